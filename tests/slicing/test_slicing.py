"""Slicing: areas in closed form, then laws of any cut over a zoo and random meshes, then brute-force classification."""

import numpy as np
import pytest
from hypothesis import given, settings

from dsfab.core.errors import PatternError
from dsfab.slicing import cut
from dsfab.slicing.cutting.cells import LARGEST, Cells, triangulate
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, pieces
from tests.shapes import ZOO, grid, jittered, sphere, zoo
from tests.slicing.laws import cases, check_laws, material_area, points_in_cells


def area_below(surface: Surface, x: np.ndarray, level: float) -> float:
    """Area where the linear interpolant of x is under a level, one corner or all but one corner of each face."""
    a, b, c = np.sort(x[surface.F], axis=1).T
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = (level - a) ** 2 / ((b - a) * (c - a))
        rest = 1 - (c - level) ** 2 / ((c - a) * (c - b))
    share = np.select([level <= a, level >= c, level <= b], [0.0, 1.0, corner], rest)
    return float(share @ surface.areas)


def strip_area(surface: Surface, x: np.ndarray, levels: np.ndarray) -> float:
    """Area of the odd strips."""
    below = [area_below(surface, x, level) for level in levels] + [surface.area] * (len(levels) % 2)
    return sum(below[1::2]) - sum(below[0::2])


def families(fields, levels, weights) -> np.ndarray:
    """The defining rule at points given by barycentric weights: the first field with an odd number of levels below."""
    result = np.full(weights.shape[0], -1)
    for k in reversed(range(len(fields))):
        result[np.searchsorted(levels[k], weights @ fields[k]) % 2 == 1] = k
    return result


def closeness(fields, levels, weights) -> np.ndarray:
    """Least distance in value of a point from any level of any field."""
    gaps = [
        np.abs((weights @ f)[:, None] - lines).min(axis=1)
        for f, lines in zip(fields, levels, strict=True)
        if len(lines)
    ]
    return np.min(gaps, axis=0) if gaps else np.full(weights.shape[0], np.inf)


# --- closed forms


@pytest.mark.parametrize("count", [1, 2, 7, 60, 601])
def test_stripes_of_a_plate_have_exact_areas(count):
    plate = jittered(grid(5, 4, 2.0, 1.0))
    levels = np.sort(np.random.default_rng(count).uniform(-0.1, 2.1, count))
    sheet = cut(plate, [plate.V[:, 0]], [levels], snap=0)
    edges = np.append(np.clip(levels, 0, 2), [2.0] * (count % 2))
    assert material_area(sheet) == pytest.approx((edges[1::2] - edges[::2]).sum(), rel=1e-12)
    check_laws(plate, sheet)


def test_two_crossing_families_cover_the_union_of_their_stripes():
    plate = jittered(grid(6, 6, 1.0, 1.0))
    along, across = np.array([0.11, 0.31, 0.47, 0.92]), np.array([0.05, 0.13, 0.38, 0.71, 0.83])
    a, b = 0.2 + 0.45, 0.08 + 0.33 + 0.17
    sheet = cut(plate, [plate.V[:, 0], plate.V[:, 1]], [along, across], snap=0)
    area = lambda k: sheet.surface.areas[sheet.family == k].sum()  # noqa: E731
    assert area(0) == pytest.approx(a, rel=1e-12)
    assert area(1) == pytest.approx((1 - a) * b, rel=1e-12)
    assert material_area(sheet) == pytest.approx(1 - (1 - a) * (1 - b), rel=1e-12)
    assert area(-1) == pytest.approx((1 - a) * (1 - b), rel=1e-12)
    check_laws(plate, sheet)


def test_material_of_an_earlier_field_is_not_cut_again():
    plate = grid(3, 3, 1.0, 1.0)
    lines = np.linspace(0.01, 0.99, 30)
    one = cut(plate, [plate.V[:, 0]], [[0.5]], snap=0)
    two = cut(plate, [plate.V[:, 0], plate.V[:, 1]], [[0.5], lines], snap=0)
    beyond = two.surface.V[two.surface.V[:, 0] > 0.5 + 1e-9]
    assert not np.isclose(beyond[:, 1][:, None], lines).any()
    assert (two.family == 0).sum() >= (one.family == 0).sum()
    assert (two.family == 1).sum() > 100
    check_laws(plate, two)


def test_annulus_has_the_area_of_the_linear_distance():
    plate = jittered(grid(20, 20, 2.0, 2.0))
    distance = np.linalg.norm(plate.V[:, :2] - 1, axis=1)
    sheet = cut(plate, [-distance], [[-0.8, -0.3]], snap=0)
    assert material_area(sheet) == pytest.approx(
        area_below(plate, distance, 0.8) - area_below(plate, distance, 0.3), rel=1e-12
    )
    assert material_area(sheet) == pytest.approx(np.pi * (0.8**2 - 0.3**2), rel=0.02)


@zoo
def test_any_linear_field_is_cut_exactly(name):
    surface = ZOO[name]()
    x = np.random.default_rng(1).normal(size=surface.n)
    levels = np.linspace(-2, 2, 12)
    sheet = cut(surface, [x], [levels], snap=0)
    assert material_area(sheet) == pytest.approx(strip_area(surface, x, levels), rel=1e-11)


# --- laws


@zoo
@pytest.mark.parametrize("snap", [0.0, 0.05, 0.3])
def test_cells_give_back_the_surface(name, snap):
    surface = ZOO[name]()
    rng = np.random.default_rng(2)
    fields = [surface.V[:, 0] / surface.size, rng.normal(size=surface.n)]
    sheet = cut(surface, fields, [np.linspace(-0.4, 0.4, 15), np.linspace(-1, 1, 6)], snap=snap)
    assert len(np.unique(sheet.family)) == 3
    check_laws(surface, sheet)


def test_each_sample_point_lies_in_a_cell_of_its_family():
    """Points of the faces, located among the cells of their face by barycentric coordinates."""
    surface = jittered(grid(3, 3, 1.0, 1.0), seed=3)
    rng = np.random.default_rng(4)
    fields = [rng.normal(size=surface.n) for _ in range(3)]
    levels = [np.linspace(-1, 1, 7), np.linspace(-1.2, 1.3, 5), np.array([0.4, 0.5])]
    sheet = cut(surface, fields, levels, snap=0)
    face = np.repeat(np.arange(surface.m), 2000)
    samples = np.zeros((len(face), surface.n))
    np.put_along_axis(samples, surface.F[face], rng.dirichlet([1, 1, 1], len(face)), axis=1)
    expected = families(fields, levels, samples)
    found = np.full(len(face), -2)
    corners = sheet.weights.toarray()[sheet.surface.F]
    for cell in range(sheet.surface.m):
        here = np.flatnonzero(face == sheet.parent[cell])
        on = surface.F[sheet.parent[cell]]
        inside = np.linalg.solve(corners[cell][:, on].T, samples[here][:, on].T).min(axis=0) >= 0
        found[here[inside]] = sheet.family[cell]
    clear = closeness(fields, levels, samples) > 1e-9
    assert clear.mean() > 0.999
    assert (found[clear] == expected[clear]).all()


@pytest.mark.parametrize("snap", [0.02, 0.1, 0.3])
def test_snap_moves_a_line_by_at_most_its_fraction(snap):
    surface = jittered(grid(12, 12, 1.0, 1.0))
    x = surface.V[:, 0] + 0.3 * surface.V[:, 1] ** 2
    levels = np.linspace(0.1, 1.1, 5)
    sheet = cut(surface, [x], [levels], snap=snap)
    reach = np.abs(np.diff(x[surface.edges.ends], axis=1)).max()
    values = sheet.carry(x)[sheet.surface.F]
    strip = np.searchsorted(levels, values.mean(axis=1))
    borders = np.concatenate([[-np.inf], levels, [np.inf]])
    beyond = np.maximum(borders[strip] - values.min(axis=1), values.max(axis=1) - borders[strip + 1])
    assert 0.1 * snap * reach < beyond.max() <= snap * reach
    assert ((strip % 2 == 1) == sheet.material).mean() > 0.95
    added = sheet.weights[surface.n :]
    assert added.data.min() > snap / (1 + 2 * snap)  # no new vertex close to an old one
    assert cut(surface, [x], [levels], snap=0).weights[surface.n :].data.min() < snap / 2


@settings(max_examples=150, deadline=None, derandomize=True)
@given(cases())
def test_laws_hold_on_random_meshes_with_degenerate_fields(case):
    surface, fields, levels, snap = case
    sheet = cut(surface, fields, levels, snap=snap)
    check_laws(surface, sheet)
    points, cell = points_in_cells(sheet, 3)
    wrong = families(fields, levels, points) != sheet.family[cell]
    reach = max(np.abs(np.diff(x[surface.edges.ends], axis=1)).max() for x in fields)
    assert closeness(fields, levels, points)[wrong].max(initial=0) <= max(snap, 1e-6) * reach + 1e-14


# --- degenerate values, by rule


@pytest.mark.parametrize(
    ("values", "levels", "cells", "families"),
    [
        ((0, 0, 1), [0], 1, {0}),  # an edge on the level: the face goes to the side it lies on
        ((0, 0, -1), [0], 1, {-1}),
        ((0, 1, 2), [0], 1, {0}),  # a corner on the level
        ((-1, 0, 1), [0], 2, {0, -1}),  # from a corner to the opposite edge
        ((0, 0, 0), [0], 1, {-1}),  # wholly on a level: void, whichever side of it is material
        ((1, 1, 1), [0, 1], 1, {-1}),
        ((1, 1, 1), [0], 1, {0}),
        ((-1, -1, -1), [0], 1, {-1}),
        ((-1, 1, 1), [0, 0], 1, {-1}),  # equal levels enclose nothing
        ((-1, 1, 1), [0, 0, 0], 3, {0, -1}),  # three equal ones are one
        ((-1, 1, 1), [], 1, {-1}),
        ((-1, 1, 1), [-5], 1, {0}),  # one level below everything: all material
        ((0, 1, 2), [0.5, 1.5], 5, {0, -1}),  # three parts: corner, quadrilateral with the middle corner, corner
    ],
)
def test_degenerate_values_follow_the_rule(values, levels, cells, families):
    face = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    sheet = cut(face, [np.array(values, dtype=float)], [levels], snap=0)
    assert sheet.surface.m == cells
    assert set(sheet.family.tolist()) == families
    check_laws(face, sheet)


@pytest.mark.parametrize("distance", [1e-15, 1e-11])
def test_a_line_very_near_a_vertex_snaps_to_it(distance):
    plate = grid(4, 4, 1.0, 1.0)
    exact = cut(plate, [plate.V[:, 0]], [[0.5]], snap=0)
    near = cut(plate, [plate.V[:, 0]], [[0.5 + distance]], snap=0)
    assert exact.surface.m == near.surface.m == plate.m
    assert (exact.family == near.family).all()


def test_slivers_of_a_long_thin_face_are_not_made():
    """A cell of area 1e-19 of the squared size is left out by moving its corners onto the line."""
    thin = Surface([[0, 0, 0], [1, 0, 0], [1, 1e-6, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    x = thin.V[:, 0] - 1e-7
    sheet = cut(thin, [x], [[0.0]], snap=0)
    check_laws(thin, sheet)
    assert sheet.surface.areas.min() > 1e-17


def test_corners_on_one_line_make_no_cell():
    """Snapping puts a and c on the level but not b between them: the cell a b c would have no area but rounding."""
    a, c, d = np.array([[0.1, 0.2, 0.3], [0.8, 0.5, 0.1], [0.2, 0.9, 0.4]]) + 1000
    X = np.stack([a, a + 0.3 * (c - a), c, d])
    quad, everywhere = Cells(np.array([0, 4]), np.arange(4)), np.array([True])
    split = clean_split(quad, X, np.array([0, 0.1, 0, -1]), np.array([0.0]), everywhere, Snapping(0.0, 1.0))
    assert len(split.cells.sizes) == 1
    assert split.strip.tolist() == [0]
    bent = X.copy()
    bent[1] += 1e-3 * (a - d)
    assert (
        len(clean_split(quad, bent, np.array([0, 0.1, 0, -1]), np.array([0.0]), everywhere, Snapping(0.0, 1.0)).strip)
        == 2
    )


def test_constant_field_on_a_level_stays_void_where_an_earlier_field_cuts():
    """Interpolated constants are off by a rounding; that must not cut the faces into noise."""
    surface = jittered(grid(6, 6, 1.0, 1.0))
    constant = np.full(surface.n, 0.1 + 0.2)
    lines = np.linspace(0.03, 0.97, 20)
    sheet = cut(surface, [surface.V[:, 0], constant], [lines, [0.1 + 0.2]], snap=0)
    assert set(sheet.family.tolist()) == {-1, 0}
    assert sheet.surface.m == cut(surface, [surface.V[:, 0]], [lines], snap=0).surface.m


# --- triangulation of cells


@pytest.mark.parametrize("extra", [0, 1, 5, 40])
def test_polygon_with_straight_corners_is_filled_without_flat_triangles(extra):
    """A triangle with extra corners on one side, as a cell gets from a neighbour that is cut more often."""
    side = np.linspace(0, 1, extra + 2)
    X = np.concatenate([np.c_[side, 0 * side, 0 * side], [[0.3, 1, 0]]])
    start = np.array([0, len(X)])
    for shift in range(0, len(X), 7):
        F, owner = triangulate(Cells(start, np.roll(np.arange(len(X)), shift)), X)
        assert len(F) == len(X) - 2
        assert (owner == 0).all()
        made = Surface(X, F)
        assert made.area == pytest.approx(0.5, rel=1e-12)
        assert made.areas.min() > 0.4 / (extra + 1)
        assert (made.normals[:, 2] > 0).all()
        assert made.edges.boundary.sum() == len(X)


def test_triangulation_maximises_the_worst_triangle():
    """Of the 14 triangulations of a hexagon the best by listing them all."""
    angle = np.sort(np.random.default_rng(5).uniform(0, 2 * np.pi, 6))
    X = np.c_[2 * np.cos(angle), np.sin(angle), 0 * angle]

    def quality(i, j, k):
        a, b, c = X[i], X[j], X[k]
        sides = sum(((p - q) ** 2).sum() for p, q in ((a, b), (b, c), (c, a)))
        return 2 * np.sqrt(3) * np.linalg.norm(np.cross(b - a, c - a)) / sides

    def all_worst(corners):
        if len(corners) < 3:
            return [np.inf]
        found = []
        for k in range(1, len(corners) - 1):
            here = quality(corners[0], corners[k], corners[-1])
            found += [min(here, p, q) for p in all_worst(corners[: k + 1]) for q in all_worst(corners[k:])]
        return found

    worst = all_worst(tuple(range(6)))
    F, _ = triangulate(Cells(np.array([0, 6]), np.arange(6)), X)
    assert len(worst) == 14
    assert min(quality(*f) for f in F) == pytest.approx(max(worst))


def test_cell_beside_many_stripes_takes_all_their_corners():
    plate = grid(1, 1, 1.0, 1.0)
    lines = np.linspace(0.01, 0.99, 150)
    sheet = cut(plate, [plate.V[:, 0], plate.V[:, 1]], [[0.5], lines], snap=0)
    widths = np.diff(lines)[::2].sum()
    assert material_area(sheet) == pytest.approx(0.5 + 0.5 * widths, rel=1e-12)
    assert np.bincount(sheet.surface.F.ravel()).max() > LARGEST
    check_laws(plate, sheet)


# --- the value `Sheet`


def test_kept_is_the_material_alone():
    surface = sphere(2)
    x = surface.V[:, 2]
    sheet = cut(surface, [x, surface.V[:, 0]], [[-0.3, 0.4], [0.2]])
    kept = sheet.subset()
    assert kept.surface.area == pytest.approx(material_area(sheet), rel=1e-14)
    assert kept.surface.n == len(np.unique(kept.surface.F)) < sheet.surface.n
    assert kept.carry(surface.V) == pytest.approx(kept.surface.V, abs=1e-14)
    assert kept.material.all()
    assert (kept.parent == sheet.parent[sheet.material]).all()
    assert (kept.family == sheet.family[sheet.material]).all()
    belt = sheet.subset(sheet.family == 0)
    assert euler_characteristic(belt.surface.F, belt.surface.edges) == 0
    assert pieces(belt.surface.F, belt.surface.edges)[0] == 1


def test_carried_values_are_linear_and_agree_on_shared_vertices():
    surface = sphere(2)
    sheet = cut(surface, [surface.V[:, 2]], [np.linspace(-0.9, 0.9, 20)], snap=0)
    assert sheet.carry(surface.V @ [1.0, 2.0, 3.0]) == pytest.approx(sheet.surface.V @ [1.0, 2.0, 3.0], abs=1e-13)
    assert sheet.carry(np.ones((surface.n, 2, 2))[:, 0]).shape == (sheet.surface.n, 2)
    inner = sheet.carry(surface.V[:, 2])[surface.n :]
    assert np.abs(inner[:, None] - np.linspace(-0.9, 0.9, 20)).min(axis=1).max() < 1e-14


def test_sheet_is_frozen():
    sheet = cut(sphere(1), [sphere(1).V[:, 2]], [[0.1]])
    for array in (sheet.parent, sheet.family, sheet.weights.data):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


# --- refusals


def test_impossible_requests_are_refused():
    surface = sphere(1)
    x = surface.V[:, 2]
    with pytest.raises(PatternError, match=r"not finite at 1 of 18 vertices \(first: 3\)"):
        cut(surface, [np.where(np.arange(surface.n) == 3, np.inf, x)], [[0.1]])
    for levels in ([0.2, 0.1], [np.nan]):
        with pytest.raises(PatternError, match="finite and ascending"):
            cut(surface, [x], [levels])
    for snap in (-0.1, 0.5, np.nan):
        with pytest.raises(PatternError, match="between 0 and"):
            cut(surface, [x], [[0.1]], snap=snap)
    with pytest.raises(PatternError, match="lower the threshold"):
        cut(surface, [x], [[]]).subset()
    with pytest.raises(ValueError, match="shape"):
        cut(surface, [x[:-1]], [[0.1]])
    with pytest.raises(ValueError, match="shorter"):
        cut(surface, [x, x], [[0.1]])
    line = np.c_[np.arange(4.0), np.zeros((4, 2))]
    with pytest.raises(PatternError, match=r"2 of 2 cells have no area \(in faces 7\)"):
        filled_polygons(Cells(np.array([0, 4]), np.arange(4)), line, np.array([7]))
