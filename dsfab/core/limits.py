"""What is accepted: each limit that more than one part of dsfab applies, once; and what is said of keeping one.

A stage that refuses beyond a limit and a report that says whether it was kept take it from here.
"""

from collections.abc import Iterable
from typing import Literal

Status = Literal["pass", "fail", "unknown"]
"""Whether a limit is kept; unknown: nobody has found out well enough."""

Mark = Status | Literal["note"]
"""The same on a list of checks; a note does not count."""

SEVERITY: tuple[Status, ...] = ("pass", "unknown", "fail")

MARKS: tuple[Mark, ...] = (*SEVERITY, "note")

BALANCE = 1e-4
"""Largest accepted sum of loads and reactions, relative to the sum of the loads' magnitudes, far below what elements
are off by. Rounding alone makes 1e-6 of it where a sheet is long, thin and finely meshed (a beam of 30 widths with 8
`hhj` cells across), and 1.3e-5 where needles of 9 micrometres bend that are 20 mm thick, however well the equations are
solved: the entries of their stiffness are rounded."""

PRECISE = 1e-8
"""Relative residual of the linear system, in the norm of its energy, that is told when it is exceeded."""

RESIDUAL = 1e-6
"""Largest accepted residual, and by how much of itself a compliance may be off for it: far below what elements are off
by. The same beam has 1e-6 after a solution in double precision and 1e-10 once refined with longer numbers (see
`dsfab.statics.factorisation.refined_solution`), where the machine has them. On a sheet with needles of 7 micrometres
these
come to 1e-8 and no further, by rounding that the number of threads decides: that must not decide what is accepted."""

LARGEST_MOVE = 0.1
"""Largest accepted displacement, as a share of the longest side of the surface's box: linear statics say nothing of
what moves further, and mostly a unit is wrong."""

AT_ONE_VERTEX = 0.95
"""Largest accepted share of the reactions at one vertex."""

FEW_VERTICES = 3
"""A support that holds fewer vertices is told, if it carries more than `SOME_REACTION`."""

SOME_REACTION = 0.05
"""A support that carries a smaller share of the reactions only keeps the sheet from drifting."""

FAR_FROM_SURFACE = 0.25
"""Largest accepted distance from a point to the vertex that stands for it, as a share of the surface's size."""

GLANCING = 1e-3
"""Snow or wind of which a smaller share arrives at its faces, in the mean, acts on nothing: a twentieth of a degree."""

POSSIBLE_SIZE = (1e-9, 1e9)
"""Metres; a surface that is smaller or larger is refused: its numbers are no lengths, and products of them overflow."""

USUAL_SIZE = (0.01, 1e3)
"""Metres; a surface that is smaller or larger is told: its unit may be another one."""

CONVERGED = 0.02
"""A compliance counts as known within this bound, relative."""

FACETS = 0.2
"""Larger L^2 / (R h) of a mesh (edge length, radius of curvature, thickness) is told: flat facets of a curved sheet are
off by 1 % in compliance there, and under pressure or weight by up to this share in the largest stress."""

SLIT = 0.25
"""Half-width, in periods, at which the opening between two members is as wide as they are: a narrower one is a slit."""

CROWDING = 1.25
"""Where members leave no wider openings anyway, they may take so many times the usual share of their spacing."""

FILM = 0.05
"""A sheet that has less than this share of its thickness somewhere is a film there."""

OUTLINE = 1 / 40
"""Tolerance of lines and planar outlines unless asked otherwise, as a share of the thickness."""

OFF_SURFACE = 1 / 20
"""Largest distance of a file's solid from the design's unless asked otherwise, as a share of the thickness: what smooth
and simplified solids are made within, and what the check of a file that may have curves accepts."""

FURTHER = 2
"""Times `OFF_SURFACE` that a solid of planar faces may be simplified by, where nothing else keeps to the budget."""

DEFLECTION = 1 / 4
"""How far the triangles that a reader makes of curved faces may be off them, as a share of what a file may be off the
design: a build and the check of its file measure with the same."""

CHANGED_VOLUME = 5e-3
"""Largest accepted change of a volume, relative, where curves or fewer triangles take the place of triangles."""

READ_BACK = 1e-3
"""Largest accepted change of a volume, an area, a length or, as a share of the size, of the bounding box by writing a
file and reading it back."""


def worst(found: Iterable[Status]) -> Status:
    """The one that counts of several; pass of none."""
    return max(found, key=SEVERITY.index, default="pass")
