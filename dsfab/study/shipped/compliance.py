"""Does the solid in the file carry as the sheet of the design does? Ten-node tetrahedra beside shell elements."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Bools, Floats
from dsfab.design import Design
from dsfab.pipeline.handover import sheet_loads
from dsfab.statics import VERDICT, flat_axis, solve_cases
from dsfab.study.shipped.elastic import Holding, SolidModel, compliances
from dsfab.study.shipped.reading import Found
from dsfab.study.shipped.tetrahedra import tetrahedra
from dsfab.surface import LoadCase, Surface
from dsfab.thickening.offset import SHIFT

EDGE = 2.0
"""Longest edge on the solid's surface, in thicknesses; but not finer than `COARSE` of the solid's size."""

COARSE = 1 / 60
"""See `EDGE`: very thin sheets would take millions of tetrahedra, and quadratic ones bend well at 1 : 5."""

RIGID = 1e3
"""A rigid support is a spring of this many times Young's modulus times the thickness."""

LEVER = 0.8
"""Clamped edges are held at this share of half the thickness on both sides of the sheet."""


@dataclass(frozen=True)
class Carrying:
    """Compliances, joules, of the cut sheet as a shell and of the file as a solid, under what the pattern follows.

    tetrahedra, unknowns : of the solid model.    edge : longest edge on its surface, metres.
    elements : of the shell.
    """

    shell: float
    solid: float
    tetrahedra: int
    unknowns: int
    edge: float
    elements: str

    @property
    def ratio(self) -> float:
        """Solid over shell: above 1 the file is softer than the verdict on the sheet."""
        return self.solid / self.shell


def carrying(found: Found, design: Design, edge: float | None = None) -> Carrying:
    """Compare the sound solid in a file with the sheet of its design.

    edge : longest edge on the surface of the solid model, metres; two thicknesses, or a 60th of the size, if left out.

    Loads and supports are those of the cut sheet, at its vertices: these are points inside the solid (see `elastic`).
    Sheets that are loaded in their plane do not leave it. Raises StaticsError when gmsh or the solver cannot do it.
    """
    sheet, statics = design.sheet.surface, design.preset.statics
    given = {name: design.statics.cases[name].load for name in design.preset.followed}
    loads = sheet_loads(design.surface, design.slicing.cells.kept(), design.sheet, given)
    t = statics.thickness
    longest = edge or max(EDGE * t, COARSE * found.size)
    model = SolidModel.of(tetrahedra(found, longest), statics.material)
    middle = sheet.V + SHIFT[design.preset.thickening.side] * t / 2 * sheet.vertex_normals
    at = model.at(middle, t)
    forces = [at.T @ load.force.ravel() for load in loads.values()]
    holding = _holding(model, at, middle, sheet, loads, RIGID * statics.young * t, t)
    solid = compliances(model, holding, forces)
    answers = solve_cases(sheet, statics.material, loads, t, statics.law, VERDICT.membrane, "hhj")
    weights = np.array([design.preset.followed[name] for name in loads])
    shell = sum(weight * answers[name].compliance for name, weight in design.preset.followed.items())
    return Carrying(float(shell), float(weights @ solid), len(model.mesh.T), model.K.shape[0], longest, str(VERDICT))


def _holding(
    model: SolidModel,
    at: csr_array,
    middle: Floats,
    sheet: Surface,
    loads: Mapping[str, LoadCase],
    rigid: float,
    thickness: float,
) -> Holding:
    """Supports of the sheet: held directions and springs at its vertices, and edges that do not turn."""
    load = next(iter(loads.values()))
    fixed = load.fixed.copy()
    axis = flat_axis(sheet, *loads.values())
    if axis is not None:
        fixed[:, axis] = True
    stiffness = np.where(fixed, rigid, load.spring).ravel()
    held = np.flatnonzero(stiffness)
    rows, strength = [at[held]], [stiffness[held]]
    if load.clamped.any() and axis is None:
        still = _still(model, sheet, middle, load.clamped, thickness)
        rows.append(still)
        strength.append(np.full(still.shape[0], rigid))
    return Holding(csr_array(vstack(rows)), np.concatenate(strength))


def _still(model: SolidModel, sheet: Surface, middle: Floats, clamped: Bools, thickness: float) -> csr_array:
    """(r, N) how far the two skins move apart along the sheet, square to each clamped edge, at its middle."""
    ends = sheet.edges.ends[clamped]
    face = sheet.edges.order[sheet.edges.start[:-1][clamped]] // 3
    normal = sheet.normals[face]
    along = sheet.V[ends[:, 1]] - sheet.V[ends[:, 0]]
    across = np.cross(along, normal)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    place, lift = middle[ends].mean(axis=1), LEVER * thickness / 2 * normal
    apart = csr_array(model.at(place + lift, thickness) - model.at(place - lift, thickness))
    k = len(ends)
    entries = (across.ravel(), (np.repeat(np.arange(k), 3), np.arange(3 * k)))
    return csr_array(csr_array(entries, shape=(k, 3 * k)) @ apart)
