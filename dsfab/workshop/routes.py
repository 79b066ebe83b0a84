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
from dsfab.workshop.ground import Ground
from dsfab.workshop.layering import Layering
from dsfab.workshop.legs import Footing
from dsfab.workshop.limits import StripLimits, strip_limits
from dsfab.workshop.parts import LABEL, SMALL, FlatPart
from dsfab.workshop.planks import PlankPlan, PlankStock, plank_plan, standing_order
from dsfab.workshop.strips import is_strip

UP = np.array([0.0, 0.0, 1.0])
SLACK = 5e-4
"""Metres that parts are shorter than the stock has room for: what their direction may differ by on the drawing."""
LEAST_DEPTH = 1.5
"""Thicknesses that an upright plank is deep, at least."""


STRAY = 0.5
"""Widths of members that bars may leave the curved surface by: planks follow it, and are taken where these can be."""


@dataclass(frozen=True, eq=False)
class Route:
    """Its name, and why it was chosen; "" where it was asked for. bars, planks : of that route."""

    name: str
    reason: str = ""
    bars: BarPlan | None = None
    planks: PlankPlan | None = None


def chosen_route(design: Design, graph: MemberGraph | None, layering: Layering | None, up: Floats = UP) -> Route:
    """The route of a design, by [workshop] of its preset.

    up : (3,) unit vector.
    graph, layering : of strips, as large as they are built; None where the design is to be a flat sheet.

    Raises PatternError where the route that was asked for is not possible.
    """
    ask = design.preset.workshop
    if ask.route == "sheet" or graph is None or layering is None:
        return Route("sheet", "" if ask.route == "sheet" else "the design is flat")
    if ask.route in ("bars", "planks"):
        if ask.model:
            raise PatternError("a model is built of strips: leave out --model, or take workshop.route = 'strips'")
        if ask.route == "planks":
            return Route("planks", planks=planned_planks(design, graph, up))
        return Route("bars", bars=planned_bars(design, graph, up))
    if ask.route == "panels" and not ask.model:
        raise PatternError("panels with tabs are for models in card: give --model 1:50, or another route")
    if ask.route in ("strips", "panels"):
        return Route(ask.route)
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


def planned_planks(design: Design, graph: MemberGraph, up: Floats = UP) -> PlankPlan:
    """The planks of a design. Raises PatternError where no piece fits on the stock, or nothing is a plank."""
    ask, statics = design.preset.workshop, design.preset.statics
    wide = [member.mean_width for member in graph.members if is_strip(member)]
    if not wide:
        raise PatternError("no member of this design is long enough for a plank; build it as one piece")
    thickness, depth = ask.thickness or statics.thickness, ask.depth or float(np.median(wide))
    if depth < LEAST_DEPTH * thickness:
        raise PatternError(
            f"planks {length(depth)} deep of boards {length(thickness)} thick do not stand upright: set "
            f"workshop.thickness to {depth / LEAST_DEPTH:.2g} or less, or workshop.depth to "
            f"{LEAST_DEPTH * thickness:.2g} or more"
        )
    stock = PlankStock(thickness, depth, ask.bolt, ask.splice, (LABEL, SMALL))
    ground = Ground.under(design.surface, design.load, up, thickness, 0.0) if design.has("statics") else None
    strain = statics.strength / statics.young
    order = standing_order(graph, up)
    return plank_plan(graph, node_normals(design, graph), stock, stock_room(ask), strain, ground, order)


def stock_room(ask: Workshop) -> list[tuple[float, float]]:
    """Lengths and widths, metres, that parts may have on the sheets of the stock. Raises PatternError for none."""
    room = [(a - 2 * ask.gap - SLACK, b - 2 * ask.gap - SLACK) for a, b in ask.stock]
    if min(min(size) for size in room) <= 0:
        raise PatternError("workshop.gap leaves no room on the smallest stock; give a smaller gap or larger sheets")
    return room


def _by_limits(design: Design, graph: MemberGraph, limits: StripLimits, up: Floats) -> Route:
    """Strips where they can be bent, or nobody knows; else bars that stay near the surface; else planks; else bars."""
    worst, how = max(limits.bending, limits.shape), f"layers of {length(limits.thickness)} of strips"
    if not limits.limit:
        return Route("strips", f"{how} would be bent to {worst:.2%}, and how far the material can be is not known")
    if worst <= limits.limit:
        return Route("strips", f"{how} can be bent: to {worst:.2%}, of {limits.limit:.2%} allowed")
    why = (
        f"{how} would be bent or stretched to {worst:.2%}, {worst / limits.limit:.1f} times what the material takes; "
        f"the thickest strips that could be bent are {length(limits.thickest)}"
    )
    bars, no_bars = _possible_bars(design, graph, up)
    if bars and not no_bars:
        return Route("bars", f"{why}; bars leave the surface by up to {length(bars.strayed)}", bars)
    planks, no_planks = _possible_planks(design, graph, up)
    if planks:
        return Route("planks", f"{why}; {no_bars}; {planks.merit}", planks=planks)
    if bars:
        return Route("bars", f"{why}; {no_bars}, but {no_planks}", bars)
    return Route("strips", f"{why}, but {no_bars}, and {no_planks}")


def _possible_bars(design: Design, graph: MemberGraph, up: Floats) -> tuple[BarPlan | None, str]:
    """Bars, None where they cannot be; and what speaks against them, "" for nothing."""
    try:
        bars = planned_bars(design, graph, up)
    except PatternError as error:
        why = str(error).partition("; ")[0]  # after that, ways out that name other routes, among them the one taken
        return None, f"bars are no way either: {why}"
    if bars.loose:
        return None, f"{len(bars.loose)} bar{'s' * (len(bars.loose) > 1)} would be too short for bolts"
    long = longest_unfit(bars.parts, design.preset.workshop)
    if long:
        return None, f"bars are longer than the stock ({long.id} is {length(long.size[0])})"
    wide = float(np.median([member.mean_width for member in graph.members if is_strip(member)]))
    far = f"bars would leave the surface by up to {length(bars.strayed)}, and members are {length(wide)} wide"
    return bars, far if bars.strayed > STRAY * wide else ""


def _possible_planks(design: Design, graph: MemberGraph, up: Floats) -> tuple[PlankPlan | None, str]:
    """Planks, or None and why they cannot be."""
    try:
        planks = planned_planks(design, graph, up)
    except PatternError as error:
        return None, f"upright planks are no way: {error}"
    return (None, f"upright planks {planks.hindrance}") if planks.hindrance else (planks, "")


def longest_unfit(parts: Sequence[FlatPart], ask: Workshop) -> FlatPart | None:
    """The longest of the parts that fit on no sheet of the stock, along it, or across where no grain speaks against
    that; None where all do."""
    room = [(a - 2 * ask.gap, b - 2 * ask.gap) for a, b in ask.stock]
    if not ask.grain:
        room += [(b, a) for a, b in room]
    unfit = [part for part in parts if not any(part.size[0] <= a and part.size[1] <= b for a, b in room)]
    return max(unfit, key=lambda part: float(part.size[0]), default=None)


def node_normals(design: Design, graph: MemberGraph) -> Floats:
    """(n, 3) directions of the surface's normals at the vertices of a graph's sheet."""
    return graph.sheet.carry(spherical_normals(design.surface))
