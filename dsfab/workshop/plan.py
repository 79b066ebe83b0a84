"""Workshop plan of a design: the way to build it (route), its parts, and the sheets with these parts."""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.core.messages import length, names_and_count
from dsfab.design import Design
from dsfab.members import MemberGraph, member_graph, spherical_normals
from dsfab.preset.sections import Workshop
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.workshop.bars import BarPlan, BarStock, bar_plan
from dsfab.workshop.bars.joints import Footing, leg_lines, leg_plates
from dsfab.workshop.card_models import (
    CREASE_STRAIN,
    MODEL_LETTERS,
    model_notes,
    packing_parts,
    panel_parts,
    scaled_graph,
    scaled_surface,
)
from dsfab.workshop.ground import BasePlane, base_notes, base_parts
from dsfab.workshop.layers import FAMILIES_BELOW, Layering
from dsfab.workshop.nesting import NestedSheet, nest_parts, require_spyrrow, with_fewer_sheets
from dsfab.workshop.parts import NODE_LETTERS, PART_LETTERS, FlatPart, alike_parts, congruent, shape_key
from dsfab.workshop.planks import PlankPlan, PlankStock, plank_plan, standing_order
from dsfab.workshop.plates import SheetJoint, is_plate, plate_parts, sheet_parts
from dsfab.workshop.splices import SCARF_SLOPE, scarf_line
from dsfab.workshop.stock import price_notes, sheet_hints, stock_choices, stock_cost
from dsfab.workshop.strips import (
    HOLE_FIT,
    LEAST_STRAIN,
    StripLimits,
    StripParts,
    drilling_edge,
    is_strip,
    strip_limits,
    strip_parts,
)

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class ConstructionRoute:
    """Way to build a design ("strips", "bars", ...). reason : why dsfab chose this route, or ""."""

    name: str
    reason: str = ""
    bars: BarPlan | None = None
    planks: PlankPlan | None = None


def construction_route(
    design: Design, graph: MemberGraph | None, layering: Layering | None, up: Floats = UP
) -> ConstructionRoute:
    """Return the way to build a design (route), from section [workshop] of its preset.
    graph, layering : None for a flat sheet.    up : (3,) upward unit vector.
    Raises PatternError if the requested route is impossible."""
    options = design.preset.workshop
    if options.route == "sheet" or graph is None or layering is None:
        return ConstructionRoute("sheet", "" if options.route == "sheet" else "the design is flat")
    if options.route in ("bars", "planks"):
        if options.model:
            raise PatternError(
                "dsfab builds models only from strips: leave out --model, or set workshop.route = 'strips'"
            )
        if options.route == "planks":
            return ConstructionRoute("planks", planks=design_planks(design, graph, up))
        return ConstructionRoute("bars", bars=design_bars(design, graph, up))
    if options.route == "panels" and not options.model:
        raise PatternError("panels with tabs are only for models in card: give --model 1:50, or another workshop.route")
    if options.route in ("strips", "panels"):
        return ConstructionRoute(options.route)
    if options.model:
        return ConstructionRoute("strips", "dsfab builds models only from strips")
    statics = design.preset.statics
    edge = drilling_members(design)[1]
    limits = strip_limits(graph, design.surface, layering.thickness, statics.strength / statics.young, edge)
    return _route_by_limits(design, graph, limits, up)


def design_footing(design: Design, up: Floats) -> Footing | None:
    """Return the supports of a design, with their anchors, or None without anchors."""
    options = design.preset.workshop
    if options.model or not options.anchor:
        return None
    return Footing.from_supports(design.surface, design.load, up, options.anchor)


def design_bars(design: Design, graph: MemberGraph, up: Floats = UP) -> BarPlan:
    """Return the bars of a design. Raises PatternError if nodes are too close to each other."""
    options = design.preset.workshop
    stock = BarStock(options.thickness or design.preset.statics.thickness, options.plate, options.bolt, PART_LETTERS)
    return bar_plan(graph, node_normals(design, graph), stock, design_footing(design, up))


def design_planks(design: Design, graph: MemberGraph, up: Floats = UP) -> PlankPlan:
    """Return the planks of a design. Raises PatternError if planks are not possible."""
    options, statics = design.preset.workshop, design.preset.statics
    widths = [member.mean_width for member in graph.members if is_strip(member)]
    if not widths:
        raise PatternError("no member of this design is long enough for a plank; build the design as one piece")
    thickness, depth = options.thickness or statics.thickness, options.depth or float(np.median(widths))
    slenderness = 1.5  # smallest ratio of an upright plank's depth to its thickness
    if depth < slenderness * thickness:
        raise PatternError(
            f"a plank that is {length(depth)} deep and {length(thickness)} thick is not slender enough for an upright "
            f"plank: set workshop.thickness to {depth / slenderness:.2g} or less, or workshop.depth to "
            f"{slenderness * thickness:.2g} or more"
        )
    stock = PlankStock(thickness, depth, options.bolt, options.splice, (PART_LETTERS, NODE_LETTERS))
    ground = BasePlane.from_supports(design.surface, design.load, up, thickness, 0.0) if design.has("statics") else None
    strain = statics.strength / statics.young
    order = standing_order(graph, up)
    return plank_plan(graph, node_normals(design, graph), stock, usable_sizes(options), strain, ground, order)


def usable_sizes(options: Workshop) -> list[tuple[float, float]]:
    """Return the largest part size (two lengths, m) for each stock sheet. Raises PatternError if no room is left."""
    slack = 5e-4  # metres: parts may be slightly rotated on their drawings
    room = [(a - 2 * options.gap - slack, b - 2 * options.gap - slack) for a, b in options.stock]
    if min(min(size) for size in room) <= 0:
        raise PatternError(
            "workshop.gap leaves no room for parts on the smallest stock sheet; use a smaller gap or larger sheets"
        )
    return room


def _route_by_limits(design: Design, graph: MemberGraph, limits: StripLimits, up: Floats) -> ConstructionRoute:
    worst, layers_text = max(limits.bending, limits.shape), f"layers of {length(limits.thickness)} of strips"
    if not limits.limit:
        reason = f"{layers_text} would be bent to a strain of {worst:.2%}, and the limit of the material is not known"
        return ConstructionRoute("strips", reason)
    if worst <= limits.limit:
        return ConstructionRoute(
            "strips", f"{layers_text} can be bent: the strain is {worst:.2%}, and {limits.limit:.2%} is allowed"
        )
    problem = (
        f"{layers_text} would be bent or stretched to a strain of {worst:.2%}, {worst / limits.limit:.1f} times the "
        f"strain that the material bears; the largest thickness that can be bent is {length(limits.thickest)}"
    )
    bars, no_bars = _bars_or_reason(design, graph, up)
    if bars and not no_bars:
        reason = f"{problem}; bars are up to {length(bars.largest_sagitta)} from the surface"
        return ConstructionRoute("bars", reason, bars)
    planks, no_planks = _planks_or_reason(design, graph, up)
    if planks:
        return ConstructionRoute("planks", f"{problem}; {no_bars}; {planks.summary}", planks=planks)
    if bars:
        return ConstructionRoute("bars", f"{problem}; {no_bars}, but {no_planks}", bars)
    return ConstructionRoute("strips", f"{problem}, but {no_bars}, and {no_planks}")


def _bars_or_reason(design: Design, graph: MemberGraph, up: Floats) -> tuple[BarPlan | None, str]:
    try:
        bars = design_bars(design, graph, up)
    except PatternError as error:
        reason = str(error).partition("; ")[0]  # the text after "; " proposes other ways to build
        return None, f"bars are impossible too: {reason}"
    if bars.too_short:
        return None, f"{len(bars.too_short)} bar{'s' * (len(bars.too_short) > 1)} would be too short for bolts"
    oversize = longest_oversize_part(bars.parts, design.preset.workshop)
    if oversize:
        return None, f"bars are longer than the stock ({oversize.id} is {length(oversize.size[0])})"
    width = float(np.median([member.mean_width for member in graph.members if is_strip(member)]))
    sagitta = bars.largest_sagitta
    deviation = f"bars would be up to {length(sagitta)} from the surface, but members are only {length(width)} wide"
    return bars, deviation if sagitta > 0.5 * width else ""


def _planks_or_reason(design: Design, graph: MemberGraph, up: Floats) -> tuple[PlankPlan | None, str]:
    try:
        planks = design_planks(design, graph, up)
    except PatternError as error:
        return None, f"upright planks are impossible: {error}"
    return (None, planks.obstacle) if planks.obstacle else (planks, "")


def longest_oversize_part(parts: Sequence[FlatPart], options: Workshop) -> FlatPart | None:
    """Return the longest part that fits on no stock sheet; None if all parts fit."""
    room = [(a - 2 * options.gap, b - 2 * options.gap) for a, b in options.stock]
    if not options.grain:
        room += [(b, a) for a, b in room]
    unfit = [part for part in parts if not any(part.size[0] <= a and part.size[1] <= b for a, b in room)]
    return max(unfit, key=lambda part: float(part.size[0]), default=None)


def node_normals(design: Design, graph: MemberGraph) -> Floats:
    """Return vectors (n, 3), of any length, along the surface normals at the vertices of a sheet."""
    return graph.sheet.carry(spherical_normals(design.surface))


JOINT_SENTENCES = {
    "butt": "with straight edges that meet without a joint; for a joint, set workshop.splice to 'fingers' or 'scarf'",
    "fingers": "joined by fingers that are {} long and drawn without a gap; a round cutter leaves round inner corners",
    "scarf": "which overlap by {} and are glued there; cut bevels from the engraved lines to the edges: at right and "
    "upper edges on the engraved face, at left and lower edges on the back",
}
"""Ends of the sentence "the sheet is in 2 x 3 pieces, ...", by the kind of joint between the pieces."""
TAB_CLEARANCE = 1e-4  # gap between a tab and its slot in a model's base plate, on each side (m)
TABS_LENGTH = 4.0  # largest length that two tabs add to a strip, in strip thicknesses


@dataclass(frozen=True, eq=False)
class WorkshopPlan:
    """Parts of a design and the sheets from which the parts are cut.
    route : "strips", "planks", "bars", "panels" or "sheet".    thickness : thickness of the stock, metres.
    equal_parts : groups of part numbers; the parts of a group have equal shapes.
    notes : sentences for the builder.    graph : members and nodes at built size; None for a flat sheet.
    layering : layers of strips; None for other routes.    model : 50 for a model at 1:50; 0 for full size.
    bars, planks : plans of these two routes; None for other routes."""

    route: str
    thickness: float
    parts: tuple[FlatPart, ...]
    sheets: tuple[NestedSheet, ...]
    equal_parts: tuple[tuple[int, ...], ...]
    notes: tuple[str, ...]
    graph: MemberGraph | None = None
    layering: Layering | None = None
    model: float = 0.0
    bars: BarPlan | None = None
    planks: PlankPlan | None = None

    def part_thickness(self, part: FlatPart) -> float:
        """Return the thickness of a part (m)."""
        return part.thickness or self.thickness

    @cached_property
    def sheet_numbers(self) -> dict[str, int]:
        """Sheet number of each part, by part name, from 1 on."""
        return {item.part.id: k for k, sheet in enumerate(self.sheets, 1) for item in sheet.parts}

    @property
    def used_share(self) -> float:
        """Fraction of the sheets' area that becomes parts."""
        return sum(part.area for part in self.parts) / sum(a * b for a, b in (sheet.size for sheet in self.sheets))


def workshop_plan(design: Design, up: Floats = UP) -> WorkshopPlan:
    """Return the workshop plan of a design, from section [workshop] of its preset.    up : (3,) upward unit vector.
    If the stock has prices, the plan is the cheapest that dsfab finds.
    Raises PatternError if the route is impossible, a part fits on no sheet, or a library is missing."""
    if design.preset.workshop.nesting == "spyrrow":
        require_spyrrow()
    all_sizes, *fewer_sizes = stock_choices(design.preset.workshop)
    plan = _plan_for_stock(design, up)
    plans = [(all_sizes, plan)]
    for choice in fewer_sizes:
        shorter = Design.from_preset(design.preset.model_copy(update={"workshop": choice}), design)
        with suppress(PatternError):
            plans.append((choice, _plan_for_stock(shorter, up)))
    plans = [(choice, candidate) for choice, candidate in plans if candidate.route == plan.route]
    cheapest = min(plans, key=lambda candidate: stock_cost(candidate[1].sheets))[1]
    rejected = [(choice, stock_cost(candidate.sheets)) for choice, candidate in plans if candidate is not cheapest]
    return replace(cheapest, notes=(*cheapest.notes, *price_notes(cheapest.sheets, rejected)))


def _plan_for_stock(design: Design, up: Floats) -> WorkshopPlan:
    options, surface = design.preset.workshop, design.sheet.surface
    if options.route == "sheet" and not surface.is_flat:
        raise PatternError(
            "workshop.route = 'sheet' is for flat designs; but this design is curved: use 'strips' or 'bars'"
        )
    flat = options.route == "sheet" or (options.route == "auto" and surface.is_flat)
    if options.splice == "fingers" and not flat:
        raise PatternError("workshop.splice = 'fingers' is for flat sheets, not for members; use 'cover' or 'scarf'")
    room = usable_sizes(options)
    graph, layering = (None, None) if flat else _graph_as_built(design)
    route = construction_route(design, graph, layering, up)
    thickness = options.thickness or design.preset.statics.thickness / (options.model or 1.0)
    if built := route.bars or route.planks:
        parts, notes, layering = list(built.parts), list(built.lines), None
    elif graph and layering and route.name == "panels":
        parts, notes = _panel_design_parts(design, graph, layering, room, up)
        thickness, layering = layering.thickness, None
    elif graph and layering:
        parts, notes = _curved_design_parts(design, graph, layering, room, up)
        thickness = layering.thickness
    else:
        parts, notes = _flat_design_parts(design, room)
    sheets, saved = nested_by_thickness(parts, options)
    notes = [*notes, *saved]
    if layering:
        notes = [*notes, *sheet_hints(parts, sheets, options.stock, options.gap, options.grain)]
    if route.reason:
        notes = [f"route {route.name}: {route.reason}", *notes]
    return WorkshopPlan(
        *(route.name, thickness, tuple(parts), tuple(sheets), equal_part_groups(parts), tuple(notes)),
        *(graph, layering, options.model, route.bars, route.planks),
    )


def nested_by_thickness(parts: list[FlatPart], options: Workshop) -> tuple[list[NestedSheet], list[str]]:
    """Nest the parts of each thickness on separate sheets. Return the sheets, and notes."""
    groups: dict[float, list[FlatPart]] = {}
    for part in parts:
        groups.setdefault(part.thickness, []).append(part)
    stacks = [nest_parts(group, options.stock, options.gap, options.grain, options.prices) for group in groups.values()]
    nests, notes = stacks, list[str]()
    if options.nesting == "spyrrow":
        nests = [with_fewer_sheets(group, options.gap, options.grain) for group in stacks]
        before, after = (sum(map(len, group)) for group in (stacks, nests))
        notes = [f"spyrrow saved {_quantity(before - after, 'sheet')} of {before}"]
    return [sheet for sheets in nests for sheet in sheets], notes


MOST_FACES = 250_000  # largest number of faces of a cut sheet refined for drilling


def drilling_members(design: Design) -> tuple[MemberGraph, float]:
    """Return the members of a design on a fine mesh, and the edge length (m) of this mesh."""

    def members() -> tuple[MemberGraph, float]:
        graph, sheet, edge = design.members, design.sheet, design.surface.mean_edge
        needed_halvings = int(np.ceil(np.log2(max(edge / drilling_edge(graph), 1.0))))
        halvings = min(needed_halvings, int(np.log2(max(MOST_FACES / sheet.surface.m, 1.0)) / 2))
        if not halvings:
            return graph, edge
        finer_sheets = meshes(sheet, SmoothSurface.from_surface(design.surface))
        finer = member_graph(design.surface, next(islice(finer_sheets, halvings, None)), design.pattern)
        is_same = [member.id for member in finer.members] == [member.id for member in graph.members]
        return (finer, edge / 2**halvings) if is_same else (graph, edge)

    return design.cached_result("slicing", "drilling members", members)


def _graph_as_built(design: Design) -> tuple[MemberGraph, Layering]:
    options, graph = design.preset.workshop, design.members
    thickness = options.thickness or design.preset.statics.thickness / options.layers / (options.model or 1.0)
    if not options.model:
        layering = Layering(thickness, options.layers, options.bolt, alike=options.alike)
        return drilling_members(design)[0], layering
    present = {member.family for member in graph.members if is_strip(member)}
    order = tuple(family for family in FAMILIES_BELOW if family in present)
    return scaled_graph(graph, options.model), Layering(thickness, options.layers, options.bolt, order, MODEL_LETTERS)


def _flat_design_parts(design: Design, room: list[tuple[float, float]]) -> tuple[list[FlatPart], list[str]]:
    options, surface = design.preset.workshop, design.sheet.surface
    scale = options.model or 1.0
    thickness = options.thickness or design.preset.statics.thickness / scale
    joint = SheetJoint(options.splice if options.splice in ("fingers", "scarf") else "butt", thickness)
    division = sheet_parts(scaled_surface(surface, scale) if options.model else surface, room, joint)
    along, across = division.counts
    if along * across == 1:
        return list(division.pieces), []
    extra_parts = len(division.pieces) - along * across
    notes = [f"the sheet is in {along} x {across} pieces, {JOINT_SENTENCES[joint.kind].format(length(joint.reach))}"]
    if extra_parts > 0:
        notes.append(f"openings divide some of these pieces, which makes {_quantity(extra_parts, 'part')} more")
    return list(division.pieces), notes


def _curved_design_parts(
    design: Design, graph: MemberGraph, layering: Layering, room: list[tuple[float, float]], up: Floats
) -> tuple[list[FlatPart], list[str]]:
    options, statics = design.preset.workshop, design.preset.statics
    surface, ground = design.surface, None
    limit = CREASE_STRAIN if options.model else statics.strength / statics.young
    if options.model:
        surface = scaled_surface(surface, options.model)
        ground = BasePlane.from_supports(surface, design.load, up, layering.thickness, TAB_CLEARANCE)
        room = [(a - TABS_LENGTH * layering.thickness, b - TABS_LENGTH * layering.thickness) for a, b in room]
    edge = surface.mean_edge if options.model else drilling_members(design)[1]
    limits = strip_limits(graph, surface, layering.thickness, limit, edge)
    strips = strip_parts(graph, layering, room, options.splice, ground)
    discs = [member for member in graph.members if is_plate(member)]
    below, missed_nodes = layering.layer_height(layering.plate_layer), {node for node, _ in strips.missed_nodes}
    plates = plate_parts(graph, discs, node_normals(design, graph), below, layering.bolt, missed_nodes)
    if not strips.pieces and not plates:
        raise PatternError("this design has no strips and no plates; build the design as one piece, see `dsfab build`")
    lines = model_notes(limits, graph, options.model, options.bolt) if options.model else [*limits.lines]
    if edge < surface.mean_edge:
        refined = (
            f"dsfab refined the mesh for exact holes: edges are {length(edge)}, not {length(surface.mean_edge)} long"
        )
        lines = [*lines, f"{refined}, on a smooth surface"]
    notes = [*lines, *_plate_notes(plates), *_strip_notes(strips, graph, layering)]
    if options.splice == "scarf" and strips.splice_count:
        notes.append(scarf_line(strips.splice_count, SCARF_SLOPE * layering.thickness))
    parts = [*strips.pieces, *strips.covers, *plates]
    if options.model:
        parts += packing_parts(graph, layering)
    else:
        alike = alike_parts(parts, options.alike or NEARLY_EQUAL, HOLE_FIT)
        notes += _alike_notes(parts, alike, options.alike)
        parts = list(alike) if options.alike else parts
    if footing := design_footing(design, up):
        feet, flat = leg_plates(graph, layering, footing, options.plate)
        parts, notes = [*parts, *feet], [*notes, *leg_lines([foot.folds[0].angle for foot in feet], flat)]
    if ground:
        base = base_parts(ground, surface, strips.feet, room)
        parts, notes = [*parts, *base], [*notes, *base_notes(ground, strips.feet, base)]
    return parts, notes


def _panel_design_parts(
    design: Design, graph: MemberGraph, layering: Layering, room: list[tuple[float, float]], up: Floats
) -> tuple[list[FlatPart], list[str]]:
    options, thickness = design.preset.workshop, layering.thickness
    surface = scaled_surface(design.surface, options.model)
    ground = BasePlane.from_supports(surface, design.load, up, thickness, TAB_CLEARANCE)
    room = [(a - TABS_LENGTH * thickness, b - TABS_LENGTH * thickness) for a, b in room]
    limits = strip_limits(graph, surface, thickness, CREASE_STRAIN, surface.mean_edge)
    panels = panel_parts(graph, thickness, layering.letters[0], room, ground)
    discs = [member for member in graph.members if is_plate(member)]
    plates = plate_parts(graph, discs, node_normals(design, graph), 0.0, layering.bolt)
    notes = [*model_notes(limits, graph, options.model, 0.0), *panels.lines, *_plate_notes(plates)]
    parts = [*panels.parts, *(replace(plate, holes=()) for plate in plates)]
    if ground:
        base = base_parts(ground, surface, panels.feet, room)
        parts, notes = [*parts, *base], [*notes, *base_notes(ground, panels.feet, base)]
    return parts, notes


NEARLY_EQUAL = 5e-3  # largest distance of near-equal outlines if workshop.alike is 0 (m)


def _alike_notes(parts: list[FlatPart], alike: list[FlatPart], distance: float) -> list[str]:
    before, after = len(equal_part_groups(parts)), len(equal_part_groups(alike))
    if distance:
        return [
            f"{_quantity(len(parts), 'part')} with {after} different shapes; workshop.alike = 0 would give {before}"
        ]
    fewer = (
        f"; workshop.alike = {NEARLY_EQUAL:g} would leave at most {after} different shapes" if after < before else ""
    )
    return [f"{_quantity(len(parts), 'part')} of {_quantity(before, 'shape')}{fewer}"]


def _plate_notes(plates: list[FlatPart]) -> list[str]:
    if not plates:
        return []
    worst = max(plates, key=lambda plate: plate.strain)
    stretched = f", stretched by up to {worst.strain:.2%} ({worst.id})" if worst.strain >= 10 * LEAST_STRAIN else ""
    return [f"{_quantity(len(plates), 'plate')}{stretched}"]


def _strip_notes(strips: StripParts, graph: MemberGraph, layering: Layering) -> list[str]:
    notes = []
    if strips.shortened:
        number, missed = len(strips.shortened), _quantity(len(strips.missed_nodes), "node")
        singular = "1 strip stops before its ends, because it would meet other strips of the same layer or curl up"
        plural = f"{number} strips stop before their ends, because they would meet strips of the same layer or curl up"
        reason = singular if number == 1 else plural
        notes.append(f"{reason}: {names_and_count(strips.shortened)}; this leaves {missed} unreached")
    if strips.vanished:
        notes.append(
            f"NOT BUILT, because other strips of the same layer are in the way: {names_and_count(strips.vanished)}"
        )
    if strips.splices_near_nodes:
        splices = f"{strips.splices_near_nodes} of {strips.splice_count} splices"
        notes.append(f"{splices} are too close to a node: the cover plate or lap may overlap the crossing strip")
    if strips.missing_holes:
        holes = _quantity(len(strips.missing_holes), "hole")
        places = list(dict.fromkeys(strips.missing_holes))  # bolts of one splice share a name
        notes.append(f"{holes} not drilled, because the distance to an edge is too small: {names_and_count(places)}")
    families = {member.id: member.family for member in graph.members}
    nodes = [node for node in graph.nodes if node.kind != "grazing"]
    packed = Counter(layering.packing_layers(node, families) for node in nodes)
    notes += [
        f"put packing, {length(layers * layering.thickness)} thick, between both members at {_quantity(count, 'node')}"
        for layers, count in sorted(packed.items())
        if layers
    ]
    level = sum(families[node.members[0]] == families[node.members[1]] for node in nodes)
    if level:
        notes.append(
            f"at {_quantity(level, 'node')}, members of the same layer meet: notch them, or let one end at the other"
        )
    fills = sum(member.kind == "fill" for member in graph.members)
    return [*notes, f"{_quantity(fills, 'filled corner')} left open"] if fills else notes


def _quantity(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def equal_part_groups(parts: list[FlatPart]) -> tuple[tuple[int, ...], ...]:
    """Return groups of part numbers; the parts of a group have equal shapes."""
    groups: dict[tuple[int, int], list[list[int]]] = {}
    for k, part in enumerate(parts):
        candidates = groups.setdefault(shape_key(part), [])
        match = next((group for group in candidates if congruent(parts[group[0]], part)), None)
        if match is None:
            candidates.append([k])
        else:
            match.append(k)
    return tuple(sorted(tuple(group) for lists in groups.values() for group in lists))
