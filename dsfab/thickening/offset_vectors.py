"""Offset vectors of the uncut surface, and checks of the sheet before thickening."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, cross, first_few, lengths, lock, sorted_order
from dsfab.core.errors import SolidError
from dsfab.core.messages import count_phrase
from dsfab.surface.mesh import Surface
from dsfab.surface.orientation import corner_sides, one_sided_pieces
from dsfab.surface.topology import misoriented_edges


def check_edges(surface: Surface) -> None:
    """Raise SolidError unless every edge has one face or two."""
    edges = surface.edges
    crowded = np.flatnonzero(edges.count > 2)
    if len(crowded):
        raise SolidError(
            f"the sheet has more than two faces at {count_phrase(len(crowded), 'edge')} (first, by vertices: "
            f"{_edge_names(edges.ends[crowded])}); separate the sheets that meet at these edges"
        )


def check_oriented(surface: Surface) -> None:
    """Raise SolidError for edges of over two faces, and for neighbouring faces of opposite orientations.
    One-sided pieces, such as a Moebius strip, may have opposite orientations."""
    check_edges(surface)
    edges = surface.edges
    against = misoriented_edges(surface.F, edges)
    wrong = against[~one_sided_pieces(surface.F, edges)[edges.order[edges.start[against]] // 3]]
    if len(wrong):
        raise SolidError(
            f"the two faces at {count_phrase(len(wrong), 'edge')} point to opposite sides (first, by vertices: "
            f"{_edge_names(edges.ends[wrong])}); orient the faces of the mesh consistently"
        )


def check_contacts(surface: Surface) -> None:
    """Raise SolidError if parts of the sheet touch only in a vertex."""
    pinched = surface.pinches
    if len(pinched):
        raise SolidError(
            f"parts of the sheet touch only in points, at {count_phrase(len(pinched), 'vertex')} "
            f"(first: {first_few(pinched)}); join or split these parts before thickening"
        )


def _edge_names(ends: Ints, count: int = 5) -> str:
    return ", ".join(f"{a}-{b}" for a, b in ends[:count]) + (", ..." if len(ends) > count else "")


VISIBILITY_GAP = 0.001  # Relative tolerance of the search in `visible_normals`.
CHUNK = 1 << 13  # Number of faces in a batch that fits the processor's cache.


def visible_normals(surface: Surface, weights: Floats, faces: Floats) -> Floats:
    """Return a unit normal (n, 3) at each vertex, with the smallest possible angle to the farthest face normal there.
    faces   : (m, 3, 3) face normals at corners, turned to the side of the vertex normal.
    weights : (m, 3) angles of the faces at corners.
    Source: [Gilbert 1966]. If no normal is within 90 degrees of all face normals, the mean is returned."""
    vertex, normal = surface.F.ravel(), faces.reshape(-1, 3)
    mean = _corner_mean(surface, weights, normal)
    point = mean.copy()
    tight = np.flatnonzero(_may_improve(surface, point, faces)[vertex])  # corners where a better normal may exist
    by_vertex = tight[sorted_order(vertex[tight])]
    vertex, normal = vertex[by_vertex], normal[by_vertex]
    for _ in range(200 if len(tight) else 0):
        worst, lowest = _lowest_corner(vertex, np.einsum("ci,ci->c", normal, point[vertex]))
        corner_vertex = vertex[worst]
        square = np.einsum("vi,vi->v", point[corner_vertex], point[corner_vertex])
        open_ = lowest < (1 - VISIBILITY_GAP) * square
        if not open_.any():
            break
        corner_vertex, worst, square, lowest = corner_vertex[open_], worst[open_], square[open_], lowest[open_]
        towards = normal[worst] - point[corner_vertex]
        length2 = np.maximum(np.einsum("vi,vi->v", towards, towards), np.finfo(float).tiny)
        point[corner_vertex] += np.clip((square - lowest) / length2, 0, 1)[:, None] * towards
        still = np.isin(vertex, corner_vertex)
        vertex, normal = vertex[still], normal[still]
    return _unit_normals(surface, point, mean, faces)


def _may_improve(surface: Surface, point: Floats, faces: Floats) -> Bools:
    lowest = np.full(surface.n, np.inf)
    for corner, normal in zip(surface.F.T, faces.transpose(1, 0, 2), strict=True):
        np.minimum.at(lowest, corner, np.einsum("mi,mi->m", normal, point.take(corner, axis=0)))
    return np.asarray(lowest < (1 - 0.999 * VISIBILITY_GAP) * np.einsum("vi,vi->v", point, point))


def mitres(surface: Surface, N: Floats, weights: Floats, faces: Floats, limit: float = 2.0) -> Floats:
    """Return factors (n,), at most `limit`, that lengthen offset vectors at creases.
    N : (n, 3) vertex normals.    weights, faces : as for `visible_normals`."""
    cosine = np.stack([np.einsum("mi,mi->m", N.take(surface.F[:, v], axis=0), faces[:, v]) for v in range(3)], axis=1)
    return 1 / np.clip(_corner_mean(surface, weights, cosine.reshape(-1, 1))[:, 0], 1 / limit, 1)


def _corner_mean(surface: Surface, weights: Floats, values: Floats) -> Floats:
    w, vertex = weights.ravel(), surface.F.ravel()
    total = np.stack([np.bincount(vertex, w * column, surface.n) for column in values.T], axis=1)
    total_weight = np.bincount(vertex, w, surface.n)[:, None]
    mean: Floats = np.divide(total, total_weight, out=np.zeros_like(total), where=total_weight > 0)
    return mean


def corner_angles(surface: Surface) -> Floats:
    """Return the angles of the faces at their corners (m, 3), radians."""
    angles = np.empty((surface.m, 3))
    for k in range(0, surface.m, CHUNK):
        a, b, c = (surface.V.take(F, axis=0) for F in surface.F[k : k + CHUNK].T)
        sides = b - a, c - b, a - c
        for v in range(3):
            sine, cosine = lengths(cross(sides[v - 1], sides[v])), -np.einsum("mi,mi->m", sides[v], sides[v - 1])
            angles[k : k + CHUNK, v] = np.arctan2(sine, cosine)
    return angles


def _lowest_corner(vertex: Ints, value: Floats) -> tuple[Ints, Floats]:
    start = np.flatnonzero(np.concatenate([[True], vertex[1:] != vertex[:-1]]))
    lowest = np.minimum.reduceat(value, start)
    run = np.cumsum(np.concatenate([[False], vertex[1:] != vertex[:-1]]))
    hits = np.flatnonzero(value == lowest[run])
    first_hit = np.diff(run[hits], prepend=-1) > 0
    return hits[first_hit], lowest


def _unit_normals(surface: Surface, point: Floats, mean: Floats, faces: Floats) -> Floats:
    N = np.where(_sees_all(surface, point, faces)[:, None], point, mean)
    lost = lengths(N) < 1e-6
    if lost.any():
        some_face = np.zeros_like(N)
        some_face[surface.F[:, ::-1].ravel()] = faces[:, ::-1].reshape(-1, 3)
        N = np.where(lost[:, None], some_face, N)
    length = lengths(N)[:, None]
    unit: Floats = np.divide(N, length, out=np.zeros_like(N), where=length > 0)
    return unit


def _sees_all(surface: Surface, N: Floats, faces: Floats) -> Bools:
    sees = np.ones(surface.n, dtype=bool)
    for corner, normal in zip(surface.F.T, faces.transpose(1, 0, 2), strict=True):
        sees[corner[np.einsum("mi,mi->m", normal, N.take(corner, axis=0)) <= 0]] = False
    return sees


Side = Literal["mid", "out", "in"]

SHIFT = {"mid": 0, "out": 1, "in": -1}  # Distance of the sheet's middle from the surface, in half thicknesses.


@dataclass(frozen=True, eq=False)
class Offsets:
    """Offset vectors at the vertices of a surface.
    D        : (n, 3) half of the vector from the lower to the upper skin, metres; 0 at vertices without faces.
    limited  : number of vertices where the sheet is thinner than wanted.
    smallest : smallest ratio of thickness to wanted thickness, at vertex `tightest`.
    sides    : (m, 3) for each corner of a face: 1 if D points to the side of the face's normal, else -1."""

    D: Floats
    limited: int
    smallest: float
    tightest: int
    sides: Ints

    def __post_init__(self) -> None:
        lock(self, "D", np.float64, (None, 3))
        lock(self, "sides", np.int64, (None, 3))

    def at_corners(self, F: Ints) -> Floats:
        """Return half-thickness vectors (m, 3, 3) at the corners of faces F (m, 3), on the side of the face normals."""
        seen: Floats = self.D[F] * self.sides[:, :, None]
        return seen


def offsets(surface: Surface, thickness: float | Floats, side: Side = "mid") -> Offsets:
    """Return offset vectors for a sheet around a surface, shorter where the thickened faces would fold over.
    thickness : thickness of the whole sheet, metres: a number, or (n,) at the vertices.
    side      : "mid": the surface is in the middle; "out": the sheet is on the side of the normals; "in": on the back.
    Raises SolidError for a thickness that is not positive, for surfaces that are not manifolds or wrongly oriented, and
    for "out" and "in" on a one-sided surface."""
    t = _checked_thickness(surface, thickness)
    check_oriented(surface)
    if side != "mid" and one_sided_pieces(surface.F, surface.edges).any():
        raise SolidError(f'thickening.side = "{side}" is impossible on a one-sided surface; use "mid"')
    sides = corner_sides(surface.F, surface.edges)
    weights, faces = corner_angles(surface), surface.normals[:, None, :] * sides[:, :, None]
    N = visible_normals(surface, weights, faces)
    full = 0.5 * N * (t * mitres(surface, N, weights, faces))[:, None]
    share = safe_shares(surface, full, sides, SHIFT[side])
    limited = int((share < 1).sum())
    return Offsets(full * share[:, None], limited, float(share.min()), int(share.argmin()), sides)


def _checked_thickness(surface: Surface, thickness: float | Floats) -> Floats:
    t = np.asarray(thickness, dtype=np.float64)
    if t.shape not in ((), (surface.n,)):
        raise SolidError(f"thickness has shape {t.shape}; give one number, or one for each of {surface.n} vertices")
    bad = np.flatnonzero(~(np.isfinite(t) & (t > 0)))
    if len(bad) and not t.shape:
        raise SolidError(f"thickness = {thickness} m is not positive; give a positive number of metres")
    if len(bad):
        where = f"{count_phrase(len(bad), 'vertex')} (first: {first_few(bad)})"
        raise SolidError(f"thickness is not a positive number at {where}")
    return np.broadcast_to(t, surface.n)


def safe_shares(
    surface: Surface, D: Floats, sides: Ints, shift: int = 0, shrink: float = 0.85, smallest: float = 0.05
) -> Floats:
    """Return factors (n,), at most 1, that shorten half-thickness vectors D (n, 3) until no face folds over.
    sides : as in `Offsets`.    shrink : factor by which each round shortens a vector.    smallest : smallest result.
    shift : 0 if the surface is the middle of the sheet, 1 if the sheet is on the side of the normals, -1 if behind."""
    share = np.ones(surface.n)
    faces = np.arange(surface.m)
    while len(faces):
        shrinks, scaled = np.zeros(surface.n, dtype=bool), D * share[:, None]
        for k in range(0, len(faces), CHUNK):
            rows = faces[k : k + CHUNK]
            F = surface.F[rows]
            d = scaled.take(F, axis=0)
            C, required = prism_jacobians(surface.V.take(F, axis=0) + shift * d, d * sides[rows][:, :, None])
            least = np.minimum(np.minimum(C[:, 0], C[:, 1]), C[:, 2])
            tight = ((least < required) & (required > 0)).any(axis=1)
            shrinks[F[tight]] = True
        shrinks &= share > smallest
        share[shrinks] = np.maximum(share[shrinks] * shrink, smallest)
        faces = np.flatnonzero(shrinks[surface.F].any(axis=1))
    return share


def prism_jacobians(P: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Return the coefficients (m, 3, 3) of the Jacobian of thickened faces, and their least safe values (m, 3).
    A thickened face does not fold over if all its coefficients are positive.
    P, d : (m, 3, 3) corners of the faces, and half-thickness vectors there, on the side of the faces' normals."""
    e1, e2 = P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]
    d1, d2 = d[:, 1] - d[:, 0], d[:, 2] - d[:, 0]
    flat = cross(e1, e2)
    normals = cross(e1 - d1, e2 - d2), flat - cross(d1, d2), cross(e1 + d1, e2 + d2)
    scale = (lengths(flat) * lengths(d).mean(axis=1))[:, None]
    C = np.stack([np.einsum("mi,mvi->mv", N, d) / scale for N in normals], axis=1)
    straight = np.einsum("mi,mvi->mv", flat, d) / scale
    return C, np.minimum(0.2, 0.5 * straight)  # a minimum of 0.05 is unsafe; with 0.4, `safe_shares` may not converge
