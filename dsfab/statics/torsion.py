"""Ribs that are twisted: a bar of rectangular section is softer than the strip of a thin sheet that it is taken for."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.statics.bending import hhj_stiffness, midedge_stiffness
from dsfab.statics.elements import Elements, voigt
from dsfab.statics.model import SheetModel
from dsfab.surface import Surface, half_edges
from dsfab.surface.fields import tangents

NARROWEST = 0.01
"""Thicknesses: ribs are taken to be no narrower, so that equations can be solved."""

BORDER = 12
"""Points on the border for a typical edge."""

APART = np.radians(60)
"""A disc touches the border in two places at least as far from each other, seen from its centre; nearer ones are a kink
of one side [Ma, Bae and Choi 2012]."""

STEPS = 20
"""Of shrinking discs, at most; 5 to 8 are taken."""

TOUCH = 1e-3
"""Share of its radius by which the border may reach into a disc."""


def torsion_share(ratio: Floats) -> Floats:
    """(...) of the torsional stiffness G w h^3 / 3 of a thin strip, what a rectangle has; ratio : w / h, (...).

    1 - .63 h / w (1 - h^4 / 12 w^4) where it is wider than thick, else the same with w and h exchanged, times w^2 / h^2
    [Saint-Venant 1855; Timoshenko and Goodier 1970, 109].
    """
    ratio = np.maximum(ratio, NARROWEST)
    flat = np.minimum(ratio, 1 / ratio)
    lost = 0.63 * flat * (1 - flat**4 / 12)
    return np.asarray((1 - lost) * np.minimum(ratio, 1.0) ** 2)


class RibShape(NamedTuple):
    """widths : (m,) metres of the ribs around the middle of each face; inf on a closed sheet without openings.
    along : (m, 3) unit vectors in the face, along the border next to it."""

    widths: Floats
    along: Floats


def rib_shape(surface: Surface) -> RibShape:
    """How wide the material is around each face: the largest disc in it that touches the border where that is nearest
    [medial discs, Blum 1967], and which way this runs."""
    border = np.flatnonzero(surface.edges.boundary[surface.edges.of.ravel()])
    if not len(border):
        return RibShape(np.full(surface.m, np.inf), tangents(surface)[:, 0])
    points, of = _points_on(surface, border)
    begin, end = half_edges(surface.F)
    way = surface.V[end[border]] - surface.V[begin[border]]
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    tree = cKDTree(points)
    small = float(np.median(surface.edge_lengths))
    radius = _disc_radii(tree, points, np.cross(surface.normals[border // 3], way)[of], small, surface.size)
    near = np.asarray(tree.query(surface.centroids)[1])
    along = way[of[near]]
    along -= np.einsum("mx,mx->m", along, surface.normals)[:, None] * surface.normals
    return RibShape(2 * radius[near], along / np.linalg.norm(along, axis=1, keepdims=True))


def _disc_radii(tree: cKDTree, points: Floats, inward: Floats, small: float, largest: float) -> Floats:
    """(k,) of the largest discs that touch the border in points (k, 3), on the inner side, and hold no other of them:
    small ones grow until they do, and shrink until they do not [Ma, Bae and Choi 2012].

    Of discs that begin as large as the surface, the points next to their far centres take ten times as long to find.
    """

    def held(which: Ints) -> tuple[Bools, Floats]:
        """Of which discs another point is in, and the radii of those that touch it as well."""
        p, n, r = points[which], inward[which], radius[which]
        away, hit = tree.query(p + r[:, None] * n)
        off = points[hit] - p
        high = np.einsum("kx,kx->k", n, off)
        shorter = np.einsum("kx,kx->k", off, off) / np.maximum(2 * high, np.finfo(float).tiny)
        opening = np.arccos(np.clip(1 - high / np.maximum(shorter, np.finfo(float).tiny), -1, 1))
        return (away < (1 - TOUCH) * r) & (high > 0) & (shorter < r) & (opening > APART), shorter

    radius = np.full(len(points), min(small, largest))
    empty = np.arange(len(points))
    while len(empty):
        empty = empty[~held(empty)[0] & (radius[empty] < largest)]
        radius[empty] = np.minimum(2 * radius[empty], largest)
    moving = np.arange(len(points))
    for _ in range(STEPS):
        shrinks, shorter = held(moving)
        moving = moving[shrinks]
        radius[moving] = shorter[shrinks]
        if not len(moving):
            break
    return radius


def torsion_loss(sheet: SheetModel, elements: Elements, ribs: RibShape) -> csr_array:
    """What twist about the directions of ribs adds to K where they are bars: negative, over the unknowns of `elements`.

    Of each face D is lessened by (1 - share) D_66 t t^T, with t : kappa the twist 2 kappa_ab along and across the rib.
    Raises ValueError for bending that is neither `hhj` nor `midedge`.
    """
    if elements.bending not in ("hhj", "midedge"):
        raise ValueError(f"{elements}: torsion of ribs is lessened for hhj and midedge alone")
    share = torsion_share(ribs.widths / sheet.thickness)
    a = np.einsum("mx,max->ma", ribs.along, tangents(sheet.surface))
    t = voigt(a, np.stack([-a[:, 1], a[:, 0]], axis=1)) * np.array([2.0, 2.0, 1.0])
    stiff = sheet.material.bending(sheet.thickness)[2, 2]
    lost = (stiff * (1 - share))[:, None, None] * t[:, :, None] * t[:, None]
    return -(hhj_stiffness if elements.bending == "hhj" else midedge_stiffness)(sheet.surface, lost, elements)


def _points_on(surface: Surface, border: Ints) -> tuple[Floats, Ints]:
    """(k, 3) points on half-edges (b,), evenly, and the number of each one's half-edge in `border`."""
    begin, end = (surface.V[vertices[border]] for vertices in half_edges(surface.F))
    step = float(np.median(surface.edge_lengths)) / BORDER
    count = np.maximum(1, np.ceil(np.linalg.norm(end - begin, axis=1) / step)).astype(np.int64)
    of = np.repeat(np.arange(len(border)), count)
    at = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    return begin[of] + at[:, None] * (end - begin)[of], of
