"""Members as straight beams between nodes, with loads and supports."""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, group_sums
from dsfab.members import Member
from dsfab.members.frame.joints import AxisJoints, fitting
from dsfab.surface import LoadCase, Surface

SHORT = 1e-3  # Least distance between two nodes of a member, as a fraction of its width.


class BeamRow(NamedTuple):
    """A straight beam. ends : numbers of the two nodes.    normal : (3,) local z axis.    width : m.
    shift  : distance (m) from the beam's axis to the middle of the material's width, positive to the left.
    member : number of the member; -1 for a link, which only joins two nodes.
    stout  : width / length of the bay (part between nodes), at most 1; 0 for a link."""

    ends: tuple[int, int]
    normal: Floats
    width: float
    shift: float
    member: int
    stout: float


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams as arrays with a row for each beam. The fields have the same meaning as in `BeamRow`."""

    ends: Ints
    normal: Floats
    width: Floats
    shift: Floats
    member: Ints
    stout: Floats

    @classmethod
    def from_rows(cls, rows: list[BeamRow]) -> "Beams":
        ends = np.array([row.ends for row in rows], dtype=np.int64).reshape(-1, 2)
        normal = np.array([row.normal for row in rows]).reshape(-1, 3)
        width, shift, stout = (np.array([row[k] for row in rows], dtype=np.float64) for k in (2, 3, 5))
        return cls(ends, normal, width, shift, np.array([row.member for row in rows], dtype=np.int64), stout)

    def subset(self, chosen: Ints, ends: Ints) -> "Beams":
        """Return the beams with the numbers `chosen` (k,). ends : (b, 2) new node numbers of all beams."""
        shape = self.normal[chosen], self.width[chosen], self.shift[chosen]
        return Beams(ends[chosen], *shape, self.member[chosen], self.stout[chosen])

    def and_links(self, ends: Ints, normal: Floats, width: Floats) -> "Beams":
        """Return these beams and k links. A link is a beam that only joins two nodes, `ends` (k, 2).
        width : (k,) widths of the links, m.    normal : (k, 3) local z axes of the links."""
        none = np.zeros(len(ends))
        return Beams(
            np.concatenate([self.ends, ends]),
            np.concatenate([self.normal, normal]),
            np.concatenate([self.width, width]),
            np.concatenate([self.shift, none]),
            np.concatenate([self.member, np.full(len(ends), -1, dtype=np.int64)]),
            np.concatenate([self.stout, none]),
        )


def beams_along(joints: AxisJoints) -> Beams:
    """Return beams along the axes of all members, and links between nodes. Adds new nodes to `joints`."""
    rows = list[BeamRow]()
    for number, member in enumerate(joints.members_with_axis):
        for begin, end in pairwise(_stations(joints, member)):
            rows += _bay(joints, member, number, begin, end)
    for node_a, node_b, width in joints.links:
        rows.append(BeamRow((node_a, node_b), joints.normal_at(node_a), width, 0.0, -1, 0.0))
    return Beams.from_rows(rows)


def _stations(joints: AxisJoints, member: Member) -> list[tuple[float, int]]:
    axis = member.curve
    stations = sorted(joints.on[member.id])
    if axis.closed:
        stations = stations or [(0.0, joints.node(axis.P[0], f"{member.id} 0"))]
        return [*stations, (stations[0][0] + member.length, stations[0][1])]
    begin, end = joints.ends[member.id]
    tolerance = SHORT * member.mean_width
    stations = [entry for entry in stations if begin - tolerance <= entry[0] <= end + tolerance]
    for s, is_first in ((begin, True), (end, False)):
        if not any(abs(place - s) < tolerance for place, _ in stations):
            name = f"{member.id} {'begin' if is_first else 'end'}"
            station = s, joints.node(axis.frames_at(np.array([s]))[0][0], name)
            stations = [station, *stations] if is_first else [*stations, station]
    return stations


def _bay(
    joints: AxisJoints, member: Member, number: int, begin: tuple[float, int], end: tuple[float, int]
) -> list[BeamRow]:
    (s, node_a), (t, node_b) = begin, end
    axis = member.curve
    if t - s < (0.5 if node_a == node_b else SHORT) * member.mean_width:
        return []
    around = member.length if axis.closed else np.inf
    widths = joints.other_width(member, node_a), joints.other_width(member, node_b)
    cuts, spread = _divide_bay(member, (s, t), widths, 3 if node_a == node_b else 1)
    inner, middle = cuts[1:-1] % around, ((cuts[:-1] + cuts[1:]) / 2) % around
    names = [f"{member.id} {x:.3f}" for x in inner]
    nodes = [node_a, *(joints.node(p, name) for p, name in zip(axis.frames_at(inner)[0], names, strict=True)), node_b]
    left_reach, right_reach = (np.interp(middle, axis.s, side) for side in _sides(member).T)
    stout = 1.0 if joints.grazed & {node_a, node_b} else min(member.mean_width / (t - s), 1.0)
    return [
        BeamRow(ends, normal, float(a + b + extra), float(a - b) / 2, number, stout)
        for ends, normal, a, b, extra in zip(
            pairwise(nodes), axis.frames_at(middle)[2], left_reach, right_reach, spread, strict=True
        )
    ]


def _sides(member: Member) -> Floats:
    return member.sides if member.kind != "disc" else np.maximum(member.sides, member.area / member.length / 2)


def _divide_bay(
    member: Member, span: tuple[float, float], joint_widths: tuple[float, float], least: int
) -> tuple[Floats, Floats]:
    """Divide a bay into k beams. Return arc lengths (k + 1,), m, of the ends, and widths (k,), m, to add to the beams.
    span : ends of the bay, m.    joint_widths : widths of the crossing members, m.    least : smallest k."""
    (s, t), axis = span, member.curve
    half = fitting(np.array(joint_widths) / 2, t - s)
    half[half < 0.05 * member.mean_width] = 0.0  # leave out joints with a smaller half length
    fine, clear = np.linspace(s, t, 17), np.linspace(s + half[0], t - half[1], 17)
    if axis.closed:
        fine, clear = fine % member.length, clear % member.length
    bent = np.interp(fine, axis.s, np.hypot(axis.kg, axis.kn)).mean() * (t - s)
    width = np.interp(clear, axis.s, member.width)
    # a beam bends by at most 5 degrees and tapers by at most 1.25, unless it would be shorter than half its width
    parts = max(np.degrees(bent) / 5.0, np.log(width.max() / width.min()) / np.log(1.25))
    count = max(least, min(int(np.ceil(parts)), int((t - s) / (0.5 * member.mean_width))))
    cuts = np.linspace(s + half[0], t - half[1], count + 1)
    spread = np.zeros(count)
    into = 0.5  # in a joint, a beam is wider by 0.5 x the crossing member's width: forces spread at 45 degrees
    if half[0]:
        cuts, spread = np.concatenate([[s], cuts]), np.concatenate([[into * joint_widths[0]], spread])
    if half[1]:
        cuts, spread = np.concatenate([cuts, [t]]), np.concatenate([spread, [into * joint_widths[1]]])
    return cuts, spread


@dataclass(frozen=True, eq=False)
class BeamPlaces:
    """The nearest beam to each of q places.    beam : (q,) number of the beam.
    along : (q,) position along the beam, 0 at the first node, 1 at the second.    foot : (q, 3) nearest point."""

    beam: Ints
    along: Floats
    foot: Floats


def nearest_beams(places: Floats, points: Floats, beams: Beams) -> BeamPlaces:
    """Return the beam nearest to each place (q, 3). points : (n, 3) nodes of the beams, metres."""
    a, b = points[beams.ends[:, 0]], points[beams.ends[:, 1]]
    count = 9  # samples along each beam; the search tests only the beams of the six nearest samples
    samples = (a[:, None] + np.linspace(0, 1, count)[:, None] * (b - a)[:, None]).reshape(-1, 3)
    candidates = cKDTree(samples).query(places, k=min(6, len(samples)))[1].reshape(len(places), -1) // count
    direction = b - a
    along = (
        np.einsum("qki,qki->qk", places[:, None] - a[candidates], direction[candidates])
        / np.einsum("bi,bi->b", direction, direction)[candidates]
    )
    along = np.clip(along, 0, 1)
    foot = a[candidates] + along[..., None] * direction[candidates]
    nearest = np.linalg.norm(places[:, None] - foot, axis=2).argmin(axis=1)
    row = np.arange(len(places))
    return BeamPlaces(candidates[row, nearest], along[row, nearest], foot[row, nearest])


def nodal_loads(load: LoadCase, V: Floats, places: BeamPlaces, points: Floats, beams: Beams) -> Floats:
    """Return forces (N) and moments (Nm) at nodes, (n, 6), equivalent to a load on the sheet's vertices V (v, 3).
    places : nearest beam to each vertex.    points : (n, 3) nodes, metres."""
    loads = np.zeros((len(points), 6))
    ends, moment = beams.ends[places.beam], np.cross(V - places.foot, load.force)
    for side, share in ((0, 1 - places.along), (1, places.along)):
        forces = np.concatenate([load.force, moment], axis=1) * share[:, None]
        loads += group_sums(ends[:, side], forces, len(points))
    return loads


@dataclass(frozen=True, eq=False)
class NodeSupports:
    """Supports at nodes of a frame; h counts the supports.
    node   : (h,) nearest node.    place : (h, 3) centre of the support, metres.
    apart  : (h,) True if a link (an added beam) must join node and centre.    width : (h,) width of the link, metres.
    fixed  : (h, 6) True for a fixed translation or rotation.    spring : (h, 6) stiffness of springs, N/m."""

    node: Ints
    place: Floats
    apart: Bools
    fixed: Bools
    spring: Floats
    width: Floats


def supports_at_nodes(load: LoadCase, surface: Surface, points: Floats, beams: Beams) -> NodeSupports:
    """Return the supports of a sheet (shell model), moved to the nearest of the beams' nodes `points` (n, 3), m."""
    V, clamped = surface.V, _clamped_vertices(surface, load)
    vertices = np.flatnonzero(load.supported | clamped)
    places = nearest_beams(V[vertices], points, beams)
    node = np.where(places.along < 0.5, beams.ends[places.beam, 0], beams.ends[places.beam, 1])
    which, group = np.unique(node, return_inverse=True)
    count = np.bincount(group)
    place = group_sums(group, V[vertices], len(which)) / count[:, None]
    fixed = np.zeros((len(which), 6), dtype=bool)
    np.logical_or.at(fixed[:, :3], group, load.fixed[vertices])
    spring = np.zeros((len(which), 6))
    np.add.at(spring[:, :3], group, load.spring[vertices])
    around = np.array([beams.width[(beams.ends == k).any(axis=1)].max() for k in which])
    reach = _reach(V[vertices], group)[:, 0]
    least = np.zeros(len(which))
    np.maximum.at(least, group, _blocks(load, surface)[vertices])
    turned = np.zeros(len(which), dtype=bool)
    np.logical_or.at(turned, group, clamped[vertices])
    block = least > 0.2 * around  # a support wider than 0.2 x the width of the node's beams prevents rotation
    still = turned | (block & fixed[:, :3].all(axis=1))
    fixed[:, 3:] |= still[:, None]
    apart = np.linalg.norm(place - points[which], axis=1) > 0.02 * around  # supports away from the node need links
    return NodeSupports(which, place, apart & ~block, fixed, spring, np.maximum(reach, 0.25 * around))


def _clamped_vertices(surface: Surface, load: LoadCase) -> Bools:
    clamped = np.zeros(surface.n, dtype=bool)
    if len(load.clamped):
        clamped[surface.edges.ends[load.clamped].ravel()] = True
    return clamped


def _blocks(load: LoadCase, surface: Surface) -> Floats:
    faces = surface.F[load.fixed[surface.F].all(axis=(1, 2))]
    rows, columns = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    joined = coo_array((np.ones(len(rows)), (rows, columns)), shape=(surface.n, surface.n))
    vertices = np.unique(faces)
    group = np.unique(connected_components(joined, directed=False)[1][vertices], return_inverse=True)[1]
    widths = np.zeros(surface.n)
    if len(vertices):
        widths[vertices] = _reach(surface.V[vertices], group)[group, 1]
    return widths


def _reach(V: Floats, group: Ints) -> Floats:
    """Return length and width (h, 2), m, of h groups of points V (v, 3). group : (v,) number of each point's group."""
    count = np.bincount(group)
    offset = V - (group_sums(group, V, len(count)) / count[:, None])[group]
    spread = np.zeros((len(count), 3, 3))
    np.add.at(spread, group, offset[:, :, None] * offset[:, None, :])
    return np.asarray(np.sqrt(12 * np.maximum(np.linalg.eigvalsh(spread / count[:, None, None]), 0))[:, :0:-1])


def fixed_in_plane(fixed: Bools, axis: int) -> Bools:
    """Return the mask `fixed` (n, 6) with added supports, which prevent movement of a plane frame out of its plane.
    axis : number of the coordinate axis normal to the plane, 0 to 2."""
    still = fixed.copy()
    still[:, axis] = True
    still[:, [3 + k for k in range(3) if k != axis]] = True
    return still
