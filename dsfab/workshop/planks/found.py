"""What sawing planks finds: their flat parts, and what is to be known of them."""

from dataclasses import dataclass, field

from dsfab.workshop.parts import FlatPart
from dsfab.workshop.planks.slots import PlankCrossings


@dataclass
class PlankParts:
    """Flat parts of all planks, and what is to be known of them.

    order     : of families, from those that stand first.
    crossings : with slots, and nodes without.    crowded : nodes whose slots would run into others, "N007 in A02".
    steep     : the angle, radians, of pieces, by name, between the way on which they come and their slots, at most.
    stuck     : pieces that do not slide on, by name, with that angle.
    stopped   : members that stop before others of their family, or where they curl up.    left : nodes that they miss.
    gone      : those of which nothing is left then.
    level     : ends cut along the ground.    near, splices : splices near to a node, and all.
    longer    : metres that twisted edges are longer than drawn, by member.    bends : strain of bending, by member.
    """

    order: tuple[str, ...]
    pieces: list[FlatPart] = field(default_factory=list)
    covers: list[FlatPart] = field(default_factory=list)
    crossings: PlankCrossings = field(default_factory=PlankCrossings)
    crowded: list[str] = field(default_factory=list)
    steep: dict[str, float] = field(default_factory=dict)
    stuck: dict[str, float] = field(default_factory=dict)
    stopped: list[str] = field(default_factory=list)
    gone: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    level: int = 0
    near: int = 0
    splices: int = 0
    longer: dict[str, float] = field(default_factory=dict)
    bends: dict[str, float] = field(default_factory=dict)
