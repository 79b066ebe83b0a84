"""What happened to a solid, in sentences: thinned places, remaining intersections, details that rounding destroys."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import half_edges
from dsfab.thickening.repair import Repaired
from dsfab.units import MM_PER_M

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Repairs:
    """What was done to make a solid buildable, in numbers.

    rung     : the strongest means that it took: `none`, `flipped` (wall diagonals), `thinned`, or `united` (parts of a
               sheet that crosses itself).
    found    : pairs of faces that intersected before.
    thinned  : vertices of the sheet that were made thinner because it met itself, `thinnest` the smallest share of the
               thickness left there, and `thinnest_at` its place, metres; 0, 1 and None without any.
    pairs    : pairs of faces that still intersect, and `pairs_at` the place of the first, metres.
    crossings : lines along which the sheet crosses itself and its parts were fused.
    moved    : vertices that were moved where the sheet was folded over itself in a small place, at most by `moved_by`
               metres.
    lost     : share of the sheet's volume that thinning took.
    limited  : vertices of the uncut surface made thinner because it bends too tightly there, down to `smallest`.
    """

    rung: Literal["none", "flipped", "thinned", "united"] = "none"
    found: int = 0
    thinned: int = 0
    thinnest: float = 1.0
    thinnest_at: Place | None = None
    pairs: int = 0
    pairs_at: Place | None = None
    crossings: int = 0
    moved: int = 0
    moved_by: float = 0.0
    lost: float = 0.0
    limited: int = 0
    smallest: float = 1.0


def repairs_of(surface: Surface, D: Floats, repair: Repaired, V: Floats, F: Ints) -> tuple[Repairs, tuple[str, ...]]:
    """What the repair did to the sheet with offsets D (n, 3), in numbers and in sentences; V, F is the solid made."""
    told, notes = Repairs(rung="flipped" if repair.found else "none", found=repair.found), []
    share = np.linalg.norm(repair.D, axis=1) / np.linalg.norm(D, axis=1)
    thin = int((share < 1 - 1e-9).sum())
    if thin:
        at, least = surface.V[share.argmin()], float(share.min())
        lost = 1 - float(surface.areas @ share[surface.F].mean(axis=1)) / float(surface.areas.sum())
        told = replace(told, rung="thinned", thinned=thin, thinnest=least, thinnest_at=_triple(at), lost=lost)
        notes.append(
            f"the sheet met itself in {repair.found} pairs of faces and was thinned at {thin} of {surface.n} "
            f"vertices, by {lost:.2%} of its volume, down to {least:.2f} of its thickness near {_place(at)}"
        )
    away = np.linalg.norm(repair.V - surface.V, axis=1)
    if away.any():
        moved, far = int((away > 0).sum()), float(away.max())
        told = replace(told, rung=told.rung if thin else "thinned", moved=moved, moved_by=far)
        notes.append(
            f"the sheet was folded over itself in places smaller than its thickness; {moved} of its vertices were "
            f"moved, at most by {far:.3g} m near {_place(surface.V[away.argmax()])}"
        )
    if repair.union:
        told = replace(told, rung="united", crossings=repair.union.places)
        lines = "in one place" if repair.union.places == 1 else f"in {repair.union.places} places"
        notes.append(f"the sheet crosses itself {lines}; its parts are fused there")
    if len(repair.pairs):
        at = V[F[repair.pairs[0]]].mean(axis=(0, 1))
        told = replace(told, pairs=len(repair.pairs), pairs_at=_triple(at))
        notes.append(
            f"{len(repair.pairs)} pairs of faces of the solid still intersect, the first near {_place(at)}; "
            f"{_cause(repair)}"
        )
    return told, tuple(notes)


def rounding_notes(V: Floats, F: Ints) -> tuple[str, ...]:
    """Which faces F (m, 3) lose a corner when V (n, 3), metres, is rounded to single precision in millimetres, as in
    STL."""
    a, b = half_edges(F)
    lost = np.arange(len(a))
    for column in V.T:
        single = (column * MM_PER_M).astype(np.float32)
        lost = lost[single[a[lost]] == single[b[lost]]]
    lost = np.unique(lost // 3)
    if not len(lost):
        return ()
    where = _place(V[F[lost[0]]].mean(axis=0))
    return (
        f"{len(lost)} of {len(F)} faces collapse in files of single precision (STL), the first near {where}; "
        "coarsen the sheet there or move it to the origin",
    )


def _cause(repair: Repaired) -> str:
    """Why the last intersections could not be removed."""
    if repair.union:
        return "rounding where parts are fused; programs that slice it for printing take such contacts"
    if repair.crosses:
        return f"the surface itself crosses itself, in {repair.crosses} pairs of faces"
    return "parts of the surface are closer together than the sheet is thick"


def _place(point: Floats) -> str:
    x, y, z = (float(c) for c in point)
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"


def _triple(point: Floats) -> Place:
    return float(point[0]), float(point[1]), float(point[2])
