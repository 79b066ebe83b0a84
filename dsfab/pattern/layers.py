"""`Layer`: one field and its levels, ready to be cut; and `Family`: stripes on a mode, drawn as a layer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.pattern.stripes import Stripes
from dsfab.pattern.width import Widths, slopes, solved_factor
from dsfab.surface.mesh import Surface

DUTY_TOLERANCE = 1e-9
"""How closely the mean duty of graded stripes is that of plain ones."""


class Layer(NamedTuple):
    """What slicing cuts: a field (n,) whose odd strips are material, or (n, 2), see `Stripes.band`.

    half_width : (n,) d in periods, for shaders.
    """

    name: str
    field: Floats
    levels: Floats
    half_width: Floats


@dataclass(frozen=True, eq=False)
class Family:
    """Stripes on a mode x (n,), with what their width may follow at every vertex.

    slope  : (n,) |grad z|, periods per metre.    stress : (n,) size of the stress along the stripes; any unit.
    """

    name: str
    stripes: Stripes
    x: Floats
    slope: Floats
    stress: Floats

    @classmethod
    def on(
        cls,
        surface: Surface,
        name: str,
        stripes: Stripes,
        x: Floats,
        stress: Floats | None = None,
        radius: float = 0.0,
    ) -> "Family":
        """The family with its slope over a radius in metres; a stress (n,) left out is the same everywhere."""
        stress = np.ones(surface.n) if stress is None else stress
        return cls(name, stripes, x, slopes(surface, stripes.phases(x), radius), stress)

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """(n,) d in periods."""
        return widths.half_widths(self.stripes.half_width, self.slope, self.stress, factor)

    def layer(self, widths: Widths, factor: float = 1.0) -> Layer:
        """The family as a layer; of one field where the width does not vary."""
        d = self.half_widths(widths, factor)
        if widths.vary:
            return Layer(self.name, self.stripes.band(self.x, d), self.stripes.middles(self.x), d)
        return Layer(self.name, self.x, self.stripes.widened(factor).levels(self.x), d)


def mean_duty_factor(surface: Surface, families: Sequence[Family], widths: Widths) -> float:
    """The factor at which families of graded width keep the mean duty that their thresholds ask for.

    One factor for all: the family with the larger stress gets the larger share. Bounds in metres come on top.
    Raises PatternError when too little of the surface is stressed for that.
    """
    free = Widths(widths.rule, widths.member, widths.q)

    def duty(factor: float) -> float:
        means = [surface.vertex_areas @ family.half_widths(free, factor) for family in families]
        return float(2 * sum(means) / (len(families) * surface.area))

    wanted = float(np.mean([2 * family.stripes.half_width for family in families]))
    return solved_factor(duty, wanted, DUTY_TOLERANCE)
