"""Stress that is linear on each face, averaged at the vertices: what is read off as the largest."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface

SMOOTH = np.cos(np.radians(30))
"""Faces that lean by more than 30 degrees from the mean normal at a vertex are across a fold there."""


def averaged(surface: Surface, frame: Floats, values: Floats, sided: bool) -> Floats:
    """(m, 3 corners, 3) plane tensors (xx, yy, xy), replaced by their mean over the faces around each vertex.

    frame  : (m, 2, 3) of each face, that components refer to.
    values : (m, 3 corners, 3).
    sided  : whether they change sign with the side that the normal points to (bending does).

    Jumps between faces are errors, and averaging removes most of them [Hinton and Campbell 1974]: at a built-in edge it
    keeps what means of faces miss, and on curved sheets it removes the bending of each flat face by its own load, which
    is large at corners and cancels around a vertex. Across folds nothing is averaged: the mean of the face stands.
    """
    corner = surface.F.ravel()
    face = np.repeat(np.arange(surface.m), 3)
    first = np.full(surface.n, -1)
    first[corner[::-1]] = face[::-1]
    side = np.where(np.einsum("cx,cx->c", surface.normals[face], surface.normals[first[corner]]) < 0, -1.0, 1.0)
    around = csr_array((np.ones(len(corner)), corner, np.arange(len(corner) + 1)), (len(corner), surface.n)).T
    area = surface.areas[face]
    mean = np.asarray(around @ (surface.normals[face] * (side * area)[:, None]))
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    level = np.abs(np.einsum("cx,cx->c", surface.normals[face], mean[corner])) > SMOOTH
    signed = side if sided else np.ones_like(side)
    tensors = _in_space(frame[face], values.reshape(-1, 3)) * (signed * level * area)[:, None]
    total = (around @ tensors) / np.maximum(around @ (level * area), 1e-300)[:, None]
    found = _in_plane(frame[face], total[corner]) * signed[:, None]
    return np.where(level.reshape(-1, 3, 1), found.reshape(-1, 3, 3), values.mean(axis=1, keepdims=True))


def _in_space(frame: Floats, planar: Floats) -> Floats:
    """(k, 6) components xx, yy, zz, yz, xz, xy of plane tensors (k, 3)."""
    a, b = frame[:, 0], frame[:, 1]
    xx, yy, xy = (planar[:, i, None] for i in range(3))
    direct = xx * a * a + yy * b * b + 2 * xy * a * b
    c, d = np.roll(a, -1, axis=1), np.roll(a, -2, axis=1)
    e, f = np.roll(b, -1, axis=1), np.roll(b, -2, axis=1)
    return np.concatenate([direct, xx * c * d + yy * e * f + xy * (c * f + d * e)], axis=1)


def _in_plane(frame: Floats, tensor: Floats) -> Floats:
    """(k, 3) the part of tensors (k, 6) in the plane of each frame."""
    a, b = frame[:, 0], frame[:, 1]
    direct, mixed = tensor[:, :3], tensor[:, 3:]

    def product(p: Floats, q: Floats) -> Floats:
        cross = np.roll(p, -1, axis=1) * np.roll(q, -2, axis=1) + np.roll(p, -2, axis=1) * np.roll(q, -1, axis=1)
        return np.asarray((direct * p * q + mixed * cross).sum(axis=1))

    return np.stack([product(a, a), product(b, b), product(a, b)], axis=1)
