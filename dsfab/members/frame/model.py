"""A frame of straight beams, its solution, and comparison with the shell model (sheet)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from dsfab.core.arrays import Bools, Floats, Ints, lock, lock_floats, read_only_copy
from dsfab.core.errors import StaticsError
from dsfab.statics import Equilibrium

Combinations = Mapping[str, Mapping[str, float]]  # For each combination, the factor of each load case, by name.
SHEAR = 5 / 6  # Shear area of a rectangle divided by its area [Timoshenko 1921].


def torsion_constant(width: Floats, thickness: Floats) -> Floats:
    """Return St. Venant's torsion constant (b,) of rectangles, m4, from lengths in m [Roark, table 10.1, case 4]."""
    a, t = np.maximum(width, thickness), np.minimum(width, thickness)
    slim = t / a
    return np.asarray(a * t**3 * (1 / 3 - 0.21 * slim * (1 - slim**4 / 12)))


@dataclass(frozen=True, eq=False)
class BeamMaterial:
    """Material of beams. young : Young's modulus, Pa.    density : kg/m3.    name : as in the preset, or ''."""

    young: float
    poisson: float
    density: float
    name: str = ""

    @property
    def shear(self) -> float:
        """Shear modulus, Pa."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True, eq=False)
class Frame:
    """Straight beams of rectangular section between nodes, in SI units. n counts the nodes, b the beams.
    The six unknowns of a node are translations along the global axes, then rotations about these axes.

             z (normal of the surface)
             |  y (in the surface)        width along y, thickness along z
        o====+==/=====o --> x             Mz bends the beam in the surface, My out of it
             | /

    points    : (n, 3) metres.    nodes : (n,) names.    ends : (b, 2) nodes of each beam.
    normal    : (b, 3) unit vectors, local z of each beam.    member : (b,) number in `members` (names); -1 for a link.
    width     : (b,) metres, along local y.    thickness : (b,) metres, along local z.
    fixed     : (n, 6) True for a fixed unknown.    spring : (n, 6) stiffness, N/m and Nm.
    loads     : (n, 6) N and Nm, by case.    combinations : factors of the cases, by name of the combination.
    actions   : permanent, snow, wind or variable, by case; {} if unknown.
    eccentricity : (b,) metres from the beam to the middle of the material, along local y.
    stout     : (b,) width / length of the bay (part between nodes), at most 1; 0 for links."""

    points: Floats
    nodes: tuple[str, ...]
    ends: Ints
    normal: Floats
    width: Floats
    thickness: Floats
    member: Ints
    members: tuple[str, ...]
    fixed: Bools
    spring: Floats
    loads: Mapping[str, Floats]
    material: BeamMaterial
    combinations: Combinations = field(default_factory=dict)
    eccentricity: Floats = field(default_factory=lambda: np.zeros(0))
    stout: Floats = field(default_factory=lambda: np.zeros(0))
    actions: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n, b = len(self.points), len(self.ends)
        for name in ("eccentricity", "stout"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.zeros(b))
        lock_floats(self, points=(n, 3), normal=(b, 3), spring=(n, 6))
        lock_floats(self, width=(b,), thickness=(b,), eccentricity=(b,), stout=(b,))
        lock(self, "ends", np.int64, (b, 2))
        lock(self, "member", np.int64, (b,))
        lock(self, "fixed", np.bool_, (n, 6))
        loads = {name: read_only_copy(values, np.float64, (n, 6)) for name, values in self.loads.items()}
        object.__setattr__(self, "loads", MappingProxyType(loads))

    @cached_property
    def beam_members(self) -> tuple[str, ...]:
        """Name of each beam's member (b,); '' for a link."""
        return tuple(self.members[k] if k >= 0 else "" for k in self.member.tolist())

    @cached_property
    def length(self) -> Floats:
        """Lengths (b,), metres."""
        return np.asarray(np.linalg.norm(self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]], axis=1))

    @cached_property
    def axes(self) -> Floats:
        """Local x, y and z of each beam, unit vectors in rows (b, 3, 3)."""
        x = (self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]]) / self.length[:, None]
        y = np.cross(self.normal, x)
        y /= np.linalg.norm(y, axis=1)[:, None]
        return np.stack([x, y, np.cross(x, y)], axis=1)

    @cached_property
    def area(self) -> Floats:
        """Areas of the sections (b,), m2."""
        return self.width * self.thickness

    @cached_property
    def shear_area(self) -> Floats:
        """Shear areas of the sections (b,), m2."""
        return SHEAR * self.area

    @cached_property
    def inertia(self) -> Floats:
        """Torsion constant, second moments about local y and about local z (b, 3), m4."""
        w, t = self.width, self.thickness
        return np.stack([torsion_constant(w, t), w * t**3 / 12, t * w**3 / 12], axis=1)

    @cached_property
    def all_loads(self) -> dict[str, Floats]:
        """Loads (n, 6) by name: of each case, then of each combination."""
        sums = {
            name: np.sum([factor * self.loads[case] for case, factor in factors.items()], axis=0)
            for name, factors in self.combinations.items()
        }
        return {**self.loads, **sums}


@dataclass(frozen=True, eq=False)
class FrameAnswer:
    """Solution of a frame under a load. u : (n, 6) displacements, metres, and rotations, radians.
    reaction : (n, 6) forces and moments of supports and springs on the frame, N and Nm.
    end      : (b, 2, 6) section forces at the two ends, in the beam's local axes: N, Vy, Vz in N; Mt, My, Mz in Nm.
               The section's outward normal is local x. Positive N is tension.
    energy   : (b,) elastic energy of each beam, J.    compliance : loads times displacements, J."""

    u: Floats
    reaction: Floats
    end: Floats
    energy: Floats
    compliance: float

    def __post_init__(self) -> None:
        lock_floats(self, u=(None, 6), reaction=(len(self.u), 6), end=(None, 2, 6), energy=(len(self.end),))


def solve_frame(frame: Frame, shear: bool = True) -> dict[str, FrameAnswer]:
    """Return the solutions of a frame by name, for its cases and combinations.
    shear : False for beams without shear deformation.    Raises StaticsError for a frame that is free to move."""
    k, turn = local_stiffness(frame, shear), _turn(frame)
    K = _stiffness_matrix(frame, np.einsum("bji,bjk,bkl->bil", turn, k, turn))
    free = ~frame.fixed.ravel()
    solve = _factor(K, free, frame)
    return {name: _answer(frame, load, K, solve(load.ravel()), (k, turn)) for name, load in frame.all_loads.items()}


def local_stiffness(frame: Frame, shear: bool = True) -> Floats:
    """Return the stiffness matrix (b, 12, 12) of each beam in the local axes of the beam."""
    L, E, G = frame.length, frame.material.young, frame.material.shear
    torsion, about_y, about_z = frame.inertia.T
    k = np.zeros((len(L), 12, 12))
    for row, stiff in ((0, E * frame.area / L), (3, G * torsion / L)):
        k[:, row, row] = k[:, row + 6, row + 6] = stiff
        k[:, row, row + 6] = k[:, row + 6, row] = -stiff
    sheared = G * frame.shear_area * L**2 if shear else np.full(len(L), np.inf)
    for across, turn, inertia, sign in ((1, 5, about_z, 1.0), (2, 4, about_y, -1.0)):
        phi = 12 * E * inertia / sheared
        c = E * inertia / (L**3 * (1 + phi))
        signs = np.array([1.0, sign, 1.0, sign])
        four = np.array([across, turn, across + 6, turn + 6])
        k[:, four[:, None], four] = c[:, None, None] * _bending(L, phi) * np.outer(signs, signs)
    return k


def _bending(L: Floats, phi: Floats) -> Floats:
    twelve, far_end, near_end = np.full_like(L, 12.0), (2 - phi) * L**2, (4 + phi) * L**2
    rows = [
        [twelve, 6 * L, -twelve, 6 * L],
        [6 * L, near_end, -6 * L, far_end],
        [-twelve, -6 * L, twelve, -6 * L],
        [6 * L, far_end, -6 * L, near_end],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _turn(frame: Frame) -> Floats:
    turn = np.zeros((len(frame.ends), 12, 12))
    for k in range(0, 12, 3):
        turn[:, k : k + 3, k : k + 3] = frame.axes
    return turn


def _unknowns(frame: Frame) -> Ints:
    return np.asarray((6 * frame.ends[:, :, None] + np.arange(6)).reshape(-1, 12))


def _stiffness_matrix(frame: Frame, k: Floats) -> csr_array:
    unknowns, size = _unknowns(frame), 6 * len(frame.points)
    rows, columns = np.repeat(unknowns, 12, axis=1).ravel(), np.tile(unknowns, (1, 12)).ravel()
    return csr_array(coo_array((k.ravel(), (rows, columns)), shape=(size, size)))


def _factor(K: csr_array, free: Bools, frame: Frame) -> Callable[[Floats], Floats]:
    inside = csc_array(csr_array(K + diags_array(frame.spring.ravel()))[free][:, free])
    scale = 1 / np.sqrt(np.maximum(inside.diagonal(), np.finfo(float).tiny))
    try:
        factor = splu(csc_array(diags_array(scale) @ inside @ diags_array(scale)), options={"SymmetricMode": True})
    except RuntimeError:
        raise StaticsError(_moves(frame)) from None

    def solve(load: Floats) -> Floats:
        u, f = np.zeros(len(free)), load[free]
        u[free] = scale * factor.solve(scale * f)
        u[free] += scale * factor.solve(scale * (f - inside @ u[free]))
        residual = np.abs(inside @ u[free] - f).max()
        loose = 1e-5  # largest residual of a supported frame, as a fraction of the loads
        if not residual <= loose * max(np.abs(f).max(), np.finfo(float).tiny):
            raise StaticsError(_moves(frame))
        return u

    return solve


def _moves(frame: Frame) -> str:
    held_nodes = int(frame.fixed.any(axis=1).sum())
    return (
        f"the beam model of {len(frame.members)} members can move freely, although {held_nodes} of "
        f"{len(frame.points)} nodes are supported; add supports, or connect the loose members (see members.json)"
    )


def _answer(frame: Frame, load: Floats, K: csr_array, u: Floats, local: tuple[Floats, Floats]) -> FrameAnswer:
    k, turn = local
    reaction = (K @ u - load.ravel()) * (frame.fixed | (frame.spring > 0)).ravel()
    moved = np.einsum("bij,bj->bi", turn, u[_unknowns(frame)])
    forces = np.einsum("bij,bj->bi", k, moved)
    energy, forces = np.einsum("bi,bi->b", forces, moved) / 2, forces.reshape(-1, 2, 6)
    forces[:, 0] *= -1  # the outward normal of the first section is -x
    return FrameAnswer(u.reshape(-1, 6), reaction.reshape(-1, 6), forces, energy, float(load.ravel() @ u))


STOUT = 0.35
"""A bay (part between nodes) with a larger width / length does not act as a beam: joints cover half of the bay."""


@dataclass(frozen=True, eq=False)
class FrameAgreement:
    """Comparison of a frame of beams with the shell model (sheet) of the same structure, for one case.
    compliance, displacement : compliance and largest displacement of the frame, divided by the values of the sheet.
    stout : fraction of the elastic energy in parts that are too short and wide to act as beams.
    twist : largest displacement of a sheet with ribs that twist like bars / largest displacement of a thin sheet."""

    case: str
    compliance: float
    displacement: float
    stout: float
    twist: float = 1.0

    @property
    def slender(self) -> bool:
        """True if nearly all elastic energy is in long, narrow bays (parts of members between nodes)."""
        few = 0.15
        return self.stout <= few

    @property
    def summary(self) -> str:
        """Sentence that compares the beams with the sheet."""
        sentence = (
            f"beam model compared with the sheet, {self.case}: {self.compliance:.2f} times the compliance and "
            f"{self.displacement:.2f} times the largest displacement of the sheet"
        )
        if self.twist > 1.02:
            sentence += (
                f"; the ribs of the sheet twist like bars, so the sheet moves {self.twist:.2f} times as far as "
                f"thin-sheet theory predicts"
            )
        if abs(self.compliance - 1) <= 0.1 and abs(self.displacement - 1) <= 0.1:
            return sentence
        where = (
            f"{self.stout:.0%} of the strain energy is in discs, links, short wide parts (width over {STOUT:g} of the "
            f"length), and places where members overlap without a crossing"
        )
        why = (
            "most energy is in slender bays, so this difference is unexpected"
            if self.slender
            else f"{where}, where beams are a rough model"
        )
        return f"{sentence}: {why}; take displacements from the sheet"


def agreement(
    frame: Frame,
    answers: Mapping[str, FrameAnswer],
    sheet: Mapping[str, Equilibrium],
    other_energy: Mapping[str, float],
    twist: Mapping[str, float],
) -> list[FrameAgreement]:
    """Compare the frame of beams with the shell model (sheet), for each case and combination.
    other_energy : fraction of the sheet's elastic energy that is not in members with an axis, by case.
    twist        : as in `FrameAgreement`, by case."""
    stout = (frame.member < 0) | (frame.stout > STOUT)
    agreements = []
    for name in (name for name in answers if name in sheet):
        ours, theirs = answers[name], sheet[name]
        moved = float(np.linalg.norm(ours.u[:, :3], axis=1).max())
        energy = ours.energy[stout].sum() / ours.energy.sum()
        ratios = ours.compliance / theirs.compliance, moved / theirs.largest_displacement
        agreements.append(FrameAgreement(name, *ratios, max(float(energy), other_energy[name]), twist[name]))
    return agreements
