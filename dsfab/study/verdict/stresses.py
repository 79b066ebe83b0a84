"""Stress as numbers that finer meshes settle: what most of the area keeps to, and what is found away from corners.

At a corner that bends inwards, and where a support ends, the stress of a linear sheet is infinite [Williams 1952]: what
a mesh shows there grows with every finer one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, weighted_quantile
from dsfab.statics import LAYERS, SheetStress
from dsfab.surface import Surface

QUANTILE = 0.99
"""Share of the area that a stress is told of."""

REENTRANT = np.radians(30)
"""A border that turns into the material by more than this at a vertex has a corner there; less is a rounded outline."""

RIB = 0.05
"""A rib is taken to be no wider than this share of the sheet's size: sheets without openings have none."""


@dataclass(frozen=True)
class Extreme:
    """The largest of a quantity: `value` at `place`, metres; and what `QUANTILE` of the area does not exceed.

    away : the largest further than a rib's width from corners, where `value` of a stress is no number; None of what is
           no stress, and where nothing is so far from them.
    """

    value: float
    place: tuple[float, float, float]
    quantile: float
    away: float | None = None

    @property
    def settled(self) -> float:
        """The largest that a finer mesh does not raise without end: `away`, or `value` where there is none."""
        return self.value if self.away is None else self.away


def stress_extremes(surface: Surface, stress: SheetStress, held: Bools) -> dict[str, Extreme]:
    """Pa, by name: `stress` (von Mises), `tension` and `compression` (the largest principal stress and minus the
    smallest, not under 0), each the largest of both sides and the middle.

    held : (n,) vertices with a support.
    """
    principal = np.stack([stress.principal(layer).values for layer in LAYERS], axis=1)
    values = {
        "stress": stress.largest,
        "tension": np.maximum(principal[..., 0].max(axis=1), 0),
        "compression": np.maximum(-principal[..., 1].min(axis=1), 0),
    }
    far = off_corners(surface, held)
    return {name: extreme(surface, value, far) for name, value in values.items()}


def extreme(surface: Surface, value: Floats, far: Bools | None = None) -> Extreme:
    """Of values of faces (m,). far : (m,) faces that are far from corners."""
    worst = int(value.argmax())
    x, y, z = (float(v) for v in surface.centroids[worst] + 0.0)
    away = float(value[far].max()) if far is not None and far.any() else None
    return Extreme(float(value[worst]), (x, y, z), quantile(value, surface.areas), away)


def quantile(value: Floats, weight: Floats, share: float = QUANTILE) -> float:
    """What of the values (k,) a share of the weights (k,) does not exceed."""
    return weighted_quantile(value, weight, share)


def off_corners(surface: Surface, held: Bools) -> Bools:
    """(m,) faces further than a rib's width from every corner that bends inwards and every end of a support."""
    corners = np.concatenate([inward_corners(surface), support_ends(surface, held)])
    if not len(corners):
        return np.ones(surface.m, dtype=bool)
    near, _ = cKDTree(surface.V[corners]).query(surface.centroids)
    return np.asarray(near > min(rib_width(surface), RIB * surface.size))


def rib_width(surface: Surface) -> float:
    """Metres: the mean width of the members, twice the area over the length of all borders; inf without a border."""
    length = float(surface.edge_lengths[surface.edges.boundary].sum())
    return 2 * surface.area / length if length else float("inf")


def inward_corners(surface: Surface) -> Ints:
    """(c,) vertices of the border around which the material turns by more than half a turn and `REENTRANT`."""
    X = surface.V[surface.F]
    ahead, back = np.roll(X, -1, axis=1) - X, np.roll(X, 1, axis=1) - X
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    angle = np.arctan2(sine, (ahead * back).sum(axis=2))
    around = np.bincount(surface.F.ravel(), angle.ravel(), surface.n)
    border = np.zeros(surface.n, dtype=bool)
    border[surface.edges.ends[surface.edges.boundary]] = True
    return np.flatnonzero(border & (around > np.pi + REENTRANT))


def support_ends(surface: Surface, held: Bools) -> Ints:
    """(c,) held vertices of the border beside one that is not held."""
    ends = surface.edges.ends[surface.edges.boundary]
    mixed = ends[held[ends].sum(axis=1) == 1]
    return np.unique(mixed[held[mixed]])
