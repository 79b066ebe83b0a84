"""Workshop plan: the route by which a design is built, its parts, their sheets and the warnings."""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.core.messages import length, some_names, stopping
from dsfab.design import Design
from dsfab.members import MemberGraph, spherical_normals
from dsfab.preset.sections import Workshop
from dsfab.workshop.bars import BarPlan, BarStock, bar_plan
from dsfab.workshop.bars.joints import Footing, leg_lines, leg_plates
from dsfab.workshop.card_models import (
    CARD,
    LETTERS,
    model_notes,
    packing_parts,
    panel_parts,
    scaled_graph,
    scaled_surface,
)
from dsfab.workshop.ground import Ground, base_notes, base_parts
from dsfab.workshop.layers import OWN, Layering
from dsfab.workshop.nesting import NestedSheet, emptied, nested, require_spyrrow
from dsfab.workshop.parts import LABEL, WORKSHOP_SMALL, FlatPart, congruent, shape_key
from dsfab.workshop.planks import PlankPlan, PlankStock, plank_plan, standing_order
from dsfab.workshop.plates import SheetJoint, is_plate, plate_parts, sheet_parts
from dsfab.workshop.splices import SCARF, scarf_line
from dsfab.workshop.stock import price_notes, sheet_hints, stock_choices, stock_cost
from dsfab.workshop.strips import NOTHING, StripLimits, StripParts, is_strip, strip_limits, strip_parts

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Route:
    """Route by which a design is built; `reason` is empty if the preset names the route."""

    name: str
    reason: str = ""
    bars: BarPlan | None = None
    planks: PlankPlan | None = None


def chosen_route(design: Design, graph: MemberGraph | None, layering: Layering | None, up: Floats = UP) -> Route:
    """Return the route of a design by [workshop] of its preset.

    graph, layering : members and layers at built size; None for a flat sheet.    up : (3,) unit vector.

    Raises PatternError if the design cannot be built by the requested route.
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
    """Return the anchored supports of a design; None without anchors and for models."""
    ask = design.preset.workshop
    if ask.model or not ask.anchor:
        return None
    return Footing.of(design.surface, design.load, up, ask.anchor)


def planned_bars(design: Design, graph: MemberGraph, up: Floats = UP) -> BarPlan:
    """Return the bars of a design. Raises PatternError if nodes are too close to each other."""
    ask = design.preset.workshop
    stock = BarStock(ask.thickness or design.preset.statics.thickness, ask.plate, ask.bolt, LABEL)
    return bar_plan(graph, node_normals(design, graph), stock, footing_of(design, up))


def planned_planks(design: Design, graph: MemberGraph, up: Floats = UP) -> PlankPlan:
    """Return the planks of a design. Raises PatternError if no piece fits on the stock, or no member can be a plank."""
    ask, statics = design.preset.workshop, design.preset.statics
    wide = [member.mean_width for member in graph.members if is_strip(member)]
    if not wide:
        raise PatternError("no member of this design is long enough for a plank; build it as one piece")
    thickness, depth = ask.thickness or statics.thickness, ask.depth or float(np.median(wide))
    slenderness = 1.5  # least depth of an upright plank over its thickness
    if depth < slenderness * thickness:
        raise PatternError(
            f"planks {length(depth)} deep of boards {length(thickness)} thick do not stand upright: set "
            f"workshop.thickness to {depth / slenderness:.2g} or less, or workshop.depth to "
            f"{slenderness * thickness:.2g} or more"
        )
    stock = PlankStock(thickness, depth, ask.bolt, ask.splice, (LABEL, WORKSHOP_SMALL))
    ground = Ground.under(design.surface, design.load, up, thickness, 0.0) if design.has("statics") else None
    strain = statics.strength / statics.young
    order = standing_order(graph, up)
    return plank_plan(graph, node_normals(design, graph), stock, stock_room(ask), strain, ground, order)


def stock_room(ask: Workshop) -> list[tuple[float, float]]:
    """Return the largest part sizes (m) for each stock sheet. Raises PatternError if gaps leave no room."""
    slack = 5e-4  # metres: parts may turn a little on the drawing
    room = [(a - 2 * ask.gap - slack, b - 2 * ask.gap - slack) for a, b in ask.stock]
    if min(min(size) for size in room) <= 0:
        raise PatternError("workshop.gap leaves no room on the smallest stock; give a smaller gap or larger sheets")
    return room


def _by_limits(design: Design, graph: MemberGraph, limits: StripLimits, up: Floats) -> Route:
    """Choose strips if they bend or the limit is unknown; else bars close to the surface; else planks; else bars."""
    worst, how = max(limits.bending, limits.shape), f"layers of {length(limits.thickness)} of strips"
    if not limits.limit:
        return Route("strips", f"{how} would be bent to {worst:.2%}, and the limit of the material is not known")
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
    """Return the bars, None if impossible, and the objection to them, empty for none."""
    try:
        bars = planned_bars(design, graph, up)
    except PatternError as error:
        why = str(error).partition("; ")[0]  # the rest proposes other routes
        return None, f"bars are impossible too: {why}"
    if bars.loose:
        return None, f"{len(bars.loose)} bar{'s' * (len(bars.loose) > 1)} would be too short for bolts"
    long = longest_unfit(bars.parts, design.preset.workshop)
    if long:
        return None, f"bars are longer than the stock ({long.id} is {length(long.size[0])})"
    wide = float(np.median([member.mean_width for member in graph.members if is_strip(member)]))
    far = f"bars would leave the surface by up to {length(bars.strayed)}, and members are {length(wide)} wide"
    return bars, far if bars.strayed > 0.5 * wide else ""


def _possible_planks(design: Design, graph: MemberGraph, up: Floats) -> tuple[PlankPlan | None, str]:
    try:
        planks = planned_planks(design, graph, up)
    except PatternError as error:
        return None, f"upright planks are impossible: {error}"
    return (None, f"upright planks {planks.hindrance}") if planks.hindrance else (planks, "")


def longest_unfit(parts: Sequence[FlatPart], ask: Workshop) -> FlatPart | None:
    """Return the longest part that fits on no stock sheet, without grain also across; None if all parts fit."""
    room = [(a - 2 * ask.gap, b - 2 * ask.gap) for a, b in ask.stock]
    if not ask.grain:
        room += [(b, a) for a, b in room]
    unfit = [part for part in parts if not any(part.size[0] <= a and part.size[1] <= b for a, b in room)]
    return max(unfit, key=lambda part: float(part.size[0]), default=None)


def node_normals(design: Design, graph: MemberGraph) -> Floats:
    """Return the directions (n, 3) of the surface normals at the vertices of a graph's sheet."""
    return graph.sheet.carry(spherical_normals(design.surface))


JOINED = {
    "butt": "cut straight and butted: no joint is drawn; set workshop.splice to 'fingers' or 'scarf' for one",
    "fingers": "with fingers {} long that close without a gap; a round cutter leaves its radius in their corners",
    "scarf": "which reach over each other by {} and are glued there on a bevel: to the right and above on the engraved "
    "face, from the engraved line to the edge, to the left and below on the other one",
}
"""Sentence on the pieces of a flat sheet, by their joint."""
CLEARANCE = 1e-4
"""Clearance between a tab and its slot in the base plate of a model, to each side (m)."""
TABS = 4.0
"""Length that both tabs add to a strip, at most, over its thickness."""


@dataclass(frozen=True, eq=False)
class WorkshopPlan:
    """Parts of a design and the sheets that they are cut from.

    route     : "strips", "planks", "bars", "panels" or "sheet".
    thickness : of the stock (m); a part may have its own.
    parts     : all parts.    sheets : nested sheets, each part on one of them.
    equal_parts : lists of part numbers with one shape, in the order of the parts.
    notes     : sentences on what can be built and what cannot.
    graph     : members and nodes at built size; None for a flat sheet.
    layering  : layers of strips; None for other routes.
    model     : 50 for a model at 1:50; 0 for full size.
    bars, planks : plans of these routes, which have no layers.
    """

    route: str
    thickness: float
    parts: tuple[FlatPart, ...]
    sheets: tuple[NestedSheet, ...]
    same: tuple[tuple[int, ...], ...]
    notes: tuple[str, ...]
    graph: MemberGraph | None = None
    layering: Layering | None = None
    model: float = 0.0
    bars: BarPlan | None = None
    planks: PlankPlan | None = None

    def thickness_of(self, part: FlatPart) -> float:
        """Return the thickness of a part (m)."""
        return part.thickness or self.thickness

    @cached_property
    def sheet_of(self) -> dict[str, int]:
        """Sheet number of each part, from 1, by part name."""
        return {one.part.id: k for k, sheet in enumerate(self.sheets, 1) for one in sheet.parts}

    @property
    def used(self) -> float:
        """Share of the sheets' area that becomes parts."""
        return sum(part.area for part in self.parts) / sum(a * b for a, b in (sheet.size for sheet in self.sheets))


def workshop_plan(design: Design, up: Floats = UP) -> WorkshopPlan:
    """Return the plan of a design by [workshop] of its preset.

    up : (3,) unit vector, for the base plate of a model.

    If the stock has prices, the plan is the cheapest of those for all sizes and for the shorter sizes alone.

    Raises PatternError if the route is impossible, a part fits on no sheet, or a library is missing.
    """
    if design.preset.workshop.nesting == "spyrrow":
        require_spyrrow()
    first, *others = stock_choices(design.preset.workshop)
    plan = _plan(design, up)
    plans = [(first, plan)]
    for ask in others:
        shorter = Design.of(design.preset.model_copy(update={"workshop": ask}), design)
        with suppress(PatternError):
            plans.append((ask, _plan(shorter, up)))
    plans = [(ask, one) for ask, one in plans if one.route == plan.route]
    best = min(plans, key=lambda one: stock_cost(one[1].sheets))[1]
    left = [(ask, stock_cost(one.sheets)) for ask, one in plans if one is not best]
    return replace(best, notes=(*best.notes, *price_notes(best.sheets, left)))


def _plan(design: Design, up: Floats) -> WorkshopPlan:
    ask, surface = design.preset.workshop, design.sheet.surface
    if ask.route == "sheet" and not surface.is_flat:
        raise PatternError(
            "workshop.route = 'sheet' is for flat designs, and this one is curved; use 'strips' or 'bars'"
        )
    flat = ask.route == "sheet" or (ask.route == "auto" and surface.is_flat)
    if ask.splice == "fingers" and not flat:
        raise PatternError(
            "workshop.splice = 'fingers' is for flat sheets, and this design has members; use 'cover' or 'scarf'"
        )
    room = stock_room(ask)
    graph, layering = (None, None) if flat else _built_graph(design)
    route = chosen_route(design, graph, layering, up)
    thickness = ask.thickness or design.preset.statics.thickness / _scale(design)
    if built := route.bars or route.planks:
        parts, notes, layering = list(built.parts), list(built.lines), None
    elif graph and layering and route.name == "panels":
        parts, notes = _panels(design, graph, layering, room, up)
        thickness, layering = layering.thickness, None
    elif graph and layering:
        parts, notes = _curved(design, graph, layering, room, up)
        thickness = layering.thickness
    else:
        parts, notes = _flat(design, room)
    sheets, saved = nested_by_thickness(parts, ask)
    notes = [*notes, *saved]
    if layering:
        notes = [*notes, *sheet_hints(parts, sheets, ask.stock, ask.gap, ask.grain)]
    if route.reason:
        notes = [f"route {route.name}: {route.reason}", *notes]
    return WorkshopPlan(
        *(route.name, thickness, tuple(parts), tuple(sheets), same_parts(parts), tuple(notes)),
        *(graph, layering, ask.model, route.bars, route.planks),
    )


def nested_by_thickness(parts: list[FlatPart], ask: Workshop) -> tuple[list[NestedSheet], list[str]]:
    """Nest the parts of each thickness on sheets of their own; return the sheets and notes."""
    groups: dict[float, list[FlatPart]] = {}
    for part in parts:
        groups.setdefault(part.thickness, []).append(part)
    piled = [nested(some, ask.stock, ask.gap, ask.grain, ask.prices) for some in groups.values()]
    found = [emptied(some, ask.gap, ask.grain) for some in piled] if ask.nesting == "spyrrow" else piled
    before, after = (sum(map(len, some)) for some in (piled, found))
    said = [f"spyrrow saved {_count(before - after, 'sheet')} of {before}"] if ask.nesting == "spyrrow" else []
    return [sheet for sheets in found for sheet in sheets], said


def _scale(design: Design) -> float:
    """Return the size of the design over the built size: 50 for a model at 1:50."""
    return design.preset.workshop.model or 1.0


def _built_graph(design: Design) -> tuple[MemberGraph, Layering]:
    ask, graph = design.preset.workshop, design.members
    thickness = ask.thickness or design.preset.statics.thickness / ask.layers / _scale(design)
    if not ask.model:
        return graph, Layering(thickness, ask.layers, ask.bolt)
    there = {member.family for member in graph.members if is_strip(member)}
    own = tuple(family for family in OWN if family in there)
    return scaled_graph(graph, ask.model), Layering(thickness, ask.layers, ask.bolt, own, LETTERS)


def _flat(design: Design, room: list[tuple[float, float]]) -> tuple[list[FlatPart], list[str]]:
    ask, surface, scale = design.preset.workshop, design.sheet.surface, _scale(design)
    thickness = ask.thickness or design.preset.statics.thickness / scale
    joint = SheetJoint(ask.splice if ask.splice in ("fingers", "scarf") else "butt", thickness)
    found = sheet_parts(scaled_surface(surface, scale) if ask.model else surface, room, joint)
    along, across = found.counts
    if along * across == 1:
        return list(found.pieces), []
    loose = len(found.pieces) - along * across
    notes = [f"the sheet is in {along} x {across} pieces, {JOINED[joint.kind].format(length(joint.reach))}"]
    if loose > 0:
        notes.append(f"{_count(loose, 'part')} more, as not all of a piece hangs together")
    return list(found.pieces), notes


def _curved(
    design: Design, graph: MemberGraph, layering: Layering, room: list[tuple[float, float]], up: Floats
) -> tuple[list[FlatPart], list[str]]:
    ask, statics = design.preset.workshop, design.preset.statics
    surface, ground = design.surface, None
    limit = CARD if ask.model else statics.strength / statics.young
    if ask.model:
        surface = scaled_surface(surface, ask.model)
        ground = Ground.under(surface, design.load, up, layering.thickness, CLEARANCE)
        room = [(a - TABS * layering.thickness, b - TABS * layering.thickness) for a, b in room]
    limits = strip_limits(graph, surface, layering.thickness, limit, ask.bolt)
    strips = strip_parts(graph, layering, room, ask.splice, ground)
    discs = [member for member in graph.members if is_plate(member)]
    below, left = layering.height(layering.plates), {node for node, _ in strips.left}
    plates = plate_parts(graph, discs, node_normals(design, graph), below, layering.bolt, left)
    if not strips.pieces and not plates:
        raise PatternError("nothing of this design is a strip or a plate; build it as one piece, see `dsfab build`")
    lines = model_notes(limits, graph, ask.model, ask.bolt) if ask.model else limits.lines
    notes = [*lines, *_plate_notes(plates), *_strip_notes(strips, graph, layering)]
    if ask.splice == "scarf" and strips.splices:
        notes.append(scarf_line(strips.splices, SCARF * layering.thickness))
    parts = [*strips.pieces, *strips.covers, *plates]
    if ask.model:
        parts += packing_parts(graph, layering)
    if footing := footing_of(design, up):
        feet, flat = leg_plates(graph, layering, footing, ask.plate)
        parts, notes = [*parts, *feet], [*notes, *leg_lines([foot.folds[0].angle for foot in feet], flat)]
    if ground:
        base = base_parts(ground, surface, strips.feet, room)
        parts, notes = [*parts, *base], [*notes, *base_notes(ground, strips.feet, base)]
    return parts, notes


def _panels(
    design: Design, graph: MemberGraph, layering: Layering, room: list[tuple[float, float]], up: Floats
) -> tuple[list[FlatPart], list[str]]:
    ask, thickness = design.preset.workshop, layering.thickness
    surface = scaled_surface(design.surface, ask.model)
    ground = Ground.under(surface, design.load, up, thickness, CLEARANCE)
    room = [(a - TABS * thickness, b - TABS * thickness) for a, b in room]
    limits = strip_limits(graph, surface, thickness, CARD, ask.bolt)
    found = panel_parts(graph, thickness, layering.letters[0], room, ground)
    discs = [member for member in graph.members if is_plate(member)]
    plates = plate_parts(graph, discs, node_normals(design, graph), 0.0, layering.bolt)
    notes = [*model_notes(limits, graph, ask.model, 0.0), *found.lines, *_plate_notes(plates)]
    parts = [*found.parts, *(replace(plate, holes=()) for plate in plates)]
    if ground:
        base = base_parts(ground, surface, found.feet, room)
        parts, notes = [*parts, *base], [*notes, *base_notes(ground, found.feet, base)]
    return parts, notes


def _plate_notes(plates: list[FlatPart]) -> list[str]:
    if not plates:
        return []
    worst = max(plates, key=lambda plate: plate.strain)
    stretched = f", stretched by up to {worst.strain:.2%} ({worst.id})" if worst.strain >= 10 * NOTHING else ""
    return [f"{_count(len(plates), 'plate')}{stretched}"]


def _strip_notes(strips: StripParts, graph: MemberGraph, layering: Layering) -> list[str]:
    found = []
    if strips.stopped:
        found.append(
            f"{_count(len(strips.stopped), 'strip')} {stopping(len(strips.stopped))} others of their layer or curl up: "
            f"{some_names(strips.stopped)}; {_count(len(strips.left), 'node')} without them"
        )
    if strips.gone:
        found.append(f"NOT BUILT, as others of their layer lie where they would be: {some_names(strips.gone)}")
    if strips.near:
        found.append(f"{strips.near} of {strips.splices} splices are nearer to a node than a cover plate is long")
    if strips.missing:
        holes = _count(len(strips.missing), "hole")
        places = list(dict.fromkeys(strips.missing))  # the bolts of a splice share a name
        found.append(f"{holes} not drilled, too near to an edge: {some_names(places)}")
    families = {member.id: member.family for member in graph.members}
    nodes = [node for node in graph.nodes if node.kind != "grazing"]
    packed = Counter(layering.packing(node, families) for node in nodes)
    found += [
        f"{_count(count, 'node')} with packing of {length(layers * layering.thickness)} between two members"
        for layers, count in sorted(packed.items())
        if layers
    ]
    level = sum(families[node.members[0]] == families[node.members[1]] for node in nodes)
    if level:
        found.append(f"{_count(level, 'node')} between members of one layer: notch or butt them there")
    fills = sum(member.kind == "fill" for member in graph.members)
    return [*found, f"{_count(fills, 'filled corner')} left open"] if fills else found


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def same_parts(parts: list[FlatPart]) -> tuple[tuple[int, ...], ...]:
    """Return groups of part numbers with one shape (see `congruent`)."""
    groups: dict[tuple[int, int], list[list[int]]] = {}
    for k, part in enumerate(parts):
        known = groups.setdefault(shape_key(part), [])
        alike = next((group for group in known if congruent(parts[group[0]], part)), None)
        if alike is None:
            known.append([k])
        else:
            alike.append(k)
    return tuple(sorted(tuple(group) for some in groups.values() for group in some))
