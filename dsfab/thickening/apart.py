"""A proof, without looking at pairs, that most of a thickened sheet cannot meet itself.

All cells of a cut surface are thickened together, void ones too. Where the prism over every cell can be seen whole from
its middle, whichever way the diagonals of its sides run, the prisms fill space without a fold, and a point is covered
as often as the boundary of the thickened surface winds around it. In a cylinder along a direction that all faces near
by look to that number is counted on the rim of a block of faces around the cylinder:

    . . rim . . . .          Skins seen from the front wind around the cylinder as often as their rim does. Once:
    .   +-----+   .          each point of the cylinder lies below the upper skin and above the lower one at most
    .   | box |   .          once. So the prisms in the box meet no other ones of the block but in the sides they share,
    .   +-----+   .          and no other prism reaches the box at all.
    . . . . . . . .

What is proven needs no test of pairs, whatever part of the cells is kept. The rest is for `intersecting_pairs`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, grouped
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening.offset import SHIFT, Side
from dsfab.thickening.rounding import is_fine, rounding_step

BOXES = (1000, 8000)
"""About how many boxes a surface is divided into, where its faces and its thickness are small enough; the second number
only where the first leaves something open."""
REACH = 2
"""A block is a box and this many boxes around it on each side."""
CHUNK = 1 << 15
"""Cells looked at together: as many as the processor's cache takes."""
ROUNDING = 1e-13
"""Share of the largest coordinate by which computed places are off, at most."""
MOST_BAD = 0.05
"""With a larger share of folded prisms nothing is proven."""
MOST_BOXES = 2e7
"""Of the grid, empty ones too."""

Three = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class Layer:
    """A thickened surface before anything is removed.

    uncut  : an edge-manifold surface, faces consistently oriented, with half-thickness vectors D (n, 3), metres.
    cells  : the same surface cut, all of it, with vectors `carried` (n', 3), and the face (m',) each cell lies in.
    side   : as in `thicken`.
    """

    uncut: Surface
    D: Floats
    cells: Surface
    carried: Floats
    parent: Ints
    side: Side = "mid"

    @property
    def shift(self) -> int:
        """By how many D the middle lies off the surface."""
        return SHIFT[self.side]


@dataclass(frozen=True, eq=False)
class _Boxes:
    """The box of each face (m,), and of each of k boxes: place in the grid (k, 3), middle, direction, radius.

    grid : the box at each place, -1 where there is none, with a border of `REACH` empty ones.
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
        """The box at a step (3,) from each of the given ones, -1 where there is none."""
        _, ny, nz = self.grid.shape
        return np.asarray(self.grid.ravel()[self.key[box] + (step[0] * ny + step[1]) * nz + step[2]])


def apart(layer: Layer) -> Bools:
    """(m',) cells whose prism surely meets no other one, however its sides are divided by diagonals.

    This holds for the vertices as they are and as files of single precision hold them (where `is_fine`).
    """
    cells, uncut = layer.cells, layer.uncut
    if len(misoriented_edges(uncut.F, uncut.edges)):
        return np.zeros(cells.m, dtype=bool)
    off = ROUNDING * float(np.abs(uncut.V).max() + np.abs(layer.D).max())
    if is_fine(uncut.V, layer.D):
        off += rounding_step(uncut.V, layer.D)
    sure = np.zeros(cells.m, dtype=bool)
    for count in BOXES:
        boxes = _boxes(layer, off, count)
        folded, cosine, reach = _prisms(layer, boxes, off)
        if folded.mean() > MOST_BAD:
            return sure
        good = _windings(layer, boxes, _fronts(boxes, cosine), off)
        sure |= good[boxes.of[layer.parent]]
        if sure.all():
            break
    if folded.any():
        sure &= ~_near(layer, folded, reach)
    return sure


def _boxes(layer: Layer, off: float, count: int) -> _Boxes:
    """The faces of the uncut surface in boxes that are larger than any prism."""
    uncut = layer.uncut
    middle = uncut.V[uncut.F].mean(axis=1)
    size = np.linalg.norm(layer.D, axis=1) * (1 + abs(layer.shift))
    reach = (np.linalg.norm(uncut.V[uncut.F] - middle[:, None], axis=2) + size[uncut.F]).max(axis=1) + off
    low, extent = middle.min(axis=0), np.ptp(middle, axis=0)
    least = (uncut.area / count) ** 0.5, (extent.prod() / MOST_BOXES) ** (1 / 3), extent.max() / MOST_BOXES**0.4
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
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    radius = np.zeros(len(key))
    np.maximum.at(radius, of, np.linalg.norm(middle - centre[of], axis=1) + reach)
    at = np.stack(np.unravel_index(key, tuple(shape)), axis=1)
    return _Boxes(of, at, centre, axis, radius, grid, key)


def _prisms(layer: Layer, boxes: _Boxes, off: float) -> tuple[Bools, Floats, Floats]:
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
        folded[part], cosine[part], reach[part] = _prism(upper[:, corner], lower[:, corner], axes[:, box[part]], off)
    least = np.ones(len(boxes.axis))
    np.minimum.at(least, box, cosine)
    return folded, least, reach


def _prism(upper: Floats, lower: Floats, axis: Floats, off: float) -> tuple[Bools, Floats, Floats]:
    """Of prisms with corners (3 xyz, 3, m): folded or not, the least cosine of their skins to an axis, their reach.

    They hold for corners that are off by up to `off`: a determinant of three vectors up to r long is off by 3 r^2 off,
    and the normal of a triangle of sides up to s by 4 s off.
    """
    middle = (upper.sum(axis=1) + lower.sum(axis=1)) / 6
    A, B = lower - middle[:, None], upper - middle[:, None]
    reach = np.sqrt(np.maximum((A**2).sum(axis=0), (B**2).sum(axis=0)).max(axis=0)) + off
    bottom, top = _cross(A[:, 2] - A[:, 0], A[:, 1] - A[:, 0]), _cross(B[:, 1] - B[:, 0], B[:, 2] - B[:, 0])
    least = np.minimum(_dot(bottom, A[:, 0]), _dot(top, B[:, 0]))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        under, over = _cross(A[:, i], A[:, j]), _cross(B[:, j], B[:, i])
        for side, point in ((under, B[:, j]), (under, B[:, i]), (over, A[:, i]), (over, A[:, j])):
            np.minimum(least, _dot(side, point), out=least)
    cosines = []
    for normal, skin, sign in ((top, B, 1), (bottom, A, -1)):
        length = np.maximum(np.sqrt(_dot(normal, normal)), np.finfo(float).tiny)
        side = np.sqrt(((skin - np.roll(skin, 1, axis=1)) ** 2).sum(axis=0).max(axis=0)) + 2 * off
        tilt = 5 * off * side / length
        cosines.append(np.where(tilt < 0.5, sign * _dot(normal, axis) / length - 2 * tilt, -1.0))
    return least <= 4 * off * reach**2, np.minimum(*cosines), reach


def _fronts(boxes: _Boxes, cosine: Floats) -> Bools:
    """(k,) boxes whose axis sees all skins of their block from the front."""
    spread = np.arccos(np.clip(cosine, -1, 1))
    good = spread < np.pi / 2
    every = np.arange(len(good))
    for step in _steps():
        other = boxes.near(every, step)
        there = np.flatnonzero(other >= 0)
        seen = np.einsum("ki,ki->k", boxes.axis[there], boxes.axis[other[there]])
        good[there] &= np.arccos(np.clip(seen, -1, 1)) + spread[other[there]] < np.pi / 2 - 1e-6
    return good


def _windings(layer: Layer, boxes: _Boxes, good: Bools, off: float) -> Bools:
    """(k,) boxes, of the good ones (k,), around whose cylinder the rim of the block runs once, outside."""
    uncut = layer.uncut
    thick = np.linalg.norm(layer.D, axis=1) * (1 + abs(layer.shift)) + off
    good, turns = good.copy(), np.zeros(len(boxes.axis), dtype=np.int64)
    other = np.cross(boxes.axis, np.eye(3)[np.abs(boxes.axis).argmin(axis=1)])
    first = other / np.linalg.norm(other, axis=1, keepdims=True)
    second = np.cross(boxes.axis, first)
    ends = uncut.F.ravel(), np.roll(uncut.F, -1, axis=1).ravel()
    for box, h in _rims(uncut, boxes, good):
        flat = []
        for end in ends:
            arm = uncut.V[end[h]] - boxes.middle[box]
            flat.append((np.einsum("ki,ki->k", arm, first[box]), np.einsum("ki,ki->k", arm, second[box])))
        (ax, ay), (bx, by) = flat
        ux, uy = bx - ax, by - ay
        t = np.clip(-(ax * ux + ay * uy) / np.maximum(ux**2 + uy**2, np.finfo(float).tiny), 0, 1)
        distance = np.hypot(ax + t * ux, ay + t * uy) - np.maximum(thick[ends[0][h]], thick[ends[1][h]])
        good[box[distance <= boxes.radius[box]]] = False
        left = ax * by - ay * bx
        turn = ((ay < 0) & (by >= 0) & (left > 0)).astype(np.int64) - ((by < 0) & (ay >= 0) & (left < 0))
        turns += np.bincount(box, turn, len(turns)).astype(np.int64)
    return np.asarray(good & (turns == 1))


def _rims(uncut: Surface, boxes: _Boxes, good: Bools) -> list[tuple[Ints, Ints]]:
    """Pairs of a good box and a half-edge on the rim of its block: its face lies in it, the one beyond does not."""
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
        for step in _steps():
            if np.abs(step - d).max() > REACH:
                collect(mine, step)
    rim = uncut.edges.order[uncut.edges.start[:-1][uncut.edges.boundary]]
    for step in _steps() if len(rim) else ():
        collect(rim, step)
    box, edge = (np.concatenate(column) for column in zip(*found, strict=True)) if found else (h[:0], h[:0])
    return [(box[k : k + 4 * CHUNK], edge[k : k + 4 * CHUNK]) for k in range(0, len(box), 4 * CHUNK)]


def _steps() -> list[Ints]:
    """All steps to the boxes of a block, (3,) each."""
    along = np.arange(-REACH, REACH + 1)
    return list(np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3))


def _near(layer: Layer, folded: Bools, reach: Floats) -> Bools:
    """(m',) cells whose prisms may come near a folded one."""
    middle = layer.cells.centroids + layer.shift * layer.carried[layer.cells.F].mean(axis=1)
    bad = np.flatnonzero(folded)
    size = 2.1 * reach  # around the mean of the middle layer, which the mean of the corners is
    lists = cKDTree(middle).query_ball_point(middle[bad], size[bad] + size.max())
    near = np.zeros(len(folded), dtype=bool)
    near[np.concatenate([np.asarray(found, dtype=np.int64) for found in lists])] = True
    return near


def _cross(a: Floats, b: Floats) -> Three:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Three, b: Floats | Three) -> Floats:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
