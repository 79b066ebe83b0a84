"""Division of a surface into charts that project onto a plane without folds, and the sheet's outlines in each chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import igl
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import splu

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.sparse.cholesky import one_blas_thread
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.planar import cut_apart
from dsfab.export.part import DividedSheet
from dsfab.surface.fields import voronoi_mass
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import boundary_loops, edge_table, half_edges, pieces

CONE_SLACK = np.deg2rad(12.0)
"""Radians by which charts may exceed their cone, because straightening moves faces into charts that see them
obliquely."""

REACH = 0.25
"""Diffusion length of indicators, as a share of the radius of small charts."""

SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "options": {"SymmetricMode": True},
    "diag_pivot_thresh": 0.0,
}
"""SuperLU options for factors of symmetric matrices with fewer entries."""

SWEEPS = 4
"""Number of rounds of diffusion and choice of charts."""


def chart_fields(surface: Surface, cone: float, fewest: int = 1, start: int = 0) -> Floats:
    """Return fields (n, c) on the vertices; chart k is where field k is largest.

    cone : largest angle, radians, between a normal of a cluster and its mean normal.
    fewest : smallest number of charts; start : seed, another number gives another layout.
    """
    label = _clusters(surface, cone, fewest, start)
    if label.max() == 0:
        return np.ones((surface.n, 1))
    return _within_cones(surface, label, np.cos(cone + CONE_SLACK))


def _clusters(surface: Surface, cone: float, fewest: int, start: int) -> Ints:
    """(m,) cluster of each face. All normals of a cluster lie in the cone around their mean, unless the rounds run
    out."""
    rounds = 30  # at most 30 rounds add seeds of clusters
    graph = _dual(surface)
    count, piece = connected_components(graph, directed=False)
    rng = np.random.default_rng(start)
    seeds = [int(rng.choice(np.flatnonzero(piece == c))) for c in range(count)]
    while len(seeds) < min(fewest, surface.m):
        seeds.append(int(np.argmax(_nearest_seeds(graph, seeds)[1])))
    for _ in range(rounds):
        for _ in range(3):
            seeds = _middles(surface, _nearest_seeds(graph, seeds)[0])
        label = _nearest_seeds(graph, seeds)[0]
        cosine = _cosines(surface, label)
        least = np.full(len(seeds), 2.0)
        np.minimum.at(least, label, cosine)
        bad = np.flatnonzero(least < np.cos(cone))
        if not len(bad):
            break
        for b in bad:
            inside = np.flatnonzero(label == b)
            seeds.append(int(inside[np.argmin(cosine[inside])]))
        seeds = list(dict.fromkeys(seeds))
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def _dual(surface: Surface) -> csr_array:
    """Return the graph of distances between neighbouring faces. Turns add distance, so that clusters end at bends."""
    turn_cost = 0.2  # a turn by one radian costs this share of the root of the surface's area
    f, g = (surface.edges.pairs // 3).T
    away = np.linalg.norm(surface.centroids[f] - surface.centroids[g], axis=1)
    angle = np.arccos(np.clip(np.einsum("ki,ki->k", surface.normals[f], surface.normals[g]), -1, 1))
    length = away + turn_cost * np.sqrt(surface.area) * angle + 1e-12 * surface.size
    ends = (np.concatenate([f, g]), np.concatenate([g, f]))
    return coo_array((np.concatenate([length, length]), ends), shape=(surface.m, surface.m)).tocsr()


def _nearest_seeds(graph: csr_array, seeds: list[int]) -> tuple[Ints, Floats]:
    distance, _, source = dijkstra(graph, directed=False, indices=seeds, min_only=True, return_predecessors=True)
    number = np.zeros(graph.shape[0], dtype=np.int64)
    number[seeds] = np.arange(len(seeds))
    return number[source], distance


def _middles(surface: Surface, label: Ints) -> list[int]:
    area = np.bincount(label, surface.areas)
    middle = np.stack([np.bincount(label, surface.areas * c) for c in surface.centroids.T], axis=1) / area[:, None]
    away = np.linalg.norm(surface.centroids - middle[label], axis=1)
    least = np.full(len(area), np.inf)
    np.minimum.at(least, label, away)
    nearest = np.flatnonzero(away == least[label])
    return [int(f) for f in nearest[np.unique(label[nearest], return_index=True)[1]]]


def _cosines(surface: Surface, label: Ints) -> Floats:
    vectors = surface.areas[:, None] * surface.normals
    mean = np.stack([np.bincount(label, x) for x in vectors.T], axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    area = np.bincount(label, surface.areas)[:, None]
    mean = np.where(size > 1e-3 * area, mean / np.maximum(size, 1e-300), 0.0)  # a closed cluster has no mean
    return np.asarray(np.einsum("mi,mi->m", surface.normals, mean[label]))


def _within_cones(surface: Surface, label: Ints, least: float) -> Floats:
    """Straighten the charts; divide those that become too steep or fall apart, and straighten again."""
    for turn in range(5):
        fields = _diffused_fields(surface, label, 1.0 if turn == 0 else 0.7)
        label = fields[surface.F].sum(axis=1).argmax(axis=1)
        label = _parts(surface, label)
        cosine = _cosines(surface, label)
        bad = np.unique(label[cosine < least])
        if not len(bad) and label.max() + 1 == len(np.unique(fields.argmax(axis=1))):
            break
        for b in bad:
            _halve(surface, label, int(b), cosine)
    used = np.unique(fields.argmax(axis=1))
    return np.asarray(fields[:, used])


def _diffused_fields(surface: Surface, label: Ints, share: float) -> Floats:
    count = int(label.max()) + 1
    stiffness = -igl.cotmatrix(surface.V, surface.F)
    mass = voronoi_mass(surface)
    radius = np.sqrt(np.bincount(label, surface.areas, count) / np.pi)
    reach = share * REACH * max(float(np.percentile(radius, 10)), 4 * surface.mean_edge)
    load = np.zeros((surface.n, count))
    for corner in range(3):
        np.add.at(load, (surface.F[:, corner], label), surface.areas / 3)
    with one_blas_thread():  # with one thread all columns at once are fast, with more they are slow
        step = splu(csc_array(diags_array(mass) + reach**2 * stiffness), **SYMMETRIC)
        fields = step.solve(load)
        for _ in range(SWEEPS - 1):
            chosen = np.zeros_like(load)
            chosen[np.arange(surface.n), fields.argmax(axis=1)] = mass
            moved = (chosen != load).any(axis=0)  # skip charts without a change
            fields[:, moved] = step.solve(chosen[:, moved])
            load = chosen
    return fields


def _parts(surface: Surface, label: Ints) -> Ints:
    f, g = (surface.edges.pairs // 3).T
    is_joined = label[f] == label[g]
    links = coo_array((np.ones(int(is_joined.sum())), (f[is_joined], g[is_joined])), shape=(surface.m, surface.m))
    return np.asarray(connected_components(links, directed=False)[1].astype(np.int64))


def _halve(surface: Surface, label: Ints, bad: int, cosine: Floats) -> None:
    inside = np.flatnonzero(label == bad)
    steepest = inside[np.argmin(cosine[inside])]
    opposite = inside[np.argmin(surface.normals[inside] @ surface.normals[steepest])]
    closer = surface.normals[inside] @ (surface.normals[opposite] - surface.normals[steepest]) > 0
    label[inside[closer]] = int(label.max()) + 1


SHARP = np.deg2rad(35.0)
"""A wall has a corner at a vertex with at least this turn (radians)."""

WALL = -1
"""Number in place of a chart, where a wall ends the chart."""


@dataclass(frozen=True, eq=False)
class OutlineRun:
    """Part of an outline.

    vertices : (k,) in order, the material on their left.    beyond : chart on the other side, or `WALL`.
    width    : width of the loop, mm: twice the area over the length, which is a circle's radius or a slit's width.
    """

    vertices: Ints
    beyond: int
    width: float


@dataclass(frozen=True, eq=False)
class ChartRegion:
    """Connected part of the sheet in one chart. Its loops consist of runs, in any order."""

    chart: int
    piece: int
    loops: tuple[tuple[OutlineRun, ...], ...]


@dataclass(frozen=True, eq=False)
class SheetOutline:
    """Divided sheet in millimetres, with its regions.

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
    regions: tuple[ChartRegion, ...]

    @property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.piece.max()) + 1


@dataclass(frozen=True, eq=False)
class _HalfEdgeCharts:
    """Half-edges by sorted keys start * n + end, with the chart on the other side of each and its family of edges."""

    n: int
    key: Ints
    chart: Ints
    family: Ints

    def of_loop(self, loop: Ints) -> tuple[Ints, Ints]:
        k = np.searchsorted(self.key, loop * self.n + np.roll(loop, -1))
        return self.chart[k], self.family[k]


def both_skins(sheet: DividedSheet, shift: int) -> Floats:
    """(n, 2, 3) vertices of a sheet on its upper and lower skin, millimetres."""
    V, D = _middle(sheet, shift)
    return np.stack([V + D, V - D], axis=1)


def _middle(sheet: DividedSheet, shift: int) -> tuple[Floats, Floats]:
    D = MM_PER_M * sheet.D
    return MM_PER_M * sheet.V + shift * D, D


def sheet_of(sheet: DividedSheet, shift: int) -> SheetOutline:
    """Return the regions of a sheet whose middle lies `shift` half-thicknesses off its vertices."""
    V, D, F = *_middle(sheet, shift), sheet.F
    table = edge_table(F)
    _, piece = pieces(F, table)
    count = int(sheet.chart.max()) + 1
    charts = np.stack(np.divmod(np.unique(F * count + sheet.chart[:, None]), count), axis=1)  # pairs as single numbers
    special = np.bincount(charts[:, 0], minlength=len(V)) > 2
    special[table.ends[table.boundary]] = True
    beyond = _half_edge_charts(sheet, len(V))
    parts = list(_regions(F, sheet.chart))
    shared = [_repeated_vertices(loops) for _, loops in parts]
    special[np.concatenate(shared)] = True
    regions = tuple(
        ChartRegion(
            int(sheet.chart[face]),
            int(piece[face]),
            tuple(
                _runs(V, simple_loop, special, beyond, touching)
                for loop in loops
                for simple_loop in _simple_loops(loop)
            ),
        )
        for (face, loops), touching in zip(parts, shared, strict=True)
    )
    return SheetOutline(V, D, F, sheet.chart, piece, charts, regions)


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


def _simple_loops(loop: Ints) -> list[Ints]:
    """Cut a loop at repeated vertices, because STEP forbids loops that touch themselves and few readers repair them."""
    return [loop[positions] for positions in cut_apart(list(range(len(loop))), loop.tolist())]


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
    chart, family = beyond.of_loop(loop)
    seam = chart != WALL
    kind = np.where(seam, chart, -2 - family)
    along = V[np.roll(loop, -1)] - V[loop]
    length = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length, 1e-300)[:, None]
    ahead = np.einsum("ki,ki->k", along, np.roll(along, 1, axis=0))
    sharp = ~seam & ~np.roll(seam, 1) & (ahead < np.cos(SHARP))
    ends = (kind != np.roll(kind, 1)) | sharp | (seam & np.roll(seam, 1) & special[loop]) | np.isin(loop, touching)
    starts = _run_starts(V, loop, np.flatnonzero(ends))
    stops, width = [*starts.tolist(), int(starts[0]) + len(loop)], _width(V[loop], float(length.sum()))
    return tuple(OutlineRun(loop[np.arange(i, j + 1) % len(loop)], int(chart[i]), width) for i, j in pairwise(stops))


def _width(line: Floats, length: float) -> float:
    P = line - line.mean(axis=0)
    return float(np.linalg.norm(np.cross(P, np.roll(P, -1, axis=0)).sum(axis=0))) / max(length, 1e-300)


def _run_starts(V: Floats, loop: Ints, starts: Ints) -> Ints:
    """Return positions in a loop where runs begin: at least two, and equal from both sides of a seam."""
    if len(starts) > 1:
        return starts
    start = int(starts[0]) if len(starts) else int(np.argmin(loop))
    away = np.round(np.linalg.norm(V[loop] - V[loop[start]], axis=1), 6)
    far_position = int(np.lexsort((loop, -away))[0])
    return np.sort(np.array([start, far_position]))
