"""Loose ends of stripes: removed up to their last crossing, joined at singular faces, or closed in crowds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.slicing.cutting.cells import Cells, nearest
from dsfab.slicing.cutting.polygon_mesh import Contacts, PolygonMesh
from dsfab.slicing.cutting.sheet import VOID
from dsfab.surface import connected
from dsfab.surface.fields import CornerField

ALIKE = 0.1
"""Openings whose values differ by less may be the same but for the mesh."""


def with_closed(mesh: PolygonMesh, closed: Sequence[Floats | None]) -> PolygonMesh:
    """The mesh with openings that close made material.

    closed : for each field (n,) values at the uncut vertices, or None: an opening becomes material of the first field
             of whose values the mean over its area is over 0. Of openings that are alike all do or none.
    """
    given = {k: x for k, x in enumerate(closed) if x is not None}
    if not given or not mesh.void.any():
        return mesh
    _, opening = np.unique(mesh.parts(mesh.void), return_inverse=True)  # the first is all material
    area = np.where(mesh.void, mesh.cells.areas(mesh.X)[0], 0.0)
    total = np.bincount(opening, area)
    family, also = mesh.family, mesh.also
    for k, x in given.items():
        at = (mesh.weights @ x)[mesh.cells.corner]
        mean = mesh.cells.reduced(np.add, at) / mesh.cells.sizes
        means = np.divide(np.bincount(opening, area * mean), total, out=np.full(len(total), -np.inf), where=total > 0)
        closes = means > limit(means[np.isfinite(means)], 0.0, ALIKE)
        mine = (family == VOID) & closes[opening.ravel()]
        family, also = np.where(mine, k, family), np.where(mine, k, also)  # a joint, as a crossing is one
    return replace(mesh, family=family, also=also)


def limit(values: Floats, least: float, alike: float) -> float:
    """Where to part values (k,) into small and large ones: at `least`, or near it in the widest gap between values.

    Things that are alike but for the mesh, as all are between two rings of a dome, are then on the same side.
    """
    near = values[np.abs(values - least) < alike]
    if not len(near):
        return least
    below = values[values <= least - alike].max(initial=least - 2 * alike)
    above = values[values >= least + alike].min(initial=least + 2 * alike)
    x = np.sort(np.array([below, *near, above]))
    widest = int(np.argmax(np.round(np.diff(x), 6)))
    return float(x[widest : widest + 2].mean())


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


MEET = 2
"""So many middles that end at a face make a node of it."""
FEW = 6
"""A gap in more polygons than meet at a vertex is no singular point: there a field is not drawn, or not known."""
ON = 1e-6
"""Middles this near to a vertex, in periods, end at it."""
THIN = 1e-3
"""A corner stays where it has less than this share of the area of its face."""


def with_meeting_ends(mesh: PolygonMesh, fields: Sequence[object], levels: Sequence[Floats]) -> PolygonMesh:
    """The mesh with void polygons of faces without a phase made material where middles of stripes meet in them.

    fields, levels : those that the mesh was cut along, in their order; others than `CornerField` have no such faces.
    """
    drawn = {k: field for k, field in enumerate(fields) if isinstance(field, CornerField) and len(levels[k])}
    blank = {k: field.blank[mesh.parent] & mesh.void for k, field in drawn.items()}
    open_ = np.any(list(blank.values()), axis=0) if blank else np.zeros(len(mesh.parent), dtype=bool)
    if not open_.any() and not _old_nodes(mesh, drawn).any():
        return mesh
    gap = mesh.parts(open_)
    family, count = np.full(len(mesh.parent), VOID), np.zeros(int(gap.max()) + 2, dtype=np.int64)
    for k, field in drawn.items():
        at, vertex = _ends(mesh, field, k, blank[k], levels[k])
        once = np.unique(np.stack([gap[at], vertex]), axis=1)
        np.add.at(count, once[0], 1)
        family[blank[k] & (family == VOID)] = k
    faces = np.bincount(gap[open_], minlength=len(count))
    node = open_ & (count[gap] >= MEET) & (faces[gap] <= FEW)
    family, also = np.where(node, family, mesh.family), np.where(node, family, mesh.also)
    return _without_corners(replace(mesh, family=family, also=also), node | _old_nodes(mesh, drawn))


def _old_nodes(mesh: PolygonMesh, drawn: dict[int, CornerField]) -> Bools:
    """(c,) polygons that are nodes already: whole faces without a phase, made material by the field that has none."""
    alone = np.bincount(mesh.parent, minlength=len(mesh.F))[mesh.parent] == 1
    blank = [(mesh.family == k) & field.blank[mesh.parent] for k, field in drawn.items()]
    return np.asarray(alone & np.any(blank, axis=0))


def _ends(mesh: PolygonMesh, field: CornerField, k: int, blank: Bools, levels: Floats) -> tuple[Ints, Ints]:
    """Polygons (q,) of those that are blank (c,) at which middles of field k end, and the vertex (q,) at which each
    does, or a number of its own below 0 where it ends on a side.

    On the plane of a mirror middles run through vertices: both sides there see such an end, and it is one.
    """
    one, two, _ = mesh.neighbours
    owner, following, corner = mesh.cells.owner, mesh.cells.following, mesh.cells.corner
    inner, outer = np.concatenate([one, two]), np.concatenate([two, one])
    ends = blank[owner[inner]] & (mesh.family[owner[outer]] == k) & ~field.blank[mesh.face[outer]]
    inner, outer = inner[ends], outer[ends]
    slots = np.stack([outer, following[outer]])
    z = np.stack([_middle(mesh, field, outer, slot) for slot in slots])
    whole = nearest(z.ravel(), levels).reshape(z.shape)
    on = np.abs(z - whole) < ON
    low, high = np.sort(np.where(on, whole, z), axis=0)
    between = np.searchsorted(levels, high, "left") - np.searchsorted(levels, low, "right")
    inside = np.repeat(owner[inner], np.maximum(between, 0))
    at = np.concatenate([inside, *(owner[inner[here]] for here in on)])
    vertex = np.concatenate(
        [-1 - np.arange(len(inside)), *(corner[slot[here]] for slot, here in zip(slots, on, strict=True))]
    )
    return at, vertex


def _middle(mesh: PolygonMesh, field: CornerField, side: Ints, slot: Ints) -> Floats:
    """(q,) the middle of the band at slots (q,), as the polygons of sides (q,) see it."""
    face, rows = mesh.face[side], mesh.weights[mesh.cells.corner[slot]].tocoo()
    row, vertex = (np.asarray(at, dtype=np.int64) for at in rows.coords)
    seen = field.corners(mesh.F).mean(axis=2)[face[row], mesh.corner(face[row], vertex)]
    return np.bincount(row, rows.data * seen, len(side)).astype(np.float64)


def _without_corners(mesh: PolygonMesh, nodes: Bools) -> PolygonMesh:
    """The mesh with the corners of nodes (c,) cut off: polygons of their own, and void."""
    cells, beside = mesh.cells, (mesh.beyond >= 0) & ~mesh.void[mesh.beyond]
    rest, polygons = np.flatnonzero(~nodes), []
    source, void = rest.tolist(), [False] * len(rest)
    for node in np.flatnonzero(nodes).tolist():
        own = slice(cells.start[node], cells.start[node + 1])
        parts = _parted(mesh.X[cells.corner[own]], beside[own])
        polygons += [cells.corner[own][part] for part in parts]
        source += [node] * len(parts)
        void += [k > 0 for k in range(len(parts))]
    sizes = np.concatenate([[0], cells.sizes[rest], [len(polygon) for polygon in polygons]])
    every = Cells(np.cumsum(sizes).astype(np.int64), np.concatenate([cells.some(rest).corner, *polygons]))
    order = np.argsort(source, kind="stable")  # by parent faces again
    of, gone = np.array(source, dtype=np.int64)[order], np.array(void)[order]
    family, also = (np.where(gone, VOID, x[of]) for x in (mesh.family, mesh.also))
    return replace(
        mesh, cells=every.some(order), parent=mesh.parent[of], family=family, also=also, again=mesh.again[of]
    )


def _parted(X: Floats, beside: Bools) -> list[Ints]:
    """Of a convex polygon X (s, 3): first what is between the sides that are marked (s,), and then the corners."""
    count, every = len(X), np.arange(len(X))
    marked = beside | np.roll(beside, 1)
    if not marked.any():
        return [every]
    corners = []
    for start in np.flatnonzero(marked & ~beside).tolist():
        length = 1 + int(np.argmax(np.roll(marked, -start - 1)))
        corner = (start + np.arange(length + 1)) % count
        if length > 1 and _area(X[corner]) > THIN * _area(X):
            corners.append(corner)
        else:
            marked[corner] = True
    hull = every[marked]
    if len(hull) < 3 or _area(X[hull]) < THIN * _area(X):
        return [every]
    return [hull, *corners]


def _area(X: Floats) -> float:
    a, b = X[1:-1] - X[0], X[2:] - X[0]
    return float(np.linalg.norm(np.cross(a, b).sum(axis=0)) / 2)
