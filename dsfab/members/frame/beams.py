"""Members as straight beams between nodes, with the loads and supports of the sheet on these nodes."""

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

TURN = 5.0
"""Degrees that a beam may leave out of its member's turning: bays that turn more become several beams."""
TAPER = 1.25
"""Nor over what its width changes by more than this factor: bays that taper become several beams."""
FINEST = 0.5
"""But none is shorter than this share of the width, joints left out."""
SHORT = 1e-3
"""Nodes of a member that are nearer than this share of its width are the same."""
SPREAD = 0.5
"""Within a joint a beam is wider than its member by this share of the other's width: that is material too, and forces
spread into it by 45 degrees. Against the sheet, tower, vaults and gridshell: 0 gives compliances of 1.10, 1.02 and 1.06
times the sheet's, 1 gives .96, 1.00 and .98."""
FINE = 17
"""Places along a bay at which its curvature and width are asked."""
LEAST = 0.05
"""AxisJoints that reach less far than this share of the width are none."""


class Row(NamedTuple):
    """A beam: its nodes, local z, width and shift in metres, member and its width over the length of its bay."""

    ends: tuple[int, int]
    normal: Floats
    width: float
    shift: float
    member: int
    stout: float


@dataclass(frozen=True, eq=False)
class Beams:
    """Columns of beams, see `Frame`.    stout : (b,) the width of the member over the length of its bay, 1 beside
    others that it grazes."""

    ends: Ints
    normal: Floats
    width: Floats
    shift: Floats
    member: Ints
    stout: Floats

    @classmethod
    def of(cls, rows: list[Row]) -> "Beams":
        """As columns."""
        ends = np.array([row.ends for row in rows], dtype=np.int64).reshape(-1, 2)
        normal = np.array([row.normal for row in rows]).reshape(-1, 3)
        width, shift, stout = (np.array([row[k] for row in rows], dtype=np.float64) for k in (2, 3, 5))
        return cls(ends, normal, width, shift, np.array([row.member for row in rows], dtype=np.int64), stout)

    def some(self, kept: Ints, ends: Ints) -> "Beams":
        """Some of them (k,), between nodes (b, 2) of other numbers."""
        shape = self.normal[kept], self.width[kept], self.shift[kept]
        return Beams(ends[kept], *shape, self.member[kept], self.stout[kept])

    def and_links(self, ends: Ints, normal: Floats, width: Floats) -> "Beams":
        """With links (k, 2) of a width (k,)."""
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
    """Beams along all axes, and links; new nodes are added between those of the joints."""
    rows = list[Row]()
    for number, member in enumerate(joints.lined):
        stations = _stations(joints, member)
        for begin, end in pairwise(stations):
            rows += _bay(joints, member, number, begin, end)
    for one, other, width in joints.links:
        rows.append(Row((one, other), joints.normal_at(one), width, 0.0, -1, 0.0))
    return Beams.of(rows)


def _stations(joints: AxisJoints, member: Member) -> list[tuple[float, int]]:
    """Arc lengths and nodes along a member, in order; of a closed one the first comes again at the end."""
    axis = member.axis
    assert axis is not None
    found = sorted(joints.on[member.id])
    if axis.closed:
        found = found or [(0.0, joints.node(axis.P[0], f"{member.id} 0"))]
        return [*found, (found[0][0] + member.length, found[0][1])]
    begin, end = joints.ends[member.id]
    near = SHORT * member.mean_width
    found = [one for one in found if begin - near <= one[0] <= end + near]
    for s, first in ((begin, True), (end, False)):
        if not any(abs(at - s) < near for at, _ in found):
            new = (s, joints.node(axis.at(np.array([s]))[0][0], f"{member.id} {'begin' if first else 'end'}"))
            found = [new, *found] if first else [*found, new]
    return found


def _bay(
    joints: AxisJoints, member: Member, number: int, begin: tuple[float, int], end: tuple[float, int]
) -> list[Row]:
    """The beams from one node of a member to the next."""
    (s, one), (t, other) = begin, end
    axis = member.axis
    assert axis is not None
    if t - s < (0.5 if one == other else SHORT) * member.mean_width:
        return []
    around = member.length if axis.closed else np.inf
    widths = joints.other_width(member, one), joints.other_width(member, other)
    at, spread = _divided(member, (s, t), widths, 3 if one == other else 1)
    inner, middle = at[1:-1] % around, ((at[:-1] + at[1:]) / 2) % around
    names = [f"{member.id} {x:.3f}" for x in inner]
    nodes = [one, *(joints.node(p, name) for p, name in zip(axis.at(inner)[0], names, strict=True)), other]
    left, right = (np.interp(middle, axis.s, side) for side in _sides(member).T)
    stout = 1.0 if joints.grazed & {one, other} else min(member.mean_width / (t - s), 1.0)
    return [
        Row(ends, normal, float(a + b + more), float(a - b) / 2, number, stout)
        for ends, normal, a, b, more in zip(pairwise(nodes), axis.at(middle)[2], left, right, spread, strict=True)
    ]


def _sides(member: Member) -> Floats:
    """(k, 2) metres that a member reaches to the left and to the right of its axis.

    A disc has material on both sides of the ring that stands for it, and an outline on the outer one only: it is as
    wide as its area over its length, at least.
    """
    if member.kind != "disc":
        return member.sides
    return np.maximum(member.sides, member.area / member.length / 2)


def _divided(
    member: Member, span: tuple[float, float], other: tuple[float, float], least: int
) -> tuple[Floats, Floats]:
    """(k + 1,) arc lengths that divide a bay into joints and beams that turn little, and (k,) what joints are wider."""
    (s, t), axis = span, member.axis
    assert axis is not None
    half = fitting(np.array(other) / 2, t - s)
    half[half < LEAST * member.mean_width] = 0.0
    fine, clear = np.linspace(s, t, FINE), np.linspace(s + half[0], t - half[1], FINE)
    if axis.closed:
        fine, clear = fine % member.length, clear % member.length
    bent = np.interp(fine, axis.s, np.hypot(axis.kg, axis.kn)).mean() * (t - s)
    width = np.interp(clear, axis.s, member.width)
    parts = max(np.degrees(bent) / TURN, np.log(width.max() / width.min()) / np.log(TAPER))
    count = max(least, min(int(np.ceil(parts)), int((t - s) / (FINEST * member.mean_width))))
    at = np.linspace(s + half[0], t - half[1], count + 1)
    spread = np.zeros(count)
    if half[0]:
        at, spread = np.concatenate([[s], at]), np.concatenate([[SPREAD * other[0]], spread])
    if half[1]:
        at, spread = np.concatenate([at, [t]]), np.concatenate([spread, [SPREAD * other[1]]])
    return at, spread


SAMPLES = 9
"""Points along each beam by which the nearest ones are found; they are then told apart exactly."""
NEAREST = 6
LINK = 0.02
"""A support that is farther from its node than this share of the beams' width is a node of its own, on a link."""
BLOCK = 0.2
"""A held place turns nothing if it reaches so many widths of the beams to all sides."""


@dataclass(frozen=True, eq=False)
class OnBeams:
    """Places beside beams.    beam : (q,) the nearest.    along : (q,) 0 at its first node to 1.    foot : (q, 3)."""

    beam: Ints
    along: Floats
    foot: Floats


def nearest_beams(places: Floats, points: Floats, beams: Beams) -> OnBeams:
    """The nearest beam to each place (q, 3), and where on it."""
    a, b = points[beams.ends[:, 0]], points[beams.ends[:, 1]]
    t = np.linspace(0, 1, SAMPLES)
    samples = (a[:, None] + t[:, None] * (b - a)[:, None]).reshape(-1, 3)
    near = cKDTree(samples).query(places, k=min(NEAREST, len(samples)))[1].reshape(len(places), -1) // SAMPLES
    way = b - a
    along = np.einsum("qki,qki->qk", places[:, None] - a[near], way[near]) / np.einsum("bi,bi->b", way, way)[near]
    along = np.clip(along, 0, 1)
    foot = a[near] + along[..., None] * way[near]
    best = np.linalg.norm(places[:, None] - foot, axis=2).argmin(axis=1)
    row = np.arange(len(places))
    return OnBeams(near[row, best], along[row, best], foot[row, best])


def nodal_loads(load: LoadCase, V: Floats, at: OnBeams, points: Floats, beams: Beams) -> Floats:
    """(n, 6) newtons and newton metres on nodes, of forces on the vertices V (v, 3) of a sheet.

    Each force goes to the nearest point on the axes, and from there to the two nodes of that beam as to the supports of
    a simple beam; its moment about that point goes along. So the sum of forces and of moments is that of the sheet.
    """
    found = np.zeros((len(points), 6))
    ends, moment = beams.ends[at.beam], np.cross(V - at.foot, load.force)
    for side, share in ((0, 1 - at.along), (1, at.along)):
        both = np.concatenate([load.force, moment], axis=1) * share[:, None]
        found += group_sums(ends[:, side], both, len(points))
    return found


@dataclass(frozen=True, eq=False)
class Held:
    """Supports at nodes; each row is one.

    node  : (h,) the node on the axes that is held, or that a link goes to.    place : (h, 3) the middle of what
            is held.
    apart : (h,) whether a link is needed.    fixed : (h, 6).    spring : (h, 6) N/m.    width : (h,) metres held.
    """

    node: Ints
    place: Floats
    apart: Bools
    fixed: Bools
    spring: Floats
    width: Floats


def held_places(load: LoadCase, surface: Surface, points: Floats, beams: Beams) -> Held:
    """The held vertices of a sheet, each with the node that is nearest along the beam that is nearest.

    Where whole faces are held, the heads of columns for instance, the sheet cannot turn: no node there can, either.
    """
    V, clamped = surface.V, _clamped(surface, load)
    held = np.flatnonzero(load.held | clamped)
    at = nearest_beams(V[held], points, beams)
    node = np.where(at.along < 0.5, beams.ends[at.beam, 0], beams.ends[at.beam, 1])
    which, group = np.unique(node, return_inverse=True)
    count = np.bincount(group)
    place = group_sums(group, V[held], len(which)) / count[:, None]
    fixed = np.zeros((len(which), 6), dtype=bool)
    np.logical_or.at(fixed[:, :3], group, load.fixed[held])
    spring = np.zeros((len(which), 6))
    np.add.at(spring[:, :3], group, load.spring[held])
    around = np.array([beams.width[(beams.ends == k).any(axis=1)].max() for k in which])
    reach = _reach(V[held], group)[:, 0]
    least = np.zeros(len(which))
    np.maximum.at(least, group, _blocks(load, surface)[held])
    turned = np.zeros(len(which), dtype=bool)
    np.logical_or.at(turned, group, clamped[held])
    still = turned | ((least > BLOCK * around) & fixed[:, :3].all(axis=1))
    fixed[:, 3:] |= still[:, None]
    apart = np.linalg.norm(place - points[which], axis=1) > LINK * around
    return Held(which, place, apart & ~(least > BLOCK * around), fixed, spring, np.maximum(reach, 0.25 * around))


def _clamped(surface: Surface, load: LoadCase) -> Bools:
    """(v,) vertices at edges that cannot turn."""
    found = np.zeros(surface.n, dtype=bool)
    if len(load.clamped):
        found[surface.edges.ends[load.clamped].ravel()] = True
    return found


def _blocks(load: LoadCase, surface: Surface) -> Floats:
    """(v,) how wide the patch of faces is, metres, that are held at all corners in all directions; 0 in none."""
    faces = surface.F[load.fixed[surface.F].all(axis=(1, 2))]
    rows, columns = faces.ravel(), np.roll(faces, 1, axis=1).ravel()
    joined = coo_array((np.ones(len(rows)), (rows, columns)), shape=(surface.n, surface.n))
    vertices = np.unique(faces)
    group = np.unique(connected_components(joined, directed=False)[1][vertices], return_inverse=True)[1]
    found = np.zeros(surface.n)
    if len(vertices):
        found[vertices] = _reach(surface.V[vertices], group)[group, 1]
    return found


def _reach(V: Floats, group: Ints) -> Floats:
    """(h, 2) how long each group of points is, and how wide, metres: root twelve of their spread along two axes."""
    count = np.bincount(group)
    off = V - (group_sums(group, V, len(count)) / count[:, None])[group]
    spread = np.zeros((len(count), 3, 3))
    np.add.at(spread, group, off[:, :, None] * off[:, None, :])
    return np.asarray(np.sqrt(12 * np.maximum(np.linalg.eigvalsh(spread / count[:, None, None]), 0))[:, :0:-1])


def in_plane(fixed: Bools, axis: int) -> Bools:
    """The supports (n, 6) of a frame that is loaded in its plane, across this axis: it stays in it."""
    still = fixed.copy()
    still[:, axis] = True
    still[:, [3 + k for k in range(3) if k != axis]] = True
    return still
