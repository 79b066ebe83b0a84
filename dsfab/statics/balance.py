"""Who carries what: resultants of forces, and the reactions of each support."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, lock
from dsfab.statics.solve import Equilibrium
from dsfab.surface.loads import Support
from dsfab.surface.mesh import Surface


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
    """What each support exerts on the sheet.

    A direction of a vertex that several supports hold is shared equally; the torque of an edge that cannot turn goes to
    the supports that pick its ends. Together they balance the loads, unless edges were clamped away from all supports.
    """
    fixed = np.array([support.fixed(surface) for support in supports])  # (s, n, 3)
    forces = answer.reaction * fixed / np.maximum(fixed.sum(axis=0), 1)
    torques = np.zeros((len(supports), 0))
    if len(answer.torque):
        held = np.asarray(fixed.any(axis=2))
        ends = held[:, surface.edges.ends].sum(axis=2)  # (s, e) how many it picks
        torques = answer.torque * ends / np.maximum(ends.sum(axis=0), 1)
    return tuple(resultant(surface, force, torque) for force, torque in zip(forces, torques, strict=True))
