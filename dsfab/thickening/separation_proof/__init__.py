"""Proof, without a test of pairs of faces, that most of a thickened sheet cannot intersect itself.

A prism is the thickened solid of a face. A grid of boxes sorts the faces. The axis of a box is the faces' mean normal.
A box and the boxes around it form a block. The prisms of a box cannot intersect any prism if:

1. All normals of the block's prisms are within 90 degrees of the axis.
2. Seen along the axis, the boundary of the block's faces goes exactly once around the prisms of the box."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, equal_key_groups, lengths, unit_vectors
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening.offset_vectors import SHIFT, Side
from dsfab.thickening.skin import is_fine, rounding_step


@dataclass(frozen=True, eq=False)
class OffsetLayer:
    """A surface before and after the pattern is cut, with half-thickness vectors.
    uncut   : the surface before the cut; edge-manifold, consistently oriented.
    D, carried : (n, 3), (n', 3) half-thickness vectors of `uncut` and of `cells`, metres.
    cells   : the mesh after the cut, with the faces of material and of voids.
    parent  : (m',) the face of `uncut` that contains each cell."""

    uncut: Surface
    D: Floats
    cells: Surface
    carried: Floats
    parent: Ints
    side: Side = "mid"

    @property
    def shift(self) -> int:
        """Distance of the solid's middle layer from the surface, divided by half the thickness: 0, 1 or -1."""
        return SHIFT[self.side]


REACH = 2  # Number of boxes on each side of the middle box in a block of boxes.


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes of a grid that divide the faces of a surface into groups.
    of : (m,) number of the box of each face.    place : (k, 3) integer position of each box in the grid.
    radius : (k,) radius of a cylinder that contains the thickened faces of the box, metres.
    middle, axis : (k, 3) middle (metres) and mean normal of the faces of each box.
    grid   : number of the box at each grid position, -1 for a position without faces.
    key    : (k,) index of each box in the flattened grid."""

    of: Ints
    place: Ints
    middle: Floats
    axis: Floats
    radius: Floats
    grid: Ints
    key: Ints

    def neighbours(self, box: Ints, step: Ints) -> Ints:
        """Return the numbers (k,) of the boxes that lie `step` (3,) grid cells from boxes (k,); -1 without a box."""
        _, ny, nz = self.grid.shape
        return np.asarray(self.grid.ravel()[self.key[box] + (step[0] * ny + step[1]) * nz + step[2]])


def boxes_of(layer: OffsetLayer, error: float, count: int) -> Boxes:
    """Sort the faces of the uncut surface into about `count` equal boxes. error : bound of rounding errors, metres."""
    uncut = layer.uncut
    middle = uncut.centroids
    size = lengths(layer.D) * (1 + abs(layer.shift))
    reach = np.zeros(uncut.m)
    for corner in uncut.F.T:
        np.maximum(reach, lengths(uncut.V.take(corner, axis=0) - middle) + size[corner] + error, out=reach)
    low, extent = (np.array([box(column) for column in middle.T]) for box in (np.min, np.ptp))
    box_limit = 2e7  # largest number of boxes in the grid; empty boxes count
    least_widths = (uncut.area / count) ** 0.5, (extent.prod() / box_limit) ** (1 / 3), extent.max() / box_limit**0.4
    width = max(2.1 * reach.max(), *least_widths)
    place = np.floor((middle - low) / width).astype(np.int64) + REACH
    shape = place.max(axis=0) + REACH + 1
    flat = np.ravel_multi_index(tuple(place.T), tuple(shape))
    order, begins, box = equal_key_groups(flat)
    key = flat[order[begins]]
    grid = np.full(shape, -1)
    grid.ravel()[key] = np.arange(len(key))
    centre: Floats = np.stack([np.bincount(box, column) for column in middle.T], axis=1) / np.bincount(box)[:, None]
    axis: Floats = np.stack([np.bincount(box, column) for column in uncut.normals.T], axis=1).astype(np.float64)
    axis = unit_vectors(axis)
    radius = np.zeros(len(key))
    np.maximum.at(radius, box, lengths(middle - centre.take(box, axis=0)) + reach)
    return Boxes(box, np.stack(np.unravel_index(key, tuple(shape)), axis=1), centre, axis, radius, grid, key)


def block_steps() -> list[Ints]:
    """Return the grid steps (3,) from a box to all boxes of its block, including itself."""
    along = np.arange(-REACH, REACH + 1)
    return list(np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3))


CHUNK = 1 << 14  # Number of cells in a batch that fits the processor's cache.

Three = tuple[Floats, Floats, Floats]


def prisms(layer: OffsetLayer, boxes: Boxes, error: float) -> tuple[Bools, Floats, Floats]:
    """Return three properties of prisms (thickened cells). error : bound of the rounding errors, metres.
    1. A mask (m',) of the prisms that may be folded.
    2. The smallest cosine (k,) between the axis of each box and the upper and lower normals of its prisms.
    3. The radius (m',) of a sphere around each prism, metres."""
    F, m = layer.cells.F, layer.cells.m
    upper = np.ascontiguousarray((layer.cells.V + (layer.shift + 1) * layer.carried).T)
    lower = np.ascontiguousarray((layer.cells.V + (layer.shift - 1) * layer.carried).T)
    box = boxes.of[layer.parent]
    axes = np.ascontiguousarray(boxes.axis.T)
    folded, reach, cosine = np.empty(m, dtype=bool), np.empty(m), np.empty(m)
    for begin in range(0, m, CHUNK):
        part = slice(begin, begin + CHUNK)
        corner = np.ascontiguousarray(F[part].T)
        over, under = (np.stack([column.take(corner) for column in skin]) for skin in (upper, lower))
        axis = np.stack([column.take(box[part]) for column in axes])
        folded[part], cosine[part], reach[part] = _prism(over, under, axis, error)
    least = np.ones(len(boxes.axis))
    np.minimum.at(least, box, cosine)
    return folded, least, reach


def _prism(upper: Floats, lower: Floats, axis: Floats, error: float) -> tuple[Bools, Floats, Floats]:
    middle = (upper.sum(axis=1) + lower.sum(axis=1)) / 6
    A, B = lower - middle[:, None], upper - middle[:, None]
    reach = np.sqrt(np.maximum((A**2).sum(axis=0), (B**2).sum(axis=0)).max(axis=0)) + error
    (p, q, r), (u, v, w) = ((P[:, 1] - P[:, 0], P[:, 2] - P[:, 0], P[:, 2] - P[:, 1]) for P in (A, B))
    bottom, top = _cross(q, p), _cross(u, v)
    least = np.minimum(_dot(bottom, A[:, 0]), _dot(top, B[:, 0]))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        under, over = _cross(A[:, i], A[:, j]), _cross(B[:, j], B[:, i])
        for side, point in ((under, B[:, j]), (under, B[:, i]), (over, A[:, i]), (over, A[:, j])):
            np.minimum(least, _dot(side, point), out=least)
    cosines = []
    for normal, sides, sign in ((top, (u, v, w), 1), (bottom, (p, q, r), -1)):
        length = np.maximum(np.sqrt(_dot(normal, normal)), np.finfo(float).tiny)
        side = np.sqrt(np.maximum.reduce([_dot(s, s) for s in sides])) + 2 * error
        tilt = 5 * error * side / length
        cosines.append(np.where(tilt < 0.5, sign * _dot(normal, axis) / length - 2 * tilt, -1.0))
    return least <= 4 * error * reach**2, np.minimum(*cosines), reach


def _cross(a: Floats, b: Floats) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Three, b: Floats | Three) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def boxes_seen_from_front(boxes: Boxes, cosine: Floats) -> Bools:
    """Return a mask (k,) of the boxes with an axis within 90 degrees of all prism normals in their block.
    cosine : (k,) smallest cosine between a box's axis and the upper and lower normals of its prisms."""
    spread = np.arccos(np.clip(cosine, -1, 1))
    visible = spread < np.pi / 2
    every = np.arange(len(visible))
    for step in block_steps():
        neighbour = boxes.neighbours(every, step)
        present = np.flatnonzero(neighbour >= 0)
        seen = np.einsum("ki,ki->k", boxes.axis[present], boxes.axis[neighbour[present]])
        visible[present] &= np.arccos(np.clip(seen, -1, 1)) + spread[neighbour[present]] < np.pi / 2 - 1e-6
    return visible


def boxes_with_simple_rims(layer: OffsetLayer, boxes: Boxes, accepted: Bools, error: float) -> Bools:
    """Return a mask (k,) of boxes: the block's boundary goes exactly once around the box's cylinder.
    accepted : (k,) mask of the boxes to test.    error : bound of rounding errors, metres."""
    uncut = layer.uncut
    thick = lengths(layer.D) * (1 + abs(layer.shift)) + error
    accepted, turns = accepted.copy(), np.zeros(len(boxes.axis), dtype=np.int64)
    perpendicular = np.cross(boxes.axis, np.eye(3)[np.abs(boxes.axis).argmin(axis=1)])
    first_axis = perpendicular / np.linalg.norm(perpendicular, axis=1, keepdims=True)
    second_axis = np.cross(boxes.axis, first_axis)
    ends = uncut.F.ravel(), np.roll(uncut.F, -1, axis=1).ravel()
    for box, h in _rims(uncut, boxes, accepted):
        flat = []
        for end in ends:
            arm = uncut.V.take(end[h], axis=0) - boxes.middle.take(box, axis=0)
            flat.append(tuple(np.einsum("ki,ki->k", arm, axis.take(box, axis=0)) for axis in (first_axis, second_axis)))
        (ax, ay), (bx, by) = flat
        ux, uy = bx - ax, by - ay
        t = np.clip(-(ax * ux + ay * uy) / np.maximum(ux**2 + uy**2, np.finfo(float).tiny), 0, 1)
        distance = np.hypot(ax + t * ux, ay + t * uy) - np.maximum(thick[ends[0][h]], thick[ends[1][h]])
        accepted[box[distance <= boxes.radius[box]]] = False
        moment = ax * by - ay * bx
        turn = ((ay < 0) & (by >= 0) & (moment > 0)).astype(np.int64) - ((by < 0) & (ay >= 0) & (moment < 0))
        turns += np.bincount(box, turn, len(turns)).astype(np.int64)
    return np.asarray(accepted & (turns == 1))


def _rims(uncut: Surface, boxes: Boxes, accepted: Bools) -> list[tuple[Ints, Ints]]:
    pairs = uncut.edges.pairs
    h, g = np.concatenate([pairs, pairs[:, ::-1]]).T
    box_here, beyond = boxes.of[h // 3], boxes.of[g // 3]
    crosses = box_here != beyond
    h, box_here, beyond = h[crosses], box_here[crosses], beyond[crosses]
    moved = boxes.place[beyond] - boxes.place[box_here]
    span = 2 * np.abs(moved).max(initial=0) + 1
    order, begins, step_index = equal_key_groups((moved + span // 2) @ np.array([span**2, span, 1]))
    moves, batches = moved[order[begins]], []

    def collect(h: Ints, step: Ints) -> None:
        box = boxes.neighbours(boxes.of[h // 3], step)
        in_block = (box >= 0) & accepted[box]
        batches.append((box[in_block], h[in_block]))

    for k, d in enumerate(moves):
        half_edges = h[step_index == k]
        for step in block_steps():
            if np.abs(step - d).max() > REACH:
                collect(half_edges, step)
    rim = uncut.edges.outline
    for step in block_steps() if len(rim) else ():
        collect(rim, step)
    box, edge = (np.concatenate(column) for column in zip(*batches, strict=True)) if batches else (h[:0], h[:0])
    return [(box[k : k + 4 * CHUNK], edge[k : k + 4 * CHUNK]) for k in range(0, len(box), 4 * CHUNK)]


def proven_cells(layer: OffsetLayer) -> Bools:
    """Return a mask (m',) of the cells: True if the thickened cell certainly meets no second thickened cell."""
    cells, uncut = layer.cells, layer.uncut
    if len(misoriented_edges(uncut.F, uncut.edges)):
        return np.zeros(cells.m, dtype=bool)
    error = 1e-13 * float(np.abs(uncut.V).max() + np.abs(layer.D).max())
    if is_fine(uncut.V, layer.D):
        error += rounding_step(uncut.V, layer.D)
    sure = np.zeros(cells.m, dtype=bool)
    for count in (1000, 8000):  # with more boxes, more cells are proved free of intersections
        boxes = boxes_of(layer, error, count)
        folded, cosine, reach = prisms(layer, boxes, error)
        if folded.mean() > 0.05:
            return sure
        simple = boxes_with_simple_rims(layer, boxes, boxes_seen_from_front(boxes, cosine), error)
        sure |= simple[boxes.of[layer.parent]]
        if sure.all():
            break
    if folded.any():
        sure &= ~_cells_near_folds(layer, folded, reach)
    return sure


def _cells_near_folds(layer: OffsetLayer, folded: Bools, reach: Floats) -> Bools:
    middle = layer.cells.centroids + layer.shift * layer.carried[layer.cells.F].mean(axis=1)
    bad = np.flatnonzero(folded)
    size = 2.1 * reach  # a sphere of radius `reach` around `middle` contains the prism of a cell
    lists = cKDTree(middle).query_ball_point(middle[bad], size[bad] + size.max())
    result = np.zeros(len(folded), dtype=bool)
    result[np.concatenate([np.asarray(row, dtype=np.int64) for row in lists])] = True
    return result
