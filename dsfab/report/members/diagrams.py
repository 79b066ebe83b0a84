"""N, Vz and My along members, as PNG."""

from typing import TYPE_CHECKING

import numpy as np

from dsfab.pipeline import Design
from dsfab.report.compliance.charts import Chart, lettering, png
from dsfab.report.compliance.words import unit_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dsfab.frame import MemberForces

SHOWN = ((0, "N", "N"), (2, "Vz", "N"), (4, "My", "N m"))
"""Component, its name and its unit."""
WIDE, HIGH = 6.8, 1.05
"""Inches of a row; the head has half a row more."""
RISING, FALLING, INK = "#b84f38", "#21508c", "#3a3532"
"""Colours of what is above and below zero, and of lines."""


def force_diagrams(design: Design, rows: list[tuple[str, str]]) -> Chart:
    """A row for each member, with the case or combination that it is drawn for, and a column for N, Vz and My.

    Grey lines are the least and the greatest of all cases; strokes at the bottom are nodes.
    """
    from matplotlib.figure import Figure

    with lettering(**{"font.size": 7.5}):
        figure = Figure(figsize=(WIDE, HIGH * (len(rows) + 0.4)), layout="constrained")
        grid = figure.subplots(len(rows), len(SHOWN), squeeze=False)
        for line, (name, case) in zip(grid, rows, strict=True):
            forces = design.member_forces[name]
            for axes, (column, letter, unit) in zip(line, SHOWN, strict=True):
                _drawn(axes, forces, case, (column, letter, unit))
                nodes = [node.at[node.members.index(name)] for node in design.members.along[name]]
                axes.plot(nodes, np.zeros(len(nodes)), "|", color=INK, ms=4, transform=axes.get_xaxis_transform())
            line[0].annotate(name, (0, 1.08), xycoords="axes fraction", fontsize=8.5, fontweight="bold", va="bottom")
        for axes in grid[-1]:
            axes.set_xlabel("along the member, m")
        return png(figure)


def _drawn(axes: "Axes", forces: "MemberForces", case: str, shown: tuple[int, str, str]) -> None:
    """One component along one member."""
    column, letter, unit = shown
    value, least, most = forces.forces[case][:, column], *np.moveaxis(forces.envelope[:, column], -1, 0)
    factor, name = unit_for(max(float(np.abs([least, most]).max()), 1e-9), unit)
    order = np.argsort(forces.s, kind="stable")
    s, value, least, most = forces.s[order], value[order] / factor, least[order] / factor, most[order] / factor
    for above, colour in ((True, RISING), (False, FALLING)):
        axes.fill_between(s, 0, value, where=(value >= 0) == above, color=colour, alpha=0.3, lw=0, interpolate=True)
    axes.plot(s, value, color=INK, lw=0.9)
    if len(forces.forces) > 1:
        for edge in (least, most):
            axes.plot(s, edge, color="#9a948d", lw=0.6)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set_title(f"{letter}, {name}", fontsize=7.5, loc="right", pad=2)
    axes.margins(x=0.01)
    axes.locator_params(axis="y", nbins=4)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.tick_params(length=2, pad=2)
