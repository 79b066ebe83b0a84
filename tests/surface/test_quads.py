"""Quads of files, cut into triangles: along folds, and else along the shorter diagonal."""

import numpy as np
import pytest

from dsfab.surface.files.polygons import Polygons, triangles


def sheet(height, cells=8, turned=()):
    """Quads of 1 x 1 about the origin at a height of x and y; some with their corners the other way round."""
    g = np.arange(cells + 1) - cells / 2
    x, y = (c.ravel() for c in np.meshgrid(g, g, indexing="ij"))
    k = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    Q = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    Q[list(turned)] = Q[list(turned)][:, ::-1]
    return Polygons(np.stack([x, y, height(x, y)], axis=1), Q.ravel(), np.full(len(Q), 4))


def off(mesh, height):
    """How far the middles of the triangles are from a height of x and y."""
    x, y, z = mesh.V[triangles(mesh).F].mean(axis=1).T
    return np.abs(z - height(x, y))


@pytest.mark.parametrize("slope", [0.6, -0.6, -0.3, 2.0])
@pytest.mark.parametrize("turned", [(), (3, 9, 10, 27, 28, 54)])
def test_quads_across_a_valley_or_a_hip_are_cut_along_it(slope, turned):
    """They were cut along their level diagonals, which are shorter: a tooth in each."""

    def funnel(x, y):
        return slope * np.maximum(np.abs(x), np.abs(y))

    assert off(sheet(funnel, turned=turned), funnel).max() < 1e-12


@pytest.mark.parametrize("bend", [0.05, 0.5, 2.0])
def test_quads_of_a_saddle_are_cut_along_their_shorter_diagonals(bend):
    mesh = sheet(lambda x, y: bend * x * y, cells=5)
    F = triangles(mesh).F.reshape(-1, 6)
    Q, V = mesh.corners.reshape(-1, 4), mesh.V
    d02, d13 = (np.linalg.norm(V[Q[:, a]] - V[Q[:, b]], axis=1) for a, b in ((0, 2), (1, 3)))
    on02 = np.array([{q[0], q[2]} <= set(f[:3]) and {q[0], q[2]} <= set(f[3:]) for q, f in zip(Q, F, strict=True)])
    differ = np.abs(d02 - d13) > 1e-6
    assert differ.any()
    assert (on02 == (d02 < d13))[differ].all()


def test_quads_beside_a_fold_are_cut_along_their_shorter_diagonal():
    """A gable whose ridge is between quads, and one quad alone, with nothing beside it."""
    gable = sheet(lambda x, y: -np.abs(x) + 0.02 * x * y, cells=6)
    lone = sheet(lambda x, y: np.maximum(x, y), cells=1)
    for mesh in (gable, lone):
        Q, V = mesh.corners.reshape(-1, 4), mesh.V
        cut = {tuple(sorted(f)) for f in triangles(mesh).F.tolist()}
        for q in Q:
            shorter = np.linalg.norm(V[q[3]] - V[q[1]]) < np.linalg.norm(V[q[2]] - V[q[0]]) * (1 - 1e-9)
            first = (q[0], q[1], q[3]) if shorter else (q[0], q[1], q[2])
            assert tuple(sorted(map(int, first))) in cut
