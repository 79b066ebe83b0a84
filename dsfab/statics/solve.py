"""One linear solve: displacements, reactions, compliance, and the proof that they balance."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, Ints, lock, locked
from dsfab.errors import StaticsError
from dsfab.sparse import NotPositiveDefinite, factorise
from dsfab.statics.elements import PAPER, Elements, edge_frames
from dsfab.statics.mechanisms import require_held, require_loads_on_faces, rigid_motions
from dsfab.statics.spread import SpreadLoad
from dsfab.statics.supports import held_on_edges, require_clampable
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

BALANCE = 1e-5
"""Largest accepted sum of loads and reactions, relative to the sum of the loads' magnitudes. Rounding alone makes 1e-6
of it where a sheet is long, thin and finely meshed: a beam of 30 widths with 8 `hhj` cells across."""

RESIDUAL = 1e-8 if np.finfo(np.longdouble).eps < 1e-17 else 1e-6
"""Largest accepted relative residual of the linear system, in the norm of its energy. The same beam has 1e-6 after a
solution in double precision and 1e-10 once refined with longer numbers (see `refined`), where the machine has them."""

ACCURATE = 1e-9
"""Solutions with a larger residual are refined: a tenth of what is promised, for the residual is itself rounded."""

REFINEMENTS = 6
"""Steps at most; two or three reach what the numbers hold."""

IN_PLANE = 1e-12
"""A load with a smaller share across the plane of a flat sheet counts as lying in the plane."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """How a surface answers a load.

    u          : (n, 3) displacements, metres.
    reaction   : (n, 3) forces of the supports on the sheet, newtons; zero where nothing is held.
    compliance : f . u over all unknowns, joules (twice the elastic energy); the smaller, the stiffer.
    imbalance  : largest component of the sum of all forces (and of their moments over the size), loads and reactions
                 together, relative to the sum of the loads' magnitudes.
    residual   : relative residual of K u = f in the norm of its energy, sqrt(r . K^-1 r / f . u): the relative error
                 that the arithmetic left in u, in that norm, and a bound on that of the compliance.
    on_edges   : by name, the unknowns on edges (e,): `rotation` and `slope` in radians, `along`, `across` and `normal`
                 bubbles in metres (see `dsfab.statics.elements`); empty for the paper's elements.
    torque     : (e,) moments of the supports on edges that cannot turn, about the edges' directions, newton metres;
                 empty for elements without rotations.
    """

    u: Floats
    reaction: Floats
    compliance: float
    imbalance: float
    residual: float = 0.0
    on_edges: Mapping[str, Floats] = field(default_factory=dict)
    torque: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None, 3))
        lock(self, "reaction", np.float64, (len(self.u), 3))
        lock(self, "torque", np.float64, (None,))
        edges = {name: locked(values, np.float64, (None,)) for name, values in self.on_edges.items()}
        object.__setattr__(self, "on_edges", MappingProxyType(edges))

    @cached_property
    def largest_displacement(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.u, axis=1).max())

    @property
    def bubbles(self) -> Floats | None:
        """(e, 2) the bubbles along and across each edge, which strain the sheet; None with constant strain."""
        if "along" not in self.on_edges:
            return None
        return np.stack([self.on_edges["along"], self.on_edges["across"]], axis=1)


def flat_axis(surface: Surface, load: LoadCase) -> int | None:
    """The coordinate axis across a flat sheet whose loads lie in its plane (then it is solved in 2D), else None."""
    for axis in range(3):
        flat = np.ptp(surface.V[:, axis]) <= 1e-9 * surface.size
        if flat and np.abs(load.force[:, axis]).max() <= IN_PLANE * np.abs(load.force).max():
            return axis
    return None


def equilibrium(
    surface: Surface,
    K: csr_array,
    load: LoadCase,
    elements: Elements = PAPER,
    clamped: Bools | None = None,
    spread: SpreadLoad | None = None,
) -> Equilibrium:
    """Solve K u = f with the supported freedoms projected out.

    K        : stiffness, N/m, over the unknowns of `elements`: x, y, z of vertex 0, of vertex 1, ..., then the edges'.
    elements : the pair that K was made with (without bending for a sheet solved in its plane).
    clamped  : (e,) edges that may not turn about themselves.
    spread   : the part of the load that is spread over faces and edges. Its share on the vertices is in `load` already;
               it is named again because bubbles carry it as well.

    Raises StaticsError when the supports leave a motion free, when a load acts on nothing, when edges are clamped that
    have no rotations, or when the solution does not balance the loads.
    """
    require_clampable(surface, elements, clamped)
    fixed = load.fixed.copy()
    if (axis := flat_axis(surface, load)) is not None:
        fixed[:, axis] = True
    turning = clamped if "rotation" in elements.on_edges else None
    require_held(surface, load, fixed, turning)
    require_loads_on_faces(surface, load)
    f, held = load.force.ravel(), fixed.ravel()
    if elements.on_edges:
        bubbles = (spread or SpreadLoad.on(surface)).bubble_forces(surface, elements)
        f = np.concatenate([f, bubbles.T.ravel()])
        held = np.concatenate([held, held_on_edges(surface, elements, fixed, turning).T.ravel()])
    x, residual = _solution(surface, K, f, held)
    corners, edges = np.split(x, [3 * surface.n])
    forces, on_edges = np.split(K @ x - f, [3 * surface.n])
    reaction = np.where(load.fixed, forces.reshape(-1, 3), 0.0)
    imbalance = _imbalance(surface, load.force, reaction, _torque(elements, on_edges))
    torque = _torque(elements, np.where(held[3 * surface.n :], on_edges, 0.0))
    _require_solved(imbalance, residual)
    named = zip(elements.on_edges, edges.reshape(len(elements.on_edges), -1), strict=True) if len(edges) else ()
    return Equilibrium(corners.reshape(-1, 3), reaction, float(f @ x), imbalance, residual, dict(named), torque)


def _require_solved(imbalance: float, residual: float) -> None:
    """Raise StaticsError for a solution that does not balance the loads or does not solve the equations."""
    if not imbalance <= BALANCE:
        raise StaticsError(
            f"loads and reactions differ by {imbalance:.1e} of the load: the sheet is nearly a mechanism; "
            "hold more directions, or make it thicker or the mesh finer"
        )
    if not residual <= RESIDUAL:
        raise StaticsError(
            f"the equations are solved to {residual:.1e} only (wanted: {RESIDUAL:g}): the sheet is too "
            "thin for its size or nearly a mechanism; make it thicker, hold more directions, or remove needles of faces"
        )


@dataclass(frozen=True, eq=False)
class Factor:
    """A factorised stiffness.

    free  : (N,) the unknowns that move.            scale : (N,) 1 / sqrt of their diagonal.
    inner : (N, N) the stiffness of the free unknowns with a unit diagonal.
    solve : the function b -> inner^-1 b.
    """

    free: Ints
    scale: Floats
    inner: csr_array
    solve: Callable[[Floats], Floats]


def factored(surface: Surface, K: csr_array, held: Bools) -> Factor:
    """K without held unknowns and without those that have no stiffness (vertices of no face).

    Raises StaticsError when it is not positive definite.
    """
    diagonal = K.diagonal()
    moves = ~held & (diagonal > 0)
    free = np.flatnonzero(moves)
    # Jacobi scaling: membrane and bending differ by (size / thickness)^2 in stiffness
    scale = 1 / np.sqrt(diagonal[free])
    inner = _restricted(K, moves, scale)
    points = np.concatenate([surface.V, surface.V[surface.edges.ends].mean(axis=1)])
    node = np.where(free < 3 * surface.n, free // 3, surface.n + (free - 3 * surface.n) % len(surface.edges.ends))
    rigid = None
    if K.shape[0] == 3 * surface.n:
        rigid = rigid_motions(surface.V).reshape(-1, 6)[free] / scale[:, None]
    try:
        return Factor(free, scale, inner, factorise(inner, points, node, rigid=rigid))
    except NotPositiveDefinite as error:
        raise StaticsError(
            "the sheet is a mechanism: parts of it meet in single points or are not held; "
            "check the mesh with `dsfab inspect` and hold more directions"
        ) from error


def _restricted(K: csr_array, moves: Bools, scale: Floats) -> csr_array:
    """diag(scale) K diag(scale) on the unknowns that move: in one pass over the entries, without copies between."""
    number, every = np.cumsum(moves, dtype=K.indices.dtype) - 1, np.zeros(len(moves))
    every[moves] = scale
    row = np.repeat(np.arange(len(moves), dtype=K.indices.dtype), np.diff(K.indptr))
    keep = moves[row] & moves[K.indices]
    row, column = row[keep], K.indices[keep]
    data = K.data[keep] * every[row] * every[column]
    begin = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(moves))[moves])])
    return csr_array((data, number[column], begin.astype(K.indptr.dtype)), shape=(len(scale), len(scale)))


def _solution(surface: Surface, K: csr_array, f: Floats, held: Bools) -> tuple[Floats, Any]:
    """All unknowns for loads f, (N,) or (N, k), and the relative residual, a number or (k,).

    Unknowns without stiffness stay where they are.
    """
    u = np.zeros_like(f)
    if not (~held & (K.diagonal() > 0)).any():
        return u, 0.0 if f.ndim == 1 else np.zeros(f.shape[1])
    factor = factored(surface, K, held)
    scale = factor.scale if f.ndim == 1 else factor.scale[:, None]
    x, residual = refined(factor.inner, scale * f[factor.free], factor.solve)
    u[factor.free] = scale * x
    return u, float(residual) if f.ndim == 1 else residual


def refined(K: csr_array, b: Floats, solve: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """x with K x = b, b (N,) or (N, k), and its relative residual in the norm of the energy, sqrt(r . K^-1 r / b . x).

    A solution above `ACCURATE` is improved by iterative refinement [Wilkinson 1963] with x and residual in the longest
    floating-point numbers of the machine: K is badly conditioned for thin sheets, and a residual in its own precision
    would be all rounding. The residual told is that of x as it is returned, rounded to double.
    """
    x = solve(b)
    r = b - K @ x
    error = _energy_share(r, solve(r), b, x)
    if not (error > ACCURATE).any():
        return x, error
    long = K.astype(np.longdouble)
    exact, best = x.astype(np.longdouble), np.inf
    for _ in range(REFINEMENTS):
        r = (b - long @ exact).astype(np.float64)
        step = solve(r)
        error = _energy_share(r, step, b, x)
        if not error.max() < best / 2:
            break
        best, exact = error.max(), exact + step
    x = exact.astype(np.float64)
    r = (b - long @ x).astype(np.float64)
    return x, _energy_share(r, solve(r), b, x)


def _energy_share(r: Floats, step: Floats, b: Floats, x: Floats) -> Floats:
    """sqrt(|r . K^-1 r| / b . x) of each column; 0 where the load does no work."""
    energy = np.sum(b * x, axis=0)
    share = np.abs(np.sum(r * step, axis=0)) / np.where(energy > 0, energy, np.inf)
    return np.asarray(np.sqrt(share))


def _torque(elements: Elements, on_edges: Floats) -> Floats:
    """(e,) moments that held edges exert on the sheet, N m; the other unknowns do not move with a rigid sheet."""
    if "rotation" not in elements.on_edges:
        return np.zeros(0)
    return np.asarray(on_edges.reshape(len(elements.on_edges), -1)[elements.on_edges.index("rotation")])


def _imbalance(surface: Surface, force: Floats, reaction: Floats, torque: Floats) -> float:
    total = force + reaction
    arm = (surface.V - surface.V.mean(axis=0)) / surface.size
    turning = np.cross(arm, total).sum(axis=0)
    if len(torque):
        turning = turning + torque @ edge_frames(surface)[:, 0] / surface.size
    largest = max(np.abs(total.sum(axis=0)).max(), np.abs(turning).max())
    reference = np.linalg.norm(force, axis=1).sum()
    return float(largest / reference) if reference else 0.0
