"""Limits and tolerances of several parts of dsfab."""

from collections.abc import Iterable
from typing import Literal

Status = Literal["pass", "fail", "unknown"]  # Result of a check; "unknown" if the results cannot decide.
Mark = Status | Literal["note"]  # Status of an entry in a list of checks and notes.
SEVERITY: tuple[Status, ...] = ("pass", "unknown", "fail")
MARKS: tuple[Mark, ...] = (*SEVERITY, "note")
BALANCE = 1e-4
"""Largest accepted sum of loads and reactions, divided by the sum of load magnitudes; rounding errors reach 1.3e-5."""
REPORTED_RESIDUAL = 1e-8  # dsfab reports relative residuals (in energy) above this value.
RESIDUAL = 1e-6
"""Largest accepted relative residual of a solution, and largest relative error of compliance due to a residual.
Rounding errors reach 1e-8 on very thin triangles."""
LARGEST_MOVE = 0.1  # Largest displacement for linear statics, divided by the longest side of the bounding box.
AT_ONE_VERTEX = 0.95  # Largest accepted fraction of the reactions at one vertex.
FEW_VERTICES = 3  # Smallest recommended number of vertices of a loaded support.
SOME_REACTION = 0.05  # A support is loaded if it takes more than this fraction of the reactions.
FAR_FROM_SURFACE = 0.25  # Largest distance of a point support or load from the nearest vertex / size of the surface.
LEAST_LOAD_SHARE = 1e-3  # Smallest force of snow or wind that counts, divided by pressure times area.
MOST_TRIANGLES = 4_000_000  # Largest number of triangles of a mesh.
SAME_PHASE = 2.0**-30  # Phases or offsets count as equal if they differ by at most this value, periods.
POSSIBLE_SIZE = (1e-9, 1e9)  # Allowed sizes of a surface, metres; with other sizes, products of numbers overflow.
USUAL_SIZE = (0.01, 1e3)  # Usual sizes of a surface, metres. For unusual sizes, dsfab asks about the unit.
CONVERGED = 0.02  # Largest relative error bound of a computed compliance.
FACETS = 0.2
"""Largest L^2 / (R h) of a mesh without a warning: edge length L, radius of curvature R, thickness h.
At 0.2, flat facets change the compliance of a curved sheet by 1 %, and its largest stress by up to 20 %."""
SLIT = 0.25  # Half width of members, in periods, at which members and openings have the same width.
CROWDING = 1.25  # Largest half width / median half width (in periods) of members where stripes are dense.
FILM = 0.05  # Smallest thickness of a solid, divided by the sheet's thickness; a thinner place is a film.
OUTLINE = 1 / 40  # Default tolerance of lines and planar outlines, divided by the thickness.
OFF_SURFACE = 1 / 20
"""Default limit for the distance between the solid in a file and the solid of the design, divided by the thickness.
The limit applies to smoothed solids, to simplified solids, and to files with curves."""
SIMPLIFIED_OFF_SURFACE = 2  # Factor on `OFF_SURFACE` for solids that are simplified to have fewer planar faces.
DEFLECTION = 1 / 4  # Largest distance from a curved face to its triangles in a check, divided by `OFF_SURFACE`.
CHANGED_VOLUME = 5e-3  # Largest relative change of a volume by fitted curves or by fewer triangles.
READ_BACK = 1e-3  # Largest relative error of volume, area, lengths and box in a file.


def worst_status(statuses: Iterable[Status]) -> Status:
    """Return the most severe status; "pass" if there is none."""
    return max(statuses, key=SEVERITY.index, default="pass")
