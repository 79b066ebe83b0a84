"""Fewer triangles within a stated distance, for formats whose readers suffer from many.

manifold3d collapses edges and exceeds the tolerance it is given, so the result is measured, both ways, and made again
with a smaller one where it is too far off, has changed the volume, or crosses itself.
"""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError, SolidError
from dsfab.export.budget import within
from dsfab.export.part import Part, open_edges
from dsfab.export.planar import polyhedron
from dsfab.export.step_text import faceted_bytes
from dsfab.limits import CHANGED_VOLUME, OFF_SURFACE
from dsfab.surface import nearest
from dsfab.thickening.coarsen import coarsened
from dsfab.thickening.intersect import intersecting_pairs

TRIES = 6
STRIDE = 1.6
"""manifold3d's tolerance is changed by this factor from try to try."""
HOPELESS = 1.2
"""Times the faces that a part may have: with so many left beyond the tolerance, no try within it is made."""
WORTH = 0.9
"""Fewer triangles than this share of the given ones, or it was not worth it."""


def usual_tolerance(part: Part) -> float:
    """Millimetres that a solid may be simplified by when nothing else is said."""
    return OFF_SURFACE * 2 * part.volume / part.area


def simplified_part(part: Part, tolerance: float) -> Part:
    """The solid with fewer triangles, none of its points farther than `tolerance` (mm) from the other's surface.

    `note` of the result says the distance that was measured and the change of volume. Raises ExportError when no try
    stays within the tolerance, keeps the volume to 0.5 %, has no more crossings than before, and is worth it; and
    BudgetError as soon as far more planar faces are left than the part may have, `step_faces` (if that is not 0).
    """
    crossing, step = len(intersecting_pairs(part.V, part.F)), tolerance
    best: Part | None = None
    for _ in range(TRIES):
        simple, moved = _tried(part, step)
        if len(simple.F) and moved <= tolerance and _sound(part, simple, crossing):
            best, step = simple, STRIDE * step
        elif best is not None:
            break
        else:
            _ask_faces(simple)
            step *= min(0.9 * tolerance / moved if moved > 0 else 1.0, 1 / STRIDE)
    if best is None or len(best.F) > WORTH * len(part.F):
        raise ExportError(
            f"{part.name!r} does not become simpler within {tolerance:.3g} mm; allow a larger step_tolerance, or "
            "coarsen the mesh"
        )
    return best


def _ask_faces(simple: Part) -> None:
    """Raise BudgetError where a try is no use: it went too far, and a smaller step hardly leaves fewer faces."""
    if 0 < HOPELESS * simple.step_faces < len(simple.F):
        shape = polyhedron(simple.V, simple.F, np.zeros(len(simple.F), dtype=np.int64))
        if len(shape.normals) > HOPELESS * simple.step_faces:
            within(simple, len(shape.normals), faceted_bytes(shape))


def _tried(part: Part, step: float) -> tuple[Part, float]:
    """The part with edges collapsed by steps of `step`, and how far that took it; both in its note."""
    try:
        V, F = coarsened(part.V, part.F, step)
    except SolidError:
        return replace(part, F=part.F[:0]), np.inf
    simple, moved = replace(part, V=V, F=F, simpler=True), distance(part.V, part.F, V, F)
    note = f"simplified from {len(part.F):,} to {len(F):,} triangles, {moved:.2g} mm off at most"
    return replace(simple, note=f"{note}, volume {simple.volume / part.volume - 1:+.2%}"), moved


def _sound(part: Part, simple: Part, crossing: int) -> bool:
    """Whether it is closed, as large as before to 0.5 %, and has no more pairs of triangles that cross."""
    same = abs(simple.volume / part.volume - 1) <= CHANGED_VOLUME and not open_edges(simple.F)
    return same and len(intersecting_pairs(simple.V, simple.F)) <= crossing


def distance(V: Floats, F: Ints, V2: Floats, F2: Ints) -> float:
    """Largest distance, both ways, between surfaces of (n, 3) and (m, 3), found at vertices, middles of edges and of
    triangles."""
    there, back = nearest(_samples(V, F), V2, F2).squared, nearest(_samples(V2, F2), V, F).squared
    return float(np.sqrt(max(there.max(), back.max())))


def _samples(V: Floats, F: Ints) -> Floats:
    corners = V[F]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    return np.concatenate([V[np.unique(F)], middles.reshape(-1, 3), corners.mean(axis=1)])
