"""`apart`: the proof for all cells."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints, grouped, lengths
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import misoriented_edges
from dsfab.thickening.rounding import is_fine, rounding_step
from dsfab.thickening.separation_proof.boxes import REACH, Boxes, boxes_of, steps
from dsfab.thickening.separation_proof.layer import OffsetLayer
from dsfab.thickening.separation_proof.prisms import CHUNK, prisms


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
    """(k,) boxes, of the good ones (k,), around whose cylinder the rim of the block runs once, outside."""
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
        for step in steps():
            if np.abs(step - d).max() > REACH:
                collect(mine, step)
    rim = uncut.edges.order[uncut.edges.start[:-1][uncut.edges.boundary]]
    for step in steps() if len(rim) else ():
        collect(rim, step)
    box, edge = (np.concatenate(column) for column in zip(*found, strict=True)) if found else (h[:0], h[:0])
    return [(box[k : k + 4 * CHUNK], edge[k : k + 4 * CHUNK]) for k in range(0, len(box), 4 * CHUNK)]


BOXES = (1000, 8000)
"""About how many boxes a surface is divided into, where its faces and its thickness are small enough; the second number
only where the first leaves something open."""

ROUNDING = 1e-13
"""Share of the largest coordinate by which computed places are off, at most."""

MOST_BAD = 0.05
"""With a larger share of folded prisms nothing is proven."""


def apart(layer: OffsetLayer) -> Bools:
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
        boxes = boxes_of(layer, off, count)
        folded, cosine, reach = prisms(layer, boxes, off)
        if folded.mean() > MOST_BAD:
            return sure
        good = once_around(layer, boxes, fronts(boxes, cosine), off)
        sure |= good[boxes.of[layer.parent]]
        if sure.all():
            break
    if folded.any():
        sure &= ~_near(layer, folded, reach)
    return sure


def _near(layer: OffsetLayer, folded: Bools, reach: Floats) -> Bools:
    """(m',) cells whose prisms may come near a folded one."""
    middle = layer.cells.centroids + layer.shift * layer.carried[layer.cells.F].mean(axis=1)
    bad = np.flatnonzero(folded)
    size = 2.1 * reach  # around the mean of the middle layer, which the mean of the corners is
    lists = cKDTree(middle).query_ball_point(middle[bad], size[bad] + size.max())
    near = np.zeros(len(folded), dtype=bool)
    near[np.concatenate([np.asarray(found, dtype=np.int64) for found in lists])] = True
    return near
