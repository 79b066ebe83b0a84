"""Displacements and buckling factors of a sheet if its thickness changes, from one factorisation.

The stiffness at thickness t is K(t) = t A + t^3 B + S: membrane, bending, springs. The loads are f(t) = f0 + t f1.
Solutions and their derivatives in t form a reduced basis [Noor and Peters 1980; Grimme 1997]. Buckling modes and
derivatives form a second basis [Rayleigh-Ritz]."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.linalg import eigh, qr, solve
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import StaticsError
from dsfab.statics.bending import bending_stiffness
from dsfab.statics.boundary_conditions import with_springs
from dsfab.statics.elements import Elements, elements_of, needle_message
from dsfab.statics.factorisation import Factor, FactorCache
from dsfab.statics.membrane import membrane_stiffness
from dsfab.statics.model import SheetModel
from dsfab.statics.modes import geometric_products, geometric_stiffness, largest_eigenpairs, mode_supports
from dsfab.statics.solve import Equilibrium, equilibrium_of_unknowns, flat_axis, held_unknowns
from dsfab.statics.stress import stress
from dsfab.surface import LoadCase, Surface

INDEPENDENT = 1e-10
"""A vector is independent of earlier vectors if at least this fraction of it lies outside their span."""
ACCURATE = 2.0
"""A basis made at thickness t is accurate for thicknesses between t / ACCURATE and ACCURATE * t.
Largest errors on cut sheets: 1 % in displacements, 5 % in buckling factors. `SheetModel.rigidity` is scaled by t^3,
so the torsion of ribs narrower than three thicknesses can be wrong by a third."""
DERIVATIVES, MODE_DERIVATIVES = 3, 2  # Number of derivatives of solutions and modes by the thickness.
MODES = 3  # Number of buckling modes for each load case; with another thickness, another mode may be the lowest.
CASES = 3  # The basis has buckling modes of the 3 load cases with the largest compression.


@dataclass(frozen=True, eq=False)
class ThicknessStiffness:
    """Stiffness matrix t A + t^3 B of a sheet with u unknowns, for any thickness t, and its supports.
    membrane : A (u, u), N/m2.     bending : B (u, u), N/m4.
    load     : load case with the supports.    is_held : (u,) mask of unknowns that cannot move."""

    surface: Surface
    elements: Elements
    membrane: csr_array
    bending: csr_array
    load: LoadCase
    is_held: Bools

    @classmethod
    def from_sheet(cls, sheet: SheetModel, loads: Sequence[LoadCase], elements: Elements) -> Self:
        """Return the stiffness of a sheet for any thickness. Raises StaticsError if supports leave a motion free."""
        surface, material = sheet.surface, sheet.material
        is_held = held_unknowns(surface, loads, elements, plane=elements.bending is None)
        membrane = membrane_stiffness(surface, material, 1.0, sheet.law, elements)
        bending = csr_array(0.0 * membrane)
        if elements.bending:
            bending = bending_stiffness(surface, material, 1.0, elements, sheet.bending / sheet.thickness**3)
        return cls(surface, elements, membrane, bending, loads[0], is_held)

    def matrix(self, thickness: float) -> csr_array:
        """Return the stiffness matrix (u, u), N/m, for a thickness (m), including spring supports."""
        return with_springs(csr_array(thickness * self.membrane + thickness**3 * self.bending), self.load)

    def product(self, thickness: float, x: Floats) -> Floats:
        """Return K x for k vectors x (u, k). K : stiffness matrix for a thickness (m), without spring supports."""
        return np.asarray(thickness * (self.membrane @ x) + thickness**3 * (self.bending @ x))

    def with_derivatives(self, thickness: float, factor: Factor, x: Floats, count: int) -> list[Floats]:
        """Return [x, P x, ..., P^count x] for vectors x (u, k), with P = K^-1 dK/dt.
        K is the stiffness matrix for a thickness t. factor : factorisation of K."""
        vectors = [x]
        for _ in range(count):
            forces = self.membrane @ vectors[-1] + 3 * thickness**2 * (self.bending @ vectors[-1])
            vectors.append(factor.displacements(forces))
        return vectors

    def projection(self, basis: Floats) -> Floats:
        """Return the membrane, bending and spring stiffness (3, b, b), projected on b basis vectors (u, b)."""
        corners = basis[: self.load.spring.size]
        springs = corners.T @ (self.load.spring.ravel()[:, None] * corners)
        parts = basis.T @ (self.membrane @ basis), basis.T @ (self.bending @ basis), springs
        return np.array([_without_negative_eigenvalues(part) for part in parts])

    def basis(self, vectors: Floats, thickness: float) -> Floats:
        """Return basis vectors (u, b) of the space that `vectors` (u, c) span, orthonormal in the strain energy."""
        K = self.matrix(thickness)
        weight = np.sqrt(K.diagonal())  # makes metres and radians comparable
        columns = _independent_columns(vectors * weight[:, None]) / np.where(weight > 0, weight, 1.0)[:, None]
        energies = np.einsum("ui,ui->i", columns, K @ columns)
        images, count = np.zeros_like(columns), 0
        for x, before in zip(columns.T.copy(), energies, strict=True):
            for _ in range(2):  # repeat for accuracy [Giraud et al. 2005]
                x -= columns[:, :count] @ (images[:, :count].T @ x)
            image = K @ x
            energy = float(x @ image)
            if energy > INDEPENDENT**2 * before:
                columns[:, count], images[:, count] = x / np.sqrt(energy), image / np.sqrt(energy)
                count += 1
        return columns[:, :count]


def _without_negative_eigenvalues(part: Floats) -> Floats:
    values, vectors = np.linalg.eigh((part + part.T) / 2)
    return np.asarray((vectors * values.clip(min=0)) @ vectors.T)


def _independent_columns(columns: Floats) -> Floats:
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    q, r, _ = qr(scaled, mode="economic", pivoting=True)
    return np.asarray(q[:, np.abs(np.diag(r)) > INDEPENDENT])


@dataclass(frozen=True, eq=False)
class ThicknessBasis:
    """Reduced bases for displacements and buckling of a sheet at thicknesses near the sheet's thickness.
    loads     : the k loads by name, at the thickness of `sheet`.
    constant, per_metre : f0 (u, k), N, and f1 (u, k), N/m. At thickness t, the loads are f0 + t f1.
    vectors   : (u, b) basis of the displacements.
    reduced, modes : (3, b, b), (3, s, s) membrane, bending, spring stiffness, projected on `vectors`, on s modes.
    geometric : (b, s, s) minus the geometric stiffness on these modes, for each of `vectors` and thickness 1 m."""

    sheet: SheetModel
    loads: Mapping[str, LoadCase]
    stiffness: ThicknessStiffness
    constant: Floats
    per_metre: Floats
    vectors: Floats
    reduced: Floats
    modes: Floats
    geometric: Floats

    @classmethod
    def from_sheet(cls, sheet: SheetModel, loads: Mapping[str, LoadCase], buckling: Sequence[str] = ()) -> Self:
        """Return bases for thicknesses from half to twice the thickness of `sheet`.
        buckling : names of loads to compute buckling factors for. Raises StaticsError if the sheet cannot be solved."""
        try:
            return cls._by_elements(sheet, loads, buckling, elements_of("displacement"))
        except StaticsError:
            if not needle_message(sheet.surface):
                raise
            return cls._by_elements(sheet, loads, buckling, elements_of("needles"))

    @classmethod
    def _by_elements(
        cls, sheet: SheetModel, loads: Mapping[str, LoadCase], buckling: Sequence[str], elements: Elements
    ) -> Self:
        surface = sheet.surface
        loads = {name: sheet.with_clamped_edges(load) for name, load in loads.items()}
        is_plane = flat_axis(surface, *loads.values()) is not None
        stiffness = ThicknessStiffness.from_sheet(sheet, [*loads.values()], elements.in_plane if is_plane else elements)
        across = stiffness
        if is_plane and buckling:
            across = ThicknessStiffness.from_sheet(sheet, [mode_supports(surface, stiffness.load).load], elements)
        constant, per_metre = _linear_loads(sheet, [*loads.values()], len(stiffness.is_held))
        directions = _independent_columns(np.where(stiffness.is_held[:, None], 0.0, np.hstack([constant, per_metre])))
        cases, thickness, modes = [[*loads].index(name) for name in buckling], sheet.thickness, list[Floats]()
        factor_of = FactorCache()
        factor = factor_of(surface, stiffness.matrix(thickness), stiffness.is_held)
        answers = stiffness.with_derivatives(thickness, factor, factor.displacements(directions), DERIVATIVES)
        if cases:
            forces = (constant + thickness * per_metre)[:, cases]
            resultants = thickness * _resultants(sheet, stiffness, answers[0] @ (directions.T @ forces))
            if across is not stiffness:
                factor = factor_of(surface, across.matrix(thickness), across.is_held)
            for lowest in _buckling_modes(across, resultants, factor):
                modes += across.with_derivatives(thickness, factor, lowest, MODE_DERIVATIVES)
        vectors = stiffness.basis(np.hstack(answers), thickness)
        shapes = across.basis(np.hstack(modes), thickness) if modes else np.zeros((len(across.is_held), 0))
        geometric = -geometric_products(surface, _resultants(sheet, stiffness, vectors), across.elements, shapes)
        reduced = stiffness.projection(vectors), across.projection(shapes)
        return cls(sheet, loads, stiffness, constant, per_metre, vectors, *reduced, geometric)

    def answers(self, thickness: float) -> dict[str, Equilibrium]:
        """Return the equilibrium of each load at a thickness (m), by name. Residuals are left at 0."""
        forces = self.constant + thickness * self.per_metre
        X = self.vectors @ self._coordinates(thickness)
        unbalanced = self.stiffness.product(thickness, X) - forces
        answers = {}
        for k, (name, load) in enumerate(self.loads_at(thickness).items()):
            solved = (self.stiffness.elements, unbalanced[:, k], X[:, k], self.stiffness.is_held)
            answer = equilibrium_of_unknowns(self.sheet.surface, load, *solved)
            answers[name] = replace(answer, compliance=float(forces[:, k] @ X[:, k]))
        return answers

    def loads_at(self, thickness: float) -> dict[str, LoadCase]:
        """Return the loads at a thickness (m), by name."""
        share = thickness / self.sheet.thickness
        return {name: load.of_thickness(self.sheet.surface, share) for name, load in self.loads.items()}

    def buckling_factors(self, thickness: float) -> dict[str, float]:
        """Return the lowest buckling factor of each load at a thickness (m); inf for a load that does not buckle."""
        minus_Kg = thickness * np.einsum("bk,bij->kij", self._coordinates(thickness), self.geometric)
        if not self.modes.size:
            return dict.fromkeys(self.loads, float("inf"))
        largest = (eigh(matrix, _sum(self.modes, thickness), eigvals_only=True)[-1] for matrix in minus_Kg)
        return {name: 1 / mu if mu > 0 else float("inf") for name, mu in zip(self.loads, largest, strict=True)}

    def _coordinates(self, thickness: float) -> Floats:
        forces = self.vectors.T @ (self.constant + thickness * self.per_metre)
        return np.asarray(solve(_sum(self.reduced, thickness), forces, assume_a="pos"))


def _sum(parts: Floats, thickness: float) -> Floats:
    return np.asarray(thickness * parts[0] + thickness**3 * parts[1] + parts[2])


def _linear_loads(sheet: SheetModel, loads: Sequence[LoadCase], size: int) -> tuple[Floats, Floats]:
    once, twice = np.zeros((2, size, len(loads)))
    for k, load in enumerate(loads):
        once[: load.force.size, k] = load.force.ravel()
        twice[: load.force.size, k] = load.of_thickness(sheet.surface, 2.0).force.ravel()
    return 2 * once - twice, (twice - once) / sheet.thickness


def _resultants(sheet: SheetModel, stiffness: ThicknessStiffness, x: Floats) -> Floats:
    surface, setting = sheet.surface, (stiffness.load, stiffness.elements, np.zeros(len(x)))
    moved = [equilibrium_of_unknowns(surface, *setting, column, stiffness.is_held) for column in x.T]
    return np.array([stress(surface, sheet.material, answer.u, sheet.law, answer.bubbles) for answer in moved])


def _buckling_modes(across: ThicknessStiffness, resultants: Floats, factor: Factor) -> list[Floats]:
    surface, modes = across.surface, list[Floats]()
    compression = [-np.linalg.eigvalsh(N)[:, 0].clip(max=0) @ surface.areas for N in resultants]
    for k in np.argsort(compression)[: -1 - CASES : -1]:
        if compression[k] > 1e-9 * np.linalg.norm(resultants[k], axis=(1, 2)) @ surface.areas:
            minus_Kg = -geometric_stiffness(surface, resultants[k], across.elements)
            with suppress(StaticsError):  # modes of a barely compressed sheet may not converge
                modes.append(largest_eigenpairs(minus_Kg, factor, MODES, are_results=False)[1].T)
    return modes
