"""What a frame carries and what holds it: loads and supports of the cut sheet, brought to the nodes of the beams."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, group_sums
from dsfab.frame.beams import Beams
from dsfab.surface import LoadCase, Surface

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
