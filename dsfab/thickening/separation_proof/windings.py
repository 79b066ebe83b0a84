"""How often the rim of a block of faces winds around the box in its middle."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, grouped, lengths
from dsfab.surface.mesh import Surface
from dsfab.thickening.separation_proof.boxes import REACH, Boxes, steps
from dsfab.thickening.separation_proof.layer import OffsetLayer
from dsfab.thickening.separation_proof.prisms import CHUNK


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
