"""Limits and tolerances that several parts of dsfab apply.

A stage refuses input beyond a limit, and a report checks the same limit. Both import the limit from here."""

from collections.abc import Iterable
from typing import Literal

Status = Literal["pass", "fail", "unknown"]  # Result of a check; "unknown" if the results cannot decide.
Mark = Status | Literal["note"]  # Status of an entry in a list of checks, or of a note.
SEVERITY: tuple[Status, ...] = ("pass", "unknown", "fail")
MARKS: tuple[Mark, ...] = (*SEVERITY, "note")
BALANCE = 1e-4
"""Largest accepted sum of loads and reactions, divided by the sum of the loads' magnitudes.
The limit is far below the error of the elements. Rounding alone gives 1e-6 on a thin beam of 30 widths with 8 `hhj`
cells across. It gives 1.3e-5 where needle-shaped faces of 9 micrometres bend at a thickness of 20 mm, because the
entries of their stiffness are rounded."""
REPORTED_RESIDUAL = 1e-8  # dsfab reports a relative residual of the linear system, in energy, above this value.
RESIDUAL = 1e-6
"""Largest accepted relative residual, and largest relative error of a compliance that the residual may cause.
The limit is far below the error of the elements. The beam under `BALANCE` has 1e-6 in double precision. Longer numbers
give 1e-10 by refinement (`dsfab.statics.factorisation.refined_solution`), if the machine supports these. On a sheet
with needle-shaped faces of 7 micrometres, the residual cannot fall below 1e-8. Such rounding depends on the number of
threads, so it must not decide whether dsfab accepts a result."""
LARGEST_MOVE = 0.1  # Largest displacement for linear statics, divided by the longest side of the bounding box.
AT_ONE_VERTEX = 0.95  # Largest accepted fraction of the reactions at one vertex.
FEW_VERTICES = 3  # A support that carries more than `SOME_REACTION` should have at least this number of vertices.
SOME_REACTION = 0.05  # A support with a smaller fraction of the reactions counts as unloaded: it only prevents drift.
FAR_FROM_SURFACE = 0.25  # Largest distance of a point support or load from its vertex, divided by the surface's size.
LEAST_LOAD_SHARE = 1e-3  # Snow or wind counts as a load if its force exceeds this fraction of pressure times area.
MOST_FACES = 4_000_000  # Largest number of triangles of a mesh: twice the largest mesh tried with all stages.
SAME_PHASE = 2.0**-30  # Phases, and offsets from middle lines, are equal if they differ by fewer periods than this.
POSSIBLE_SIZE = (1e-9, 1e9)  # Allowed sizes of a surface, metres; products of other numbers overflow.
USUAL_SIZE = (0.01, 1e3)  # Usual sizes of a surface, metres; for other sizes dsfab asks to check the unit.
CONVERGED = 0.02  # A compliance counts as computed if its relative error bound is below this value.
FACETS = 0.2
"""dsfab warns if L^2 / (R h) of a mesh is larger: edge length L, radius of curvature R, thickness h. At 0.2, flat
facets change the compliance of a curved sheet by 1 %, and its largest stress under pressure or weight by up to 20 %."""
SLIT = 0.25  # Half width, in periods, at which members are as wide as openings; narrower openings are slits.
CROWDING = 1.25  # Largest width of crowded members, divided by the median width; both in periods.
FILM = 0.05  # A part of the sheet counts as a film if it is thinner than this fraction of the thickness.
OUTLINE = 1 / 40  # Default tolerance of lines and planar outlines, divided by the thickness.
OFF_SURFACE = 1 / 20
"""Default limit for the distance between the solid in a file and the solid of the design, divided by the thickness.
Smoothed and simplified solids keep this limit, and the check of a file with curves applies it."""
SIMPLIFIED_OFF_SURFACE = 2  # Factor on `OFF_SURFACE` for planar solids that would have too many faces for a file.
DEFLECTION = 1 / 4  # Largest distance of a file's curved faces from the triangles of its check, in `OFF_SURFACE`.
CHANGED_VOLUME = 5e-3  # Largest relative change of a volume when curves or fewer triangles replace its triangles.
READ_BACK = 1e-3  # Largest relative change of volume, area, lengths and box of a file that is written and read again.


def worst_status(statuses: Iterable[Status]) -> Status:
    """Return the most severe status; "pass" if there is none."""
    return max(statuses, key=SEVERITY.index, default="pass")
