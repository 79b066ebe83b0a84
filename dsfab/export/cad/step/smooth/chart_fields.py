"""Division of a surface into charts (parts) that project onto a plane without folds."""

from typing import Any

import igl
import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.sparse.linalg import splu

from dsfab.core.arrays import Floats, Ints
from dsfab.core.sparse.cholesky import one_blas_thread
from dsfab.surface.fields import voronoi_mass
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import link_components

CONE_SLACK = np.deg2rad(12.0)  # added to the angle `cone`, because faces change charts when borders become straighter
REACH = 0.25  # diffusion length of the fields that define charts, as a fraction of the radius of small charts

SYMMETRIC: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "options": {"SymmetricMode": True},
    "diag_pivot_thresh": 0.0,
}
"""Options of SuperLU for symmetric matrices. With these options, the factors have fewer entries."""

SWEEPS = 4  # number of diffusions; between them, each vertex's largest field becomes 1 and its other fields 0


def chart_fields(surface: Surface, cone: float, fewest: int = 1, start: int = 0) -> Floats:
    """Divide a surface into c charts; return fields (n, c) on the vertices. Field k is largest in chart k.
    cone   : largest angle (radians) between the normals of a cluster of faces and the mean normal.
    fewest : smallest number of charts.    start : seed of random numbers."""
    label = _clusters(surface, cone, fewest, start)
    if label.max() == 0:
        return np.ones((surface.n, 1))
    return _within_cones(surface, label, np.cos(cone + CONE_SLACK))


def _clusters(surface: Surface, cone: float, fewest: int, start: int) -> Ints:
    """Return the number (m,) of the cluster of faces that contains each face. Parameters as in `chart_fields`."""
    rounds = 30  # largest number of rounds that add clusters of faces
    graph = _dual(surface)
    count, piece = connected_components(graph, directed=False)
    rng = np.random.default_rng(start)
    seeds = [int(rng.choice(np.flatnonzero(piece == c))) for c in range(count)]
    while len(seeds) < min(fewest, surface.m):
        seeds.append(int(np.argmax(_nearest_seeds(graph, seeds)[1])))
    for _ in range(rounds):
        for _ in range(3):
            seeds = middle_faces(surface, _nearest_seeds(graph, seeds)[0])
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
    turn_cost = 0.2  # distance added per radian of bend, divided by the square root of the surface's area
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


def middle_faces(surface: Surface, label: Ints) -> list[int]:
    """Return the face nearest to the middle of each cluster of faces. label : (m,) cluster of each face."""
    area = np.bincount(label, surface.areas)
    middle = np.stack([np.bincount(label, surface.areas * c) for c in surface.centroids.T], axis=1) / area[:, None]
    away = np.linalg.norm(surface.centroids - middle[label], axis=1)
    least = np.full(len(area), np.inf)
    np.minimum.at(least, label, away)
    nearest = np.flatnonzero(away == least[label])
    return [int(f) for f in nearest[np.unique(label[nearest], return_index=True)[1]]]


def _cosines(surface: Surface, label: Ints) -> Floats:
    mean = np.stack([np.bincount(label, x) for x in (surface.areas[:, None] * surface.normals).T], axis=1)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    area = np.bincount(label, surface.areas)[:, None]
    mean = np.where(size > 1e-3 * area, mean / np.maximum(size, 1e-300), 0.0)  # zero if the normals cancel
    return np.asarray(np.einsum("mi,mi->m", surface.normals, mean[label]))


def _within_cones(surface: Surface, label: Ints, least: float) -> Floats:
    """Return fields (n, c) of charts with straight borders, starting from clusters of faces `label` (m,).
    least : smallest cosine of the angle between a face's normal and the mean normal of its chart."""
    f, g = (surface.edges.pairs // 3).T
    for turn in range(5):
        fields = diffused_fields(surface, label, 1.0 if turn == 0 else 0.7)
        label = fields[surface.F].sum(axis=1).argmax(axis=1)
        is_joined = label[f] == label[g]
        label = link_components(surface.m, f[is_joined], g[is_joined])[1]
        cosine = _cosines(surface, label)
        bad = np.unique(label[cosine < least])
        if not len(bad) and label.max() + 1 == len(np.unique(fields.argmax(axis=1))):
            break
        for b in bad:
            _halve(surface, label, int(b), cosine)
    return np.asarray(fields[:, np.unique(fields.argmax(axis=1))])


def diffused_fields(surface: Surface, label: Ints, share: float) -> Floats:
    """Return fields (n, c) on the vertices. Field k spreads from cluster k of faces by diffusion.
    label : (m,) cluster of each face.    share : factor of the diffusion length."""
    count = int(label.max()) + 1
    stiffness = -igl.cotmatrix(surface.V, surface.F)
    mass = voronoi_mass(surface)
    radius = np.sqrt(np.bincount(label, surface.areas, count) / np.pi)
    reach = share * REACH * max(float(np.percentile(radius, 10)), 4 * surface.mean_edge)
    load = np.zeros((surface.n, count))
    for corner in range(3):
        np.add.at(load, (surface.F[:, corner], label), surface.areas / 3)
    with one_blas_thread():  # several threads would be slower for many columns
        step = splu(csc_array(diags_array(mass) + reach**2 * stiffness), **SYMMETRIC)
        fields = step.solve(load)
        for _ in range(SWEEPS - 1):
            chosen = np.zeros_like(load)
            chosen[np.arange(surface.n), fields.argmax(axis=1)] = mass
            moved = (chosen != load).any(axis=0)  # fields whose load has changed are solved again
            fields[:, moved] = step.solve(chosen[:, moved])
            load = chosen
    return fields


def _halve(surface: Surface, label: Ints, bad: int, cosine: Floats) -> None:
    inside = np.flatnonzero(label == bad)
    steepest = inside[np.argmin(cosine[inside])]
    opposite = inside[np.argmin(surface.normals[inside] @ surface.normals[steepest])]
    closer = surface.normals[inside] @ (surface.normals[opposite] - surface.normals[steepest]) > 0
    label[inside[closer]] = int(label.max()) + 1
