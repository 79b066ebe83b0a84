"""Faces that share no vertex though they meet: what programs write that store each face, or each half, for itself."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, distinct
from dsfab.surface.formats.record import PolygonFile
from dsfab.surface.polygons import Polygons
from dsfab.wording import counted


def joined(file: PolygonFile) -> tuple[PolygonFile, tuple[str, ...]]:
    """The mesh with its faces joined where it is meant to be joined, and what was repaired, a few words.

    That is so where no two faces share a vertex, as in STL files, and where every free edge has an exact twin that runs
    the other way or the same way: what is left then has no free edge at all. Edges must have two faces at most
    afterwards. All other vertices at the same place stay apart: they may be meant as a joint.
    """
    mesh = file.mesh
    corners, V = mesh.corners, mesh.V
    if not len(corners) or corners.min() < 0 or corners.max() >= len(V):
        return file, ()
    used = np.zeros(len(V), dtype=bool)
    used[corners] = True
    if not _some_places_twice(V[used]):
        return file, ()
    soup = len(mesh.sizes) > 1 and len(distinct(corners)) == len(corners)
    if not soup and not _free(mesh, corners).any():
        return file, ()
    fewer, became = _first_at_each_place(V)
    welded = became[corners]
    crowded = np.unique(_edges(mesh, welded), return_counts=True)[1].max() > 2
    gone = len(distinct(corners)) - len(distinct(welded))
    if crowded or not gone or not (soup or not _free(mesh, welded).any()):
        return file, ()
    words = f"{counted(gone, 'vertex')} joined with others at exactly the same place"
    return replace(file, mesh=replace(mesh, corners=fewer[welded])), (words,)


def _some_places_twice(V: Floats) -> bool:
    """Whether vertices may be at the same place: by one number of each, which is quickly sorted."""
    if not np.isfinite(V).all():
        return False
    numbers = V[:, 0] * 0.5298 + V[:, 1] * 0.6741 + V[:, 2] * 0.5144
    numbers.sort()
    return bool((numbers[1:] == numbers[:-1]).any())


def _first_at_each_place(V: Floats) -> tuple[Ints, Ints]:
    """(k,) the first vertex at each place, in the order of the file, and which of them (n,) each vertex became."""
    _, first, became = np.unique(V + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[became.ravel()]


def _edges(mesh: Polygons, corners: Ints) -> Ints:
    """(c,) a number for the edge from each corner to the next one of its face, the same in both directions."""
    last = np.cumsum(mesh.sizes) - 1
    following = np.roll(corners, -1)
    some = mesh.sizes > 0
    following[last[some]] = corners[(last - mesh.sizes + 1)[some]]
    low, high = np.minimum(corners, following), np.maximum(corners, following)
    numbers: Ints = low * (len(mesh.V) + 1) + high
    return numbers


def _free(mesh: Polygons, corners: Ints) -> Bools:
    """(e,) which edges have one face."""
    return np.asarray(np.unique(_edges(mesh, corners), return_counts=True)[1] == 1)
