"""`Sections`: planes across a member, and how they cut the faces of its cells."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.members import MemberAxis
from dsfab.surface import Surface

SAMPLES = 4
"""Points along an axis for each edge of the mesh, by which vertices find the nearest."""
PLANES = 4
"""Planes within one edge of the mesh around a station, over which its forces are averaged: those of a face are alike
all over it, and only their means balance."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Lines in which planes across an axis cut faces, row by row.

    station : (c,) numbers of the stations.    face : (c,).    length : (c,) metres, over the planes of a station.
    arm     : (c, 2, 3) metres from the axis to both ends of the line.
    weight  : (c, 2, 3) of the corners of the face at both ends.
    across  : (c, 3) unit vectors in the face, across the line, along the axis.
    end_...  : the same of ends of lines on free edges, weight (e, 3); `end_out` (e, 3) unit vectors along the line,
               out of the face.
    """

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
    """How planes at arc lengths (k,) of an axis cut the cells (c,) of a member; metres."""
    edge = surface.mean_edge
    offsets = edge * ((np.arange(PLANES) + 0.5) / PLANES - 0.5)
    at = (stations[:, None] + offsets).ravel()
    P = axis.at(at % axis.length if axis.closed else np.clip(at, 0, axis.length))[0]
    s = _places(surface, cells, axis)
    plane, row = _crossed(s, at, axis.length if axis.closed else np.inf)
    corner = surface.V[surface.F[cells[row]]]
    level = at[plane][:, None] - s[row]
    if axis.closed:
        level = (level + axis.length / 2) % axis.length - axis.length / 2
    return _as_sections(surface, cells[row], plane, P[plane], corner, level)


def _places(surface: Surface, cells: Ints, axis: MemberAxis) -> Floats:
    """(c, 3) arc lengths of the corners of cells; of a closed axis those of a cell are not torn apart."""
    used, of = np.unique(surface.F[cells], return_inverse=True)
    count = int(np.clip(SAMPLES * axis.length / surface.mean_edge, 16, 20_000))
    t = np.linspace(0, axis.length, count + 1)
    P, T, _ = axis.at(t)
    V = surface.V[used]
    near = np.asarray(cKDTree(P).query(V)[1])
    s = (t[near] + np.einsum("vi,vi->v", V - P[near], T[near]))[of.reshape(-1, 3)]
    if axis.closed:
        half = axis.length / 2
        s = s[:, :1] + (s - s[:, :1] + half) % axis.length - half
    return np.asarray(s)


def _crossed(s: Floats, at: Floats, period: float) -> tuple[Ints, Ints]:
    """Pairs of planes and rows of cells (c, 3) that they cut."""
    low, high = s.min(axis=1), s.max(axis=1)
    hits = np.zeros((len(at), len(s)), dtype=bool)
    for turn in (0.0,) if np.isinf(period) else (-period, 0.0, period):
        there = at[:, None] + turn
        hits |= (low < there) & (there < high)
    plane, row = np.nonzero(hits)
    return plane.astype(np.int64), row.astype(np.int64)


def _line(level: Floats) -> tuple[Floats, Ints]:
    """(c, 2, 3) weights of the corners at both ends of the line where a level (c, 3) is zero on triangles, and (c, 2)
    the edges that they are on, by the number of the corner that an edge begins at."""
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
    weight, on = _line(level)
    a, b = np.moveaxis(np.einsum("cek,cki->cei", weight, corner), 1, 0)
    way = b - a
    length = np.linalg.norm(way, axis=1)
    along = way / np.maximum(length, np.finfo(float).tiny)[:, None]
    across = np.cross(along, surface.normals[face])
    ahead = corner[np.arange(len(face)), level.argmin(axis=1)] - a  # the corner that lies farthest along the axis
    across *= np.sign(np.einsum("ci,ci->c", ahead, across))[:, None]
    free = surface.edges.boundary[surface.edges.of[face]]
    rows, ends = np.nonzero(free[np.arange(len(face))[:, None], _edge_number(surface, face, on)])
    point = np.where(ends[:, None] == 0, a[rows], b[rows])
    out = along[rows] * np.where(ends == 0, -1.0, 1.0)[:, None]
    station = plane // PLANES
    return Sections(
        station,
        face,
        length / PLANES,
        np.stack([a - P, b - P], axis=1),
        weight,
        across,
        station[rows],
        face[rows],
        point - P[rows],
        weight[rows, ends],
        across[rows],
        out,
    )


def _edge_number(surface: Surface, face: Ints, begins: Ints) -> Ints:
    """(c, 2) which of the three `edges.of` a face goes from a corner (c, 2) to the next."""
    wanted = np.sort(np.stack([_corner(surface, face, begins), _corner(surface, face, (begins + 1) % 3)], axis=-1))
    given = np.sort(surface.edges.ends[surface.edges.of[face]], axis=-1)
    return np.asarray((wanted[:, :, None] == given[:, None]).all(axis=-1).argmax(axis=-1))


def _corner(surface: Surface, face: Ints, which: Ints) -> Ints:
    return np.asarray(np.take_along_axis(surface.F[face], which, axis=1))
