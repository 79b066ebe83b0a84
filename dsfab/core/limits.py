"""Limits and tolerances that more than one part of dsfab applies.

A stage that refuses input beyond a limit and a report that checks the same limit both import it from here."""

from collections.abc import Iterable
from typing import Literal

Status = Literal["pass", "fail", "unknown"]  # Result of a check; "unknown" if the results cannot decide.
Mark = Status | Literal["note"]  # Status of an entry in a list of checks; a note is no check.
SEVERITY: tuple[Status, ...] = ("pass", "unknown", "fail")
MARKS: tuple[Mark, ...] = (*SEVERITY, "note")
BALANCE = 1e-4
"""Largest accepted sum of loads and reactions, relative to the sum of the loads' magnitudes.

The limit is far below the error of the elements. Rounding alone reaches 1e-6 on a long, thin, finely meshed sheet (a
beam of 30 widths with 8 `hhj` cells across). Rounding reaches 1.3e-5 where needle-shaped faces of 9 micrometres bend at
a thickness of 20 mm, because the entries of their stiffness are rounded."""

REPORTED_RESIDUAL = 1e-8  # Relative residual of the linear system, in energy, above which dsfab reports it.
RESIDUAL = 1e-6
"""Largest accepted relative residual, and largest relative error of a compliance that the residual may cause.

The limit is far below the error of the elements. The beam under `BALANCE` has 1e-6 in double precision. Refinement in
longer numbers gives 1e-10 (`dsfab.statics.factorisation.refined_solution`), if the machine supports these. On a sheet
with needle-shaped faces of 7 micrometres the residual stops at 1e-8. Such rounding depends on the number of threads,
so it must not decide whether dsfab accepts a result."""

LARGEST_MOVE = 0.1  # Largest displacement for linear statics, divided by the longest side of the surface's box.
AT_ONE_VERTEX = 0.95  # Largest accepted share of the reactions at one vertex.
FEW_VERTICES = 3  # A support that carries more than `SOME_REACTION` should have at least this number of vertices.
SOME_REACTION = 0.05  # Share of the reactions up to which a support counts as unloaded: it only prevents drift.
FAR_FROM_SURFACE = 0.25  # Largest distance of a point support or load from its vertex, divided by the surface's size.
LEAST_LOAD_SHARE = 1e-3  # Snow or wind on faces counts as a load from this share of pressure times area.
MOST_FACES = 4_000_000  # Largest number of triangles of a mesh: twice the largest mesh tried with all stages.
SAME_PHASE = 2.0**-30  # Phases, and offsets from middle lines, are equal if they differ by fewer periods than this.
POSSIBLE_SIZE = (1e-9, 1e9)  # Allowed sizes of a surface, metres; products of other numbers overflow.
USUAL_SIZE = (0.01, 1e3)  # Usual sizes of a surface, metres; for other sizes dsfab asks to check the unit.
CONVERGED = 0.02  # A compliance counts as computed if its relative error bound is below this value.
FACETS = 0.2
"""dsfab warns above this value of L^2 / (R h) of a mesh: edge length L, radius of curvature R, thickness h. At this
value flat facets of a curved sheet change its compliance by 1 %, and its largest stress under pressure or weight by up
to 20 %."""

SLIT = 0.25  # Half-width, in periods, at which members are as wide as openings; narrower openings are slits.
CROWDING = 1.25  # Largest width of crowded members divided by the median width, both in periods.
FILM = 0.05  # A part of the sheet thinner than this share of the thickness counts as a film.
OUTLINE = 1 / 40  # Default tolerance of lines and planar outlines, as a share of the thickness.
OFF_SURFACE = 1 / 20
"""Default limit for the distance between a file's solid and the design's solid, as a share of the thickness. Smooth and
simplified solids respect this limit, and so does the check of a file with curves."""

SIMPLIFIED_OFF_SURFACE = 2  # Factor on `OFF_SURFACE` for planar solids that otherwise have too many faces for a file.
DEFLECTION = 1 / 4  # Largest distance of check triangles from a file's curved faces, divided by `OFF_SURFACE`.
CHANGED_VOLUME = 5e-3  # Largest relative change of a volume when curves or fewer triangles replace its triangles.
READ_BACK = 1e-3  # Largest relative change of volume, area, lengths and box when a file is written and read again.


def worst_status(statuses: Iterable[Status]) -> Status:
    """Return the most severe status; "pass" for an empty iterable."""
    return max(statuses, key=SEVERITY.index, default="pass")
