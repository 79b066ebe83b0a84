"""What happened to a solid, in sentences: thinned places, remaining intersections, details that rounding destroys."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.thickening.intersect import intersecting_pairs
from dsfab.thickening.repair import Repaired
from dsfab.units import MM_PER_M


def repair_notes(surface: Surface, D: Floats, repair: Repaired, F: Ints) -> tuple[str, ...]:
    """Where the repair made the sheet with offsets D (n, 3) thinner, and which faces of the solid F still intersect."""
    notes = []
    share = np.linalg.norm(repair.D, axis=1) / np.linalg.norm(D, axis=1)
    thin = np.flatnonzero(share < 1 - 1e-9)
    if len(thin):
        where = _place(surface.V[share.argmin()])
        notes.append(
            f"the sheet met itself in {repair.found} pairs of faces and was thinned at {len(thin)} of {surface.n} "
            f"vertices, down to {share.min():.2f} of its thickness near {where}"
        )
    if len(repair.pairs):
        V = np.concatenate([surface.V + repair.D, surface.V - repair.D])
        where = _place(V[F[repair.pairs[0]]].mean(axis=(0, 1)))
        notes.append(
            f"{len(repair.pairs)} pairs of faces of the solid still intersect, the first near {where}; "
            f"{_cause(surface)}"
        )
    return tuple(notes)


def rounding_notes(V: Floats, F: Ints) -> tuple[str, ...]:
    """Which faces lose a corner when vertices are rounded to single precision in millimetres, as STL stores them."""
    single = (V * MM_PER_M).astype(np.float32)
    lost = (single[F] == single[np.roll(F, -1, axis=1)]).all(axis=2).any(axis=1)
    if not lost.any():
        return ()
    where = _place(V[F[lost.argmax()]].mean(axis=0))
    return (
        f"{int(lost.sum())} of {len(F)} faces collapse in files of single precision (STL), the first near {where}; "
        "coarsen the sheet there or move it to the origin",
    )


def _cause(surface: Surface) -> str:
    """Why the last intersections could not be removed."""
    crossings = len(intersecting_pairs(surface.V, surface.F))
    if crossings:
        return f"the surface itself crosses itself, in {crossings} pairs of faces"
    return "parts of the surface are closer together than the sheet is thick"


def _place(point: Floats) -> str:
    x, y, z = (float(c) for c in point)
    return f"({x:.4g}, {y:.4g}, {z:.4g}) m"
