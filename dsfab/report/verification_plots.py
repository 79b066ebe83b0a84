"""Plots and drawings of the verification page, as SVG that takes its ink from the page and is the same every time."""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.arrays import Floats
from dsfab.study.verification import Problem, Standing, Test, VerificationRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#c0653c", "#3d7fc4", "#2c9a62", "#9a6fc0", "#b0892a", "#c0507f")
"""Of the pairs, in their order; readable on white and on black."""

PUBLISHED, SUPPORT, LOAD = "#8d8d8d", "#2c9a62", "#c0653c"
MARKS = "xd+^v*sp<>hDPX"

INK, FAINT = "#010203", "#040506"
"""Written by matplotlib, and replaced by what the page says: `currentColor` and its `--faint`."""

LEAST = 1e-5
"""Relative errors below this are drawn as this."""

ARROWS = 8
"""At most so many loads are drawn."""


def curves(test: Test, rows: Sequence[VerificationRow], against: Sequence[Standing]) -> str:
    """Error in percent over the number of unknowns: a line for each pair and pattern, marks for published values."""
    with _figure(6.6, 3.1) as (figure, axes):
        for colour, name in zip(COLOURS, dict.fromkeys(row.elements for row in rows), strict=False):
            for k, mesh in enumerate(test.meshes):
                drawn = [row for row in rows if (row.elements, row.mesh) == (name, mesh) and row.ratio is not None]
                axes.loglog(
                    [row.unknowns for row in drawn],
                    [_percent((row.ratio or 0) - 1) for row in drawn],
                    color=colour,
                    linestyle=("-", "--", ":")[k],
                    marker="o",
                    markersize=3.5,
                    linewidth=1.6,
                    label=(name if k == 0 else None) if drawn else None,
                )
        found = [standing for standing in against if standing.unknowns is not None]
        names = list(dict.fromkeys(standing.published.element for standing in found))
        for mark, name in zip(MARKS, names, strict=False):
            same = [standing for standing in found if standing.published.element == name]
            axes.plot(
                [standing.unknowns or 0 for standing in same],
                [_percent(standing.published.ratio - 1) for standing in same],
                color=PUBLISHED,
                linestyle="",
                marker=mark,
                markersize=5.5,
                label=name,
            )
        axes.axhline(100 * test.tolerance, color=FAINT, linewidth=1)
        axes.set_xlabel("unknowns")
        axes.set_ylabel("error, %")
        axes.grid(True, which="major", color=FAINT, linewidth=0.5, alpha=0.6)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.minorticks_off()
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False, fontsize=8, labelcolor=INK)
        return _svg(figure, f"{test.name}: error over unknowns")


def drawing(problem: Problem, title: str) -> str:
    """The mesh seen from above or from its side, with what is held (dots) and some of its loads (arrows)."""
    V = problem.surface.V
    view = np.eye(2, 3) if problem.flat == 2 else _isometric()
    shown = V @ view.T
    ends = problem.surface.edges.ends
    rim = problem.surface.edges.boundary
    holds = problem.fixed.sum(axis=1)
    dots = shown[holds > holds.min()]
    with _figure(2.9, 2.3) as (figure, axes):
        for which, width, colour in ((~rim, 0.5, FAINT), (rim, 1.1, INK)):
            lines = np.full((which.sum(), 3, 2), np.nan)
            lines[:, :2] = shown[ends[which]]
            axes.plot(*lines.reshape(-1, 2).T, color=colour, linewidth=width)
        axes.plot(*dots.T, color=SUPPORT, linestyle="", marker="o", markersize=3)
        _arrows(axes, problem, view)
        axes.set_aspect("equal")
        axes.axis("off")
        axes.margins(0.12)
        return _svg(figure, title)


def _arrows(axes: "Axes", problem: Problem, view: Floats) -> None:
    force = problem.load.force
    shown, seen = problem.surface.V @ view.T, force @ view.T
    size = np.linalg.norm(force, axis=1)
    if not size.any():  # it vibrates by itself
        return
    loaded = np.flatnonzero(size > 0.2 * size.max())
    loaded = loaded[np.unique(np.linspace(0, len(loaded) - 1, ARROWS).round().astype(int))]
    reach = 0.2 * np.ptp(shown, axis=0).max() / size.max()
    for vertex in loaded:
        tip, tail = shown[vertex], shown[vertex] - reach * seen[vertex]
        style = {"arrowstyle": "-|>", "color": LOAD, "linewidth": 1.1, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=style)
        axes.update_datalim([tail])


def _isometric() -> Floats:
    """(2, 3) projection: x to the lower right, y to the upper right, z upwards."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    return np.array([[c, c, 0.0], [-s, s, 1.0]])


def _percent(error: float) -> float:
    return 100 * max(abs(error), LEAST)


@contextmanager
def _figure(width: float, height: float) -> Iterator[tuple["Figure", "Axes"]]:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    settings: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": "dsfab",
        "font.size": 9,
        "text.color": INK,
        "axes.edgecolor": FAINT,
        "axes.labelcolor": INK,
        "xtick.color": INK,
        "ytick.color": INK,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "path.simplify": False,
    }
    with mpl.rc_context(settings):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.add_subplot()


def _svg(figure: "Figure", title: str) -> str:
    """The figure without the parts of a file of its own: it stands within a page."""
    text = io.StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r' id="[a-zA-Z]+[a-z0-9]*_\d+"', "", svg)  # matplotlib numbers its groups; nothing refers to them
    svg = re.sub(r"font: ([\d.]+)px[^;\"]*", r"font-size: \1px", svg)
    svg = re.sub(r"(?<![>\d.])(\d+\.\d\d)\d+", r"\1", svg)  # coordinates, not the numbers of the axes
    svg = svg.replace(INK, "currentColor").replace(FAINT, "var(--faint)")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1).strip()
