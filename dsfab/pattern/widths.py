"""Widths of stripes: by threshold, equal in metres, by stress, or evened by strain energy."""

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

_End = tuple[float, float]
"""End of an interval: a factor, and its share minus the wanted one."""
Rule = Literal["plain", "constant", "graded", "stressed"]

SOLID = 0.5
"""Half-width, in periods, at which neighbouring stripes touch."""
ROUNDS = (2, 60)
"""Fewest and most rounds of averaging."""
JUMP = 5e-3
"""Largest accepted jump of a share past the wanted one, as tidied ends appear and vanish: the nearest share suffices.
"""


class ShareJumpError(PatternError):
    """The share jumps past the wanted one: values exist on both sides, but none near it."""


@dataclass(frozen=True)
class Widths:
    """The rule for the half-width d of stripes at every vertex.

    rule      : "plain"     d = (1 - threshold) / 4, the paper;
                "constant"  d = |grad z| member / 2: the same width in metres also where a mode flattens;
                "graded"    d proportional to (1 - threshold) |stress|^q, the stress along the stripes of the family;
                "stressed"  begins as "graded", then widens where the cut sheet has most energy, see `evened_grading`.
    member    : metres, for "constant".    q : 0 to 4, for "graded" and the beginning of "stressed".
    min_width, max_width : metres, bounds on the width at every vertex under any rule; 0 sets none.
    min_gap   : metres; a narrower gap to the next stripe is filled. 0 fills none.

    Raises PatternError for other values, and for "constant" without `member`.
    """

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
                raise PatternError(f"{name} = {getattr(self, name)} must be a length in metres, or 0 for none")
        if not 0 <= self.q <= 4:
            raise PatternError(f"q = {self.q} must lie between 0 (no grading) and 4")
        if self.rule == "constant" and not self.member:
            raise PatternError("the width rule constant needs member, the width of the members in metres")
        if 0 < self.max_width < self.min_width:
            raise PatternError(f"min_width = {self.min_width} m is more than max_width = {self.max_width} m")

    @property
    def radius(self) -> float:
        """Radius, metres, for averages of slopes: half the width of a member if the rule sets it."""
        return self.member / 2 if self.rule == "constant" else 0.0

    @property
    def follow(self) -> bool:
        """True if widths follow the stress."""
        return self.rule in ("graded", "stressed")

    @property
    def vary(self) -> bool:
        """True if the half-width differs from vertex to vertex."""
        return self.rule != "plain" or max(self.min_width, self.max_width, self.min_gap) > 0

    def grading(self, stress: Floats) -> Floats:
        """Return relative half-widths (n,); see `half_widths`."""
        return stress**self.q if self.rule == "graded" else stress if self.rule == "stressed" else np.ones_like(stress)

    def half_widths(self, plain: float, slope: Floats, stress: Floats, factor: float = 1.0) -> Floats:
        """Return d (n,) in periods, 0 (no material) to 0.5 (no gap), never less for a larger `factor`.

        base   : d of the stripes' threshold.    slope : (n,) |grad z|, periods per metre (see `slopes`).
        stress : (n,) for "graded" the size of the stress along the stripes, any unit; for "stressed" the relative
                 half-widths themselves.
        factor : multiplies the rule, before the bounds.
        """
        d = factor * (slope * (self.member / 2) if self.rule == "constant" else plain * self.grading(stress))
        if self.max_width:
            d = np.minimum(d, slope * (self.max_width / 2))
        d = np.maximum(d, slope * (self.min_width / 2))
        return np.asarray(np.where(d + slope * (self.min_gap / 2) > SOLID, SOLID, d))


def vertex_means(surface: Surface, x: Floats) -> Floats:
    """Return area-weighted means (n, ...) of values x (m, ...) over the faces around each vertex; 0 without faces."""
    return np.asarray(_averaging(surface) @ x)


def slopes(surface: Surface, z: Floats, radius: float = 0.0) -> Floats:
    """Return the mean of |grad z| around each vertex (n,): periods per metre for a phase z (n,).

    The length of the mean gradient would vanish on ridges of z, and open a slit along the middle of a member. Half the
    range of z over a disc of radius R is R |grad z| off a ridge and R^2 z'' / 2 on it, equal to the mean of |grad z|
    over
    the disc. So means extend over `radius`, metres, half the width of a member, and at least over two rings of faces,
    or
    members would fray on ridges.
    """
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), z[surface.F])
    return spread_means(surface, np.linalg.norm(gradient, axis=1), radius)


def spread_means(surface: Surface, x: Floats, radius: float) -> Floats:
    """Return means (n, ...) of values x (m, ...) of the faces over about a disc of that radius, metres, around each
    vertex.

    They extend over at least two rings of faces, and along the surface, not through a gap between sheets.
    """
    average = _averaging(surface)
    means = average @ x
    # the variance of a round is h^2 / 3 on a regular mesh of width h; that of a disc is R^2 / 4
    for _ in range(int(np.clip(0.75 * (radius / surface.mean_edge) ** 2, *ROUNDS))):
        means = average @ means[surface.F].mean(axis=1)
    return np.asarray(means)


def _averaging(surface: Surface) -> csr_array:
    """Return area-weighted means (n, m) over the faces around each vertex."""
    area = np.maximum(surface.vertex_areas, np.finfo(float).tiny)
    weights = np.repeat(surface.areas / 3, 3) / area[surface.F.ravel()]
    faces = np.repeat(np.arange(surface.m), 3)
    return csr_array((weights, (surface.F.ravel(), faces)), shape=(surface.n, surface.m))


def relative_stresses(surface: Surface, principal: Floats) -> Floats:
    """Return sizes of both principal stresses (m, 2) at the vertices, (n, 2), over their common mean over the area.

    Raises PatternError if the stress is zero.
    """
    size = vertex_means(surface, np.abs(principal))
    mean = float(surface.vertex_areas @ size.mean(axis=1)) / surface.area
    if not mean > 0:
        raise PatternError("nothing is stressed, so the width rule graded has nothing to follow; use another rule")
    return np.asarray(size / mean)


def solved_factor(
    share: Callable[[float], float],
    wanted: float,
    tolerance: float,
    slope: float = 0.0,
    near: bool = False,
    jump: float = JUMP,
    steepest: float = 40,
) -> float:
    """Return the factor at which share(factor), which never falls, is `target` to `tolerance`.

    slope    : approximate derivative, if the factor may be about 1: then that and one step of Newton's come first.
    near_one : whether the factor is about 1: then secants start there.
    jump     : accepted miss if the share jumps past the target: the factor of the nearest share is returned then.
    steepest : no share without jumps grows faster than this, relative to its factor.

    Secants of an interval around the solution, with the value at an end halved after it stays twice (Illinois rule of
    regula falsi [Dowell, Jarratt 1971]). Raises PatternError if no factor gives that share (ShareJumpError for a larger
    jump).
    """

    @cache
    def at(factor: float) -> _End:
        return factor, share(factor) - wanted

    low, high = (_felt(at, tolerance, slope, near) if slope > 0 else None) or _ends(at, wanted, tolerance)
    best, kept = min(low, high, key=_miss), 0
    for _ in range(30):  # several times the need of a share without jumps
        if _miss(best) <= tolerance:
            return best[0]
        if high[0] - low[0] < tolerance / steepest * high[0]:
            break  # the share jumps here
        x = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        new = at(x)
        best = min(best, new, key=_miss)
        if new[1] < 0:
            low, high, kept = new, (high[0], high[1] / (2 if kept == 1 else 1)), 1
        else:
            low, high, kept = (low[0], low[1] / (2 if kept == -1 else 1)), new, -1
    if _miss(best) <= jump:
        return best[0]
    raise ShareJumpError(
        f"the kept share jumps past {wanted:.1%} of the surface (nearest: {best[1] + wanted:.2%}); "
        "change the phase or the frequency a little"
    )


def _felt(at: Callable[[float], _End], tolerance: float, slope: float, near: bool) -> tuple[_End, _End] | None:
    """Return an interval around the solution, or the solution twice, by secants from 1; None if they do not
    converge.
    """
    one = at(1.0)
    for _ in range(5 if near else 1):
        if _miss(one) <= tolerance or one[0] * slope <= one[1]:
            break
        new = at(one[0] - one[1] / slope)
        if near and new[1] * one[1] <= 0:
            return (one, new) if one[1] < new[1] else (new, one)
        slope, one = max((new[1] - one[1]) / (new[0] - one[0]), slope / 4), new
    return (one, one) if _miss(one) <= tolerance else None


def _ends(at: Callable[[float], _End], wanted: float, tolerance: float) -> tuple[_End, _End]:
    """Return an interval around the solution, or the solution twice, between 0 and too wide stripes."""
    one = at(1.0)
    if _miss(one) <= tolerance:
        return one, one
    if one[1] > 0:
        low = at(0.0)
        if low[1] > tolerance:
            raise _unreachable(wanted, f"at least {low[1] + wanted:.1%}")
        return low, one
    most = at(1e9)  # no wider stripes reach more
    if most[1] < -tolerance:
        raise _unreachable(wanted, f"at most {most[1] + wanted:.1%}")
    low = one
    while (high := at(4 * low[0]))[1] < -tolerance:
        low = high
    return low, high


def _miss(end: _End) -> float:
    return abs(end[1])


def _unreachable(wanted: float, reach: str) -> PatternError:
    return PatternError(
        f"the pattern cannot keep {wanted:.1%} of the surface: {reach} with these widths, thresholds and kept regions"
    )


def evened(
    surface: Surface, grading: Floats, work: Floats, material: Floats, spacing: float, limit: float = 2.0
) -> Floats:
    """Return relative half-widths (n, k) for the next step, from those of k families, (n, k), that were cut and solved.

    work     : (m, k) energy, joules, of each family in each face.    material : (m, k) its area, m2.
    spacing  : metres from stripe to stripe; energies are averaged over 0.4 of it, less than the distance of neighbours.
    limit    : largest factor of a step.

    Widths grow with the root of the energy density: in a member with a fixed force it falls with the square of the
    width. Redistributed forces need several steps. Widths stay where material is missing. The geometric mean of the
    densities stays, so that an evenly stressed sheet is unchanged.
    """
    both = np.concatenate([work, material], axis=1) / surface.areas[:, None]
    near, share = np.split(spread_means(surface, both, 0.4 * spacing), 2, axis=1)
    known = (share > 1e-9) & (near > 0)
    if not known.any():
        return grading
    density = near[known] / share[known]
    grown = np.ones_like(grading)
    grown[known] = np.clip((density / np.exp(np.log(density).mean())) ** 0.5, 1 / limit, limit)
    return np.asarray(grading * grown)
