"""A surface divided into charts that a plane sees whole: all normals of a chart lie within a cone.

Seeds grow to clusters of faces over the dual graph and move to their clusters' middles [Lloyd 1982]; a cluster with a
normal outside the cone gets one more seed there. Then the borders are straightened: the clusters' indicators diffuse
a little, each vertex goes to the largest, again and again [Merriman, Bence and Osher 1992]. The charts are the upper
envelope of the diffused fields.
"""

from typing import Any

import igl
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import splu

from dsfab.arrays import Floats, Ints
from dsfab.sparse.threads import one_blas_thread
from dsfab.surface.hats import voronoi_mass
from dsfab.surface.mesh import Surface

SLACK = np.deg2rad(12.0)
"""Straightening moves faces into charts that see them at a flatter angle: so much more is allowed then."""

ROUNDS = 30
"""Seeds are added so often."""

TURN = 0.2
"""What turning by a radian counts on the way between faces, as a share of the surface's root area."""

REACH = 0.25
"""How far indicators diffuse, as a share of the small charts' radii."""

SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "options": {"SymmetricMode": True},
    "diag_pivot_thresh": 0.0,
}
"""For factors of symmetric matrices with fewer entries."""

SWEEPS = 4
"""Rounds of diffusion and choice."""


def layout(surface: Surface, cone: float, fewest: int = 1, start: int = 0) -> Floats:
    """Fields (n, c) on the vertices: chart k is where field k is largest.

    cone : half angle, radians, within which the normals of a cluster lie around their mean.
    fewest : charts at least; start : another number gives another layout.
    """
    label = _clusters(surface, cone, fewest, start)
    if label.max() == 0:
        return np.ones((surface.n, 1))
    return _within_cones(surface, label, np.cos(cone + SLACK))


def _clusters(surface: Surface, cone: float, fewest: int, start: int) -> Ints:
    """(m,) a cluster for each face, no normal of a cluster outside the cone around its mean, if rounds suffice."""
    graph = _dual(surface)
    count, piece = connected_components(graph, directed=False)
    rng = np.random.default_rng(start)
    seeds = [int(rng.choice(np.flatnonzero(piece == c))) for c in range(count)]
    while len(seeds) < min(fewest, surface.m):
        seeds.append(int(np.argmax(_grown(graph, seeds)[1])))
    for _ in range(ROUNDS):
        for _ in range(3):
            seeds = _middles(surface, _grown(graph, seeds)[0])
        label = _grown(graph, seeds)[0]
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
    """Distances between neighbouring faces; turning counts, too, so that clusters end at bends."""
    f, g = (surface.edges.pairs // 3).T
    away = np.linalg.norm(surface.centroids[f] - surface.centroids[g], axis=1)
    angle = np.arccos(np.clip(np.einsum("ki,ki->k", surface.normals[f], surface.normals[g]), -1, 1))
    length = away + TURN * np.sqrt(surface.area) * angle + 1e-12 * surface.size
    ends = (np.concatenate([f, g]), np.concatenate([g, f]))
    return coo_array((np.concatenate([length, length]), ends), shape=(surface.m, surface.m)).tocsr()


def _grown(graph: csr_array, seeds: list[int]) -> tuple[Ints, Floats]:
    """The nearest seed of each face, and its distance."""
    distance, _, source = dijkstra(graph, directed=False, indices=seeds, min_only=True, return_predecessors=True)
    number = np.zeros(graph.shape[0], dtype=np.int64)
    number[seeds] = np.arange(len(seeds))
    return number[source], distance


def _middles(surface: Surface, label: Ints) -> list[int]:
    """The face of each cluster nearest to its centroid."""
    area = np.bincount(label, surface.areas)
    middle = np.stack([np.bincount(label, surface.areas * c) for c in surface.centroids.T], axis=1) / area[:, None]
    away = np.linalg.norm(surface.centroids - middle[label], axis=1)
    least = np.full(len(area), np.inf)
    np.minimum.at(least, label, away)
    nearest = np.flatnonzero(away == least[label])
    return [int(f) for f in nearest[np.unique(label[nearest], return_index=True)[1]]]


def _cosines(surface: Surface, label: Ints) -> Floats:
    """(m,) of the angle between each face's normal and its cluster's mean."""
    vectors = surface.areas[:, None] * surface.normals
    mean = np.stack([np.bincount(label, x) for x in vectors.T], axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    area = np.bincount(label, surface.areas)[:, None]
    mean = np.where(size > 1e-3 * area, mean / np.maximum(size, 1e-300), 0.0)  # a closed cluster has none
    return np.asarray(np.einsum("mi,mi->m", surface.normals, mean[label]))


def _within_cones(surface: Surface, label: Ints, least: float) -> Floats:
    """Straightened fields; charts that became too steep or fell apart are divided, and straightened again."""
    for turn in range(5):
        fields = _straightened(surface, label, 1.0 if turn == 0 else 0.7)
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


def _straightened(surface: Surface, label: Ints, share: float) -> Floats:
    """(n, c) indicators of the clusters, diffused and chosen from in turn."""
    count = int(label.max()) + 1
    stiffness = -igl.cotmatrix(surface.V, surface.F)
    mass = voronoi_mass(surface)
    radius = np.sqrt(np.bincount(label, surface.areas, count) / np.pi)
    reach = share * REACH * max(float(np.percentile(radius, 10)), 4 * surface.mean_edge)
    load = np.zeros((surface.n, count))
    for corner in range(3):
        np.add.at(load, (surface.F[:, corner], label), surface.areas / 3)
    with one_blas_thread():  # then all columns at once take half the time of one by one, otherwise five times as much
        step = splu(csc_array(diags_array(mass) + reach**2 * stiffness), **SYMMETRIC)
        fields = step.solve(load)
        for _ in range(SWEEPS - 1):
            chosen = np.zeros_like(load)
            chosen[np.arange(surface.n), fields.argmax(axis=1)] = mass
            moved = (chosen != load).any(axis=0)  # of small charts, half stay as they are
            fields[:, moved] = step.solve(chosen[:, moved])
            load = chosen
    return fields


def _parts(surface: Surface, label: Ints) -> Ints:
    """A label of its own for every connected part."""
    f, g = (surface.edges.pairs // 3).T
    same = label[f] == label[g]
    links = coo_array((np.ones(int(same.sum())), (f[same], g[same])), shape=(surface.m, surface.m))
    return np.asarray(connected_components(links, directed=False)[1].astype(np.int64))


def _halve(surface: Surface, label: Ints, bad: int, cosine: Floats) -> None:
    """Divide a chart between its steepest face and the face that looks away from that one most."""
    inside = np.flatnonzero(label == bad)
    first = inside[np.argmin(cosine[inside])]
    second = inside[np.argmin(surface.normals[inside] @ surface.normals[first])]
    closer = surface.normals[inside] @ (surface.normals[second] - surface.normals[first]) > 0
    label[inside[closer]] = int(label.max()) + 1
