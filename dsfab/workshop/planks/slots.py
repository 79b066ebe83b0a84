"""Crossings of planks, and the slots through which planks pass each other.

         d  assembly direction of the upper plank
    n   /
    |  /          ┌──────┐    ┌──────┐    lower plank with a slot from above;
    | /           │      │    │      │    the bottom of the slot is in the middle
    |/            │      └────┘      │    of both planks
                  └──────────────────┘

Slots are cut square to the face. Their width is t / sin a + t / tan a, for thickness t and crossing angle a."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Floats, lock_floats
from dsfab.members import MemberGraph
from dsfab.workshop.development import StripCourse
from dsfab.workshop.parts import FlatPart

SLIDE_ANGLE = float(np.radians(10.0))
"""Largest angle between the assembly direction of a piece and the normals at its nodes, radians.
Slots are widened so that a piece can slide in its assembly direction. A plank with a larger angle is spliced."""


def largest_deviation(normals: Floats) -> float:
    """Return the largest angle (radians) between unit vectors (q, 3) and their middle direction; 0 without vectors."""
    return 0.0 if len(normals) < 2 else float(np.arccos(np.clip(normals @ middle_direction(normals), -1.0, 1.0)).max())


def middle_direction(normals: Floats) -> Floats:
    """Return the unit vector (3,) halfway between the two most different of `normals` (q, 3)."""
    i, j = np.unravel_index(int((normals @ normals.T).argmin()), (len(normals),) * 2)
    direction = normals[i] + normals[j]
    return np.asarray(direction / np.linalg.norm(direction))


STANDING_ORDER = ("major", "minor", "rim", "keep")
"""Order of assembly of families of planks that begin at equal heights. Later families cross above earlier families."""
SLOT_CLEARANCE = 2e-4  # gap between a plank and the sides and bottom of its slot (m)
LEAST_DEGREES = 30.0
"""Smallest crossing angle of planks with slots (degrees); at a smaller angle a slot would cut most of the plank."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """Two planks at a node.
    members : lower plank and upper plank.    at : (2,) arc length on the axis of each plank, metres.
    rise    : height of the upper axis above the lower axis, metres.    normal : (3,) unit normal of the surface.
    ways : (2, 3) unit tangents of both planks.    angle : angle between the tangents, at most 90 degrees, radians."""

    node: str
    members: tuple[str, str]
    at: tuple[float, float]
    rise: float
    normal: Floats
    ways: Floats
    angle: float

    def __post_init__(self) -> None:
        lock_floats(self, normal=(3,), ways=(2, 3))

    def slot_leans(self, direction: Floats) -> tuple[float, float]:
        """Return the lower and the upper plank's `Slot.lean`, so that the planks slide together along `direction` (3,).
        The lean is the growth of a slot's width per metre of height."""
        along_lower, along_upper, up = np.linalg.solve(np.stack([*self.ways, self.normal], axis=1), direction)
        return float(along_lower / up), float(-along_upper / up)


@dataclass(frozen=True)
class Slot:
    """Slot of a plank at an arc length.
    half  : half the width of the slot's bottom, metres.
    y     : height of the slot's bottom above the axis, metres.    above : True if the slot is open at the top.
    lean  : growth of the width per metre from the bottom; positive: on the side of higher arc length."""

    node: str
    s: float
    y: float
    half: float
    lean: float
    above: bool

    def mouth(self, edge: float) -> tuple[float, float]:
        """Return the positions (m) of the slot's two sides at the height `edge` (m) above the axis.
        Positions are measured along the plank from the middle of the slot's bottom."""
        widening = self.lean * abs(edge - self.y)
        return -self.half + min(widening, 0.0), self.half + max(widening, 0.0)


@dataclass
class PlankCrossings:
    """Crossings with slots, and names of nodes with an angle too sharp for slots."""

    crossings: list[Crossing] = field(default_factory=list)
    sharp_nodes: list[str] = field(default_factory=list)


def slot_width(thickness: float, angle: float) -> float:
    """Return the width of a slot (m) for planks with equal thickness (m) and a crossing angle (radians)."""
    return float(thickness / np.sin(angle) + thickness / np.tan(angle))


def standing_order(graph: MemberGraph, up: Floats) -> tuple[str, ...]:
    """Return the families of members, sorted by the height at which members begin. up : (3,) upward unit vector."""
    z = graph.sheet.surface.V @ up
    begins: dict[str, list[float]] = {family: [] for family in STANDING_ORDER}
    for member in graph.members:
        if member.axis is not None and member.family in begins:
            begins[member.family].append(float(z[graph.sheet.surface.F[member.cells]].min()))
    span = max(float(np.ptp(z)), np.finfo(float).tiny)
    # heights within a twentieth of the structure's height count as equal
    low = {family: round(float(np.median(heights)) / span / 0.05) for family, heights in begins.items() if heights}
    return tuple(sorted(STANDING_ORDER, key=lambda family: (low.get(family, np.inf), STANDING_ORDER.index(family))))


def plank_crossings(
    graph: MemberGraph, courses: Mapping[str, StripCourse], order: Sequence[str] = STANDING_ORDER
) -> PlankCrossings:
    """Return the crossings of planks at nodes. order : families from the lowest to the uppermost."""
    result = PlankCrossings()
    for node in graph.nodes:
        if node.kind == "grazing" or not all(name in courses for name in node.members):
            continue
        pairs = sorted(zip(node.members, node.at, strict=True), key=lambda x: order.index(graph.by_id[x[0]].family))
        if not np.isfinite(node.at).all() or node.angle < LEAST_DEGREES:
            result.sharp_nodes.append(node.id)
            continue
        (lower, s), (upper, t) = pairs
        result.crossings.append(slot_crossing(node.id, (lower, upper), (courses[lower], courses[upper]), (s, t)))
    return result


def slot_crossing(
    node: str, names: tuple[str, str], courses: tuple[StripCourse, StripCourse], stations: tuple[float, float]
) -> Crossing:
    """Return the crossing of two planks. stations : approximate arc length on each axis, metres."""
    s, t = (course.wrapped_station(x) for course, x in zip(courses, stations, strict=True))
    for _ in range(5):
        (P, T, N), (Q, U, M) = ([x[0] for x in c.frame_at(np.array([x]))] for c, x in zip(courses, (s, t), strict=True))
        n = (N + M) / np.linalg.norm(N + M)
        u, v, rise = np.linalg.solve(np.stack([T, -U, n], axis=1), Q - P)
        s, t = s + float(u), t + float(v)
    ways = np.stack([T - (T @ n) * n, U - (U @ n) * n])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    angle = float(np.arccos(np.clip(abs(ways[0] @ ways[1]), 0.0, 1.0)))
    return Crossing(node, names, (s, t), float(rise), n, ways, angle)


@dataclass
class PlankParts:
    """Flat parts of all planks, with notes on them.
    order        : families, from the lowest planks to the uppermost.
    crowded      : slots that would run into a neighbouring slot, "N007 in A02".
    slide_angles : largest angle between the assembly direction and the slots, by piece, radians.
    stuck        : the same angle, by piece, only for pieces that cannot slide onto lower planks, radians.
    shortened    : members that stop early.    missed_nodes : nodes that these members do not reach.
    longer : largest elongation of an edge by twist, by member, metres.    bends : bending strain, by member."""

    order: tuple[str, ...]
    pieces: list[FlatPart] = field(default_factory=list)
    covers: list[FlatPart] = field(default_factory=list)
    crossings: PlankCrossings = field(default_factory=PlankCrossings)
    crowded: list[str] = field(default_factory=list)
    slide_angles: dict[str, float] = field(default_factory=dict)
    stuck: dict[str, float] = field(default_factory=dict)
    shortened: list[str] = field(default_factory=list)
    vanished: list[str] = field(default_factory=list)
    missed_nodes: list[str] = field(default_factory=list)
    level_ends: int = 0
    splices_near_nodes: int = 0
    splice_count: int = 0
    longer: dict[str, float] = field(default_factory=dict)
    bends: dict[str, float] = field(default_factory=dict)
