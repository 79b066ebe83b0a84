"""Joints: node plates with an arm for each bar, the angles at the ends of bars, and legs that stand on the ground.

       n                     n    normal of a node; the node's plate is perpendicular to n, below the bars
       |   dip               e    distance from the node to the beginning of the bar's line, where the arm is folded
-------+--e--·.._            dip  angle of the bar below the plane of the plate
     plate      ··.._        m    normal of the bar: n without its component along the bar
                 bar          ·

A leg is a further arm of the plate, down along the surface. Beyond its fold, the leg is level and has anchors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, lock, lock_floats
from dsfab.core.messages import names_and_count
from dsfab.members import MemberGraph
from dsfab.surface import LoadCase, Surface
from dsfab.workshop.bars.lattice import BAR_CLEARANCE, LEAST_BAR, Bay, Lattice, LatticeNode
from dsfab.workshop.layers import END_DISTANCE, Layering
from dsfab.workshop.parts import NODE_LETTERS, FlatPart, Fold, Hole, label, text_length

FLAT_SINE = np.sin(np.radians(5.0))  # sine of the smallest slope at which node plates at supports get legs
LEAST_SIDE, ARM_SHARE = 1.5, 0.45  # half width of an arm: at least 1.5 bolt diameters, usually 0.45 member widths
ANCHOR_SPACINGS = (3.0, 4.0, 3.0)
"""Distances in anchor diameters: fold to first anchor, first to second anchor, second anchor to the leg's end."""


@dataclass(frozen=True, eq=False)
class Leg:
    """Leg of a node plate: an arm with anchors in the ground.
    way    : (3,) unit direction of the leg in the plane of the plate.
    fold   : fold angle, positive towards the plate's normal, radians.    anchor : diameter of anchors, metres."""

    way: Floats
    fold: float
    anchor: float

    def __post_init__(self) -> None:
        lock(self, "way", np.float64, (3,))

    @property
    def holes(self) -> tuple[float, ...]:
        """Distances from the leg's fold to the holes of the anchors (m)."""
        return tuple((self.anchor * np.cumsum(ANCHOR_SPACINGS[:2])).tolist())

    @property
    def length(self) -> float:
        """Length of the leg from its fold to its end (m)."""
        return self.anchor * sum(ANCHOR_SPACINGS)


@dataclass(frozen=True, eq=False)
class Footing:
    """Supports of a structure on the ground.
    supports : (q, 3) supported points, m.    up : (3,) upward unit vector.    anchor : diameter of anchors, metres.
    reach    : metres; a node can get a leg if a support is closer than `reach` plus 0.75 member widths."""

    supports: Floats
    up: Floats
    reach: float
    anchor: float

    def __post_init__(self) -> None:
        lock_floats(self, supports=(None, 3), up=(3,))

    @classmethod
    def from_supports(cls, surface: Surface, load: LoadCase, up: Floats, anchor: float) -> "Footing | None":
        """Return the supports of a surface on the ground; None without supports, or if `anchor` is 0."""
        points = surface.V[load.fixed.any(axis=1) | load.spring.any(axis=1)]
        return cls(points, up, float(surface.mean_edge), anchor) if len(points) and anchor else None

    def legs(self, points: Floats, normals: Floats, widths: Sequence[float]) -> dict[int, Leg | None]:
        """Return, by node number, the leg of each node near a support; None where the slope is too small.
        points, normals : (q, 3) of all nodes. widths : (q,) widths of the widest members, metres."""
        away = np.asarray(cKDTree(self.supports).query(points)[0])
        legs: dict[int, Leg | None] = {}
        limits = self.reach + 0.75 * np.asarray(widths)  # largest distance from a node to its support (m)
        for k in np.flatnonzero(away < limits).tolist():
            n = normals[k]
            down = (n @ self.up) * n - self.up
            steep = float(np.linalg.norm(down))
            outward = n @ self.up > 0  # a plate whose normal points down folds upwards
            angle = float(np.arctan2(steep, abs(float(n @ self.up)))) * (1 if outward else -1)
            legs[k] = Leg(down / steep, angle, self.anchor) if steep > FLAT_SINE else None
        return legs


def leg_plates(
    graph: MemberGraph, layering: Layering, footing: Footing, thickness: float
) -> tuple[list[FlatPart], list[str]]:
    """Return plates with legs, which hold strips at supports, and names of nodes where the slope is too small.
    thickness : thickness of the plates, metres."""
    nodes = [node for node in graph.nodes if node.kind != "grazing"]
    members = [[graph.by_id[name] for name in node.members] for node in nodes]
    widths = [max(member.mean_width for member in node_members) for node_members in members]
    points, normals = (np.array([getattr(node, name) for node in nodes]) for name in ("point", "normal"))
    parts, flat = list[FlatPart](), list[str]()
    for k, leg in footing.legs(points.reshape(-1, 3), normals.reshape(-1, 3), widths).items():
        if leg is None:
            flat.append(nodes[k].id)
            continue
        lowest = max(number for member in members[k] for number in layering.family_layers(member.family))
        height = layering.layer_height(lowest) - (layering.thickness + thickness) / 2
        half = max(LEAST_SIDE * leg.anchor, ARM_SHARE * min(member.mean_width for member in members[k]))
        size = widths[k] / 2 + layering.bolt, half
        parts.append(_leg_plate(nodes[k].id, leg, size, layering.bolt, height, thickness))
    return parts, flat


def _leg_plate(
    node: str, leg: Leg, size: tuple[float, float], bolt: float, height: float, thickness: float
) -> FlatPart:
    root, half = size
    begin, end = -END_DISTANCE * bolt, root + leg.length
    outline = np.array([[begin, -half], [end, -half], [end, half], [begin, half]])
    holes = [Hole(np.zeros(2), bolt, node)]
    holes += [Hole(np.array([root + r, 0.0]), leg.anchor, "anchor") for r in leg.holes]
    fold = Fold(np.array([[root, -half], [root, half]]), -leg.fold)
    name = f"{node} foot"
    high = min(NODE_LETTERS, 0.9 * (root - bolt) / text_length(name, 1.0))
    marks = label(name, np.array([(root + 0.6 * bolt) / 2, 0.0]), 0.0, high)
    basics = name, "", (0.0, 0.0), outline, tuple(holes)
    return FlatPart(*basics, marks=marks, layer=height, folds=(fold,), thickness=thickness).at_origin()


def leg_lines(folds: Sequence[float], flat: Sequence[str]) -> list[str]:
    """Return sentences on plates with folded legs, and on nodes `flat` without a leg."""
    angles = [abs(float(np.degrees(fold))) for fold in folds]
    sentences = []
    if angles:
        sentences.append(
            f"{len(angles)} plates at supports have a leg with anchors; to make the leg level, fold the leg by "
            f"{min(angles):.0f} to {max(angles):.0f} degrees"
        )
    if flat:
        reason = "the surface slopes by less than 5 degrees, or a bar is in the place of the leg"
        sentences.append(f"no leg at {names_and_count(flat)}: {reason}")
    return sentences


SQUARE_ANGLE = np.radians(70.0)
"""Smallest angle between bars with square ends. Bars at sharper angles have mitres, to begin closer to the node."""


@dataclass(frozen=True, eq=False)
class BarEnd:
    """End of a bar.
    azimuth : angle about the node's normal, counter-clockwise from the node's first bar, radians.
    dip     : angle below the plane of the node, radians.
    before, after : angles to the next bars, clockwise and counter-clockwise, radians; 2 pi for a single bar.
    root    : distance from the node to the beginning of the bar's centre line, metres."""

    node: int
    azimuth: float
    dip: float
    before: float
    after: float
    root: float


@dataclass(frozen=True, eq=False)
class LatticeBar:
    """Straight bar that replaces a part of a member between two nodes.
    points  : (2, 3) ends of the bar's centre line, metres.    normals : (2, 3) normals at these ends.
    sagitta : largest distance of the member's axis from the bar, metres."""

    bay: Bay
    ends: tuple[BarEnd, BarEnd]
    points: Floats
    normals: Floats
    sagitta: float

    def __post_init__(self) -> None:
        lock_floats(self, points=(2, 3), normals=(2, 3))

    @cached_property
    def length(self) -> float:
        """Length of the bar's line (m)."""
        return float(np.linalg.norm(self.points[1] - self.points[0]))

    @cached_property
    def direction(self) -> Floats:
        """Unit vector (3,) from the first to the second end."""
        return np.asarray((self.points[1] - self.points[0]) / self.length)

    @cached_property
    def twist(self) -> float:
        """Angle (radians) from the first end's normal to the second end's normal, right-handed about the direction."""
        begin_normal, end_normal = self.normals
        return float(np.arctan2(np.cross(begin_normal, end_normal) @ self.direction, begin_normal @ end_normal))


@dataclass(frozen=True, eq=False)
class Joint:
    """Node with bars and a plate.
    bars : pairs of a bar number and an end, counter-clockwise; end 0: the bar begins at this node, 1: it ends here.
    half : half width of the plate's arms, metres.    root : approximate distance from the node to the folds, metres.
    leg  : arm of the plate that stands on the ground, if any."""

    node: LatticeNode
    bars: tuple[tuple[int, int], ...]
    half: float
    root: float
    leg: Leg | None = None


@dataclass(frozen=True, eq=False)
class BarLattice:
    """Bars and joints of a design."""

    bars: tuple[LatticeBar, ...]
    joints: tuple[Joint, ...]
    lattice: Lattice

    def azimuth(self, joint: Joint, direction: Floats) -> float:
        """Return the angle (radians), 0 to 2 pi, counter-clockwise from a joint's first bar to a direction (3,)."""
        (k, side), n = joint.bars[0], joint.node.normal
        x = _level_directions((self.bars[k].direction * (1 - 2 * side))[None], n[None])[0]
        return float(np.mod(np.arctan2(direction @ np.cross(n, x), direction @ x), 2 * np.pi))

    def with_legs(self, footing: Footing) -> "tuple[BarLattice, list[str]]":
        """Return the lattice with legs at supports, and names of nodes without a leg."""
        joined = [k for k, joint in enumerate(self.joints) if joint.node.joined]
        nodes = [self.joints[k].node for k in joined]
        points, normals = (np.array([getattr(node, name) for node in nodes]) for name in ("point", "normal"))
        widths = [max(self.bars[number].bay.width for number, _ in self.joints[k].bars) for k in joined]
        joints, legless = list(self.joints), list[str]()
        for k, leg in footing.legs(points.reshape(-1, 3), normals.reshape(-1, 3), widths).items():
            joint = joints[joined[k]]
            if leg is None or not self._is_free(joint, self.azimuth(joint, leg.way)):
                legless.append(joint.node.id)
            else:
                joints[joined[k]] = replace(joint, leg=leg)
        return replace(self, joints=tuple(joints)), legless

    def _is_free(self, joint: Joint, azimuth: float) -> bool:
        azimuths = np.array([self.bars[k].ends[side].azimuth for k, side in joint.bars])
        gap = float(np.abs(np.angle(np.exp(1j * (azimuths - azimuth)))).min())
        return bool(joint.half <= joint.root * np.tan(gap / 2))


@dataclass(frozen=True, eq=False)
class _BayEnds:
    """Ends (q,) of parts of members between two nodes: number of the node, width (m), and index of the opposite end."""

    node: Ints
    width: Floats
    opposite: Ints

    def dip(self, directions: Floats, N: Floats) -> Floats:
        sines = np.einsum("qi,qi->q", directions, N[self.node]) / np.linalg.norm(directions, axis=1)
        return np.asarray(-np.arcsin(sines))


def bar_lattice(graph: MemberGraph, lattice: Lattice, thickness: float, bolt: float) -> BarLattice:
    """Return a bar for each part of a member between two nodes. thickness : of the bars; bolt : bolt diameter (m)."""
    ends = np.array([bay.ends for bay in lattice.bays], dtype=np.int64).reshape(-1, 2)
    count = len(ends)
    opposite, widths = np.roll(np.arange(2 * count), count), np.tile([bay.width for bay in lattice.bays], 2)
    bay_ends = _BayEnds(ends.T.ravel(), widths, opposite)
    P = np.array([node.point for node in lattice.nodes]).reshape(-1, 3)
    N = np.array([node.normal for node in lattice.nodes]).reshape(-1, 3)
    joined = np.array([node.joined for node in lattice.nodes], dtype=bool)
    chord = P[bay_ends.node[bay_ends.opposite]] - P[bay_ends.node]
    level = _level_directions(chord, N[bay_ends.node])
    # a bar dips below the node's plane about 1.5 times as steeply as the chord between its nodes
    lean = 1.5 * thickness / 2 * np.sin(np.abs(bay_ends.dip(chord, N)))
    orders = [_counter_clockwise(np.flatnonzero(bay_ends.node == k), level, N[k]) for k in range(len(P))]
    lengths = np.linalg.norm(chord, axis=1)
    sizes = [_arm_size(gaps, bay_ends.width[order], lean[order], lengths[order], bolt) for order, _, gaps in orders]
    root = np.where(joined, [root for _, root in sizes], 0.0)
    roots = _bar_roots(P, N, bay_ends, root)
    directions = roots[bay_ends.opposite] - roots
    level = _level_directions(directions, N[bay_ends.node])
    orders = [_counter_clockwise(np.flatnonzero(bay_ends.node == k), level, N[k]) for k in range(len(P))]
    joints = [
        Joint(node, tuple((int(e) % count, int(e) // count) for e in order), half, float(root[k]))
        for k, (node, (order, _, _), (half, _)) in enumerate(zip(lattice.nodes, orders, sizes, strict=True))
    ]
    bar_ends = _bar_ends(orders, directions, N, bay_ends, root)
    bars = [
        _bar(graph, bay, (bar_ends[k], bar_ends[k + count]), roots[[k, k + count]], N[ends[k]])
        for k, bay in enumerate(lattice.bays)
    ]
    return BarLattice(tuple(bars), tuple(joints), lattice)


def _level_directions(directions: Floats, N: Floats) -> Floats:
    level = directions - np.einsum("qi,qi->q", directions, N)[:, None] * N
    return np.asarray(level / np.linalg.norm(level, axis=1)[:, None])


def _counter_clockwise(ends: Ints, level: Floats, normal: Floats) -> tuple[Ints, Floats, Floats]:
    x = level[ends[0]]
    y = np.cross(normal, x)
    azimuth = np.mod(np.arctan2(level[ends] @ y, level[ends] @ x), 2 * np.pi)
    azimuth[0] = 0.0
    order = azimuth.argsort(kind="stable")
    azimuth = azimuth[order]
    return ends[order], azimuth, np.diff(azimuth, append=2 * np.pi)


def _arm_size(gaps: Floats, width: Floats, lean: Floats, long: Floats, bolt: float) -> tuple[float, float]:
    notch = 0.9  # distance from the node to the corner between two arms, divided by the distance to the bars
    least, sharpest = LEAST_SIDE * bolt, min(float(gaps.min()), np.pi / 2)
    sharp, half = float(np.tan(sharpest / 2)), float(width.max()) / 2
    clear = half / float(np.tan(max(sharpest, SQUARE_ANGLE) / 2)) + BAR_CLEARANCE * bolt + float(lean.max())
    room = float(long.min()) / 2 - (2 * BAR_CLEARANCE + LEAST_BAR) * bolt
    root = max(min(clear, max(room, half + BAR_CLEARANCE * bolt)), least / sharp / notch)
    return max(min(ARM_SHARE * float(width.min()), notch * root * sharp), least), root


def _bar_roots(P: Floats, N: Floats, bay_ends: _BayEnds, root: Floats, rounds: int = 30) -> Floats:
    node_points = P[bay_ends.node]
    roots = node_points
    for _ in range(rounds):  # each round moves the beginnings of the bars much less than the round before
        level = _level_directions(roots[bay_ends.opposite] - node_points, N[bay_ends.node])
        roots = node_points + root[bay_ends.node][:, None] * level
    return roots


def _bar_ends(
    orders: list[tuple[Ints, Floats, Floats]], directions: Floats, N: Floats, bay_ends: _BayEnds, root: Floats
) -> dict[int, BarEnd]:
    dip = bay_ends.dip(directions, N)
    ends_by_number = {}
    for k, (order, azimuth, gaps) in enumerate(orders):
        columns = (x.tolist() for x in (order, azimuth, np.roll(gaps, 1), gaps))
        for e, a, before, after in zip(*columns, strict=True):
            ends_by_number[e] = BarEnd(k, a, float(dip[e]), before, after, float(root[k]))
    return ends_by_number


def _bar(graph: MemberGraph, bay: Bay, ends: tuple[BarEnd, BarEnd], points: Floats, N: Floats) -> LatticeBar:
    axis = graph.by_id[bay.member].curve
    d = points[1] - points[0]
    d = d / np.linalg.norm(d)
    normals = N - (N @ d)[:, None] * d
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    s = np.linspace(*bay.span, 33)
    offsets = axis.frames_at(np.mod(s, axis.length) if axis.closed else s)[0] - points[0]
    offsets = offsets - (offsets @ d)[:, None] * d
    return LatticeBar(bay, ends, points, normals, float(np.linalg.norm(offsets, axis=1).max()))
