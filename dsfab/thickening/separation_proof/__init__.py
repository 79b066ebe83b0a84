"""Proof, without a test of pairs, that most of a thickened sheet cannot intersect itself.

The surface is divided into boxes; boxes around a box are its block. The prisms of a box meet no others under two
conditions. The box's axis sees all skins of the block from the front. The rim of the block runs once around the box's
cylinder, outside it. Then the prisms project along the axis without overlap.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, grouped, lengths, unit_vectors
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening.offset_vectors import SHIFT, Side
from dsfab.thickening.skin import is_fine, rounding_step


@dataclass(frozen=True, eq=False)
class OffsetLayer:
    """A thickened surface before anything is removed.

    uncut  : an edge-manifold surface, faces consistently oriented, with half-thickness vectors D (n, 3), metres.
    cells  : the same surface cut, all of it, with interpolated vectors `carried` (n', 3).
    parent : (m',) the face of each cell.    side : as in `thicken`.
    """

    uncut: Surface
    D: Floats
    cells: Surface
    carried: Floats
    parent: Ints
    side: Side = "mid"

    @property
    def shift(self) -> int:
        """Distance of the middle from the surface, in D."""
        return SHIFT[self.side]


REACH = 2
"""A block is a box and this many boxes around it on each side."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """The box of each face (m,), and of each of k boxes: place in the grid (k, 3), middle, direction, radius.

    grid : the box at each place, -1 without faces, with a border of `REACH` empty ones.
    key  : (k,) the place in the flat grid.
    """

    of: Ints
    place: Ints
    middle: Floats
    axis: Floats
    radius: Floats
    grid: Ints
    key: Ints

    def near(self, box: Ints, step: Ints) -> Ints:
        """Return the boxes at a step (3,) from boxes (k,), -1 for missing ones."""
        _, ny, nz = self.grid.shape
        return np.asarray(self.grid.ravel()[self.key[box] + (step[0] * ny + step[1]) * nz + step[2]])


def boxes_of(layer: OffsetLayer, off: float, count: int) -> Boxes:
    """Sort the faces of the uncut surface into about `count` boxes, all larger than any prism."""
    uncut = layer.uncut
    middle = uncut.centroids
    size = lengths(layer.D) * (1 + abs(layer.shift))
    reach = np.zeros(uncut.m)
    for corner in uncut.F.T:
        arm = lengths(uncut.V.take(corner, axis=0) - middle)
        np.maximum(reach, arm + size[corner] + off, out=reach)
    low, extent = (np.array([of(column) for column in middle.T]) for of in (np.min, np.ptp))
    box_limit = 2e7  # boxes of the grid, empty ones too
    least = (uncut.area / count) ** 0.5, (extent.prod() / box_limit) ** (1 / 3), extent.max() / box_limit**0.4
    width = max(2.1 * reach.max(), *least)
    place = np.floor((middle - low) / width).astype(np.int64) + REACH
    shape = place.max(axis=0) + REACH + 1
    flat = np.ravel_multi_index(tuple(place.T), tuple(shape))
    order, begins, of = grouped(flat)
    key = flat[order[begins]]
    grid = np.full(shape, -1)
    grid.ravel()[key] = np.arange(len(key))
    centre: Floats = np.stack([np.bincount(of, column) for column in middle.T], axis=1) / np.bincount(of)[:, None]
    axis: Floats = np.stack([np.bincount(of, column) for column in uncut.normals.T], axis=1).astype(np.float64)
    axis = unit_vectors(axis)
    radius = np.zeros(len(key))
    np.maximum.at(radius, of, lengths(middle - centre.take(of, axis=0)) + reach)
    at = np.stack(np.unravel_index(key, tuple(shape)), axis=1)
    return Boxes(of, at, centre, axis, radius, grid, key)


def steps() -> list[Ints]:
    """Return all steps to the boxes of a block, (3,) each."""
    along = np.arange(-REACH, REACH + 1)
    return list(np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3))


CHUNK = 1 << 14
"""Cells processed together: this many fit the processor's cache."""

Three = tuple[Floats, Floats, Floats]


def prisms(layer: OffsetLayer, boxes: Boxes, off: float) -> tuple[Bools, Floats, Floats]:
    """(m',) prisms that may be folded; (k,) the least cosine between skins and axis in each box; (m',) the reach."""
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
        folded[part], cosine[part], reach[part] = _prism(over, under, axis, off)
    least = np.ones(len(boxes.axis))
    np.minimum.at(least, box, cosine)
    return folded, least, reach


def _prism(upper: Floats, lower: Floats, axis: Floats, off: float) -> tuple[Bools, Floats, Floats]:
    """For prisms with corners (3 xyz, 3, m): mask of the folded ones, least cosine of their skins to an axis, reach.

    Valid for corners with errors up to e. A determinant of three vectors up to r long has an error of 3 r^2 e. The
    normal of a triangle with sides up to s has one of 4 s e.
    """
    middle = (upper.sum(axis=1) + lower.sum(axis=1)) / 6
    A, B = lower - middle[:, None], upper - middle[:, None]
    reach = np.sqrt(np.maximum((A**2).sum(axis=0), (B**2).sum(axis=0)).max(axis=0)) + off
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
        side = np.sqrt(np.maximum.reduce([_dot(s, s) for s in sides])) + 2 * off
        tilt = 5 * off * side / length
        cosines.append(np.where(tilt < 0.5, sign * _dot(normal, axis) / length - 2 * tilt, -1.0))
    return least <= 4 * off * reach**2, np.minimum(*cosines), reach


def _cross(a: Floats, b: Floats) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Three, b: Floats | Three) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def fronts(boxes: Boxes, cosine: Floats) -> Bools:
    """(k,) boxes whose axis sees all skins of their block from the front."""
    spread = np.arccos(np.clip(cosine, -1, 1))
    good = spread < np.pi / 2
    every = np.arange(len(good))
    for step in steps():
        other = boxes.near(every, step)
        there = np.flatnonzero(other >= 0)
        seen = np.einsum("ki,ki->k", boxes.axis[there], boxes.axis[other[there]])
        good[there] &= np.arccos(np.clip(seen, -1, 1)) + spread[other[there]] < np.pi / 2 - 1e-6
    return good


def once_around(layer: OffsetLayer, boxes: Boxes, good: Bools, off: float) -> Bools:
    """(k,) boxes, of the accepted ones (k,), around whose cylinder the rim of the block runs once, outside."""
    uncut = layer.uncut
    thick = lengths(layer.D) * (1 + abs(layer.shift)) + off
    good, turns = good.copy(), np.zeros(len(boxes.axis), dtype=np.int64)
    other = np.cross(boxes.axis, np.eye(3)[np.abs(boxes.axis).argmin(axis=1)])
    first = other / np.linalg.norm(other, axis=1, keepdims=True)
    second = np.cross(boxes.axis, first)
    ends = uncut.F.ravel(), np.roll(uncut.F, -1, axis=1).ravel()
    for box, h in _rims(uncut, boxes, good):
        flat = []
        for end in ends:
            arm = uncut.V.take(end[h], axis=0) - boxes.middle.take(box, axis=0)
            flat.append(tuple(np.einsum("ki,ki->k", arm, axis.take(box, axis=0)) for axis in (first, second)))
        (ax, ay), (bx, by) = flat
        ux, uy = bx - ax, by - ay
        t = np.clip(-(ax * ux + ay * uy) / np.maximum(ux**2 + uy**2, np.finfo(float).tiny), 0, 1)
        distance = np.hypot(ax + t * ux, ay + t * uy) - np.maximum(thick[ends[0][h]], thick[ends[1][h]])
        good[box[distance <= boxes.radius[box]]] = False
        left = ax * by - ay * bx
        turn = ((ay < 0) & (by >= 0) & (left > 0)).astype(np.int64) - ((by < 0) & (ay >= 0) & (left < 0))
        turns += np.bincount(box, turn, len(turns)).astype(np.int64)
    return np.asarray(good & (turns == 1))


def _rims(uncut: Surface, boxes: Boxes, good: Bools) -> list[tuple[Ints, Ints]]:
    """Pairs of an accepted box and a half-edge on the rim of its block, whose face is inside the block."""
    pairs = uncut.edges.pairs
    h, g = np.concatenate([pairs, pairs[:, ::-1]]).T
    here, beyond = boxes.of[h // 3], boxes.of[g // 3]
    crosses = here != beyond
    h, here, beyond = h[crosses], here[crosses], beyond[crosses]
    moved = boxes.place[beyond] - boxes.place[here]
    span = 2 * np.abs(moved).max(initial=0) + 1
    order, begins, way = grouped((moved + span // 2) @ np.array([span**2, span, 1]))
    ways, found = moved[order[begins]], []

    def collect(h: Ints, step: Ints) -> None:
        box = boxes.near(boxes.of[h // 3], step)
        here = (box >= 0) & good[box]
        found.append((box[here], h[here]))

    for k, d in enumerate(ways):
        mine = h[way == k]
        for step in steps():
            if np.abs(step - d).max() > REACH:
                collect(mine, step)
    rim = uncut.edges.order[uncut.edges.start[:-1][uncut.edges.boundary]]
    for step in steps() if len(rim) else ():
        collect(rim, step)
    box, edge = (np.concatenate(column) for column in zip(*found, strict=True)) if found else (h[:0], h[:0])
    return [(box[k : k + 4 * CHUNK], edge[k : k + 4 * CHUNK]) for k in range(0, len(box), 4 * CHUNK)]


def apart(layer: OffsetLayer) -> Bools:
    """(m',) cells whose prism surely meets no other one, for any diagonals of its sides.

    This holds for the vertices as they are and as files of single precision hold them (if `is_fine`). With more than 5
    % folded prisms nothing is proven.
    """
    cells, uncut = layer.cells, layer.uncut
    if len(misoriented_edges(uncut.F, uncut.edges)):
        return np.zeros(cells.m, dtype=bool)
    off = 1e-13 * float(np.abs(uncut.V).max() + np.abs(layer.D).max())
    if is_fine(uncut.V, layer.D):
        off += rounding_step(uncut.V, layer.D)
    sure = np.zeros(cells.m, dtype=bool)
    for count in (1000, 8000):  # the finer grid only where the first leaves cells open
        boxes = boxes_of(layer, off, count)
        folded, cosine, reach = prisms(layer, boxes, off)
        if folded.mean() > 0.05:
            return sure
        good = once_around(layer, boxes, fronts(boxes, cosine), off)
        sure |= good[boxes.of[layer.parent]]
        if sure.all():
            break
    if folded.any():
        sure &= ~_near(layer, folded, reach)
    return sure


def _near(layer: OffsetLayer, folded: Bools, reach: Floats) -> Bools:
    middle = layer.cells.centroids + layer.shift * layer.carried[layer.cells.F].mean(axis=1)
    bad = np.flatnonzero(folded)
    size = 2.1 * reach  # around the mean of the middle layer, which the mean of the corners is
    lists = cKDTree(middle).query_ball_point(middle[bad], size[bad] + size.max())
    near = np.zeros(len(folded), dtype=bool)
    near[np.concatenate([np.asarray(found, dtype=np.int64) for found in lists])] = True
    return near
