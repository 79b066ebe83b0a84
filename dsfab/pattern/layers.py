"""`Layer`: one field and its levels, ready to be cut; and `ModeFamily`: stripes on a mode, drawn as a layer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import NamedTuple, Protocol, Self

import numpy as np

from dsfab.arrays import Floats
from dsfab.pattern.stripes import Stripes
from dsfab.pattern.width import Widths, slopes, solved_factor
from dsfab.surface.corner_field import CornerField
from dsfab.surface.divided import DividedField
from dsfab.surface.mesh import Surface

DUTY_TOLERANCE = 1e-9
"""How closely the mean duty of graded stripes is that of plain ones."""


class Layer(NamedTuple):
    """What slicing cuts: a field (n,) whose odd strips are material, or (n, 2), see `Stripes.band`; or that at corners,
    or on parts of the faces.

    half_width : (n,) d in periods, for shaders.
    closed     : (n,) openings in the mean of which that is over 0 are material, whatever their own width; None: none.
    """

    name: str
    field: Floats | CornerField | DividedField
    levels: Floats
    half_width: Floats
    closed: Floats | None = None


@dataclass(frozen=True, eq=False)
class ModeFamily:
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
    ) -> "ModeFamily":
        """The family with its slope over a radius in metres; a stress (n,) left out is the same everywhere."""
        stress = np.ones(surface.n) if stress is None else stress
        return cls(name, stripes, x, slopes(surface, stripes.phases(x), radius), stress)

    def stressed(self, stress: Floats) -> Self:
        """The same under another stress (n,)."""
        return replace(self, stress=stress)

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """(n,) d in periods."""
        return widths.half_widths(self.stripes.half_width, self.slope, self.stress, factor)

    adds = 0
    """See `Drawable`."""

    @property
    def density(self) -> Floats:
        """(n,) stripes per metre."""
        return self.slope

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """The family as one layer; of one field where the width does not vary."""
        d = self.half_widths(widths, factor)
        if widths.vary:
            return [Layer(self.name, self.stripes.band(self.x, d), self.stripes.middles(self.x), d)]
        return [Layer(self.name, self.x, self.stripes.widened(factor).levels(self.x), d)]


class Drawable(Protocol):
    """A family of stripes, on a mode or evenly spaced.

    density : (n,) stripes per metre.    stress : (n,) size of the stress along the stripes; any unit.
    adds    : families add stripes between those that are drawn everywhere in this order.
    """

    @property
    def adds(self) -> int:
        """Its place among the families that add stripes between those that are drawn everywhere."""

    @property
    def name(self) -> str:
        """The name of the family."""

    @property
    def stripes(self) -> Stripes:
        """The stripes, of a mode or of a phase."""

    @property
    def density(self) -> Floats:
        """(n,) stripes per metre."""

    @property
    def stress(self) -> Floats:
        """(n,) size of the stress along the stripes; any unit."""

    def stressed(self, stress: Floats) -> Self:
        """The same under another stress (n,)."""
        ...

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """(n,) d in periods."""
        ...

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """What slicing cuts: the stripes that are drawn everywhere, then those in the openings between them.

        closing : the factor that says which openings are closed as a whole, as `factor` if 0: with the same one the
                  share of material does not jump as `factor` grows.
        """
        ...


def stripe_layers(
    families: Sequence[Drawable], widths: Widths, factor: float = 1.0, closing: float = 0.0
) -> list[Layer]:
    """The layers of all families: what each draws everywhere, then what they add, in the order of `adds`."""
    drawn = [(family.adds, family.layers(widths, factor, closing)) for family in families]
    return [layers[0] for _, layers in drawn] + [
        layer for _, layers in sorted(drawn, key=itemgetter(0)) for layer in layers[1:]
    ]


def mean_duty_factor(surface: Surface, families: Sequence[Drawable], widths: Widths) -> float:
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
