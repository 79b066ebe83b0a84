"""One linear solve: displacements, reactions, compliance, and the proof that they balance."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, lock
from dsfab.errors import StaticsError
from dsfab.sparse import NotPositiveDefinite, factorise
from dsfab.statics.mechanisms import require_held, require_loads_on_faces
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

BALANCE = 1e-6
"""Largest accepted sum of loads and reactions, relative to the sum of the loads' magnitudes."""

IN_PLANE = 1e-12
"""A load with a smaller share across the plane of a flat sheet counts as lying in the plane."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """How a surface answers a load.

    u          : (n, 3) displacements, metres.
    reaction   : (n, 3) forces of the supports on the sheet, newtons; zero where nothing is held.
    compliance : f . u, joules (twice the elastic energy); the smaller, the stiffer.
    imbalance  : largest component of the sum of all forces (and of their moments over the size), loads and reactions
                 together, relative to the sum of the loads' magnitudes.
    """

    u: Floats
    reaction: Floats
    compliance: float
    imbalance: float

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None, 3))
        lock(self, "reaction", np.float64, (len(self.u), 3))

    @cached_property
    def largest_displacement(self) -> float:
        """Metres."""
        return float(np.linalg.norm(self.u, axis=1).max())


def flat_axis(surface: Surface, load: LoadCase) -> int | None:
    """The coordinate axis across a flat sheet whose loads lie in its plane (then it is solved in 2D), else None."""
    for axis in range(3):
        flat = np.ptp(surface.V[:, axis]) <= 1e-9 * surface.size
        if flat and np.abs(load.force[:, axis]).max() <= IN_PLANE * np.abs(load.force).max():
            return axis
    return None


def equilibrium(surface: Surface, K: csr_array, load: LoadCase) -> Equilibrium:
    """Solve K u = f with the supported freedoms projected out.

    K : (3 n, 3 n) stiffness, N/m, freedoms ordered x, y, z of vertex 0, of vertex 1, ...

    Raises StaticsError when the supports leave a motion free, when a load acts on nothing, or when the solution does
    not balance the loads.
    """
    fixed = load.fixed.copy()
    if (axis := flat_axis(surface, load)) is not None:
        fixed[:, axis] = True
    require_held(surface, load, fixed)
    require_loads_on_faces(surface, load)
    f = load.force.ravel()
    u = _displacements(surface, K, f, fixed)
    reaction = np.where(load.fixed.ravel(), K @ u - f, 0.0).reshape(-1, 3)
    imbalance = _imbalance(surface, load.force, reaction)
    if not imbalance <= BALANCE:
        raise StaticsError(
            f"loads and reactions differ by {imbalance:.1e} of the load: the sheet is nearly a mechanism; "
            "hold more directions, or make it thicker or the mesh finer"
        )
    return Equilibrium(u.reshape(-1, 3), reaction, float(f @ u), imbalance)


def _displacements(surface: Surface, K: csr_array, f: Floats, fixed: Bools) -> Floats:
    """(3 n,) solution; freedoms without stiffness (vertices of no face) stay where they are."""
    free = np.flatnonzero(~fixed.ravel() & (K.diagonal() > 0))
    u = np.zeros(3 * surface.n)
    if not len(free):
        return u
    inner = csr_array(K[free][:, free])
    # Jacobi scaling: membrane and bending differ by (size / thickness)^2 in stiffness
    scale = 1 / np.sqrt(inner.diagonal())
    inner = csr_array(inner.multiply(scale[:, None]).multiply(scale[None, :]))
    try:
        solve = factorise(inner, surface.V, free // 3)
    except NotPositiveDefinite as error:
        raise StaticsError(
            "the sheet is a mechanism: parts of it meet in single points or are not held; "
            "check the mesh with `dsfab inspect` and hold more directions"
        ) from error
    b = scale * f[free]
    x = solve(b)
    x += solve(b - inner @ x)  # one step of iterative refinement: thin sheets are badly conditioned
    u[free] = scale * x
    return u


def _imbalance(surface: Surface, force: Floats, reaction: Floats) -> float:
    total = force + reaction
    arm = (surface.V - surface.V.mean(axis=0)) / surface.size
    largest = max(np.abs(total.sum(axis=0)).max(), np.abs(np.cross(arm, total).sum(axis=0)).max())
    reference = np.linalg.norm(force, axis=1).sum()
    return float(largest / reference) if reference else 0.0
