"""Stripes that end at the same face without a phase: between them it becomes material, so that they meet in a node.

Around a singular point of the stress an odd number of stripes comes together, or they turn over. The face in which
that happens has no phase and is not cut: each stripe ends at its outline. Two ends at one face, of whichever family,
face each other across a gap that is as wide as a triangle; one alone is a loose end, which is taken off.

        |   |  C              |   |  C
    ____|___|.                |   |.         A B C : the face. Its corners are cut off by straight lines from one end
        A    | `.             | # | `.       to the next; what is between the ends, #, is the node.
    _________|   B        ____|__/   B
    _________|
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.cells import Cells
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import VOID
from dsfab.slicing.snap import nearest
from dsfab.surface.corner_field import CornerField

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
