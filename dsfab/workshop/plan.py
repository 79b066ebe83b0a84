"""`WorkshopPlan`: what a workshop needs of a design: its parts, their sheets, and what is to be known first."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.errors import PatternError
from dsfab.members import MemberGraph, spherical_normals
from dsfab.pipeline import Design
from dsfab.wording import length
from dsfab.workshop.layering import Layering
from dsfab.workshop.limits import strip_limits
from dsfab.workshop.nesting import NestedSheet, nested
from dsfab.workshop.parts import FlatPart, congruent, shape_key
from dsfab.workshop.plates import plate_parts
from dsfab.workshop.sheet import sheet_parts
from dsfab.workshop.strips import StripParts, strip_parts

SLACK = 5e-4
"""Metres that parts are shorter than the stock has room for: what their direction may differ by on the drawing."""


@dataclass(frozen=True, eq=False)
class WorkshopPlan:
    """The parts of a design and the sheets that they are cut from.

    route     : "strips" or "sheet".    thickness : of the stock, metres.
    parts     : all of them.            sheets : each part on one of them.
    same      : numbers of parts that are one part to cut, as lists, in the order of the parts.
    notes     : sentences that come first: what is possible, and what is not.
    graph     : the members that the parts are of, and their nodes; None of a flat sheet.
    """

    route: str
    thickness: float
    parts: tuple[FlatPart, ...]
    sheets: tuple[NestedSheet, ...]
    same: tuple[tuple[int, ...], ...]
    notes: tuple[str, ...]
    graph: MemberGraph | None = None

    @cached_property
    def sheet_of(self) -> dict[str, int]:
        """The number, from 1, of the sheet that a part is on, by the names of parts."""
        return {one.part.id: k for k, sheet in enumerate(self.sheets, 1) for one in sheet.parts}

    @property
    def used(self) -> float:
        """Share of the sheets' area that becomes parts."""
        return sum(part.area for part in self.parts) / sum(a * b for a, b in (sheet.size for sheet in self.sheets))


def workshop_plan(design: Design) -> WorkshopPlan:
    """The plan of a design, by the section [workshop] of its preset.

    Raises PatternError where the route is not possible, or a part fits on no sheet.
    """
    ask, surface = design.preset.workshop, design.sheet.surface
    if ask.route == "sheet" and not surface.is_flat:
        raise PatternError("workshop.route = 'sheet' is for flat designs, and this one is curved; use 'strips'")
    flat = ask.route == "sheet" or (ask.route == "auto" and surface.is_flat)
    room = [(a - 2 * ask.gap - SLACK, b - 2 * ask.gap - SLACK) for a, b in ask.stock]
    if min(min(size) for size in room) <= 0:
        raise PatternError("workshop.gap leaves no room on the smallest stock; give a smaller gap or larger sheets")
    parts, notes = _flat(design, room) if flat else _curved(design, room)
    sheets = nested(parts, ask.stock, ask.gap)
    thickness = ask.thickness or design.preset.statics.thickness / (1 if flat else ask.layers)
    route = "sheet" if flat else "strips"
    if ask.route == "auto":
        notes = [f"route {route}: the design is {'flat' if flat else 'curved, and its members can lie in it'}", *notes]
    graph = None if flat else design.members
    return WorkshopPlan(route, thickness, tuple(parts), tuple(sheets), same_parts(parts), tuple(notes), graph)


def _flat(design: Design, room: list[tuple[float, float]]) -> tuple[list[FlatPart], list[str]]:
    found = sheet_parts(design.sheet.surface, room)
    along, across = found.counts
    if along * across == 1:
        return list(found.pieces), []
    return list(found.pieces), [f"the sheet is cut straight into {along} x {across} pieces, butted: no joint is drawn"]


def _curved(design: Design, room: list[tuple[float, float]]) -> tuple[list[FlatPart], list[str]]:
    preset, graph = design.preset, design.members
    ask, statics = preset.workshop, preset.statics
    layering = Layering(ask.thickness or statics.thickness / ask.layers, ask.layers, ask.bolt)
    limits = strip_limits(graph, design.surface, layering.thickness, statics.strength / statics.young, ask.bolt)
    strips = strip_parts(graph, layering, room, ask.splice == "cover")
    normals = graph.sheet.carry(spherical_normals(design.surface))
    plates = plate_parts(graph, normals / np.linalg.norm(normals, axis=1)[:, None], layering)
    if not strips.pieces and not plates:
        raise PatternError("nothing of this design is a strip or a plate; build it as one piece, see `dsfab build`")
    notes = [*limits.lines, *_plate_notes(plates), *_strip_notes(strips, graph, layering)]
    return [*strips.pieces, *strips.covers, *plates], notes


def _plate_notes(plates: list[FlatPart]) -> list[str]:
    if not plates:
        return []
    worst = max(plates, key=lambda plate: plate.strain)
    return [f"{_count(len(plates), 'plate')}, stretched by up to {worst.strain:.2%} ({worst.id})"]


def _strip_notes(strips: StripParts, graph: MemberGraph, layering: Layering) -> list[str]:
    """What is to be known of splices, holes, packing and what is not built."""
    found = []
    if strips.near:
        found.append(f"{strips.near} of {strips.splices} splices are nearer to a node than a cover plate is long")
    if strips.missing:
        shown = ", ".join(strips.missing[:5]) + (", ..." if len(strips.missing) > 5 else "")
        found.append(f"{_count(len(strips.missing), 'hole')} not drilled, too near to an edge: {shown}")
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
