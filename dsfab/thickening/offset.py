"""Offset vectors of the uncut surface: where the two skins of the sheet run.

They are found before anything is cut and carried through the slicer as linear attributes, so that every cut sheet is a
part of one thickened surface: where the prisms of that surface are valid, no two pieces of the sheet can meet.

        V + D   o-------o   upper skin
                 \\     /
        V        o-----o    the surface
                /       \\
        V - D  o---------o  lower skin
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.errors import SolidError
from dsfab.surface.mesh import Surface
from dsfab.thickening.check import check_edges

VISIBILITY_GAP = 0.001
"""A normal is visible enough when its smallest cosine is within this share of the best possible one."""

VISIBILITY_ROUNDS = 200
"""Most steps towards the most visible normal. Few vertices need them all, and end within 5 % of the best cosine."""

MITRE_LIMIT = 2.0
"""Longest offset at a crease, in half thicknesses."""

SAFE_JACOBIAN = 0.2
"""Smallest Bernstein coefficient of a prism that counts as safe, as a share of a straight prism's. 0.05 was measured
to be too weak, 0.4 not to end on real meshes."""

SHRINK = 0.85
"""What an offset is multiplied by while a prism around it is not safe."""

SMALLEST_OFFSET = 0.05
"""Share of the asked thickness below which an offset is not shrunk: the exact test has the last word there."""


@dataclass(frozen=True, eq=False)
class Offsets:
    """Half-thickness vectors of a surface.

    D        : (n, 3) from the surface to its upper skin, metres; minus D leads to the lower skin. Zero without faces.
    limited  : number of vertices where the surface bends too tightly for the asked thickness.
    smallest : the smallest share of the asked thickness that was left there; 1 when nothing was limited.
    """

    D: Floats
    limited: int
    smallest: float

    def __post_init__(self) -> None:
        lock(self, "D", np.float64, (None, 3))


def offsets(surface: Surface, thickness: float) -> Offsets:
    """Offset vectors that make a sheet of `thickness` (metres, measured normal to its faces) around a surface.

    Each runs along the normal that is most visible from the faces around its vertex, is lengthened at creases (mitre,
    at most twice), and is shortened where the prisms over the faces would fold over.
    Raises SolidError for a thickness that is not a positive number, and for surfaces that are not oriented manifolds.
    """
    if not (np.isfinite(thickness) and thickness > 0):
        raise SolidError(f"thickness = {thickness} m cannot be built; give a positive number of metres")
    check_edges(surface)
    weights = _corner_angles(surface)
    N = visible_normals(surface, weights)
    full = 0.5 * thickness * N * _mitres(surface, N, weights)[:, None]
    share = safe_shares(surface, full)
    limited = int((share < 1).sum())
    return Offsets(full * share[:, None], limited, float(share.min()))


def visible_normals(surface: Surface, weights: Floats) -> Floats:
    """(n, 3) unit normals with nearly (5 %) the largest possible smallest cosine to the faces around each vertex.

    The best one is the direction of the point nearest to the origin in the convex hull of the face normals
    [Gilbert 1966: step towards the worst face], and the length of any point there bounds the best cosine from above.
    Starts from the mean weighted by the corner angles (m, 3), and falls back to it where no direction sees all faces.
    """
    mean = _corner_mean(surface, weights, np.repeat(surface.normals, 3, axis=0))
    point = mean.copy()
    vertex, normal = surface.F.ravel(), np.repeat(surface.normals, 3, axis=0)
    by_vertex = np.argsort(vertex, kind="stable")
    vertex, normal = vertex[by_vertex], normal[by_vertex]
    for _ in range(VISIBILITY_ROUNDS):
        worst, lowest = _lowest_corner(vertex, np.einsum("ci,ci->c", normal, point[vertex]))
        here = vertex[worst]
        square = np.einsum("vi,vi->v", point[here], point[here])
        open_ = lowest < (1 - VISIBILITY_GAP) * square
        if not open_.any():
            break
        here, worst, square, lowest = here[open_], worst[open_], square[open_], lowest[open_]
        towards = normal[worst] - point[here]
        length2 = np.maximum(np.einsum("vi,vi->v", towards, towards), np.finfo(float).tiny)
        point[here] += np.clip((square - lowest) / length2, 0, 1)[:, None] * towards
        still = np.isin(vertex, here)
        vertex, normal = vertex[still], normal[still]
    return _settled(surface, point, mean)


def safe_shares(surface: Surface, D: Floats) -> Floats:
    """(n,) shares of D (n, 3) that leave every prism over a face with a Jacobian that is clearly positive.

    A corner that its own offset vector does not see, or hardly, is asked for less: no shrinking can help it.
    """
    share = np.ones(surface.n)
    look = np.arange(surface.m)
    while len(look):
        F = surface.F[look]
        C, asked = _prism_jacobians(surface.V, F, D * share[:, None])
        tight = ((C - asked[:, None, :] < 0) & (asked[:, None, :] > 0)).any(axis=(1, 2))
        shrinks = np.zeros(surface.n, dtype=bool)
        shrinks[F[tight]] = True
        shrinks &= share > SMALLEST_OFFSET
        share[shrinks] = np.maximum(share[shrinks] * SHRINK, SMALLEST_OFFSET)
        look = np.flatnonzero(shrinks[surface.F].any(axis=1))
    return share


def _prism_jacobians(V: Floats, F: Ints, D: Floats) -> tuple[Floats, Floats]:
    """Coefficients (m, 3, 3) of the Jacobian of prisms V + s D, -1 <= s <= 1, and what each corner (m, 3) must reach.

    The Jacobian is quadratic in s and linear over the face: coefficient [k, v] belongs to power k of s (Bernstein) and
    corner v. All positive means that the prism does not fold over. Divided by twice the area and the mean |D|.
    """
    d = D[F]
    e1, e2 = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    d1, d2 = d[:, 1] - d[:, 0], d[:, 2] - d[:, 0]
    below, above = np.cross(e1 - d1, e2 - d2), np.cross(e1 + d1, e2 + d2)
    middle = np.cross(e1, e2) - np.cross(d1, d2)
    scale = np.linalg.norm(np.cross(e1, e2), axis=1) * np.linalg.norm(d, axis=2).mean(axis=1)
    C = np.einsum("kmi,mvi->mkv", np.stack([below, middle, above]), d) / scale[:, None, None]
    straight = np.einsum("mi,mvi->mv", np.cross(e1, e2), d) / scale[:, None]
    return C, np.minimum(SAFE_JACOBIAN, 0.5 * straight)


def _mitres(surface: Surface, N: Floats, weights: Floats) -> Floats:
    """(n,) 1 / mean cosine between each normal and the faces around it, at most MITRE_LIMIT."""
    cosine = np.einsum("mvi,mi->mv", N[surface.F], surface.normals)
    mean = _corner_mean(surface, weights, cosine.reshape(-1, 1))[:, 0]
    return 1 / np.clip(mean, 1 / MITRE_LIMIT, 1)


def _corner_mean(surface: Surface, weights: Floats, values: Floats) -> Floats:
    """(n, k) weighted mean over the corners at each vertex of values (3 m, k); zero without corners."""
    w, vertex = weights.ravel(), surface.F.ravel()
    total = np.stack([np.bincount(vertex, w * column, surface.n) for column in values.T], axis=1)
    whole = np.bincount(vertex, w, surface.n)[:, None]
    mean: Floats = np.divide(total, whole, out=np.zeros_like(total), where=whole > 0)
    return mean


def _corner_angles(surface: Surface) -> Floats:
    """(m, 3) angles of the faces at their corners, radians."""
    P = surface.V[surface.F]
    ahead, back = np.roll(P, -1, axis=1) - P, np.roll(P, 1, axis=1) - P
    sine = np.linalg.norm(np.cross(ahead, back), axis=2)
    angles: Floats = np.arctan2(sine, np.einsum("mvi,mvi->mv", ahead, back))
    return angles


def _lowest_corner(vertex: Ints, value: Floats) -> tuple[Ints, Floats]:
    """Index of the corner with the lowest value at each vertex of a sorted list, and that value."""
    start = np.flatnonzero(np.concatenate([[True], vertex[1:] != vertex[:-1]]))
    lowest = np.minimum.reduceat(value, start)
    run = np.cumsum(np.concatenate([[False], vertex[1:] != vertex[:-1]]))
    hits = np.flatnonzero(value == lowest[run])
    _, first_hit = np.unique(run[hits], return_index=True)
    return hits[first_hit], lowest


def _settled(surface: Surface, point: Floats, mean: Floats) -> Floats:
    """Unit normals from the points found; the mean, or any face's normal, where a point sees a face from behind."""
    seen = _sees_all(surface, point)
    N = np.where(seen[:, None], point, mean)
    lost = np.linalg.norm(N, axis=1) < 1e-6
    some_face = np.zeros_like(N)
    some_face[surface.F[:, ::-1].ravel()] = np.repeat(surface.normals, 3, axis=0)
    N = np.where(lost[:, None], some_face, N)
    length = np.linalg.norm(N, axis=1, keepdims=True)
    unit: Floats = np.divide(N, length, out=np.zeros_like(N), where=length > 0)
    return unit


def _sees_all(surface: Surface, N: Floats) -> Bools:
    """(n,) whether each vector (n, 3) makes an acute angle with all faces around its vertex."""
    hidden = np.einsum("mvi,mi->mv", N[surface.F], surface.normals) <= 0
    sees = np.ones(surface.n, dtype=bool)
    sees[surface.F[hidden]] = False
    return sees
