"""Limits and tolerances of several parts of dsfab."""

from collections.abc import Iterable
from typing import Literal

Status = Literal["pass", "fail", "unknown"]  # Result of a check.
Mark = Status | Literal["note"]  # Status of a check, or a note.
SEVERITY: tuple[Status, ...] = ("pass", "unknown", "fail")
MARKS: tuple[Mark, ...] = (*SEVERITY, "note")
BALANCE = 1e-4
"""Largest accepted sum of loads and reactions, divided by the sum of the loads' magnitudes."""
REPORTED_RESIDUAL = 1e-8  # Relative residual, in energy, above which dsfab reports a residual.
RESIDUAL = 1e-6
"""Largest accepted relative residual of a solution."""
LARGEST_MOVE = 0.1  # Largest displacement for linear statics, divided by the longest side of the bounding box.
AT_ONE_VERTEX = 0.95  # Largest accepted fraction of the reactions at one vertex.
FEW_VERTICES = 3  # Smallest recommended number of vertices of a loaded support.
SOME_REACTION = 0.05  # Smallest fraction of the reactions at a loaded support.
FAR_FROM_SURFACE = 0.25  # Largest distance of a point support or load from the nearest vertex / size of the surface.
LEAST_LOAD_SHARE = 1e-3  # Smallest force of snow or wind, divided by pressure times area.
MOST_TRIANGLES = 4_000_000  # Largest number of triangles of a mesh.
SAME_PHASE = 2.0**-30  # Largest difference of phases or offsets that count as equal, periods.
POSSIBLE_SIZE = (1e-9, 1e9)  # Allowed sizes of a surface, metres.
USUAL_SIZE = (0.01, 1e3)  # Usual sizes of a surface, metres.
CONVERGED = 0.02  # Largest relative error bound of a computed compliance.
FACETS = 0.2
"""Largest L^2 / (R h) of a mesh without a warning: edge length L, radius of curvature R, thickness h."""
SLIT = 0.25  # Half width of members, in periods, at which members and openings have the same width.
CROWDING = 1.25  # Largest width of members in dense stripes, divided by the median width; widths in periods.
FILM = 0.05  # Smallest thickness of a solid, divided by the sheet's thickness.
OUTLINE = 1 / 40  # Default tolerance of lines and planar outlines, divided by the thickness.
OFF_SURFACE = 1 / 20
"""Default limit for the distance of a file's solid from the design's solid, divided by the thickness."""
SIMPLIFIED_OFF_SURFACE = 2  # Factor on `OFF_SURFACE` for simplified solids.
DEFLECTION = 1 / 4  # Largest distance from a curved face to its triangles in a check, divided by `OFF_SURFACE`.
CHANGED_VOLUME = 5e-3  # Largest relative change of a volume by curves or by fewer triangles.
READ_BACK = 1e-3  # Largest relative error of volume, area, lengths and box in a file.


def worst_status(statuses: Iterable[Status]) -> Status:
    """Return the most severe status; "pass" if there is none."""
    return max(statuses, key=SEVERITY.index, default="pass")
