"""Levels of refinement: finer meshes of a sheet, each solved by two pairs of elements, with their errors."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, lock
from dsfab.core.errors import StaticsError
from dsfab.core.sparse import NotPositiveDefinite, peak_memory
from dsfab.design import sheet_supports
from dsfab.slicing import Sheet, three_each
from dsfab.statics import (
    Elements,
    Equilibrium,
    ShearRecovery,
    SheetMaterial,
    SheetModel,
    SheetStress,
    SpreadLoad,
    elements_of,
    equilibria,
    flat_axis,
    section_forces,
    sheet_stiffness,
    sheet_stress,
    solve_cases,
)
from dsfab.study.verdict.estimates import Extreme, rib_width, stress_extremes
from dsfab.surface import LoadCase, Surface

CREASE = np.cos(np.radians(30))
"""A face that leans more than 30 degrees from the mean normal at a vertex keeps its own normal there: a crease."""


@dataclass(frozen=True, eq=False)
class SmoothSurface:
    """Every face bent to a quadratic patch over its barycentric coordinates: p + sum over edges of 4 l_i l_j bulge.

    surface : the flat faces.
    bulge   : (e, 3) how far the middle of each edge leaves its chord, metres. Flat faces and creases stay.

    The middle of an edge from a to b is that of the cubic which leaves a and b at right angles to the normals there
    [Vlachos, Peters, Boyd and Mitchell 2001]:  bulge = ((a - b) . n_a n_a + (b - a) . n_b n_b) / 8. It is the same
    whichever side the normals point to, and belongs to the edge, so that patches meet without gaps.
    """

    surface: Surface
    bulge: Floats

    def __post_init__(self) -> None:
        lock(self, "bulge", np.float64, (len(self.surface.edges.ends), 3))

    @classmethod
    def through(cls, surface: Surface) -> "SmoothSurface":
        """The smooth surface through the vertices of `surface`."""
        normals, F, edges = _corner_normals(surface), surface.F, surface.edges
        start, end = F, np.roll(F, -1, axis=1)
        chord = surface.V[end] - surface.V[start]  # (m, half-edge, 3)
        n_a, n_b = normals, np.roll(normals, -1, axis=1)
        bent = (_along(chord, n_b) - _along(chord, n_a)) / 8
        total = np.stack([np.bincount(edges.of.ravel(), bent[..., k].ravel()) for k in range(3)], axis=1)
        return cls(surface, total / edges.count[:, None])

    def points(self, weights: csr_array) -> Floats:
        """(k, 3) metres: the points with barycentric weights (k, n), at most three in a row, all within one face."""
        flat = np.asarray(weights @ self.surface.V)
        if not self.bulge.any():
            return flat
        edges, (column, weight) = self.surface.edges, three_each(weights)
        for i, j in ((0, 1), (1, 2), (0, 2)):
            product = 4 * weight[:, i] * weight[:, j]
            between = np.flatnonzero(product > 0)
            flat[between] += product[between, None] * self.bulge[edges.between(column[between, i], column[between, j])]
        return flat


def _along(chord: Floats, normal: Floats) -> Floats:
    return np.asarray((chord * normal).sum(axis=-1, keepdims=True) * normal)


def _corner_normals(surface: Surface) -> Floats:
    """(m, 3, 3) unit normals at the corners of each face: the mean around the vertex, or the face's own at a crease."""
    corner, face = surface.F.ravel(), np.repeat(np.arange(surface.m), 3)
    first = np.zeros(surface.n, dtype=np.int64)
    first[corner[::-1]] = face[::-1]
    own = surface.normals[face]
    # around a vertex of a one-sided sheet the faces disagree: all are turned as the first one is
    side = np.where((own * surface.normals[first[corner]]).sum(axis=1) < 0, -1.0, 1.0)
    weighted = own * (side * surface.areas[face])[:, None]
    mean = np.stack([np.bincount(corner, weighted[:, k], surface.n) for k in range(3)], axis=1)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    smooth = np.abs((own * mean[corner]).sum(axis=1)) > CREASE
    return np.asarray(np.where(smooth[:, None], mean[corner], own).reshape(-1, 3, 3))


ROUNDED = 1e-12
"""Barycentric weights below this are zero: halving many times would else leave dust."""


def finer(sheet: Sheet, smooth: SmoothSurface) -> Sheet:
    """Every triangle in four, the points on the smooth surface; the old vertices come first.

    Weights are halved along edges and stay barycentric on the uncut surface: supports and loads are found by them.
    """
    F, edges, n = sheet.surface.F, sheet.surface.edges, sheet.surface.n
    a, b = edges.ends.T
    weights = csr_array(vstack([sheet.weights, 0.5 * (sheet.weights[a] + sheet.weights[b])]))
    weights.data[weights.data < ROUNDED] = 0.0
    weights.eliminate_zeros()
    mid = n + edges.of
    parts = [np.stack([F[:, k], mid[:, k], mid[:, k - 1]], axis=1) for k in range(3)]
    surface = Surface(smooth.points(weights), np.concatenate([*parts, mid]))
    return Sheet(surface, np.tile(sheet.parent, 4), np.tile(sheet.family, 4), weights)


def meshes(sheet: Sheet, smooth: SmoothSurface) -> Iterator[Sheet]:
    """The cut mesh with its points on the smooth surface, then finer and finer ones, without end."""
    mesh = replace(sheet, surface=Surface(smooth.points(sheet.weights), sheet.surface.F))
    while True:
        yield mesh
        mesh = finer(mesh, smooth)


class Shares(NamedTuple):
    """What a load is on every mesh of a sheet, newtons.

    vertices : (n, 3) on the surroundings of each vertex of the uncut surface that the sheet still has.
    faces    : (p, 3) on the material in each face of the uncut surface, up to the last that has some.
    """

    vertices: Floats
    faces: Floats


def shares(sheet: Sheet, loads: Mapping[str, LoadCase]) -> dict[str, Shares]:
    """Those of each load; they sum to its forces.

    loads : on the sheet (`dsfab.design.sheet_loads`); a force between vertices goes to those it lies between.
    """
    areas, last = sheet.surface.areas[:, None], int(sheet.parent.max()) + 1
    found = {}
    for name, load in loads.items():
        spread = np.zeros((len(areas), 3)) if load.parts is None else load.parts.traction * areas
        on_faces: Floats = np.stack([np.bincount(sheet.parent, x, last) for x in spread.T], axis=1).astype(np.float64)
        found[name] = Shares(np.asarray(sheet.weights.T @ load.point), on_faces)
    return found


def on_mesh(
    surface: Surface, sheet: Sheet, given: Mapping[str, LoadCase], forces: Mapping[str, Shares]
) -> tuple[dict[str, LoadCase], dict[str, SpreadLoad]]:
    """Supports and loads on a sheet of the uncut surface, on whatever mesh it is.

    given  : on the uncut surface.    forces : `shares` of them.

    A force on a vertex is spread over the material around it, in proportion to the hat function of the uncut mesh: a
    load has the same place and size on every finer mesh, and no force acts on a point, for which a sheet in its plane
    has no finite answer. What is on a face is even over the material there. The whole of it is kept to the last digit.
    """
    F, areas = sheet.surface.F, sheet.surface.areas
    hats = csr_array(sheet.weights[F[:, 0]] + sheet.weights[F[:, 1]] + sheet.weights[F[:, 2]])  # 3 x mean on each face
    mass = np.asarray(hats.T @ areas)
    material = np.bincount(sheet.parent, areas)
    cases, spreads = {}, {}
    for name, load in given.items():
        around, within = forces[name]
        density = np.divide(around, mass[:, None], out=np.zeros_like(around), where=mass[:, None] > 0)
        even = within / np.where(material > 0, material, 1.0)[:, None]
        spreads[name] = SpreadLoad.on(sheet.surface, np.asarray(hats @ density) + even[sheet.parent])
        cases[name] = replace(sheet_supports(surface, sheet, load), force=spreads[name].vertex_forces(sheet.surface))
    return cases, spreads


FULL = 6 / 5
"""Shear through the thickness is a parabola: its energy is so much more than that of an even one [Reissner 1945]."""


class RibSoftening(NamedTuple):
    """Shares of a thin sheet's compliance.

    torsion : by how much it grows where ribs that are twisted are bars of their own width and thickness, solved again
              (`solve_cases`); inf where that cannot be solved.
    shear   : energy of shear through the thickness, q^2 6 / (5 G h) on each square metre, q that of the thin sheet, its
              mean over half a thickness all around: a solid spreads what passes through a neck.
    bending : of moments, times the root of thickness over the mean width of ribs.
    """

    torsion: float
    shear: float
    bending: float


def rib_softening(
    sheet: SheetModel,
    elements: Elements,
    loads: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    answers: Mapping[str, Equilibrium],
    stresses: Mapping[str, SheetStress],
) -> dict[str, RibSoftening]:
    """Of a solved sheet that bends, for each of its cases. One more solve on its mesh."""
    surface, h, made = sheet.surface, sheet.thickness, sheet.material
    try:
        barred = [one.compliance for one in solve_cases(sheet, loads, elements, spreads, bars=True).values()]
    except (StaticsError, NotPositiveDefinite):
        barred = [np.inf] * len(loads)
    recovery, means = ShearRecovery.of(surface, linear=elements.bending == "hhj"), _means_within(surface, h / 2)
    stiff, found = made.young / (2 * (1 + made.poisson)) * h, {}
    slender = float(np.sqrt(h / rib_width(surface)))
    for name, one in zip(loads, barred, strict=True):
        c, stress = answers[name].compliance, stresses[name]
        forces = section_forces(surface, h, stress, recovery)
        q = means @ np.einsum("ma,max->mx", forces.q, forces.frame)
        sheared = FULL / stiff * float(surface.areas @ (q**2).sum(axis=1))
        bent = 2 * float(surface.areas @ stress.bending_energy) * slender
        shares = (max(float(one / c) - 1, 0.0), sheared / c, bent / c) if c > 0 else (0.0, 0.0, 0.0)
        found[name] = RibSoftening(*shares)
    return found


def _means_within(surface: Surface, reach: float) -> csr_array:
    """(m, m) means by area over faces whose middles are so near, of vectors that change sign with a face's side."""
    tree = cKDTree(surface.centroids)
    near = tree.sparse_distance_matrix(tree, min(reach, 2 * surface.mean_edge), output_type="coo_matrix")
    here, there = near.coords
    side = np.sign(np.einsum("kx,kx->k", surface.normals[here], surface.normals[there]))
    weight = surface.areas[there] / np.bincount(here, surface.areas[there], surface.m)[here]
    return csr_array((side * weight, (here, there)), shape=(surface.m, surface.m))


OVER = 1.2
"""Times torsion and shear, which follow from mechanics,"""

REST = 0.1
"""and times bending, for what is left: ribs that meet, shells that are thick for their radius. Both are chosen so that
39 random designs lie inside, solved by CalculiX as solids of quadratic wedges. 31 on other surfaces and supports do too
(`solids.csv`); 8 of them, seed 3, were drawn only when the form stood. All are softer than thin sheets."""

WORTH = 0.001
"""Less is not told."""


def theory_share(soft: RibSoftening) -> float:
    """By what share of a thin sheet's compliance that of a solid may be larger."""
    return OVER * (soft.torsion + soft.shear) + REST * soft.bending


MAIN, BESIDE = elements_of("compliance"), elements_of("spread")
"""The pair that a verdict is made with, and the one that it is compared to: they err to opposite sides mostly."""

ONCE = elements_of("compliance_once")
"""The pair of the quick level, which has no other mesh to tell it what is left."""

BYTES = {
    "PARDISO": {"hhj": 2200.0, "midedge": 1900.0, None: 1900.0},
    "multifrontal": {"hhj": 4200.0, "midedge": 3000.0, None: 2800.0},
}
"""Memory of a solve for each unknown, by solver and by bending: measured at 0.3 to 3.3 million. PARDISO keeps half of a
symmetric factor, and what it was made from is given back before: 2.7 GB for 1.2 million instead of 4.9."""


@dataclass(frozen=True)
class Level:
    """One mesh of a verdict.

    triangles  : of the mesh.              unknowns : of the main pair (without bending in the plane).
    compliance : J, by the main pair, for each case: `MAIN`, or `ONCE` of the quick level.
    midedge    : J, by `BESIDE`; empty where not run.
    zz_membrane, zz_bending : for each case the squared error that the recovered stress shows, as a share of the
                 compliance [Zienkiewicz and Zhu 1987], of the main pair.
    residual   : the largest of all cases and pairs, relative, in the norm of the energy (see `Equilibrium`).
    seconds    : of both pairs.
    memory     : bytes, the most that the process has held up to then.
    stresses   : of the main pair, for each case, see `stress_extremes`.
    softer     : of the main pair, for each case, see `RibSoftening`; empty where not asked for, or in the plane.
    """

    triangles: int
    unknowns: int
    compliance: Mapping[str, float]
    midedge: Mapping[str, float]
    zz_membrane: Mapping[str, float]
    zz_bending: Mapping[str, float]
    residual: float
    seconds: float
    memory: int
    stresses: Mapping[str, Mapping[str, Extreme]] = field(default_factory=dict)
    softer: Mapping[str, RibSoftening] = field(default_factory=dict)


def level(
    surface: Surface,
    made: SheetMaterial,
    loads: Mapping[str, LoadCase],
    spreads: Mapping[str, SpreadLoad],
    pairs: tuple[Elements, ...] = (MAIN, BESIDE),
    ribs: bool = False,
) -> Level:
    """The sheet on one mesh, under loads on the same supports.

    ribs : whether it is solved once more with ribs that twist as bars, see `RibSoftening`.

    Raises StaticsError as `equilibria` does.
    """
    start = time.perf_counter()
    plane = flat_axis(surface, *loads.values()) is not None
    found = {}
    # in the plane there is no bending, and the two pairs are one
    for pair in pairs[:1] if plane else pairs:
        elements = pair.in_plane if plane else pair
        K = sheet_stiffness(made.on(surface), elements)
        answers = equilibria(surface, K, list(loads.values()), elements, spreads=list(spreads.values()))
        found[pair] = dict(zip(loads, answers, strict=True))
        del K
    main = pairs[0]
    elements = main.in_plane if plane else main
    stress = {name: sheet_stress(made.on(surface), elements, answer) for name, answer in found[main].items()}
    errors = {name: recovery_errors(surface, made, stress[name], answer) for name, answer in found[main].items()}
    energies = {pair: {name: answer.compliance for name, answer in of.items()} for pair, of in found.items()}
    return Level(
        surface.m,
        elements.unknowns(surface),
        energies[main],
        energies.get(BESIDE, {}),
        {name: error[0] for name, error in errors.items()},
        {name: error[1] for name, error in errors.items()},
        max(answer.residual for of in found.values() for answer in of.values()),
        time.perf_counter() - start,
        peak_memory(),
        {name: stress_extremes(surface, one, loads[name].held) for name, one in stress.items()},
        rib_softening(made.on(surface), elements, loads, spreads, found[main], stress) if ribs and not plane else {},
    )


def recovery_errors(
    surface: Surface, made: SheetMaterial, found: SheetStress, answer: Equilibrium
) -> tuple[float, float]:
    """Squared errors in the norm of the energy over the compliance, of membrane and of bending: how far the stress is
    from the same averaged around each vertex [Zienkiewicz and Zhu 1987]. 0 for stress that is constant on each face."""
    if answer.compliance <= 0:
        return 0.0, 0.0
    C = np.linalg.inv(made.material.membrane(made.law)) * made.thickness
    D = np.linalg.inv(made.material.bending(made.thickness)) * (made.thickness**2 / 6) ** 2
    membrane = _squared(surface, found.smooth_membrane - found.membrane, np.asarray(C))
    bending = _squared(surface, found.smooth_bending - found.bending, np.asarray(D))
    return membrane / answer.compliance, bending / answer.compliance


def _squared(surface: Surface, off: Floats, by: Floats) -> float:
    """The integral of off . by off, `off` (m, 3 corners, 3) linear on each face."""
    there = off @ by
    total = np.einsum("mci,mci->m", off, there) + np.einsum("mi,mi->m", off.sum(axis=1), there.sum(axis=1))
    return float(total @ surface.areas / 12)


def memory_needed(unknowns: int, bending: str | None, solver: str) -> int:
    """Bytes that a solve of so many unknowns takes, about, with the one of `dsfab.core.sparse.solver_name`, or the
    other
    one; what the process holds besides is not counted."""
    return int(BYTES[solver][bending] * unknowns)
