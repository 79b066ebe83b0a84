"""Models in card: a graph of members as large as the model, and what card, lasers and fingers take."""

from dataclasses import replace

import numpy as np

from dsfab.members import Member, MemberGraph, Node
from dsfab.surface import Surface
from dsfab.units import MM_PER_M
from dsfab.wording import length
from dsfab.workshop.layering import Layering
from dsfab.workshop.limits import DRILL, StripLimits
from dsfab.workshop.parts import FlatPart, Hole
from dsfab.workshop.strips import is_strip

CARD = 0.01
"""Strain at which greyboard creases: bent to a radius of fifty times its thickness. A rule of thumb; thin card and
paper take more."""
NARROWEST = 0.002
"""Metres; narrower strips of card tear at their holes and burn through."""
LETTERS = (0.003, 0.002)
"""Heights of names of parts and of nodes, metres, at most."""
FIT = 1e-4
"""Metres that holes of a model may be off their nodes, by a mesh that is too coarse."""


def scaled_surface(surface: Surface, scale: float) -> Surface:
    """A surface at 1 : scale."""
    return Surface(surface.V / scale, surface.F)


def scaled_graph(graph: MemberGraph, scale: float) -> MemberGraph:
    """Members and nodes at 1 : scale: lengths become shorter, curvatures larger, names stay."""
    sheet = replace(graph.sheet, surface=scaled_surface(graph.sheet.surface, scale))
    members = tuple(_scaled_member(member, scale) for member in graph.members)
    return replace(graph, sheet=sheet, members=members, nodes=tuple(_scaled_node(node, scale) for node in graph.nodes))


def _scaled_member(member: Member, scale: float) -> Member:
    axis = member.axis
    if axis is not None:
        lengths = {name: getattr(axis, name) / scale for name in ("s", "P", "traced", "strayed")}
        axis = replace(axis, **lengths, **{name: getattr(axis, name) * scale for name in ("kg", "kn", "tg")})
    return replace(member, area=member.area / scale**2, axis=axis, sides=member.sides / scale)


def _scaled_node(node: Node, scale: float) -> Node:
    at = node.at[0] / scale, node.at[1] / scale
    return replace(node, at=at, point=node.point / scale, area=node.area / scale**2)


def model_notes(limits: StripLimits, graph: MemberGraph, scale: float, bolt: float) -> list[str]:
    """What card can be bent to, what is too narrow for it, and whether the mesh is fine enough; in the model's size.

    graph : as large as the model.    bolt : diameter of the pins, metres; 0 where nothing has holes.
    """
    found = []
    how = f"card of {length(limits.thickness)} is bent to a strain of {limits.bending:.2%} ({limits.member} most)"
    thinner = np.floor(1e4 * limits.thickest) / 1e4 if limits.bending else 0.0
    if limits.bending > CARD:
        found.append(
            f"NOT WITHOUT CREASES: {how}, and greyboard creases at some {CARD:.0%}: set --thickness to "
            f"{MM_PER_M * thinner:g}mm or less, or build a larger model"
        )
    else:
        found.append(f"{how}; greyboard creases at some {CARD:.0%}")
    narrow = sorted((member for member in graph.members if is_strip(member)), key=lambda member: member.mean_width)
    narrow = [member for member in narrow if member.mean_width < NARROWEST]
    if narrow:
        least = narrow[0].mean_width
        larger = _rounded_scale(scale * least / NARROWEST)
        found.append(
            f"TOO NARROW: {len(narrow)} of the members are narrower than the {length(NARROWEST)} that card holds "
            f"together at ({narrow[0].id} is {length(least)}): build at 1:{larger:g} or "
            f"larger, or make members {length(NARROWEST * scale)} wide, see [pattern.width]"
        )
    wanted = limits.wanted * np.sqrt(FIT / (DRILL * bolt)) * scale if bolt else np.inf
    if limits.edge * scale > 1.05 * wanted:
        found.append(
            f"HOLES MAY MISS EACH OTHER: edges of {length(limits.edge * scale)} are too coarse a mesh for this model; "
            f"set surface.edge to {wanted:.2g} or less"
        )
    return found


def packing_parts(graph: MemberGraph, layering: Layering) -> list[FlatPart]:
    """Squares of card for nodes between whose members a layer or more lies empty, a hole in the middle of each."""
    families = {member.id: member.family for member in graph.members}
    found = []
    for node in graph.nodes:
        if node.kind != "grazing" and all(is_strip(graph.by_id[name]) for name in node.members):
            side = min(graph.by_id[name].mean_width for name in node.members)
            square = side / 2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
            hole = Hole(np.zeros(2), layering.bolt, node.id)
            found += [
                FlatPart(f"{node.id}.p{k}", "", (0.0, 0.0), square, (hole,))
                for k in range(1, layering.packing(node, families) + 1)
            ]
    return found


def _rounded_scale(most: float) -> float:
    """The largest usual scale, its second number, that is not larger than `most`; `most` rounded down below 1."""
    usual = [k * 10.0**power for power in range(5) for k in (1.0, 2.0, 2.5, 5.0)]
    return max((one for one in usual if one <= most), default=float(np.floor(10 * most) / 10))
