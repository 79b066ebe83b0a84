"""`tidied`: stripes that end in the air, or turn back, taken off as far as the member that they cross last.

Where two families cross, the material is divided by the edges of both. What is between two crossings is then a part of
its own, and a stripe that leads nowhere is a part that touches other material in one place only:

         |     |            ---- and | : crossings are parts too, +
    -----+-----+---x        x : the part that ends there touches one crossing, and nothing else: it is taken off
         |     |
"""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID
from dsfab.surface.topology import connected

TURNED = 0.3
"""Parts are taken off in which a larger share runs across the direction that it should have."""
CROSSING, KEPT = -1, -2
"""Classes of polygons besides the numbers of fields."""


@dataclass(frozen=True, eq=False)
class Tidy:
    """What `cut` needs to take off loose ends.

    striped : for each field whether it draws stripes; what others keep is not touched.
    astray  : for each field (m,) faces in which its stripes run across their direction, or None where they nowhere do.
    anchor  : (n,) vertices at which stripes may end: supports and loads.
    """

    striped: tuple[bool, ...]
    astray: tuple[Bools | None, ...]
    anchor: Bools

    def __post_init__(self) -> None:
        lock(self, "anchor", np.bool_, (None,))

    def ends(self, mesh: PolygonMesh, k: int, blank: Bools) -> Bools:
        """(c,) the material of field k that later fields must divide: stripes that meet a blank face (m,) or go off."""
        mine = mesh.family == k
        if not self.striped[k] or not mine.any():
            return np.zeros_like(mine)
        astray = self.astray[k]
        suspect = blank if astray is None else blank | astray
        at = np.zeros(len(mesh.X), dtype=bool)
        at[mesh.cells.corner[suspect[mesh.face]]] = True
        part = mesh.parts(mine)
        touched = mine & mesh.cells.reduced(np.logical_or, at[mesh.cells.corner])
        return np.asarray(mine & np.isin(part, part[touched]))


def tidied(mesh: PolygonMesh, tidy: Tidy) -> PolygonMesh:
    """The mesh without parts of stripes that go astray, and then without those that lead nowhere, part after part."""
    striped = np.array(tidy.striped)
    kind = np.where(mesh.void | striped[mesh.family], mesh.family, KEPT)
    kind[mesh.also != VOID] = CROSSING
    material = ~mesh.void
    one, two, _ = mesh.neighbours
    f, g = mesh.cells.owner[one], mesh.cells.owner[two]
    same = material[f] & material[g] & (kind[f] == kind[g])
    count, part = connected(len(kind), f[same], g[same])
    stays = np.zeros(count, dtype=bool)
    stays[part[kind == KEPT]] = True
    gone = np.zeros(count, dtype=bool)
    gone[part[~material]] = True
    gone |= ~stays & _astray(mesh, tidy, part, count)
    touching = _Contacts.of(mesh, part, tidy.anchor)
    while True:
        loose = ~gone & ~stays & touching.ending(gone)
        if not loose.any():
            break
        gone |= loose
    family = np.where(gone[part], VOID, mesh.family)
    return replace(mesh, family=family)


def _astray(mesh: PolygonMesh, tidy: Tidy, part: Ints, count: int) -> Bools:
    """(p,) parts that are mostly where their stripes run across their direction."""
    area, off = mesh.cells.areas(mesh.X)[0], np.zeros(len(part), dtype=bool)
    for k, astray in enumerate(tidy.astray):
        if astray is not None:
            off |= (mesh.family == k) & (mesh.also == VOID) & astray[mesh.parent]
    return np.asarray(np.bincount(part, area * off, count) > TURNED * np.bincount(part, area, count))


@dataclass(frozen=True, eq=False)
class _Contacts:
    """Places where parts touch.

    parts : (k, 2) the two parts of each, the second one -1 for an edge of the surface.    length : (k,) metres.
    around : (p,) metres, the outline of each part.
    """

    parts: Ints
    length: Floats
    around: Floats

    @classmethod
    def of(cls, mesh: PolygonMesh, part: Ints, anchor: Bools) -> "_Contacts":
        """Sides that follow each other between the same two parts are one place."""
        one, two, _ = mesh.neighbours
        owner, cells = mesh.cells.owner, mesh.cells
        f, g = part[owner[one]], part[owner[two]]
        between = (f != g) & ~mesh.void[owner[one]] & ~mesh.void[owner[two]]
        rim = np.ones(len(cells.corner), dtype=bool)
        rim[one], rim[two] = False, False
        rim &= ~mesh.void[owner]
        side = np.concatenate([one[between], np.flatnonzero(rim)])
        first = np.concatenate([np.minimum(f, g)[between], part[owner[rim]]])
        second = np.concatenate([np.maximum(f, g)[between], np.full(int(rim.sum()), -1)])
        place = _chains(side, first, second, mesh)
        _, at, of = np.unique(place, return_index=True, return_inverse=True)
        size = np.linalg.norm(mesh.X[cells.corner] - mesh.X[cells.ahead(cells.corner)], axis=1)
        held = np.flatnonzero(np.append(anchor, np.zeros(len(mesh.X) - len(anchor), dtype=bool))[cells.corner])
        held = held[~mesh.void[owner[held]]]
        anchored = np.unique(part[owner[held]])
        pairs = np.concatenate(
            [np.stack([first[at], second[at]], axis=1), np.stack([anchored, np.full(len(anchored), -1)], axis=1)]
        )
        outer = np.ones(len(owner), dtype=bool)
        within = f == g
        outer[one[within]], outer[two[within]] = False, False
        around = np.bincount(part[owner[outer]], size[outer], int(part.max()) + 1).astype(np.float64)
        length = np.concatenate([np.bincount(of.ravel(), size[side], len(at)), np.zeros(len(anchored))])
        return cls(pairs, length, around)

    def ending(self, gone: Bools) -> Bools:
        """(p,) parts that touch others, or an edge of the surface, in one place, with less than half their outline."""
        a, b = self.parts.T
        here = ~gone[a] & ((b < 0) | ~gone[b])
        both = here & (b >= 0)
        part, length = np.concatenate([a[here], b[both]]), np.concatenate([self.length[here], self.length[both]])
        count = np.bincount(part, minlength=len(gone))
        return np.asarray((count == 1) & (np.bincount(part, length, len(gone)) < self.around / 2))


def _chains(side: Ints, first: Ints, second: Ints, mesh: PolygonMesh) -> Ints:
    """(k,) the chain of each side: sides between the same two parts that share a vertex."""
    cells = mesh.cells
    ends = np.stack([cells.corner[side], cells.corner[cells.following[side]]], axis=1)
    pair = np.unique(np.stack([first, second], axis=1), axis=0, return_inverse=True)[1].ravel()
    key = (pair[:, None] * len(mesh.X) + ends).ravel()
    order = np.argsort(key, kind="stable")
    meet = np.flatnonzero(np.diff(key[order]) == 0)
    return connected(len(side), order[meet] // 2, order[meet + 1] // 2)[1]
