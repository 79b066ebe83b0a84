"""`Route`: in which way a design is built, and why, in numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import PatternError
from dsfab.members import MemberGraph, spherical_normals
from dsfab.pipeline import Design
from dsfab.preset_workshop import Workshop
from dsfab.wording import length
from dsfab.workshop.bars import BarPlan, BarStock, bar_plan
from dsfab.workshop.layering import Layering
from dsfab.workshop.legs import Footing
from dsfab.workshop.limits import StripLimits, strip_limits
from dsfab.workshop.parts import LABEL, FlatPart

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Route:
    """Its name, and why it was chosen; "" where it was asked for. bars : the plan of bars, where that is the route."""

    name: str
    reason: str = ""
    bars: BarPlan | None = None


def chosen_route(design: Design, graph: MemberGraph | None, layering: Layering | None, up: Floats = UP) -> Route:
    """The route of a design, by [workshop] of its preset.

    up : (3,) unit vector.
    graph, layering : of strips, as large as they are built; None where the design is to be a flat sheet.

    Raises PatternError where the route that was asked for is not possible.
    """
    ask = design.preset.workshop
    if ask.route == "sheet" or graph is None or layering is None:
        return Route("sheet", "" if ask.route == "sheet" else "the design is flat")
    if ask.route == "bars":
        if ask.model:
            raise PatternError("a model is built of strips: leave out --model, or take workshop.route = 'strips'")
        return Route("bars", bars=planned_bars(design, graph, up))
    if ask.route == "strips":
        return Route("strips")
    if ask.model:
        return Route("strips", "models are built of strips")
    statics = design.preset.statics
    limits = strip_limits(graph, design.surface, layering.thickness, statics.strength / statics.young, ask.bolt)
    return _by_limits(design, graph, limits, up)


def footing_of(design: Design, up: Floats) -> Footing | None:
    """Where a design is anchored; None where it is not, or is a model."""
    ask = design.preset.workshop
    if ask.model or not ask.anchor:
        return None
    return Footing.of(design.surface, design.load, up, ask.anchor)


def planned_bars(design: Design, graph: MemberGraph, up: Floats = UP) -> BarPlan:
    """The bars of a design. Raises PatternError where nodes are too near to each other."""
    ask = design.preset.workshop
    stock = BarStock(ask.thickness or design.preset.statics.thickness, ask.plate, ask.bolt, LABEL)
    return bar_plan(graph, node_normals(design, graph), stock, footing_of(design, up))


def _by_limits(design: Design, graph: MemberGraph, limits: StripLimits, up: Floats) -> Route:
    """Strips where they can be bent, or nobody knows; else bars, unless these are too short."""
    worst, how = max(limits.bending, limits.shape), f"layers of {length(limits.thickness)} of strips"
    if not limits.limit:
        return Route("strips", f"{how} would be bent to {worst:.2%}, and how far the material can be is not known")
    if worst <= limits.limit:
        return Route("strips", f"{how} can be bent: to {worst:.2%}, of {limits.limit:.2%} allowed")
    why = f"{how} would be bent or stretched to {worst:.2%}, {worst / limits.limit:.1f} times what the material takes"
    try:
        bars = planned_bars(design, graph, up)
    except PatternError as error:
        return Route("strips", f"{why}, but bars are no way either: {error}")
    if bars.loose:
        return Route("strips", f"{why}, but {len(bars.loose)} bars would be too short for bolts")
    long = longest_unfit(bars.parts, design.preset.workshop)
    if long:
        return Route("strips", f"{why}, but bars are longer than the stock ({long.id} is {length(long.size[0])})")
    return Route("bars", f"{why}; the thickest strips that could be bent are {length(limits.thickest)}", bars)


def longest_unfit(parts: Sequence[FlatPart], ask: Workshop) -> FlatPart | None:
    """The longest of the parts that fit on no sheet of the stock, along or across it; None where all do."""
    room = [(a - 2 * ask.gap, b - 2 * ask.gap) for a, b in ask.stock]
    room += [(b, a) for a, b in room]
    unfit = [part for part in parts if not any(part.size[0] <= a and part.size[1] <= b for a, b in room)]
    return max(unfit, key=lambda part: float(part.size[0]), default=None)


def node_normals(design: Design, graph: MemberGraph) -> Floats:
    """(n, 3) directions of the surface's normals at the vertices of a graph's sheet."""
    return graph.sheet.carry(spherical_normals(design.surface))
