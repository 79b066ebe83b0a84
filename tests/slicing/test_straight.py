"""Straight lines over a sheet: closed forms on a strip, whatever its triangles, its folds and their orientation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsfab.slicing.measures.widths import far_ends
from dsfab.surface import Surface

LONG, WIDE = 3.0, 0.7


def shaken_strip(seed: int, nx: int = 12, ny: int = 5) -> Surface:
    """A flat strip of shaken vertices and random diagonals; shaken by more, a face could be turned over."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, LONG, nx), np.linspace(0, WIDE, ny), indexing="ij")
    shake = rng.uniform(-0.2, 0.2, (nx, ny, 2)) * [LONG / (nx - 1), WIDE / (ny - 1)]
    shake[[0, -1], :, 0] = shake[:, [0, -1], 1] = 0
    V = np.stack([x, y], axis=-1) + shake
    k = np.arange(nx * ny).reshape(nx, ny)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    one, two = np.stack([a, b, c, a, c, d], axis=1), np.stack([a, b, d, b, c, d], axis=1)
    F = np.where(rng.random(len(a))[:, None] < 0.5, one, two).reshape(-1, 3)
    return Surface(np.column_stack([V.reshape(-1, 2), np.zeros(nx * ny)]), F)


def lower_edges(flat: Surface) -> np.ndarray:
    """The half-edges along y = 0."""
    edge = np.flatnonzero((flat.V[flat.edges.ends][:, :, 1] == 0).all(axis=1))
    return flat.edges.order[flat.edges.start[:-1][edge]]


def ends_from_below(flat: Surface, F: np.ndarray, V: np.ndarray) -> tuple[np.ndarray, ...]:
    """x on the flat strip where lines start and end, their lengths and slopes, found on V and F."""
    h = lower_edges(flat)
    first, last = F.ravel()[h], np.roll(F, -1, axis=1).ravel()[h]
    length = np.linalg.norm(V[last] - V[first], axis=1)
    found = far_ends(Surface(V, F), h, 0.4 * length)
    x = flat.V[:, 0]
    start = 0.6 * x[first] + 0.4 * x[last]
    one, two = F.ravel()[found.edge], np.roll(F, -1, axis=1).ravel()[found.edge]
    end = x[one] + (x[two] - x[one]) * found.place / np.abs(x[two] - x[one])
    return start, end, found.length, found.slope


@given(seed=st.integers(0, 10**6))
def test_a_line_crosses_a_flat_strip_straight(seed):
    flat = shaken_strip(seed)
    start, end, length, slope = ends_from_below(flat, flat.F, flat.V)
    np.testing.assert_allclose(end, start, atol=1e-12)
    np.testing.assert_allclose(length, WIDE)
    np.testing.assert_allclose(slope, 0, atol=1e-12)


@given(seed=st.integers(0, 10**6), angle=st.floats(-2.5, 2.5))
def test_straight_ends_do_not_depend_on_folds_or_orientation(seed, angle):
    flat = shaken_strip(seed)
    edge = 4 / 11 * LONG  # folded along the edges there: nothing of it is shaken in x
    V, rng = flat.V.copy(), np.random.default_rng(seed)
    V[np.abs(V[:, 0] - edge) < 0.5 * LONG / 11, 0] = edge
    flat = Surface(V, flat.F)
    beyond = np.maximum(V[:, 0] - edge, 0)
    folded = np.column_stack([np.minimum(V[:, 0], edge) + np.cos(angle) * beyond, V[:, 1], np.sin(angle) * beyond])
    start, end, length, _ = ends_from_below(flat, flat.F, folded)
    np.testing.assert_allclose(end, start, atol=1e-12)
    np.testing.assert_allclose(length, WIDE)
    # turned faces: the half-edges are others, the lines the same
    turned = np.where(rng.random(flat.m)[:, None] < 0.5, flat.F, flat.F[:, ::-1])
    other = Surface(flat.V, turned)
    start, end, length, _ = ends_from_below(other, turned, folded)
    np.testing.assert_allclose(end, start, atol=1e-12)
    np.testing.assert_allclose(length, WIDE)


@pytest.mark.parametrize("angle", [5, 20, 40])
def test_a_line_that_meets_a_slanted_side_returns_its_slope(angle):
    """A trapezium whose upper side rises: a line from x meets it at height WIDE + x tan(angle)."""
    rise = np.tan(np.radians(angle))
    V = np.array([[0, 0, 0], [LONG, 0, 0], [LONG, WIDE + LONG * rise, 0], [0, WIDE, 0]])
    one = Surface(V, np.array([[0, 1, 2], [0, 2, 3]]))
    found = far_ends(one, np.array([0, 0]), np.array([0.5, 1.0]))
    assert (found.edge == 4).all()  # from vertex 2 to vertex 3
    np.testing.assert_allclose(found.length, WIDE + np.array([0.5, 1.0]) * rise)
    np.testing.assert_allclose(found.slope, -np.sin(np.radians(angle)))
    np.testing.assert_allclose(found.place, (LONG - np.array([0.5, 1.0])) / np.cos(np.radians(angle)))
