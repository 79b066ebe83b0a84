"""Roofs with a fold, their solids and their openings."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.design.output.files import curved_sheet
from dsfab.export.cad.step.strategies import prepare
from dsfab.export.part import part_of
from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.thickening import offsets, thicken
from tests.shapes import grid

T, SLOPE = 0.04, 0.6


def ridged_roof(cells: int = 10, slope: float = SLOPE) -> Surface:
    """Two strips of 2 x 1 m in plan, which rise to a ridge along x."""
    flat = grid(2 * cells, 2 * cells, 2.0, 2.0)
    return Surface(flat.V + np.array([0, 0, slope]) * (1 - np.abs(flat.V[:, 1:2] - 1)), flat.F)


def folded_part(surface: Surface, void: np.ndarray):
    """The solid without the faces `void` of a surface, the part that STEP takes of it, and its sheet."""
    used, F = np.unique(surface.F[~void], return_inverse=True)
    kept = Surface(surface.V[used], F.reshape(-1, 3))
    weights = csr_array(eye_array(surface.n, format="csr")[used])
    parent = np.flatnonzero(~void)
    curved = curved_sheet(surface, Sheet(kept, parent, np.zeros(kept.m, dtype=np.int64), weights), T)
    solid = thicken(kept, offsets(surface, T).D[used])
    part = replace(prepare(part_of(solid, "roof", 10**6)), curved=lambda: curved, step="planar", tolerance=1.0)
    return part, solid, curved


def openings(surface: Surface) -> np.ndarray:
    """(m,) the faces of one square opening in a strip, and of one across the ridge."""
    x, y = surface.centroids[:, 0], surface.centroids[:, 1]
    return ((x > 0.2) & (x < 0.6) & (y > 0.3) & (y < 0.7)) | ((x > 1.2) & (x < 1.6) & (y > 0.6) & (y < 1.4))
