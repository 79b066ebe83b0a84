"""Crossings of planks, and the slots that let them pass each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Floats, lock
from dsfab.members import MemberGraph
from dsfab.workshop.development import StripCourse
from dsfab.workshop.parts import FlatPart

SLIDE = float(np.radians(10.0))
"""Slots of a piece open so that it can be put on along one direction, if the normals at its nodes are no farther from
that; it is spliced where they would be."""


def spread(normals: Floats) -> float:
    """The largest angle between unit vectors (q, 3) and the way in their middle, radians; 0 for none."""
    if len(normals) < 2:
        return 0.0
    return float(np.arccos(np.clip(normals @ middle(normals), -1.0, 1.0)).max())


def middle(normals: Floats) -> Floats:
    """(3,) the unit vector between those of some (q, 3) that are farthest from each other."""
    i, j = np.unravel_index(int((normals @ normals.T).argmin()), (len(normals),) * 2)
    way = normals[i] + normals[j]
    return np.asarray(way / np.linalg.norm(way))


ORDER = ("major", "minor", "rim", "keep")
"""Families from the lowest to the uppermost, where nothing else decides: later ones are put on those before."""
FIT = 2e-4
"""Metres of air between a plank and each side of a slot, and its bottom."""
SHARPEST = 30.0
"""Degrees: planks that meet at less have no slot, which would take most of them away."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """Two planks at a node.

    members : the lower one, then the one that is put on it.    at : (2,) arc lengths of their courses, metres.
    rise    : of the upper one's axis over the other, metres.   normal : (3,) unit vector.
    ways    : (2, 3) unit tangents of both, square to the normal.    angle : between them, radians, at most a right one.
    """

    node: str
    members: tuple[str, str]
    at: tuple[float, float]
    rise: float
    normal: Floats
    ways: Floats
    angle: float

    def __post_init__(self) -> None:
        lock(self, "normal", np.float64, (3,))
        lock(self, "ways", np.float64, (2, 3))

    def leans(self, way: Floats) -> tuple[float, float]:
        """By how much the slots of the lower and of the upper plank open, along each for a metre of height, so that the
        upper one comes along a unit vector (3,)."""
        one, two, up = np.linalg.solve(np.stack([*self.ways, self.normal], axis=1), way)
        return float(one / up), float(-two / up)


@dataclass(frozen=True)
class Slot:
    """A slot of a plank: at an arc length, half as wide as `half`, its bottom `y` metres over the axis, open above or
    below. lean : how far its mouth reaches along the plank for a metre of depth, to one side."""

    node: str
    s: float
    y: float
    half: float
    lean: float
    above: bool

    def mouth(self, edge: float) -> tuple[float, float]:
        """Where it begins and ends at an edge that is metres over the axis; metres from its middle."""
        more = self.lean * abs(edge - self.y)
        return -self.half + min(more, 0.0), self.half + max(more, 0.0)


@dataclass
class PlankCrossings:
    """Those with slots, and the names of nodes without: `sharp` ones."""

    found: list[Crossing] = field(default_factory=list)
    sharp: list[str] = field(default_factory=list)


def slot_width(thickness: float, angle: float) -> float:
    """Metres, of a slot for a plank of a thickness that crosses another of the same at an angle, radians."""
    return float(thickness / np.sin(angle) + thickness / np.tan(angle))


def standing_order(graph: MemberGraph, up: Floats) -> tuple[str, ...]:
    """All families, those first that begin lowest, as arches and meridians do: they stand on the ground, and carry
    those that are put on them.    up : (3,) unit vector."""
    z = graph.sheet.surface.V @ up
    begins: dict[str, list[float]] = {family: [] for family in ORDER}
    for member in graph.members:
        if member.axis is not None and member.family in begins:
            begins[member.family].append(float(z[graph.sheet.surface.F[member.cells]].min()))
    span = max(float(np.ptp(z)), np.finfo(float).tiny)
    # heights within a twentieth of the structure's height count as equal
    low = {family: round(float(np.median(some)) / span / 0.05) for family, some in begins.items() if some}
    return tuple(sorted(ORDER, key=lambda family: (low.get(family, np.inf), ORDER.index(family))))


def plank_crossings(
    graph: MemberGraph, courses: Mapping[str, StripCourse], order: Sequence[str] = ORDER
) -> PlankCrossings:
    """All nodes between two members that are planks, by their courses along the surface; families in the order in which
    they stand on each other."""
    found = PlankCrossings()
    for node in graph.nodes:
        if node.kind == "grazing" or not all(name in courses for name in node.members):
            continue
        pairs = sorted(zip(node.members, node.at, strict=True), key=lambda one: order.index(graph.by_id[one[0]].family))
        if not np.isfinite(node.at).all() or node.angle < SHARPEST:
            found.sharp.append(node.id)
            continue
        (lower, s), (upper, t) = pairs
        found.found.append(_crossing(node.id, (lower, upper), (courses[lower], courses[upper]), (s, t)))
    return found


def _crossing(
    node: str, names: tuple[str, str], courses: tuple[StripCourse, StripCourse], at: tuple[float, float]
) -> Crossing:
    """By the plane through both tangents there, again and again: P + u T + w n = Q + v U."""
    s, t = (course.wrapped(x) for course, x in zip(courses, at, strict=True))
    for _ in range(5):  # Newton steps
        (P, T, N), (Q, U, M) = ([x[0] for x in c.at(np.array([x]))] for c, x in zip(courses, (s, t), strict=True))
        n = (N + M) / np.linalg.norm(N + M)
        u, v, rise = np.linalg.solve(np.stack([T, -U, n], axis=1), Q - P)
        s, t = s + float(u), t + float(v)
    ways = np.stack([T - (T @ n) * n, U - (U @ n) * n])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    angle = float(np.arccos(np.clip(abs(ways[0] @ ways[1]), 0.0, 1.0)))
    return Crossing(node, names, (s, t), float(rise), n, ways, angle)


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
