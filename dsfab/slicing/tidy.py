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
from dsfab.slicing.contacts import Contacts
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID
from dsfab.surface import connected

TURNED = 0.3
"""Parts are taken off in which a larger share runs across the direction that it should have."""
CROSSING, KEPT, NODE = -1, -2, -3
"""Classes of polygons besides the numbers of fields."""


@dataclass(frozen=True, eq=False)
class Tidy:
    """What `cut` needs to take off loose ends.

    striped : for each field whether it draws stripes; what others keep is not touched.
    astray  : for each field (m,) faces in which its stripes run across their direction, or None where they nowhere do.
    anchor  : (n,) vertices at which stripes may end: supports and loads.
    closed  : for each field (n,) values: openings in the mean of which these are over 0 are material; or None.
    """

    striped: tuple[bool, ...]
    astray: tuple[Bools | None, ...]
    anchor: Bools
    closed: tuple[Floats | None, ...] = ()

    def __post_init__(self) -> None:
        lock(self, "anchor", np.bool_, (None,))

    def ends(self, mesh: PolygonMesh, k: int, blank: Bools) -> Bools:
        """(c,) the material of field k that later fields must divide: stripes that meet a blank face (m,) or go off."""
        mine = (mesh.family == k) | (mesh.also == k)
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
    part, gone, stays = _parts(mesh, tidy, np.zeros_like(mesh.void))
    gone |= ~stays & _astray(mesh, tidy, part, len(gone))
    loose, islands = _leading_nowhere(mesh, tidy.anchor, part, gone, stays)
    return replace(mesh, family=np.where(loose | islands, VOID, mesh.family))


def held_by(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> Bools:
    """(c,) the polygons of nodes (c,), and of parts that would lead nowhere without them."""
    part, gone, stays = _parts(mesh, tidy, nodes)
    gone[part[nodes]] = True
    return _leading_nowhere(mesh, tidy.anchor, part, gone, stays)[0] & ~mesh.void


def between_crossings(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> Ints:
    """(c,) the part of each polygon of a stripe, from one crossing to the next, and of nodes (c,); -1 of all others."""
    part, _, stays = _parts(mesh, tidy, nodes)
    plain = ~mesh.void & ~stays[part] & ((mesh.also == VOID) | nodes)
    return np.where(plain, part, -1)


def _parts(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> tuple[Ints, Bools, Bools]:
    """The part of each polygon (c,), of nodes (c,) too; which parts are void (p,), and which are kept anyway (p,)."""
    striped, material = np.array(tidy.striped), ~mesh.void
    kind = np.where(mesh.void | striped[mesh.family], mesh.family, KEPT)
    kind[mesh.also != VOID] = CROSSING
    kind[nodes] = NODE
    one, two, _ = mesh.neighbours
    f, g = mesh.cells.owner[one], mesh.cells.owner[two]
    same = material[f] & material[g] & (kind[f] == kind[g])
    count, part = connected(len(kind), f[same], g[same])
    gone, stays = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    gone[part[~material]], stays[part[kind == KEPT]] = True, True
    return part, gone, stays


def _leading_nowhere(mesh: PolygonMesh, anchor: Bools, part: Ints, gone: Bools, stays: Bools) -> tuple[Bools, Bools]:
    """(c,) polygons of parts (c,) that are gone (p,), or lead nowhere when those are; what `stays` (p,) does. And (c,)
    those that no longer hang together with anything that stays.

    A crossing of which one member has gone is the end of the other one: parts that touch one other only and are no end
    by themselves, as they are as short as they are wide, become one with it.
    """
    before = gone
    while True:
        touching = Contacts.of(mesh, part, anchor)
        while (loose := ~gone & ~stays & touching.ending(gone)).any():
            gone = gone | loose
        one, two = touching.single(gone)
        if not (joined := ~stays[one]).any():
            return gone[part], touching.islands(before, gone, stays)[part]
        count, label = connected(len(gone), one[joined], two[joined])
        part = label[part]
        before, gone, stays = (np.bincount(label, marked, count) > 0 for marked in (before, gone, stays))


def _astray(mesh: PolygonMesh, tidy: Tidy, part: Ints, count: int) -> Bools:
    """(p,) parts that are mostly where their stripes run across their direction."""
    area, off = mesh.cells.areas(mesh.X)[0], np.zeros(len(part), dtype=bool)
    for k, astray in enumerate(tidy.astray):
        if astray is not None:
            off |= (mesh.family == k) & (mesh.also == VOID) & astray[mesh.parent]
    return np.asarray(np.bincount(part, area * off, count) > TURNED * np.bincount(part, area, count))
