"""Exact test for self-intersection, and what can be done about one: other diagonals, a thinner sheet, a union."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.thickening.folds import flattened, unfolded
from dsfab.thickening.intersect import intersecting_pairs, pairs_after_moves
from dsfab.thickening.skin import Skin
from dsfab.thickening.union import THIN, THINNEST, United, united_prisms

FLIP_ROUNDS = 3
"""Rounds of flipping the diagonals of walls that intersect something."""

THIN_ROUNDS = 30
"""Rounds of thinning; each vertex takes part in six at most."""


@dataclass(frozen=True, eq=False)
class Repaired:
    """A skin after repair: offsets D (n, 3) metres, diagonals (r,), and the pairs of faces that still intersect (k, 2).

    found   : pairs before the repair.
    crosses : pairs of faces in which the sheet itself, without a thickness, crosses itself.
    union   : what is taken instead where it does; `pairs` are then those of the union.
    V       : (n, 3) vertices of the sheet: those where it was folded over itself in a small place were moved.
    """

    V: Floats
    D: Floats
    backslash: Bools
    pairs: Ints
    found: int
    crosses: int = 0
    union: United | None = None


def repaired(surface: Surface, skin: Skin, D: Floats, among: Bools | None = None) -> Repaired:
    """The skin of a sheet with offsets D (n, 3), freed from intersections as far as possible.

    No thinning helps a sheet that crosses itself: it is cut into patches that do not, and their solids are united.
    among : faces of the skin that may intersect at all, with these offsets and any diagonals; all when left out.
    """
    V = surface.V
    backslash = skin.shorter_diagonals(V, D)
    pairs = intersecting_pairs(skin.vertices(V, D), skin.faces(backslash), among)
    found = len(pairs)
    backslash, pairs = _flipped(skin, V, D, backslash, pairs, among)
    if not len(pairs):
        return Repaired(V, D, backslash, pairs, found)
    sheet = unfolded(surface, D)
    crosses, folded = len(sheet.crossing), sheet.V is not V
    if folded:
        V, surface = sheet.V, Surface(sheet.V, surface.F)
        backslash, pairs = _flipped(
            skin, V, D, backslash, intersecting_pairs(skin.vertices(V, D), skin.faces(backslash))
        )
    if crosses:
        D, pairs = _thinned(skin, V, D, backslash, pairs, _away_from(surface, sheet.crossing, D))
        corners = D[surface.F] * np.where(skin.upper < surface.n, 1, -1)[:, :, None]
        union = united_prisms(surface, corners, skin, pairs)
        if union is not None and len(union.pairs) < len(pairs):
            return Repaired(V, D, backslash, union.pairs, found, crosses, union)
    every = np.ones(surface.n, dtype=bool)
    D, pairs = _thinned(skin, V, D, backslash, pairs, every)
    if not crosses:
        V, D, pairs = flattened(surface, skin, D, backslash, pairs)
    return Repaired(V, D, backslash, pairs, found, crosses)


def _flipped(
    skin: Skin, V: Floats, D: Floats, backslash: Bools, pairs: Ints, among: Bools | None = None
) -> tuple[Bools, Ints]:
    """Diagonals of the walls in `pairs` flipped, those only that are free of intersections afterwards."""
    if not len(pairs):
        return backslash, pairs
    P = skin.vertices(V, D)
    for round_ in range(FLIP_ROUNDS):
        walls = skin.walls(pairs)[round_ % 2 :: 1 + (round_ > 0)]  # neighbours may block each other: then every second
        if not len(walls):
            break
        trial = _toggled(backslash, walls)
        cleared = np.setdiff1d(walls, skin.walls(intersecting_pairs(P, skin.faces(trial), among)))
        if not len(cleared):
            continue
        trial = _toggled(backslash, cleared)
        left = intersecting_pairs(P, skin.faces(trial), among)
        if len(left) < len(pairs):
            backslash, pairs = trial, left
    return backslash, pairs


def _away_from(surface: Surface, crossing: Ints, D: Floats) -> Bools:
    """(n,) vertices that are no part of where the sheet crosses itself: farther from there than twice its thickness."""
    reach = 4 * np.linalg.norm(D, axis=1).max()
    return np.asarray(cKDTree(surface.V[surface.F[crossing]].reshape(-1, 3)).query(surface.V)[0] > reach)


def _thinned(skin: Skin, V: Floats, D: Floats, backslash: Bools, pairs: Ints, free: Bools) -> tuple[Floats, Ints]:
    """Offsets shortened around the pairs until none is left or none may be shortened; the best state met.

    free : (n,) whether a vertex may be shortened.
    """
    if not len(pairs):
        return D, pairs
    faces = skin.faces(backslash)
    share = np.ones(skin.n)
    best_share, best = share, pairs
    for _ in range(THIN_ROUNDS):
        if not len(pairs):
            break
        involved = np.unique(faces[pairs] % skin.n)
        involved = involved[free[involved] & (share[involved] > THINNEST)]
        if not len(involved):
            break
        share = share.copy()
        share[involved] = np.maximum(THIN * share[involved], THINNEST)
        moved = np.zeros(skin.n, dtype=bool)
        moved[involved] = True
        pairs = pairs_after_moves(skin.vertices(V, D * share[:, None]), faces, pairs, np.tile(moved, 2))
        if len(pairs) < len(best):
            best_share, best = share, pairs
    return D * best_share[:, None], best


def _toggled(flags: Bools, at: Ints) -> Bools:
    changed = flags.copy()
    changed[at] = ~changed[at]
    return changed
