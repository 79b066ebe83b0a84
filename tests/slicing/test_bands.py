"""Slicing of two fields, stripes whose width varies over a face: closed forms, laws, polygons clipped one by one."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from dsfab.core.errors import PatternError
from dsfab.slicing import cut, material_area, resolve_pinches
from dsfab.slicing.cutting.cut import LEVEL_GAP
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.shapes import ZOO, grid, jittered, sphere, zoo
from tests.slicing.laws import check_laws, points_in_cells
from tests.slicing.laws import material_area as area_of


def band(z, d) -> np.ndarray:
    return np.stack([z + d, z - d], axis=1)


def integers(z) -> np.ndarray:
    return np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2)


def clipped(polygon: list, x: int, level: float, above: bool) -> list:
    """Sutherland, Hodgman: clip of a polygon of rows (position, values): where column x is above or below a level."""
    result = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        a, b = p[x] - level, q[x] - level
        if (a > 0) == above:
            result.append(p)
        if (a > 0) != (b > 0):
            result.append(p + a / (a - b) * (q - p))
    return result


def clipped_area(surface: Surface, fields: np.ndarray, levels: np.ndarray) -> float:
    """Area where the first field is above and the second below one of the levels, face by face and level by level."""
    total = 0.0
    for face in surface.F:
        rows = list(np.c_[surface.V[face], fields[face]])
        for level in levels[(levels <= fields[face].max()) & (levels >= fields[face].min())]:
            part = clipped(clipped(rows, 3, level, True), 4, level, False)
            if len(part) > 2:
                P = np.array(part)[:, :3]
                total += 0.5 * np.linalg.norm(np.cross(P[1:-1] - P[0], P[2:] - P[0]).sum(axis=0))
    return total


def topology(sheet) -> tuple:
    kept = sheet.subset().surface
    return kept.n, kept.m, euler_characteristic(kept.F, kept.edges), pieces(kept.F, kept.edges)[0], len(kept.loops)


# --- closed forms


@pytest.mark.parametrize(("a", "b"), [(0.1, 0.05), (0.3, -0.12), (0.02, 0.2), (0.5, -0.2)])
def test_stripes_that_widen_along_a_plate_have_exact_edges(a, b):
    """|f x - k| < a + b x  lies between  x = (k - a) / (f + b)  and  x = (k + a) / (f - b)."""
    plate, f = jittered(grid(7, 4, 2.0, 1.0)), 3.3
    x = plate.V[:, 0]
    sheet = cut(plate, [band(f * x, a + b * x)], [np.arange(-2, 10)], snap=0)
    k = np.arange(-2, 10)
    edges = np.clip([(k - a) / (f + b), (k + a) / (f - b)], 0, 2)
    assert area_of(sheet) == pytest.approx((edges[1] - edges[0]).sum(), rel=1e-12)
    lines = np.concatenate([(k - a) / (f + b), (k + a) / (f - b)])
    border = np.unique(sheet.subset().surface.edges.ends[sheet.subset().surface.edges.boundary])
    at = sheet.subset().surface.V[border]
    inside = (at[:, :2] > 1e-9).all(axis=1) & (at[:, 0] < 2 - 1e-9) & (at[:, 1] < 1 - 1e-9)
    assert np.abs(at[inside, 0][:, None] - lines).min(axis=1).max() < 1e-13
    check_laws(plate, sheet)


@pytest.mark.parametrize("snap", [0.0, 0.05])
def test_stripes_run_out_into_tips_where_their_width_is_zero(snap):
    """d = b y: wedges of area 2 b / (2 f) each; at y = 0 every wedge ends in one vertex."""
    plate, f, b = jittered(grid(9, 6, 2.0, 1.0)), 4.0, 0.3
    x, y = plate.V[:, 0] + 0.1, plate.V[:, 1]
    sheet = cut(plate, [band(f * x, b * y)], [np.arange(0, 12)], snap=snap)
    assert area_of(sheet) == pytest.approx(8 * b / f, rel=1e-12 if snap == 0 else 0.02)
    kept = sheet.subset().surface
    assert pieces(kept.F, kept.edges)[0] == 8
    assert (np.bincount(kept.F.ravel())[kept.V[:, 1] == 0] > 0).sum() == 8
    check_laws(plate, sheet)


def test_gaps_close_where_the_half_width_reaches_a_half():
    """d from 0.2 to 0.5 across the plate: beyond y = 0.5 nothing is cut, the gaps before it are wedges."""
    plate = grid(10, 10, 2.0, 1.0)
    x, y = plate.V[:, 0] + 0.0137, plate.V[:, 1]
    d = np.minimum(0.2 + 0.6 * y, 0.5)
    sheet = cut(plate, [band(4 * x, d)], [np.arange(-1, 12)], snap=0)
    assert area_of(sheet) == pytest.approx(2 - 2 * 0.5 * (1 - 0.4) / 2, rel=1e-12)
    new = sheet.surface.V[plate.n :]
    assert new[:, 1].max() <= 0.5 + 1e-12
    assert pieces(sheet.subset().surface.F, sheet.subset().surface.edges)[0] == 1
    check_laws(plate, sheet)


def test_negative_widths_are_void_and_the_tip_may_lie_within_a_face():
    plate = jittered(grid(3, 3, 1.0, 1.0))
    x, y = plate.V[:, 0], plate.V[:, 1]
    sheet = cut(plate, [band(x, 0.4 * y - 0.1)], [[0.47]], snap=0)
    assert area_of(sheet) == pytest.approx(0.75 * 0.6 / 2, rel=1e-12)
    assert sheet.subset().surface.V[:, 1].min() == pytest.approx(0.25, abs=1e-12)
    check_laws(plate, sheet)


# --- the same sheet as by one field, where the width is constant


@settings(max_examples=60, deadline=None, derandomize=True)
@example(name="flat", d=0.25, frequency=7.0, snap=0.2, seed=5)  # a corner as far from the line above as from that below
@given(
    name=st.sampled_from(list(ZOO)),
    d=st.floats(0.05, 0.45),
    frequency=st.floats(1, 9),
    snap=st.sampled_from([0.0, 0.05, 0.2]),
    seed=st.integers(0, 99),
)
def test_constant_width_gives_the_sheet_of_one_field(name, d, frequency, snap, seed):
    surface = ZOO[name]()
    z = frequency * (surface.V / surface.size) @ np.random.default_rng(seed).normal(size=3)
    k = integers(z)
    levels = np.stack([k - d, k + d], axis=1).ravel()
    # a line nearer to a vertex than that leaves a corner whose stripe is thinner than stripes of two fields are made
    assume(snap or np.abs(z[:, None] - levels).min() > LEVEL_GAP * np.ptp(z))
    one = cut(surface, [z], [levels], snap=snap)
    two = cut(surface, [band(z, np.full(surface.n, d))], [k], snap=snap)
    assert area_of(two) == pytest.approx(area_of(one), rel=1e-12)
    assert (two.surface.n, two.surface.m) == (one.surface.n, one.surface.m)
    assert one.material.any() == two.material.any()
    if one.material.any():
        assert topology(two) == topology(one)
    places = [s.surface.V[np.lexsort(np.round(s.surface.V / surface.size, 9).T)] for s in (one, two)]
    assert places[0] == pytest.approx(places[1], abs=1e-9 * surface.size)


def test_nothing_is_cut_where_all_or_nothing_is_material():
    surface = sphere(2)
    z = 5 * surface.V[:, 2] + 0.123
    for d, material in ((0.5, True), (0.6, True), (0.0, False), (-0.1, False)):
        sheet = cut(surface, [band(z, np.full(surface.n, d))], [integers(z)])
        assert sheet.surface.m == surface.m
        assert sheet.material.all() == sheet.material.any() == material


# --- laws


@zoo
def test_band_areas_equal_the_areas_of_clipped_polygons(name):
    surface = ZOO[name]()
    rng = np.random.default_rng(7)
    z = 4 * surface.V[:, 0] / surface.size + 0.4 * rng.normal(size=surface.n)
    fields = band(z, np.clip(rng.uniform(-0.3, 0.8, surface.n), 0, 0.5))
    levels = integers(z)
    sheet = cut(surface, [fields], [levels], snap=0)
    assert area_of(sheet) == pytest.approx(clipped_area(surface, fields, levels), rel=1e-10)
    assert material_area(surface, [fields], [levels], snap=0) == pytest.approx(area_of(sheet), rel=1e-12)
    check_laws(surface, sheet)


@st.composite
def cases(draw):
    """Random meshes; middles and half-widths random, rounded onto levels, a rounding beside them, or flat in places."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    xy = rng.uniform(size=(draw(st.integers(4, 22)), 2))
    surface = Surface(np.c_[xy, draw(st.sampled_from([0.0, 0.5])) * rng.normal(size=len(xy))], Delaunay(xy).simplices)
    fields = []
    for _ in range(draw(st.integers(1, 2))):
        z, d = 2 * rng.normal(size=surface.n), rng.uniform(-0.2, 0.7, surface.n)
        kind = draw(st.sampled_from(["random", "rounded", "near", "flat", "thin", "wide"]))
        if kind != "random":
            z, d = np.round(4 * z) / 4, np.round(4 * d) / 4
        if kind == "near":
            noise = [0, 1e-16, 1e-12, -1e-10, 1e-8, -1e-6, 1e-3]
            z, d = z + rng.choice(noise, surface.n), d + rng.choice(noise, surface.n)
        if kind == "flat":
            z[surface.F[rng.integers(surface.m, size=3)]] = 0.25
            d[surface.F[rng.integers(surface.m, size=3)]] = 0.25
        if kind == "thin":
            d = rng.choice([0, 1e-14, 1e-9, 1e-5, 1e-2], surface.n)
        if kind == "wide":
            d = 0.5 - rng.choice([0, 1e-14, 1e-9, 1e-5, 1e-2], surface.n)
        fields.append(band(z, np.clip(d, 0, 0.5)))
    return surface, fields, draw(st.sampled_from([0.0, 0.05, 0.3]))


@pytest.mark.slow
@settings(max_examples=150, deadline=None, derandomize=True)
@given(cases())
def test_laws_hold_on_random_meshes_with_degenerate_bands(case):
    surface, fields, snap = case
    levels = [integers(f) for f in fields]
    sheet = cut(surface, fields, levels, snap=snap)
    check_laws(surface, sheet)
    points, cell = points_in_cells(sheet, 3)
    family, closeness = np.full(len(points), -1), np.full(len(points), np.inf)
    for k in reversed(range(len(fields))):
        u, v = (points @ fields[k]).T
        family[np.floor(u) > np.floor(v)] = k
        closeness = np.minimum(closeness, np.abs(np.stack([u - np.round(u), v - np.round(v)])).min(axis=0))
    wrong = family != sheet.family[cell]
    reach = max(np.abs(np.diff(f[surface.edges.ends], axis=1)).max() for f in fields)
    # a value moves by the snap fraction; one that moves along with another, by the larger range of the two
    assert closeness[wrong].max(initial=0) <= max(snap + min(snap, 1e-3), 3e-6) * reach + 1e-14


def test_tips_that_touch_are_pinches_that_are_joined_or_split():
    """Width |x| / 2 about the line y = 0: two wedges meet tip to tip at x = 0, on a vertex of the plate."""
    plate = grid(10, 10, 2.0, 2.0)
    x, y = plate.V[:, 0] - 1, plate.V[:, 1] - 1
    sheet = cut(plate, [band(y, np.abs(x) / 2)], [[0.0]], snap=0)
    assert area_of(sheet) == pytest.approx(1.0, rel=1e-12)
    assert len(manifold_faults(sheet.subset().surface.F, sheet.subset().surface.edges, sheet.subset().surface.n)) == 1
    for rule, count in (("join", 1), ("split", 2)):
        pinched = resolve_pinches(sheet, 0.05, rule)
        kept = pinched.sheet.subset().surface
        assert pinched.pinches == 1
        assert manifold_faults(kept.F, kept.edges, kept.n) == ()
        assert pieces(kept.F, kept.edges)[0] == count


# --- degenerate values, by rule


@pytest.mark.parametrize(
    ("z", "d", "families"),
    [
        ((0, 0, 0), (0.2, 0.2, 0.2), {0}),  # a flat face within a stripe
        ((0.5, 0.5, 0.5), (0.2, 0.2, 0.2), {-1}),  # between two
        ((0.2, 0.2, 0.2), (0.2, 0.2, 0.2), {-1}),  # wholly on the upper edge of a stripe: void
        ((0.8, 0.8, 0.8), (0.2, 0.2, 0.2), {-1}),  # on the lower edge: void
        ((0, 0, 0), (0, 0, 0), {-1}),  # no width
        ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5), {0}),  # no gap
        ((0, 0, 1), (0, 0, 0.5), {0, -1}),  # t < 1/2 t nowhere, 1 - t < 1/2 t from t = 2/3
        ((0, 0, 0), (0, 0, 0.3), {0}),  # the width grows from a side on the middle
        ((0, 0, 1), (0.1, 0.1, 0.1), {0, -1}),
    ],
)
def test_degenerate_values_follow_the_rule(z, d, families):
    face = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    sheet = cut(face, [band(np.array(z, float), np.array(d, float))], [np.arange(-2, 4)], snap=0)
    assert set(sheet.family.tolist()) == families
    check_laws(face, sheet)


def test_fields_of_other_shapes_are_refused():
    surface = sphere(1)
    with pytest.raises(ValueError, match=r"\(18,\) or \(18, 2\), got \(18, 3\)"):
        cut(surface, [surface.V], [[0.1]])
    with pytest.raises(PatternError, match=r"not finite at 1 of 18 vertices \(first: 3\)"):
        cut(surface, [np.where(np.arange(18)[:, None] == 3, np.nan, surface.V[:, :2])], [[0.1]])
