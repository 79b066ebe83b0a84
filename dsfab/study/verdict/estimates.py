"""Estimates from several meshes: compliance with its error bound, and stress away from corners."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, weighted_quantile
from dsfab.statics import LAYERS, SheetStress
from dsfab.surface import Surface

STEP = 2.0
"""Each refinement takes the error to 1 / (1 + STEP) of what it was: two meshes have the value c1 + (c1 - c0) / STEP."""

OF_STEP = 0.6
"""The bound is at least this share of the last step |c1 - c0|."""

OF_SPREAD = 0.4
"""And at least this share of what is left of the spread against quadratic + midedge."""

OF_RECOVERY = 0.3
"""And at least this share of the recovery error, membrane and bending together."""

OWN = 0.75
"""Of three meshes, whose steps shrink at a rate of their own, the value lies half way between what `STEP` and what that
rate carry it on to, and the bound is at least this share of the distance between these two, so half as much again as
either is off. Of ten designs whose fourth mesh is known, neither alone is the better: a vault whose steps first shrink
by 1.6 and then by 2.2 is 1.4 % beyond the one and 3.2 % short of the other."""

FLOOR = 0.003
"""And never less than this: the truth in the table is itself known to 0.1 or 0.2 % only."""

ONE_MESH = 1.7
"""Where one mesh alone was solved, the bound is at least this multiple of its recovery error. It is told (19 of 20
designs keep it), but a compliance is never called converged by one mesh."""

QUICK = (0.02, 0.05)
"""Error of the quick level (hybrid + hhj, as cut): the median, and what nine in ten designs keep."""

MEMBER = 4.0
"""Fewer edges of the uncut mesh across a member are told."""


@dataclass(frozen=True)
class ComplianceEstimate:
    """value : compliance, J.  bound : half width of its interval, over the value."""

    value: float
    bound: float


def estimate(values: Sequence[float], spread: float, recovery: float) -> ComplianceEstimate:
    """From compliances by quadratic + hhj on one or more meshes, each of four times the triangles, coarse to fine.

    spread   : against quadratic + midedge on the first mesh; about half of it is left on each further one, where it is
               not measured: it would cost half as much again.
    recovery : ZZ on the finest mesh.
    """
    if len(values) < 2:
        return ComplianceEstimate(values[0], max(ONE_MESH * recovery, OF_SPREAD * abs(spread), FLOOR))
    step = values[-1] - values[-2]
    usual, own = values[-1] + step / STEP, limit_at_own_rate(values)
    value = (usual + own) / 2
    left = abs(spread) / 2 ** (len(values) - 1)
    steps = max(OF_STEP * abs(step), OWN * abs(own - usual)) / value
    return ComplianceEstimate(value, max(steps, OF_SPREAD * left, OF_RECOVERY * recovery, FLOOR))


def limit_at_own_rate(values: Sequence[float]) -> float:
    """What the values go to at the rate of the last two steps, kept within `STEPS`; at `STEP` where there are two
    values only, or where the last step turns back."""
    step, before = values[-1] - values[-2], values[-2] - values[-3] if len(values) > 2 else 0.0
    if before * step <= 0:
        return values[-1] + step / STEP
    return values[-1] + step / (min(max(before / step, STEPS[0]), STEPS[1]) - 1)


MODES_KNOWN = 0.05
"""A third mesh is solved where buckling or frequency is known less well. Linear buckling itself is off by more."""

STEPS = (1.5, 4.0)
"""Ratios of one step to the next that are believed of three meshes. Corners that bend inwards let the error of an
eigenvalue fall to 1 / 2.1 at best, smooth sheets to 1 / 16; below the first the steps count as not shrinking."""


@dataclass(frozen=True)
class ModeEstimate:
    """value : the lowest load factor, or hertz.   bound : half width of its interval, over the value; inf for one mesh.
    ratio : of the steps between three meshes, None for fewer; each mesh has four times the triangles."""

    value: float
    bound: float
    ratio: float | None = None

    @property
    def known(self) -> float | None:
        """The bound, None for one mesh."""
        return self.bound if self.bound < float("inf") else None


def mode_estimate(values: Sequence[float]) -> ModeEstimate:
    """From the lowest eigenvalue on one to three meshes, each of four times the triangles, coarse to fine.

    Two meshes: the value goes on by half of the step, as a compliance does, and the bound is the whole step: it covers
    ratios of steps from 1.7 up. Three: it goes on at its own ratio, within `STEPS`, and the bound is as far as it went
    on. Where the last step turns back, the last value stands, and the bound is twice that step; where steps do not
    shrink, twice the larger one. Not calibrated on random designs, and about the mesh alone: a thin sheet of perfect
    shape, linear until it buckles.
    """
    if len(values) < 2:
        return ModeEstimate(values[0], float("inf"))
    last, step = values[-1], values[-1] - values[-2]
    if len(values) == 2:
        value = last + step / STEP
        return ModeEstimate(value, max(abs(step) / value, FLOOR))
    before = values[-2] - values[-3]
    ratio = before / step if step else float("inf")
    if ratio < STEPS[0]:
        shrinking = abs(ratio) >= STEPS[0]
        return ModeEstimate(
            last, max(2 * (abs(step) if shrinking else max(abs(step), abs(before))) / last, FLOOR), ratio
        )
    on = step / (min(ratio, STEPS[1]) - 1)
    return ModeEstimate(last + on, max(abs(on) / (last + on), FLOOR), ratio)


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
