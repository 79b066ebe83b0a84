"""Cones of needles, and a check of a new mesh."""

import numpy as np
import pytest

from dsfab.surface import Surface
from dsfab.surface.mesh import nearest_places
from dsfab.surface.remesh.features import design_features
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.shapes import fan


def samples(surface: Surface, edges: np.ndarray, count: int = 9) -> np.ndarray:
    """(k, 3) points along marked edges."""
    t = np.linspace(0, 1, count)[:, None, None]
    a, b = surface.V[surface.edges.ends[edges]].transpose(1, 0, 2)
    return ((1 - t) * a + t * b).reshape(-1, 3)


def farthest(points: np.ndarray, surface: Surface, edges: np.ndarray) -> float:
    """The largest distance of points from marked edges, metres; 0 of no points."""
    if not len(points):
        return 0.0
    return float(nearest_places(points, surface.V, surface.edges.ends[edges]).distance.max())


def check_kept(old: Surface, new: Surface, edge: float, tolerance: float = 0.02) -> None:
    """Boundaries both ways, creases, vertices on the surface, extent, topology and sides."""
    assert farthest(samples(old, old.edges.boundary), new, new.edges.boundary) <= tolerance * edge
    assert farthest(samples(new, new.edges.boundary), old, old.edges.boundary) <= tolerance * edge
    inner = design_features(old, edge) & ~old.edges.boundary
    every = np.ones(len(new.edges.ends), dtype=bool)
    assert farthest(samples(old, inner), new, every) <= tolerance * edge
    assert nearest_places(new.V, old.V, old.F).distance.max() <= 1e-9 * old.size
    assert new.V.min(axis=0) == pytest.approx(old.V.min(axis=0), abs=1e-12 * old.size)
    assert new.V.max(axis=0) == pytest.approx(old.V.max(axis=0), abs=1e-12 * old.size)
    assert euler_characteristic(new.F, new.edges) == euler_characteristic(old.F, old.edges)
    assert pieces(new.F, new.edges)[0] == pieces(old.F, old.edges)[0]
    assert len(new.loops) == len(old.loops)
    assert len(manifold_faults(new.F, new.edges, new.n)) == len(manifold_faults(old.F, old.edges, old.n))


def cone_of_needles(count: int) -> Surface:
    """A flat cone of needles about its tip."""
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return fan(5 * np.c_[np.cos(t), np.sin(t)], top=1.0)
