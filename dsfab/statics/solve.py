"""Displacements, reactions and compliance from linear solves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, lock_floats, read_only_copy
from dsfab.core.errors import StaticsError
from dsfab.core.limits import BALANCE, RESIDUAL
from dsfab.statics.boundary_conditions import (
    SpreadLoad,
    all_clamped,
    held_on_edges,
    require_clampable,
    require_held,
    require_loads_on_faces,
    with_springs,
)
from dsfab.statics.elements import PAPER, Elements, edge_frames, needle_message
from dsfab.statics.factorisation import FactorFunction, refined_solution, stiffness_factor
from dsfab.surface.loads.load_case import LoadCase
from dsfab.surface.mesh import Surface


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Solution of a surface under a load.
    u          : (n, 3) displacements of the vertices, metres.
    reaction   : (n, 3) forces of the supports and springs on the sheet, newtons; zero at free vertices.
    compliance : twice the elastic energy, joules.    residual : relative rounding error of u in the energy norm.
    imbalance  : largest component of two sums: all forces, and all moments divided by the surface's size.
                 It is a fraction of the sum of the loads' magnitudes.
    on_edges   : unknowns on edges (e,), by name: `rotation` and `slope` in radians; edge bubbles `along`, `across`
                 and `normal` in metres. Empty for the elements `PAPER`.
    torque     : (e,) moments of the supports about clamped edges, N m; empty for elements without rotations."""

    u: Floats
    reaction: Floats
    compliance: float
    imbalance: float
    residual: float = 0.0
    on_edges: Mapping[str, Floats] = field(default_factory=dict)
    torque: Floats = field(default_factory=lambda: np.zeros(0))
    elements: Elements = PAPER

    def __post_init__(self) -> None:
        lock_floats(self, u=(None, 3), reaction=(len(self.u), 3), torque=(None,))
        edges = {name: read_only_copy(values, np.float64, (None,)) for name, values in self.on_edges.items()}
        object.__setattr__(self, "on_edges", MappingProxyType(edges))

    @cached_property
    def largest_displacement(self) -> float:
        """Largest displacement, metres."""
        return float(np.linalg.norm(self.u, axis=1).max())

    @property
    def bubbles(self) -> Floats | None:
        """Displacement (e, 2) of each edge's midpoint relative to the mean of its ends, along and across it, metres.
        None for elements with constant strain."""
        if "along" not in self.on_edges:
            return None
        return np.stack([self.on_edges["along"], self.on_edges["across"]], axis=1)


def flat_axis(surface: Surface, *loads: LoadCase) -> int | None:
    """Return the coordinate axis (0 to 2) normal to a flat sheet with in-plane loads; None for any other sheet."""
    for axis in range(3):
        flat = np.ptp(surface.V[:, axis]) <= 1e-9 * surface.size
        if flat and all(np.abs(load.force[:, axis]).max() <= 1e-12 * np.abs(load.force).max() for load in loads):
            return axis
    return None


def equilibrium(
    surface: Surface,
    K: csr_array,
    load: LoadCase,
    elements: Elements = PAPER,
    spread: SpreadLoad | None = None,
    factor_of: "FactorFunction | None" = None,
) -> Equilibrium:
    """Return displacements, reactions and compliance of a sheet with a known stiffness under a load.
    K         : stiffness matrix without springs, N/m. Unknowns: x, y, z of each vertex, then unknowns of edges.
    spread    : the distributed part of the load. `load` also contains this part, as forces on vertices.
    Raises StaticsError if the supports leave a motion free, or if the solution does not balance the loads."""
    return equilibria(surface, K, [load], elements, [spread] if spread else None, (), factor_of)[0]


def equilibria(
    surface: Surface,
    K: csr_array,
    loads: Sequence[LoadCase],
    elements: Elements = PAPER,
    spreads: Sequence[SpreadLoad] | None = None,
    sums: Sequence[Sequence[float]] = (),
    factor_of: "FactorFunction | None" = None,
) -> tuple[Equilibrium, ...]:
    """Return the equilibrium of each load, then of each combination of the loads.
    K : stiffness matrix without springs, N/m.    spreads : the distributed part of each load.
    sums : for each combination, a factor for each load. Raises StaticsError, also for loads on different supports."""
    _require_same_supports(loads)
    is_held = held_unknowns(surface, loads, elements)
    F = np.stack([load.force.ravel() for load in loads], axis=1)
    if elements.on_edges:
        spread_loads = spreads or [SpreadLoad.broadcast(surface)] * len(loads)
        bubbles = [spread.bubble_forces(surface, elements).T.ravel() for spread in spread_loads]
        F = np.concatenate([F, np.stack(bubbles, axis=1)])
    X, residuals = solution(surface, with_springs(K, loads[0]), F, is_held, factor_of or stiffness_factor)
    answers = []
    for load, f, x, residual in zip(loads, F.T, X.T, residuals, strict=True):
        answer = equilibrium_of_unknowns(surface, load, elements, K @ x - f, x, is_held)
        answers.append(replace(answer, compliance=float(f @ x), residual=float(residual)))
        require_solved(surface, answers[-1].imbalance, residual)
    return (*answers, *(_combination(surface, loads, answers, factors, F, X) for factors in sums))


def _require_same_supports(loads: Sequence[LoadCase]) -> None:
    reference = loads[0]
    for load in loads[1:]:
        if not all(
            np.array_equal(getattr(reference, name), getattr(load, name)) for name in ("fixed", "spring", "clamped")
        ):
            raise StaticsError("load cases solved together need the same supports; solve these cases one by one")


def held_unknowns(surface: Surface, loads: Sequence[LoadCase], elements: Elements, plane: bool | None = None) -> Bools:
    """Return a mask (u,) of the unknowns that cannot move. All loads must have equal supports.
    plane : False lets a flat sheet move out of its plane. Raises StaticsError if the supports leave a motion free."""
    reference = loads[0]
    clamped = all_clamped(reference)
    require_clampable(surface, elements, clamped)
    fixed = reference.fixed.copy()
    if plane is not False and (axis := flat_axis(surface, *loads)) is not None:
        fixed[:, axis] = True
    turning = clamped if "rotation" in elements.on_edges else None
    require_held(surface, reference, fixed, turning)
    for load in loads:
        require_loads_on_faces(surface, load)
    if not elements.on_edges:
        return fixed.ravel()
    return np.concatenate([fixed.ravel(), held_on_edges(surface, elements, fixed, turning).T.ravel()])


def equilibrium_of_unknowns(
    surface: Surface, load: LoadCase, elements: Elements, unbalanced: Floats, x: Floats, is_held: Bools
) -> Equilibrium:
    """Return the equilibrium for known values x (u,) of the unknowns. Its compliance and residual are left at 0.
    unbalanced : (u,) forces of supports and springs on the sheet, N.    is_held : (u,) mask of fixed unknowns."""
    corners, edges = np.split(x, [3 * surface.n])
    forces, on_edges = np.split(unbalanced, [3 * surface.n])
    u = corners.reshape(-1, 3)
    # take spring forces from u, because K x - f hides errors of u
    reaction = np.where(load.fixed, forces.reshape(-1, 3), 0.0) - load.spring * u
    imbalance = _imbalance(surface, load.force, reaction, _torque(elements, on_edges))
    torque = _torque(elements, np.where(is_held[3 * surface.n :], on_edges, 0.0))
    named = zip(elements.on_edges, edges.reshape(len(elements.on_edges), -1), strict=True) if len(edges) else ()
    return Equilibrium(u, reaction, 0.0, imbalance, 0.0, dict(named), torque, elements)


def _combination(
    surface: Surface,
    loads: Sequence[LoadCase],
    answers: Sequence[Equilibrium],
    factors: Sequence[float],
    F: Floats,
    X: Floats,
) -> Equilibrium:
    parts = list(zip(factors, answers, strict=True))
    reaction = np.sum([a * part.reaction for a, part in parts], axis=0)
    torque = np.sum([a * part.torque for a, part in parts], axis=0)
    on_edges = {name: np.sum([a * part.on_edges[name] for a, part in parts], axis=0) for name in answers[0].on_edges}
    compliance = float((F @ np.array(factors)) @ (X @ np.array(factors)))
    energy_error = sum(abs(a) * part.residual * np.sqrt(abs(part.compliance)) for a, part in parts)
    residual = float(energy_error / np.sqrt(compliance)) if compliance > 0 else 0.0
    force = np.sum([a * load.force for a, load in zip(factors, loads, strict=True)], axis=0)
    imbalance = _imbalance(surface, force, reaction, torque)
    u = np.sum([a * part.u for a, part in parts], axis=0)
    return Equilibrium(u, reaction, compliance, imbalance, residual, on_edges, torque, answers[0].elements)


def require_solved(surface: Surface, imbalance: float, residual: float) -> None:
    """Raise StaticsError if the relative imbalance exceeds `BALANCE`, or the relative residual exceeds `RESIDUAL`."""
    if imbalance <= BALANCE and residual <= RESIDUAL:
        return
    needles = f"; {message}" if (message := needle_message(surface)) else ""
    if not imbalance <= BALANCE:
        either = f"{'some triangles are too flat, or ' if needles else ''}the sheet is nearly a mechanism"
        raise StaticsError(
            f"loads and reactions differ by {imbalance:.1e} of the load (relative residual {residual:.1e}): "
            f"{either}; hold more directions at the supports, or use a thicker sheet or a finer mesh{needles}"
        )
    raise StaticsError(
        f"the relative residual of the solution is {residual:.1e} (limit {RESIDUAL:g}): the sheet is too thin for its "
        f"size or nearly a mechanism; use a thicker sheet, hold more directions at the supports, or remove very flat "
        f"triangles{needles}"
    )


def solution(
    surface: Surface, K: csr_array, F: Floats, is_held: Bools, factor_of: FactorFunction
) -> tuple[Floats, Floats]:
    """Solve K U = F for k load vectors F (N, k). Return U (N, k), and the relative residual (k,) of each column."""
    U = np.zeros(F.shape)
    if not (~is_held & (K.diagonal() > 0)).any():
        return U, np.zeros(F.shape[1])
    factor = factor_of(surface, K, is_held)
    scale = factor.scale[:, None]
    x, residual = refined_solution(factor.map, scale * F[factor.free], factor.solve)
    U[factor.free] = scale * x
    return U, residual


def _torque(elements: Elements, on_edges: Floats) -> Floats:
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
