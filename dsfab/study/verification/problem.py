"""What a verification test is made of: a mesh, its supports and loads, and the number that is looked at."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
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
from dsfab.statics.supports import held_on_edges
from dsfab.study.verification.meshes import Mesh, at, edges_on
from dsfab.surface import LoadCase, Surface


@dataclass(frozen=True, eq=False)
class Problem:
    """One mesh of one test: what is solved, and the number that is looked at.

    fixed   : (n, 3) held directions.                   clamped : (e,) edges that may not turn (built in, or symmetry).
    force   : (n, 3) concentrated loads, newtons.       spread  : loads per area and per length.
    value   : the number of an answer that the reference is about.
    modes   : the same of elements, where it is not of an equilibrium but of shapes that leave the plane.
    """

    surface: Surface
    material: Material
    thickness: float
    fixed: Bools
    force: Floats
    spread: SpreadLoad
    clamped: Bools
    value: Callable[[Equilibrium], float]
    modes: Callable[[Elements], float] | None = None

    @property
    def load(self) -> LoadCase:
        """Supports, and all loads on the vertices."""
        force = self.force + self.spread.vertex_forces(self.surface)
        return LoadCase(self.fixed, force, (self.force != 0).any(axis=1))

    @property
    def flat(self) -> int | None:
        """The axis across a sheet that is solved in its plane, else None."""
        return None if self.modes else flat_axis(self.surface, self.load)

    @property
    def needs_rotations(self) -> bool:
        """Whether edges are clamped and the load bends the sheet."""
        return bool(self.clamped.any()) and self.flat is None

    def unknowns(self, elements: Elements) -> int:
        """How many unknowns of these elements the supports leave free: the size of the system that is solved."""
        fixed = self.fixed.copy()
        if self.flat is not None:
            fixed[:, self.flat] = True
            elements = elements.in_plane
        return int((~fixed).sum() + (~held_on_edges(self.surface, elements, fixed, self.clamped)).sum())

    def nodal_unknowns(self) -> int:
        """The same for elements that others use on this mesh: three displacements and two rotations a vertex.

        Vertices of clamped edges lose one rotation, both where they are built in; in a plane there are none.
        """
        fixed = self.fixed.copy()
        if self.flat is not None:
            fixed[:, self.flat] = True
            return int((~fixed).sum())
        turning = np.zeros(self.surface.n, dtype=bool)
        turning[self.surface.edges.ends[self.clamped]] = True
        built_in = turning & fixed.all(axis=1)
        return int((~fixed).sum() + 2 * self.surface.n - turning.sum() - built_in.sum())

    def solve(self, elements: Elements) -> float:
        """The value with these elements; raises StaticsError."""
        if self.modes:
            return self.modes(elements)
        answer = solve_statics(
            SheetModel(
                self.surface, self.material, self.thickness, clamped=self.clamped if self.clamped.any() else None
            ),
            self.load,
            elements=elements,
            spread=self.spread,
        )
        return self.value(answer)


@dataclass(frozen=True)
class Test:
    """A structure with a known answer.

    reference : of `value`, in SI units or the source's own consistent ones.
    source    : where the reference comes from, with the share of the load that the meshed part carries.
    about     : the structure in a line.
    problem   : (cells, mesh) -> Problem, with `cells` along the side that is refined.
    cells     : refinements, coarse to fine.      meshes : patterns it is run on.
    within    : accepted relative error where it is less than that of the quantity.
    targets   : relative errors that the elements for displacements are meant to stay below, by cells.
    limit     : what the targets are about where it is not the reference: what the elements converge to (the exact
                answer of a thin sheet where one is published) if the usual reference is not that. The table has both.
    quantity  : what the number is: it says how far off it may be.
    beyond    : what no thin sheet has and the reference does, in words: then it is `limit` that must be met.
    outside   : (cells, mesh) -> unknowns and value of a program that is not ours, None where that is not installed.
    """

    __test__ = False  # pytest collects classes of this name

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
        """Accepted relative error on the finest mesh, of every pair that something is reported from."""
        return tolerance_of(self.quantity) if self.within is None else self.within


def held_directions(n: int, *supports: tuple[Bools, str]) -> Bools:
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
    """The value: mean displacement of the marked vertices (n,) along a direction, metres."""
    return lambda answer: float((answer.u[where] @ np.array(direction)).mean())


def lines_on(surface: Surface, where: Bools, newtons_per_metre: tuple[float, float, float]) -> Floats:
    """(e, 3) the line load on marked edges."""
    return np.asarray(where[:, None] * np.array(newtons_per_metre))


def tip_loaded(
    uv: Floats,
    F: Ints,
    V: Floats,
    material: Material,
    thickness: float,
    force: tuple[float, float, float],
) -> Problem:
    """A strip V (n, 3) built in where u = 0 of uv (n, 2), a force spread along its end u = 1; how far that end moves
    is the value."""
    surface = Surface(V, F)
    root, tip = at(uv[:, 0], 0.0), at(uv[:, 0], 1.0)
    end = edges_on(surface, tip)
    ends = surface.V[surface.edges.ends[end]]
    width = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    along = np.array(force)
    direction = along / np.linalg.norm(along)
    return Problem(
        surface,
        material,
        thickness,
        fixed=held_directions(surface.n, (root, "xyz")),
        force=np.zeros((surface.n, 3)),
        spread=SpreadLoad.on(surface, edge=lines_on(surface, end, tuple(along / width))),
        clamped=edges_on(surface, root),
        value=mean_move(tip, tuple(direction)),
    )
