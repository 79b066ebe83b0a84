"""Who carries what: resultants of forces, and the reactions of each support."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, lock
from dsfab.statics.solve import Equilibrium
from dsfab.surface.mesh import Surface
from dsfab.surface.supports import Support


@dataclass(frozen=True, eq=False)
class Resultant:
    """force : (3,) sum of forces, newtons.  moment : (3,) sum of moments about the origin, newton metres."""

    force: Floats
    moment: Floats

    def __post_init__(self) -> None:
        lock(self, "force", np.float64, (3,))
        lock(self, "moment", np.float64, (3,))


def resultant(surface: Surface, force: Floats, torque: Floats | None = None) -> Resultant:
    """Of forces (n, 3) at the vertices, newtons, and torques (e,) about the edges' directions, newton metres."""
    moment = np.cross(surface.V, force).sum(axis=0)
    if torque is not None and len(torque):
        ends = surface.V[surface.edges.ends]
        along = ends[:, 1] - ends[:, 0]
        moment = moment + torque @ (along / np.linalg.norm(along, axis=1, keepdims=True))
    return Resultant(force.sum(axis=0), moment)


def support_reactions(surface: Surface, supports: Sequence[Support], answer: Equilibrium) -> tuple[Resultant, ...]:
    """What each support exerts on the sheet: the sums of `support_forces`, and torques.

    The torque of an edge goes to the supports that clamp it; where none does, and yet it cannot turn, to
    those that pick its ends. Together they balance the loads, unless edges were clamped away from all supports.
    """
    forces = support_forces(surface, supports, answer)
    fixed = np.array([support.fixed(surface) for support in supports])  # (s, n, 3)
    torques = np.zeros((len(supports), 0))
    if len(answer.torque):
        clamped = np.array([support.clamped(surface) for support in supports])  # (s, e)
        ends = np.asarray(fixed.any(axis=2))[:, surface.edges.ends].sum(axis=2)  # how many it holds
        torques = answer.torque * _shares(np.where(clamped.any(axis=0), clamped, ends))
    return tuple(resultant(surface, force, torque) for force, torque in zip(forces, torques, strict=True))


def support_forces(surface: Surface, supports: Sequence[Support], answer: Equilibrium) -> Floats:
    """(s, n, 3) newtons that each support exerts on each vertex.

    A direction of a vertex that several supports hold is shared equally, one on several springs in proportion to their
    stiffness.
    """
    fixed = np.array([support.fixed(surface) for support in supports])
    springs = np.array([support.springs(surface) for support in supports])
    # a spring at a held place does not stretch
    return np.asarray(answer.reaction * _shares(np.where(fixed.any(axis=0), fixed, springs)))


def _shares(parts: Floats) -> Floats:
    """(s, ...) non-negative parts over their sum along the first axis; 0 where all are."""
    total = parts.sum(axis=0)
    return np.asarray(parts / np.where(total > 0, total, 1.0))
