"""Stripes as earlier work draws them: a direction is chosen on every face, and one field integrated over all of them.

Where directions part or turn round a point no choice of signs is right everywhere, and the field is squeezed there. The
paper says that diffusion, which chooses none, is more regular; `dsfab reproduce` shows both.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from dsfab.arrays import Bools, Floats
from dsfab.diffusion import Modes, diffusion_operator
from dsfab.pipeline import Design
from dsfab.results import DiffusionResult
from dsfab.sparse import factorise
from dsfab.study.verdict.stresses import quantile
from dsfab.surface import Surface, hat_gradients

SOFT = 1e-9
"""Of the stiffness of the field, against a constant: pieces of a surface have no common height."""


class DrawnFamily(NamedTuple):
    """A family on a mode: its diffusion tensors D (m, 3, 3), the number and the values (n,) of its mode, and how many
    stripes there are for each unit of it."""

    D: Floats
    number: int
    mode: Floats
    frequency: float


def drawn_families(design: Design) -> tuple[DrawnFamily, DrawnFamily]:
    """Both families of a design on modes that are given by number."""
    found, pattern = design.diffusion, design.preset.pattern
    major, minor = (
        DrawnFamily(D, number := int(own.mode), modes.mode(number), own.frequency)
        for D, modes, own in (
            (found.tensors.major, found.major, pattern.major),
            (found.tensors.minor, found.minor, pattern.minor),
        )
    )
    return major, minor


def integrated_design(design: Design) -> Design:
    """A design on modes that are given by number, both replaced by integrated fields, with as many stripes a metre."""
    surface, tensors, modes = design.surface, design.diffusion.tensors, []
    for family in drawn_families(design):
        field = integrated_field(surface, across(family.D), ~tensors.isotropic)
        field *= typical_slope(surface, family.mode) / typical_slope(surface, field)
        modes.append(Modes(np.zeros(family.number), np.repeat(field[:, None], family.number, axis=1)))
    made = DiffusionResult(tensors, *modes)
    return Design.known(design.preset, surface=surface, statics=design.statics, diffusion=made)


def along(D: Floats) -> Floats:
    """(m, 3) unit directions in which tensors D (m, 3, 3) let the most through: stripes run along them."""
    return np.asarray(np.linalg.eigh(D)[1][:, :, 2])


def across(D: Floats) -> Floats:
    """(m, 3) unit directions in the faces' planes in which tensors D (m, 3, 3) let the least through.

    Of the three eigenvalues 0, 1 and r that is the one in the middle; stripes lie across it.
    """
    return np.asarray(np.linalg.eigh(D)[1][:, :, 1])


def integrated_field(surface: Surface, direction: Floats, clear: Bools) -> Floats:
    """(n,) metres: the field u whose gradient is nearest to the directions, in the mean square over clear faces.

    direction : (m, 3) units up to sign.    clear : (m,) faces that have one; on others the field is as flat as can be.
    """
    wanted = signed(surface, direction) * clear[:, None]
    pull = np.einsum("mik,mk->mi", hat_gradients(surface), wanted) * surface.areas[:, None]
    K = diffusion_operator(surface, np.broadcast_to(np.eye(3), (surface.m, 3, 3)))
    K = csr_array(K + SOFT * K.diagonal().mean() * eye_array(surface.n))
    b: Floats = np.bincount(surface.F.ravel(), pull.ravel(), minlength=surface.n).astype(np.float64)
    return np.asarray(factorise(K, surface.V)(b))


def signed(surface: Surface, direction: Floats) -> Floats:
    """(m, 3) the directions with signs that agree from face to face along that tree of faces which turns the least."""
    i, j = surface.edges.pairs.T // 3
    dot = np.einsum("ek,ek->e", direction[i], direction[j])
    turn = coo_array((1.0 + 1e-6 - np.abs(dot), (i, j)), shape=(surface.m, surface.m)).tocsr()
    tree = minimum_spanning_tree(turn)
    count, piece = connected_components(tree, directed=False)
    out = direction.copy()
    for k in range(count):
        order, before = breadth_first_order(tree, int(np.argmax(piece == k)), directed=False)
        for face in order[1:].tolist():
            if out[face] @ out[before[face]] < 0:
                out[face] = -out[face]
    return out


def typical_slope(surface: Surface, value: Floats) -> float:
    """The median over the area of the length of the gradient of (n,) values, per metre."""
    slope = np.linalg.norm(np.einsum("mik,mi->mk", hat_gradients(surface), value[surface.F]), axis=1)
    return quantile(slope, surface.areas, 0.5)
