"""Where the parts of a sheet overlap before they are united, so that no face of one lies on a face of another.

         A                        A, of a lower colour, runs on for half a face under full thickness;
__________________
________________  |_ _ _ _ _      B begins inside A, a little thinner there, and comes out behind its end.
          |_______|_________
                  |         B
Faces of two parts that lie on each other up to rounding leave voids and handles without a size in a union,
wherever a third part runs through them: all their crossings would be found in the last digit.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.surface.neighbours import adjacency, corners_of

STEP = 0.01
"""By this share of the offset a part is thinner one vertex away from a seam, and by twice of it on the seam; half as
much again for every colour."""

INWARD = 0.005
"""Share of the way to its neighbours in A by which a vertex of B on the seam is moved, and the ends of A aside."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """A part: its faces (m,), those of its neighbours included, its vertices (n, 3), and the share (n,) of the offsets.

    tips : (n,) vertices where it ends in its neighbours.
    """

    faces: Bools
    V: Floats
    share: Floats


def overlaps(surface: Surface, colour: Ints, clashes: Ints) -> list[Overlap]:
    """The parts of each colour (m,), of which lower ones run on into higher ones, but not where they would meet.

    clashes : (k, 2) faces of the sheet that meet others once they are thick.
    """
    near = adjacency(surface.edges, surface.n)
    count = int(colour.max()) + 1
    own = [corners_of(surface.F, colour == c, surface.n) for c in range(count)]
    more = [_extension(surface, colour, c, own[c], clashes) for c in range(count)]
    parts = []
    for c in range(count):
        beyond = corners_of(surface.F, more[c], surface.n) & ~own[c]
        on_seam, open_seam = np.zeros((2, surface.n), dtype=bool)
        for lower in range(c):
            shared = own[c] & own[lower]
            open_ = shared & corners_of(surface.F, (colour == c) & ~more[lower], surface.n)
            on_seam, open_seam = on_seam | (shared & ~open_), open_seam | open_
        on_seam &= ~open_seam
        inside = corners_of(surface.F, colour < c, surface.n) & ~on_seam if c else np.zeros(surface.n, dtype=bool)
        V = _drawn_in(surface, near, beyond, own[c])
        V = _moved(V, near, on_seam, inside, INWARD)
        share = np.ones(surface.n)
        step = STEP * (1 + 0.5 * c)
        share[(near @ on_seam.astype(float) > 0) & own[c] & ~open_seam] = 1 - step
        share[on_seam] = 1 - 2 * step
        parts.append(Overlap((colour == c) | more[c], V, share))
    return parts


def _extension(surface: Surface, colour: Ints, c: int, own: Bools, clashes: Ints) -> Bools:
    """(m,) the faces of higher colours with an `own` vertex of colour c, but those that meet another of the part."""
    more = (colour > c) & own[surface.F].any(axis=1)
    part = more | (colour == c)
    meet = clashes[part[clashes].all(axis=1)]
    more[meet.ravel()] = False
    return np.asarray(more)


def _drawn_in(surface: Surface, near: csr_array, beyond: Bools, own: Bools) -> Floats:
    """Vertices with those `beyond` drawn in by about half along their shortest edge to an `own` one.

    Nearly along it: on the edge itself the end of the part would meet the skins of its neighbour edge on edge.
    """
    i, j = np.concatenate([surface.edges.ends, surface.edges.ends[:, ::-1]]).T
    used = beyond[i] & own[j]
    i, j = i[used], j[used]
    order = np.lexsort([np.linalg.norm(surface.V[i] - surface.V[j], axis=1), i])
    at, nearest = np.unique(i[order], return_index=True)
    V = surface.V.copy()
    V[at] += 0.45 * (surface.V[j[order][nearest]] - V[at])
    return _moved(V, near, beyond, own, INWARD)


def _moved(V: Floats, near: csr_array, which: Bools, towards: Bools, share: float) -> Floats:
    """V with the marked vertices moved a share of the way to the mean of their neighbours in `towards`, if any."""
    count = near @ towards.astype(float)
    at = np.flatnonzero(which & (count > 0))
    V = V.copy()
    V[at] += share * ((near[at] @ (V * towards[:, None])) / count[at, None] - V[at])
    return V
