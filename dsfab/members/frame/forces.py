"""Section forces of members: the internal forces of the shell model (sheet), summed over cuts across each member."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, group_sums, lock_floats, read_only_copy
from dsfab.members import Member, MemberAxis, MemberGraph, Node
from dsfab.members.frame.joints import fitting
from dsfab.statics import SectionForces
from dsfab.surface import Surface

PLANES = 4
"""Number of planes that cut a member near each station (point of its axis), all within one edge length of the mesh.
The forces are constant on each face of the mesh. Means over several planes are closer to equilibrium."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Intersection lines of faces with planes across a member's axis, near stations (points of the axis).
    station : (c,) number of the line's station.    face : (c,) number of the line's face.
    length  : (c,) length of the line, metres, divided by the number of planes at a station.
    arm     : (c, 2, 3) vectors (m) from the axis to the two ends of the line.
    weight  : (c, 2, 3) barycentric coordinates of the two ends of the line.
    across  : (c, 3) unit vectors in the face, perpendicular to the line, towards larger arc length.
    end_station, end_face, end_arm, end_weight, end_across : the same values for each of e line ends on a free edge.
    end_out : (e, 3) unit vectors along the line, from the face outwards."""

    station: Ints
    face: Ints
    length: Floats
    arm: Floats
    weight: Floats
    across: Floats
    end_station: Ints
    end_face: Ints
    end_arm: Floats
    end_weight: Floats
    end_across: Floats
    end_out: Floats


def sections(surface: Surface, cells: Ints, axis: MemberAxis, stations: Floats) -> Sections:
    """Return the intersection lines of cells (c,) with planes across a member's axis.
    cells : numbers of faces of the surface.    stations : (k,) arc lengths of points on the axis, m."""
    offsets = surface.mean_edge * ((np.arange(PLANES) + 0.5) / PLANES - 0.5)
    lengths = (stations[:, None] + offsets).ravel()
    P = axis.frames_at(lengths % axis.length if axis.closed else np.clip(lengths, 0, axis.length))[0]
    s = _places(surface, cells, axis)
    plane, row = _cut_cells(s, lengths, axis.length if axis.closed else np.inf)
    corner = surface.V[surface.F[cells[row]]]
    level = lengths[plane][:, None] - s[row]
    if axis.closed:
        level = (level + axis.length / 2) % axis.length - axis.length / 2
    return _as_sections(surface, cells[row], plane, P[plane], corner, level)


def _places(surface: Surface, cells: Ints, axis: MemberAxis) -> Floats:
    used, vertex_row = np.unique(surface.F[cells], return_inverse=True)
    count = int(np.clip(4 * axis.length / surface.mean_edge, 16, 20_000))
    t = np.linspace(0, axis.length, count + 1)
    P, T, _ = axis.frames_at(t)
    V = surface.V[used]
    nearest = np.asarray(cKDTree(P).query(V)[1])
    s = (t[nearest] + np.einsum("vi,vi->v", V - P[nearest], T[nearest]))[vertex_row.reshape(-1, 3)]
    if axis.closed:
        half = axis.length / 2
        s = s[:, :1] + (s - s[:, :1] + half) % axis.length - half
    return np.asarray(s)


def _cut_cells(s: Floats, lengths: Floats, period: float) -> tuple[Ints, Ints]:
    low, high = s.min(axis=1), s.max(axis=1)
    hits = np.zeros((len(lengths), len(s)), dtype=bool)
    for turn in (0.0,) if np.isinf(period) else (-period, 0.0, period):
        level = lengths[:, None] + turn
        hits |= (low < level) & (level < high)
    plane, row = np.nonzero(hits)
    return plane.astype(np.int64), row.astype(np.int64)


def _line(level: Floats) -> tuple[Floats, Ints]:
    """Return the barycentric coordinates (c, 2, 3) of the two ends of the line `level` = 0 in each of c triangles.
    Also return the triangle edges (c, 2) that contain these ends, 0 to 2.    level : (c, 3) values at the corners."""
    ahead = np.roll(level, -1, axis=1)
    crossed = (level > 0) != (ahead > 0)
    order = np.argsort(~crossed, axis=1, kind="stable")[:, :2]
    row = np.arange(len(level))[:, None]
    share = level[row, order] / (level[row, order] - ahead[row, order])
    weight = np.zeros((len(level), 2, 3))
    np.put_along_axis(weight, order[..., None], (1 - share)[..., None], axis=2)
    np.put_along_axis(weight, ((order + 1) % 3)[..., None], share[..., None], axis=2)
    return weight, order.astype(np.int64)


def _as_sections(surface: Surface, face: Ints, plane: Ints, P: Floats, corner: Floats, level: Floats) -> Sections:
    weight, edges = _line(level)
    a, b = np.moveaxis(np.einsum("cek,cki->cei", weight, corner), 1, 0)
    direction = b - a
    length = np.linalg.norm(direction, axis=1)
    along = direction / np.maximum(length, np.finfo(float).tiny)[:, None]
    across = np.cross(along, surface.normals[face])
    ahead = corner[np.arange(len(face)), level.argmin(axis=1)] - a  # vector to the corner with the largest arc length
    across *= np.sign(np.einsum("ci,ci->c", ahead, across))[:, None]
    free = surface.edges.boundary[surface.edges.of[face]]
    rows, ends = np.nonzero(free[np.arange(len(face))[:, None], _edge_number(surface, face, edges)])
    point = np.where(ends[:, None] == 0, a[rows], b[rows])
    out = along[rows] * np.where(ends == 0, -1.0, 1.0)[:, None]
    station = plane // PLANES
    lines = station, face, length / PLANES, np.stack([a - P, b - P], axis=1), weight, across
    return Sections(*lines, station[rows], face[rows], point - P[rows], weight[rows, ends], across[rows], out)


def _edge_number(surface: Surface, face: Ints, begins: Ints) -> Ints:
    corners = (np.take_along_axis(surface.F[face], which, axis=1) for which in (begins, (begins + 1) % 3))
    ends, edge_vertices = np.sort(np.stack([*corners], axis=-1)), np.sort(surface.edges.ends[surface.edges.of[face]])
    return np.asarray((ends[:, :, None] == edge_vertices[:, None]).all(axis=-1).argmax(axis=-1))


SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # Stations of a bay, as fractions of its clear length between joints.
STATIONS = len(SHARES)  # Number of stations (points with forces) of each bay.
COMPONENTS = ("N", "Vy", "Vz", "Mt", "My", "Mz")
"""Names of the section forces. The section's normal x lies along the axis; y points left, z along surface normals."""


@dataclass(frozen=True, eq=False)
class MemberForces:
    """Section forces of a member at k stations (points of the axis).
    s, width : (k,) arc length and width of the section, metres.    bay : (k,) names of the bay's nodes, "N012 N013".
    forces   : by case and combination, (k, 6): N, Vy, Vz in N, and Mt (about the axis), My, Mz in Nm. Positive N is
               tension. Positive My causes tension on the side of the surface normal, positive Mz on the right side."""

    member: str
    s: Floats
    bay: tuple[str, ...]
    width: Floats
    forces: Mapping[str, Floats]

    def __post_init__(self) -> None:
        lock_floats(self, s=(len(self.bay),), width=(len(self.bay),))
        forces = {name: read_only_copy(rows, np.float64, (len(self.s), 6)) for name, rows in self.forces.items()}
        object.__setattr__(self, "forces", MappingProxyType(forces))

    @property
    def envelope(self) -> Floats:
        """Least and greatest value of each force at each station, over all cases: (k, 6, 2)."""
        every = np.stack(list(self.forces.values()))
        return np.stack([every.min(axis=0), every.max(axis=0)], axis=-1)


@dataclass(frozen=True, eq=False)
class MemberCuts:
    """Cuts across a member at k stations (points of the axis).
    axes : (k, 3, 3) unit vectors in rows: x along the axis, y to the left, z along the surface normal."""

    s: Floats
    bay: tuple[str, ...]
    width: Floats
    axes: Floats
    sections: Sections

    @classmethod
    def from_member(cls, graph: MemberGraph, member: Member, s: Floats, bay: tuple[str, ...]) -> Self:
        """Cut a member at arc lengths s (k,), m. bay : (k,) name of the bay (part between nodes) at each arc length."""
        axis = member.curve
        cut = sections(graph.sheet.surface, member.cells, axis, s)
        _, T, N = axis.frames_at(s % axis.length if axis.closed else s)
        width = group_sums(cut.station, cut.length[:, None], len(s))[:, 0]
        return cls(s, bay, width, np.stack([T, np.cross(N, T), N], axis=1), cut)


def member_cuts(graph: MemberGraph) -> dict[str, MemberCuts]:
    """Return the cuts of each member that has an axis and a bay (part between two nodes), by name of the member."""
    stations = {member.id: _stations(graph, member) for member in graph.members}
    return {
        name: MemberCuts.from_member(graph, graph.by_id[name], *station)
        for name, station in stations.items()
        if len(station[0])
    }


def member_forces(
    graph: MemberGraph,
    forces: Mapping[str, SectionForces],
    cuts: Mapping[str, MemberCuts] | None = None,
    combinations: Mapping[str, Mapping[str, float]] | None = None,
) -> dict[str, MemberForces]:
    """Return the section forces of each member that has an axis and two nodes or more, by name of the member.
    forces       : section forces of the sheet (shell model), by case.    cuts : `member_cuts(graph)`, if known.
    combinations : factor of each case, by name of the load combination."""
    by_member = {}
    for name, cut in (member_cuts(graph) if cuts is None else cuts).items():
        part = forces_in(graph, name, cut, forces)
        rows = {case: with_balanced_shear(rows, cut) for case, rows in part.forces.items()}
        for combination, factors in (combinations or {}).items():
            rows[combination] = np.asarray(sum(factor * rows[case] for case, factor in factors.items()))
        by_member[name] = replace(part, forces=rows)
    return by_member


def with_balanced_shear(forces: Floats, cut: MemberCuts) -> Floats:
    """Return forces (k, 6) with a corrected shear force Vz. Equilibrium with the moments M needs Vz = N . (T x dM/ds),
    for the tangent T and the normal N. Near joints, the sheet's Vz can be far from equilibrium. In a bay up to two
    widths long, the mean of N . (T x dM/ds) replaces Vz. In a longer bay, the Vz of the neighbouring station replaces
    the first and the last Vz. Each replacement is made only if it reduces the error of equilibrium."""
    s, width, shear = (values.reshape(-1, STATIONS) for values in (cut.s, cut.width, forces[:, 2]))
    axes = cut.axes.reshape(-1, STATIONS, 3, 3)
    moments = np.einsum("bkai,bka->bki", axes, forces[:, 3:].reshape(-1, STATIONS, 3))
    T, N = ((axes[:, 1:, k] + axes[:, :-1, k]) / 2 for k in (0, 2))
    steps = np.maximum(np.diff(s, axis=1), np.finfo(float).tiny)
    slope = np.einsum("bki,bki->bk", np.cross(N, T), np.diff(moments, axis=1)) / steps  # N . (T x dM/ds)
    is_long = np.ptp(s, axis=1) > 2 * width.mean(axis=1)
    mean = slope @ np.array([0.2, 0.3, 0.3, 0.2])  # least-squares slope of five evenly spaced stations
    error = np.abs((shear[:, 1:] + shear[:, :-1]) / 2 - slope)
    constant = ~is_long & (((mean[:, None] - slope) ** 2).sum(axis=1) < (error**2).sum(axis=1))
    balanced = np.where(constant[:, None], mean[:, None], shear)
    for end, inner in ((0, 1), (-1, -2)):
        replaced = is_long & (np.abs(shear[:, inner] - slope[:, end]) < error[:, end])
        balanced[:, end] = np.where(replaced, shear[:, inner], balanced[:, end])
    result = forces.copy()
    result[:, 2] = balanced.ravel()
    return result


def forces_in(graph: MemberGraph, name: str, cut: MemberCuts, forces: Mapping[str, SectionForces]) -> MemberForces:
    """Return the section forces of the member `name` at its cuts. forces : section forces of the sheet, by case."""
    normals = graph.sheet.surface.normals
    sums = {case: _force_sums(cut.sections, cut.axes, parts, graph, normals) for case, parts in forces.items()}
    return MemberForces(name, cut.s, cut.bay, cut.width, sums)


def _force_sums(
    cut: Sections, axes: Floats, section_forces: SectionForces, graph: MemberGraph, normals: Floats
) -> Floats:
    source, z = graph.source[cut.face], normals[cut.face]
    frame = section_forces.frame[source]
    v = np.einsum("cai,ci->ca", frame, cut.across)
    n = np.einsum("cek,cka->cea", cut.weight, section_forces.corners[source])
    ends = [np.einsum("ca,cai->ci", _times(n[:, k], v), frame) for k in (0, 1)]
    m = np.einsum("ca,cai->ci", _times(section_forces.m[source], v), frame)
    p = np.stack(ends, axis=1) - (np.einsum("ca,ca->c", section_forces.q[source], v)[:, None] * z)[:, None]
    F = group_sums(cut.station, cut.length[:, None] * p.mean(axis=1), len(axes))
    moment = np.cross(cut.arm, (2 * p + p[:, ::-1]) / 6).sum(axis=1) + np.cross(m, z)  # exact for a linear force p
    M = group_sums(cut.station, cut.length[:, None] * moment, len(axes))
    f = _edge_forces(cut, section_forces, graph, normals)
    F = F + group_sums(cut.end_station, f, len(axes))
    M = M + group_sums(cut.end_station, np.cross(cut.end_arm, f), len(axes))
    return np.concatenate([np.einsum("kai,ki->ka", axes, F), np.einsum("kai,ki->ka", axes, M)], axis=1)


def _edge_forces(cut: Sections, section_forces: SectionForces, graph: MemberGraph, normals: Floats) -> Floats:
    source = graph.source[cut.end_face]
    frame = section_forces.frame[source]
    v, s = (np.einsum("cai,ci->ca", frame, x) for x in (cut.end_across, cut.end_out))
    m = np.einsum("ck,cka->ca", cut.end_weight, section_forces.corner_moments[source])
    return np.asarray(np.einsum("ca,ca->c", s, _times(m, v))[:, None] * normals[cut.end_face] / PLANES)


def _times(tensor: Floats, v: Floats) -> Floats:
    x, y, xy = tensor.T
    return np.stack([x * v[:, 0] + xy * v[:, 1], xy * v[:, 0] + y * v[:, 1]], axis=1)


def _stations(graph: MemberGraph, member: Member) -> tuple[Floats, tuple[str, ...]]:
    nodes = graph.nodes_along[member.id]
    if member.axis is None or len(nodes) < 2:
        return np.zeros(0), ()
    bays, incomplete = graph.bays(member.id), _incomplete_cuts(graph, member)
    s, names = [], list[str]()
    for k, length in enumerate(bays.tolist()):
        node_a, node_b = nodes[k], nodes[(k + 1) % len(nodes)]
        begin = node_a.at[node_a.members.index(member.id)]
        half = np.array([_half(graph, member, node) for node in (node_a, node_b)]) + graph.sheet.surface.mean_edge / 2
        half = fitting(half, length)
        if length > member.mean_width:
            clear = _complete_part(begin + half[0], begin + length - half[1], incomplete, graph.sheet.surface.mean_edge)
            s.append(clear[0] + np.array(SHARES) * (clear[1] - clear[0]))
            names += [f"{node_a.id} {node_b.id}"] * len(SHARES)
    return np.concatenate(s) if s else np.zeros(0), tuple(names)


def _incomplete_cuts(graph: MemberGraph, member: Member) -> Floats:
    """Return intervals (k, 2) of arc length, m, in which other material adjoins the member and cuts are incomplete."""
    surface, axis = graph.sheet.surface, member.curve
    edge = surface.edges.of[member.cells]
    number, sides = np.unique(edge, return_counts=True)
    shared = ~surface.edges.boundary[edge] & np.isin(edge, number[sides == 1])
    s = _places(surface, member.cells, axis)
    ends = np.stack([s, np.roll(s, -1, axis=1)], axis=-1)[shared]
    intervals = np.stack([ends.min(axis=1), ends.max(axis=1)], axis=1) + surface.mean_edge / 2 * np.array([-1, 1])
    turns = axis.length * np.arange(-1, 2)[:, None, None] if axis.closed else np.zeros((1, 1, 1))
    return np.asarray((intervals + turns).reshape(-1, 2))


def _complete_part(begin: float, end: float, incomplete: Floats, least: float) -> tuple[float, float]:
    low, high = incomplete[(incomplete[:, 1] > begin) & (incomplete[:, 0] < end)].T
    at_begin = low + high < begin + end
    complete = high[at_begin].max(initial=begin), low[~at_begin].min(initial=end)
    return complete if complete[1] - complete[0] > least else (begin, end)


def _half(graph: MemberGraph, member: Member, node: Node) -> float:
    neighbour = graph.by_id[node.members[1 - node.members.index(member.id)]]
    slant = np.sin(np.radians(node.angle)) if node.angle == node.angle else 1.0
    return float(neighbour.mean_width / 2 / max(slant, 0.3))
