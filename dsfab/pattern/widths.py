"""Rules for the widths of stripes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.surface.fields import hat_gradients
from dsfab.surface.mesh import Surface

_End = tuple[float, float]  # (factor, share(factor) - target) at an end of the interval in `solved_factor`
Rule = Literal["plain", "constant", "graded", "stressed"]
SOLID = 0.5  # Half width, in periods, at which neighbouring stripes touch.
ROUNDS = (2, 60)  # Smallest and largest number of rounds of averaging in `spread_means`.
JUMP = 5e-3
"""Largest accepted error of the fraction of material if it jumps because loose ends of members appear or vanish."""


class ShareJumpError(PatternError):
    """No width gives the requested fraction of material, because the fraction jumps."""


@dataclass(frozen=True)
class Widths:
    """Rule for the half width d of stripes at every vertex; z is the phase.
    rule      : "plain"     d = (1 - threshold) / 4 (see `Stripes`), as in the paper by Madan et al.;
                "constant"  d = |grad z| member / 2: the same width in metres;
                "graded"    d proportional to (1 - threshold) |stress|^q, the stress along the stripes of the family;
                "stressed"  begins as "graded", then widens where the cut sheet has most energy.
    member    : width of members, metres, for "constant".    q : 0 to 4, exponent for "graded".
    min_width, max_width : bounds on the width under any rule, metres; 0 for none.
    min_gap   : metres; narrower gaps become material; 0 for none.    Raises PatternError for invalid values."""

    rule: Rule = "plain"
    member: float = 0.0
    q: float = 1.0
    min_width: float = 0.0
    max_width: float = 0.0
    min_gap: float = 0.0

    def __post_init__(self) -> None:
        if self.rule not in get_args(Rule):
            raise PatternError(f"the width rule {self.rule!r} must be plain, constant, graded or stressed")
        for name in ("member", "min_width", "max_width", "min_gap"):
            if not 0 <= getattr(self, name) < np.inf:
                raise PatternError(f"{name} = {getattr(self, name)} must be a length in metres, or 0 for no limit")
        if not 0 <= self.q <= 4:
            raise PatternError(f"q = {self.q} must lie between 0 (no grading) and 4")
        if self.rule == "constant" and not self.member:
            raise PatternError("the width rule 'constant' needs the key member, the width of the members in metres")
        if 0 < self.max_width < self.min_width:
            raise PatternError(f"min_width = {self.min_width} m is more than max_width = {self.max_width} m")

    @property
    def radius(self) -> float:
        """Radius (m) of the disc around a vertex over which the slope of the phase is averaged."""
        return self.member / 2 if self.rule == "constant" else 0.0

    @property
    def follow_stress(self) -> bool:
        """True if the rule makes stripes wider where the stress or energy is larger."""
        return self.rule in ("graded", "stressed")

    @property
    def vary(self) -> bool:
        """True if the half width may vary over the surface."""
        return self.rule != "plain" or max(self.min_width, self.max_width, self.min_gap) > 0

    def grading(self, stress: Floats) -> Floats:
        """Return factors (n,) on the half width of the rule "plain". stress : (n,) size of the stress along stripes."""
        return stress**self.q if self.rule == "graded" else stress if self.rule == "stressed" else np.ones_like(stress)

    def half_widths(self, base: float, slope: Floats, stress: Floats, factor: float = 1.0) -> Floats:
        """Return half widths d (n,) in periods, 0 (no material) to 0.5 (no gap).
        base   : d of the rule "plain".    slope : (n,) |grad z|, periods per metre (see `slopes`).
        stress : (n,) size of the stress along the stripes, any unit; for "stressed" the relative half widths."""
        d = factor * (slope * (self.member / 2) if self.rule == "constant" else base * self.grading(stress))
        if self.max_width:
            d = np.minimum(d, slope * (self.max_width / 2))
        d = np.maximum(d, slope * (self.min_width / 2))
        return np.asarray(np.where(d + slope * (self.min_gap / 2) > SOLID, SOLID, d))


def vertex_means(surface: Surface, x: Floats) -> Floats:
    """Return area-weighted means (n, ...) of values x (m, ...) around each vertex."""
    return np.asarray(_averaging(surface) @ x)


def slopes(surface: Surface, z: Floats, radius: float = 0.0) -> Floats:
    """Return the mean |grad z| in a disc around each vertex (n,), periods per m. z : (n,) phase.    radius : in m."""
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), z[surface.F])
    return spread_means(surface, np.linalg.norm(gradient, axis=1), radius)


def spread_means(surface: Surface, x: Floats, radius: float) -> Floats:
    """Return means (n, ...) of values x (m, ...) within about `radius` metres of each vertex."""
    average = _averaging(surface)
    means = average @ x
    # a round adds variance h^2 / 3 (mesh width h); the sum must reach R^2 / 4, the variance of a disc of radius R
    for _ in range(int(np.clip(0.75 * (radius / surface.mean_edge) ** 2, *ROUNDS))):
        means = average @ means[surface.F].mean(axis=1)
    return np.asarray(means)


def _averaging(surface: Surface) -> csr_array:
    area = np.maximum(surface.vertex_areas, np.finfo(float).tiny)
    weights = np.repeat(surface.areas / 3, 3) / area[surface.F.ravel()]
    faces = np.repeat(np.arange(surface.m), 3)
    return csr_array((weights, (surface.F.ravel(), faces)), shape=(surface.n, surface.m))


def relative_stresses(surface: Surface, principal: Floats) -> Floats:
    """Return sizes (n, 2) of the principal stresses (m, 2) at the vertices, divided by the mean.
    Raises PatternError if the stress is zero."""
    size = vertex_means(surface, np.abs(principal))
    mean = float(surface.vertex_areas @ size.mean(axis=1)) / surface.area
    if not mean > 0:
        raise PatternError("the surface has no stress for the width rule graded; use another rule, or check the loads")
    return np.asarray(size / mean)


def solved_factor(
    share: Callable[[float], float],
    target: float,
    tolerance: float,
    slope: float = 0.0,
    jump: float = JUMP,
    steepest: float = 40,
) -> float:
    """Return the factor at which the increasing function share(factor) is `target` [Dowell, Jarratt 1971].
    slope    : approximate derivative of `share`, or 0 if unknown.    jump : accepted error at a jump of `share`.
    steepest : largest growth of `share` per relative change of the factor.
    Raises PatternError if no factor exists, and ShareJumpError at a jump."""

    @cache
    def evaluate(factor: float) -> _End:
        return factor, share(factor) - target

    low, high = (_secant_interval(evaluate, tolerance, slope) if slope > 0 else None) or _bracket(
        evaluate, target, tolerance
    )
    best_end, kept_side = min(low, high, key=_miss), 0
    for _ in range(30):  # 30 steps are enough, unless share(factor) jumps past `target`
        if _miss(best_end) <= tolerance:
            return best_end[0]
        if high[0] - low[0] < tolerance / steepest * high[0]:
            break  # share(factor) jumps past `target`
        x = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        trial = evaluate(x)
        best_end = min(best_end, trial, key=_miss)
        if trial[1] < 0:
            low, high, kept_side = trial, (high[0], high[1] / (2 if kept_side == 1 else 1)), 1
        else:
            low, high, kept_side = (low[0], low[1] / (2 if kept_side == -1 else 1)), trial, -1
    if _miss(best_end) <= jump:
        return best_end[0]
    raise ShareJumpError(
        f"the share of material cannot be {target:.1%} of the surface, because this share jumps (nearest possible: "
        f"{best_end[1] + target:.2%}); change the phase or the frequency a little"
    )


def _secant_interval(evaluate: Callable[[float], _End], tolerance: float, slope: float) -> tuple[_End, _End] | None:
    end = evaluate(1.0)
    for _ in range(5):
        if _miss(end) <= tolerance or end[0] * slope <= end[1]:
            break
        trial = evaluate(end[0] - end[1] / slope)
        if trial[1] * end[1] <= 0:
            return (end, trial) if end[1] < trial[1] else (trial, end)
        slope, end = max((trial[1] - end[1]) / (trial[0] - end[0]), slope / 4), trial
    return (end, end) if _miss(end) <= tolerance else None


def _bracket(evaluate: Callable[[float], _End], target: float, tolerance: float) -> tuple[_End, _End]:
    start = evaluate(1.0)
    if _miss(start) <= tolerance:
        return start, start
    if start[1] > 0:
        low = evaluate(0.0)
        if low[1] > tolerance:
            raise _unreachable_error(target, f"at least {low[1] + target:.1%}")
        return low, start
    widest = evaluate(1e9)  # everything is material
    if widest[1] < -tolerance:
        raise _unreachable_error(target, f"at most {widest[1] + target:.1%}")
    low = start
    while (high := evaluate(4 * low[0]))[1] < -tolerance:
        low = high
    return low, high


def _miss(end: _End) -> float:
    return abs(end[1])


def _unreachable_error(target: float, reach: str) -> PatternError:
    return PatternError(
        f"the pattern cannot keep {target:.1%} of the surface: {reach} remain material with these widths, thresholds "
        f"and regions"
    )


def evened_grading(
    surface: Surface, grading: Floats, work: Floats, material: Floats, spacing: float, limit: float = 2.0
) -> Floats:
    """Return changed relative half widths (n, k) of k families, for a more even energy per area of material.
    grading  : (n, k) present relative half widths.    limit : largest factor of a change.
    work     : (m, k) elastic energy of each family in each face, J.    material : (m, k) area of material, m2.
    spacing  : distance between stripes, metres."""
    densities = np.concatenate([work, material], axis=1) / surface.areas[:, None]
    mean_work, share = np.split(spread_means(surface, densities, 0.4 * spacing), 2, axis=1)
    has_material = (share > 1e-9) & (mean_work > 0)
    if not has_material.any():
        return grading
    density = mean_work[has_material] / share[has_material]
    grown = np.ones_like(grading)
    grown[has_material] = np.clip((density / np.exp(np.log(density).mean())) ** 0.5, 1 / limit, limit)
    return np.asarray(grading * grown)
