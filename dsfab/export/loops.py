"""The outlines of regions of triangles, as loops of half-edges with the region on their left."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Ints


@dataclass(frozen=True, eq=False)
class Outline:
    """Loops of vertices: loop i has the half-edges h[start[i] : start[i + 1]], each leaving its vertex."""

    h: Ints
    start: Ints

    @property
    def loop(self) -> Ints:
        """(h,) the loop that each half-edge is of."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    @property
    def next(self) -> Ints:
        """(h,) position of the next half-edge of the same loop."""
        onward = np.arange(1, len(self.h) + 1)
        onward[self.start[1:] - 1] = self.start[:-1]
        return onward


def outline_of(region: Ints, other: Ints) -> Outline:
    """The half-edges between different regions (m,), chained with their region on the left; other: (3 m,) the
    opposite ones.

    After a half-edge, the next one is found by turning about its end through triangles of the same region: loops never
    jump across a vertex where a region touches itself.
    """
    kept = region[np.arange(len(other)) // 3] != region[other // 3]
    onward = np.arange(len(other))
    onward += np.where(onward % 3 == 2, -2, 1)
    follow = onward.copy()
    turning = np.flatnonzero(kept)  # about a vertex inside a region one would turn for ever
    while len(turning := turning[~kept[onward[turning]]]):
        onward[turning] = follow[other[onward[turning]]]
    step, passed = onward.tolist(), bytearray(len(other))
    h, start = list[int](), [0]
    for at in np.flatnonzero(kept).tolist():
        while not passed[at]:
            passed[at] = True
            h.append(at)
            at = step[at]
        if len(h) > start[-1]:
            start.append(len(h))
    return Outline(np.array(h, dtype=np.int64), np.array(start))


def simple(outline: Outline, F: Ints) -> Outline:
    """The loops of faces F (m, 3) cut where they come back to a vertex, so that none touches itself."""
    vertex = F.ravel()[outline.h]
    visits = np.sort(outline.loop * (int(F.max()) + 1) + vertex)
    touching = set((visits[1:][visits[1:] == visits[:-1]] // (int(F.max()) + 1)).tolist())
    if not touching:
        return outline
    loops: list[list[int]] = []
    for i, (begin, end) in enumerate(zip(outline.start[:-1], outline.start[1:], strict=True)):
        h = outline.h[begin:end].tolist()
        loops.extend(cut_apart(h, vertex[begin:end].tolist()) if i in touching else [h])
    return Outline(np.concatenate([np.array(loop) for loop in loops]), np.cumsum([0, *map(len, loops)]))


def cut_apart(h: list[int], vertices: list[int]) -> list[list[int]]:
    """One loop of half-edges h, with the vertices they leave, as loops that visit each vertex once."""
    loops, path, place = [], list[int](), dict[int, int]()
    visited: list[int] = []
    for half_edge, vertex in zip(h, vertices, strict=True):
        if vertex in place:
            begin = place[vertex]
            loops.append(path[begin:])
            for v in visited[begin:]:
                del place[v]
            del path[begin:], visited[begin:]
        place[vertex] = len(path)
        path.append(half_edge)
        visited.append(vertex)
    return [*loops, path]


def ends_of_runs(alive: Bools, outline: Outline) -> tuple[Ints, Ints]:
    """(h,) for each position, the last corner (alive, (h,)) of its loop at or before it, and the first corner after
    it."""
    at = np.flatnonzero(alive)
    loop = outline.loop
    first = np.searchsorted(at, outline.start[:-1])
    last = np.searchsorted(at, outline.start[1:]) - 1
    rank = np.searchsorted(at, np.arange(len(alive)), side="right") - 1
    run = np.where(rank >= first[loop], rank, last[loop])
    end = np.where(rank + 1 <= last[loop], rank + 1, first[loop])
    return at[run], at[end]


def positions(start: Ints, loops: Ints) -> tuple[Ints, Ints]:
    """(p,) the positions of all steps of some loops (k,), loop after loop, and for each of them which of `loops` it
    is of."""
    length = np.diff(start)[loops]
    loop = np.repeat(np.arange(len(loops)), length)
    return (start[loops] - np.cumsum(length) + length)[loop] + np.arange(len(loop)), loop
