"""Thickening: closed forms and their rates, laws over a zoo, real surfaces, repairs, refusals."""

from collections.abc import Callable
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from dsfab.core.errors import SolidError
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import boundary_loops, euler_characteristic, pieces, pinches
from dsfab.thickening import Solid, offsets, thicken
from dsfab.thickening.offset_vectors import prism_jacobians, visible_normals
from dsfab.thickening.repair import repair_skin
from dsfab.thickening.self_intersection import intersecting_pairs, pairs_after_moves
from dsfab.thickening.skin import Skin
from dsfab.thickening.solid import check_solid
from tests.shapes import ZOO, annulus, folded, grid, lifted, sphere, stacked, tube, zoo
from tests.thickening.thick_solids import cgal_pairs, check_second_order, check_sound, made, real


def kept(surface: Surface, faces: np.ndarray) -> np.ndarray:
    """The marked faces, and all those around vertices where they would meet in a point only."""
    faces = faces.copy()
    while len(bad := pinches(surface.F[faces], Surface(surface.V, surface.F[faces]).edges, surface.n)):
        faces |= np.isin(surface.F, bad).any(axis=1)
    return faces


def ragged(surface: Surface, seed: int, share: float = 0.5) -> Surface:
    """A surface with random faces missing; vertices without faces stay."""
    random = np.random.default_rng(seed).random(surface.m) < share
    return Surface(surface.V, surface.F[kept(surface, random)])


# ---------------------------------------------------------------- closed forms


def test_a_plate_has_its_area_times_its_thickness():
    plate = ZOO["flat"]()
    solid = made(plate, 0.03)
    assert solid.volume == pytest.approx(2.0 * 0.03, rel=1e-13)
    assert solid.area == pytest.approx(2 * 2.0 + 6.0 * 0.03, rel=1e-12)
    assert np.allclose(solid.box, [[0, 0, -0.015], [2, 1, 0.015]], atol=1e-15)
    assert (solid.genus, solid.pieces, solid.notes) == (0, 1, ())
    check_sound(solid)


def test_a_ring_has_one_handle():
    ring = annulus(24, 4)
    solid = made(ring, 0.05)
    assert solid.volume == pytest.approx(ring.area * 0.05, rel=1e-7)  # vertices are rounded
    assert (solid.genus, solid.pieces) == (1, 1)
    check_sound(solid)


def shell_volume(radius: float, t: float) -> float:
    return 4 / 3 * np.pi * ((radius + t / 2) ** 3 - (radius - t / 2) ** 3)


def test_a_spherical_shell_converges_to_its_volume():
    exact = shell_volume(2.0, 0.4)
    check_second_order([made(sphere(k, 2.0), 0.4).volume / exact - 1 for k in (2, 3, 4)], 5e-3)


def test_a_tube_converges_to_its_volume():
    exact = np.pi * (1.1**2 - 0.9**2) * 2.0
    solids = [made(tube(cells, max(2, cells // 4)), 0.2) for cells in (16, 32, 64)]
    check_second_order([s.volume / exact - 1 for s in solids], 5e-3)
    assert {s.genus for s in solids} == {1}
    check_sound(solids[-1])


def test_a_shell_of_a_sphere_is_one_piece_between_two_spheres():
    solid = made(sphere(3), 0.1)
    assert (solid.genus, solid.pieces) == (0, 1)
    assert pieces(solid.F, Surface(solid.V, solid.F).edges)[0] == 2
    check_sound(solid)


def test_a_sphere_turned_inside_out_gives_the_same_shell():
    ball = sphere(3)
    turned = made(Surface(ball.V, ball.F[:, ::-1]), 0.1)
    assert turned.volume == pytest.approx(made(ball, 0.1).volume, rel=1e-12)
    check_sound(turned)


def test_genus_counts_the_boundary_loops_of_every_piece():
    """An orientable piece with boundary and Euler characteristic chi gives 1 - chi handles."""
    ring = annulus(24, 4)
    sheet = Surface(*(lambda s: (s.V, s.F))(stacked(ring, 1.0)))
    punched = Surface(sheet.V, sheet.F[kept(sheet, np.arange(sheet.m) % 31 != 5)])
    count, _ = pieces(punched.F, punched.edges)
    solid = made(punched, 0.02)
    assert (solid.pieces, count) == (2, 2)
    assert solid.genus == count - euler_characteristic(punched.F, punched.edges)
    assert solid.genus == len(boundary_loops(punched.F, punched.edges)) - count  # flat: no handles of its own
    check_sound(solid)


# ---------------------------------------------------------------- offset vectors


def test_offsets_on_a_plate_are_half_the_thickness_upward():
    found = offsets(ZOO["flat"](), 0.03)
    assert np.allclose(found.D, [0, 0, 0.015], atol=1e-15)
    assert (found.limited, found.smallest) == (0, 1.0)


@pytest.mark.parametrize("opening", [60, 90, 150])
def test_thickness_at_a_crease_is_measured_normal_to_the_faces(opening):
    fold = folded(opening)
    D = offsets(fold, 0.01).D
    assert np.einsum("mvi,mi->mv", D[fold.F], fold.normals) == pytest.approx(0.005, rel=1e-3)


def test_a_mitre_is_at_most_twice_as_long():
    length = np.linalg.norm(offsets(folded(20), 1e-4).D, axis=1)
    assert length.max() == pytest.approx(2 * 0.5e-4, rel=1e-12)


@pytest.mark.parametrize(
    ("surface", "largest"),
    [(tube(48, 12, 0.1, 0.5), 0.8), (sphere(4, 0.1), 1 - np.sqrt(0.2))],
    ids=["tube: 1 - d/R", "sphere: (1 - d/R)^2"],
)
def test_offsets_end_before_the_centre_of_curvature(surface, largest):
    """A straight-sided prism shrinks by 1 - d/R per curved direction; 0.2 of it must be left, in steps of 0.85."""
    found = offsets(surface, 0.4)
    length = np.linalg.norm(found.D, axis=1) / 0.1
    assert length.max() <= largest + 0.01
    assert length.min() >= 0.85 * 0.85 * largest - 0.01
    assert found.limited == surface.n
    assert found.smallest == pytest.approx(length.min() * 0.1 / 0.2, rel=0.02)
    check_sound(thicken(surface, found.D))


def at_corners(surface: Surface) -> np.ndarray:
    return np.repeat(surface.normals[:, None], 3, axis=1)


@zoo
def test_limited_prisms_do_not_fold_over(name):
    surface = ZOO[name]()
    C, _ = prism_jacobians(surface.V[surface.F], offsets(surface, 0.3 * surface.size).at_corners(surface.F))
    assert C.min() > 0


@pytest.mark.parametrize("seed", range(4))
def test_visible_normals_are_nearly_optimal(seed):
    """Against the best of many directions, on random cones of unequal triangles."""
    random = np.random.default_rng(seed)
    turn = np.sort(random.uniform(0, 2 * np.pi, 7))[np.argsort(np.arange(7))] + np.arange(7) * 1e-2
    rim = np.c_[np.cos(turn), np.sin(turn), random.uniform(-1, 1, 7)] * random.uniform(0.5, 1.5, (7, 1))
    cone = Surface(np.r_[[[0, 0, 0.7]], rim], [[0, 1 + k, 1 + (k + 1) % 7] for k in range(7)])
    directions = np.array(sphere(6).V)
    best = (directions @ cone.normals.T).min(axis=1).max()
    N = visible_normals(cone, np.ones((7, 3)), at_corners(cone))
    assert np.linalg.norm(N, axis=1) == pytest.approx(1)
    if best > 0.05:
        assert (N[0] @ cone.normals.T).min() >= 0.95 * best


def test_a_vertex_that_no_direction_sees_gets_the_mean_normal():
    """A needle folded back on itself: at its tip no direction sees all three faces."""
    spike = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, -1e-3, -1e-3]], [[0, 1, 2], [1, 0, 3], [0, 2, 3], [2, 1, 3]])
    N = visible_normals(spike, np.ones((4, 3)), at_corners(spike))
    unseen = np.unique(spike.F[np.einsum("mvi,mi->mv", N[spike.F], spike.normals) <= 0])
    assert len(unseen) > 0
    for vertex in unseen:
        mean = spike.normals[(vertex == spike.F).any(axis=1)].mean(axis=0)
        assert N[vertex] @ mean == pytest.approx(np.linalg.norm(mean))


def test_a_vertex_without_a_mean_normal_gets_that_of_a_face():
    """Two faces back to back: their normals cancel."""
    pillow = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]])
    D = offsets(pillow, 0.01).D
    assert np.abs(D[:, 2]).min() > 0
    assert not D[:, :2].any()


def test_vertices_without_faces_get_no_offset_and_do_not_reach_the_solid():
    plate = grid(4, 4, 1.0, 1.0)
    loose = Surface(np.concatenate([[[5.0, 5, 5]], plate.V]), plate.F + 1)
    found = offsets(loose, 0.1)
    assert not found.D[0].any()
    solid = thicken(loose, found.D)
    assert len(solid.V) == 2 * plate.n
    check_sound(solid)


# ---------------------------------------------------------------- laws


SHAPES: dict[str, tuple[Callable[[], Surface], float]] = {
    **{name: (make, 0.02) for name, make in ZOO.items()},
    "right angle": (lambda: folded(90), 0.02),
    "nearly closed": (lambda: folded(8), 0.01),
    "coarse saddle": (lambda: lifted(lambda x, y: 2 * (x - 0.5) * (y - 0.5), cells=3), 0.05),
    "two spheres": (lambda: stacked(sphere(2), 3.0), 0.02),
    "ragged dome": (lambda: ragged(lifted(lambda x, y: 8 * x * (1 - x) * y * (1 - y), cells=20), 3), 0.01),
    "ragged sphere": (lambda: ragged(sphere(4), 5), 0.03),
}


@pytest.mark.parametrize("name", list(SHAPES))
def test_every_shape_becomes_a_sound_solid(name):
    make, share = SHAPES[name]
    surface = make()
    t = share * surface.size / 2
    solid = made(surface, t)
    if name == "nearly closed":
        assert 0.5 < solid.volume / (surface.area * t) < 1  # the sides share room near the crease
    else:
        assert solid.volume == pytest.approx(surface.area * t, rel=0.02)
    count, _ = pieces(surface.F, surface.edges)
    closed = not surface.edges.boundary.any()
    assert solid.pieces == count
    assert solid.genus == (0 if closed else count - euler_characteristic(surface.F, surface.edges))
    check_sound(solid)


def test_the_same_sheet_gives_the_same_bytes():
    sheet = ragged(sphere(4), 2)
    one, two = made(sheet, 0.05), made(Surface(sheet.V, sheet.F), 0.05)
    assert one.V.tobytes() == two.V.tobytes()
    assert one.F.tobytes() == two.F.tobytes()
    assert one.notes == two.notes


def test_a_solid_cannot_be_changed():
    solid = made(grid(2, 2, 1.0, 1.0), 0.1)
    for array in (solid.V, solid.F, solid.box, offsets(grid(2, 2, 1.0, 1.0), 0.1).D):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError):
        solid.genus = 1  # type: ignore[misc]


def test_volume_keeps_its_digits_far_from_the_origin():
    plate = grid(5, 5, 1.0, 1.0)
    assert made(Surface(plate.V + 1e4, plate.F), 0.01).volume == pytest.approx(0.01, rel=1e-8)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    points=st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=8, max_size=60, unique=True),
    bend=st.floats(-0.3, 0.3),
    twist=st.floats(-0.3, 0.3),
    t=st.floats(0.002, 0.02),
)
def test_random_gentle_sheets_become_sound_solids(points, bend, twist, t):
    xy = np.concatenate([np.array(points) / 40, [[-0.1, -0.1], [1.1, -0.1], [1.1, 1.1], [-0.1, 1.1]]])
    F = Delaunay(xy).simplices
    V = np.c_[xy, bend * xy[:, 0] ** 2 + twist * xy[:, 0] * xy[:, 1]]
    (ax, ay), (bx, by) = (xy[F[:, 1]] - xy[F[:, 0]]).T, (xy[F[:, 2]] - xy[F[:, 0]]).T
    up = ax * by - ay * bx
    sheet = Surface(V, np.where((up > 0)[:, None], F, F[:, ::-1])[np.abs(up) > 1e-9])
    found = offsets(sheet, t)
    solid = thicken(sheet, found.D)
    check_sound(solid)
    assert solid.volume == pytest.approx(sheet.area * t, rel=0.02 if not (found.limited or solid.notes) else 0.3)


# ---------------------------------------------------------------- real surfaces


@pytest.mark.parametrize(
    ("name", "share", "genus", "tolerance"),
    [
        ("bob", 0.01, 2, 0.005),  # a torus sheet: two tori around the material
        ("spot", 0.005, 0, 0.005),
        ("hypar", 0.02, 0, 0.01),
        ("roof_with_opening", 0.02, 1, 0.01),
        ("Botanic", 0.02, 0, 0.005),
    ],
)
def test_a_real_surface_becomes_a_sound_solid(name, share, genus, tolerance):
    surface = real(name)
    t = share * surface.size / 2
    solid = made(surface, t)
    assert solid.notes == ()
    assert (solid.genus, solid.pieces) == (genus, 1)
    assert solid.volume == pytest.approx(surface.area * t, rel=tolerance)
    check_sound(solid)


def test_a_real_surface_that_bends_too_tightly_is_thinned_with_a_note():
    surface = real("bob")
    found = offsets(surface, 0.1 * surface.size / 2)
    assert 0 < found.limited < 0.2 * surface.n
    assert 0.05 <= found.smallest < 0.5
    solid = thicken(surface, found.D)
    assert any("thinned" in note for note in solid.notes)
    check_sound(solid)


def test_a_ragged_part_of_a_real_surface_becomes_a_sound_solid():
    surface = real("bob")
    found = offsets(surface, 0.02 * surface.size / 2)
    sheet = ragged(surface, 1)
    solid = thicken(sheet, found.D)
    assert solid.genus > 100
    assert solid.volume == pytest.approx(sheet.area * 0.02 * surface.size / 2, rel=0.01)
    check_sound(solid)


# ---------------------------------------------------------------- the exact test


@pytest.mark.parametrize("scale", [1.0, 2.0**-20, 2.0**10])
@pytest.mark.parametrize("flat", [False, True], ids=["in space", "in one plane"])
def test_intersecting_pairs_are_those_of_cgal_at_every_scale(scale, flat):
    total = 0
    for seed in range(6):
        shape = sphere(2) if seed % 2 and not flat else grid(9, 9, 1.0, 1.0)
        jitter = np.random.default_rng(seed).normal(size=shape.V.shape) * ([1, 1, 0] if flat else [1, 1, 1])
        V = scale * (shape.V + (0.05 if flat else 0.1) * jitter)
        expected = cgal_pairs(V, shape.F)
        pairs = intersecting_pairs(V, shape.F)
        assert {tuple(pair) for pair in pairs} == expected
        assert np.array_equal(pairs, np.unique(pairs, axis=0))  # libigl gives them in the order of its threads
        total += len(expected)
    assert total > 20


def test_overlapping_neighbours_in_one_plane_are_found_by_their_angles():
    """Around the origin, angles 0..60 and 30..90 degrees overlap, 0..60 and 60..90 without a common vertex touch."""
    turn = np.radians([0, 60, 30, 90, 60, 120])
    ring = np.c_[np.cos(turn), np.sin(turn), 0 * turn] * np.array([[1, 1, 1, 1, 2, 1]]).T
    V = np.concatenate([[[0, 0, 0]], ring])
    for other, meets in ([3, 4], True), ([5, 6], True), ([4, 6], False):
        assert len(intersecting_pairs(V, np.array([[0, 1, 2], [0, *other]]))) == meets


def test_a_face_folded_back_onto_its_neighbour_is_found():
    V = np.array([[0, 0, 0], [1, 0, 0], [0.4, 1, 0], [0.5, 0.5, 0], [0.5, -1, 0], [0.5, 0.5, 1e-9]])
    for apex, meets in (3, True), (4, False), (5, False):
        assert len(intersecting_pairs(V, np.array([[0, 1, 2], [1, 0, apex]]))) == meets


# ---------------------------------------------------------------- repairs


def test_sheets_closer_than_their_thickness_are_thinned_until_separate():
    plate = grid(4, 4, 1.0, 1.0)
    solid = made(stacked(plate, 0.07), 0.1)
    check_sound(solid)
    assert 0.3 * 0.2 < solid.volume < 0.14  # as much as fits between their middles and outside, 0.5 * (0.07 + 0.1) each
    (note,) = solid.notes
    assert "met itself in " in note
    assert "was thinned at " in note
    assert solid.repairs.lost == pytest.approx(1 - solid.volume / 0.2, rel=1e-9)
    assert f"the sheet lost {solid.repairs.lost:.2%} of its volume" in note


def test_sheets_much_closer_than_their_thickness_become_films_with_a_note():
    solid = made(stacked(grid(2, 2, 1.0, 1.0), 0.02), 0.1)
    check_sound(solid)
    assert (solid.repairs.rung, solid.repairs.pairs) == ("thinned", 0)
    assert 0.1 < solid.repairs.thinnest < 0.2  # half of each may fill half of 0.02
    assert solid.repairs.lost == pytest.approx(1 - solid.volume / 0.2, rel=1e-9)


def test_flipping_the_diagonal_of_a_wall_avoids_thinning():
    """A twisted wall bulges to y = 0.3 over one diagonal and to -0.3 over the other; a tip waits at y = 0.05."""
    V = [[0, 0, 0], [0.5, -1, 0], [1, 0, 0], [0.5, 0.05, 0], [0.6, 1, 0], [0.4, 1, 0]]
    D = np.array([[0.1, 0.3, 0.5], [0, 0, 0.5], [0, -0.3, 0.5], *[[0, 0, 0.02]] * 3])
    sheet = Surface(V, [[0, 1, 2], [3, 4, 5]])
    skin = Skin.from_surface(sheet)
    before = skin.shorter_diagonals(sheet.V, D)
    pairs = intersecting_pairs(skin.vertices(sheet.V, D), skin.faces(before))
    assert len(pairs) > 0
    repaired = repair_skin(sheet, skin, D)
    assert len(repaired.pairs) == 0
    assert repaired.found == len(pairs)
    assert repaired.D is D
    assert (repaired.backslash != before).any()
    solid = thicken(sheet, D)
    assert solid.notes == ()
    check_sound(solid)


def test_sheets_that_cannot_be_parted_give_a_note():
    plate = grid(2, 2, 1.0, 1.0)
    solid = made(stacked(plate, 1e-4), 0.1)
    left = intersecting_pairs(np.array(solid.V), np.array(solid.F))
    assert len(left) > 0
    assert any(
        f"{len(left)} pairs of faces of the solid still intersect" in n and "closer together" in n for n in solid.notes
    )


def test_a_surface_that_crosses_itself_is_refused_with_its_place(monkeypatch):
    """Where it could not be united."""
    monkeypatch.setattr("dsfab.thickening.repair.prism_union", lambda *_: None)
    plate = grid(4, 4, 1.0, 1.0)
    wall = np.c_[plate.V[:, 0] * 0 + 0.43, plate.V[:, 1] + 0.013, plate.V[:, 0] - 0.47]
    both = Surface(np.concatenate([plate.V, wall]), np.concatenate([plate.F, plate.F + plate.n]))
    note = made(both, 0.02).notes[-1]
    assert "still intersect" in note
    assert "crosses itself" in note
    x, _, z = (float(c) for c in note.split("near (")[1].split(")")[0].split(","))
    assert x == pytest.approx(0.43, abs=0.3)
    assert abs(z) < 0.3


def test_details_below_single_precision_give_a_note():
    plate = grid(4, 4, 1e-3, 1e-3)
    far = Surface(plate.V + np.array([1e4, 0, 0]), plate.F)
    (note,) = made(far, 1e-4).notes
    assert "collapse in files of single precision" in note
    assert "near (1e+04, " in note


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize("thickness", [0.0, -0.01, float("nan"), float("inf")])
def test_a_thickness_that_cannot_be_built_is_refused(thickness):
    with pytest.raises(SolidError, match=r"thickness = .* positive"):
        offsets(grid(2, 2, 1.0, 1.0), thickness)


def three_pages() -> Surface:
    return Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0.5]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])


def one_face_turned() -> Surface:
    plate = grid(3, 3, 1.0, 1.0)
    F = plate.F.copy()
    F[4] = F[4, ::-1]
    return Surface(plate.V, F)


@pytest.mark.parametrize(
    ("surface", "told"),
    [
        (three_pages(), r"more than two faces at 1 edge \(first, by vertices: 0-1\)"),
        (one_face_turned(), r"two faces at [23] edges .* opposite sides \(first, by vertices: \d+-\d+"),
    ],
    ids=["three faces on an edge", "one face turned over"],
)
def test_a_surface_that_is_no_oriented_manifold_is_refused(surface, told):
    with pytest.raises(SolidError, match=told):
        offsets(surface, 0.01)


def test_a_contact_in_a_point_is_refused():
    plate = grid(2, 2, 1.0, 1.0)
    corners = Surface(plate.V, plate.F[np.isin(plate.F, [0, 8]).any(axis=1) & ~np.isin(plate.F, [1, 5]).all(axis=1)])
    bow = Surface([[0, 0, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    assert corners.m > 0
    with pytest.raises(SolidError, match=r"touch only in points, at 1 vertex \(first: 0\)"):
        thicken(bow, offsets(bow, 0.1).D)


def test_wrong_offset_vectors_are_refused():
    plate = grid(2, 2, 1.0, 1.0)
    D = np.array(offsets(plate, 0.1).D)
    with pytest.raises(SolidError, match=r"shape \(3, 3\)"):
        thicken(plate, D[:3])
    for value in (0.0, np.nan):
        bad = D.copy()
        bad[[2, 5]] = value
        with pytest.raises(SolidError, match=r"2 offset vectors are zero or not finite \(first: 2, 5\)"):
            thicken(plate, bad)


def test_offset_vectors_to_the_back_of_a_piece_are_refused():
    sheet = stacked(grid(3, 3, 1.0, 1.0), 1.0)
    D = np.array(offsets(sheet, 0.1).D)
    D[16:] *= -1
    with pytest.raises(SolidError, match=r"back of 1 of 2 pieces .* face 18"):
        thicken(sheet, D)


def test_every_solid_is_judged(monkeypatch):
    monkeypatch.setattr("dsfab.thickening.solid.VOLUME_TOLERANCE", -1.0)
    with pytest.raises(SolidError, match="manifold3d measures"):
        made(grid(2, 2, 1.0, 1.0), 0.1)


def test_an_open_mesh_is_rejected_with_the_name_of_the_status():
    solid = made(grid(2, 2, 1.0, 1.0), 0.1)
    with pytest.raises(SolidError, match="NotManifold"):
        check_solid(Solid(solid.V, solid.F[1:], 0, 1))


def test_a_solid_inside_out_is_rejected():
    solid = made(grid(2, 2, 1.0, 1.0), 0.1)
    with pytest.raises(SolidError, match="not positive"):
        check_solid(Solid(solid.V, solid.F[:, ::-1], 0, 1))


def test_a_volume_that_manifold3d_does_not_measure_is_rejected():
    solid = made(grid(2, 2, 1.0, 1.0), 0.1)
    solid.__dict__["volume"] = 0.1001
    with pytest.raises(SolidError, match=r"0\.1001 m3, but manifold3d measures 0\.1 m3"):
        check_solid(solid)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), some=st.floats(0.001, 0.4), far=st.floats(1e-3, 0.6))
def test_pairs_after_moves_are_those_of_the_whole_mesh(seed, some, far):
    ball, rng = sphere(3), np.random.default_rng(seed)
    V = ball.V + 0.05 * rng.normal(size=ball.V.shape)
    before = intersecting_pairs(V, ball.F)
    moved = rng.random(ball.n) < some
    V = np.where(moved[:, None], V + far * rng.normal(size=V.shape), V)
    after = pairs_after_moves(V, ball.F, before, moved)
    assert np.array_equal(after, intersecting_pairs(V, ball.F))
    assert pairs_after_moves(V, ball.F, after, np.zeros(ball.n, dtype=bool)) is after


@pytest.mark.parametrize(("error", "is_refused"), [(2.5e-9, False), (5e-9, True)])
def test_two_volumes_of_a_solid_may_differ_by_rounding(error, is_refused):
    """A plate of 1 x 1 x .1 m: a billionth of its area times its size is 3.4e-9 m3."""
    solid = made(grid(2, 2, 1.0, 1.0), 0.1)
    solid.__dict__["volume"] = 0.1 + error
    with pytest.raises(SolidError, match="manifold3d measures") if is_refused else nullcontext():
        check_solid(solid)
