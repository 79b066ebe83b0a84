"""Chords between places of an outline, inside of it and clear of it, the best ones to divide a region at first."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.network.curves import parts_of
from dsfab.export.network.graph import Loop
from dsfab.export.network.model import NetModel
from dsfab.export.network.trimmed import axes_of, middle_normal
from dsfab.export.splines import bernstein

CLEAR = 0.3
"""Distance of each point of a chord from the outline over that from the chord's nearer end, at least: the sine of the
angle there, and no other edge is nearer."""

WIDE = 1 / 20
"""Mean width of what a chord cuts off, as a share of the thickness, at least: of a lens of two edges, 1.6 mm long and
.2 wide beside an edge that wiggles, OCCT draws no triangles."""

BESIDE = np.linspace(0, 1, 17)[1:-1]
"""Shares of a chord where that is asked."""

TRIED = 24
"""Chords that are tried, half of them from where the gap is widest."""

POINTS = 8
"""Of the outline along half an edge."""


@dataclass(frozen=True, eq=False)
class HalvedOutline:
    """A region's outline in halves of its edges; a place is where one begins.

    poles : (2 e, 4, 6) cubics in a row, two for each step of the loop.
    """

    poles: Floats

    @classmethod
    def of(cls, model: NetModel, loop: Loop) -> "HalvedOutline":
        """Of e steps."""
        whole = np.stack([model.poles(step) for step in loop])
        start, end = np.tile([0.0, 0.5], len(loop)), np.tile([0.5, 1.0], len(loop))
        poles = parts_of(np.repeat(whole, 2, axis=0), start, end)
        poles[::2, 0], poles[1::2, 3] = whole[:, 0], whole[:, 3]
        return cls(poles)

    @cached_property
    def line(self) -> Floats:
        """(2 e POINTS, 6) points along it, the first of them at its first place."""
        return np.asarray(bernstein(np.arange(POINTS) / POINTS) @ self.poles).reshape(-1, 6)

    def part(self, a: int, b: int, seam: Floats) -> Floats:
        """(k, 6) the closed line along it from place a to place b, and back along the cubics (c, 4, 6) of a seam from a
        to b."""
        turned = np.roll(self.line, -a * POINTS, axis=0)[: (b - a) % len(self.poles) * POINTS]
        back = bernstein(1 - np.arange(2 * POINTS) / (2 * POINTS)) @ seam[::-1]
        return np.concatenate([turned, back.reshape(-1, 6)])

    def chords(self, worst: Ints, times: int = 1) -> Iterator[tuple[int, int]]:
        """Pairs of places, ascending, between which a chord is inside and clear: those that are short for the smaller
        area that they cut off first, once of those from the worst places (k,), and once of all others; so many times
        `TRIED`."""
        axes = axes_of(middle_normal(self.line))
        line, at = self.line[:, :3] @ axes[:2].T, self.poles[:, 0, :3] @ axes[:2].T
        i, j = np.triu_indices(len(at), 1)
        area = np.append(0.0, np.cumsum(_cross(line, np.roll(line, -1, axis=0)))) / 2
        one = area[POINTS * j] - area[POINTS * i] + _cross(at[j], at[i]) / 2
        least = np.minimum(one, area[-1] - one)
        long = np.linalg.norm(at[j] - at[i], axis=1)
        order = np.argsort(long / np.maximum(least, 1e-300), kind="stable")
        narrow = WIDE * float(np.linalg.norm(self.line[:, :3] - self.line[:, 3:], axis=1).mean())
        order = order[least[order] > narrow * long[order]]  # what a chord outside cuts off runs the other way
        near = np.isin(i[order], worst) | np.isin(j[order], worst)
        for some in (order[near], order[~near]):
            clear = (k for k in some.tolist() if _is_clear(at[i[k]], at[j[k]], line))
            yield from ((int(i[k]), int(j[k])) for k in islice(clear, times * TRIED // 2))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _is_clear(a: Floats, b: Floats, line: Floats) -> bool:
    """Whether the chord between two points (2,) of a closed line (k, 2) is as far from it as it has to be."""
    P, way = a + BESIDE[:, None] * (b - a), np.roll(line, -1, axis=0) - line
    from_start = P[:, None] - line
    x = np.clip((from_start * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
    apart = np.linalg.norm(from_start - x[..., None] * way, axis=2).min(axis=1)
    return bool((apart >= CLEAR * np.minimum(BESIDE, 1 - BESIDE) * np.linalg.norm(b - a)).all())
