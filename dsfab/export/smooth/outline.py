"""The outlines of a sheet in each chart: closed chains of runs, each along one wall or one seam between two charts.

           wall (family 0)                A run ends where its family or the chart beyond it changes, at a sharp turn,
     o-----------------------o            and where a seam passes a wall or a third chart; at a vertex that two loops
     |   chart 0             |            share, so that neither crosses the other. Both charts of a seam end its runs
seam |........ 0 | 1 ........| seam       at the same vertices.
     |   chart 1             |
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.loops import cut_apart
from dsfab.export.smooth.source import DividedSheet
from dsfab.surface.topology import boundary_loops, edge_table, half_edges, pieces
from dsfab.units import MM_PER_M

SHARP = np.deg2rad(35.0)
"""A wall that turns by more than this at a vertex has a corner there."""

WALL = -1
"""What is beyond a wall, where a seam has a chart."""


@dataclass(frozen=True, eq=False)
class OutlineRun:
    """vertices (k,) in order, the material on their left; beyond: the chart there, or `WALL`; width: of the loop it is
    in, twice its area over its length, millimetres: the radius of a circle, the width of a long slit."""

    vertices: Ints
    beyond: int
    width: float


@dataclass(frozen=True, eq=False)
class Region:
    """A connected part of the sheet in one chart: its loops of runs, in any order."""

    chart: int
    piece: int
    loops: tuple[tuple[OutlineRun, ...], ...]


@dataclass(frozen=True, eq=False)
class SheetOutline:
    """The divided sheet in millimetres, with its regions.

    V, D    : (n, 3) vertices of the middle surface, half-thickness vectors.
    F       : (m, 3) faces; chart and piece (m,) of each.
    charts  : (v, 2) all pairs of a vertex and a chart around it, in order.
    """

    V: Floats
    D: Floats
    F: Ints
    chart: Ints
    piece: Ints
    charts: Ints
    regions: tuple[Region, ...]

    @property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.piece.max()) + 1


@dataclass(frozen=True, eq=False)
class _Beyond:
    """Half-edges by their ends, sorted keys start * n + end; the chart beyond each, and what it is an edge of."""

    n: int
    key: Ints
    chart: Ints
    family: Ints

    def at(self, loop: Ints) -> tuple[Ints, Ints]:
        k = np.searchsorted(self.key, loop * self.n + np.roll(loop, -1))
        return self.chart[k], self.family[k]


def both_skins(given: DividedSheet, shift: int) -> Floats:
    """(n, 2, 3) millimetres, the vertices of a sheet on its upper skin and on its lower one."""
    V, D = _middle(given, shift)
    return np.stack([V + D, V - D], axis=1)


def _middle(given: DividedSheet, shift: int) -> tuple[Floats, Floats]:
    """(n, 3) each, millimetres: the vertices of the middle surface, and half-thickness vectors."""
    D = MM_PER_M * given.D
    return MM_PER_M * given.V + shift * D, D


def sheet_of(given: DividedSheet, shift: int) -> SheetOutline:
    """The regions of a sheet whose middle lies `shift` half-thicknesses off its vertices."""
    V, D, F = *_middle(given, shift), given.F
    table = edge_table(F)
    _, piece = pieces(F, table)
    count = int(given.chart.max()) + 1
    charts = np.stack(np.divmod(np.unique(F * count + given.chart[:, None]), count), axis=1)  # pairs as single numbers
    special = np.bincount(charts[:, 0], minlength=len(V)) > 2
    special[table.ends[table.boundary]] = True
    beyond = _beyond(given, len(V))
    found = list(_regions(F, given.chart))
    shared = [_shared(loops) for _, loops in found]
    special[np.concatenate(shared)] = True
    regions = tuple(
        Region(
            int(given.chart[face]),
            int(piece[face]),
            tuple(_runs(V, some, special, beyond, touching) for loop in loops for some in _simple(loop)),
        )
        for (face, loops), touching in zip(found, shared, strict=True)
    )
    return SheetOutline(V, D, F, given.chart, piece, charts, regions)


def _regions(F: Ints, chart: Ints) -> Iterator[tuple[int, list[Ints]]]:
    """Connected parts of charts: a face of each, and its outlines as vertices."""
    for k in np.unique(chart):
        mine = np.flatnonzero(chart == k)
        count, part = pieces(F[mine], edge_table(F[mine]))
        for i in range(count):
            faces = mine[part == i]
            yield int(faces[0]), boundary_loops(F[faces], edge_table(F[faces]))


def _shared(loops: list[Ints]) -> Ints:
    """The vertices that the outlines of a part pass more than once."""
    vertices, often = np.unique(np.concatenate(loops), return_counts=True)
    return np.asarray(vertices[often > 1])


def _simple(loop: Ints) -> list[Ints]:
    """A loop cut apart where it comes back to a vertex: a wire of STEP must not, and only some readers mend it."""
    return [loop[some] for some in cut_apart(list(range(len(loop))), loop.tolist())]


def _beyond(given: DividedSheet, n: int) -> _Beyond:
    a, b = half_edges(given.F)
    h0, h1 = edge_table(given.F).pairs.T
    chart, family = np.full(len(a), WALL), np.full(len(a), WALL)
    chart[h0], chart[h1] = given.chart[h1 // 3], given.chart[h0 // 3]
    family[given.half_edge] = given.family
    key = a * n + b
    order = np.argsort(key)
    return _Beyond(n, key[order], chart[order], family[order])


def _runs(V: Floats, loop: Ints, special: Bools, beyond: _Beyond, touching: Ints) -> tuple[OutlineRun, ...]:
    chart, family = beyond.at(loop)
    seam = chart != WALL
    kind = np.where(seam, chart, -2 - family)
    along = V[np.roll(loop, -1)] - V[loop]
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, 1e-300)[:, None]
    ahead = np.einsum("ki,ki->k", along, np.roll(along, 1, axis=0))
    sharp = ~seam & ~np.roll(seam, 1) & (ahead < np.cos(SHARP))
    ends = (kind != np.roll(kind, 1)) | sharp | (seam & np.roll(seam, 1) & special[loop]) | np.isin(loop, touching)
    at = _two_at_least(V, loop, np.flatnonzero(ends))
    stops, width = [*at.tolist(), int(at[0]) + len(loop)], _width(V[loop], float(length.sum()))
    return tuple(OutlineRun(loop[np.arange(i, j + 1) % len(loop)], int(chart[i]), width) for i, j in pairwise(stops))


def _width(line: Floats, length: float) -> float:
    """Twice the area inside a closed line in space over its length."""
    P = line - line.mean(axis=0)
    return float(np.linalg.norm(np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0))) / max(length, 1e-300)


def _two_at_least(V: Floats, loop: Ints, at: Ints) -> Ints:
    """Positions of a loop where runs begin: at least two, found alike from both sides of a seam."""
    if len(at) > 1:
        return at
    first = int(at[0]) if len(at) else int(np.argmin(loop))
    away = np.round(np.linalg.norm(V[loop] - V[loop[first]], axis=1), 6)
    second = int(np.lexsort((loop, -away))[0])
    return np.sort(np.array([first, second]))
