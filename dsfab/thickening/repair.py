"""Repairs of a solid that intersects itself."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, distinct
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import link_components, smoothing_neighbours
from dsfab.thickening.self_intersection import intersecting_pairs, pairs_after_moves
from dsfab.thickening.skin import Skin
from dsfab.thickening.union import THIN, THINNEST, PrismUnion, prism_union


@dataclass(frozen=True, eq=False)
class UnfoldedSheet:
    """A sheet with smoothed folds: vertices V (n, 3), metres, and face pairs that still cross, `crossing` (k, 2)."""

    V: Floats
    crossing: Ints


def unfold(surface: Surface, D: Floats) -> UnfoldedSheet:
    """Return the sheet with small folds smoothed. A fold is a group of faces that cross each other.
    D : (n, 3) half-thickness vectors, metres."""
    all_crossings = crossing = intersecting_pairs(surface.V, surface.F)
    V, averages, half = surface.V, _averages(surface), float(np.median(np.linalg.norm(D, axis=1)))
    for _ in range(10 if len(crossing) else 0):
        fold, size = _folds(surface.V, surface.F, np.concatenate([all_crossings, crossing]))
        small = np.isin(fold, np.flatnonzero(size <= 4 * half))
        to_move = np.zeros(surface.n, dtype=bool)
        to_move[surface.F[crossing].ravel()] = True
        to_move &= small
        if not to_move.any():
            break
        V = np.where(to_move[:, None], (V + averages @ V) / 2, V)
        all_crossings, crossing = np.concatenate([all_crossings, crossing]), intersecting_pairs(V, surface.F)
    stuck = np.isin(fold, np.unique(fold[surface.F[crossing].ravel()])) & (fold >= 0) if len(all_crossings) else None
    if stuck is not None and stuck.any() and (V != surface.V).any():  # undo moves in folds whose faces still cross
        V = np.where(stuck[:, None], surface.V, V)
        crossing = intersecting_pairs(V, surface.F)
    return UnfoldedSheet(V, crossing)


def flatten_contacts(
    surface: Surface, skin: Skin, D: Floats, backslash: Bools, pairs: Ints
) -> tuple[Floats, Floats, Ints]:
    """Thin a sheet where its skin (closed mesh around it) intersects itself. D : (n, 3) half-thickness vectors, metres.
    pairs, backslash : pairs (k, 2) of skin faces that intersect; mask of the walls' diagonals (see `Skin`).
    Returns the sheet's vertices (n, 3), its vectors D (n, 3), metres, and the pairs (q, 2) that still intersect."""
    V, faces, averages = surface.V, skin.faces(backslash), _averages(surface)
    least = 0.002 * np.linalg.norm(D, axis=1)  # shortest offset; at 0.001, rounding errors would be visible
    result = V, D, pairs
    for _ in range(60):
        if not len(pairs):
            break
        involved = np.zeros(surface.n, dtype=bool)
        involved[faces[pairs].ravel() % surface.n] = True
        blind = involved & (_lowest_cosine(Surface(V, surface.F), skin, D) < 0.1)
        thin = involved & (np.linalg.norm(D, axis=1) > least)
        if not (blind | thin).any():
            break
        V = np.where(blind[:, None], (V + averages @ V) / 2, V)
        D = np.where(blind[:, None], (D + averages @ D) / 2, D) * np.where(thin, THIN, 1)[:, None]
        pairs = pairs_after_moves(skin.vertices(V, D), faces, pairs, np.tile(blind | thin, 2))
        if len(pairs) < len(result[2]):
            result = V, D, pairs
    return result


def _lowest_cosine(surface: Surface, skin: Skin, D: Floats) -> Floats:
    side = np.where(skin.upper < surface.n, 1, -1)
    unit = D / np.linalg.norm(D, axis=1, keepdims=True)
    cosine = np.einsum("mi,mvi->mv", surface.normals, unit[surface.F]) * side
    lowest = np.ones(surface.n)
    np.minimum.at(lowest, surface.F.ravel(), cosine.ravel())
    return lowest


def _folds(V: Floats, F: Ints, pairs: Ints) -> tuple[Ints, Floats]:
    """Return the number (n,) of each vertex's group of crossing faces, or -1 without a group.
    Return also the diagonal (g,) of each group's bounding box."""
    corner = F[pairs].reshape(-1, 6)
    i, j = np.repeat(corner[:, :1], 5, axis=1).ravel(), corner[:, 1:].ravel()
    label, used = link_components(len(V), i, j)[1], distinct(corner)
    kinds, fold_of_vertex = np.unique(label[used], return_inverse=True)
    fold = np.full(len(V), -1)
    fold[used] = fold_of_vertex
    low, high = np.full((len(kinds), 3), np.inf), np.full((len(kinds), 3), -np.inf)
    np.minimum.at(low, fold_of_vertex, V[used])
    np.maximum.at(high, fold_of_vertex, V[used])
    return fold, np.linalg.norm(high - low, axis=1)


def _averages(surface: Surface) -> csr_array:
    i, j = smoothing_neighbours(surface.edges, surface.n)
    return csr_array((1 / np.bincount(i, minlength=surface.n)[i], (i, j)), shape=(surface.n,) * 2)


@dataclass(frozen=True, eq=False)
class RepairedSkin:
    """A repaired skin (closed mesh around a sheet).
    V, D      : (n, 3) vertices of the sheet and half-thickness vectors, metres.
    backslash : (r,) mask of the walls' diagonals (see `Skin`).
    pairs     : (k, 2) pairs of faces of the skin, or of `union`, that still intersect.
    found     : number of pairs before the repair.    crosses : number of face pairs in which the sheet crosses itself.
    union     : mesh that replaces the skin if the sheet crosses itself; else None."""

    V: Floats
    D: Floats
    backslash: Bools
    pairs: Ints
    found: int
    crosses: int = 0
    union: PrismUnion | None = None


def repair_skin(surface: Surface, skin: Skin, D: Floats, among: Bools | None = None) -> RepairedSkin:
    """Remove intersections of a skin (closed mesh around a sheet) as far as possible.
    D     : (n, 3) half-thickness vectors, metres.    among : mask (f,) of faces to test; by default all."""
    V = surface.V
    backslash = skin.shorter_diagonals(V, D)
    pairs = intersecting_pairs(skin.vertices(V, D), skin.faces(backslash), among)
    pair_count = len(pairs)
    backslash, pairs = _flip_diagonals(skin, V, D, backslash, pairs, among)
    if not len(pairs):
        return RepairedSkin(V, D, backslash, pairs, pair_count)
    sheet = unfold(surface, D)
    crosses, folded = len(sheet.crossing), sheet.V is not V
    if folded:
        V, surface = sheet.V, Surface(sheet.V, surface.F)
        pairs = intersecting_pairs(skin.vertices(V, D), skin.faces(backslash))
        backslash, pairs = _flip_diagonals(skin, V, D, backslash, pairs)
    if crosses:
        D, pairs = _thin_offsets(skin, V, D, backslash, pairs, _away_from(surface, sheet.crossing, D))
        corners = D[surface.F] * np.where(skin.upper < surface.n, 1, -1)[:, :, None]
        union = prism_union(surface, corners, skin, pairs)
        if union is not None and len(union.pairs) < len(pairs):
            return RepairedSkin(V, D, backslash, union.pairs, pair_count, crosses, union)
    D, pairs = _thin_offsets(skin, V, D, backslash, pairs, np.ones(surface.n, dtype=bool))
    if not crosses:
        V, D, pairs = flatten_contacts(surface, skin, D, backslash, pairs)
    return RepairedSkin(V, D, backslash, pairs, pair_count, crosses)


def _flip_diagonals(
    skin: Skin, V: Floats, D: Floats, backslash: Bools, pairs: Ints, among: Bools | None = None
) -> tuple[Bools, Ints]:
    if not len(pairs):
        return backslash, pairs
    P = skin.vertices(V, D)
    for round_ in range(3):
        walls = skin.walls(pairs)[round_ % 2 :: 1 + (round_ > 0)]  # neighbours interact: rounds 2 and 3 skip walls
        if not len(walls):
            break
        trial = _toggle(backslash, walls)
        cleared = np.setdiff1d(walls, skin.walls(intersecting_pairs(P, skin.faces(trial), among)))
        if not len(cleared):
            continue
        trial = _toggle(backslash, cleared)
        remaining = intersecting_pairs(P, skin.faces(trial), among)
        if len(remaining) < len(pairs):
            backslash, pairs = trial, remaining
    return backslash, pairs


def _away_from(surface: Surface, crossing: Ints, D: Floats) -> Bools:
    reach = 4 * np.linalg.norm(D, axis=1).max()
    return np.asarray(cKDTree(surface.V[surface.F[crossing]].reshape(-1, 3)).query(surface.V)[0] > reach)


def _thin_offsets(skin: Skin, V: Floats, D: Floats, backslash: Bools, pairs: Ints, free: Bools) -> tuple[Floats, Ints]:
    if not len(pairs):
        return D, pairs
    faces = skin.faces(backslash)
    share = np.ones(skin.n)
    best_share, best_pairs = share, pairs
    for _ in range(30):
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
        if len(pairs) < len(best_pairs):
            best_share, best_pairs = share, pairs
    return D * best_share[:, None], best_pairs


def _toggle(flags: Bools, indices: Ints) -> Bools:
    changed = flags.copy()
    changed[indices] = ~changed[indices]
    return changed
