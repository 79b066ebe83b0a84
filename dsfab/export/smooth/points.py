"""What a chart is fitted to: points of both skins over the plane that sees it, with a ring of those around it."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.smooth.dense import Dense, between, halfway
from dsfab.surface.neighbours import corners_of, faces_at
from dsfab.surface.topology import edge_table

OUTSIDE, BOUNDARY = 0.2, 0.5
"""Weights of the points around a chart, which hold the skins where seams are drawn, and of those on the boundary, whose
normals lean to one side. The tolerance is not asked of either."""

FOLDED = 0.01
"""Share of a chart's faces that may look away: finer meshes of coarse ones fold at a corner of their boundary now and
then. The distance of the fit from all points is asked for in any case."""


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """What a chart is fitted to, millimetres.

    origin, axes, steepest : see `Chart`.
    uv, Q  : (k, 2) and (k, 6) over the plane, and on both skins.
    inside : (k,) whether the tolerance is asked there; weight (k,).
    chord  : how far the edges between the points lie below the surface, but for a tenth of them.
    """

    origin: Floats
    axes: Floats
    steepest: float
    uv: Floats
    Q: Floats
    inside: Bools
    weight: Floats
    chord: float


def points_of(dense: Dense, near: Bools, mine: Bools) -> SkinPoints:
    """Of a chart and a ring around it. near : (faces of the mesh,); mine : (n,) vertices of the chart."""
    faces = np.flatnonzero(near[dense.parent])
    used, F = np.unique(dense.surface.F[faces], return_inverse=True)
    F = F.reshape(-1, 3)
    touched = faces_at(F, mine[used])
    if not touched.any():
        raise ExportError("a chart of the sheet is smaller than a face")
    core = corners_of(F, touched, len(used))
    around = faces_at(F, corners_of(F, faces_at(F, core), len(used)))
    V, normals = dense.points[used], dense.surface.normals[faces]
    axes = _axes(V[core], (dense.surface.areas[faces, None] * normals)[touched].sum(axis=0))
    steepest = float(np.quantile(normals[touched] @ axes[2], FOLDED))
    if steepest <= 0:
        raise ExportError("the sheet bends too sharply for charts")
    ring = around & (normals @ axes[2] > 0.5 * steepest)
    some, F = np.unique(F[ring], return_inverse=True)
    ends = edge_table(F.reshape(-1, 3)).ends
    V, core, used = V[some], core[some], used[some]
    origin, P, d = V.mean(axis=0), dense.middle[used], dense.across[used]
    M = between(P, d, ends)
    chord = np.linalg.norm(M - halfway(P, ends), axis=1)
    uv = np.concatenate([V - origin, M - origin]) @ axes[:2].T
    P, d = np.concatenate([P, M]), np.concatenate([d, _mean(d, ends)])
    own, inside = (np.concatenate([x, x[ends].all(axis=1)]) for x in (core, core & ~dense.boundary[used]))
    inside = inside if inside.any() else own
    weight = np.where(inside, 1.0, np.where(own, BOUNDARY, OUTSIDE))
    Q = np.concatenate([P + d, P - d], axis=1)
    return SkinPoints(origin, axes, steepest, uv, Q, inside, weight, float(np.percentile(chord, 90)))


def _mean(d: Floats, ends: Ints) -> Floats:
    """Half way along edges: their ends' mean direction, and mean length."""
    middle, length = halfway(d, ends), halfway(np.linalg.norm(d, axis=1), ends)
    return np.asarray(middle * (length / np.maximum(np.linalg.norm(middle, axis=1), 1e-300))[:, None])


def _axes(V: Floats, across: Floats) -> Floats:
    """(3, 3) right-handed: the longest direction in the plane, the one beside it, and the given one."""
    across = across / max(float(np.linalg.norm(across)), 1e-300)
    flat = V - V.mean(axis=0)
    flat = flat - np.outer(flat @ across, across)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    along = along * np.sign(along[np.abs(along).argmax()])
    along = along - across * (along @ across)
    along /= np.linalg.norm(along)
    return np.stack([along, np.cross(across, along), across])
