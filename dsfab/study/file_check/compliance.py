"""Does the solid in the file carry as the sheet of the design does? Ten-node tetrahedra beside shell elements."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Bools, Floats
from dsfab.pipeline.design import Design
from dsfab.statics import elements_of, flat_axis, solve_for
from dsfab.statics.supports import held_middles
from dsfab.study.file_check.elastic import Holding, SolidModel, compliances
from dsfab.study.file_check.reading import FileContents
from dsfab.study.file_check.tetrahedra import tetrahedra
from dsfab.surface import LoadCase, Surface
from dsfab.thickening.offset import SHIFT

EDGE = 1.0
"""Longest edge on the solid's surface, in thicknesses; but not finer than `COARSE` of the solid's size. On members two
thicknesses wide, edges of two thicknesses gave 2.5 to 5 % less compliance."""

COARSE = 1 / 100
"""See `EDGE`: very thin sheets would take millions of tetrahedra, and quadratic ones bend well at 1 : 5."""

RIGID = 1e3
"""A rigid support is a spring of this many times Young's modulus times the thickness."""

GAUSS = ((np.sqrt(0.6), 5 / 18), (0.0, 8 / 18), (-np.sqrt(0.6), 5 / 18))
"""Heights over the middle, in half thicknesses, and their weights."""


@dataclass(frozen=True)
class SolidCompliance:
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


def carrying(found: FileContents, design: Design, edge: float | None = None) -> SolidCompliance:
    """Compare the sound solid in a file with the sheet of its design.

    edge : longest edge on the surface of the solid model, metres; else one thickness, or a hundredth of the size.

    Loads and supports are those of the cut sheet. Its vertices, and points along its held edges, lie in the solid (see
    `elastic`), and what acts on one acts on the mean through the thickness there, as it does on a shell.
    Sheets that are loaded in their plane do not leave it. Raises StaticsError when gmsh or the solver cannot do it.
    """
    sheet, statics = design.sheet.surface, design.preset.statics
    loads, t = design.cut_loads, statics.thickness
    longest = edge or max(EDGE * t, COARSE * found.size)
    model = SolidModel.of(tetrahedra(found, longest), statics.elastic)
    points = SupportPoints(model, sheet, t, SHIFT[design.preset.thickening.side])
    at = points.mean(sheet.V, sheet.vertex_normals)
    forces = [at.T @ load.force.ravel() for load in loads.values()]
    solid = compliances(model, _holding(points, at, loads, RIGID * statics.young * t), forces)
    answers = solve_for(statics.sheet().on(sheet), loads, "compliance_once")
    used = next(iter(answers.values())).elements
    pair = replace(used, bending=used.bending or elements_of("compliance_once").bending)  # none in a plane
    weights = np.array([design.preset.followed[name] for name in loads])
    shell = sum(weight * answers[name].compliance for name, weight in design.preset.followed.items())
    return SolidCompliance(
        float(shell), float(weights @ solid), len(model.mesh.T), model.K.shape[0], longest, str(pair)
    )


@dataclass(frozen=True, eq=False)
class SupportPoints:
    """Points of a sheet in a solid of `thickness` metres, whose middle lies `shift` half thicknesses off the sheet."""

    model: SolidModel
    sheet: Surface
    thickness: float
    shift: int

    def mean(self, places: Floats, normals: Floats) -> csr_array:
        """(3 k, N) displacements of places (k, 3) of the sheet, averaged through the thickness by three Gauss points.

        The points lie evenly about the middle: a force so divided has no moment about it.
        """
        parts = (weight * self._level(places, normals, height) for height, weight in GAUSS)
        return csr_array(sum(parts, start=csr_array((3 * len(places), self.model.K.shape[0]))))

    def turn(self, edges: Bools) -> csr_array:
        """(r, N) how far the outer Gauss points move apart, square to each of the marked edges and along the sheet."""
        places, normals, along = self.samples(edges)
        across = np.cross(along, normals)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        high = GAUSS[0][0]
        apart = self._level(places, normals, high) - self._level(places, normals, -high)
        k = len(places)
        entries = (across.ravel(), (np.repeat(np.arange(k), 3), np.arange(3 * k)))
        return csr_array(csr_array(entries, shape=(k, 3 * k)) @ apart)

    def samples(self, edges: Bools) -> tuple[Floats, Floats, Floats]:
        """Places (k, 3) on marked edges, half a thickness apart at most, with the normal of a face and the edge there.

        A line that is held in fewer points gives way between them, which a held shell does not.
        """
        table = self.sheet.edges
        start, end = np.moveaxis(self.sheet.V[table.ends[edges]], 1, 0)
        count = np.ceil(2 * np.linalg.norm(end - start, axis=1) / self.thickness).astype(np.int64)
        of = np.repeat(np.arange(len(start)), count)
        number = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        share = ((number + 0.5) / count[of])[:, None]
        face = table.order[table.start[:-1][edges]] // 3
        along = end - start
        return start[of] + share * along[of], self.sheet.normals[face][of], along[of]

    def _level(self, places: Floats, normals: Floats, height: float) -> csr_array:
        lift = (self.shift + height) * self.thickness / 2
        return self.model.at(places + lift * normals, self.thickness)


def _holding(points: SupportPoints, at: csr_array, loads: Mapping[str, LoadCase], rigid: float) -> Holding:
    """Supports of the sheet: held directions of vertices and along edges, springs, and edges that stay."""
    sheet, load = points.sheet, next(iter(loads.values()))
    fixed, middles = load.fixed.copy(), held_middles(sheet, load.fixed)
    if (axis := flat_axis(sheet, *loads.values())) is not None:
        fixed[:, axis] = True
    stiffness = np.where(fixed, rigid, load.spring).ravel()
    held = np.flatnonzero(stiffness)
    rows, strength = [at[held]], [stiffness[held]]
    for axes in np.unique(middles[middles.any(axis=1)], axis=0):  # edges that are held alike
        places, normals, _ = points.samples(np.asarray((middles == axes).all(axis=1)))
        rows.append(points.mean(places, normals)[np.flatnonzero(np.tile(axes, len(places)))])
    if load.clamped.any() and axis is None:
        rows.append(points.turn(load.clamped))
    strength += [np.full(row.shape[0], rigid) for row in rows[1:]]
    return Holding(csr_array(vstack(rows)), np.concatenate(strength))
