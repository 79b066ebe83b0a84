"""Edges flipped between two cells of one uncut face: the surface and everything carried on it stay as they are."""

import numpy as np

from dsfab.slicing.mesh_edit import GAIN, Cut, independent
from dsfab.slicing.sheet import VOID


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
