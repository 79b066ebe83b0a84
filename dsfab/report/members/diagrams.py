"""Section forces along members, as PNG."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.frame import COMPONENTS
from dsfab.pipeline import Design
from dsfab.report.compliance.charts import Chart, lettering, png
from dsfab.report.compliance.words import unit_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dsfab.frame import MemberForces

UNITS = (*["N"] * 3, *["N m"] * 3)
"""Of the components: forces, then moments."""
SHOWN = tuple(enumerate(zip(COMPONENTS, UNITS, strict=True)))
"""Component, its name and its unit."""
ACROSS = 3
"""Components in a row: forces above, moments below."""
WIDE, HIGH = 6.8, 0.68
"""Inches of a row; the axis below has half a row more."""
RISING, FALLING, INK = "#b84f38", "#21508c", "#3a3532"
"""Colours of what is above and below zero, and of lines."""


def force_diagrams(design: Design, rows: list[tuple[str, str]]) -> Chart:
    """Two rows for each member, with the case or combination that it is drawn for: N, Vy, Vz, and Mt, My, Mz below.

    Grey lines are the least and the greatest of all cases; strokes at the bottom are nodes.
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    lines = len(SHOWN) // ACROSS
    with lettering(**{"font.size": 7.5}):
        layout = ConstrainedLayoutEngine(hspace=0.06, h_pad=0.02)
        figure = Figure(figsize=(WIDE, HIGH * (lines * len(rows) + 0.4)), layout=layout)
        grid = figure.subplots(lines * len(rows), ACROSS, squeeze=False)
        for number, (name, case) in enumerate(rows):
            block = grid[lines * number : lines * (number + 1)]
            forces = design.member_forces[name]
            nodes = [node.at[node.members.index(name)] for node in design.members.along[name]]
            for axes, (column, (letter, unit)) in zip(block.flat, SHOWN, strict=True):
                _drawn(axes, forces, case, (column, letter, unit))
                axes.plot(nodes, np.zeros(len(nodes)), "|", color=INK, ms=4, transform=axes.get_xaxis_transform())
            for axes in block[:-1].flat:
                axes.tick_params(labelbottom=False)
            _titled(block[0, 0], name, case)
        for axes in grid[-1]:
            axes.set_xlabel("along the member, m")
        return png(figure)


def _titled(axes: "Axes", name: str, case: str) -> None:
    """The member and its case, above the titles of the diagrams."""
    above: dict[str, Any] = {"textcoords": "offset points", "va": "bottom", "fontsize": 8.5}
    bold = axes.annotate(name, (0, 1), (0, 10), xycoords="axes fraction", fontweight="bold", **above)
    axes.annotate(case, (1, 0), (6, 0), xycoords=bold, **above)


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
