"""`WedgeModel`: a cut sheet as a solid of quadratic wedges (C3D15), with what holds it and what presses on it."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import StaticsError
from dsfab.statics import Material
from dsfab.study.finite_elements import held_nodes
from dsfab.study.verification.solids import Wedges, wedges
from dsfab.surface import LoadCase, Surface

THROUGH = (1 / 6, 1 / 6, 2 / 3)
"""Of a force on a vertex of the sheet, what goes to its nodes below, above and between."""


@dataclass(frozen=True, eq=False)
class WedgeModel:
    """solid : nodes (p, 3), metres, and elements.    fixed : (q, 2) nodes and directions that do not move.
    opposite : (r, 3) two nodes and a direction in which they move oppositely: the sheet may turn there.
    force    : (p, 3) newtons.
    """

    solid: Wedges
    material: Material
    fixed: Ints
    opposite: Ints
    force: Floats


def solid_model(surface: Surface, normal: Floats, thickness: float, material: Material, load: LoadCase) -> WedgeModel:
    """One wedge through the thickness for each triangle.

    normal : (n, 3) at the vertices, unit vectors, all to one side.    thickness : metres.
    Supports hold the middle of the thickness, and clamped edges all of it. Raises StaticsError for springs.
    """
    if load.spring.any():
        raise StaticsError("springs of supports are not in the nonlinear check; hold these supports rigidly for it")
    across = normal[surface.edges.ends].sum(axis=1)
    normals = iter((normal, across / np.linalg.norm(across, axis=1, keepdims=True)))
    solid = wedges(surface, thickness, lambda points: (points, next(normals)))
    held = held_nodes(surface, {"HELD": load.fixed})["HELD"]
    fixed, opposite = _supports(solid, surface, load, held)
    force = np.zeros_like(solid.nodes)
    for column, share in zip(solid.columns.T, THROUGH, strict=True):
        np.add.at(force, column, share * load.force)
    return WedgeModel(solid, material, fixed, opposite, force)


def _supports(solid: Wedges, surface: Surface, load: LoadCase, held: Bools) -> tuple[Ints, Ints]:
    """`fixed` and `opposite`, of directions (n + e, 3) that are held at vertices and at middles of edges."""
    n = surface.n
    vertex, way = np.nonzero(held[:n])
    edge, along = np.nonzero(held[n:])
    fixed = np.stack([solid.columns[vertex, 2], way], axis=1)
    pairs = np.concatenate(
        [
            np.concatenate([solid.columns[vertex, :2], way[:, None]], axis=1),
            np.concatenate([solid.middles[edge], along[:, None]], axis=1),
        ]
    )
    edges = np.flatnonzero(load.clamped)
    stiff = np.unique(np.concatenate([solid.columns[surface.edges.ends[edges]].ravel(), solid.middles[edges].ravel()]))
    whole = np.stack([np.repeat(stiff, 3), np.tile(np.arange(3), len(stiff))], axis=1)
    return np.unique(np.concatenate([fixed, whole]), axis=0), pairs[~np.isin(pairs[:, :2], stiff).any(axis=1)]
