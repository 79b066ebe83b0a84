"""`pattern_quality`: how even, how well connected and how true to the stress a pattern is, from its phases alone."""

from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Bools, Floats, weighted_quantiles
from dsfab.slicing.bays import Bays, bays
from dsfab.slicing.dead_ends import OFF, DeadEnds, dead_ends
from dsfab.slicing.drawn import Drawn
from dsfab.slicing.middles import middles

SHARES = (0.05, 0.5, 0.95)
"""Spacings and openings are told by the values that these shares of the area do not exceed."""

Quantiles = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FamilyQuality:
    """One family of members.

    spacing    : metres from middle to middle: P5, median and P95 over the area outside of what is kept besides stripes.
    opening    : metres of clear opening between neighbours: the same over the area that is open.
    deviation  : degrees off the stress, mean over area x stress along the members x confidence of its direction.
    off        : share of that weight off by more than 30 degrees.
    dead_ends  : see `dsfab.slicing.dead_ends`.
    slits      : openings narrower than the members beside them: counted by bays, see `Bays`; of a sheet that is cut one
                 by one, see `dsfab.slicing.openings`.
    slit_share : share of the length of members beside such an opening.
    drawn      : whether there are such members; without them the other numbers are 0.
    """

    spacing: Quantiles
    opening: Quantiles
    deviation: float
    off: float
    dead_ends: DeadEnds = field(repr=False)
    slits: int
    slit_share: float
    drawn: bool = True

    @property
    def evenness(self) -> float:
        """P95 over P5 of the spacing: 1 where all are the same."""
        if not self.drawn:
            return 1.0
        return self.spacing[2] / self.spacing[0] if self.spacing[0] > 0 else float("inf")

    @property
    def dead(self) -> int:
        """How many ends are dead."""
        return len(self.dead_ends.loose) + len(self.dead_ends.turns)


@dataclass(frozen=True, eq=False)
class PatternQuality:
    """Both families, and what they are together.

    crossing_angle : degrees, the smallest between two members that cross; 90 where none do.
    symmetry_error : share of the surface where material differs from its image under a symmetry of the design, the
                     largest over all of them; None without any.
    turned         : degrees that members were to be off the stress: deviations are those from there.
    """

    major: FamilyQuality
    minor: FamilyQuality
    crossing_angle: float
    symmetry_error: float | None = None
    turned: float = 0.0

    @property
    def families(self) -> tuple[tuple[str, FamilyQuality], tuple[str, FamilyQuality]]:
        """Both families, by name."""
        return ("major", self.major), ("minor", self.minor)

    @property
    def evenness(self) -> float:
        """The larger P95 over P5 of the spacing."""
        return max(self.major.evenness, self.minor.evenness)

    @property
    def dead_ends(self) -> int:
        """Of both families."""
        return self.major.dead + self.minor.dead

    @property
    def slits(self) -> int:
        """Of both families."""
        return self.major.slits + self.minor.slits

    @property
    def deviation(self) -> float:
        """Degrees off the stress, of the family that is further off."""
        return max(self.major.deviation, self.minor.deviation)

    @property
    def summary(self) -> str:
        """One line in plain words."""
        crossing = f", crossing at {self.crossing_angle:.0f} or more" if self.major.drawn and self.minor.drawn else ""
        turned = f" turned by {self.turned:g}" if self.turned else ""
        crooked = f"members {self.deviation:.1f} degrees off the stress{turned}{crossing}"
        same = "" if self.symmetry_error is None else f", {self.symmetry_error:.2%} not symmetric"
        return f"{_count(self.dead_ends, 'dead end')}, {_count(self.slits, 'slit')}, {crooked}{same}"


def pattern_quality(
    drawn: Drawn,
    stress: Floats,
    direction: Floats,
    confidence: Floats,
    symmetry_error: float | None = None,
    guided: Bools | None = None,
) -> PatternQuality:
    """The measures of a pattern.

    stress     : (m, 2) principal stresses of which the major and minor members run along the first and the second.
    direction  : (m, 2, 3) their unit directions.    confidence : (m,) how clear these are, 0 to 1.
    guided     : (m,) faces where members follow something else, and no turn counts; None where they nowhere do.
    """
    turning = confidence if guided is None else np.where(guided, 0.0, confidence)
    found = [_family(drawn, k, stress[:, k], direction, confidence, turning) for k in (0, 1)]
    angles = np.concatenate([cut.angle for _, cut in found])
    (major, _), (minor, _) = found
    return PatternQuality(major, minor, float(angles.min(initial=90.0)), symmetry_error)


def _family(
    drawn: Drawn,
    k: int,
    stress: Floats,
    direction: Floats,
    confidence: Floats,
    turning: Floats,
) -> tuple[FamilyQuality, Bays]:
    """Of family k: its members should run along direction k, and its phase grow along the other one."""
    shown = bool((drawn.d[:, k] > 0).any())
    area, known, slope = drawn.surface.areas, drawn.steep(k) & shown, drawn.slope[k]
    spacing = 1 / slope
    opening = (1 - 2 * drawn.corners(drawn.d[:, k]).mean(axis=0)) * spacing
    cosine = np.abs(np.einsum("mx,mx->m", drawn.gradients[k], direction[:, 1 - k])) / slope
    deviation = np.degrees(np.arccos(np.minimum(cosine, 1)))
    weight = area * np.abs(stress) * confidence * drawn.free * known
    total = max(float(weight.sum()), np.finfo(float).tiny)
    lines = middles(drawn, k)
    cut = bays(lines)
    found = FamilyQuality(
        _quantiles(spacing, area * drawn.free * known),
        _quantiles(opening, area * drawn.void * known),
        float(weight @ deviation) / total,
        float(weight @ (deviation > OFF)) / total,
        dead_ends(lines, direction[:, k], deviation, turning),
        cut.slits,
        cut.slit_share,
        shown,
    )
    return found, cut


def _quantiles(values: Floats, weight: Floats) -> Quantiles:
    """The values that `SHARES` of the weight do not exceed; zeros where nothing weighs."""
    if not weight.sum() > 0:
        return 0.0, 0.0, 0.0
    low, middle, high = weighted_quantiles(values, weight, SHARES).tolist()
    return low, middle, high


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
