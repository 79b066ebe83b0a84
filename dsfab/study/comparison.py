"""`compare`: does a structure carry its loads better than others of its mass? A figure of the paper, for any design.

The competitors have the same mass, thickness (but for `thinner`), loads, supports and kept regions:

full       the whole surface, uncut: nothing can be stiffer at this thickness, and it weighs more
thinner    the whole surface, uncut, as thin as the design is light
isotropic  stripes of the same frequencies on modes that ignore the stress (r = 1): the best and the median over pairs
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from dsfab.design import Design
from dsfab.errors import DsfabError, PatternError
from dsfab.pipeline import revise
from dsfab.pipeline.handover import sheet_loads
from dsfab.preset_file import overridden
from dsfab.statics import solve_cases
from dsfab.surface import LoadCase, Surface

SAME_MASS = 0.01
"""Competitors that lose more than this share of their mass as loose pieces are out of the race."""

PAIRS = tuple(product((1, 2, 3), (1, 2, 3)))
"""Pairs of modes that the isotropic competitors are made of: where modes repeat, one pair would be a lucky draw."""


@dataclass(frozen=True)
class Competitor:
    """A structure under the design's loads: compliance in joules and mass in kg; `error` if it carries nothing."""

    name: str
    compliance: float
    mass: float
    error: str = ""


@dataclass(frozen=True)
class Comparison:
    """The design against its competitors; the smaller the compliance, the stiffer.

    Each value is one solve on the mesh as it is cut, with quadratic membrane and mid-edge bending elements: at four
    elements across a member typically within 3 %, good for comparing like with like, not a verdict on safety.

    The loads are those that the pattern follows: one case or combination, or several, whose compliances are then added
    with the weights of [diffusion] (1 each when left out).
    """

    design: Competitor
    full: Competitor
    thinner: Competitor
    isotropic: tuple[Competitor, ...]

    @property
    def carried(self) -> tuple[Competitor, ...]:
        """Isotropic competitors that carry the loads, stiffest first."""
        return tuple(sorted((c for c in self.isotropic if not c.error), key=lambda c: c.compliance))

    @property
    def gain(self) -> float:
        """Compliance of the best isotropic competitor over the design's: above 1 the design is stiffer."""
        return self.carried[0].compliance / self.design.compliance if self.carried else float("inf")

    @property
    def median_gain(self) -> float:
        """The same for the median competitor; those that carry nothing count as infinitely soft."""
        values = [np.inf if c.error else c.compliance for c in self.isotropic]
        return float(np.median(values)) / self.design.compliance


def compare(design: Design, pairs: tuple[tuple[int, int], ...] = PAIRS) -> Comparison:
    """The design's compliance on its own cut sheet, beside competitors of the same mass.

    pairs : (major, minor) modes of the isotropic competitors.

    Raises StaticsError when the design itself does not carry its loads: a concentrated load that stands on a piece
    which reaches no support counts as not carried.
    """
    sheet, statics = design.sheet, design.preset.statics
    weight = statics.density * statics.thickness
    share = sheet.surface.area / design.surface.area
    own = Competitor("design", _on_sheet(design), weight * sheet.surface.area)
    whole = _compliance(design, design.surface, _loads(design), 1.0)
    full = Competitor("full", whole, weight * design.surface.area)
    thinner = Competitor("thinner", _compliance(design, design.surface, _loads(design), share), own.mass)
    return Comparison(own, full, thinner, tuple(_isotropic(design, pairs)))


def _on_sheet(design: Design) -> float:
    """Compliance, joules, of the design on its own cut sheet."""
    sheet = design.sheet
    loads = sheet_loads(design.surface, design.slicing.cells.kept(), sheet, _loads(design))
    return _compliance(design, sheet.surface, loads, 1.0)


def _loads(design: Design) -> dict[str, LoadCase]:
    """The loads of what the pattern follows, by name."""
    return {name: design.statics.cases[name].load for name in design.preset.followed}


def _compliance(design: Design, surface: Surface, loads: Mapping[str, LoadCase], share: float) -> float:
    """Compliance, joules, of a sheet of `share` of the design's thickness: the weighted sum over what is followed."""
    statics = design.preset.statics
    thickness = share * statics.thickness
    answers = solve_cases(surface, statics.material, loads, thickness, statics.law, "quadratic", "midedge")
    return sum(weight * answers[name].compliance for name, weight in design.preset.followed.items())


def _isotropic(design: Design, pairs: tuple[tuple[int, int], ...]) -> Iterator[Competitor]:
    """Competitors that know nothing of the stress: r = 1, plain widths scaled to the design's area."""
    weight = design.preset.statics.density * design.preset.statics.thickness
    blind = {
        "diffusion.r": 1.0,
        "diffusion.modes": max([design.preset.diffusion.modes, *(max(pair) for pair in pairs)]),
        "pattern.width": {"solid_fraction": design.sheet.surface.area / design.surface.area},
    }
    last = design
    for major, minor in pairs:
        name = f"isotropic {major}, {minor}"
        try:
            last = revise(
                last, overridden(design.settled, {**blind, "pattern.major.mode": major, "pattern.minor.mode": minor})
            )
            lost = 1 - last.sheet.surface.area / design.sheet.surface.area
            if lost > SAME_MASS:
                raise PatternError(f"falls apart: {lost:.0%} of it reach no support")
            yield Competitor(name, _on_sheet(last), weight * last.sheet.surface.area)
        except DsfabError as error:
            yield Competitor(name, float("nan"), 0.0, str(error))
