"""A cut sheet and its loads on finer and finer meshes: the same structure, every triangle in four."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.pipeline import sheet_load
from dsfab.slicing import Sheet
from dsfab.statics import SpreadLoad
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.surface import LoadCase, Surface

ROUNDED = 1e-12
"""Barycentric weights below this are zero: halving many times would else leave dust."""


def finer(sheet: Sheet, smooth: SmoothSurface) -> Sheet:
    """Every triangle in four, the points on the smooth surface; the old vertices come first.

    Weights are halved along edges and stay barycentric on the uncut surface: supports and loads are found by them.
    """
    F, edges, n = sheet.surface.F, sheet.surface.edges, sheet.surface.n
    a, b = edges.ends.T
    weights = csr_array(vstack([sheet.weights, 0.5 * (sheet.weights[a] + sheet.weights[b])]))
    weights.data[weights.data < ROUNDED] = 0.0
    weights.eliminate_zeros()
    mid = n + edges.of
    parts = [np.stack([F[:, k], mid[:, k], mid[:, k - 1]], axis=1) for k in range(3)]
    surface = Surface(smooth.points(weights), np.concatenate([*parts, mid]))
    return Sheet(surface, np.tile(sheet.parent, 4), np.tile(sheet.family, 4), weights)


def meshes(sheet: Sheet, smooth: SmoothSurface) -> Iterator[Sheet]:
    """The cut mesh with its points on the smooth surface, then finer and finer ones, without end."""
    mesh = replace(sheet, surface=Surface(smooth.points(sheet.weights), sheet.surface.F))
    while True:
        yield mesh
        mesh = finer(mesh, smooth)


def shares(sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, Floats]:
    """(n, 3) newtons of each load on the vertices of the uncut surface whose surroundings the sheet still has.

    loads : on the sheet (`dsfab.pipeline.handover.sheet_loads`); a force between vertices goes to those it lies
            between. Their sum is kept.
    """
    return {name: np.asarray(sheet.weights.T @ load.force) for name, load in loads.items()}


def on_mesh(
    surface: Surface, sheet: Sheet, given: Mapping[str, LoadCase], forces: Mapping[str, Floats]
) -> tuple[dict[str, LoadCase], dict[str, SpreadLoad]]:
    """Supports and loads on a sheet of the uncut surface, on whatever mesh it is.

    given  : on the uncut surface.    forces : (n, 3) newtons, `shares` of them.

    A force on a vertex is spread over the material around it, in proportion to the hat function of the uncut mesh: a
    load has the same place and size on every finer mesh, and no force acts on a point, for which a sheet in its plane
    has no finite answer. The whole of it is kept to the last digit.
    """
    F, areas = sheet.surface.F, sheet.surface.areas
    hats = csr_array(sheet.weights[F[:, 0]] + sheet.weights[F[:, 1]] + sheet.weights[F[:, 2]])  # 3 x mean on each face
    mass = np.asarray(hats.T @ areas)
    cases, spreads = {}, {}
    for name, load in given.items():
        density = np.divide(forces[name], mass[:, None], out=np.zeros_like(forces[name]), where=mass[:, None] > 0)
        spreads[name] = SpreadLoad.on(sheet.surface, np.asarray(hats @ density))
        cases[name] = replace(sheet_load(surface, sheet, load), force=spreads[name].vertex_forces(sheet.surface))
    return cases, spreads
