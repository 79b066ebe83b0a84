"""Sheets of members and the networks that STEP takes of them."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.design.output.files import curved_sheet
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel
from dsfab.export.cad.step.by_members.patches import FaceLimits
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.strategies import prepare
from dsfab.export.part import StripedSheet, part_of
from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.thickening import offsets, thicken

T = 0.04

RADIUS = 2.0


def cylinder_strip(columns: int = 40, rows: int = 12) -> Surface:
    """A quarter of a cylinder of radius 2 m, 1 m long."""
    angle, x = np.meshgrid(np.linspace(0, np.pi / 2, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    V = np.stack([x, RADIUS * np.cos(angle), RADIUS * np.sin(angle)], axis=2).reshape(-1, 3)
    i = np.arange(columns * (rows + 1)).reshape(columns, rows + 1)[:, :-1].ravel()
    a, b, c, d = i, i + 1, i + rows + 2, i + rows + 1
    return Surface(V, np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)]))


def flat_strip() -> Surface:
    given = cylinder_strip()
    angle = np.arctan2(given.V[:, 2], given.V[:, 1])
    return Surface(np.stack([given.V[:, 0], RADIUS * angle, 0 * angle], axis=1), given.F)


def striped(surface: Surface, kept=None, label=None) -> StripedSheet:
    """Some cells of a surface, with labels of theirs."""
    kept = np.ones(surface.m, dtype=bool) if kept is None else kept
    label = np.zeros(surface.m, dtype=np.int64) if label is None else label
    used, F = np.unique(surface.F[kept], return_inverse=True)
    rows = csr_array(eye_array(surface.n, format="csr")[used])
    return StripedSheet(F.reshape(-1, 3), rows, label[kept], np.zeros(int(kept.sum()), dtype=bool))


def cylinder_grid(surface: Surface) -> StripedSheet:
    """Two members along the cylinder and two across, with their crossings; the middle is an opening."""
    angle, x = np.arctan2(*surface.centroids.T[[2, 1]]) / (np.pi / 2), surface.centroids[:, 0]
    along, across = (x < 0.25) | (x > 0.75), (angle < 0.2) | (angle > 0.8)
    return striped(surface, along | across, (along + 2 * across).astype(np.int64))


def draft_of(surface: Surface, sheet: StripedSheet):
    kept = Surface(surface.V[sheet.weights.indices], sheet.F)
    D = offsets(surface, T).D
    solid = thicken(kept, D[sheet.weights.indices])
    curved = replace(_curved(surface, kept, sheet), striped=lambda: sheet)
    part = replace(prepare(part_of(solid, "strip", 10**6)), curved=lambda: curved)
    return part, solid, curved


def _curved(surface: Surface, kept: Surface, sheet: StripedSheet):
    parent = np.zeros(kept.m, dtype=np.int64)
    return curved_sheet(surface, Sheet(kept, parent, parent, sheet.weights), T)


def lifting_of(surface: Surface) -> Lifting:
    curved = _curved(surface, surface, striped(surface))
    return Lifting.from_sheet(surface, curved)


def flat_model(corners: np.ndarray) -> tuple[NetModel, list]:
    """One region over the plane between corners (k, 2), 40 mm thick; with its loop."""
    model, k = NetModel(), len(corners)
    for i in range(k):
        line = corners[i] + np.arange(4)[:, None] / 3 * (corners[(i + 1) % k] - corners[i])
        both = [np.c_[line, np.full(4, z)] for z in (20.0, -20.0)]
        model.edges.append(NetEdge(i, (i + 1) % k, np.concatenate(both, axis=1)))
    return model, [(i, True) for i in range(k)]


def asked(gap: float, off: float) -> FaceLimits:
    """Of trimmed faces, wherever their poles are."""
    return FaceLimits(gap, off, np.array([[-np.inf] * 3, [np.inf] * 3]))
