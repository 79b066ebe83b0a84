r"""Surfaces with one side only, cut open: what is left has two skins, and what was one edge of it is two.

     a                 Faces of such a surface agree about their side but for those along a seam. Its vertices become
o====o====o            two there, one for each side, whose upper skins are each other's lower ones. Sheets that were
seam      b  a, b      cut from the surface are opened alike.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, csr_matrix
from scipy.sparse.csgraph import dijkstra

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing import Sheet
from dsfab.surface import Surface, connected, corner_fans, half_edges
from dsfab.surface.cover import flips_along_tree, one_sided_pieces

VOID = 0.1
"""What a metre of a seam in a void counts for, where one in the sheet counts for one more."""

NOTHING = 1e-12
"""Metres from anywhere on the boundary to any place of it."""

MOST = 1000
"""Times that a seam is made shorter; each time by many faces."""


class Opening(NamedTuple):
    """given : the surface (n, m) as it was, but for its faces that were turned over: `turned` (m,).
    surface : (n', m) cut open, its faces in the same order.
    twins   : (k, 2) vertices of `surface` at one place, on both sides of the seam."""

    given: Surface
    turned: Bools
    surface: Surface
    twins: Ints

    def offsets(self, corners: Floats) -> Floats:
        """(n', 3) half-thickness vectors of those (m, 3, 3) that the faces' corners had before."""
        found = np.zeros((self.surface.n, 3))
        found[self.surface.F] = np.where(self.turned[:, None, None], -corners[:, [0, 2, 1]], corners)
        return found

    def sheet(self, sheet: Sheet) -> tuple[Sheet, Ints]:
        """A sheet that was cut from the surface, cut open, its cells in the same order; and (k, 2) its half-edges on
        both sides of the seam."""
        whole = _with_turned(sheet.surface, self.turned[sheet.parent])
        seam = _seam(whole)
        F = corner_fans(whole.F, whole.edges, apart=seam)
        _, corner = np.unique(F, return_index=True)
        old, face = whole.F.ravel()[corner], sheet.parent[corner // 3]
        weights = csr_matrix(sheet.weights)
        each = [np.asarray(weights[old, self.given.F[face, c]]).ravel() for c in range(3)]
        rows = csr_array(
            (np.stack(each, axis=1).ravel(), self.surface.F[face].ravel(), np.arange(0, 3 * len(old) + 1, 3)),
            shape=(len(old), self.surface.n),
        )
        rows.eliminate_zeros()
        cut = Sheet(Surface(whole.V[old], F), sheet.parent, sheet.family, rows)
        return cut, np.asarray(whole.edges.pairs[seam[whole.edges.count == 2]])


def opened(surface: Surface, sheet: Sheet) -> Opening | None:
    """A surface cut open along a seam, of which little is in a sheet that was cut from it; None where no piece has one
    side only."""
    if not one_sided_pieces(surface.F, surface.edges).any():
        return None
    kept = np.bincount(sheet.parent, sheet.surface.areas, surface.m) / surface.areas
    turned = _turned_for_best_way(surface, VOID + kept)
    if turned is None:
        turned = flips_along_tree(surface.F, surface.edges)
        turned ^= _turned_for_short_seam(_with_turned(surface, turned))
    given = _with_turned(surface, turned)
    seam = _seam(given)
    F = corner_fans(given.F, given.edges, apart=seam)
    _, corner = np.unique(F, return_index=True)
    pairs = given.edges.pairs[seam[given.edges.count == 2]]
    twins = np.concatenate([end[pairs] for end in half_edges(F)])
    whole = Surface(surface.V[given.F.ravel()[corner]], F)
    return Opening(given, turned, whole, np.unique(twins, axis=0))


def _turned_for_best_way(surface: Surface, counts: Floats) -> Bools | None:
    """(m,) faces to turn over so that the seam is the shortest way from boundary to boundary that crosses a loop, along
    which a side becomes the other, an odd number of times; None where they do not agree beside it then.

    counts : (m,) what a metre of a seam in each face counts for.
    """
    n, m, edges = surface.n, surface.m, surface.edges
    h0, h1 = edges.pairs.T
    f, g, ends = h0 // 3, h1 // 3, edges.ends[edges.count == 2]
    start, border = surface.F.ravel(), np.unique(edges.ends[edges.boundary])
    clash = (start[h0] == start[h1]).astype(np.int64)
    loop = _way(2 * m, f, g, clash, np.ones(len(f)), 0, m)
    long = np.linalg.norm(np.subtract(*surface.V[ends.T]), axis=1) * (counts[f] + counts[g])
    crossed = np.zeros(len(f), dtype=np.int64)
    np.add.at(crossed, loop, 1)
    outer = np.full(len(border), n)
    way = _way(
        2 * (n + 1),
        np.append(ends[:, 0], border),
        np.append(ends[:, 1], outer),
        np.append(crossed % 2, 0 * outer),
        np.append(long, np.full(len(border), NOTHING)),
        n,
        2 * n + 1,
    )
    seam = np.zeros(len(f), dtype=bool)
    seam[way[way < len(f)]] = True
    f, g, clash = (some[~seam] for some in (f, g, clash))
    one, two = np.concatenate([f, f + m]), np.concatenate([g + m * clash, g + m * (1 - clash)])
    count, side = connected(2 * m, one, two)
    return np.asarray(side[:m] != side[0]) if count == 2 and len(way) else None


def _way(count: int, one: Ints, two: Ints, turns: Ints, long: Floats, first: int, last: int) -> Ints:
    """The edges, in order, of the shortest way from node `first` to node `last` of `count`, half of which are on the
    other side: edges with turns of 1 lead there. (0,) where there is none."""
    half = count // 2
    a, b = np.concatenate([one, one + half]), np.concatenate([two + half * turns, two + half * (1 - turns)])
    graph = csr_array((np.tile(long, 2), (a, b)), shape=(count, count))
    before = dijkstra(graph, directed=False, indices=[first], return_predecessors=True)[1][0]
    number = {tuple(sorted(pair)): i % len(one) for i, pair in enumerate(zip(a.tolist(), b.tolist(), strict=True))}
    found = list[int]()
    while last != first and before[last] >= 0:
        found.append(number[tuple(sorted((last, int(before[last]))))])
        last = int(before[last])
    return np.array(found, dtype=np.int64)


def _turned_for_short_seam(surface: Surface) -> Bools:
    """(m,) faces to turn over, each while more of its outline is seam than is not: along a tree it has teeth."""
    h0, h1 = surface.edges.pairs.T
    f, g, (a, b) = h0 // 3, h1 // 3, half_edges(surface.F)
    long = np.linalg.norm(surface.V[a[h0]] - surface.V[b[h0]], axis=1)
    clash, turned = a[h0] == a[h1], np.zeros(surface.m, dtype=bool)
    for _ in range(MOST):
        worth = np.bincount(np.append(f, g), np.tile(np.where(clash, long, -long), 2), surface.m)
        rank = np.lexsort([np.arange(surface.m), worth]).argsort()
        best = worth > 1e-9 * long.max()
        best[f[(rank[f] < rank[g]) & best[g]]] = False
        best[g[(rank[g] < rank[f]) & best[f]]] = False
        if not best.any():
            break
        turned ^= best
        clash = clash ^ best[f] ^ best[g]
    return turned


def _with_turned(surface: Surface, turned: Bools) -> Surface:
    """The surface with some faces (m,) turned over."""
    F = surface.F.copy()
    F[turned] = F[turned][:, [0, 2, 1]]
    return Surface(surface.V, F)


def _seam(surface: Surface) -> Bools:
    """(e,) the edges along which faces do not agree about their side."""
    h0, h1 = surface.edges.pairs.T
    start, found = surface.F.ravel(), np.zeros(len(surface.edges.ends), dtype=bool)
    found[surface.edges.count == 2] = start[h0] == start[h1]
    return found
