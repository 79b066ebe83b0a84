"""`WorkshopPlan`: what a workshop needs of a design: its parts, their sheets, and what is to be known first."""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

from dsfab.arrays import Floats
from dsfab.errors import PatternError
from dsfab.members import MemberGraph
from dsfab.pipeline import Design
from dsfab.preset_workshop import Workshop
from dsfab.wording import length, some_names, stopping
from dsfab.workshop.bars import BarPlan
from dsfab.workshop.base import base_notes, base_parts
from dsfab.workshop.ground import Ground
from dsfab.workshop.hints import sheet_hints
from dsfab.workshop.layering import OWN, Layering
from dsfab.workshop.legs import leg_lines, leg_plates
from dsfab.workshop.limits import NOTHING, strip_limits
from dsfab.workshop.model import CARD, LETTERS, model_notes, packing_parts, scaled_graph, scaled_surface
from dsfab.workshop.nesting import NestedSheet, emptied, nested, require_spyrrow
from dsfab.workshop.panels import panel_parts
from dsfab.workshop.parts import FlatPart, congruent, shape_key
from dsfab.workshop.planks import PlankPlan
from dsfab.workshop.plates import is_plate, plate_parts
from dsfab.workshop.prices import price_notes, stock_choices, stock_cost
from dsfab.workshop.routes import UP, chosen_route, footing_of, node_normals, stock_room
from dsfab.workshop.sheet import SheetJoint, sheet_parts
from dsfab.workshop.splices import SCARF, scarf_line
from dsfab.workshop.strips import StripParts, is_strip, strip_parts

JOINED = {
    "butt": "cut straight and butted: no joint is drawn; set workshop.splice to 'fingers' or 'scarf' for one",
    "fingers": "with fingers {} long that close without a gap; a round cutter leaves its radius in their corners",
    "scarf": "which reach over each other by {} and are glued there on a bevel: to the right and above on the engraved "
    "face, from the engraved line to the edge, to the left and below on the other one",
}
"""What is said of pieces of a flat sheet, by their joint."""
CLEARANCE = 1e-4
"""Metres that a slot in the plate of a model is wider than its tab, to each side."""
TABS = 4.0
"""Thicknesses that both tabs of a strip may make it longer."""


@dataclass(frozen=True, eq=False)
class WorkshopPlan:
    """The parts of a design and the sheets that they are cut from.

    route     : "strips", "planks", "bars", "panels" or "sheet".
    thickness : of the stock, metres; some parts say their own.
    parts     : all of them.            sheets : each part on one of them.
    same      : numbers of parts that are one part to cut, as lists, in the order of the parts.
    notes     : sentences that come first: what is possible, and what is not.
    graph     : the members that the parts are of, and their nodes, as large as what is built; None of a flat sheet.
    layering  : how strips lie on each other; None of other routes.
    model     : 50 for a model at 1:50; 0 for full size.
    bars, planks : of these routes; they have no layers.
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
        """Metres."""
        return part.thickness or self.thickness

    @cached_property
    def sheet_of(self) -> dict[str, int]:
        """The number, from 1, of the sheet that a part is on, by the names of parts."""
        return {one.part.id: k for k, sheet in enumerate(self.sheets, 1) for one in sheet.parts}

    @property
    def used(self) -> float:
        """Share of the sheets' area that becomes parts."""
        return sum(part.area for part in self.parts) / sum(a * b for a, b in (sheet.size for sheet in self.sheets))


def workshop_plan(design: Design, up: Floats = UP) -> WorkshopPlan:
    """The plan of a design, by the section [workshop] of its preset.

    up : (3,) unit vector, for the base plate of a model.

    Where the stock has prices, it is the cheapest of those for all of its sizes and for the shorter ones alone.

    Raises PatternError where the route is not possible, a part fits on no sheet, or a library is missing.
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
    """The plan of a design for all of its stock."""
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
    """Parts on sheets, those of each thickness on sheets of their own (see `nested`, `emptied`), and what is said of
    it."""
    groups: dict[float, list[FlatPart]] = {}
    for part in parts:
        groups.setdefault(part.thickness, []).append(part)
    piled = [nested(some, ask.stock, ask.gap, ask.grain, ask.prices) for some in groups.values()]
    found = [emptied(some, ask.gap, ask.grain) for some in piled] if ask.nesting == "spyrrow" else piled
    before, after = (sum(map(len, some)) for some in (piled, found))
    said = [f"spyrrow saved {_count(before - after, 'sheet')} of {before}"] if ask.nesting == "spyrrow" else []
    return [sheet for sheets in found for sheet in sheets], said


def _scale(design: Design) -> float:
    """How many times as large a design is as what is built: 50 of a model at 1:50."""
    return design.preset.workshop.model or 1.0


def _built_graph(design: Design) -> tuple[MemberGraph, Layering]:
    """Members and nodes as large as they are built, and the layers that they lie in."""
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
    """Panels of a model, plates beneath them without holes, and what it stands on."""
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
    """What is to be known of splices, holes, packing and what is not built."""
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
        places = list(dict.fromkeys(strips.missing))  # a splice has several bolts of one name
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
    """Groups of parts, by number, that are one part to cut (see `congruent`)."""
    groups: dict[tuple[int, int], list[list[int]]] = {}
    for k, part in enumerate(parts):
        known = groups.setdefault(shape_key(part), [])
        alike = next((group for group in known if congruent(parts[group[0]], part)), None)
        if alike is None:
            known.append([k])
        else:
            alike.append(k)
    return tuple(sorted(tuple(group) for some in groups.values() for group in some))
