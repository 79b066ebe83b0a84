"""Drawings of docs/concepts.md: a plate, held on the left and pulled down on the right, solved by dsfab.

`concept(name)` draws one of `CONCEPTS`; `python -m docs._build.make` writes them all.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

import dsfab
from dsfab.design import Design
from dsfab.study.verdict import check

RED, BLUE, INK, PALE, MATERIAL = "#b5453a", "#3a6ea5", "#333333", "#e9e6e0", "#c9a36b"
WIDE = 11.2
"""Width of a figure in inches, at 100 dots per inch."""


@cache
def plate(fine: bool = False) -> Design:
    return dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.03 if fine else 0.05}))


def panels(*titles: str, tall: float = 3.2, widths: tuple[float, ...] | None = None) -> tuple[Figure, list[Axes]]:
    """Return a figure of a height in inches, with a panel without axes for each title."""
    figure = Figure((WIDE, tall), dpi=100, layout="constrained", facecolor="white")
    places = list(figure.subplots(1, len(titles), width_ratios=widths, squeeze=False)[0])
    for place, title in zip(places, titles, strict=True):
        place.set_title(title, fontsize=12, color=INK)
        place.set_axis_off()
    return figure, places


def sheet(place: Axes, V: Any, F: Any, colour: Any, **more: Any) -> None:
    """Draw triangles in the plane, each in its colour."""
    place.add_collection(PolyCollection(V[F][:, :, :2], facecolors=colour, edgecolors=colour, linewidths=0.3, **more))
    place.set_aspect("equal")
    place.autoscale()
    place.margins(0.02)


def arrow(place: Axes, start: Any, end: Any, colour: str) -> None:
    place.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2, "mutation_scale": 16})


def square(place: Axes, degrees: float) -> Any:
    """Draw a turned square of the sheet and return its rotation matrix, (2, 2)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.array([[c, -s], [s, c]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ turn.T
    place.fill(*corners.T, facecolor=PALE, edgecolor=INK)
    place.set(xlim=(-3.1, 3.1), ylim=(-3.1, 3.1), aspect="equal")
    return turn


def stress_directions() -> Figure:
    """Draw a square with shear, the same square turned until it has none, and stress crosses on the plate."""
    titles = ("Sides that slide", "Turned: no side slides", "Everywhere on a plate")
    figure, (sliding, turned, whole) = panels(*titles, widths=(1, 1, 1.9))
    square(sliding, 0)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        side, along = np.array([x, y]) * 1.35, np.array([abs(y), abs(x)]) * (x + y)
        arrow(sliding, side - along, side + along, INK)
    turn = square(turned, 45)
    for way in (1.0, -1.0):
        arrow(turned, turn @ (1.2 * way, 0), turn @ (2.8 * way, 0), RED)
        arrow(turned, turn @ (0, 2.8 * way), turn @ (0, 1.2 * way), BLUE)
    turned.text(0, -2.95, "red is pulled, blue is pressed", ha="center", color=INK)
    design = plate()
    sheet(whole, design.surface.V, design.surface.F, PALE)
    value, way = np.linalg.eigh(design.statics.sigma[:, :2, :2])
    middle = design.surface.centroids[:, :2]
    at = _apart(middle, 0.085)
    for k in (0, 1):
        half = 0.032 * way[at, :, k]
        ends = np.stack([middle[at] - half, middle[at] + half], axis=1)
        whole.add_collection(LineCollection(ends, colors=np.where(value[at, k] > 0, RED, BLUE), linewidths=1.6))
    return figure


def _apart(points: Any, distance: float) -> list[int]:
    """Return indices of points that are at least a distance apart."""
    kept: list[int] = []
    for i, point in enumerate(points):
        if not kept or np.min(np.linalg.norm(points[kept] - point, axis=1)) >= distance:
            kept.append(i)
    return kept


def mode() -> Figure:
    """Draw the first three modes of the major family."""
    figure, places = panels("mode 1", "mode 2", "mode 3", tall=2.2)
    design = plate()
    V, F = design.surface.V, design.surface.F
    for number, place in enumerate(places, start=1):
        height = design.diffusion.major.mode(number)
        most = np.abs(height).max()
        place.tricontourf(V[:, 0], V[:, 1], F, height, levels=np.linspace(-most, most, 13), cmap="BrBG")
        place.tricontour(V[:, 0], V[:, 1], F, height, levels=[0], colors=INK, linewidths=1.2)
        place.set_aspect("equal")
    return figure


def stripes() -> Figure:
    """Draw a wave, its cut at a height, and the material of both families."""
    figure, (wave, kept) = panels("A wave over the surface, cut at a height", "Both families, and what they keep")
    x = np.linspace(0, 4, 801)
    y, height = np.cos(2 * np.pi * x), 0.3
    wave.plot(x, y, color=INK)
    wave.plot(x, 0 * x + height, color=RED, ls="--")
    wave.fill_between(x, height, y, where=y > height, color=MATERIAL)
    wave.fill_between(x, -1.75, -1.45, where=y > height, color=MATERIAL)
    wave.plot(x, 0 * x - 1.75, color=INK, lw=0.8)
    wave.text(4.05, height, "height", color=RED, va="center")
    wave.text(4.05, -1.6, "members", color=INK, va="center")
    wave.annotate("", (1, 1.25), (2, 1.25), arrowprops={"arrowstyle": "<->", "color": INK})
    wave.text(1.5, 1.32, "spacing", ha="center", color=INK)
    wave.set(xlim=(0, 4.7), ylim=(-1.9, 1.6))
    _structure(kept, plate(fine=True))
    return figure


def _structure(place: Axes, design: Design) -> None:
    """Draw the material in the colours of its families."""
    names = np.array(design.pattern.names)[design.sheet.family]
    colour = np.where(names == "major", RED, np.where(names == "minor", BLUE, "#8a8a8a"))
    sheet(place, design.sheet.surface.V, design.sheet.surface.F, colour)


def phase() -> Figure:
    """Draw a family with three phases."""
    values = (0.0, 0.25, 0.5)
    figure, places = panels(*(f"phase {value:g}" for value in values), tall=2.2)
    for value, place in zip(values, places, strict=True):
        changes = {"surface.edge": 0.03, "pattern.families": "major", "pattern.major.phase": value}
        design = dsfab.run(dsfab.load_preset("cantilever", {**changes, "pattern.width": {"rule": "plain"}}))
        sheet(place, design.surface.V, design.surface.F, PALE)
        _structure(place, design)
    return figure


def compliance() -> Figure:
    """Draw load over displacement for stripes that follow the stress and for stripes that ignore it."""
    found = dsfab.compare(plate(), against=("isotropic",), level="quick")
    rival = next(one for one in found.competitors if one.name == "isotropic")
    force = 1000.0
    titles = ("stripes along the stress", "as much material, stripes that ignore it")
    rows = zip(titles, (found.design.compliance, rival.compliance), (MATERIAL, PALE), strict=True)
    figure, places = panels(*titles)
    widest = max(found.design.compliance, rival.compliance) / force
    for place, (_, joules, colour) in zip(places, rows, strict=True):
        move = joules / force * 1e6
        place.set_axis_on()
        place.fill([0, move, move, 0], [0, 0, force, force], facecolor=colour, edgecolor=INK)
        place.text(move / 2, force / 2.2, f"{1e3 * joules:.3g} mJ", ha="center", color=INK, fontsize=13)
        place.set(xlim=(0, 1.15e6 * widest), ylim=(0, 1.15 * force), ylabel="load, N")
        place.set_xlabel(f"way of the loaded end, µm: {move:.0f} at the full load")
        place.spines[["top", "right"]].set_visible(False)
    return figure


def verdict() -> Figure:
    """Draw the compliance on finer and finer meshes, and the interval of the verdict."""
    design = plate()
    told = check(design)
    values = [1e3 * next(iter(level.compliance.values())) for level in told.levels]
    figure, (place,) = panels(f"{told.status}: {1e3 * told.value:.4g} mJ ± {100 * told.bound:.2g} %", tall=2.8)
    place.set_axis_on()
    low, high = (1e3 * told.value * (1 + sign * told.bound) for sign in (-1, 1))
    place.axhspan(low, high, color=MATERIAL, alpha=0.45)
    place.axhline(1e3 * told.value, color=INK, lw=1)
    place.plot(range(len(values)), values, "o-", color=RED, ms=8)
    for i, value in enumerate(values):
        place.annotate(f"{value:.4g}", (i, value), (9, -12), textcoords="offset points", color=INK)
    place.text(
        len(values) - 0.08, 1e3 * told.value, " the verdict, \n with its bound", va="bottom", ha="right", color=INK
    )
    place.set_xticks(range(len(values)), [f"{level.triangles:,} triangles" for level in told.levels])
    place.set(xlim=(-0.4, len(values)), ylim=(min(low, *values) - 0.25 * (high - low), None), ylabel="compliance, mJ")
    place.spines[["top", "right"]].set_visible(False)
    return figure


CONCEPTS: dict[str, Callable[[], Figure]] = {
    drawing.__name__: drawing for drawing in (stress_directions, mode, stripes, phase, compliance, verdict)
}
"""Drawings by name; the name is that of the file."""
