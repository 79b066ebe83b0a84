"""A cut sheet and its loads on finer and finer meshes: the same structure, every triangle in four."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.pipeline import sheet_supports
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


class Shares(NamedTuple):
    """What a load is on every mesh of a sheet, newtons.

    vertices : (n, 3) on the surroundings of each vertex of the uncut surface that the sheet still has.
    faces    : (p, 3) on the material in each face of the uncut surface, up to the last that has some.
    """

    vertices: Floats
    faces: Floats


def shares(sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, Shares]:
    """Those of each load; they sum to its forces.

    loads : on the sheet (`dsfab.pipeline.sheet_loads`); a force between vertices goes to those it lies between.
    """
    areas, last = sheet.surface.areas[:, None], int(sheet.parent.max()) + 1
    found = {}
    for name, load in loads.items():
        spread = np.zeros((len(areas), 3)) if load.parts is None else load.parts.traction * areas
        on_faces: Floats = np.stack([np.bincount(sheet.parent, x, last) for x in spread.T], axis=1).astype(np.float64)
        found[name] = Shares(np.asarray(sheet.weights.T @ load.point), on_faces)
    return found


def on_mesh(
    surface: Surface, sheet: Sheet, given: Mapping[str, LoadCase], forces: Mapping[str, Shares]
) -> tuple[dict[str, LoadCase], dict[str, SpreadLoad]]:
    """Supports and loads on a sheet of the uncut surface, on whatever mesh it is.

    given  : on the uncut surface.    forces : `shares` of them.

    A force on a vertex is spread over the material around it, in proportion to the hat function of the uncut mesh: a
    load has the same place and size on every finer mesh, and no force acts on a point, for which a sheet in its plane
    has no finite answer. What is on a face is even over the material there. The whole of it is kept to the last digit.
    """
    F, areas = sheet.surface.F, sheet.surface.areas
    hats = csr_array(sheet.weights[F[:, 0]] + sheet.weights[F[:, 1]] + sheet.weights[F[:, 2]])  # 3 x mean on each face
    mass = np.asarray(hats.T @ areas)
    material = np.bincount(sheet.parent, areas)
    cases, spreads = {}, {}
    for name, load in given.items():
        around, within = forces[name]
        density = np.divide(around, mass[:, None], out=np.zeros_like(around), where=mass[:, None] > 0)
        even = within / np.where(material > 0, material, 1.0)[:, None]
        spreads[name] = SpreadLoad.on(sheet.surface, np.asarray(hats @ density) + even[sheet.parent])
        cases[name] = replace(sheet_supports(surface, sheet, load), force=spreads[name].vertex_forces(sheet.surface))
    return cases, spreads
