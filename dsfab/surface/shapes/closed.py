"""Shapes without a boundary."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.meshing import ROW, Length, check_density, pieces_of, ring_faces, ring_turns, shape


@shape
def sphere(radius: Length = 2.0, edge: Length = 0.2) -> Surface:
    """A sphere around the origin: an icosahedron with every edge cut in f parts, pushed out to the sphere.

    Class I subdivision [Clinton 1971] of any frequency f: 10 f^2 + 2 vertices, 20 f^2 faces. A vertex is at each pole.
    """
    area = 4 * np.pi * radius**2
    check_density(area, edge)
    corners, faces = _icosahedron()
    f = max(1, round(float(np.sqrt(area / (20 * ROW / 2 * edge**2)))))
    V, F = _subdivided(corners, faces, f)
    return Surface(radius * V / np.linalg.norm(V, axis=1, keepdims=True), F)


def _icosahedron() -> tuple[Floats, Ints]:
    """Twelve unit vectors, two at the poles and five at each latitude arctan(1/2), and the twenty faces."""
    k = np.arange(5)
    upper, lower = 2 * np.pi * k / 5, 2 * np.pi * (k + 0.5) / 5
    ring = [
        np.stack([2 * np.cos(t), 2 * np.sin(t), np.full(5, h)], axis=1) / np.sqrt(5)
        for t, h in ((upper, 1), (lower, -1))
    ]
    V = np.concatenate([[[0, 0, 1.0]], ring[0], ring[1], [[0, 0, -1.0]]])
    a, b, c, d = 1 + k, 1 + (k + 1) % 5, 6 + k, 6 + (k + 1) % 5
    top, bottom = 0 * k, 0 * k + 11
    F = np.concatenate([np.stack(t, axis=1) for t in ((top, a, b), (a, c, b), (b, c, d), (bottom, d, c))])
    return V, F


def _subdivided(corners: Floats, faces: Ints, f: int) -> tuple[Floats, Ints]:
    """Every face cut into f^2 flat triangles; vertices on shared edges are shared.

    A vertex is named by its integer weights on the corners, so that equal ones are found exactly.
    """
    i, j = (x.ravel() for x in np.meshgrid(np.arange(f + 1), np.arange(f + 1), indexing="ij"))
    inside = i + j <= f
    at = np.full((f + 1, f + 1), -1)
    at[i[inside], j[inside]] = np.arange(inside.sum())
    i, j = i[inside], j[inside]
    weights = np.zeros((len(faces), len(i), len(corners)), dtype=np.int64)
    face = np.arange(len(faces))[:, None]
    for corner, weight in enumerate((f - i - j, i, j)):
        weights[face, np.arange(len(i)), faces[:, [corner]]] += weight
    up = i + j < f
    down = i + j < f - 1
    small = np.concatenate(
        [
            np.stack([at[i[up], j[up]], at[i[up] + 1, j[up]], at[i[up], j[up] + 1]], axis=1),
            np.stack([at[i[down] + 1, j[down]], at[i[down] + 1, j[down] + 1], at[i[down], j[down] + 1]], axis=1),
        ]
    )
    names, name = np.unique(weights.reshape(-1, len(corners)), axis=0, return_inverse=True)
    every = (small[None] + len(i) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    return names @ corners / f, name.ravel()[every]


@shape
def torus(major: Length = 3.0, minor: Length = 1.2, edge: Length = 0.22) -> Surface:
    """A ring around the z axis: tube of radius `minor` along a circle of radius `major`, normals outward.

    Area 4 pi^2 major minor, volume 2 pi^2 major minor^2. Raises SurfaceError unless major > minor.
    """
    if minor >= 0.95 * major:
        raise SurfaceError(f"torus: minor = {minor:g} m leaves no hole; keep it under 0.95 x major = {major:g} m")
    check_density(4 * np.pi**2 * major * minor, edge)
    rows = pieces_of(2 * np.pi * minor, ROW * edge, multiple=2, least=6)
    phi = 2 * np.pi * np.arange(rows) / rows
    r, z = major + minor * np.cos(phi), minor * np.sin(phi)
    counts = np.array([pieces_of(2 * np.pi * x, edge, multiple=6, least=6) for x in r])
    turns = ring_turns(counts)
    angle, radius = 2 * np.pi * np.concatenate(turns), np.repeat(r, counts)
    V = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.repeat(z, counts)], axis=1)
    return Surface(V, ring_faces(turns, closed=True)[:, ::-1])
