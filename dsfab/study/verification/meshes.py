"""Meshes of the unit square and of the sphere, to map onto the geometry of a test, and marks on them."""

from typing import Literal

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import Surface

Mesh = Literal["diagonal", "union_jack", "jittered"]
MESHES: tuple[Mesh, ...] = ("diagonal", "union_jack", "jittered")
"""Squares halved by parallel diagonals, by alternating ones, and the latter with the inner vertices moved at random."""

NEAR = 1e-9
"""Parameters of the unit square closer than this are the same."""


def square(nx: int, ny: int, mesh: Mesh) -> tuple[Floats, Ints]:
    """Vertices (n, 2) and faces of a mesh of the unit square with nx by ny cells."""
    x, y = np.meshgrid(np.arange(nx + 1) / nx, np.arange(ny + 1) / ny, indexing="ij")
    uv = np.stack([x.ravel(), y.ravel()], axis=1)
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    a = (i * (ny + 1) + j).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    other = np.zeros(len(a), dtype=bool) if mesh == "diagonal" else ((i + j) % 2 == 1).ravel()
    F = np.concatenate(
        [
            np.stack([a, b, c], axis=1)[~other],
            np.stack([a, c, d], axis=1)[~other],
            np.stack([a, b, d], axis=1)[other],
            np.stack([b, c, d], axis=1)[other],
        ]
    )
    if mesh == "jittered":
        inner = ((uv > NEAR) & (uv < 1 - NEAR)).all(axis=1) & (np.abs(uv - 0.5).max(axis=1) > NEAR)  # keep the centre
        shift = np.random.default_rng(0).uniform(-0.25, 0.25, (inner.sum(), 2))
        uv[inner] += shift / (nx, ny)
    return uv, F


def at(values: Floats, where: float) -> Bools:
    """(k,) which parameters (k,) are `where`."""
    return np.asarray(np.abs(values - where) < NEAR)


def edges_on(surface: Surface, *lines: Bools) -> Bools:
    """(e,) boundary edges with both ends on one of the lines of vertices."""
    on = np.logical_or.reduce([line[surface.edges.ends].all(axis=1) for line in lines])
    return np.asarray(on & surface.edges.boundary)


def octasphere(cells: int) -> tuple[Floats, Ints]:
    """V (n, 3), F (m, 3): the unit sphere as an octahedron whose edges are cut into `cells`; normals point outwards."""
    b, faces = _octahedron_side(cells)
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    points = (b[None] * signs[:, None]).reshape(-1, 3)
    F = np.concatenate([(faces if s.prod() > 0 else faces[:, ::-1]) + k * len(b) for k, s in enumerate(signs)])
    unique, of = np.unique(points, axis=0, return_inverse=True)
    return _on_sphere(unique, cells), of.reshape(-1)[F]


def octant(cells: int) -> tuple[Floats, Ints]:
    """V (n, 3), F (m, 3): the part of `octasphere` with no negative coordinate."""
    b, faces = _octahedron_side(cells)
    return _on_sphere(b, cells), faces


def _octahedron_side(cells: int) -> tuple[Ints, Ints]:
    """Corners (n, 3), integers that sum to `cells`, and faces of one side of the octahedron."""
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    inside = i + j <= cells
    number = np.full((cells + 1, cells + 1), -1)
    number[inside] = np.arange(inside.sum())
    b = np.stack([cells - i - j, i, j], axis=-1)[inside]
    up, down = i + j < cells, i + j < cells - 1
    a = np.stack(np.nonzero(up), axis=1)
    d = np.stack(np.nonzero(down), axis=1)
    faces = np.concatenate(
        [
            np.stack([number[a[:, 0], a[:, 1]], number[a[:, 0] + 1, a[:, 1]], number[a[:, 0], a[:, 1] + 1]], axis=1),
            np.stack(
                [number[d[:, 0] + 1, d[:, 1]], number[d[:, 0] + 1, d[:, 1] + 1], number[d[:, 0], d[:, 1] + 1]], axis=1
            ),
        ]
    )
    return b, faces


def _on_sphere(points: Ints, cells: int) -> Floats:
    """Equal angles along the octahedron's edges: all triangles stay of similar size."""
    bent = np.sign(points) * np.sin(np.pi / 2 * np.abs(points) / cells)
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True))
