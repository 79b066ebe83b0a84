"""Outlines of a sheet that is divided into charts (parts)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.planar import cut_apart
from dsfab.export.part import DividedSheet
from dsfab.surface.topology import boundary_loops, edge_table, half_edges, pieces

SHARP = np.deg2rad(35.0)  # smallest bend (radians) at a corner of a wall
WALL = -1  # number in place of a neighbouring chart, where the sheet ends at a wall


@dataclass(frozen=True, eq=False)
class OutlineRun:
    """Part of the outline of a chart (a part of the sheet).
    vertices : (k,) vertex numbers, with the material on the left.    beyond : chart on the right, or `WALL`.
    width    : mean width inside the whole loop, mm."""

    vertices: Ints
    beyond: int
    width: float


@dataclass(frozen=True, eq=False)
class ChartRegion:
    """Connected part of the sheet inside a chart. loops : outlines of the region, each a sequence of `OutlineRun`."""

    chart: int
    piece: int
    loops: tuple[tuple[OutlineRun, ...], ...]


@dataclass(frozen=True, eq=False)
class SheetOutline:
    """Sheet in millimetres, divided into charts (parts). V, D : (n, 3) vertices of the middle, vectors to upper skin.
    F      : (m, 3) faces.    chart, piece : (m,) chart and connected component of each face.
    charts : (v, 2) pairs of a vertex number and the number of a chart at the vertex."""

    V: Floats
    D: Floats
    F: Ints
    chart: Ints
    piece: Ints
    charts: Ints
    regions: tuple[ChartRegion, ...]

    @property
    def count(self) -> int:
        """Number of pieces (connected components)."""
        return int(self.piece.max()) + 1


@dataclass(frozen=True, eq=False)
class _HalfEdgeCharts:
    n: int
    key: Ints
    chart: Ints
    family: Ints


def both_skins(sheet: DividedSheet, shift: int) -> Floats:
    """Return points (n, 2, 3) on both skins, mm. shift : distance from vertices to the middle / half the thickness."""
    V, D = _middle(sheet, shift)
    return np.stack([V + D, V - D], axis=1)


def _middle(sheet: DividedSheet, shift: int) -> tuple[Floats, Floats]:
    D = MM_PER_M * sheet.D
    return MM_PER_M * sheet.V + shift * D, D


def sheet_of(sheet: DividedSheet, shift: int) -> SheetOutline:
    """Return a sheet with its outlines. shift : distance from vertices to the sheet's middle / half the thickness."""
    V, D, F = *_middle(sheet, shift), sheet.F
    table = edge_table(F)
    _, piece = pieces(F, table)
    count = int(sheet.chart.max()) + 1
    pair_numbers = np.unique(F * count + sheet.chart[:, None])  # one number for each pair of a vertex and a chart
    charts = np.stack(np.divmod(pair_numbers, count), axis=1)
    special = np.bincount(charts[:, 0], minlength=len(V)) > 2
    special[table.ends[table.boundary]] = True
    beyond = _half_edge_charts(sheet, len(V))
    parts = list(_regions(F, sheet.chart))
    shared = [_repeated_vertices(loops) for _, loops in parts]
    special[np.concatenate(shared)] = True
    regions = list[ChartRegion]()
    for (face, loops), touching in zip(parts, shared, strict=True):
        # STEP forbids loops that touch themselves, and few readers repair them
        simple = [np.array(part) for loop in loops for part in cut_apart(loop.tolist(), loop.tolist())]
        runs = tuple(_runs(V, loop, special, beyond, touching) for loop in simple)
        regions.append(ChartRegion(int(sheet.chart[face]), int(piece[face]), runs))
    return SheetOutline(V, D, F, sheet.chart, piece, charts, tuple(regions))


def _regions(F: Ints, chart: Ints) -> Iterator[tuple[int, list[Ints]]]:
    for k in np.unique(chart):
        chart_faces = np.flatnonzero(chart == k)
        count, part = pieces(F[chart_faces], edge_table(F[chart_faces]))
        for i in range(count):
            faces = chart_faces[part == i]
            yield int(faces[0]), boundary_loops(F[faces], edge_table(F[faces]))


def _repeated_vertices(loops: list[Ints]) -> Ints:
    vertices, often = np.unique(np.concatenate(loops), return_counts=True)
    return np.asarray(vertices[often > 1])


def _half_edge_charts(sheet: DividedSheet, n: int) -> _HalfEdgeCharts:
    a, b = half_edges(sheet.F)
    h0, h1 = edge_table(sheet.F).pairs.T
    chart, family = np.full(len(a), WALL), np.full(len(a), WALL)
    chart[h0], chart[h1] = sheet.chart[h1 // 3], sheet.chart[h0 // 3]
    family[sheet.half_edge] = sheet.family
    key = a * n + b
    order = np.argsort(key)
    return _HalfEdgeCharts(n, key[order], chart[order], family[order])


def _runs(V: Floats, loop: Ints, special: Bools, beyond: _HalfEdgeCharts, touching: Ints) -> tuple[OutlineRun, ...]:
    k = np.searchsorted(beyond.key, loop * beyond.n + np.roll(loop, -1))
    chart, family = beyond.chart[k], beyond.family[k]
    seam = chart != WALL
    kind = np.where(seam, chart, -2 - family)
    along = V[np.roll(loop, -1)] - V[loop]
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, 1e-300)[:, None]
    sharp = ~seam & ~np.roll(seam, 1) & (np.einsum("ki,ki->k", along, np.roll(along, 1, axis=0)) < np.cos(SHARP))
    ends = (kind != np.roll(kind, 1)) | sharp | (seam & np.roll(seam, 1) & special[loop]) | np.isin(loop, touching)
    starts = _run_starts(V, loop, np.flatnonzero(ends))
    stops, width = [*starts.tolist(), int(starts[0]) + len(loop)], loop_width(V[loop], float(length.sum()))
    return tuple(OutlineRun(loop[np.arange(i, j + 1) % len(loop)], int(chart[i]), width) for i, j in pairwise(stops))


def loop_width(line: Floats, length: float) -> float:
    """Return the mean width inside a closed line (k, 3): twice the enclosed area / the line's `length`."""
    P = line - line.mean(axis=0)
    return float(np.linalg.norm(np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0))) / max(length, 1e-300)


def _run_starts(V: Floats, loop: Ints, starts: Ints) -> Ints:
    if len(starts) > 1:
        return starts
    start = int(starts[0]) if len(starts) else int(np.argmin(loop))
    away = np.round(np.linalg.norm(V[loop] - V[loop[start]], axis=1), 6)
    return np.sort(np.array([start, int(np.lexsort((loop, -away))[0])]))
