"""Stiffness matrix of a sheet: sum of membrane and bending stiffness."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import StaticsError
from dsfab.core.sparse import Factor, NotPositiveDefinite, factorise
from dsfab.statics.assembly import matrix_sum
from dsfab.statics.bending import bending_stiffness, curvatures, hinge_blocks
from dsfab.statics.elements import PAPER, Elements, elements_of
from dsfab.statics.membrane import constant_blocks, corner_strains, membrane_stiffness
from dsfab.statics.model import Law, Material, SheetModel
from dsfab.statics.solve import flat_axis, held_unknowns
from dsfab.surface import LoadCase, Surface

Row = Callable[[str], AbstractContextManager[object]]
"""A function that returns a context manager, which adds the time of its `with` block to a row in a table of times."""


def sheet_stiffness(sheet: SheetModel, elements: Elements, row: Row = nullcontext) -> csr_array:
    """Return the stiffness matrix (N, N), N/m, for the N unknowns of `elements`. row : records the time in a table."""
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
            K = matrix_sum(K, bending_stiffness(surface, material, thickness, elements, sheet.rigidity))
    return K


@dataclass(frozen=True, eq=False)
class FaceStiffness:
    """Stiffness matrix K of a sheet: the sum of s_f K_f, with a factor s_f and a matrix K_f for each face f.
    blocks  : (m, c, c) matrices K_f, N/m.    force : (count, k) load vectors of k loads, newtons.
    unknown : (m, c) index of the free unknown for each row of K_f; `count` for fixed unknowns.
    places  : (nnz, m) matrix that maps the factors s (m,) to the nonzero values of K.
    points  : vertices, then edge midpoints.    node : (count,) index in `points` for each free unknown."""

    blocks: Floats
    unknown: Ints
    count: int
    places: csr_array
    indices: Ints
    indptr: Ints
    springs: Floats
    points: Floats
    node: Ints
    force: Floats

    @classmethod
    def from_sheet(cls, sheet: SheetModel, loads: Sequence[LoadCase]) -> Self:
        """Return a sheet's stiffness. Raises StaticsError if the supports (from `loads`) leave a motion free."""
        surface = sheet.surface
        axis = flat_axis(surface, *loads)
        elements = elements_of("ranking")
        elements = elements if axis is None else elements.in_plane
        blocks, columns = face_blocks(surface, sheet.material, sheet.thickness, sheet.law, elements)
        free = ~held_unknowns(surface, loads, elements)
        touched = np.zeros(len(free), dtype=bool)
        touched[columns] = True
        numbers = np.flatnonzero(free & touched)
        count = len(numbers)
        number = np.full(len(free), count)
        number[numbers] = np.arange(count)
        moving = free[columns].any(axis=0) if axis is not None else np.ones(columns.shape[1], dtype=bool)
        blocks, unknown = np.ascontiguousarray(blocks[:, moving][:, :, moving]), number[columns[:, moving]]
        places, indices, indptr, diagonal = _sparse_pattern(blocks, unknown, count)
        springs, force = np.zeros(len(indices)), np.zeros((len(free), len(loads)))
        soft = np.zeros(len(free))
        soft[: 3 * surface.n] = loads[0].spring.ravel()
        springs[diagonal] = soft[numbers]
        force[: 3 * surface.n] = np.stack([load.force.ravel() for load in loads], axis=1)
        points = np.concatenate([surface.V, surface.V[surface.edges.ends].mean(axis=1)])
        node = np.where(numbers < 3 * surface.n, numbers // 3, numbers - 2 * surface.n)
        return cls(blocks, unknown, count, places, indices, indptr, springs, points, node, np.asarray(force[numbers]))

    def matrix(self, scale: Floats) -> csr_array:
        """Return the stiffness matrix (count, count), N/m. scale : (m,) factor on the stiffness of each face."""
        values = self.places @ scale + self.springs
        return csr_array((values, self.indices, self.indptr), shape=(self.count, self.count))

    def factor(self, scale: Floats, earlier: Factor | None = None) -> Factor:
        """Factorise the stiffness matrix. scale : (m,) factor on each face's stiffness.
        earlier : an earlier factorisation, which this method overwrites. Raises StaticsError for a mechanism."""
        try:
            if earlier is None:
                return factorise(self.matrix(scale), self.points, self.node)
            earlier.refactor(self.matrix(scale))
        except NotPositiveDefinite as error:
            raise StaticsError(
                "in the optimisation, the sheet moves freely; add supports, or check the mesh with `dsfab inspect`"
            ) from error
        return earlier

    def energies(self, x: Floats) -> Floats:
        """Return twice the strain energy (m, k), J, of each face at its full stiffness, for solutions x (count, k)."""
        moved = np.concatenate([x, np.zeros((1, x.shape[1]))])[self.unknown]
        return np.asarray(np.einsum("mck,mck->mk", moved, self.blocks @ moved))


def face_blocks(
    surface: Surface, material: Material, thickness: float, law: Law, elements: Elements
) -> tuple[Floats, Ints]:
    """Return the stiffness matrix (m, c, c) of each face, N/m, and the indices (m, c) of its c unknowns.
    c is 9 without bending, or 12 with mid-edge bending."""
    names = ("rotation",) if elements.bending else ()
    columns = elements.columns(surface, *names)
    blocks = np.zeros((surface.m, columns.shape[1], columns.shape[1]))
    B, areas = corner_strains(surface), surface.areas[:, None, None]
    blocks[:, :9, :9] = B.transpose(0, 2, 1) @ (material.membrane(law) * thickness @ B) * areas
    if elements.bending:
        B = curvatures(surface)
        blocks += B.transpose(0, 2, 1) @ (material.bending(thickness) @ B) * areas
    return blocks, columns


def _sparse_pattern(blocks: Floats, unknown: Ints, count: int) -> tuple[csr_array, Ints, Ints, Ints]:
    m, c = unknown.shape
    row, column = np.repeat(unknown, c, axis=1).ravel(), np.tile(unknown, (1, c)).ravel()
    free_entries = np.flatnonzero((row < count) & (column < count))
    keys, entry = np.unique(row[free_entries] * count + column[free_entries], return_inverse=True)
    places = csr_array((blocks.ravel()[free_entries], (entry, free_entries // (c * c))), shape=(len(keys), m))
    rows, columns = np.divmod(keys, count)
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=count))])
    return places, columns.astype(np.int32), indptr.astype(np.int32), np.flatnonzero(rows == columns)
