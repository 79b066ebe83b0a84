"""What a verification test is made of, and meshes of the unit square to map onto its geometry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.statics import Elements, Equilibrium, Material, SpreadLoad, flat_axis, solve_statics
from dsfab.surface import LoadCase, Surface

Mesh = Literal["diagonal", "union_jack", "jittered"]
MESHES: tuple[Mesh, ...] = ("diagonal", "union_jack", "jittered")
"""Squares halved by parallel diagonals, by alternating ones, and the latter with the inner vertices moved at random."""

NEAR = 1e-9
"""Parameters of the unit square closer than this are the same."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One mesh of one test: what is solved, and the number that is looked at.

    fixed   : (n, 3) held directions.                   clamped : (e,) edges that may not turn (built in, or symmetry).
    force   : (n, 3) concentrated loads, newtons.       spread  : loads per area and per length.
    value   : the number of an answer that the reference is about.
    """

    surface: Surface
    material: Material
    thickness: float
    fixed: Bools
    force: Floats
    spread: SpreadLoad
    clamped: Bools
    value: Callable[[Equilibrium], float]

    @property
    def needs_rotations(self) -> bool:
        """Whether edges are clamped and the load bends the sheet."""
        load = LoadCase(self.fixed, self.force + self.spread.vertex_forces(self.surface), self.fixed[:, 0])
        return bool(self.clamped.any()) and flat_axis(self.surface, load) is None

    def solve(self, elements: Elements) -> float:
        """The value with these elements; raises StaticsError."""
        force = self.force + self.spread.vertex_forces(self.surface)
        load = LoadCase(self.fixed, force, (self.force != 0).any(axis=1))
        answer = solve_statics(
            self.surface,
            self.material,
            load,
            self.thickness,
            membrane=elements.membrane,
            bending=elements.bending or "hinge",
            clamped=self.clamped if self.clamped.any() else None,
            spread=self.spread,
        )
        return self.value(answer)


@dataclass(frozen=True)
class Test:
    """A structure with a known answer.

    reference : of `value`, in SI units or the source's own consistent ones.
    source    : where the reference comes from, with the share of the load that the meshed part carries.
    problem   : (cells, mesh) -> Problem, with `cells` along the side that is refined.
    cells     : refinements, coarse to fine.      meshes : patterns it is run on.
    tolerance : accepted relative error of the verdict's elements on the finest mesh.
    """

    __test__ = False  # pytest collects classes of this name

    name: str
    reference: float
    source: str
    problem: Callable[[int, Mesh], Problem]
    cells: tuple[int, ...] = (8, 16, 32)
    meshes: tuple[Mesh, ...] = ("union_jack",)
    tolerance: float = 0.02


def square(nx: int, ny: int, mesh: Mesh) -> tuple[Floats, Ints]:
    """Vertices (n, 2) and faces of a mesh of the unit square with nx by ny cells."""
    x, y = np.meshgrid(np.arange(nx + 1) / nx, np.arange(ny + 1) / ny, indexing="ij")
    uv = np.stack([x.ravel(), y.ravel()], axis=1)
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    a = (i * (ny + 1) + j).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    other = np.zeros(len(a), dtype=bool) if mesh == "diagonal" else ((i + j) % 2 == 1).ravel()
    F = np.concatenate(
        [
            np.stack([a, b, c], axis=1)[~other],
            np.stack([a, c, d], axis=1)[~other],
            np.stack([a, b, d], axis=1)[other],
            np.stack([b, c, d], axis=1)[other],
        ]
    )
    if mesh == "jittered":
        inner = ((uv > NEAR) & (uv < 1 - NEAR)).all(axis=1) & (np.abs(uv - 0.5).max(axis=1) > NEAR)  # keep the centre
        shift = np.random.default_rng(0).uniform(-0.25, 0.25, (inner.sum(), 2))
        uv[inner] += shift / (nx, ny)
    return uv, F


def at(values: Floats, where: float) -> Bools:
    """Which parameters are `where`."""
    return np.asarray(np.abs(values - where) < NEAR)


def edges_on(surface: Surface, *lines: Bools) -> Bools:
    """(e,) boundary edges with both ends on one of the lines of vertices."""
    on = np.logical_or.reduce([line[surface.edges.ends].all(axis=1) for line in lines])
    return np.asarray(on & surface.edges.boundary)


def held(n: int, *supports: tuple[Bools, str]) -> Bools:
    """(n, 3) from pairs of marked vertices and directions such as "xz"."""
    fixed = np.zeros((n, 3), dtype=bool)
    for where, axes in supports:
        for axis in axes:
            fixed[where, "xyz".index(axis)] = True
    return fixed


def point_force(n: int, *forces: tuple[Bools, tuple[float, float, float]]) -> Floats:
    """(n, 3) newtons from pairs of one marked vertex and its force."""
    force = np.zeros((n, 3))
    for where, newtons in forces:
        force[np.flatnonzero(where)[0]] += newtons
    return force


def mean_move(where: Bools, direction: tuple[float, float, float]) -> Callable[[Equilibrium], float]:
    """The value: mean displacement of the marked vertices along a direction."""
    return lambda answer: float((answer.u[where] @ np.array(direction)).mean())


def lines_on(surface: Surface, where: Bools, newtons_per_metre: tuple[float, float, float]) -> Floats:
    """(e, 3) the line load on marked edges."""
    return np.asarray(where[:, None] * np.array(newtons_per_metre))
