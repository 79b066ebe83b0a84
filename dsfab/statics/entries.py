"""What each support of a sheet holds, and what each load amounts to: entry by entry, as a preset lists them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Bools, Floats, lock
from dsfab.statics.balance import support_forces
from dsfab.statics.solve import Equilibrium
from dsfab.statics.spread import spread_load
from dsfab.surface import Load, Support, Surface, load_names, support_names


@dataclass(frozen=True, eq=False)
class SupportEntry:
    """A support and what rests on it.

    vertices : how many it holds.       place : (3,) their mean, metres.
    length   : metres of edges along it: free edges, and those of a line within the sheet. 0 for points.
    area     : m2 of the faces that it holds wholly.
    holds    : 'xyz', 'z, clamped', 'spring xy'.
    reaction : by case, (3,) newtons that it exerts on the sheet.
    share    : by case, of the sum of the magnitudes of all reactions at the vertices; 0 to 1.
    """

    name: str
    vertices: int
    place: Floats
    length: float
    area: float
    holds: str
    reaction: Mapping[str, Floats] = field(default_factory=dict)
    share: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class LoadEntry:
    """A load and what it amounts to.

    force    : (3,) its resultant, newtons.    total : the sum of the magnitudes of its forces, newtons.
    area     : m2 of the faces that it acts on.    length : metres of the edges.    vertices : how many take part.
    """

    name: str
    kind: str
    case: str
    force: Floats
    total: float
    area: float
    length: float
    vertices: int

    def __post_init__(self) -> None:
        lock(self, "force", np.float64, (3,))


def support_entries(
    surface: Surface, supports: Sequence[Support], answers: Mapping[str, Equilibrium] | None = None
) -> tuple[SupportEntry, ...]:
    """Each support, with its reactions under each case where `answers` has them. Raises SurfaceError for pickers that
    pick nothing."""
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
    """How many vertices are picked (n,), their mean, metres of edges along them and m2 of faces among them.

    An edge within the sheet counts if no face beside it is picked wholly: it is of a line, not of a region.
    """
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
    """Each load by itself, without the factors of combinations.

    weight : of the sheet, newtons per square metre, as for `LoadCase.build`.
    Raises SurfaceError for loads that act on nothing.
    """
    entries = []
    for name, load in zip(load_names(loads), loads, strict=True):
        force, spread = load.on(surface, weight), spread_load(surface, [load], weight)
        size = np.linalg.norm(force, axis=1)
        area = surface.areas[spread.face.any(axis=1)].sum()
        length = surface.edge_lengths[spread.edge.any(axis=1)].sum()
        sums = force.sum(axis=0), float(size.sum()), float(area), float(length), int(np.count_nonzero(size))
        entries.append(LoadEntry(name, load.kind, load.case, *sums))
    return tuple(entries)
