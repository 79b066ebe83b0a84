"""Estimates of compliance, buckling and frequency from several meshes, and largest stress away from corners."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, weighted_quantile
from dsfab.statics import LAYERS, SheetStress
from dsfab.surface import Surface

EXTRAPOLATION_DIVISOR = 2.0  # d in extrapolated compliance c1 + (c1 - c0) / d; c0: coarse mesh, c1: finer mesh
LEAST_BOUND = 0.003  # smallest relative error bound: the calibration table itself has errors of 0.1 to 0.2 %
QUICK_ERRORS = (0.02, 0.05)  # median and 90 % quantile of the relative error of a quick solve
LEAST_EDGES_PER_MEMBER = 4.0  # dsfab warns of members narrower than 4 edges of the uncut mesh


@dataclass(frozen=True)
class ComplianceEstimate:
    """Estimated compliance of a sheet: `value` (J), and the error bound divided by the compliance (`bound`)."""

    value: float
    bound: float


def estimate(values: Sequence[float], spread: float, recovery: float) -> ComplianceEstimate:
    """Return the compliance and its error bound, extrapolated from several meshes.
    values   : compliances (J) by quadratic + hhj elements. Each mesh has four times the triangles of the previous mesh.
    spread   : compliance by midedge elements on the first mesh, divided by values[0], minus 1.
    recovery : energy of the stress error on the finest mesh, divided by the compliance."""
    of_step, of_spread, of_recovery, of_rates = 0.6, 0.4, 0.3, 0.75  # factors of error terms, from calibration.csv
    if len(values) < 2:
        # for 19 of 20 designs, the relative error of the compliance is at most 1.7 x recovery
        return ComplianceEstimate(values[0], max(1.7 * recovery, of_spread * abs(spread), LEAST_BOUND))
    step = values[-1] - values[-2]
    usual_limit, own_limit = values[-1] + step / EXTRAPOLATION_DIVISOR, limit_at_own_rate(values)
    value = (usual_limit + own_limit) / 2
    remaining_spread = abs(spread) / 2 ** (len(values) - 1)
    steps = max(of_step * abs(step), of_rates * abs(own_limit - usual_limit)) / value
    return ComplianceEstimate(value, max(steps, of_spread * remaining_spread, of_recovery * recovery, LEAST_BOUND))


def limit_at_own_rate(values: Sequence[float]) -> float:
    """Return the limit of `values` on finer and finer meshes, if their differences shrink by a constant ratio."""
    step, before = values[-1] - values[-2], values[-2] - values[-3] if len(values) > 2 else 0.0
    if before * step <= 0:
        return values[-1] + step / EXTRAPOLATION_DIVISOR
    return values[-1] + step / (min(max(before / step, STEP_RATIOS[0]), STEP_RATIOS[1]) - 1)


WIDEST_MODE_BOUND = 0.05  # two meshes suffice if each mode's relative error bound is at most this
STEP_RATIOS = (1.5, 4.0)
"""Smallest and largest ratio of a step to the next step that an extrapolation uses.
A step is the difference of a result on two successive meshes. Below the smallest ratio, steps do not clearly shrink."""


@dataclass(frozen=True)
class ModeEstimate:
    """Estimate (`value`) of the lowest buckling factor, or of the lowest frequency (Hz).
    bound : relative error bound; inf for one mesh.
    ratio : (second - first value) / (third - second value) for three meshes, else None."""

    value: float
    bound: float
    ratio: float | None = None

    @property
    def finite_bound(self) -> float | None:
        """The relative error bound; None if only one mesh was solved."""
        return self.bound if self.bound < float("inf") else None


def mode_estimate(values: Sequence[float]) -> ModeEstimate:
    """Estimate a buckling factor or frequency from its values on one to three meshes, coarse to fine.
    Each mesh has four times the triangles of the previous mesh."""
    if len(values) < 2:
        return ModeEstimate(values[0], float("inf"))
    finest, step = values[-1], values[-1] - values[-2]
    if len(values) == 2:
        value = finest + step / EXTRAPOLATION_DIVISOR
        return ModeEstimate(value, max(abs(step) / value, LEAST_BOUND))
    before = values[-2] - values[-3]
    ratio = before / step if step else float("inf")
    if ratio < STEP_RATIOS[0]:
        error = abs(step) if abs(ratio) >= STEP_RATIOS[0] else max(abs(step), abs(before))
        return ModeEstimate(finest, max(2 * error / finest, LEAST_BOUND), ratio)
    extension = step / (min(ratio, STEP_RATIOS[1]) - 1)
    return ModeEstimate(finest + extension, max(abs(extension) / (finest + extension), LEAST_BOUND), ratio)


REENTRANT_ANGLE = np.radians(30)  # a corner is reentrant if its angle exceeds 180 degrees by this value


@dataclass(frozen=True)
class Extreme:
    """Largest value of a quantity on a surface.
    place : point (m) with this value.    quantile : value that is not exceeded on 99 % of the area.
    away  : largest value far from corners; None if unknown."""

    value: float
    place: tuple[float, float, float]
    quantile: float
    away: float | None = None

    @property
    def settled(self) -> float:
        """Largest value far from corners, if known; else the largest value everywhere."""
        return self.value if self.away is None else self.away


def stress_extremes(surface: Surface, stress: SheetStress, supported: Bools) -> dict[str, Extreme]:
    """Return the largest stresses (Pa) in all layers of a sheet, by name.
    Names: `stress` (von Mises), `tension` and `compression` (principal stresses, at least 0).
    supported : (n,) mask of supported vertices."""
    principal = np.stack([stress.principal(layer).values for layer in LAYERS], axis=1)
    values = {
        "stress": stress.largest,
        "tension": np.maximum(principal[..., 0].max(axis=1), 0),
        "compression": np.maximum(-principal[..., 1].min(axis=1), 0),
    }
    off_corner_faces = off_corners(surface, supported)
    return {name: extreme(surface, value, off_corner_faces) for name, value in values.items()}


def extreme(surface: Surface, value: Floats, off_corner_faces: Bools | None = None) -> Extreme:
    """Return the largest value (m,) of all faces. off_corner_faces : (m,) mask of the faces far from corners."""
    worst = int(value.argmax())
    x, y, z = (float(v) for v in surface.centroids[worst] + 0.0)
    away = float(value[off_corner_faces].max()) if off_corner_faces is not None and off_corner_faces.any() else None
    return Extreme(float(value[worst]), (x, y, z), quantile(value, surface.areas), away)


def quantile(value: Floats, weight: Floats, share: float = 0.99) -> float:
    """Return the weighted quantile of k values. weight : (k,) weights.    share : quantile, 0 to 1."""
    return weighted_quantile(value, weight, share)


def off_corners(surface: Surface, supported: Bools) -> Bools:
    """Return a mask (m,) of the faces far from reentrant corners and ends of supports. supported : (n,) vertices."""
    corners = np.concatenate([inward_corners(surface), support_ends(surface, supported)])
    if not len(corners):
        return np.ones(surface.m, dtype=bool)
    distances, _ = cKDTree(surface.V[corners]).query(surface.centroids)
    # for sheets without openings, rib_width is large
    return np.asarray(distances > min(rib_width(surface), 0.05 * surface.size))


def rib_width(surface: Surface) -> float:
    """Return the mean width of a cut sheet's members, metres: 2 * area / length of the border; inf without a border."""
    length = float(surface.edge_lengths[surface.edges.boundary].sum())
    return 2 * surface.area / length if length else float("inf")


def inward_corners(surface: Surface) -> Ints:
    """Return the numbers (c,) of reentrant border vertices: the angle of the material there exceeds 210 degrees."""
    X = surface.V[surface.F]
    ahead, back = np.roll(X, -1, axis=1) - X, np.roll(X, 1, axis=1) - X
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, back), axis=2), (ahead * back).sum(axis=2))
    around = np.bincount(surface.F.ravel(), angle.ravel(), surface.n)
    border = np.zeros(surface.n, dtype=bool)
    border[surface.edges.ends[surface.edges.boundary]] = True
    return np.flatnonzero(border & (around > np.pi + REENTRANT_ANGLE))


def support_ends(surface: Surface, supported: Bools) -> Ints:
    """Return the numbers (c,) of supported border vertices with an unsupported neighbour on the border."""
    ends = surface.edges.ends[surface.edges.boundary]
    mixed = ends[supported[ends].sum(axis=1) == 1]
    return np.unique(mixed[supported[mixed]])
