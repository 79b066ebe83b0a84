"""Remove loose ends of stripes, or join them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lock, split_value
from dsfab.slicing.cutting.cells import Cells, nearest_levels
from dsfab.slicing.cutting.cut import Field
from dsfab.slicing.cutting.polygon_mesh import Contacts, PolygonMesh
from dsfab.slicing.cutting.sheet import VOID
from dsfab.surface import link_components
from dsfab.surface.fields import CornerField


@dataclass(frozen=True, eq=False)
class Tidy:
    """Rules by which finishing removes stripes. A field makes a family of stripes, or a kept region.
    striped : for each field, True for a family of stripes.
    astray  : for each field, (m,) mask of faces in which stripes have the wrong direction, or None.
    anchor  : (n,) mask of vertices at which stripes may end.
    closed  : for each field, (n,) values or None. An opening with a positive mean value becomes material."""

    striped: tuple[bool, ...]
    astray: tuple[Bools | None, ...]
    anchor: Bools
    closed: tuple[Floats | None, ...] = ()

    def __post_init__(self) -> None:
        lock(self, "anchor", np.bool_, (None,))

    def divided_again(self, mesh: PolygonMesh, k: int, blank: Bools) -> Bools:
        """Return a mask (c,) of polygons in stripes of field k that the next fields must cut, too.
        blank : (m,) mask of faces without values of field k, and of neighbouring faces."""
        own_polygons = (mesh.family == k) | (mesh.also == k)
        if not self.striped[k] or not own_polygons.any():
            return np.zeros_like(own_polygons)
        astray = self.astray[k]
        suspect = blank if astray is None else blank | astray
        suspect_vertices = np.zeros(len(mesh.X), dtype=bool)
        suspect_vertices[mesh.cells.corner[suspect[mesh.face]]] = True
        part = mesh.part_labels(own_polygons)
        touched = own_polygons & mesh.cells.per_polygon(np.logical_or, suspect_vertices[mesh.cells.corner])
        return np.asarray(own_polygons & np.isin(part, part[touched]))


CLOSED = -2  # Value of `PolygonMesh.also` for polygons of filled openings. Stripes may end at these polygons.


def with_closed_openings(mesh: PolygonMesh, closed: Sequence[Floats | None]) -> tuple[PolygonMesh, int]:
    """Fill openings where the mean value of a field is positive; return also the number of filled openings.
    closed : for each field, (n,) values at the uncut vertices, or None."""
    close_values = {k: x for k, x in enumerate(closed) if x is not None}
    if not close_values or not mesh.void.any():
        return mesh, 0
    _, opening = np.unique(mesh.part_labels(mesh.void), return_inverse=True)  # 0 for material, 1, 2 ... for openings
    area = np.where(mesh.void, mesh.cells.areas(mesh.X)[0], 0.0)
    total = np.bincount(opening, area)
    family, also, closed_openings = mesh.family, mesh.also, np.zeros(len(total), dtype=bool)
    for k, x in close_values.items():
        slot_values = (mesh.weights @ x)[mesh.cells.corner]
        mean = mesh.cells.per_polygon(np.add, slot_values) / mesh.cells.sizes
        means = np.divide(np.bincount(opening, area * mean), total, out=np.full(len(total), -np.inf), where=total > 0)
        closes = means > split_value(means[np.isfinite(means)], 0.0, tolerance=0.1)
        closed_polygons = (family == VOID) & closes[opening.ravel()]
        family, also = np.where(closed_polygons, k, family), np.where(closed_polygons, CLOSED, also)
        closed_openings |= closes
    return replace(mesh, family=family, also=also), int(closed_openings.sum())


CROSSING, KEPT, NODE = -1, -2, -3  # Kinds of polygons. Other polygons have the number of their field.


def without_loose_ends(mesh: PolygonMesh, tidy: Tidy) -> tuple[PolygonMesh, int]:
    """Remove parts of stripes with the wrong direction, then dead ends; return also the number of removed parts."""
    part, gone, stays = _parts(mesh, tidy, np.zeros_like(mesh.void))
    gone |= ~stays & _astray(mesh, tidy, part, len(gone))
    loose, islands = _loose_polygons(mesh, tidy.anchor, part, gone, stays)
    removed = (loose | islands) & ~mesh.void
    return replace(mesh, family=np.where(removed, VOID, mesh.family)), len(np.unique(part[removed]))


def dependent_polygons(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> Bools:
    """Return a mask (c,) of nodes, and of stripes that become dead ends without these nodes.
    nodes : (c,) mask of polygons where ends of stripes meet."""
    part, gone, stays = _parts(mesh, tidy, nodes)
    gone[part[nodes]] = True
    return _loose_polygons(mesh, tidy.anchor, part, gone, stays)[0] & ~mesh.void


def between_crossings(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> Ints:
    """Number the parts of stripes between crossings. Return each polygon's part (c,); -1 at crossings and in void."""
    part, _, stays = _parts(mesh, tidy, nodes)
    single_stripe = ~mesh.void & ~stays[part] & ((mesh.also == VOID) | nodes)
    return np.where(single_stripe, part, -1)


def _parts(mesh: PolygonMesh, tidy: Tidy, nodes: Bools) -> tuple[Ints, Bools, Bools]:
    striped, material = np.array(tidy.striped), ~mesh.void
    kind = np.where(mesh.void | striped[mesh.family], mesh.family, KEPT)
    kind[mesh.also != VOID] = CROSSING
    kind[nodes] = NODE
    slot_a, slot_b, _ = mesh.neighbours
    f, g = mesh.cells.owner[slot_a], mesh.cells.owner[slot_b]
    same_kind = material[f] & material[g] & (kind[f] == kind[g])
    count, part = link_components(len(kind), f[same_kind], g[same_kind])
    gone, stays = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    gone[part[~material]], stays[part[kind == KEPT]] = True, True
    return part, gone, stays


def _loose_polygons(mesh: PolygonMesh, anchor: Bools, part: Ints, gone: Bools, stays: Bools) -> tuple[Bools, Bools]:
    before = gone
    while True:
        touching = Contacts.from_parts(mesh, part, anchor)
        while (loose := ~gone & ~stays & touching.dead_ends(gone)).any():
            gone = gone | loose
        leaf, neighbour = touching.single_contacts(gone)
        if not (joined := ~stays[leaf]).any():
            return gone[part], touching.islands(before, gone, stays)[part]
        count, label = link_components(len(gone), leaf[joined], neighbour[joined])
        part = label[part]
        before, gone, stays = (np.bincount(label, marked, count) > 0 for marked in (before, gone, stays))


def _astray(mesh: PolygonMesh, tidy: Tidy, part: Ints, count: int) -> Bools:
    area, strays = mesh.cells.areas(mesh.X)[0], np.zeros(len(part), dtype=bool)
    for k, astray in enumerate(tidy.astray):
        if astray is not None:
            strays |= (mesh.family == k) & (mesh.also == VOID) & astray[mesh.parent]
    return np.asarray(np.bincount(part, area * strays, count) > 0.3 * np.bincount(part, area, count))


def with_meeting_ends(mesh: PolygonMesh, fields: Sequence[Field], levels: Sequence[Floats]) -> tuple[PolygonMesh, int]:
    """Fill void polygons where ends of stripes meet; return also the number of filled polygons."""
    corner_fields = {k: field for k, field in enumerate(fields) if isinstance(field, CornerField) and len(levels[k])}
    blank = {k: field.blank[mesh.parent] & mesh.void for k, field in corner_fields.items()}
    open_ = np.any(list(blank.values()), axis=0) if blank else np.zeros(len(mesh.parent), dtype=bool)
    if not open_.any() and not _old_nodes(mesh, corner_fields).any():
        return mesh, 0
    gap = mesh.part_labels(open_)
    family, count = np.full(len(mesh.parent), VOID), np.zeros(int(gap.max()) + 2, dtype=np.int64)
    for k, field in corner_fields.items():
        polygon, vertex = _ends(mesh, field, k, blank[k], levels[k])
        unique_ends = np.unique(np.stack([gap[polygon], vertex]), axis=1)
        np.add.at(count, unique_ends[0], 1)
        family[blank[k] & (family == VOID)] = k
    faces = np.bincount(gap[open_], minlength=len(count))
    # the void around a singular point of the field lies in at most six faces
    node = open_ & (count[gap] >= 2) & (faces[gap] <= 6)
    family, also = np.where(node, family, mesh.family), np.where(node, family, mesh.also)
    mesh = replace(mesh, family=family, also=also)
    return _without_corners(mesh, node | _old_nodes(mesh, corner_fields)), int(node.sum())


def nodes_of(mesh: PolygonMesh) -> Bools:
    """Return a mask (c,) of nodes: material in faces without field values, where ends of stripes meet."""
    return np.asarray((mesh.also == mesh.family) & ~mesh.void)


def _old_nodes(mesh: PolygonMesh, corner_fields: dict[int, CornerField]) -> Bools:
    alone = np.bincount(mesh.parent, minlength=len(mesh.F))[mesh.parent] == 1
    blank = [(mesh.family == k) & field.blank[mesh.parent] for k, field in corner_fields.items()]
    return np.asarray(alone & np.any(blank, axis=0))


def _ends(mesh: PolygonMesh, field: CornerField, k: int, blank: Bools, levels: Floats) -> tuple[Ints, Ints]:
    slot_a, slot_b, _ = mesh.neighbours
    owner, following, corner = mesh.cells.owner, mesh.cells.following, mesh.cells.corner
    inner, outer = np.concatenate([slot_a, slot_b]), np.concatenate([slot_b, slot_a])
    ends = blank[owner[inner]] & (mesh.family[owner[outer]] == k) & ~field.blank[mesh.face[outer]]
    inner, outer = inner[ends], outer[ends]
    slots = np.stack([outer, following[outer]])
    z = np.stack([_middle(mesh, field, outer, slot) for slot in slots])
    level = nearest_levels(z.ravel(), levels).reshape(z.shape)
    on_level = np.abs(z - level) < 1e-6  # True if a stripe's middle line ends at the vertex; 1e-6 is in periods
    low, high = np.sort(np.where(on_level, level, z), axis=0)
    between = np.searchsorted(levels, high, "left") - np.searchsorted(levels, low, "right")
    inside = np.repeat(owner[inner], np.maximum(between, 0))
    polygon = np.concatenate([inside, *(owner[inner[at_vertex]] for at_vertex in on_level)])
    at_vertices = (corner[slot[at_vertex]] for slot, at_vertex in zip(slots, on_level, strict=True))
    return polygon, np.concatenate([-1 - np.arange(len(inside)), *at_vertices])


def _middle(mesh: PolygonMesh, field: CornerField, side: Ints, slot: Ints) -> Floats:
    face, rows = mesh.face[side], mesh.weights[mesh.cells.corner[slot]].tocoo()
    row, vertex = (np.asarray(index, dtype=np.int64) for index in rows.coords)
    seen = field.corners(mesh.F).mean(axis=2)[face[row], mesh.corner(face[row], vertex)]
    return np.bincount(row, rows.data * seen, len(side)).astype(np.float64)


def _without_corners(mesh: PolygonMesh, nodes: Bools) -> PolygonMesh:
    cells, has_neighbour = mesh.cells, (mesh.polygon_across >= 0) & ~mesh.void[mesh.polygon_across]
    rest, polygons, sides_on = np.flatnonzero(~nodes), [], []
    source, void = rest.tolist(), [False] * len(rest)
    for node in np.flatnonzero(nodes).tolist():
        slots = slice(cells.start[node], cells.start[node + 1])
        parts = _without_free_corners(mesh.X[cells.corner[slots]], has_neighbour[slots])
        polygons += [cells.corner[slots][part] for part in parts]
        ends = [(part, (part + 1) % cells.sizes[node]) for part in parts]  # new sides get 0 (no line)
        sides_on += [cells.sides_on[slots][part] * (np.roll(part, -1) == end) for part, end in ends]
        source += [node] * len(parts)
        void += [k > 0 for k in range(len(parts))]
    sizes = np.concatenate([[0], cells.sizes[rest], [len(polygon) for polygon in polygons]])
    unchanged = cells.subset(rest)
    corner, lines = np.concatenate([unchanged.corner, *polygons]), np.concatenate([unchanged.sides_on, *sides_on])
    every = Cells(np.cumsum(sizes).astype(np.int64), corner, lines)
    order = np.argsort(source, kind="stable")  # groups the polygons by parent face
    source_polygon, removed = np.array(source, dtype=np.int64)[order], np.array(void)[order]
    family, also = (np.where(removed, VOID, x[source_polygon]) for x in (mesh.family, mesh.also))
    parent, again = mesh.parent[source_polygon], mesh.again[source_polygon]
    return replace(mesh, cells=every.subset(order), parent=parent, family=family, also=also, again=again)


def _without_free_corners(X: Floats, has_neighbour: Bools) -> list[Ints]:
    count, every = len(X), np.arange(len(X))
    least = 1e-3 * _area(X)  # smallest area of a cut corner
    marked = has_neighbour | np.roll(has_neighbour, 1)
    if not marked.any():
        return [every]
    corners = []
    for start in np.flatnonzero(marked & ~has_neighbour).tolist():
        length = 1 + int(np.argmax(np.roll(marked, -start - 1)))
        corner = (start + np.arange(length + 1)) % count
        if length > 1 and _area(X[corner]) > least:
            corners.append(corner)
        else:
            marked[corner] = True
    hull = every[marked]
    if len(hull) < 3 or _area(X[hull]) < least:
        return [every]
    return [hull, *corners]


def _area(X: Floats) -> float:
    a, b = X[1:-1] - X[0], X[2:] - X[0]
    return float(np.linalg.norm(np.cross(a, b).sum(axis=0)) / 2)
