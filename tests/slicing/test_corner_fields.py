"""Stripes that every face sees in a sign and a shift of its own: the same cut as that of two plain fields."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.pattern import Flow, Frames, corner_phase
from dsfab.slicing import cut
from dsfab.slicing.cutting.corner_fields import PolygonField
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import SheetPart
from dsfab.slicing.cutting.split import SideValues, split_cells
from dsfab.surface import Surface, read_surface
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import euler_characteristic, manifold_faults
from tests.meshes import mesh_file
from tests.shapes import ZOO, grid, jittered, sphere, zoo
from tests.slicing.stripes import LEVELS, plain, regauged, ripples, widths


def trivial(surface: Surface, z: np.ndarray, d: np.ndarray) -> CornerField:
    """The same stripes at corners."""
    return CornerField(plain(z, d), np.ones((surface.m, 3)), np.zeros((surface.m, 3)), np.zeros(surface.m, bool))


def material(sheet) -> float:
    return float(sheet.surface.areas[sheet.material].sum())


def rim(surface: Surface) -> float:
    ends = surface.edges.ends[surface.edges.boundary]
    return float(np.linalg.norm(surface.V[ends[:, 0]] - surface.V[ends[:, 1]], axis=1).sum())


def check_whole(surface: Surface, sheet) -> None:
    """The cells fill the surface, and no edge of one is a part of an edge of another (T-junction)."""
    cells = sheet.surface
    assert cells.area == pytest.approx(surface.area, rel=1e-12)
    assert np.bincount(sheet.parent, cells.areas, surface.m) == pytest.approx(surface.areas, rel=1e-9)
    assert rim(cells) == pytest.approx(rim(surface), rel=1e-12, abs=1e-12 * surface.size)
    assert euler_characteristic(cells.F, cells.edges) == euler_characteristic(surface.F, surface.edges)
    assert manifold_faults(cells.F, cells.edges, cells.n) == manifold_faults(surface.F, surface.edges, surface.n) or (
        len(manifold_faults(surface.F, surface.edges, surface.n)) == 1  # a Moebius strip's seam, in more edges
    )
    assert cells.edges.count.max() <= 2
    assert sheet.carry(surface.V) == pytest.approx(cells.V, abs=1e-13 * np.abs(surface.V).max())


# --- the same cut as that of plain fields


def test_a_plate_has_stripes_of_the_exact_area():
    """z = x on 6 x 1, half width .2: six whole stripes, if two halves count as one."""
    plate = jittered(grid(12, 3, 6.0, 1.0))
    for seed in range(4):
        sheet = cut(plate, [regauged(plate, plate.V[:, 0], np.full(plate.n, 0.2), seed)], [LEVELS], 0)
        assert material(sheet) == pytest.approx(6 * 0.4, rel=1e-9)


@zoo
@pytest.mark.parametrize("snap", [0, 0.05])
def test_without_seams_the_cells_are_those_of_the_plain_band(name, snap):
    surface = ZOO[name]()
    z, d = ripples(surface, 1), widths(surface, "varying", 2)
    one, two = (cut(surface, [f], [LEVELS], snap) for f in (plain(z, d), trivial(surface, z, d)))
    assert material(two) == pytest.approx(material(one), rel=1e-9)
    assert two.surface.m == one.surface.m
    check_whole(surface, two)


@zoo
@pytest.mark.parametrize(("kind", "snap"), [("even", 0.05), ("varying", 0.05), ("varying", 0), ("tips", 0), ("any", 0)])
def test_signs_and_shifts_of_phases_do_not_change_the_cut(name, kind, snap):
    """Also where every face, and every vertex, has a sign and a shift of its own."""
    surface = ZOO[name]()
    for seed in range(2):
        z, d = ripples(surface, seed), widths(surface, kind, seed)
        sheet = cut(surface, [regauged(surface, z, d, seed)], [LEVELS], snap)
        wanted = material(cut(surface, [plain(z, d)], [LEVELS], snap))
        assert material(sheet) == pytest.approx(wanted, rel=1e-9, abs=1e-9 * surface.area)
        check_whole(surface, sheet)


@zoo
@pytest.mark.parametrize("kind", ["tips", "any", "some touching"])
def test_snapped_tips_move_by_less_than_a_thousandth_of_an_edge(name, kind):
    """Where both edges of a stripe meet they are joined within `TIP` of a side; which side, depends on who is first."""
    surface = ZOO[name]()
    z, d = ripples(surface, 3), widths(surface, kind, 4)
    sheet = cut(surface, [regauged(surface, z, d, 5)], [LEVELS], 0.05)
    assert material(sheet) == pytest.approx(material(cut(surface, [plain(z, d)], [LEVELS], 0.05)), rel=1e-3)
    check_whole(surface, sheet)


@pytest.mark.parametrize(("kind", "share"), [("none", 0), ("touching", 1)])
def test_stripes_of_zero_width_are_empty_and_touching_stripes_cover_all(kind, share):
    surface = sphere(2)
    z = ripples(surface, 3)
    for snap in (0, 0.05):
        sheet = cut(surface, [regauged(surface, z, widths(surface, kind, 0), 1)], [LEVELS], snap)
        assert material(sheet) == pytest.approx(share * surface.area, abs=1e-12)
        check_whole(surface, sheet)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.5, 12),
    st.floats(-8, 8),
    st.sampled_from(["even", "varying", "tips", "any", "some touching"]),
    st.sampled_from(["flat", "saddle", "obtuse", "closed", "moebius"]),
)
def test_any_phase_and_any_width(seed, count, bend, kind, name):
    surface = ZOO[name]()
    z, d = ripples(surface, seed, count, bend), widths(surface, kind, seed)
    sheet = cut(surface, [regauged(surface, z, d, seed)], [LEVELS], 0)
    wanted = material(cut(surface, [plain(z, d)], [LEVELS], 0))
    assert material(sheet) == pytest.approx(wanted, rel=1e-9, abs=1e-7 * surface.area)
    check_whole(surface, sheet)


@zoo
@pytest.mark.parametrize("snap", [0, 0.05])
def test_two_families_of_stripes(name, snap):
    surface = ZOO[name]()
    bands = [(ripples(surface, k, 5), widths(surface, "varying", k)) for k in (1, 2)]
    sheet = cut(surface, [regauged(surface, *band, 7) for band in bands], [LEVELS] * 2, snap)
    wanted = cut(surface, [plain(*band) for band in bands], [LEVELS] * 2, snap)
    assert material(sheet) == pytest.approx(material(wanted), rel=1e-9 if snap == 0 else 1e-5)
    assert set(np.unique(sheet.family)) == {-1, 0, 1}
    check_whole(surface, sheet)


def test_vertex_numbers_do_not_change_the_cut():
    surface = ZOO["dome"]()
    rng = np.random.default_rng(5)
    field = regauged(surface, ripples(surface, 2), widths(surface, "varying", 3), 4)
    vertices, faces, roll = rng.permutation(surface.n), rng.permutation(surface.m), rng.integers(0, 3, surface.m)
    corner = (np.arange(3) + roll[:, None]) % 3
    mixed = Surface(surface.V[vertices], np.argsort(vertices)[surface.F[faces[:, None], corner]])
    there = replace(
        field,
        x=field.x[vertices],
        sign=field.sign[faces[:, None], corner],
        shift=field.shift[faces[:, None], corner],
        blank=field.blank[faces],
    )
    for snap in (0, 0.05):
        one, two = cut(surface, [field], [LEVELS], snap), cut(mixed, [there], [LEVELS], snap)
        by_face = [np.bincount(s.parent, s.surface.areas * s.material, surface.m) for s in (one, two)]
        assert by_face[1] == pytest.approx(by_face[0][faces], abs=1e-9 * surface.area)
        assert two.surface.m == one.surface.m


# --- phases that turn over


def turned_phase(surface: Surface, along: np.ndarray, density: float):
    """A phase that grows along tangents (n, 3), as it comes, with its singular faces."""
    frames = Frames.for_surface(surface)
    tangent = along - np.einsum("ni,ni->n", along, frames.normal)[:, None] * frames.normal
    size = np.linalg.norm(tangent, axis=1)
    g = np.where(size[:, None] > 1e-9, tangent / np.maximum(size, 1e-9)[:, None], frames.t1)
    flow = Flow(frames, g, np.full(surface.n, density))
    nowhere = np.zeros(surface.n, bool)
    return corner_phase(flow, flow.solve(np.exp(-surface.V[:, 0]), nowhere))


SURFACES = {
    "sphere": lambda: sphere(3, 2.0),
    "moebius": ZOO["moebius"],
    "bob": lambda: read_surface(mesh_file("bob.obj"), "m"),
    "torus": lambda: read_surface(mesh_file("torus.obj"), "m"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SURFACES))
@pytest.mark.parametrize("snap", [0, 0.05])
def test_phases_with_singular_faces_leave_no_gap(name, snap):
    """Directions that turn by half a turn around points are seen from both sides, and faces there have no phase."""
    surface = SURFACES[name]()
    x = (surface.V - surface.V.mean(axis=0)) / surface.size
    angle = np.arctan2(x[:, 1], x[:, 0]) / 2 + x[:, 2]  # half a turn around the axis z: no sign fits all around
    along = np.stack([np.cos(angle), np.sin(angle), np.zeros(surface.n)], axis=1)
    phase = turned_phase(surface, along, 12 / surface.size)
    assert phase.singular.any()
    assert (phase.sign < 0).any()
    d = np.full(surface.n, 0.2)
    field = replace(phase.field, x=plain(phase.value, d))
    sheet = cut(surface, [field], [LEVELS], snap)
    check_whole(surface, sheet)
    by_face = np.bincount(sheet.parent, sheet.surface.areas * sheet.material, surface.m)
    inside = by_face[phase.singular] / surface.areas[phase.singular]
    assert np.minimum(inside, 1 - inside).max() < 1e-9  # whole or not at all: void, or a node of the stripes around it
    by_face[phase.singular] = 0
    z = phase.corners(surface)
    exact = np.array([stripe_share(*corners) for corners in z]) * surface.areas * ~phase.singular
    assert by_face.sum() == pytest.approx(exact.sum(), rel=1e-8 if snap == 0 else 5e-3)
    if snap == 0:
        assert by_face == pytest.approx(exact, abs=1e-8 * surface.area)


def stripe_share(*z: float, d: float = 0.2) -> float:
    """The share of a triangle where a linear phase with these corners is within d of a whole number."""
    a, b, c = sorted(z)
    levels = np.arange(np.floor(a) - 1, np.ceil(c) + 2)[:, None] + [-d, d]
    t = np.clip(levels, a, c)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (t - a) ** 2 / ((b - a) * (c - a))
        high = 1 - (c - t) ** 2 / ((c - a) * (c - b))
    below = np.where(levels <= a, 0.0, np.where(levels >= c, 1.0, np.where(t < b, low, high)))
    return float((below[:, 1] - below[:, 0]).sum())


# --- only in some openings


def halves(wanted_left: float) -> tuple[Surface, list, list]:
    """A plate with one wall at x = 3.1, .2 thick, and stripes along y that are wanted on its left by so much."""
    plate = jittered(grid(13, 7, 6.5, 2.0))
    wall = regauged(plate, (plate.V[:, 0] - 3.1) / 10, np.full(plate.n, 0.01), 1)
    stripes = regauged(plate, 2 * plate.V[:, 1] + 0.4, np.full(plate.n, 0.2), 2)
    left = plate.centroids[:, 0] < 3.1
    stripes = replace(stripes, wanted=np.where(left, wanted_left, 0.0))
    return plate, [wall, stripes], [LEVELS, LEVELS]


@pytest.mark.parametrize("snap", [0, 0.05])
def test_stripes_wanted_in_an_opening_end_on_its_walls(snap):
    plate, fields, levels = halves(1.0)
    sheet = cut(plate, fields, levels, snap)
    check_whole(plate, sheet)
    drawn = sheet.family == 1
    assert sheet.surface.centroids[drawn][:, 0].max() < 3.1
    assert sheet.surface.areas[drawn].sum() == pytest.approx(0.4 * 2 * 3.0, rel=1e-9 if snap == 0 else 0.02)
    at = sheet.surface.V[np.unique(sheet.surface.F[drawn])]
    ends = at[at[:, 0] > 2.9]
    wall = sheet.surface.V[np.unique(sheet.surface.F[sheet.family == 0])]
    assert np.abs(ends[:, 0].max() - wall[:, 0].min()) < 1e-12 + 2 * snap


def test_an_opening_decides_as_a_whole():
    """By the mean over its area: more than half of it, or nothing."""
    for share, drawn in ((0.51, True), (0.49, False), (0.0, False)):
        plate, fields, levels = halves(share)
        sheet = cut(plate, fields, levels, 0)
        assert (sheet.family == 1).any() == drawn


def test_blank_faces_are_void_and_stay_whole():
    plate = grid(6, 6, 3.0, 3.0)
    blank = np.linalg.norm(plate.centroids - [1.5, 1.5, 0], axis=1) < 0.6
    field = replace(regauged(plate, 3.3 * plate.V[:, 0] + 0.3, np.full(plate.n, 0.3), 0), blank=blank)
    noise = np.random.default_rng(1).integers(-9, 10, (plate.m, 3))
    field = replace(field, shift=np.where(blank[:, None], noise + 0.4, field.shift))
    assert 0.5 < material(cut(plate, [field], [LEVELS], 0)) / (plate.area - plate.areas[blank].sum()) < 0.7
    sheet = cut(plate, [field], [LEVELS], 0)
    check_whole(plate, sheet)
    assert not sheet.material[blank[sheet.parent]].any()
    near = blank[sheet.parent] & (sheet.surface.areas < 0.99 * plate.areas[sheet.parent])
    assert near.any()  # filled with triangles again: their neighbours' new vertices are theirs too


@zoo
def test_turned_edges_are_those_whose_polygons_disagree(name):
    """One by one: of two polygons that know, the first leads, the second may see the field turned over."""
    surface = ZOO[name]()
    field = trivial(surface, ripples(surface, 1), widths(surface, "even", 1))
    rng = np.random.default_rng(3)
    sign = np.where(rng.random((surface.m, 3)) < 0.1, -1.0, 1.0)  # corner by corner: whatever may come
    field = replace(field, sign=sign, blank=rng.random(surface.m) < 0.1)
    mesh = PolygonMesh.from_surface(surface)
    seen = PolygonField.from_field(mesh, field)
    first, second = seen.turned_edges()
    expected = np.zeros((2, 3 * surface.m), bool)
    for h, g in surface.edges.pairs.tolist():
        h, g = min(h, g), max(h, g)
        if field.blank[h // 3] or field.blank[g // 3]:
            continue
        a = surface.F.ravel()[g]
        c = h if surface.F.ravel()[h] == a else h - h % 3 + (h + 1) % 3
        if seen.sign[c] * seen.sign[g] < 0:
            expected[0, h] = expected[1, g] = True
    assert np.array_equal(first, expected[0])
    assert np.array_equal(second, expected[1])
    assert surface.m < 50 or first.any()


@zoo
def test_a_part_has_the_marked_faces_and_no_other_vertex(name):
    surface = ZOO[name]()
    mask = np.random.default_rng(0).random(surface.m) < 0.4
    mask[0] = True
    marked = SheetPart.from_cells(surface, mask)
    part = marked.surface
    assert np.array_equal(marked.cells, np.flatnonzero(mask))
    assert np.array_equal(marked.vertices, np.unique(surface.F[mask]))
    assert np.array_equal(part.V[part.F], surface.V[surface.F[mask]])
    assert part.n == len(np.unique(surface.F[mask]))
    assert np.array_equal(part.V, surface.V[np.unique(surface.F[mask])])


@zoo
def test_weights_of_a_split_stand_below_those_before(name):
    surface = ZOO[name]()
    mesh = PolygonMesh.from_surface(surface)
    x = ripples(surface, 1)
    levels = np.arange(np.floor(x.min()), np.ceil(x.max()) + 1) + 0.27
    split = split_cells(mesh.cells, surface.n, SideValues.from_vertices(mesh.cells, x), levels, mesh.void)
    new = mesh.after_split(split)
    assert len(new.X) > surface.n
    assert new.weights.shape == (len(new.X), surface.n)
    assert (np.diff(new.weights.indptr)[surface.n :] == 2).all()
    np.testing.assert_allclose(new.weights @ surface.V, new.X, atol=1e-12 * surface.size)
    np.testing.assert_allclose((new.weights @ x)[surface.n :], split.level, atol=1e-12 * np.abs(x).max())


def test_connected_parts_follow_shared_sides():
    plate = grid(4, 1, 4.0, 1.0)
    mesh = PolygonMesh.from_surface(plate)
    part = mesh.part_labels(np.abs(plate.centroids[:, 0] - 2) > 1)
    assert (part[np.abs(plate.centroids[:, 0] - 2) < 1] == -1).all()
    assert len(set(part.tolist())) == 3
    for left in (True, False):
        assert len(set(part[(plate.centroids[:, 0] < 1) if left else (plate.centroids[:, 0] > 3)].tolist())) == 1
