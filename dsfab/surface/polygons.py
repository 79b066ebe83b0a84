"""Polygon files as text (OBJ, OFF), and polygons to triangles.

The two text formats are read here and not with trimesh, which splits every quad from its first corner and doubles the
vertices along texture seams.
"""

from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from dsfab.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Polygons:
    """A mesh of polygons: V (n, 3) in the file's unit, and the corners of all faces one after the other.

    corners : (c,) vertex indices; face k has sizes[k] of them.
    """

    V: Floats
    corners: Ints
    sizes: Ints


def polygons(V: list[list[float]], faces: list[list[int]]) -> Polygons:
    """From lists, as the readers meet them."""
    return Polygons(
        np.array(V, dtype=np.float64).reshape(-1, 3),
        np.fromiter(chain.from_iterable(faces), dtype=np.int64),
        np.array([len(face) for face in faces], dtype=np.int64),
    )


def read_obj(path: Path) -> Polygons:
    """Vertices and faces of a Wavefront OBJ file; lines, points, textures, normals and groups are passed over.

    Raises ValueError with the line number where a line cannot be read.
    """
    V: list[list[float]] = []
    faces: list[list[int]] = []
    text = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), start=1):
        word, *rest = line.split("#")[0].split() or [""]
        try:
            if word == "v":
                x, y, z = rest[:3]
                V.append([float(x), float(y), float(z)])
            elif word == "f":
                index = [int(corner.split("/")[0]) for corner in rest]
                # counted from 1; negative from the last vertex so far
                faces.append([i - 1 if i > 0 else len(V) + i if i < 0 else -1 for i in index])
        except ValueError:
            raise ValueError(f"line {number} cannot be read: {line.strip()[:60]!r}") from None
    return polygons(V, faces)


def read_off(path: Path) -> Polygons:
    """Vertices and faces of an OFF text file (also COFF, NOFF: colours and normals are passed over)."""
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = [words for line in text.splitlines() if (words := line.split("#")[0].split())]
    if not lines or not lines[0][0].upper().endswith("OFF"):
        raise ValueError("the first word is not OFF")
    lines = ([lines[0][1:]] if lines[0][1:] else []) + lines[1:]
    try:
        n, m = int(lines[0][0]), int(lines[0][1])
        body = lines[1 : 1 + n + m]
        if len(body) < n + m:
            raise ValueError(f"{n} vertices and {m} faces are announced, {len(body)} lines follow")
        V = [[float(x) for x in words[:3]] for words in body[:n]]
        faces = [[int(i) for i in words[1 : 1 + int(words[0])]] for words in body[n:]]
    except IndexError:
        raise ValueError("the numbers of vertices and faces are missing") from None
    return polygons(V, faces)


def triangles(mesh: Polygons) -> tuple[Ints, Ints]:
    """(m, 3) triangles and (m,) the polygon of each, in the order of the polygons.

    A quad is cut along its shorter diagonal that stays inside it (along the one from its first corner when they are
    equal), a larger polygon by clipping the ear with the shortest cut, again and again. Polygons with fewer than
    three corners are dropped; one with a vertex outside the mesh is fanned, for the caller to refuse.
    """
    start = np.concatenate([[0], np.cumsum(mesh.sizes)[:-1]]).astype(np.int64)
    of3, of4 = np.flatnonzero(mesh.sizes == 3), np.flatnonzero(mesh.sizes == 4)
    cuts = [mesh.corners[start[of3][:, None] + np.arange(3)], _quads_cut(mesh, start[of4])]
    owners = [of3, np.repeat(of4, 2)]
    for k in np.flatnonzero(mesh.sizes > 4):
        cuts.append(_ears(mesh.V, mesh.corners[start[k] : start[k] + mesh.sizes[k]]))
        owners.append(np.full(mesh.sizes[k] - 2, k))
    F, owner = np.concatenate(cuts), np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return F[order], owner[order]


def _quads_cut(mesh: Polygons, start: Ints) -> Ints:
    """(2 q, 3) the two triangles of each quad."""
    Q = mesh.corners[start[:, None] + np.arange(4)]
    P = mesh.V[np.where((mesh.corners < 0) | (mesh.corners >= len(mesh.V)), 0, mesh.corners)]
    P = P[start[:, None] + np.arange(4)]
    d02, d13 = P[:, 2] - P[:, 0], P[:, 3] - P[:, 1]
    area = np.cross(d02, d13)

    def inside(a: int, b: int, c: int, d: int) -> Bools:
        one, two = (np.cross(P[:, j] - P[:, i], P[:, k] - P[:, i]) for i, j, k in ((a, b, c), (a, c, d)))
        fits: Bools = (np.einsum("qi,qi->q", one, area) > 0) & (np.einsum("qi,qi->q", two, area) > 0)
        return fits

    fits02, fits13 = inside(0, 1, 2, 3), inside(1, 2, 3, 0)
    shorter = np.linalg.norm(d13, axis=1) < (1 - 1e-9) * np.linalg.norm(d02, axis=1)
    other = np.where(fits02 == fits13, shorter, fits13)
    cut = np.where(other[:, None], [[1, 2, 3, 1, 3, 0]], [[0, 1, 2, 0, 2, 3]])
    return np.take_along_axis(Q, cut, axis=1).reshape(-1, 3)


def _ears(V: Floats, polygon: Ints) -> Ints:
    """(k - 2, 3) triangles of one polygon with k > 4 corners, by ear clipping in its mean plane."""
    left = [int(i) for i in polygon]
    if min(left) < 0 or max(left) >= len(V) or not np.isfinite(V[left]).all():
        return np.array([[left[0], b, c] for b, c in pairwise(left[1:])])
    normal = np.cross(V[left], np.roll(V[left], -1, axis=0)).sum(axis=0)
    cuts = []
    while len(left) > 3:
        k = len(left)
        corners = [(left[i - 1], left[i], left[(i + 1) % k]) for i in range(k)]
        ears = [i for i, ear in enumerate(corners) if _is_ear(V, ear, left, normal)] or list(range(k))
        best = min(ears, key=lambda i: (float(np.linalg.norm(V[corners[i][0]] - V[corners[i][2]])), i))
        cuts.append(corners[best])
        del left[best]
    return np.array([*cuts, tuple(left)])


def _is_ear(V: Floats, ear: tuple[int, int, int], polygon: list[int], normal: Floats) -> bool:
    """Whether the corner is convex and no other corner lies in its triangle, seen along the normal."""
    a, b, c = V[list(ear)]
    others = V[[i for i in polygon if i not in ear]]
    sides = [np.cross(q - p, others - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
    within = (np.array(sides) >= 0).all(axis=0)
    return bool(np.cross(b - a, c - b) @ normal > 0 and not within.any())
