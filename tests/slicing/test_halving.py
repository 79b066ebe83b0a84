"""Lines that crowd are left out: on a fan of rays between rings, where every level is known."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from dsfab.core.arrays import split_value
from dsfab.pattern import CornerPhase, EvenFamily, Stripes, Widths
from dsfab.slicing import chart_of, cut, halve_lines
from dsfab.slicing.measures.chart import equal_row_groups
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField, hat_gradients
from tests.shapes import grid, jittered

RAYS, RINGS = 32, 7
"""Periods of the rays over half a turn, and of the rings from the inner to the outer edge."""


def half_ring() -> tuple[Surface, np.ndarray, np.ndarray]:
    """Half a ring of radii 1 to 8, the phase of rays (an angle) and that of rings (a radius)."""
    flat = jittered(grid(40, 24, np.pi, 3.0), 0.1)
    angle, r = flat.V[:, 0], 2 ** flat.V[:, 1]
    surface = Surface(np.c_[r * np.cos(angle), r * np.sin(angle), 0 * r], flat.F[:, ::-1])
    return surface, RAYS * angle / np.pi + 0.21, RINGS * (r - 1) / 7 + 0.37


def phase(surface: Surface, z: np.ndarray, seed: int = 0) -> CornerPhase:
    """The same with random signs and shifts for a seed."""
    if not seed:
        return CornerPhase(z, np.ones((surface.m, 3)), np.zeros((surface.m, 3)), np.zeros(surface.m, bool))
    rng = np.random.default_rng(seed)
    s, f = rng.choice([-1.0, 1.0], surface.n), rng.choice([-1.0, 1.0], surface.m)
    k, q = 8.0 * rng.integers(-2, 3, surface.n), 8.0 * rng.integers(-2, 3, surface.m)
    sign = f[:, None] * s[surface.F]
    return CornerPhase(s * z + k, sign, q[:, None] - sign * k[surface.F], np.zeros(surface.m, bool))


@cache
def example(seed: int = 0):
    """Rays are to be as far apart at the outside as they are, inside half and a quarter as many: r = 8, 4, 2."""
    surface, rays, rings = half_ring()
    r = np.linalg.norm(surface.centroids, axis=1)
    wish = np.clip(np.log2(8 / r), 0, 3)
    phases = phase(surface, rays, seed), phase(surface, rings, seed)
    given = halve_lines(surface, (phases[0].field, phases[1].field), (wish, 0 * wish), (3, 0))
    return surface, phases, wish, given


def radii(given) -> tuple[np.ndarray, np.ndarray]:
    """(c,) the smallest and the largest radius of each polygon."""
    cells = given.mesh.cells
    r = np.linalg.norm(given.mesh.X, axis=1)[cells.corner]
    return cells.per_polygon(np.minimum, r), cells.per_polygon(np.maximum, r)


@pytest.mark.parametrize("seed", [0, 1])
def test_levels_rise_where_lines_crowd(seed):
    _surface, _, _wish, given = example(seed)
    level = given.level[:, 0]
    assert set(level.tolist()) == {0, 1, 2}
    assert (given.level[:, 1] == 0).all()
    middle = 0.5 * sum(radii(given))
    off = level - np.floor(np.log2(8 / middle))
    assert np.abs(off).max() <= 1
    assert (off == 0).mean() > 0.6
    rank = np.argsort(middle, kind="stable")
    assert np.corrcoef(rank.argsort(), level)[0, 1] < -0.8


@pytest.mark.parametrize("seed", [0, 1])
def test_a_level_belongs_to_an_opening_between_rings(seed):
    """Openings lie between rings and coarse rays: each polygon's level is told by its ring's mean wish there."""
    surface, _, wish, given = example(seed)
    _, rays, rings = half_ring()
    cells, weights = given.mesh.cells, given.mesh.weights
    centre = lambda z: cells.per_polygon(np.add, (weights @ z)[cells.corner]) / cells.sizes  # noqa: E731
    opening = np.floor(centre(rings)) * 1000 + np.floor(centre(rays) / 8)
    area = cells.areas(given.mesh.X)[0]
    for one in np.unique(opening):
        here = opening == one
        main = np.bincount(given.level[here, 0], area[here])
        assert main.max() > 0.97 * area[here].sum()  # lines move by 5 % of an edge onto vertices
        mean = np.average(wish[given.mesh.parent[here]], weights=area[here])
        if abs(mean - np.rint(mean)) > 0.05 and area[here].sum() > surface.mean_edge**2:
            assert main.argmax() == np.floor(mean)


@pytest.mark.parametrize("seed", [0, 1])
def test_lines_end_on_rings(seed):
    """Along the edges between polygons of other levels a phase is whole, and a multiple that is drawn on both sides."""
    _, _, _, given = example(seed)
    one, two, _ = given.mesh.neighbours
    owner = given.mesh.cells.owner
    differ = given.level[owner[one], 0] != given.level[owner[two], 0]
    assert differ.any()
    a = given.mesh.cells.corner[one[differ]]
    b = given.mesh.cells.next_values(given.mesh.cells.corner)[one[differ]]
    z = [_at_vertices(given, k) for k in (0, 1)]
    on_ring = [np.abs(z[1][v] - np.rint(z[1][v])) < 1e-9 for v in (a, b)]
    on_ray = [np.abs(z[0][v] / 8 - np.rint(z[0][v] / 8)) < 1e-9 for v in (a, b)]
    assert ((on_ring[0] & on_ring[1]) | (on_ray[0] & on_ray[1])).all()


def _at_vertices(given, k: int) -> np.ndarray:
    """The snapped phase of a family, up to sign and multiples of 8."""
    from dsfab.slicing.cutting.corner_fields import PolygonField

    return PolygonField.from_field(given.mesh, given.phases[k]).values[:, 0]


@pytest.mark.parametrize("seed", [0, 1])
def test_wanted_and_left_areas_sum_to_the_area_of_the_faces(seed):
    surface, _, _, given = example(seed)
    area = given.mesh.cells.areas(given.mesh.X)[0]
    assert area.sum() == pytest.approx(surface.area, rel=1e-9)
    for k in (0, 1):
        wanted = np.array([given.drawn_share(surface, k, level) for level in range(4)])
        assert (np.diff(wanted, axis=0) >= -1e-12).all()
        assert wanted[3] == pytest.approx(1)
        shares = np.diff(wanted, axis=0, prepend=0)
        assert given.mean_scale(surface, k) == pytest.approx(0.5 ** np.arange(4) @ shares, rel=1e-9)
        assert wanted[0] @ surface.areas == pytest.approx(area[given.level[:, k] == 0].sum(), rel=1e-9)


def ring_levels(wish: Callable[[np.ndarray], np.ndarray]) -> list[float]:
    """Mean level of four openings from the inside, and of the rest, halved once at most; wish of radii."""
    surface, rays, rings = half_ring()
    asked = wish(np.linalg.norm(surface.centroids, axis=1))
    fields = phase(surface, rays).field, phase(surface, rings).field
    given = halve_lines(surface, fields, (asked.clip(0, 1), 0 * asked), (1, 0), (asked, 0 * asked))
    area, middle = given.mesh.cells.areas(given.mesh.X)[0], sum(radii(given)) / 2
    ring = np.floor(middle - 0.63).clip(0, 4).astype(int)
    return (np.bincount(ring, area * given.level[:, 0]) / np.bincount(ring, area)).tolist()


def test_the_mean_wish_of_an_opening_counts_if_it_makes_stripes_more_even():
    """In three rings every other face wishes for 2.7 halvings, the others for 0.5: for 1.6 in the mean, and for 0.75
    if only one is counted; then what is wished for and what is done would be 2.7 powers of two apart, not 2.2."""
    levels = ring_levels(lambda r: np.where(r < 3.6, np.where(np.arange(len(r)) % 2, 2.7, 0.5), 0.0))
    assert levels == pytest.approx([1, 1, 1, 0, 0], abs=0.03)


def test_the_mean_wish_of_an_opening_is_ignored_if_it_gains_little():
    """A fortieth of the area wishes for 1.6 and 0.8 halvings: 1.2 in the mean, and 0.9 where one is the most."""
    assert ring_levels(lambda r: np.where(r < 1.63, np.where(np.arange(len(r)) % 2, 1.6, 0.8), 0.0)) == [0] * 5


def test_without_halving_nothing_is_divided():
    surface, rays, rings = half_ring()
    fields = phase(surface, rays).field, phase(surface, rings).field
    given = halve_lines(surface, fields, (np.ones(surface.m), np.ones(surface.m)), (0, 0))
    assert len(given.mesh.parent) == surface.m
    assert not given.level.any()


@pytest.mark.parametrize("seed", [0, 1])
def test_a_chart_is_the_surface_with_one_phase_at_every_vertex(seed):
    surface, _, _, given = example(seed)
    _, rays, _rings = half_ring()
    chart = chart_of(given)
    assert chart.surface.area == pytest.approx(surface.area, rel=1e-9)
    assert chart.carry(surface.V) == pytest.approx(chart.surface.V, abs=1e-12)
    assert set(np.unique(chart.scale[:, 0])) == {1.0, 0.5, 0.25}
    scale = chart.scale[chart.surface.F]
    assert (scale == scale[:, :1]).all()
    # lines that are drawn are where the chart's phase is whole: at the same places as those of the fan, to the snap
    own = chart.carry(rays) * chart.scale[:, 0]
    off = np.abs(np.abs(chart.z[:, 0] - np.rint(chart.z[:, 0])) - np.abs(own - np.rint(own)))
    assert np.percentile(off, 90) < 0.02
    assert off.max() < 0.2
    g = np.linalg.norm(np.einsum("mcx,mc->mx", hat_gradients(chart.surface), chart.z[:, 0][chart.surface.F]), axis=1)
    r = np.linalg.norm(chart.surface.centroids, axis=1)
    asked = RAYS / np.pi / r * scale[:, 0, 0]
    big = chart.surface.areas > 0.02 * surface.mean_edge**2
    assert np.percentile(np.abs(g[big] / asked[big] - 1), 90) < 0.1


def test_a_chart_is_cut_open_at_seams_only():
    _surface, _, _, given = example(0)
    chart = chart_of(given)
    _V, at = np.unique(np.round(chart.surface.V, 9), axis=0, return_inverse=True)
    copies = np.bincount(at.ravel())
    at_change = np.zeros(len(given.mesh.X), bool)
    one, two, _ = given.mesh.neighbours
    differ = given.level[given.mesh.cells.owner[one], 0] != given.level[given.mesh.cells.owner[two], 0]
    at_change[given.mesh.cells.corner[one[differ]]] = True
    at_change[given.mesh.cells.next_values(given.mesh.cells.corner)[one[differ]]] = True
    assert (copies > 1).sum() == at_change.sum()


def test_a_chart_marks_faces_without_a_phase():
    surface, rays, rings = half_ring()
    field = phase(surface, rays).field
    blank = np.arange(surface.m) % 50 == 7
    given = halve_lines(surface, (replace(field, blank=blank), phase(surface, rings).field), (0 * rays,) * 2, (0, 0))
    chart = chart_of(given)
    marked = (chart.scale[chart.surface.F, 0] == 0).all(axis=1)
    assert np.array_equal(marked, blank[chart.parent])
    assert (chart.z[chart.surface.F[marked], 0] == 0.5).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_the_layers_draw_half_as_many_rays_inside(seed):
    """Cut by layers: the coarse lines everywhere, then finer ones where they are wanted, with no loose end."""
    surface, phases, _, given = example(seed)
    r = np.linalg.norm(surface.V, axis=1)
    slope = RAYS / np.pi / r
    wanted = tuple(given.drawn_share(surface, 0, level) for level in range(3))
    one = np.ones(surface.n)
    rays = EvenFamily("major", Stripes(1.0, 0.0, 0.5), phases[0], wanted, slope, slope, one)
    rings = EvenFamily("minor", Stripes(1.0, 0.0, 0.5), phases[1], (), one, one, one)
    layers = [*rings.layers(Widths()), *rays.layers(Widths())]
    assert [layer.name for layer in layers] == ["minor"] + ["major"] * 4
    assert all(isinstance(layer.field, CornerField) for layer in layers)
    sheet = cut(surface, [layer.field for layer in layers], [layer.levels for layer in layers], 0)
    r, angle = _polar(sheet.surface.centroids)
    for family, period, offset in ((1, 8, 0), (2, 8, 4), (3, 4, 2), (4, 2, 1)):
        here = sheet.family == family
        line = np.rint(RAYS * angle[here] / np.pi + 0.21)
        assert here.any() or family == 4
        assert (np.mod(line, period) == offset).mean() > 0.98
    assert r[sheet.family == 4].min(initial=8.0) > r[sheet.family == 3].min() > r[sheet.family == 1].min()


def _polar(V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.linalg.norm(V, axis=1), np.arctan2(V[:, 1], V[:, 0])


@pytest.mark.parametrize(
    ("means", "wanted"),
    [
        ([0.2, 0.9, 1.1], 1.0),  # none is near
        ([0.8, 0.99, 1.01, 1.02, 1.35], 0.945),  # one ring: all of it; others are out of reach beyond 0.9 and 1.1
        ([0.93, 0.98, 1.01, 1.02, 1.35], 1.06),  # none of it, as the next is nearer below
        ([0.93, 0.96, 1.03, 1.07], 0.995),  # between two
    ],
)
def test_openings_that_are_alike_are_halved_alike(means, wanted):
    assert split_value(np.array(means), 1) == pytest.approx(wanted)


def test_equal_rows_are_grouped_as_by_numpy_unique():
    """Against numpy: the same groups, in the order in which they come first."""
    rng = np.random.default_rng(4)
    key = rng.integers(0, 40, 300)
    rows = np.stack([rng.integers(0, 2, 300), rng.integers(0, 2, 300)], axis=1).astype(float)
    leads, of = equal_row_groups(key, rows)
    _, first, inverse = np.unique(np.column_stack([key, rows]), axis=0, return_index=True, return_inverse=True)
    assert np.array_equal(leads, np.sort(first))
    assert np.array_equal(leads[of], first[inverse.ravel()])
