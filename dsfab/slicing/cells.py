"""`Cells`: convex polygons on shared vertices.

The corners of all polygons lie in one array, counter-clockwise; slot s of it also names the side from corner s to the
next corner of the same polygon:

    start  = [0, 4, 7]                d --- c
    corner = [a b c d | b e c]        |     | \\        side 1 : b -> c of polygon 0
              0 1 2 3   4 5 6         |     |   e      side 6 : c -> b of polygon 1
    following = [1 2 3 0 5 6 4]       a --- b /
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Bools, Floats, Ints

CHUNK = 1 << 13
"""Polygons measured together: as many as the processor's cache takes."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Polygons as (c + 1,) `start` and (h,) `corner`: polygon i has the corners corner[start[i] : start[i + 1]]."""

    start: Ints
    corner: Ints

    @classmethod
    def triangles(cls, F: Ints) -> "Cells":
        """The faces F (m, 3) as polygons."""
        return cls(np.arange(0, 3 * len(F) + 1, 3), F.ravel())

    @cached_property
    def sizes(self) -> Ints:
        """(c,) number of corners."""
        return np.diff(self.start)

    @cached_property
    def owner(self) -> Ints:
        """(h,) the polygon of each slot."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def following(self) -> Ints:
        """(h,) the next slot around the same polygon."""
        slot = np.arange(1, len(self.corner) + 1)
        slot[self.start[1:] - 1] = self.start[:-1]
        return slot

    def ahead(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (h,) on the slots, seen from the slot before: those of the next one around the same polygon."""
        result: NDArray[Any] = np.empty_like(values)
        result[:-1] = values[1:]
        result[self.start[1:] - 1] = values[self.start[:-1]]
        return result

    def reduced(self, ufunc: np.ufunc, values: NDArray[Any]) -> NDArray[Any]:
        """(c,) the values (h,) on the slots of each polygon brought together by `ufunc`."""
        if len(values) == 3 * len(self.sizes):  # triangles only
            a, b, c = values.reshape(-1, 3).T
            return np.asarray(ufunc(ufunc(a, b), c))
        return ufunc.reduceat(values, self.start[:-1])

    def sides(self, active: Bools) -> tuple[Ints, Ints]:
        """First and last vertex (s,) of every side of the active polygons (c,)."""
        a, b = self.corner, self.ahead(self.corner)
        if active.all():
            return a, b
        on = np.flatnonzero(active[self.owner])
        return a[on], b[on]

    def slots(self, which: Ints) -> Ints:
        """The slots of the polygons (k,) of this list, polygon by polygon."""
        sizes = self.sizes[which]
        ends = np.cumsum(sizes)
        return np.asarray(np.repeat(self.start[which] - (ends - sizes), sizes) + np.arange(int(sizes.sum())))

    def some(self, which: Ints) -> "Cells":
        """The polygons (k,) of this list alone."""
        return Cells(np.concatenate([[0], np.cumsum(self.sizes[which])]), self.corner[self.slots(which)])

    def _run(self, begin: int, end: int) -> "Cells":
        start = self.start[begin : end + 1]
        return Cells(start - start[0], self.corner[start[0] : start[-1]])

    def areas(self, X: Floats) -> tuple[Floats, Floats]:
        """(c,) areas of the polygons, and (c,) the squared distance of the farthest corner from the first."""
        if len(self.sizes) > CHUNK:
            parts = [self._run(k, k + CHUNK).areas(X) for k in range(0, len(self.sizes), CHUNK)]
            area, reach = (np.concatenate(column) for column in zip(*parts, strict=True))
            return area, reach
        base = np.repeat(self.corner[self.start[:-1]], self.sizes)
        spoke = (X.take(self.corner, axis=0) - X.take(base, axis=0)).T
        x, y, z = spoke
        u, v, w = (self.ahead(column) for column in spoke)
        twice = [np.add.reduceat(part, self.start[:-1]) for part in (y * w - z * v, z * u - x * w, x * v - y * u)]
        reach = np.maximum.reduceat(x * x + y * y + z * z, self.start[:-1])
        return 0.5 * np.sqrt(twice[0] ** 2 + twice[1] ** 2 + twice[2] ** 2), reach
