"""Compliance of the solid in a file, for comparison with the sheet of the design."""

import importlib.util
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array, vstack
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.core.errors import StaticsError
from dsfab.core.limits import CHANGED_VOLUME
from dsfab.core.sparse import NotPositiveDefinite, factorise
from dsfab.design.design import Design
from dsfab.export.subprocesses import ProgramError, run_program
from dsfab.statics import Material, elements_of, flat_axis, solve_for
from dsfab.statics.boundary_conditions import held_middles
from dsfab.study.file_check import gmsh_program
from dsfab.study.file_check.file_geometry import FileContents
from dsfab.surface import LoadCase, Surface
from dsfab.surface.edge_changes import refined_surface
from dsfab.thickening.offset_vectors import SHIFT

NEEDED = ("gmsh", "skfem")  # packages of the extra `solid`: meshes (gmsh, GPL) and solid elements (skfem, BSD-3)
STEP = (".step", ".stp")  # suffixes of files that gmsh reads


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """Nodes X (p, 3) in metres and tetrahedra T (k, 4), all of positive volume."""

    X: Floats
    T: Ints

    def __post_init__(self) -> None:
        lock(self, "X", np.float64, (None, 3))
        lock(self, "T", np.int64, (None, 4))


def missing_packages() -> str:
    """Return a message that names the missing packages for a solid model; '' if all are installed."""
    absent = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    return f'{" and ".join(absent)} not installed; install with: pip install "dsfab[solid]"' if absent else ""


def tetrahedra(contents: FileContents, edge: float) -> Tetrahedra:
    """Fill the solid in a file with tetrahedra by gmsh. edge : longest edge on the surface of the solid, metres.
    Raises StaticsError if gmsh fails, takes too long, or changes the volume."""
    volume = Surface(contents.V, contents.F).volume
    if contents.path.suffix.lower() in STEP:
        X, T = _run_gmsh({"step": str(contents.path.resolve()), "edge": edge})
        return _checked_tetrahedra(X, T, volume, CHANGED_VOLUME)
    fine = refined_surface(Surface(contents.V, contents.F), edge)
    middle = contents.V.mean(axis=0)
    X, T = _run_gmsh({"V": (fine.V - middle) / contents.size, "F": fine.F, "edge": edge / contents.size})
    return _checked_tetrahedra(X * contents.size + middle, T, volume, 1e-6)


def _run_gmsh(mesh_data: Mapping[str, Any], seconds: float = 300.0) -> tuple[Floats, Ints]:
    with tempfile.TemporaryDirectory() as folder:
        source, result_path = Path(folder) / "surface.npz", Path(folder) / "tets.npz"
        np.savez(source, **mesh_data)
        try:
            run_program(gmsh_program.__file__, str(source), str(result_path), seconds=seconds)
            with np.load(result_path) as mesh:
                return np.asarray(mesh["X"], dtype=np.float64), np.asarray(mesh["T"], dtype=np.int64)
        except subprocess.TimeoutExpired:
            raise StaticsError(f"gmsh did not fill the solid with tetrahedra within {seconds:.0f} s") from None
        except (ProgramError, FileNotFoundError) as error:
            raise StaticsError(f"gmsh could not fill the solid with tetrahedra ({str(error)[:160]})") from None


def _checked_tetrahedra(X: Floats, T: Ints, volume: float, tolerance: float) -> Tetrahedra:
    P = X[T]
    six = np.einsum("ki,ki->k", P[:, 1] - P[:, 0], np.cross(P[:, 2] - P[:, 0], P[:, 3] - P[:, 0]))
    T = np.where((six < 0)[:, None], T[:, [0, 2, 1, 3]], T)
    long = np.linalg.norm(P[:, [1, 2, 3, 2, 3, 3]] - P[:, [0, 0, 0, 1, 1, 2]], axis=2).max(axis=1)
    if flat := int((np.abs(six) <= 1e-12 * long**3).sum()):
        raise StaticsError(f"gmsh made {flat} of {len(T)} tetrahedra without volume, due to needle-shaped triangles")
    filled = float(np.abs(six).sum() / 6)
    if abs(filled - volume) > tolerance * volume:
        raise StaticsError(f"gmsh filled {filled:.6g} m3 of a solid of {volume:.6g} m3")
    return Tetrahedra(X, T)


OUTSIDE = 0.25  # accept points slightly outside a tetrahedron, with barycentric coordinates from -OUTSIDE
LARGEST = 1_200_000  # limit on the number of unknowns


@dataclass(frozen=True, eq=False)
class SolidModel:
    """Stiffness matrix K (N, N), N/m, of a solid with N unknowns.
    points : (N / 3, 3) positions of the nodes, metres.    node : (N,) index of each unknown's node in `points`."""

    mesh: Tetrahedra
    K: csr_array
    points: Floats
    node: Ints
    _dofs: Ints

    @classmethod
    def from_tetrahedra(cls, mesh: Tetrahedra, material: Material) -> "SolidModel":
        """Return the solid model of a tetrahedral mesh. Raises StaticsError for more than `LARGEST` unknowns."""
        from skfem import ElementTetP2, ElementVector, MeshTet

        tets = MeshTet(np.ascontiguousarray(mesh.X.T), np.ascontiguousarray(mesh.T.T), sort_t=True)
        element = ElementVector(ElementTetP2())
        count = 3 * (tets.p.shape[1] + tets.edges.shape[1])
        if count > LARGEST:
            raise StaticsError(f"the solid model has {count:,} unknowns, more than the limit of {LARGEST:,}")
        K, dofs = _assemble(tets, element, material)
        points = np.concatenate([tets.p.T, tets.p.T[tets.edges.T].mean(axis=1)])
        node = np.empty(count, dtype=np.int64)
        corners, middles = tets.p.shape[1], tets.edges.shape[1]
        node[: 3 * corners] = np.repeat(np.arange(corners), 3)
        node[3 * corners :] = corners + np.repeat(np.arange(middles), 3)
        return cls(Tetrahedra(tets.p.T, tets.t.T), K, points, node, dofs)

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(self.mesh.X[self.mesh.T].mean(axis=1))

    def interpolation(self, points: Floats, reach: float) -> csr_array:
        """Return the matrix (3 k, N) that maps the N unknowns to the displacements of k points (k, 3), metres.
        Raises StaticsError for points more than `reach` metres outside the solid."""
        from skfem import ElementTetP2

        tet, local = self._locate(points, reach)
        phi = np.stack([ElementTetP2().lbasis(local, a)[0] for a in range(10)])  # (10, k)
        k = len(points)
        rows = np.broadcast_to(3 * np.arange(k)[None, None] + np.arange(3)[None, :, None], (10, 3, k))
        columns = self._dofs[:, tet].reshape(10, 3, k)
        entries = (np.broadcast_to(phi[:, None], (10, 3, k)).ravel(), (rows.ravel(), columns.ravel()))
        return csr_array(coo_array(entries, shape=(3 * k, self.K.shape[0])))

    def _locate(self, points: Floats, reach: float) -> tuple[Ints, Floats]:
        """Return the number (k,) of the tetrahedron that contains each point or is nearest to it.
        Return also the local coordinates (3, k) of the point in this tetrahedron."""
        candidates = np.asarray(self._tree.query(points, k=min(40, len(self.mesh.T)))[1]).reshape(len(points), -1)
        P = self.mesh.X[self.mesh.T[candidates]]
        edges = np.swapaxes(P[:, :, 1:] - P[:, :, :1], 2, 3)
        local = np.linalg.solve(edges, (points[:, None] - P[:, :, 0])[..., None])[..., 0]
        lowest = np.minimum(local.min(axis=2), 1 - local.sum(axis=2))
        choice = lowest.argmax(axis=1)
        numbers = np.arange(len(points))
        out = np.maximum(-lowest[numbers, choice], 0) * np.abs(edges[numbers, choice]).max(axis=(1, 2))
        lost = np.flatnonzero((lowest[numbers, choice] < -OUTSIDE) | (out > reach))
        if len(lost):
            place = points[lost[0]].round(4).tolist()
            raise StaticsError(
                f"the file's solid does not contain {len(lost)} of {len(points)} points of the sheet with loads or "
                f"supports (the first at {place} m)"
            )
        return candidates[numbers, choice], local[numbers, choice].T


def _assemble(tets: Any, element: Any, material: Material, at_once: int = 20_000) -> tuple[csr_array, Ints]:
    """Return the stiffness matrix, and the indices (30, k) of the unknowns of each of k tetrahedra."""
    from skfem import Basis
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    form = linear_elasticity(*lame_parameters(material.young, material.poisson))
    K: csr_array | None = None
    for start in range(0, tets.t.shape[1], at_once):
        part = np.arange(start, min(start + at_once, tets.t.shape[1]))
        basis = Basis(tets, element, elements=part, intorder=2)  # this integration is exact for linear strains
        added = csr_array(form.assemble(basis))
        K = added if K is None else csr_array(K + added)
        dofs = basis.dofs.element_dofs
    if K is None:
        raise StaticsError("the model of the solid has no tetrahedra")
    return K, np.asarray(dofs, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Holding:
    """Supports of a solid model, represented by r springs.
    rows : (r, N) matrix from the unknowns to the elongation of each spring.
    stiffness : (r,) stiffness of each spring, N/m; very large for a rigid support."""

    rows: csr_array
    stiffness: Floats


def compliances(model: SolidModel, holding: Holding, forces: Sequence[Floats]) -> Floats:
    """Return the compliances f . u (c,), joules, of a solid under c load vectors f (N,).
    Raises StaticsError if the supports leave a motion free."""
    K = csr_array(model.K + holding.rows.T @ (diags_array(holding.stiffness) @ holding.rows))
    scale = 1 / np.sqrt(K.diagonal())
    inner = csr_array(diags_array(scale) @ K @ diags_array(scale))
    inner.sort_indices()
    f = scale[:, None] * np.stack(forces, axis=1)
    try:
        solve = factorise(inner, model.points, model.node)
    except NotPositiveDefinite:
        raise StaticsError("the supports do not hold the solid, or the solid falls into pieces") from None
    x = solve(f)
    x = x + solve(f - inner @ x)
    return np.asarray((f * x).sum(axis=0))


EDGE = 1.0
"""Longest edge on the solid's surface / thickness. With a value of 2, compliances were up to 5 % too small."""
COARSE = 1 / 100  # smallest `edge` divided by the solid's size; smaller edges give millions of tetrahedra
RIGID = 1e3  # stiffness of a rigid support's spring, divided by Young's modulus times the thickness
GAUSS = ((np.sqrt(0.6), 5 / 18), (0.0, 8 / 18), (-np.sqrt(0.6), 5 / 18))
"""Gauss points across the thickness: height above the middle, divided by half the thickness, and weight."""


@dataclass(frozen=True)
class SolidCompliance:
    """Compliances (J) of a cut sheet (`shell`) and of the solid in a file (`solid`).
    edge : longest edge on the surface of the solid model, metres."""

    shell: float
    solid: float
    tetrahedra: int
    unknowns: int
    edge: float
    elements: str

    @property
    def ratio(self) -> float:
        """Compliance of the solid divided by the compliance of the shell."""
        return self.solid / self.shell


def compared_compliance(contents: FileContents, design: Design, edge: float | None = None) -> SolidCompliance:
    """Compute the compliances of the solid in a file and of the design's cut sheet, for comparison.
    edge : longest edge on the surface of the solid model, metres; by default, the thickness determines it.
    Raises StaticsError if gmsh or the solver fails."""
    sheet, statics = design.sheet.surface, design.preset.statics
    loads, t = design.cut_loads, statics.thickness
    longest = edge or max(EDGE * t, COARSE * contents.size)
    model = SolidModel.from_tetrahedra(tetrahedra(contents, longest), statics.elastic)
    points = SupportPoints(model, sheet, t, SHIFT[design.preset.thickening.side])
    interpolation = points.mean(sheet.V, sheet.vertex_normals)
    forces = [interpolation.T @ load.force.ravel() for load in loads.values()]
    solid = compliances(model, _holding(points, interpolation, loads, RIGID * statics.young * t), forces)
    answers = solve_for(statics.sheet().model_for(sheet), loads, "compliance_once")
    used = next(iter(answers.values())).elements
    pair = replace(used, bending=used.bending or elements_of("compliance_once").bending)
    weights = np.array([design.preset.followed_weights[name] for name in loads])
    shell = sum(weight * answers[name].compliance for name, weight in design.preset.followed_weights.items())
    sizes = len(model.mesh.T), model.K.shape[0]
    return SolidCompliance(float(shell), float(weights @ solid), *sizes, longest, str(pair))


@dataclass(frozen=True, eq=False)
class SupportPoints:
    """Matrices that map the unknowns of a solid model to displacements of the sheet that it was made from.
    shift : distance from the sheet to the middle of the solid, in half thicknesses: -1, 0 or 1."""

    model: SolidModel
    sheet: Surface
    thickness: float
    shift: int

    def mean(self, places: Floats, normals: Floats) -> csr_array:
        """Return the matrix (3 k, N) from N unknowns to displacements at k points, averaged over the thickness.
        places : (k, 3) points on the sheet, metres.    normals : (k, 3) unit normals of the sheet at these points."""
        parts = (weight * self._level(places, normals, height) for height, weight in GAUSS)
        return csr_array(sum(parts, start=csr_array((3 * len(places), self.model.K.shape[0]))))

    def rotation(self, edges: Bools) -> csr_array:
        """Return the matrix (r, N) from N unknowns to rotations about edges, at r points on these edges.
        A rotation is given as the difference of two displacements, metres. edges : (e,) mask of the edges."""
        places, normals, along = self.samples(edges)
        across = np.cross(along, normals)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        high = GAUSS[0][0]
        apart = self._level(places, normals, high) - self._level(places, normals, -high)
        k = len(places)
        entries = (across.ravel(), (np.repeat(np.arange(k), 3), np.arange(3 * k)))
        return csr_array(csr_array(entries, shape=(k, 3 * k)) @ apart)

    def samples(self, edges: Bools) -> tuple[Floats, Floats, Floats]:
        """Return points (k, 3) on the marked `edges` (e,), normals (k, 3) there, and the edges' vectors (k, 3)."""
        table = self.sheet.edges
        start, end = np.moveaxis(self.sheet.V[table.ends[edges]], 1, 0)
        count = np.ceil(2 * np.linalg.norm(end - start, axis=1) / self.thickness).astype(np.int64)
        edge_numbers = np.repeat(np.arange(len(start)), count)
        number = np.arange(len(edge_numbers)) - np.repeat(np.cumsum(count) - count, count)
        share = ((number + 0.5) / count[edge_numbers])[:, None]
        face = table.order[table.start[:-1][edges]] // 3
        along = end - start
        places = start[edge_numbers] + share * along[edge_numbers]
        return places, self.sheet.normals[face][edge_numbers], along[edge_numbers]

    def _level(self, places: Floats, normals: Floats, height: float) -> csr_array:
        lift = (self.shift + height) * self.thickness / 2
        return self.model.interpolation(places + lift * normals, self.thickness)


def _holding(points: SupportPoints, interpolation: csr_array, loads: Mapping[str, LoadCase], rigid: float) -> Holding:
    sheet, load = points.sheet, next(iter(loads.values()))
    fixed, middles = load.fixed.copy(), held_middles(sheet, load.fixed)
    if (axis := flat_axis(sheet, *loads.values())) is not None:
        fixed[:, axis] = True
    stiffness = np.where(fixed, rigid, load.spring).ravel()
    held_unknowns = np.flatnonzero(stiffness)
    rows, strength = [interpolation[held_unknowns]], [stiffness[held_unknowns]]
    for axes in np.unique(middles[middles.any(axis=1)], axis=0):  # group edges by their held directions
        places, normals, _ = points.samples(np.asarray((middles == axes).all(axis=1)))
        rows.append(points.mean(places, normals)[np.flatnonzero(np.tile(axes, len(places)))])
    if load.clamped.any() and axis is None:
        rows.append(points.rotation(load.clamped))
    strength += [np.full(row.shape[0], rigid) for row in rows[1:]]
    return Holding(csr_array(vstack(rows)), np.concatenate(strength))
