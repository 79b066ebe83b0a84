"""Size of a STEP file: its limit, the cost of a file, and coarser meshes within a tolerance to meet the limit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError, SolidError
from dsfab.core.limits import CHANGED_VOLUME, OFF_SURFACE
from dsfab.core.messages import duration
from dsfab.export.cad.step.entities import faceted_bytes
from dsfab.export.cad.step.planar import polyhedron
from dsfab.export.part import Part, open_edges
from dsfab.surface import nearest
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import coarsened

START = 1.5
"""Seconds that reading back takes at least: a process that loads OCCT."""


@dataclass(frozen=True)
class Cost:
    """Per face: seconds to write and read back, seconds for another program to open it, bytes of memory for that."""

    write: float
    open: float
    memory: float


COSTS = {
    "planar": Cost(3e-3, 1e-3, 30e3),
    "members": Cost(5e-3, 1e-3, 30e3),
    "smooth": Cost(2e-2, 4e-3, 30e3),
    "faceted": Cost(1e-3, 5e-4, 9e3),
    "simplified": Cost(1e-3, 5e-4, 9e3),
    "tessellated": Cost(2e-5, 1e-5, 1e3),
}


IN_USE = 6e-2
"""Seconds for each face of a file by members that is asked for by name: eight cuts of it, and what else is tried."""


class BudgetError(ExportError):
    """A STEP file with more faces, or of more bytes (an estimate; 0 if nobody knows), than the part may have."""

    def __init__(self, part: Part, faces: int, size: float = 0.0) -> None:
        self.part, self.way, self.faces, self.size = part, way_of(part), faces, size
        super().__init__(f"the STEP file of {part.name!r} would have {self.much}, {self.limit}; {advice(self)}")

    @property
    def by_faces(self) -> bool:
        """Whether faces are too many, or else bytes."""
        return self.faces > self.part.step_faces

    @property
    def made(self) -> str:
        """The way, and within what tolerance."""
        within = f" within {self.part.tolerance:.2g} mm" if self.way == "simplified" and self.part.tolerance else ""
        return self.way + within

    @property
    def much(self) -> str:
        """What is too much, as the end of `it would have ...`."""
        if self.by_faces:
            about = "about " if self.way == "simplified" else ""
            return f"{about}{self.faces:,} {'planar ' if self.way not in ('smooth', 'members') else ''}faces"
        return f"{self.size / 1e6:.3g} MB"

    @property
    def limit(self) -> str:
        """More than what."""
        if self.by_faces:
            return f"more than step_faces = {self.part.step_faces}"
        return f"more than step_mb = {self.part.step_mb:g} MB"

    @property
    def short(self) -> str:
        """Why this way was not taken, without the ways out."""
        return f"{self.made} it would have {self.much}, {self.limit}"

    @property
    def cost(self) -> str:
        """What this way would cost without a limit."""
        size = f"{self.size / 1e6:.3g} MB, " if self.size else ""
        seconds = writing(self.part, self.way, self.faces)
        return f"{self.made} {self.faces:,} faces ({size}about {duration(seconds)} to write and check)"


def within(part: Part, faces: int, size: float = 0.0) -> None:
    """Raise BudgetError where a file has more faces or bytes than the part may have."""
    if faces > part.step_faces or (part.step_mb and size > 1e6 * part.step_mb):
        raise BudgetError(part, faces, size)


def writing(part: Part, way: str, faces: int) -> float:
    """Seconds to write a part in some way, with so many faces, and to read it back."""
    tried = IN_USE if way == "members" and not part.hurry else 0.0
    return START + (COSTS[way].write + tried) * faces


def way_of(part: Part) -> str:
    """planar, members, smooth, faceted, simplified (faceted after it) or tessellated."""
    return "simplified" if part.step == "faceted" and part.simpler else part.step


def advice(error: BudgetError) -> str:
    """The ways out."""
    key = "step_faces" if error.by_faces else "step_mb"
    return f"write STL or 3MF instead, coarsen the mesh, simplify with step_tolerance, or raise {key}"


def none_within(refused: Sequence[BudgetError]) -> ExportError:
    """The refusal of a part whose every way is over the budget: what each would cost, and the ways out."""
    last = refused[-1]
    ways = ", ".join({one.way: one.cost for one in refused}.values())
    return ExportError(f"every STEP file of {last.part.name!r} would be {last.limit}: {ways}; {advice(last)}")


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
