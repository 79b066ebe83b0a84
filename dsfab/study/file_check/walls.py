"""The thinnest wall and the smallest gap of a closed mesh: straight lines from its faces, inward and outward."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.surface.topology import edge_table
from dsfab.thickening.wall import INSIDE, OPPOSED, Facets, Rays

FLAT = 64 * float(np.finfo(np.float32).eps)
"""Triangles lower than this share of the size of the mesh say nothing of a direction: single precision moved them."""


PARALLEL = float(np.cos(np.radians(3)))
"""Neighbouring faces that look at each other and are less parallel than this meet in a tip or a notch."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """A shortest distance between faces that look at each other: metres, and where it is (3,)."""

    size: float
    place: Floats

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class Clearances:
    """The thinnest wall and the smallest gap; None where no two faces look at each other."""

    wall: Clearance | None
    gap: Clearance | None


def clearances(V: Floats, F: Ints) -> Clearances:
    """Of a closed mesh V (n, 3) metres, F (m, 3) seen from outside.

    Four lines a face, from its centre and near its corners, square to it: into the material for walls, away from it for
    gaps. What they meet counts where it is parallel to 20 degrees, at the distance of its plane: exact between flat
    faces. Neighbours that are not parallel to 3 degrees are the two sides of a tip or a notch, which tapers to nothing;
    they do not count, and neither do flat facets that meet in a point. Widths of members are walls too. Triangles too
    low for single precision to hold their direction are left out.
    """
    N, plain = _normals(V, F)
    face = np.flatnonzero(plain)
    corners = V[F[face]]
    centre = corners.mean(axis=1)
    start = np.concatenate([centre, *(INSIDE * centre + (1 - INSIDE) * corners[:, k] for k in range(3))])
    face = np.tile(face, 4)
    rays, facets = Rays(V, F), Facets(F, N)

    def nearest(sign: float) -> Clearance | None:
        way = sign * N[face]
        hit = rays.first(start, way)
        opposed = -np.einsum("ki,ki->k", N[face], N[hit])
        met = (hit >= 0) & plain[hit] & (opposed > OPPOSED)
        tapering = np.flatnonzero(met & (opposed < PARALLEL))
        met[tapering[_neighbours(F, face[tapering], hit[tapering])]] = False
        depth = np.einsum("ki,ki->k", V[F[hit, 0]] - start, N[hit])
        depth = np.where(met, np.abs(depth), np.inf)
        k = facets.first_apart(depth, face, hit)
        return None if k is None else Clearance(float(depth[k]), start[k])

    return Clearances(nearest(-1.0), nearest(1.0)) if len(face) else Clearances(None, None)


def _normals(V: Floats, F: Ints) -> tuple[Floats, Bools]:
    """(m, 3) unit normals, and which faces are high enough to have one."""
    P = V[F]
    cross = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
    twice = np.linalg.norm(cross, axis=1)
    longest = np.linalg.norm(np.roll(P, -1, axis=1) - P, axis=2).max(axis=1)
    plain = twice > FLAT * float(np.linalg.norm(np.ptp(V, axis=0))) * longest
    return cross / np.where(twice > 0, twice, 1.0)[:, None], np.asarray(plain)


def _neighbours(F: Ints, one: Ints, other: Ints) -> Bools:
    """(k,) whether faces of pairs share a corner, or an edge leads from one to the other: the edge of a tip is one."""
    n = int(F.max()) + 1
    ends = edge_table(F).ends
    keys = np.sort(ends[:, 0] * n + ends[:, 1])
    found = np.zeros(len(one), dtype=bool)
    for a in F[one].T:
        for b in F[other].T:
            key = np.minimum(a, b) * n + np.maximum(a, b)
            at = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
            found |= (a == b) | (keys[at] == key)
    return found
