"""`Contacts`: where the parts of a sheet touch each other, and which of them end there."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, sorted_order
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.surface import connected


@dataclass(frozen=True, eq=False)
class Contacts:
    """Stretches of outline along which parts touch.

    parts : (k, 2) the two parts of each, the second one -1 for an edge of the surface.    length : (k,) metres.
    links : (l, 2) stretches of the same part that follow each other; k is added where that is the second of the two.
    around : (p,) metres, the outline of each part.
    """

    parts: Ints
    length: Floats
    links: Ints
    around: Floats

    @classmethod
    def of(cls, mesh: PolygonMesh, part: Ints, anchor: Bools) -> "Contacts":
        """Sides that follow each other between the same two parts are one stretch."""
        one, two, _ = mesh.neighbours
        owner, cells = mesh.cells.owner, mesh.cells
        f, g = part[owner[one]], part[owner[two]]
        between = (f != g) & ~mesh.void[owner[one]] & ~mesh.void[owner[two]]
        rim = (mesh.beyond < 0) & ~mesh.void[owner]
        side = np.concatenate([one[between], np.flatnonzero(rim)])
        first = np.concatenate([np.minimum(f, g)[between], part[owner[rim]]])
        second = np.concatenate([np.maximum(f, g)[between], np.full(int(rim.sum()), -1)])
        ends = np.stack([cells.corner[side], cells.corner[cells.following[side]]], axis=1)
        pair = np.unique(np.stack([first, second], axis=1), axis=0, return_inverse=True)[1].ravel()
        i, j = meeting(pair, ends, len(mesh.X))
        _, at, of = np.unique(connected(len(side), i, j)[1], return_index=True, return_inverse=True)
        held = np.flatnonzero(np.append(anchor, np.zeros(len(mesh.X) - len(anchor), dtype=bool))[cells.corner])
        held = held[~mesh.void[owner[held]]]
        anchored = np.unique(part[owner[held]])
        pairs = np.concatenate(
            [np.stack([first[at], second[at]], axis=1), np.stack([anchored, np.full(len(anchored), -1)], axis=1)]
        )
        size = np.linalg.norm(mesh.X[cells.corner] - mesh.X[cells.ahead(cells.corner)], axis=1)
        outer = np.ones(len(owner), dtype=bool)
        within = f == g
        outer[one[within]], outer[two[within]] = False, False
        around = np.bincount(part[owner[outer]], size[outer], int(part.max()) + 1).astype(np.float64)
        length = np.concatenate([np.bincount(of.ravel(), size[side], len(at)), np.zeros(len(anchored))])
        inner = second >= 0
        whose = np.concatenate([first[inner], second[inner]])
        stretch = np.concatenate([of.ravel()[inner], of.ravel()[inner] + len(pairs)])
        i, j = meeting(whose, np.tile(ends[inner], (2, 1)), len(mesh.X))
        return cls(pairs, length, np.unique(np.stack([stretch[i], stretch[j]], axis=1), axis=0), around)

    def ending(self, gone: Bools) -> Bools:
        """(p,) parts that touch others, or an edge of the surface, in one place, with less than half their outline.

        Stretches that follow each other are one place, whatever is touched there: a stripe that ends in the corner
        between two others, or that touches a second one beside their crossing, is held there only.
        """
        part, _, length, row = self._left(gone)
        live = np.zeros(2 * len(self.parts), dtype=bool)
        live[row] = True
        i, j = self.links[live[self.links].all(axis=1)].T
        label = connected(len(live), i, j)[1]
        place = np.unique(np.stack([part, label[row]], axis=1), axis=0)[:, 0]
        places = np.bincount(place, minlength=len(gone))
        return np.asarray((places == 1) & (np.bincount(part, length, len(gone)) < self.around / 2))

    def single(self, gone: Bools) -> tuple[Ints, Ints]:
        """(k,) parts that touch one other part along one stretch and nothing else, and (k,) which."""
        part, other, _, _ = self._left(gone)
        alone = (np.bincount(part, minlength=len(gone))[part] == 1) & (other >= 0)
        return part[alone], other[alone]

    def islands(self, before: Bools, gone: Bools, stays: Bools) -> Bools:
        """(p,) parts that hung together with what stays, an edge or an anchor before more had gone, but do no more."""
        return self._grounded(before, stays) & ~self._grounded(gone, stays) & ~gone

    def _grounded(self, gone: Bools, stays: Bools) -> Bools:
        part, other, _, _ = self._left(gone)
        inner = other >= 0
        count, label = connected(len(gone), part[inner], other[inner])
        ground = np.zeros(count, dtype=bool)
        ground[label[part[~inner]]] = True
        ground[label[stays]] = True
        return np.asarray(ground[label])

    def _left(self, gone: Bools) -> tuple[Ints, Ints, Floats, Ints]:
        """Of what has not gone: the part that touches, what it touches, metres, and the number as in `links`."""
        a, b = self.parts.T
        here = np.flatnonzero(~gone[a] & ((b < 0) | ~gone[b]))
        both = here[b[here] >= 0]
        rows = np.concatenate([here, both])
        part, other = np.concatenate([a[here], b[both]]), np.concatenate([b[here], a[both]])
        return part, other, self.length[rows], np.concatenate([here, both + len(a)])


def meeting(group: Ints, ends: Ints, count: int) -> tuple[Ints, Ints]:
    """Pairs (l,), (l,) of sides of the same group (k,) that share one of their ends (k, 2), vertices of `count`."""
    key = (group[:, None] * count + ends).ravel()
    order = sorted_order(key)
    meet = np.flatnonzero(np.diff(key[order]) == 0)
    return order[meet] // 2, order[meet + 1] // 2
