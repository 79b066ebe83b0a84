"""`solve_frame`: displacements, reactions and end forces of beams in space, by direct stiffness.

Elements are exact for loads on nodes: cubic bending with shear [Timoshenko 1921; Przemieniecki 1968, 5.6], linear
tension and torsion. Rotations are small, and sections stay as they are.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.errors import StaticsError
from dsfab.frame.model import Frame

LOOSE = 1e-5
"""A structure whose residual is a larger share of its loads is no structure."""


@dataclass(frozen=True, eq=False)
class FrameAnswer:
    """How a frame answers a load.

    u        : (n, 6) displacements, metres, and rotations, radians.
    reaction : (n, 6) forces and moments of the supports on it, N and Nm; springs among them.
    end      : (b, 2, 6) forces and moments on both ends of each beam in its own axes, N and Nm, as it bears them:
               N, Vy, Vz, Mt, My, Mz on a section that local x points out of; N is positive for tension.
    energy   : (b,) J, elastic, in each beam.
    compliance : J, loads times displacements.
    """

    u: Floats
    reaction: Floats
    end: Floats
    energy: Floats
    compliance: float

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None, 6))
        lock(self, "reaction", np.float64, (len(self.u), 6))
        lock(self, "end", np.float64, (None, 2, 6))
        lock(self, "energy", np.float64, (len(self.end),))


def solve_frame(frame: Frame, shear: bool = True) -> dict[str, FrameAnswer]:
    """The answers of a frame to its cases and combinations, by name.

    shear : whether sections deform by shear; without it beams are those of Euler and Bernoulli.
    Raises StaticsError for a frame that is free to move.
    """
    k, turn = local_stiffness(frame, shear), _turn(frame)
    K = _assembled(frame, np.einsum("bji,bjk,bkl->bil", turn, k, turn))
    free = ~frame.fixed.ravel()
    solve = _factor(K, free, frame)
    return {name: _answer(frame, load, K, solve(load.ravel()), (k, turn)) for name, load in frame.all_loads.items()}


def local_stiffness(frame: Frame, shear: bool = True) -> Floats:
    """(b, 12, 12) stiffness of each beam in its own axes; unknowns are six of its first node, six of its second."""
    L, E, G = frame.length, frame.material.young, frame.material.shear
    torsion, about_y, about_z = frame.inertia.T
    k = np.zeros((len(L), 12, 12))
    for at, stiff in ((0, E * frame.area / L), (3, G * torsion / L)):
        k[:, at, at] = k[:, at + 6, at + 6] = stiff
        k[:, at, at + 6] = k[:, at + 6, at] = -stiff
    sheared = G * frame.shear_area * L**2 if shear else np.full(len(L), np.inf)
    for across, turn, inertia, sign in ((1, 5, about_z, 1.0), (2, 4, about_y, -1.0)):
        phi = 12 * E * inertia / sheared
        c = E * inertia / (L**3 * (1 + phi))
        signs = np.array([1.0, sign, 1.0, sign])
        four = np.array([across, turn, across + 6, turn + 6])
        k[:, four[:, None], four] = c[:, None, None] * _bending(L, phi) * np.outer(signs, signs)
    return k


def _bending(L: Floats, phi: Floats) -> Floats:
    """(b, 4, 4) of deflection and rotation at both ends, over EI / (L^3 (1 + phi))."""
    one, far, near = np.full_like(L, 12.0), (2 - phi) * L**2, (4 + phi) * L**2
    rows = [
        [one, 6 * L, -one, 6 * L],
        [6 * L, near, -6 * L, far],
        [-one, -6 * L, one, -6 * L],
        [6 * L, far, -6 * L, near],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _turn(frame: Frame) -> Floats:
    """(b, 12, 12) from the axes of the surface to those of each beam."""
    turn = np.zeros((len(frame.ends), 12, 12))
    for k in range(0, 12, 3):
        turn[:, k : k + 3, k : k + 3] = frame.axes
    return turn


def _unknowns(frame: Frame) -> Ints:
    """(b, 12) numbers of the unknowns of each beam."""
    return np.asarray((6 * frame.ends[:, :, None] + np.arange(6)).reshape(-1, 12))


def _assembled(frame: Frame, k: Floats) -> csr_array:
    at, size = _unknowns(frame), 6 * len(frame.points)
    rows, columns = np.repeat(at, 12, axis=1).ravel(), np.tile(at, (1, 12)).ravel()
    return csr_array(coo_array((k.ravel(), (rows, columns)), shape=(size, size)))


def _factor(K: csr_array, free: Bools, frame: Frame) -> Callable[[Floats], Floats]:
    """A function from loads to displacements, both (6 n,)."""
    whole = csr_array(K + diags_array(frame.spring.ravel()))
    inside = csc_array(whole[free][:, free])
    scale = 1 / np.sqrt(np.maximum(inside.diagonal(), np.finfo(float).tiny))
    try:
        factor = splu(csc_array(diags_array(scale) @ inside @ diags_array(scale)), options={"SymmetricMode": True})
    except RuntimeError:
        raise StaticsError(_moves(frame)) from None

    def solve(load: Floats) -> Floats:
        u, f = np.zeros(len(free)), load[free]
        u[free] = scale * factor.solve(scale * f)
        u[free] += scale * factor.solve(scale * (f - inside @ u[free]))
        left = np.abs(inside @ u[free] - f).max()
        if not left <= LOOSE * max(np.abs(f).max(), np.finfo(float).tiny):
            raise StaticsError(_moves(frame))
        return u

    return solve


def _moves(frame: Frame) -> str:
    held = int(frame.fixed.any(axis=1).sum())
    return (
        f"the beam model of {len(frame.members)} members moves freely, held at {held} of {len(frame.points)} nodes; "
        "hold more of the surface, or join the members that hang loose (see the nodes in members.json)"
    )


def _answer(frame: Frame, load: Floats, K: csr_array, u: Floats, local: tuple[Floats, Floats]) -> FrameAnswer:
    k, turn = local
    reaction = (K @ u - load.ravel()) * (frame.fixed | (frame.spring > 0)).ravel()
    moved = np.einsum("bij,bj->bi", turn, u[_unknowns(frame)])
    forces = np.einsum("bij,bj->bi", k, moved)
    energy, forces = np.einsum("bi,bi->b", forces, moved) / 2, forces.reshape(-1, 2, 6)
    forces[:, 0] *= -1  # on the first end local x points out of what is before the beam
    return FrameAnswer(u.reshape(-1, 6), reaction.reshape(-1, 6), forces, energy, float(load.ravel() @ u))
