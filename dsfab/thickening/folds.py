"""Small folds of a sheet: where it crosses itself, or hides from its own offsets, within less than its thickness."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from dsfab.arrays import Bools, Floats, Ints, distinct
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import smoothing_pairs
from dsfab.thickening.intersect import intersecting_pairs, pairs_after_moves
from dsfab.thickening.skin import Skin

SMALL = 4.0
"""Folds are small up to this many half thicknesses: twice the thickness of the sheet."""

ROUNDS = 10
"""Rounds of moving the vertices of a fold half of the way to the mean of their neighbours."""

GRAZING = 0.1
"""An offset with a smaller cosine to a face around its vertex hardly sees it: making it shorter does not help there."""

LAST_ROUNDS = 60
"""Rounds of shortening the offsets of all that still meets, and of smoothing where it hardly sees its faces."""

THINNER = 0.8
"""What offsets are multiplied by in each of them."""

THINNEST = 0.002
"""Share of the offset below which none is shortened: at 1e-3 of it rounding to single precision would show."""


@dataclass(frozen=True, eq=False)
class Unfolded:
    """The sheet's vertices V (n, 3) without small folds, and the pairs of its faces that still cross (k, 2)."""

    V: Floats
    crossing: Ints


def unfolded(surface: Surface, D: Floats) -> Unfolded:
    """A sheet whose small folds are smoothed away; others are left as they were. D (n, 3) its half thickness, metres.

    A mesh with such a fold, of a few faces as a rule, has a fault that no offset can pass: prisms over it turn over
    however thin they are. Larger ones are meant: there the surface crosses itself.
    """
    first = crossing = intersecting_pairs(surface.V, surface.F)
    V, near, half = surface.V, _averages(surface), float(np.median(np.linalg.norm(D, axis=1)))
    for _ in range(ROUNDS if len(crossing) else 0):
        fold, size = _folds(surface.V, surface.F, np.concatenate([first, crossing]))
        small = np.isin(fold, np.flatnonzero(size <= SMALL * half))
        at = np.zeros(surface.n, dtype=bool)
        at[surface.F[crossing].ravel()] = True
        at &= small
        if not at.any():
            break
        V = np.where(at[:, None], (V + near @ V) / 2, V)
        first, crossing = np.concatenate([first, crossing]), intersecting_pairs(V, surface.F)
    stuck = np.isin(fold, np.unique(fold[surface.F[crossing].ravel()])) & (fold >= 0) if len(first) else None
    if stuck is not None and stuck.any() and (V != surface.V).any():  # a fold that stays is left as it was
        V = np.where(stuck[:, None], surface.V, V)
        crossing = intersecting_pairs(V, surface.F)
    return Unfolded(V, crossing)


def flattened(surface: Surface, skin: Skin, D: Floats, backslash: Bools, pairs: Ints) -> tuple[Floats, Floats, Ints]:
    """Vertices V (n, 3), offsets D (n, 3) and pairs left (k, 2): the last means against faces that meet.

    What meets is made thinner, to a film if it must; where an offset hardly sees one of the faces around its vertex,
    both are moved half of the way to the mean of the neighbours instead. The best state met.
    """
    V, faces, near = surface.V, skin.faces(backslash), _averages(surface)
    least = THINNEST * np.linalg.norm(D, axis=1)
    best = V, D, pairs
    for _ in range(LAST_ROUNDS):
        if not len(pairs):
            break
        at = np.zeros(surface.n, dtype=bool)
        at[faces[pairs].ravel() % surface.n] = True
        blind = at & (_lowest_cosine(Surface(V, surface.F), skin, D) < GRAZING)
        thin = at & (np.linalg.norm(D, axis=1) > least)
        if not (blind | thin).any():
            break
        V = np.where(blind[:, None], (V + near @ V) / 2, V)
        D = np.where(blind[:, None], (D + near @ D) / 2, D) * np.where(thin, THINNER, 1)[:, None]
        pairs = pairs_after_moves(skin.vertices(V, D), faces, pairs, np.tile(blind | thin, 2))
        if len(pairs) < len(best[2]):
            best = V, D, pairs
    return best


def _lowest_cosine(surface: Surface, skin: Skin, D: Floats) -> Floats:
    """(n,) smallest cosine between each offset and the faces around its vertex, each seen from its own side."""
    side = np.where(skin.upper < surface.n, 1, -1)
    unit = D / np.linalg.norm(D, axis=1, keepdims=True)
    cosine = np.einsum("mi,mvi->mv", surface.normals, unit[surface.F]) * side
    lowest = np.ones(surface.n)
    np.minimum.at(lowest, surface.F.ravel(), cosine.ravel())
    return lowest


def _folds(V: Floats, F: Ints, pairs: Ints) -> tuple[Ints, Floats]:
    """The fold (n,) that each vertex is part of, or -1, and the size of each: the diagonal of its box, metres."""
    corner = F[pairs].reshape(-1, 6)
    i, j = np.repeat(corner[:, :1], 5, axis=1).ravel(), corner[:, 1:].ravel()
    label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(len(V),) * 2), directed=False)[1]
    used = distinct(corner)
    kinds, of = np.unique(label[used], return_inverse=True)
    fold = np.full(len(V), -1)
    fold[used] = of
    low, high = np.full((len(kinds), 3), np.inf), np.full((len(kinds), 3), -np.inf)
    np.minimum.at(low, of, V[used])
    np.maximum.at(high, of, V[used])
    return fold, np.linalg.norm(high - low, axis=1)


def _averages(surface: Surface) -> csr_array:
    """(n, n) the mean over the neighbours of each vertex, along the boundary for those on it."""
    i, j = smoothing_pairs(surface.edges, surface.n)
    count = np.bincount(i, minlength=surface.n)
    return csr_array((1 / count[i], (i, j)), shape=(surface.n,) * 2)
