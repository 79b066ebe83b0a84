"""Thickening of sheets with one side, on one side, of graded thickness; measured thickness; what is told or refused."""

from pathlib import Path

import igl
import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.core.errors import DsfabError, SolidError
from dsfab.report.design.facts import design_facts
from dsfab.slicing import cut, resolve_pinches
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import edge_table, euler_characteristic, misoriented_edges, pieces
from dsfab.thickening import Side, offsets, thicken
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import Skin
from dsfab.thickening.union import Overlap, prism_part
from tests.shapes import (
    ZOO,
    annulus,
    folded,
    grid,
    joined,
    lifted,
    moebius,
    projective_plane,
    sphere,
    stacked,
    torus,
    with_mixed_sides,
)
from tests.thickening.thick_solids import check_second_order, check_sound, made, real


def strip_area(width: float, cells: int = 800) -> float:
    """Area of the smooth strip of `moebius`: the sum of |dX/du x dX/ds| over the middles of many cells."""
    u, s = np.meshgrid((np.arange(cells) + 0.5) / cells * 2 * np.pi, (np.arange(200) + 0.5) / 200 - 0.5)
    s, r = width * s, 1 + width * s * np.cos(u / 2)
    return float(np.sqrt((s / 2) ** 2 + r**2).sum() * 2 * np.pi / cells * width / 200)


# ---------------------------------------------------------------- one side only


def test_a_moebius_strip_becomes_one_ring_whose_volume_converges():
    """Its walls and both skins are one surface, that of a solid ring: genus 1, volume area x t but for t^3 K / 12."""
    solids = [made(moebius(cells, cells // 10, 0.8), 0.005) for cells in (40, 80, 160)]
    assert {(s.genus, s.pieces) for s in solids} == {(1, 1)}
    assert all(pieces(s.F, Surface(s.V, s.F).edges)[0] == 1 for s in solids)
    exact = 0.005 * strip_area(0.8)
    check_second_order([s.volume / exact - 1 for s in solids], 1e-3)
    check_sound(solids[1])


def test_the_solid_of_a_one_sided_strip_does_not_depend_on_face_orientation():
    one, two = made(moebius(), 0.05), made(with_mixed_sides(moebius())[0], 0.05)
    assert two.volume == pytest.approx(one.volume, rel=1e-12)
    assert np.allclose(one.box, two.box)
    check_sound(two)


def test_a_sheet_whose_faces_are_turned_at_random_is_thickened_all_the_same():
    """As a cut part of a strip may be: its vectors are seen from the first face around each vertex."""
    ring, (mixed, flips) = annulus(24, 4), with_mixed_sides(annulus(24, 4))
    D = np.array(offsets(ring, 0.05).D)
    first = np.full(ring.n, -1)
    first[mixed.F[::-1].ravel()] = np.repeat(np.arange(ring.m)[::-1], 3)
    solid = thicken(mixed, np.where(flips[first][:, None], -D, D))
    assert solid.volume == pytest.approx(made(ring, 0.05).volume, rel=1e-12)
    assert (solid.genus, solid.pieces) == (1, 1)
    check_sound(solid)
    with pytest.raises(SolidError, match="opposite sides"):
        offsets(mixed, 0.05)


def test_the_solid_of_the_closed_projective_plane_is_a_sphere():
    """Its double cover is a sphere, before what crosses is united."""
    boy = projective_plane()
    skin = Skin.from_surface(boy)
    F = skin.faces(np.zeros(0, dtype=bool))
    assert len(np.unique(F)) == 2 * boy.n
    assert pieces(F, edge_table(F))[0] == 1
    assert euler_characteristic(F, edge_table(F)) == 2
    assert not len(misoriented_edges(F, edge_table(F)))


@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_a_strip_cut_into_stripes_is_sound(phase):
    """Vectors reach the sheet by its cells: seen from a face, they stay half a thickness off its plane."""
    strip, t = moebius(120, 12, 0.8), 0.01
    field = np.sin(3 * strip.V[:, 0] + 2 * strip.V[:, 1] + strip.V[:, 2])
    sheet = resolve_pinches(cut(strip, [field], [np.linspace(-2, 2, 14) + 0.3 * phase]), t / 2).sheet.subset()
    offset = offsets(strip, t)
    D = sheet.carry_corners(offset.at_corners(strip.F), strip.F)
    assert np.linalg.norm(D, axis=1) == pytest.approx(t / 2, rel=0.02)
    solid = thicken(sheet.surface, D)
    assert solid.volume == pytest.approx(sheet.surface.area * t, rel=0.002)
    count, _ = pieces(sheet.surface.F, sheet.surface.edges)
    assert solid.genus == count - euler_characteristic(sheet.surface.F, sheet.surface.edges)
    check_sound(solid)


def test_carrying_from_corners_is_carrying_where_sides_agree():
    dome = ZOO["dome"]()
    sheet = cut(dome, [dome.V[:, 0]], [np.linspace(0.1, 0.9, 6)]).subset()
    x = np.random.default_rng(0).normal(size=(dome.n, 3))
    assert np.allclose(sheet.carry_corners(x[dome.F], dome.F), sheet.carry(x), atol=1e-14)


def preset(path: Path, surface: Surface, changes: dict) -> dsfab.Preset:
    """A surface from a file, held at its left end, under its weight."""
    path.write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in surface.V.tolist())
        + "".join(f"f {a} {b} {c}\n" for a, b, c in (surface.F + 1).tolist())
    )
    toml = path.with_suffix(".toml")
    toml.write_text(
        f"""name = "mesh"
        surface.file = "{path.name}"
        surface.unit = "m"
        surface.support = [{{ at = {{ pick = "side", axis = "x", end = "min", depth = 0.3 }} }}]
        surface.load = [{{ kind = "self_weight" }}]
        statics.thickness = 0.01
        pattern.major.frequency = 12
        pattern.minor.frequency = 12
        """
    )
    return dsfab.load_preset(str(toml), changes)


def test_a_strip_goes_through_the_whole_line_from_a_file(tmp_path):
    design = dsfab.run(preset(tmp_path / "strip.obj", with_mixed_sides(moebius(90, 10, 0.8))[0], {}))
    solid, sheet = design.solid, design.sheet.surface
    assert len(misoriented_edges(design.surface.F, design.surface.edges)) > 0
    assert 0.2 < sheet.area / design.surface.area < 0.9
    assert solid.volume == pytest.approx(sheet.area * 0.01, rel=0.005)
    assert solid.genus == len(design.slicing.pieces) - euler_characteristic(sheet.F, sheet.edges)
    assert solid.genus > 10
    assert solid.repairs.pairs == 0
    check_sound(solid)


# ---------------------------------------------------------------- one side of the sheet


@pytest.mark.parametrize(("side", "low", "high"), [("mid", -0.015, 0.015), ("out", 0, 0.03), ("in", -0.03, 0)])
def test_a_plate_lies_on_the_requested_side(side: Side, low, high):
    plate = ZOO["flat"]()
    solid = thicken(plate, offsets(plate, 0.03, side).D, side)
    assert np.allclose(solid.box[:, 2], [low, high], atol=1e-15)
    assert solid.volume == pytest.approx(0.06, rel=1e-12)
    check_sound(solid)


@pytest.mark.parametrize(("side", "inner", "outer"), [("out", 2.0, 2.4), ("in", 1.6, 2.0)])
def test_a_shell_outside_or_inside_of_a_sphere_converges_to_its_volume(side: Side, inner, outer):
    exact = 4 / 3 * np.pi * (outer**3 - inner**3)
    solids = [thicken(s := sphere(k, 2.0), offsets(s, 0.4, side).D, side) for k in (2, 3, 4)]
    check_second_order([solid.volume / exact - 1 for solid in solids], 6e-3)
    radius = np.linalg.norm(solids[-1].V, axis=1)
    assert (radius.min(), radius.max()) == pytest.approx((inner, outer), rel=2e-3)
    check_sound(solids[-1])


def test_the_side_that_bends_away_is_not_limited():
    """Inside a ball of radius 0.1 there is no room for 0.15; outside there is."""
    ball = sphere(4, 0.1)
    inside, outside = offsets(ball, 0.15, "in"), offsets(ball, 0.15, "out")
    assert (inside.limited, outside.limited) == (ball.n, 0)
    for side, found in (("in", inside), ("out", outside)):
        check_sound(thicken(ball, found.D, side))


@pytest.mark.parametrize("side", ["out", "in"])
def test_one_side_of_a_surface_that_has_no_other_is_refused(side):
    with pytest.raises(SolidError, match=f'side = "{side}" is impossible on a one-sided surface'):
        offsets(moebius(), 0.01, side)


# ---------------------------------------------------------------- graded thickness


def test_a_wedge_has_the_volume_of_a_wedge():
    plate = grid(6, 4, 2.0, 1.0)
    t = 0.01 + 0.02 * plate.V[:, 0]
    found = offsets(plate, t)
    assert 2 * found.D[:, 2] == pytest.approx(t, rel=1e-13)
    solid = thicken(plate, found.D)
    assert solid.volume == pytest.approx(0.01 * 2 + 0.02 * 2, rel=1e-7)  # vertices are rounded
    check_sound(solid)


def test_a_dome_graded_from_foot_to_top_converges_to_the_integral():
    """Over a plate lifted by nothing at its rim: volume = integral of the thickness over the surface."""
    errors = []
    for k in (2, 3, 4):
        ball = sphere(k)
        errors.append(made_graded(ball, 0.02 + 0.01 * ball.V[:, 2] ** 2).volume / exact_graded() - 1)
    check_second_order(errors, 5e-3)


def made_graded(surface: Surface, t: np.ndarray):
    return thicken(surface, offsets(surface, t).D)


def exact_graded() -> float:
    """Integral over the unit sphere of t + t^3 / 12, t = 0.02 + 0.01 z^2, by Gauss points in z."""
    z, w = np.polynomial.legendre.leggauss(20)
    t = 0.02 + 0.01 * z**2
    return float(2 * np.pi * (w * (t + t**3 / 12)).sum())


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_thickness_that_is_not_positive_somewhere_is_refused(value):
    t = np.full(9, 0.1)
    t[[2, 5]] = value
    with pytest.raises(SolidError, match=r"not a positive number at 2 vertices \(first: 2, 5\)"):
        offsets(grid(2, 2, 1.0, 1.0), t)


def test_a_thickness_of_the_wrong_shape_is_refused():
    with pytest.raises(SolidError, match=r"shape \(4,\); give one number, or one for each of 9 vertices"):
        offsets(grid(2, 2, 1.0, 1.0), np.full(4, 0.1))


# ---------------------------------------------------------------- measured thickness


def wave() -> Surface:
    return lifted(lambda x, y: 0.15 * np.sin(5 * x) * np.cos(4 * y), cells=40)


def measured(surface: Surface, t: float, side: Side = "mid") -> np.ndarray:
    """(m,) distance from the middle of each upper face to the lower skin, by libigl."""
    solid = thicken(surface, offsets(surface, t, side).D, side)
    upper, lower = solid.F[: surface.m], solid.F[surface.m : 2 * surface.m]
    squared, _, _ = igl.point_mesh_squared_distance(solid.V[upper].mean(axis=1), np.array(solid.V), lower.copy())
    return np.sqrt(squared)


@pytest.mark.parametrize(
    ("make", "side"),
    [(make, side) for make in (lambda: sphere(4), wave) for side in ("mid", "out", "in")]
    + [(lambda: moebius(160, 16, 0.8), "mid")],
)
def test_the_measured_thickness_is_the_requested_thickness(make, side: Side):
    surface = make()
    seam = surface.V[surface.edges.ends[misoriented_edges(surface.F, surface.edges)]].reshape(-1, 3)
    away = np.linalg.norm(surface.centroids[:, None] - seam, axis=2).min(axis=1, initial=np.inf) > 0.06
    assert away.sum() > 0.9 * surface.m  # over a seam the lower skin goes on as the upper one
    assert measured(surface, 0.02, side)[away] == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize("side", ["mid", "out", "in"])
def test_the_thickness_of_a_fold_is_exact_away_from_its_crease(side: Side):
    fold = folded(90, 20)
    away = np.abs(fold.centroids[:, [0, 2]]).max(axis=1) > 0.1
    assert away.sum() > 0.8 * fold.m
    assert measured(fold, 0.02, side)[away] == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize(("name", "share"), [("bob", 0.01), ("hypar", 0.02), ("roof_with_opening", 0.02)])
def test_the_measured_thickness_of_real_meshes_is_the_requested_thickness(name, share):
    """For at least 98 of 100 faces: the rest lie at creases of these meshes."""
    surface = real(name)
    t = share * surface.size / 2
    assert np.quantile(np.abs(measured(surface, t) / t - 1), 0.98) < 0.02


# ---------------------------------------------------------------- told in numbers, or refused


def near_sheets(folder, **changes):
    """Two plates closer together than any thinning allows."""
    plate = grid(6, 6, 1.0, 1.0)
    both = stacked(plate, 2e-5)
    return preset(folder / "near.obj", both, {"statics.thickness": 0.05, **changes})


def test_strict_thickening_refuses_a_solid_that_intersects_itself(tmp_path):
    with pytest.raises(DsfabError, match=r"pairs of faces .* still intersect.*thickening.strict refuses"):
        dsfab.run(near_sheets(tmp_path, **{"thickening.strict": True}))


def test_design_json_lists_the_repairs(tmp_path):
    design = dsfab.run(near_sheets(tmp_path))
    told = design_facts(design, dict(design.seconds), [], [])["thickening"]
    repairs = design.solid.repairs
    assert told["pairs"] == repairs.pairs > 0
    assert told["found"] >= told["pairs"]
    assert told["side"] == "mid"
    assert 0 < told["pairs_at"][0] < 1
    assert (told["limited"], told["smallest"], told["rung"]) == (0, 1.0, repairs.rung)
    assert any(f"{repairs.pairs} pairs of faces of the solid still intersect" in n.text for n in design.notes)


def test_the_rung_names_the_repair_that_was_needed():
    plate = grid(4, 4, 1.0, 1.0)
    assert made(plate, 0.1).repairs.rung == "none"
    both = Surface(np.concatenate([plate.V, plate.V + [0, 0, 0.07]]), np.concatenate([plate.F, plate.F + plate.n]))
    told = made(both, 0.1).repairs
    assert (told.rung, told.thinned, told.pairs) == ("thinned", 50, 0)
    assert 0.3 <= told.thinnest < 0.7
    assert told.found > 0


# ---------------------------------------------------------------- sheets that cross themselves


def crossing_plates() -> Surface:
    plate = grid(8, 8, 1.0, 1.0)
    wall = np.c_[plate.V[:, 0] * 0 + 0.43, plate.V[:, 1] + 0.013, plate.V[:, 0] - 0.47]
    return joined(plate, Surface(wall, plate.F))


def check_fused(solid, volume: float) -> None:
    check_sound(solid)
    mesh = trimesh.Trimesh(solid.V, solid.F, process=False)
    assert mesh.volume == pytest.approx(volume, rel=1e-9)
    euler = len(np.unique(solid.F)) - len(mesh.edges_unique) + len(solid.F)
    assert solid.genus == len(mesh.split(only_watertight=False)) - euler // 2


def test_two_plates_that_cross_become_one_cross():
    """Exactly: the sum of both less the bar in which they meet, 0.02 x 0.02 x (1 - 0.013)."""
    solid = made(crossing_plates(), 0.02)
    check_fused(solid, 2 * 0.02 - 0.02**2 * (1 - 0.013))
    assert (solid.genus, solid.pieces) == (0, 1)
    told = solid.repairs
    assert (told.rung, told.crossings, told.pairs, told.thinned) == ("united", 1, 0, 0)
    assert told.found > 0
    assert solid.notes == ("the sheet crosses itself in one place; the crossing parts of the sheet are fused",)


def test_a_tube_through_a_sphere_has_the_right_handles_and_voids():
    """A closed tube (torus) through the shell of a ball, twice: its inside joins outside and inside of nothing."""
    ball = sphere(4)
    ring = torus(48, 16, 1.0, 0.3)
    both = Surface(np.concatenate([ball.V, ring.V + [1, 0, 0]]), np.concatenate([ball.F, ring.F + ball.n]))
    solid = made(both, 0.02)
    shells = trimesh.Trimesh(solid.V, solid.F, process=False).split(only_watertight=False)
    check_fused(solid, float(sum(s.volume for s in shells)))
    assert solid.pieces == 1
    assert len(shells) == 4  # outside; the ball less the tube; the tube within; the tube without
    assert solid.genus == 2  # of the first two, with the tube as a handle and as a bore
    assert solid.repairs.crossings == 2


def test_boys_surface_is_united_into_one_sound_solid():
    boy = projective_plane(4)
    t = 0.01 * boy.size / 2
    solid = made(boy, t)
    assert trimesh.Trimesh(solid.V, solid.F, process=False).is_volume
    assert 0.97 * boy.area * t < solid.volume < 1.005 * boy.area * t  # parts end a little off so coarse a mesh
    assert solid.repairs.rung == "united"
    check_sound(solid)


def test_faces_at_a_vertex_in_which_a_part_only_touches_itself_are_parted():
    """The face between is in another part. They were thought to bend too tightly: 30 pairs of Boy's surface were."""
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0.7, 0.7, 0], [0, 1, 0], [-0.7, 0.7, 0]])
    fan = Surface(V, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]]))
    D, share = np.broadcast_to([0.0, 0.0, 0.1], (3, 3, 3)), np.ones(5)
    pinched, whole = (
        prism_part(fan, D, Overlap(np.array(faces), V, share), Skin.from_surface(fan))
        for faces in ([True, False, True], [True, True, True])
    )
    assert len(whole.found) == 0
    assert set(map(frozenset, pinched.found.tolist())) == {frozenset((0, 2))}
    assert not pinched.around.any()


@pytest.mark.slow
def test_the_boy_that_ships_meets_itself_nowhere():
    """Nor do two of its edges become one in single precision."""
    solid = dsfab.run(dsfab.load_preset("boys_surface")).solid
    assert solid.repairs.pairs == 0
    check_sound(solid)
    points, of = np.unique(solid.V.astype(np.float32), axis=0, return_inverse=True)
    ends = np.sort(of.reshape(-1)[solid.F][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()
    assert len(points) == len(np.unique(solid.F))


# ---------------------------------------------------------------- single precision


@pytest.mark.parametrize("make", [lambda: sphere(3), wave, moebius, crossing_plates, lambda: real("bob")])
def test_the_solid_is_the_one_in_the_stl_file(make, tmp_path):
    """The file as trimesh reads it, rounded to single precision, is closed and sound."""
    surface = make()
    solid = made(surface, 0.02 * surface.size / 2)
    path = dsfab.write(solid, tmp_path / "a.stl")
    read = trimesh.load_mesh(path, process=False)
    points, of = np.unique(np.asarray(read.vertices), axis=0, return_inverse=True)
    F = of.reshape(-1)[read.faces]
    assert (len(points), len(F)) == (len(np.unique(solid.F)), len(solid.F))
    assert trimesh.Trimesh(points, F, process=False).is_volume
    assert len(intersecting_pairs(points, F)) == 0


def test_the_solid_itself_stays_exact_near_and_far():
    """Rounded vertices are tested, exact ones delivered; at 10 km, where rounding would show, nothing is rounded."""
    bent = wave()
    for surface in (bent, Surface(bent.V + 1e4, bent.F)):
        D = offsets(surface, 0.01).D
        assert np.array_equal(thicken(surface, D).V[: surface.n], surface.V + D)
