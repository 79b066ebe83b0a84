"""Torsional stiffness of ribs, the narrow strips of a cut sheet."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.statics.elements import voigt
from dsfab.statics.model import SheetModel
from dsfab.surface import Surface, half_edges
from dsfab.surface.fields import tangents

APART = np.radians(60)
"""Two border points lie on opposite sides of a rib if they are at least this angle apart (radians).
The angle is measured at the centre of a disc between the points [Ma, Bae and Choi 2012]."""
LEAN = 0.5  # A border belongs to a face's rib only if cos(angle between border and face) is at least this.


def torsion_share(ratio: Floats) -> Floats:
    """Return the torsional stiffness of a bar with the rectangular section w x h, divided by G w h^3 / 3.
    ratio : (...) w / h.    [Saint-Venant 1855; Timoshenko and Goodier 1970, 109]"""
    ratio = np.maximum(ratio, 0.01)  # at lower ratios, the equations of the sheet cannot be solved accurately
    flat = np.minimum(ratio, 1 / ratio)
    lost = 0.63 * flat * (1 - flat**4 / 12)
    return np.asarray((1 - lost) * np.minimum(ratio, 1.0) ** 2)


class RibShape(NamedTuple):
    """Width and direction of the rib (strip of the cut sheet) at each face.
    widths : (m,) metres; inf for faces without a border.  along : (m, 3) unit vectors along the nearest border."""

    widths: Floats
    along: Floats


def rib_shape(surface: Surface) -> RibShape:
    """Return the width of the rib (narrow strip) at each face, and the direction of its nearest border [Blum 1967]."""
    border = np.flatnonzero(surface.edges.boundary[surface.edges.of.ravel()])
    if not len(border):
        return RibShape(np.full(surface.m, np.inf), tangents(surface)[:, 0])
    points, h = _border_points(surface, border)
    begin, end = half_edges(surface.F)
    d = surface.V[end[border]] - surface.V[begin[border]]
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    tree = cKDTree(points)
    small = float(np.median(surface.edge_lengths))
    radius = _disc_radii(tree, points, np.cross(surface.normals[border // 3], d)[h], small, surface.size)
    nearest = np.asarray(tree.query(surface.centroids)[1])
    along = d[h[nearest]]
    along -= np.einsum("mx,mx->m", along, surface.normals)[:, None] * surface.normals
    length = np.linalg.norm(along, axis=1)
    leans = length < LEAN  # at a fold, the nearest border may be on another plate
    along = np.where(leans[:, None], tangents(surface)[:, 0], along / np.maximum(length, LEAN)[:, None])
    return RibShape(np.where(leans, np.inf, 2 * radius[nearest]), along)


def _disc_radii(tree: cKDTree, points: Floats, inward: Floats, small: float, largest: float) -> Floats:
    def blocked(discs: Ints) -> tuple[Bools, Floats]:
        p, n, r = points[discs], inward[discs], radius[discs]
        away, hit = tree.query(p + r[:, None] * n)
        offset = points[hit] - p
        high = np.einsum("kx,kx->k", n, offset)
        shorter = np.einsum("kx,kx->k", offset, offset) / np.maximum(2 * high, np.finfo(float).tiny)
        opening = np.arccos(np.clip(1 - high / np.maximum(shorter, np.finfo(float).tiny), -1, 1))
        # a border point blocks a disc if its depth in the disc exceeds a thousandth of the radius
        return (away < (1 - 1e-3) * r) & (high > 0) & (shorter < r) & (opening > APART), shorter

    radius = np.full(len(points), min(small, largest))
    growing = np.arange(len(points))
    while len(growing):
        growing = growing[~blocked(growing)[0] & (radius[growing] < largest)]
        radius[growing] = np.minimum(2 * radius[growing], largest)
    moving = np.arange(len(points))
    for _ in range(20):  # mostly 5 to 8 steps suffice
        shrinks, shorter = blocked(moving)
        moving = moving[shrinks]
        radius[moving] = shorter[shrinks]
        if not len(moving):
            break
    return radius


def with_barlike_ribs(sheet: SheetModel, ribs: RibShape | None = None) -> SheetModel:
    """Return the sheet with bending stiffnesses that let its ribs twist like bars. ribs : `rib_shape`, if known."""
    ribs = ribs or rib_shape(sheet.surface)
    D, share = sheet.material.bending(sheet.thickness), torsion_share(ribs.widths / sheet.thickness)
    a = np.einsum("mx,max->ma", ribs.along, tangents(sheet.surface))
    t = voigt(a, np.stack([-a[:, 1], a[:, 0]], axis=1)) * np.array([2.0, 2.0, 1.0])
    lost = (D[2, 2] * (1 - share))[:, None, None] * t[:, :, None] * t[:, None]
    return replace(sheet, rigidity=D - lost)


def _border_points(surface: Surface, border: Ints, points_per_edge: int = 12) -> tuple[Floats, Ints]:
    begin, end = (surface.V[vertices[border]] for vertices in half_edges(surface.F))
    step = float(np.median(surface.edge_lengths)) / points_per_edge
    count = np.maximum(1, np.ceil(np.linalg.norm(end - begin, axis=1) / step)).astype(np.int64)
    half_edge = np.repeat(np.arange(len(border)), count)
    parameter = (np.arange(len(half_edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[half_edge]
    return begin[half_edge] + parameter[:, None] * (end - begin)[half_edge], half_edge
