"""What is kept along curves and around points: even to the eye and to the ruler, whatever the mesh."""

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from dsfab.design import run
from dsfab.pattern import face_points, kept_layers, material_points
from dsfab.pattern.kept_regions import EVEN, FINEST, boundary_origins, curve_fields, patches
from dsfab.preset.file import load_preset
from dsfab.slicing import Sheet, cut, material_area
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField, DividedField, DividedSurface
from tests.shapes import ZOO, grid, jittered, smallest_angle, sphere, subsurface, zoo
from tests.slicing.laws import check_laws
from tests.surface.prisms import prism

SNAP = 0.05


def nothing(surface: Surface) -> np.ndarray:
    return np.zeros(surface.n, dtype=bool)


def at(surface: Surface, *place: float) -> np.ndarray:
    """The vertex there."""
    return np.arange(surface.n) == np.linalg.norm(surface.V - place, axis=1).argmin()


def kept(surface: Surface, marked: np.ndarray, keep: float, rim: float, snap: float = SNAP) -> Sheet:
    layers = kept_layers(surface, marked, keep, rim)
    return cut(surface, [layer.field for layer in layers], [layer.levels for layer in layers], snap)


def outline(sheet: Sheet) -> np.ndarray:
    """(k, 3) points on the edges between material and void."""
    edges, material = sheet.surface.edges, sheet.material
    one, two = edges.pairs.T
    between = edges.of.ravel()[one[material[one // 3] != material[two // 3]]]
    a, b = sheet.surface.V[edges.ends[between]].transpose(1, 0, 2)
    return np.concatenate([a + t * (b - a) for t in (0.0, 0.25, 0.5, 0.75)])


def rim_widths(surface: Surface, sheet: Sheet) -> np.ndarray:
    """Straight distance of the inner outline from the boundary."""
    curve = surface.edges.ends[surface.edges.boundary]
    return np.sqrt(igl.point_mesh_squared_distance(outline(sheet), surface.V, curve)[0])


def tolerance(surface: Surface, rim: float) -> float:
    """What widths may be off by: in corners, where faces are much larger than the rim is wide, by the share of a face
    that is not divided any more; a distance rises by at most half of that and falls again."""
    longest = np.linalg.norm(np.diff(surface.V[surface.edges.ends], axis=1)[:, 0], axis=1).max()
    return max(0.05 * rim, EVEN * rim + FINEST / 2 * longest)


def area(sheet: Sheet) -> float:
    return float(sheet.surface.areas[sheet.material].sum())


def holed(seed: int, count: int = 25, sides: int = 6) -> Surface:
    """A square of 3 x 3 with a polygon of radius 0.7 cut out, on a coarse mesh: few vertices besides the boundary."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(sides) / sides
    hole = 1.5 + 0.7 * np.c_[np.cos(turn), np.sin(turn)]
    t = np.linspace(0, 3, 5)
    square = np.concatenate([np.c_[t, 0 * t], np.c_[t, 0 * t + 3], np.c_[0 * t, t][1:-1], np.c_[0 * t + 3, t][1:-1]])
    inner = 3 * rng.random((count, 2))
    inner = inner[np.hypot(*(inner - 1.5).T) > 0.75]
    P = np.concatenate([hole, square, inner])
    F = Delaunay(P).simplices
    F = F[~(sides > F).all(axis=1)]
    used, F = np.unique(F, return_inverse=True)
    return Surface(np.c_[P[used], np.zeros(len(used))], F.reshape(-1, 3))


# --- closed forms


@pytest.mark.parametrize("rim", [0.1, 0.2, 0.35])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rim_has_its_width_around_holes_and_in_corners(seed, rim):
    surface = holed(seed)
    sheet = kept(surface, nothing(surface), 0.0, rim)
    assert rim_widths(surface, sheet) == pytest.approx(rim, abs=tolerance(surface, rim))
    around = 12 * 0.7 * np.sin(np.pi / 6)
    ring, frame = around * rim + np.pi * rim**2, 12 * rim - 4 * rim**2
    assert area(sheet) == pytest.approx(ring + frame, rel=0.01)
    check_laws(surface, sheet)


def test_a_triangle_between_three_boundary_vertices_is_not_kept_as_a_whole():
    """At a corner, and between hole and edge: all its vertices are on the boundary, its middle is not."""
    surface = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0.9, 0]]), np.array([[0, 1, 2]]))
    sheet = kept(surface, nothing(surface), 0.0, 0.1)
    sides = np.array([1.0, np.hypot(0.5, 0.9), np.hypot(0.5, 0.9)])
    inner = 2 * surface.area / sides.sum() - 0.1  # radius of the inscribed circle, less the rim
    assert surface.area - area(sheet) == pytest.approx(inner**2 / (4 * surface.area) * sides.sum() ** 2, rel=0.01)
    assert rim_widths(surface, sheet) == pytest.approx(0.1, abs=tolerance(surface, 0.1))


@pytest.mark.parametrize("keep", [0.1, 0.3, 0.45])
def test_around_a_point_a_disc_is_kept(keep):
    surface = jittered(grid(4, 4, 1.0, 1.0), 0.3, 5)
    point = at(surface, 0.5, 0.5, 0)
    sheet = kept(surface, point, keep, 0.0)
    assert np.linalg.norm(outline(sheet) - surface.V[point], axis=1) == pytest.approx(keep, rel=0.03)
    assert area(sheet) == pytest.approx(np.pi * keep**2, rel=0.02)


def test_along_a_held_part_of_an_edge_the_width_is_even():
    """Half a stadium; an inner edge between two held vertices of the boundary, across the corner, is not held."""
    surface = jittered(grid(3, 4, 3.0, 4.0), 0.3, 2)
    x, y, _ = surface.V.T
    held = ((x == 3) & (y < 2.5)) | ((y == 0) & (x > 1.5))
    assert held.sum() == 4
    assert not patches(surface, held).any()
    sheet = kept(surface, held, 0.4, 0.0)
    distance = np.sqrt(
        igl.point_mesh_squared_distance(
            outline(sheet), np.array([[3, 0, 0], [3, 2, 0], [2.0, 0, 0]]), np.array([[0, 1], [0, 2]])
        )[0]
    )
    assert distance == pytest.approx(0.4, rel=0.05)
    assert area(sheet) == pytest.approx(3 * 0.4 - 0.4**2 + 2 * np.pi * 0.4**2 / 4, rel=0.01)


def test_the_kept_distance_is_measured_along_the_surface():
    """A disc on the tube, unrolled; and both ends. Straight lines through the air would keep more."""
    surface = prism(8, 5, 4.0)
    point = np.arange(surface.n) == 2
    keep = 1.2
    assert area(kept(surface, point, keep, 0.0)) == pytest.approx(np.pi * keep**2, rel=0.02)
    sheet = kept(surface, nothing(surface), 0.0, 0.5)
    assert area(sheet) == pytest.approx(2 * 0.5 * 16 * np.sin(np.pi / 8), rel=0.02)
    z = outline(sheet)[:, 2]
    assert np.minimum(z, 4 - z) == pytest.approx(0.5, rel=0.05)


def test_the_rim_of_a_dome_comes_to_that_of_the_half_sphere():
    """Between the equator and a circle of latitude: 2 pi sin(r) for the radius 1."""
    errors = []
    for level in (1, 2, 3, 4):
        ball = sphere(level)
        dome = subsurface(ball, ball.centroids[:, 2] > 0)
        errors.append(abs(area(kept(dome, nothing(dome), 0.0, 0.5)) / (2 * np.pi * np.sin(0.5)) - 1))
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.5)
    assert errors[-1] < 2e-3
    latitude = np.arcsin(outline(kept(dome, nothing(dome), 0.0, 0.5))[:, 2])
    assert latitude == pytest.approx(0.5, rel=0.01)


# --- laws


@pytest.mark.slow
@settings(deadline=None, max_examples=25)
@given(st.integers(0, 30), st.integers(0, 10**6), st.floats(0.03, 0.45))
def test_on_any_coarse_mesh_of_a_square_the_rim_is_even(count, seed, rim):
    P = np.concatenate([np.random.default_rng(seed).random((count, 2)), [[0, 0], [1, 0], [0, 1], [1, 1]]])
    surface = Surface(np.c_[P, np.zeros(len(P))], Delaunay(P).simplices)
    sheet = kept(surface, nothing(surface), 0.0, rim)
    assert rim_widths(surface, sheet) == pytest.approx(rim, abs=tolerance(surface, rim))
    assert area(sheet) == pytest.approx(1 - (1 - 2 * rim) ** 2, rel=0.02)
    check_laws(surface, sheet)


@zoo
def test_kept_regions_and_stripes_are_cut_without_a_gap(name):
    surface = ZOO[name]()
    reach = (0.03 if name == "obtuse" else 0.08) * surface.size
    layers = kept_layers(surface, np.arange(surface.n) == 3, reach, 0.7 * reach)
    stripes = 9 * surface.V[:, 0] / surface.size
    fields = [*(layer.field for layer in layers), stripes]
    levels = [*(layer.levels for layer in layers), np.arange(-20, 20) / 2 + 0.1]
    sheet = cut(surface, fields, levels)
    check_laws(surface, sheet)
    assert {*np.unique(sheet.family)} == {-1, *range(len(fields))}
    assert material_area(surface, fields, levels) == pytest.approx(area(sheet), rel=1e-12)


def test_numbers_of_vertices_and_faces_do_not_matter():
    surface, rng = holed(4), np.random.default_rng(1)
    new, order = rng.permutation(surface.n), rng.permutation(surface.m)
    V = np.empty_like(surface.V)
    V[new] = surface.V
    other = Surface(V, np.roll(new[surface.F][order], 1, axis=1))
    marked = surface.V[:, 1] == 0
    turned = np.empty_like(marked)
    turned[new] = marked
    one, two = kept(surface, marked, 0.5, 0.2), kept(other, turned, 0.5, 0.2)
    assert area(two) == pytest.approx(area(one), rel=1e-9)
    assert two.surface.m == one.surface.m


def test_a_fine_mesh_is_not_divided_and_a_patch_is_measured_to_straight():
    surface = grid(60, 60, 1.0, 1.0)
    x, y, _ = surface.V.T
    patch = (x < 0.3) & (y < 0.3)
    (keep,) = kept_layers(surface, patch, 0.1, 0.0)
    away = np.hypot(np.maximum(x - x[patch].max(), 0), np.maximum(y - y[patch].max(), 0))
    assert keep.field == pytest.approx(-away, abs=1e-12)
    (edge,) = kept_layers(surface, x == 0, 0.2, 0.0)
    assert edge.field == pytest.approx(-x, abs=1e-9)
    both = kept_layers(surface, patch | (x == 1), 0.1, 0.0)
    assert len(both) == 1
    assert both[0].field == pytest.approx(-np.minimum(away, 1 - x), abs=1e-9)


def test_a_sheet_that_is_near_through_the_air_is_not_kept():
    """Fine plates, one above the other: straight lines are as good as others, but for where they lead."""
    plate = grid(40, 40, 1.0, 1.0)
    both = Surface(np.concatenate([plate.V, plate.V + [0, 0, 0.05]]), np.concatenate([plate.F, plate.F + plate.n]))
    below = np.arange(both.n) < plate.n
    sheet = kept(both, below & (both.V[:, 0] == 0), 0.2, 0.0)
    assert area(sheet) == pytest.approx(0.2, rel=0.01)
    assert sheet.surface.centroids[sheet.material, 2].max() == 0


def test_closed_surfaces_and_a_zero_distance_keep_nothing():
    ball = sphere()
    assert kept_layers(ball, nothing(ball), 0.3, 0.3) == []
    plate = grid(2, 2, 1.0, 1.0)
    assert kept_layers(plate, plate.V[:, 0] == 0, 0.0, 0.0) == []


def test_faces_are_divided_no_further_than_the_edge_of_a_region_asks():
    surface = holed(3)
    ((field,), rim) = curve_fields(surface, [(boundary_origins(surface), 0.3)]), 0.3
    assert isinstance(field, DividedField)
    parts = field.divided.surface
    size = np.linalg.norm(np.diff(parts.V[parts.edges.ends], axis=1)[:, 0], axis=1)
    assert size.min() > rim / 40
    assert smallest_angle(parts) > smallest_angle(surface) / 3
    assert parts.m < 40 * surface.m
    middle = parts.V[parts.edges.ends].mean(axis=1)
    curve = surface.edges.ends[surface.edges.boundary]
    true = np.sqrt(igl.point_mesh_squared_distance(middle, surface.V, curve)[0])
    mean = -field.x[parts.edges.ends].mean(axis=1)
    crossed = (np.prod(-field.x[parts.edges.ends] - rim, axis=1) < 0) & (size > rim / 16)
    assert np.abs(true - mean)[crossed].max() < 3 * EVEN * rim


def divided_rim(surface: Surface, rim: float) -> DividedField:
    (field,) = curve_fields(surface, [(boundary_origins(surface), rim)])
    assert isinstance(field, DividedField)
    return field


def test_no_row_of_tiny_parts_is_made_where_a_rim_passes_close_to_new_vertices():
    """Edges of 1/8 in quarters have vertices at 1/32 from the boundary: beside a rim that is 4 % narrower than that."""
    surface = jittered(grid(8, 8, 1.0, 1.0), 0.2, 1)
    count = [divided_rim(surface, rim).divided.surface.m for rim in (0.96 / 32, 1.04 / 32)]
    assert count[0] < 1.2 * count[1]


def test_lines_do_not_pass_close_by_a_vertex():
    surface, rim = jittered(grid(8, 8, 1.0, 1.0), 0.2, 1), 0.52 * 1.04 / 8
    field = divided_rim(surface, rim)
    off = np.abs(field.x + rim)
    assert (off == 0).sum() > 10
    assert off[off > 0].min() > EVEN * rim
    sheet = kept(surface, nothing(surface), 0.0, rim).surface
    size = np.linalg.norm(np.diff(sheet.V[sheet.edges.ends], axis=1)[:, 0], axis=1)
    assert size.min() > 0.008 / 8


def test_a_rim_within_a_kept_region_asks_for_no_parts():
    surface = jittered(grid(8, 8, 1.0, 1.0), 0.2, 1)
    keep, rim = kept_layers(surface, surface.V[:, 0] == 0, 0.3, 0.03)
    assert isinstance(rim.field, DividedField)
    divided = rim.field.divided
    parts = np.bincount(divided.parent, minlength=surface.m)
    x = surface.centroids[:, 0]
    assert (keep.name, rim.name) == ("keep", "rim")
    assert parts[x < 0.1].max() == 1  # its corners are there
    assert parts[x > 0.9].max() > 10


# --- divided fields


def test_a_divided_field_is_known_at_points_of_faces():
    surface = ZOO["saddle"]()
    divided = DividedSurface.undivided(surface)
    rng = np.random.default_rng(0)
    for _ in range(3):
        divided = divided.with_halved_edges(rng.random(len(divided.surface.edges.ends)) < 0.1)
    assert divided.surface.m > 2 * surface.m
    assert divided.weights @ surface.V == pytest.approx(divided.surface.V, abs=1e-15)
    x = surface.V @ [1.0, 2.0, 3.0]
    points = face_points(4)
    linear = DividedField(divided, divided.weights @ x)
    assert linear.at_points(points) == pytest.approx(x[surface.F] @ points.T, abs=1e-12)
    assert (linear.at_vertices == x).all()
    bent = DividedField(divided, np.abs(divided.surface.V[:, 0] - 0.5))
    where = np.einsum("pc,mcx->mpx", points, surface.V[surface.F])[..., 0]
    assert bent.at_points(points).mean() == pytest.approx(np.abs(where - 0.5).mean(), rel=0.02)


def test_angles_do_not_shrink_however_often_edges_are_halved():
    """Always one edge alone: the shortest of those from one vertex."""
    surface = ZOO["flat"]()
    divided = DividedSurface.undivided(surface)
    for _ in range(24):
        parts = divided.surface
        ends = parts.edges.ends
        size = np.linalg.norm(np.diff(parts.V[ends], axis=1)[:, 0], axis=1)
        size[~(ends == 20).any(axis=1)] = np.inf
        divided = divided.with_halved_edges(np.arange(len(ends)) == size.argmin())
    assert smallest_angle(divided.surface) > smallest_angle(surface) / 3
    assert divided.surface.edges.boundary.sum() == surface.edges.boundary.sum()
    assert divided.surface.area == pytest.approx(surface.area, rel=1e-12)


def test_the_area_of_kept_regions_is_near_the_cut_area():
    surface = holed(0)
    layers = kept_layers(surface, nothing(surface), 0.0, 0.2)
    counted = material_points(surface, layers, face_points(12)).mean(axis=1) @ surface.areas
    fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
    assert counted == pytest.approx(material_area(surface, fields, levels), rel=0.02)


def test_fields_that_do_not_fit_together_are_refused():
    surface = holed(0)
    one, two = (curve_fields(surface, [(boundary_origins(surface), 0.2)])[0] for _ in range(2))
    with pytest.raises(ValueError, match="the same value of `divided`"):
        cut(surface, [one, two], [[-0.2], [-0.2]])
    ones = np.ones((surface.m, 3))
    corners = CornerField(np.zeros((surface.n, 2)), ones, 0 * ones, np.zeros(surface.m, dtype=bool))
    with pytest.raises(ValueError, match="before every CornerField"):
        cut(surface, [corners, one], [[0.0], [-0.2]])
    with pytest.raises(ValueError, match="another surface"):
        cut(grid(2, 2, 1.0, 1.0), [one], [[-0.2]])


# --- in a design


@pytest.mark.parametrize("method", ["modes", "stripes"])
def test_a_design_on_a_coarse_mesh_has_an_even_rim_and_its_share(method):
    changes = {
        "surface.edge": 0.9,
        "pattern.rim": 0.35,
        "pattern.keep": 0.3,
        "pattern.method": method,
        "pattern.fillet": 0.0,
    }
    changes |= {"pattern.width": {"solid_fraction": 0.5}}
    if method == "stripes":
        changes |= {"pattern.major": {"spacing": 1.0}, "pattern.minor": {"spacing": 1.0}}
    design = run(load_preset("barrel_vault", changes))
    surface, sheet = design.surface, design.sheet
    assert isinstance(design.pattern.fields[0], DividedField)
    assert design.slicing.cells.surface.areas[design.slicing.cells.material].sum() == pytest.approx(
        0.5 * surface.area, rel=0.01
    )
    check_laws(surface, design.slicing.cells)
    curve = surface.edges.ends[surface.edges.boundary]
    distance = np.sqrt(igl.point_mesh_squared_distance(sheet.surface.centroids, surface.V, curve)[0])
    names = np.array(design.pattern.names)[sheet.family]
    assert distance[names == "rim"].max() < 1.03 * 0.35
    cells = design.slicing.cells
    void = np.sqrt(igl.point_mesh_squared_distance(cells.surface.centroids[~cells.material], surface.V, curve)[0])
    assert void.min() > 0.97 * 0.35
