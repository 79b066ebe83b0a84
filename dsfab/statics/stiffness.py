"""The stiffness of a sheet: membrane and bending together."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from scipy.sparse import csr_array

from dsfab.statics.bending import bending_stiffness, hinge_blocks
from dsfab.statics.blocks import added
from dsfab.statics.elements import PAPER, Elements
from dsfab.statics.membrane import constant_blocks, membrane_stiffness
from dsfab.statics.model import SheetModel

Row = Callable[[str], AbstractContextManager[object]]
"""Takes the time of what is done inside, under a name."""


def sheet_stiffness(sheet: SheetModel, elements: Elements, row: Row = nullcontext) -> csr_array:
    """(N, N) K, N/m, over the unknowns of `elements`: membrane and, where they have it, bending.

    row : is opened as "membrane", then as "bending". The paper's elements stand on the same pairs of vertices: their
          blocks are added, and the one matrix that is made of them counts as bending.
    """
    surface, material, thickness = sheet.surface, sheet.material, sheet.thickness
    if elements == PAPER:
        with row("membrane"):
            blocks = constant_blocks(surface, material.membrane(sheet.law) * thickness, elements)
        with row("bending"):
            return (blocks + hinge_blocks(surface, material, thickness)).matrix()
    with row("membrane"):
        K = membrane_stiffness(surface, material, thickness, sheet.law, elements)
    if elements.bending:
        with row("bending"):
            K = added(K, bending_stiffness(surface, material, thickness, elements))
    return K
