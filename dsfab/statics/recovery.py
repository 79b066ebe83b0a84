"""Stress that is linear on each face, averaged at the vertices: what is read off as the largest."""

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.surface import Surface

SMOOTH = np.cos(np.radians(30))
"""Faces that lean by more than 30 degrees from the mean normal at a vertex are across a fold there."""


WEIGHTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""How often xx, yy, zz, yz, xz and xy stand in a symmetric tensor."""

HALVES = np.array([1.0, 1.0, 2.0])[:, None]
"""The plane tensor of unit xy has a square of 2, those of xx and yy of 1."""


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
    basis = _tensors(frame)
    tensors = (values @ basis).reshape(-1, 6) * (signed * level * area)[:, None]
    total = (around @ tensors) / np.maximum(around @ (level * area), 1e-300)[:, None]
    back = (basis * WEIGHTS / HALVES).transpose(0, 2, 1)
    found = (total[corner] * signed[:, None]).reshape(-1, 3, 6) @ back
    return np.asarray(np.where(level.reshape(-1, 3, 1), found, values.mean(axis=1, keepdims=True)))


def _tensors(frame: Floats) -> Floats:
    """(m, 3, 6) components xx, yy, zz, yz, xz, xy in space of the plane tensors xx, yy and xy of each frame."""
    a, b = frame[:, 0], frame[:, 1]
    c, d = a[:, [1, 2, 0]], a[:, [2, 0, 1]]
    e, f = b[:, [1, 2, 0]], b[:, [2, 0, 1]]
    xx, yy = np.concatenate([a * a, c * d], axis=1), np.concatenate([b * b, e * f], axis=1)
    return np.stack([xx, yy, np.concatenate([2 * a * b, c * f + d * e], axis=1)], axis=1)
