"""`EvenFamily`: evenly spaced stripes on a phase of corners, drawn as layers: the coarse ones, then finer ones."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.arrays import Floats
from dsfab.limits import CROWDING, SLIT
from dsfab.pattern.corners import CornerPhase
from dsfab.pattern.layers import Layer
from dsfab.pattern.stripes import Stripes
from dsfab.pattern.width import SOLID, Widths
from dsfab.surface.corner_field import CornerField

CLOSING = (1.45, 1.55)
"""Members that would be so many times wider than that are not made thinner, but one: they crowd around a load. Where
openings do not close as a whole, see `Layer.closed`, they do it little by little between the two."""
FOLLOWING = (1.15, 1.25)
"""The same where widths follow the stress: material is wanted there. Thinned up to `CLOSING` such a dome is 5 % softer
at half of its material."""
WHOLE = 1.3
"""Openings close as a whole where members would be so many times wider in the mean over them; by `FOLLOWING` where
widths follow the stress. With 1.5 the crown of a dome under a point load is left open, and it is 2 % softer."""

WIDTH_RULES = {"solid": SOLID, "open": SLIT, "closer": CROWDING, "closing": CLOSING, "following": FOLLOWING}
"""The same for whoever else widens stripes: the editor's page, which shows widths while a slider moves."""


@dataclass(frozen=True, eq=False)
class EvenFamily:
    """Stripes whose middles are where a phase is a whole number; with halvings, some of these, see `wanted`.

    phase   : at the corners, with every line that may be drawn.
    wanted  : for each level of halving, the finest first, (m,) the share of each face where its lines are drawn. Lines
              at multiples of 2^len(wanted) are drawn everywhere.
    slope   : (n,) lines per metre of the phase.    density : (n,) the same of those that are drawn.
    stress  : (n,) size of the stress along the stripes; any unit.    adds : see `Drawable`.
    whole   : whether an opening between members that crowd closes as a whole, or where they do.
    """

    name: str
    stripes: Stripes
    phase: CornerPhase
    wanted: tuple[Floats, ...]
    slope: Floats
    density: Floats
    stress: Floats
    adds: int = 0
    whole: bool = False

    def stressed(self, stress: Floats) -> Self:
        """The same under another stress (n,)."""
        return replace(self, stress=stress)

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """(n,) d in periods of the drawn lines; but for the rule `plain`, members that would leave a slit are thinner,
        or, where they crowd more than that or the stress is larger, one.
        """
        return self._closed(self._asked(widths, factor), widths)

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """The coarse stripes, which are drawn everywhere, then finer and finer ones."""
        asked = self._asked(widths, factor)
        local = self._closed(asked, widths)
        opened, closed = local, None
        if self.whole and widths.rule != "plain":
            asked = self._asked(widths, closing) if closing else asked
            closed = asked / self._most(asked) - (float(np.mean(FOLLOWING)) if widths.follow else WHOLE)
            opened = self._opened(self._asked(widths, factor), widths)
        z, c = self.phase.value, len(self.wanted)
        d = finest_half_widths(opened, self.slope, self.density, c)
        band = np.stack([z + d, z - d], axis=1)
        drawn = [Layer(self.name, self._field(band, None), self._levels(2**c, 0, d), local, closed)]
        for level in range(c - 1, -1, -1):
            field = self._field(band, self.wanted[level])
            drawn.append(Layer(self.name, field, self._levels(2 ** (level + 1), 2**level, d), local))
        return drawn

    def _asked(self, widths: Widths, factor: float) -> Floats:
        """(n,) half-widths in periods of the drawn lines, however narrow that leaves the openings."""
        asked = replace(widths, min_gap=0.0) if widths.rule != "plain" else widths
        return asked.half_widths(self.stripes.half_width, self.density, self.stress, factor)

    def _most(self, asked: Floats) -> float:
        return max(SLIT, CROWDING * float(np.median(asked)))

    def _opened(self, asked: Floats, widths: Widths) -> Floats:
        """(n,) half-widths that leave no slit, but where widths.min_gap closes it."""
        d = np.minimum(asked, self._most(asked))
        return np.where(d + self.density * (widths.min_gap / 2) > SOLID, SOLID, d)

    def _closed(self, asked: Floats, widths: Widths) -> Floats:
        """The same, and where members crowd too much they are one."""
        if widths.rule == "plain":
            return asked
        most = self._most(asked)
        d = np.interp(asked, np.array([0, 1, *_limits(widths)]) * most, [0, most, most, SOLID])
        return np.where(d + self.density * (widths.min_gap / 2) > SOLID, SOLID, d)

    def _field(self, band: Floats, wanted: Floats | None) -> CornerField:
        phase = self.phase
        return CornerField(band, phase.sign, phase.shift, phase.singular, wanted)

    def _levels(self, period: int, offset: int, d: Floats) -> Floats:
        """offset + j period over all that faces see."""
        phase = self.phase
        seen = np.abs(phase.value).max() + np.abs(phase.shift[~phase.singular]).max(initial=0.0) + d.max()
        count = np.ceil(seen / period) + 1
        return np.asarray(offset + period * np.arange(-count, count + 1))


def _limits(widths: Widths) -> tuple[float, float]:
    return FOLLOWING if widths.follow else CLOSING


def finest_half_widths(local: Floats, slope: Floats, density: Floats, halvings: int) -> Floats:
    """(n,) half-widths in periods of the finest lines, of local ones in periods of the lines that are drawn.

    Where neighbours that are drawn touch, all between the coarsest lines is material.
    """
    return np.asarray(np.where(local >= SOLID, SOLID * 2**halvings, local * slope / density))
