"""Stripes as earlier work draws them: a direction is chosen on every face, and one field integrated over all of them.

Where directions part or turn round a point no choice of signs is right everywhere, and the field is squeezed there. The
paper says that diffusion, which chooses none, is more regular; `dsfab reproduce` shows both.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from dsfab.arrays import Bools, Floats
from dsfab.diffusion import Modes
from dsfab.pipeline import Design
from dsfab.results import DiffusionResult
from dsfab.sparse import factorise
from dsfab.surface import Surface, hat_gradients
from dsfab.surface.hats import assemble

SOFT = 1e-9
"""Of the stiffness of the field, against a constant: pieces of a surface have no common height."""


def integrated_design(design: Design) -> Design:
    """A design on modes that are given by number, both replaced by integrated fields, with as many stripes a metre."""
    surface, found = design.surface, design.diffusion
    pattern, modes = design.preset.pattern, []
    for D, family, own in (
        (found.tensors.major, found.major, pattern.major),
        (found.tensors.minor, found.minor, pattern.minor),
    ):
        field = integrated_field(surface, across(D), ~found.tensors.isotropic)
        number = int(own.mode)
        field *= typical_slope(surface, family.mode(number)) / typical_slope(surface, field)
        modes.append(Modes(np.zeros(number), np.repeat(field[:, None], number, axis=1)))
    made = DiffusionResult(found.tensors, *modes)
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
    hats = hat_gradients(surface)
    wanted = signed(surface, direction) * clear[:, None]
    blocks = np.einsum("mik,mjk->mij", hats, hats) * surface.areas[:, None, None]
    pull = np.einsum("mik,mk->mi", hats, wanted) * surface.areas[:, None]
    K = assemble(surface, blocks)
    K = assemble(surface, blocks, np.full(surface.n, SOFT * K.diagonal().mean()))
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
    order = np.argsort(slope)
    total = np.cumsum(surface.areas[order])
    return float(slope[order[np.searchsorted(total, total[-1] / 2)]])
