"""`improved`: better shaped cells, for finite elements and CAD, on the same sheet."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, Ints
from dsfab.slicing.collapses import collapsed
from dsfab.slicing.mesh_edit import GAIN, Cut, independent
from dsfab.slicing.quality import Quality, quality
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.surface import Surface


def flipped(cut: Cut) -> tuple[Cut, int]:
    """The cells after one round of flips that raise the smaller smallest angle of two cells, and how many there were.

      c            c
     /|\\          / \\       Only between cells of the same family and face: across faces of a curved surface a flip
    a | b   ->   a---b      would change its shape.
     \\|/          \\ /
      d            d
    """
    h, g = cut.edges.pairs.T
    f, e = h // 3, g // 3
    good = (cut.parent[f] == cut.parent[e]) & (cut.family[f] == cut.family[e]) & (cut.family[f] != VOID)
    h, g, f, e = h[good], g[good], f[good], e[good]
    d, c, b = (cut.F[f, (h + k) % 3] for k in range(3))  # h runs from d to c
    a = cut.F[e, (g + 2) % 3]
    one, two = np.stack([a, c, b], axis=1), np.stack([b, d, a], axis=1)
    parent = cut.parent[f]
    new = np.minimum(cut.angles(one, parent), cut.angles(two, parent))
    old = np.minimum(cut.angle[f], cut.angle[e])
    better = np.flatnonzero(new > GAIN * old)  # inside a plane face no other edge joins a and b
    better = better[np.argsort(-(new - old)[better], kind="stable")]
    rank = np.arange(len(better))
    both = np.concatenate([f[better], e[better]])
    chosen = better[independent(np.concatenate([rank, rank]), both, rank, len(cut.F))]
    F = cut.F.copy()
    F[f[chosen]], F[e[chosen]] = one[chosen], two[chosen]
    return cut.with_cells(F), len(chosen)


ROUNDS = 40
"""Of collapses and flips at most; most sheets need under ten."""


@dataclass(frozen=True, eq=False)
class Improved:
    """A sheet with better shaped cells.

    sheet         : all cells, material and void.      flips, collapses : how many there were.
    before, after : the shape of the material's cells.
    strayed       : metres by which the edges of stripes moved, at most.
    """

    sheet: Sheet
    flips: int
    collapses: int
    before: Quality
    after: Quality
    strayed: float

    @property
    def told(self) -> str:
        """A sentence with the worst angle, the share of needles and the median quality, before and after."""
        a, b = self.before, self.after
        return (
            f"{self.flips} edges flipped and {self.collapses} collapsed: smallest angle {a.worst_angle:.2g} -> "
            f"{b.worst_angle:.2g} degrees, under 1 degree {a.needles:.2%} -> {b.needles:.2%}, median quality "
            f"{a.median:.2f} -> {b.median:.2f}"
        )


def improved(sheet: Sheet, uncut: Surface, tolerance: float = 0.0) -> Improved:
    """The sheet after flips of edges and collapses of small edges that raise the smallest angle of its material.

    sheet     : all cells cut from the surface `uncut`, material and void.
    tolerance : metres that the edges of stripes, of families and of the surface may move.

    Cells stay in their uncut faces, and vertices where they are or are gone: the surface, its area and its topology,
    the weights and every carried field are kept exactly, as are the vertices of the uncut surface. No step makes a
    cell with a smaller angle than the smallest of the cells it takes away. With tolerance 0 the material covers the
    same points as before; else its area changes by less than tolerance x length of its edges.
    """
    cut = _cells(sheet, uncut)
    flips = collapses = 0
    for _ in range(ROUNDS):
        cut, fewer = collapsed(cut, tolerance)
        cut, turned = flipped(cut)
        flips, collapses = flips + turned, collapses + fewer
        if not fewer and not turned:
            break
    before = quality(sheet.kept().surface)
    if not flips and not collapses:
        return Improved(sheet, 0, 0, before, before, 0.0)
    better = _sheet(cut, sheet, uncut)
    return Improved(better, flips, collapses, before, quality(better.kept().surface), float(cut.strayed.max()))


def _cells(sheet: Sheet, uncut: Surface) -> Cut:
    surface, weights = sheet.surface, sheet.weights
    size = np.diff(weights.indptr)
    support = np.full((surface.n, 3), -1)
    support[np.repeat(np.arange(surface.n), size), _places(weights, size)] = weights.indices
    strayed: Floats = np.zeros(surface.n)
    return Cut(surface.V, surface.F, sheet.parent, sheet.family, uncut.normals, uncut.F, support, strayed)


def _places(weights: csr_array, size: Ints) -> Ints:
    """Each entry's place in its row."""
    return np.asarray(np.arange(weights.nnz) - np.repeat(weights.indptr[:-1], size))


def _sheet(cut: Cut, before: Sheet, uncut: Surface) -> Sheet:
    """The cells as a sheet, without the vertices that are gone."""
    used = np.zeros(len(cut.V), dtype=bool)
    used[cut.F] = True
    used[: uncut.n] = True
    surface = Surface(cut.V[used], (np.cumsum(used) - 1)[cut.F])
    return Sheet(surface, cut.parent, cut.family, before.weights[used])
