"""Reactions of supports, and resultants of loads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Bools, Floats, lock_floats
from dsfab.statics.boundary_conditions import spread_load
from dsfab.statics.solve import Equilibrium
from dsfab.surface import Load, load_names, support_names
from dsfab.surface.loads.supports import Support
from dsfab.surface.mesh import Surface


@dataclass(frozen=True, eq=False)
class Resultant:
    """Sum of forces, `force` (3,), N, and of moments about the origin, `moment` (3,), N m."""

    force: Floats
    moment: Floats

    def __post_init__(self) -> None:
        lock_floats(self, force=(3,), moment=(3,))


def resultant(surface: Surface, force: Floats, torque: Floats | None = None) -> Resultant:
    """Return the resultant of forces (n, 3), N, at the vertices and of torques (e,), N m, about the edges."""
    moment = np.cross(surface.V, force).sum(axis=0)
    if torque is not None and len(torque):
        ends = surface.V[surface.edges.ends]
        along = ends[:, 1] - ends[:, 0]
        moment = moment + torque @ (along / np.linalg.norm(along, axis=1, keepdims=True))
    return Resultant(force.sum(axis=0), moment)


def support_reactions(surface: Surface, supports: Sequence[Support], answer: Equilibrium) -> tuple[Resultant, ...]:
    """Return the resultant of the forces and torques of each support on the sheet.
    Torques at clamped edges that touch no support belong to no resultant. answer : solution with the reactions."""
    forces = support_forces(surface, supports, answer)
    fixed = np.array([support.fixed_directions(surface) for support in supports])  # (s, n, 3)
    torques = np.zeros((len(supports), 0))
    if len(answer.torque):
        clamped = np.array([support.clamped_edges(surface) for support in supports])  # (s, e)
        ends = np.asarray(fixed.any(axis=2))[:, surface.edges.ends].sum(axis=2)  # number of supported ends of each edge
        torques = answer.torque * _shares(np.where(clamped.any(axis=0), clamped, ends))
    return tuple(resultant(surface, force, torque) for force, torque in zip(forces, torques, strict=True))


def support_forces(surface: Surface, supports: Sequence[Support], answer: Equilibrium) -> Floats:
    """Return the forces (s, n, 3), N, of each of s supports on each vertex. answer : solution with the reactions."""
    fixed = np.array([support.fixed_directions(surface) for support in supports])
    springs = np.array([support.springs(surface) for support in supports])
    # a spring carries nothing in a direction that a support fixes, because the spring does not stretch
    return np.asarray(answer.reaction * _shares(np.where(fixed.any(axis=0), fixed, springs)))


def _shares(parts: Floats) -> Floats:
    total = parts.sum(axis=0)
    return np.asarray(parts / np.where(total > 0, total, 1.0))


@dataclass(frozen=True, eq=False)
class SupportEntry:
    """A support and its reactions. place : (3,) mean position of the supported vertices, metres.
    length   : length of the supported edges, metres; 0 for points.    area : supported area, m2.
    holds    : fixed directions, springs and clamping, such as 'xyz', 'z, clamped' or 'spring xy'.
    reaction : (3,) force on the sheet, newtons, for each load case by name.
    share    : this support's forces divided by the forces of all supports (sums of magnitudes), by load case."""

    name: str
    vertices: int
    place: Floats
    length: float
    area: float
    holds: str
    reaction: Mapping[str, Floats] = field(default_factory=dict)
    share: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lock_floats(self, place=(3,))


@dataclass(frozen=True, eq=False)
class LoadEntry:
    """A load and its resultant.
    force : (3,) sum of the load's forces, N.    total : sum of the magnitudes of these forces, N.
    area  : area of loaded faces, m2.            length : length of loaded edges, metres."""

    name: str
    kind: str
    case: str
    force: Floats
    total: float
    area: float
    length: float
    vertices: int

    def __post_init__(self) -> None:
        lock_floats(self, force=(3,))


def support_entries(
    surface: Surface, supports: Sequence[Support], answers: Mapping[str, Equilibrium] | None = None
) -> tuple[SupportEntry, ...]:
    """Return each support with its position, its size, and its reactions.
    answers : solution of each load case, by name. Raises SurfaceError for a support that selects no vertex."""
    reactions: dict[str, list[Floats]] = {}
    shares: dict[str, Floats] = {}
    for case, answer in (answers or {}).items():
        forces = support_forces(surface, supports, answer)
        size = np.linalg.norm(forces, axis=2).sum(axis=1)
        reactions[case] = list(forces.sum(axis=1))
        shares[case] = size / (size.sum() or 1.0)
    return tuple(
        SupportEntry(
            name,
            *_extent(surface, support.at.vertices(surface)),
            _holds(support),
            {case: parts[k] for case, parts in reactions.items()},
            {case: float(parts[k]) for case, parts in shares.items()},
        )
        for k, (name, support) in enumerate(zip(support_names(supports), supports, strict=True))
    )


def _extent(surface: Surface, picked: Bools) -> tuple[int, Floats, float, float]:
    """Return the number and the mean position (3,) of the vertices with the mask `picked`.
    Return also the length (m) of edges and the area (m2) of faces between these vertices."""
    faces, edges = surface.faces_of(picked), surface.edges
    inner = np.zeros(len(edges.ends), dtype=bool)
    inner[edges.of[faces]] = True
    along = picked[edges.ends].all(axis=1) & (edges.boundary | ~inner)
    length, area = surface.edge_lengths[along].sum(), surface.areas[faces].sum()
    return int(picked.sum()), surface.V[picked].mean(axis=0), float(length), float(area)


def _holds(support: Support) -> str:
    springs = "".join(axis for axis, k in zip("xyz", support.spring or (0, 0, 0), strict=True) if k)
    words = (support.hold, f"spring {springs}" if springs else "", "clamped" if support.clamp else "")
    return ", ".join(word for word in words if word)


def load_entries(surface: Surface, loads: Sequence[Load], weight: float) -> tuple[LoadEntry, ...]:
    """Return each load with its resultant and size. Factors of load combinations are not applied.
    weight : weight of the sheet per area, N/m2. Raises SurfaceError for a load without effect."""
    entries = []
    for name, load in zip(load_names(loads), loads, strict=True):
        force, spread = load.forces(surface, weight), spread_load(surface, [load], weight)
        size = np.linalg.norm(force, axis=1)
        area = surface.areas[spread.face.any(axis=1)].sum()
        length = surface.edge_lengths[spread.edge.any(axis=1)].sum()
        sums = force.sum(axis=0), float(size.sum()), float(area), float(length), int(np.count_nonzero(size))
        entries.append(LoadEntry(name, load.kind, load.case, *sums))
    return tuple(entries)
