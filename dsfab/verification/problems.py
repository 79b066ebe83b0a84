"""Problems for the tests: meshes of square and sphere, supports, loads, and values to compare."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.statics import (
    Elements,
    Equilibrium,
    Material,
    Quantity,
    SheetModel,
    SpreadLoad,
    flat_axis,
    solve_statics,
    tolerance_of,
)
from dsfab.statics.boundary_conditions import held_on_edges
from dsfab.surface import LoadCase, Surface

Mesh = Literal["diagonal", "union_jack", "jittered"]
MESHES: tuple[Mesh, ...] = ("diagonal", "union_jack", "jittered")
"""Mesh patterns. `diagonal` halves squares by parallel diagonals, `union_jack` by alternating diagonals; `jittered` is
`union_jack` with randomly moved inner vertices."""

NEAR = 1e-9  # Coordinates in the unit square that differ by less are equal.


def square(nx: int, ny: int, mesh: Mesh) -> tuple[Floats, Ints]:
    """Mesh the unit square with nx by ny cells. Return vertices (n, 2) and faces (m, 3)."""
    x, y = np.meshgrid(np.arange(nx + 1) / nx, np.arange(ny + 1) / ny, indexing="ij")
    uv = np.stack([x.ravel(), y.ravel()], axis=1)
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    a = (i * (ny + 1) + j).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    other_diagonal = np.zeros(len(a), dtype=bool) if mesh == "diagonal" else ((i + j) % 2 == 1).ravel()
    parts = [np.stack(corners, axis=1)[~other_diagonal] for corners in ((a, b, c), (a, c, d))]
    parts += [np.stack(corners, axis=1)[other_diagonal] for corners in ((a, b, d), (b, c, d))]
    F = np.concatenate(parts)
    if mesh == "jittered":
        # the centre vertex does not move, because tests read its values
        inner = ((uv > NEAR) & (uv < 1 - NEAR)).all(axis=1) & (np.abs(uv - 0.5).max(axis=1) > NEAR)
        shift = np.random.default_rng(0).uniform(-0.25, 0.25, (inner.sum(), 2))
        uv[inner] += shift / (nx, ny)
    return uv, F


def is_at(values: Floats, position: float) -> Bools:
    """Return a mask (k,) of the values (k,) that equal `position`."""
    return np.asarray(np.abs(values - position) < NEAR)


def edges_on(surface: Surface, *lines: Bools) -> Bools:
    """Return a mask (e,) of the boundary edges on lines. lines : masks (n,) of the vertices on each line."""
    is_on_line = np.logical_or.reduce([line[surface.edges.ends].all(axis=1) for line in lines])
    return np.asarray(is_on_line & surface.edges.boundary)


def octasphere(cells: int) -> tuple[Floats, Ints]:
    """Return vertices (n, 3), faces (m, 3) of a unit sphere from an octahedron with `cells` cells along each edge."""
    b, faces = _octahedron_side(cells)
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    points = (b[None] * signs[:, None]).reshape(-1, 3)
    F = np.concatenate([(faces if s.prod() > 0 else faces[:, ::-1]) + k * len(b) for k, s in enumerate(signs)])
    unique, vertex_numbers = np.unique(points, axis=0, return_inverse=True)
    return _on_sphere(unique, cells), vertex_numbers.reshape(-1)[F]


def octant(cells: int) -> tuple[Floats, Ints]:
    """Return vertices (n, 3) and faces (m, 3) of the eighth of `octasphere` without negative coordinates."""
    b, faces = _octahedron_side(cells)
    return _on_sphere(b, cells), faces


def _octahedron_side(cells: int) -> tuple[Ints, Ints]:
    """Return points (n, 3) and faces (m, 3) of an octahedron's side. Coordinates are integers with the sum `cells`."""
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    inside = i + j <= cells
    number = np.full((cells + 1, cells + 1), -1)
    number[inside] = np.arange(inside.sum())
    b = np.stack([cells - i - j, i, j], axis=-1)[inside]
    up, down = i + j < cells, i + j < cells - 1
    (p, q), (s, t) = np.nonzero(up), np.nonzero(down)
    upright = np.stack([number[p, q], number[p + 1, q], number[p, q + 1]], axis=1)
    return b, np.concatenate([upright, np.stack([number[s + 1, t], number[s + 1, t + 1], number[s, t + 1]], axis=1)])


def _on_sphere(points: Ints, cells: int) -> Floats:
    bent = np.sign(points) * np.sin(np.pi / 2 * np.abs(points) / cells)
    return np.asarray(bent / np.linalg.norm(bent, axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class Problem:
    """A test on a mesh: structure, loads, and the value that is compared with the reference.
    fixed   : (n, 3) mask of the fixed directions (x, y, z) at each vertex.
    clamped : (e,) mask of the edges that cannot rotate.    force : (n, 3) concentrated loads, newtons.
    face    : (m, 3) loads per area, Pa.    edge : (e, 3) loads per length, N/m.
    value   : function that returns the value from an equilibrium.
    modes   : for vibration and buckling: function that calculates the value; else None."""

    surface: Surface
    material: Material
    thickness: float
    fixed: Bools
    value: Callable[[Equilibrium], float] = lambda answer: np.nan
    force: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    face: object = 0.0
    edge: object = 0.0
    clamped: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    modes: Callable[[Elements], float] | None = None

    def __post_init__(self) -> None:
        if not len(self.force):
            object.__setattr__(self, "force", np.zeros((self.surface.n, 3)))
        if not len(self.clamped):
            object.__setattr__(self, "clamped", np.zeros(len(self.surface.edges.ends), dtype=bool))

    @cached_property
    def spread(self) -> SpreadLoad:
        """Loads per area and per length."""
        return SpreadLoad.broadcast(self.surface, self.face, self.edge)

    @property
    def load(self) -> LoadCase:
        """Supports, and all loads as forces at the vertices."""
        force = self.force + self.spread.vertex_forces(self.surface)
        return LoadCase(self.fixed, force, (self.force != 0).any(axis=1))

    @property
    def plane_axis(self) -> int | None:
        """Number (0, 1, 2) of the axis normal to the sheet, if all unknowns are in the sheet's plane; else None."""
        return None if self.modes else flat_axis(self.surface, self.load)

    @property
    def needs_rotations(self) -> bool:
        """True if the problem clamps edges and its load bends the sheet."""
        return bool(self.clamped.any()) and self.plane_axis is None

    def unknowns(self, elements: Elements) -> int:
        """Return the number of unknowns that are not fixed."""
        fixed = self.fixed.copy()
        if self.plane_axis is not None:
            fixed[:, self.plane_axis] = True
            elements = elements.in_plane
        return int((~fixed).sum() + (~held_on_edges(self.surface, elements, fixed, self.clamped)).sum())

    def nodal_unknowns(self) -> int:
        """Return the number of free unknowns of shell elements with five unknowns per vertex on this mesh."""
        fixed = self.fixed.copy()
        if self.plane_axis is not None:
            fixed[:, self.plane_axis] = True
            return int((~fixed).sum())
        turning = np.zeros(self.surface.n, dtype=bool)
        turning[self.surface.edges.ends[self.clamped]] = True
        built_in = turning & fixed.all(axis=1)
        return int((~fixed).sum() + 2 * self.surface.n - turning.sum() - built_in.sum())

    def solve(self, elements: Elements) -> float:
        """Calculate the value with the given elements. Raises StaticsError."""
        if self.modes:
            return self.modes(elements)
        clamped = self.clamped if self.clamped.any() else None
        sheet = SheetModel(self.surface, self.material, self.thickness, clamped=clamped)
        return self.value(solve_statics(sheet, self.load, elements=elements, spread=self.spread))


@dataclass(frozen=True)
class Test:
    """A structure with a known answer.
    reference : reference value, in SI units or the source's own consistent units.
    source    : source of the reference, and the modelled part of structure and load.
    problem   : (cells, mesh) -> Problem; `cells` counts the cells along the side that is refined.
    cells     : numbers of cells, coarse to fine.      meshes : mesh patterns.
    within    : tolerance; None: see `quantity`.    quantity : kind of value, which decides the default tolerance.
    targets   : largest allowed relative error of the elements for displacements, by number of cells.
    limit     : value to which thin sheets converge, if different from `reference`; `targets` then refer to `limit`.
    beyond    : effect that thin-sheet theories lack, or "". With an effect, a value close to `limit` passes too.
    outside   : (cells, mesh) -> number of unknowns and value from a second program, or None."""

    __test__ = False  # pytest would collect a class with this name

    name: str
    reference: float
    source: str
    about: str
    problem: Callable[[int, Mesh], Problem]
    cells: tuple[int, ...] = (8, 16, 32)
    meshes: tuple[Mesh, ...] = ("union_jack",)
    within: float | None = None
    targets: Mapping[int, float] = field(default_factory=dict)
    limit: float | None = None
    quantity: Quantity = "displacement"
    beyond: str = ""
    outside: Callable[[int, Mesh], tuple[int, float] | None] | None = None

    @property
    def tolerance(self) -> float:
        """Accepted relative error on the finest mesh."""
        return tolerance_of(self.quantity) if self.within is None else self.within


def held_directions(n: int, *supports: tuple[Bools, str]) -> Bools:
    """Return a mask (n, 3) of fixed directions. supports : pairs of a mask (n,) and directions, such as "xz"."""
    fixed = np.zeros((n, 3), dtype=bool)
    for where, axes in supports:
        for axis in axes:
            fixed[where, "xyz".index(axis)] = True
    return fixed


def point_force(n: int, *forces: tuple[Bools, tuple[float, float, float]]) -> Floats:
    """Return forces (n, 3), newtons. forces : pairs of a mask (n,) and the force on the first marked vertex."""
    force = np.zeros((n, 3))
    for where, newtons in forces:
        force[np.flatnonzero(where)[0]] += newtons
    return force


def mean_move(where: Bools, direction: tuple[float, float, float]) -> Callable[[Equilibrium], float]:
    """Return a function of an `Equilibrium`: the mean displacement (m) of marked vertices (n,) along `direction`."""
    return lambda answer: float((answer.u[where] @ np.array(direction)).mean())


def lines_on(where: Bools, newtons_per_metre: tuple[float, float, float]) -> Floats:
    """Return line loads (e, 3) that are constant on marked edges (e,) and 0 elsewhere."""
    return np.asarray(where[:, None] * np.array(newtons_per_metre))


def tip_loaded(
    uv: Floats, F: Ints, V: Floats, material: Material, thickness: float, force: tuple[float, float, float]
) -> Problem:
    """Return a strip built in at its end u = 0, with a force along its end u = 1.
    uv, V : (n, 2) coordinates u, v of the vertices on the strip, 0 to 1, and (n, 3) vertex positions.
    The problem's value is the displacement along the force."""
    surface = Surface(V, F)
    root, tip = is_at(uv[:, 0], 0.0), is_at(uv[:, 0], 1.0)
    end = edges_on(surface, tip)
    ends = surface.V[surface.edges.ends[end]]
    width = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    along = np.array(force)
    fixed, move = held_directions(surface.n, (root, "xyz")), mean_move(tip, tuple(along / np.linalg.norm(along)))
    load = lines_on(end, tuple(along / width))
    return Problem(surface, material, thickness, fixed, move, edge=load, clamped=edges_on(surface, root))
