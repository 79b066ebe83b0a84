"""The lattice of a structure of bars: nodes, and bays (parts of members between nodes)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, lock_floats
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.members import Member, MemberGraph, Node
from dsfab.surface import link_components
from dsfab.workshop.development import PARALLEL_SHARE
from dsfab.workshop.strips import STRIP_KINDS

BAR_CLEARANCE = 0.25  # clearance between bars, and from a plate's fold to a bar, in bolt diameters
LEAST_BAR = 4.0  # length of the shortest bar on a plate, in bolt diameters


@dataclass(frozen=True, eq=False)
class LatticeNode:
    """Node at which bars end, in place of a node of the graph of members, or of several close nodes.
    id     : name of the first replaced node, or "A07 end 1" for a free end of a member.
    nodes  : names of all replaced nodes.    point, normal : (3,) position, metres, and normal of the surface there.
    joined : True if a plate joins the bars.    moved : largest distance from `point` to a replaced node, metres."""

    id: str
    nodes: tuple[str, ...]
    point: Floats
    normal: Floats
    joined: bool
    moved: float

    def __post_init__(self) -> None:
        lock_floats(self, point=(3,), normal=(3,))


@dataclass(frozen=True)
class Bay:
    """Part of a member between two nodes. ends : numbers of the nodes. span : first and last arc length, metres."""

    id: str
    member: str
    ends: tuple[int, int]
    span: tuple[float, float]
    width: float


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes and bays (parts of members between two nodes) of a structure of bars.
    parallel : names of omitted bays, because a different bay joins the same nodes.
    rings    : names of closed members with fewer than three nodes."""

    nodes: tuple[LatticeNode, ...]
    bays: tuple[Bay, ...]
    parallel: tuple[str, ...]
    rings: tuple[str, ...]


@dataclass(frozen=True)
class _RawBay:
    member: str
    ends: tuple[str, str]
    span: tuple[float, float]
    width: float


def member_lattice(graph: MemberGraph, bolt: float) -> Lattice:
    """Return the nodes and bays of the members that have an axis; bolt : bolt diameter (m). Raises PatternError."""
    places = {node.id: (node.point, _smooth_normal(graph, node)) for node in graph.nodes}
    members = [member for member in graph.members if becomes_bars(member)]
    raw_bays = [raw_bay for member in members for raw_bay in _member_bays(graph, member, places, bolt)]
    keys = list(dict.fromkeys(key for raw_bay in raw_bays for key in raw_bay.ends))
    group, short = _place_groups(keys, raw_bays, places, bolt)
    if short > 0.1 * len(raw_bays):  # above a tenth, bars would no longer follow the pattern
        raise PatternError(
            f"{short} of {len(raw_bays)} bays (parts of members between nodes) are too short for a bar with a bolt of "
            f"{length(bolt)} at each end; use workshop.route = 'strips', a larger spacing, narrower members or a "
            f"smaller workshop.bolt"
        )
    nodes = [
        _lattice_node([key for key, k in zip(keys, group, strict=True) if k == group_number], places)
        for group_number in dict.fromkeys(group.tolist())
    ]
    number = {key: k for k, node in enumerate(nodes) for key in node.nodes}
    bays, parallel = _numbered_bays(raw_bays, number)
    closed = [member for member in members if member.axis and member.axis.closed]
    rings = tuple(member.id for member in closed if not len(graph.nodes_along[member.id]) > 2)
    return Lattice(tuple(nodes), tuple(bays), tuple(parallel), rings)


def _smooth_normal(graph: MemberGraph, node: Node) -> Floats:
    members = [(graph.by_id[name].axis, s) for name, s in zip(node.members, node.at, strict=True)]
    normals = [axis.frames_at(np.array([s]))[2][0] for axis, s in members if axis is not None and np.isfinite(s)]
    total = np.sum([n * np.sign(n @ node.normal) for n in normals], axis=0) if normals else node.normal
    return np.asarray(total / np.linalg.norm(total))


def becomes_bars(member: Member) -> bool:
    return member.axis is not None and member.kind in STRIP_KINDS


def _member_bays(
    graph: MemberGraph, member: Member, places: dict[str, tuple[Floats, Floats]], bolt: float
) -> Iterator[_RawBay]:
    axis = member.curve
    nodes = graph.nodes_along[member.id]
    stops = [(float(node.at[node.members.index(member.id)]), node.id) for node in nodes]
    if axis.closed:
        stops = [*stops, (stops[0][0] + axis.length, stops[0][1])] if len(stops) > 2 else []
    else:
        widest = max((graph.by_id[name].mean_width for node in nodes for name in node.members), default=0.0)
        least = member.mean_width + widest / 2 + (BAR_CLEARANCE + LEAST_BAR) * bolt
        for number, s in ((1, 0.0), (2, axis.length)):
            away = min((abs(s - station) for station, _ in stops), default=np.inf)
            if away > least and member.ends[number - 1] not in places:
                key = f"{member.id} end {number}"
                P, _, N = axis.frames_at(np.array([s]))
                places[key] = P[0], N[0]
                stops.insert(0 if number == 1 else len(stops), (s, key))
    for (s, begin_key), (t, end_key) in pairwise(stops):
        inside = (axis.s >= s) & (axis.s <= t)
        width = float(np.median(member.width[inside])) if inside.any() else member.mean_width
        even = abs(width - member.mean_width) < PARALLEL_SHARE * member.mean_width
        yield _RawBay(member.id, (begin_key, end_key), (s, t), member.mean_width if even else width)


def _place_groups(
    keys: list[str], raw_bays: list[_RawBay], places: dict[str, tuple[Floats, Floats]], bolt: float
) -> tuple[Ints, int]:
    number = {key: k for k, key in enumerate(keys)}
    half = np.zeros(len(keys))
    ends = np.array([[number[key] for key in raw_bay.ends] for raw_bay in raw_bays], dtype=np.int64).reshape(-1, 2)
    for side in (0, 1):
        np.maximum.at(half, ends[:, side], [raw_bay.width / 2 for raw_bay in raw_bays])
    P = np.array([places[key][0] for key in keys]).reshape(-1, 3)
    long = np.linalg.norm(P[ends[:, 1]] - P[ends[:, 0]], axis=1)
    free = np.array([" end " in key for key in keys], dtype=bool)
    short = long < half[ends].sum(axis=1) + 2 * (2 * BAR_CLEARANCE + LEAST_BAR) * bolt
    short &= ~free[ends].any(axis=1)
    alone = np.flatnonzero(free)
    corners = [
        (i, j) for k, i in enumerate(alone) for j in alone[k + 1 :] if np.linalg.norm(P[i] - P[j]) < half[i] + half[j]
    ]
    joined_pairs = np.concatenate([ends[short], np.array(corners, dtype=np.int64).reshape(-1, 2)])
    return link_components(len(keys), *joined_pairs.T)[1], int(short.sum())


def _lattice_node(keys: list[str], places: dict[str, tuple[Floats, Floats]]) -> LatticeNode:
    points = np.array([places[key][0] for key in keys])
    point = points.mean(axis=0)
    moved = float(np.linalg.norm(points - point, axis=1).max())
    normal = np.mean([places[key][1] for key in keys], axis=0)
    name = min(keys)
    joined = len(keys) > 1 or " end " not in name
    return LatticeNode(name, tuple(keys), point, normal / np.linalg.norm(normal), joined, moved)


def _numbered_bays(raw_bays: Sequence[_RawBay], number: dict[str, int]) -> tuple[list[Bay], list[str]]:
    bays, parallel = list[Bay](), list[str]()
    counted: dict[str, int] = {}
    taken = set[frozenset[int]]()
    for raw_bay in raw_bays:
        i, j = (number[key] for key in raw_bay.ends)
        if i == j:
            continue
        counted[raw_bay.member] = counted.get(raw_bay.member, 0) + 1
        name = f"{raw_bay.member}.{counted[raw_bay.member]}"
        if frozenset((i, j)) in taken:
            parallel.append(name)
            continue
        taken.add(frozenset((i, j)))
        bays.append(Bay(name, raw_bay.member, (i, j), raw_bay.span, raw_bay.width))
    return bays, parallel
