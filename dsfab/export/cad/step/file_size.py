"""Size of a STEP file: limit, cost, and simplified meshes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError, NotMadeError, SolidError
from dsfab.core.limits import CHANGED_VOLUME, OFF_SURFACE
from dsfab.core.messages import duration
from dsfab.export.cad.step.entities import faceted_bytes
from dsfab.export.cad.step.planar import polyhedron
from dsfab.export.part import Part, open_edges
from dsfab.surface import nearest_places
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import coarsen_mesh

LOADING_SECONDS = 1.5  # shortest time (seconds) to read a STEP file back, because a new process loads OCCT


@dataclass(frozen=True)
class StrategyCost:
    """Cost of each face: `write` seconds to write and read back, `open` seconds to open, and `memory` in bytes."""

    write: float
    open: float
    memory: float


COSTS = {
    "planar": StrategyCost(3e-3, 1e-3, 30e3),
    "members": StrategyCost(5e-3, 1e-3, 30e3),
    "smooth": StrategyCost(2e-2, 4e-3, 30e3),
    "faceted": StrategyCost(1e-3, 5e-4, 9e3),
    "simplified": StrategyCost(1e-3, 5e-4, 9e3),
    "tessellated": StrategyCost(2e-5, 1e-5, 1e3),
}


class BudgetError(NotMadeError):
    """Error for a STEP file beyond the limits `step_faces` or `step_mb`. size : bytes of the file, 0 if unknown."""

    def __init__(self, part: Part, faces: int, size: float = 0.0) -> None:
        self.part, self.way, self.faces, self.size = part, strategy_of(part), faces, size
        super().__init__(f"the STEP file of {part.name!r} would have {self.excess}, {self.limit}; {advice(self)}")

    @property
    def by_faces(self) -> bool:
        """True if the file has too many faces, False if it has too many bytes."""
        return self.faces > self.part.step_faces

    @property
    def strategy(self) -> str:
        """Name of the strategy, followed by the tolerance if the mesh was simplified."""
        is_within = self.way == "simplified" and self.part.tolerance
        return f"{self.way} within {self.part.tolerance:.2g} mm" if is_within else self.way

    @property
    def excess(self) -> str:
        """Text with the number of faces, or the size in MB, that is over the limit."""
        if self.by_faces:
            about = "about " if self.way == "simplified" else ""
            return f"{about}{self.faces:,} {'planar ' if self.way not in ('smooth', 'members') else ''}faces"
        return f"{self.size / 1e6:.3g} MB"

    @property
    def limit(self) -> str:
        """Phrase "more than ..." with the limit that the file exceeds."""
        if self.by_faces:
            return f"more than step_faces = {self.part.step_faces}"
        return f"more than step_mb = {self.part.step_mb:g} MB"

    @property
    def reason(self) -> str:
        """Reason why the file was refused, without advice to the user."""
        return f"a file written as {self.strategy} would have {self.excess}, {self.limit}"

    @property
    def cost(self) -> str:
        """Text with the strategy, number of faces, size, and time to write and check the file."""
        size = f"{self.size / 1e6:.3g} MB, " if self.size else ""
        seconds = writing_seconds(self.part, self.way, self.faces)
        return f"{self.strategy} {self.faces:,} faces ({size}about {duration(seconds)} to write and check)"


def require_budget(part: Part, faces: int, size: float = 0.0) -> None:
    """Raise BudgetError if a file has more faces or bytes than `step_faces` or `step_mb` allows."""
    if faces > part.step_faces or (part.step_mb and size > 1e6 * part.step_mb):
        raise BudgetError(part, faces, size)


def writing_seconds(part: Part, strategy: str, faces: int) -> float:
    """Return the seconds to write a part and to read the file back."""
    in_use = 6e-2  # seconds per face for trial cuts, which are made on request only
    tried = in_use if strategy == "members" and not part.hurry else 0.0
    return LOADING_SECONDS + (COSTS[strategy].write + tried) * faces


def strategy_of(part: Part) -> str:
    """Return a part's strategy: planar, members, smooth, faceted, simplified, or tessellated."""
    return "simplified" if part.step == "faceted" and part.simpler else part.step


def advice(error: BudgetError) -> str:
    """Return advice for the user if a file is too large."""
    key = "step_faces" if error.by_faces else "step_mb"
    return f"write STL or 3MF instead, coarsen the mesh, simplify with step_tolerance, or raise {key}"


def no_strategy_error(refused: Sequence[BudgetError]) -> ExportError:
    """Return the error for a part that exceeds the limits of file size with every strategy."""
    final = refused[-1]
    ways = ", ".join({error.way: error.cost for error in refused}.values())
    return NotMadeError(f"every STEP file of {final.part.name!r} would be {final.limit}: {ways}; {advice(final)}")


TRIES = 6


def usual_tolerance(part: Part) -> float:
    """Return the default tolerance (mm) for simplifying a part."""
    return OFF_SURFACE * 2 * part.volume / part.area


def simplified_part(part: Part, tolerance: float) -> Part:
    """Return the solid with fewer triangles, at most `tolerance` (mm) from the old surface.
    Raises ExportError if this is impossible, BudgetError if far more planar faces remain than `step_faces`."""
    worth = 0.9  # largest fraction of the triangles that may remain after simplification
    stride = 1.6  # each try has 1.6 times the tolerance (in manifold3d) of the try before
    crossing, step = len(intersecting_pairs(part.V, part.F)), tolerance
    result: Part | None = None
    for _ in range(TRIES):
        simple, moved = simplification(part, step)
        if len(simple.F) and moved <= tolerance and _sound(part, simple, crossing):
            result, step = simple, stride * step
        elif result is not None:
            break
        else:
            _require_hope(simple)
            step *= min(0.9 * tolerance / moved if moved > 0 else 1.0, 1 / stride)
    if result is None or len(result.F) > worth * len(part.F):
        raise ExportError(
            f"{part.name!r} does not become simpler within {tolerance:.3g} mm; allow a larger step_tolerance, or "
            f"coarsen the mesh"
        )
    return result


def _require_hope(simple: Part) -> None:
    hopeless = 1.2  # the search ends if a try has more than 1.2 times the allowed faces
    if 0 < hopeless * simple.step_faces < len(simple.F):
        shape = polyhedron(simple.V, simple.F, np.zeros(len(simple.F), dtype=np.int64))
        if len(shape.normals) > hopeless * simple.step_faces:
            require_budget(simple, len(shape.normals), faceted_bytes(shape))


def simplification(part: Part, step: float) -> tuple[Part, float]:
    """Coarsen a part's mesh within `step` (mm). Return the new part, and its largest distance (mm) from the old part.
    If coarsening fails, the new part has no triangles, and the distance is infinite."""
    try:
        V, F = coarsen_mesh(part.V, part.F, step)
    except SolidError:
        return replace(part, F=part.F[:0]), np.inf
    simple, moved = replace(part, V=V, F=F, simpler=True), distance(part.V, part.F, V, F)
    note = f"simplified from {len(part.F):,} to {len(F):,} triangles, {moved:.2g} mm off at most"
    return replace(simple, note=f"{note}, volume {simple.volume / part.volume - 1:+.2%}"), moved


def _sound(part: Part, simple: Part, crossing: int) -> bool:
    unchanged = abs(simple.volume / part.volume - 1) <= CHANGED_VOLUME and not open_edges(simple.F)
    return unchanged and len(intersecting_pairs(simple.V, simple.F)) <= crossing


def distance(V: Floats, F: Ints, V2: Floats, F2: Ints) -> float:
    """Return the largest distance between the meshes V, F and V2, F2, in either direction."""
    forth, back = nearest_places(_samples(V, F), V2, F2).squared, nearest_places(_samples(V2, F2), V, F).squared
    return float(np.sqrt(max(forth.max(), back.max())))


def _samples(V: Floats, F: Ints) -> Floats:
    corners = V[F]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    return np.concatenate([V[np.unique(F)], middles.reshape(-1, 3), corners.mean(axis=1)])
