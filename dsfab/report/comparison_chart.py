"""The chart of a comparison at several volumes: compliance over mass, a line for each competitor, as SVG and PNG."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Row = Mapping[str, Any]
"""A row of `results.json`: see `dsfab.study.competitors.Competitor.row`, and its `volume`."""

STYLES: Mapping[str, tuple[str, str, str]] = {
    "design": ("#b4441c", "-", "o"),
    "plain": ("#dd8f5a", "--", "o"),
    "row": ("#dd8f5a", ":", "v"),
    "letter": ("#c9a58c", ":", "1"),
    "stripes": ("#2c7a4a", "-", "P"),
    "isotropic": ("#3d7fc4", "-", "s"),
    "rotated": ("#9a6fc0", "-", "^"),
    "thinner": ("#6f6f6f", ":", ""),
    "von_mises": ("#b0892a", "-", "v"),
    "grid": ("#2c9a62", "-", "D"),
    "simp": ("#222222", "-.", "x"),
}
"""Colour, line and mark of each competitor; readable without colours too."""

NAMES = {
    "design": "this design",
    "plain": "the same, plain widths",
    "row": "Table 1's row, labelled by sign",
    "letter": "Table 1's row to the letter",
    "stripes": "evenly spaced stripes",
    "isotropic": "isotropic, best pair of modes",
    "rotated": "turned by 45°, best pair",
    "thinner": "whole sheet, thinner",
    "von_mises": "von Mises stripes",
    "grid": "straight grid",
    "simp": "SIMP, cut along a level line",
}

TONNE = 1000.0

CROWDED = 6
"""Names of more rows than these stand below the lines, where they hide none."""


def write_chart(rows: Sequence[Row], title: str, path: Path, names: Mapping[str, str] = NAMES) -> None:
    """The chart as `path` with the suffixes .svg and .png.

    rows  : of several volumes; those that carry nothing leave a gap in their line.
    names : what each competitor is called in it.
    """
    import matplotlib as mpl

    settings: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "dsfab", "font.size": 10}
    with mpl.rc_context(settings):
        _save(chart_figure(rows, title, names), path)


def chart_figure(rows: Sequence[Row], title: str, names: Mapping[str, str] = NAMES) -> "Figure":
    """The chart itself, see `write_chart`."""
    from matplotlib.figure import Figure

    many = len({row["name"] for row in rows}) > CROWDED
    figure = Figure(figsize=(7.6, 5.6 if many else 4.6), layout="constrained")
    axes = figure.add_subplot()
    _draw(axes, rows, title, names)
    if many:
        figure.legend(*axes.get_legend_handles_labels(), frameon=False, fontsize=9, loc="outside lower left", ncols=2)
    else:
        axes.legend(frameon=False, fontsize=9)
    return figure


def _save(figure: "Figure", path: Path) -> None:
    figure.savefig(path.with_suffix(".svg"), format="svg", metadata={"Date": None, "Creator": None})
    figure.savefig(path.with_suffix(".png"), format="png", dpi=110, metadata={"Software": None})


def _draw(axes: "Axes", rows: Sequence[Row], title: str, names: Mapping[str, str]) -> None:
    full = next(row for row in rows if row["name"] == "full")
    heavy = full["mass_kg"] >= TONNE
    unit, scale = ("t", 1 / TONNE) if heavy else ("kg", 1.0)
    whole = full["mass_kg"] * scale
    for name in (name for name in STYLES if any(row["name"] == name for row in rows)):
        colour, line, mark = STYLES[name]
        mine = sorted((row for row in rows if row["name"] == name), key=lambda row: float(row["volume"]))
        mass = [whole * row["volume"] for row in mine]
        ratio = [_number(row["ratio_to_full"]) for row in mine]
        wide = 2.4 if name == "design" else 1.5
        told = names[name] + ("" if any(value == value for value in ratio) else ": carries nothing")
        axes.plot(mass, ratio, color=colour, linestyle=line, marker=mark, markersize=5, linewidth=wide, label=told)
        if name == "isotropic" and told == names[name]:
            low, high = ([_over(row, f"variants_{key}") for row in mine] for key in ("best", "worst"))
            axes.fill_between(
                mass, low, high, color=colour, alpha=0.13, linewidth=0, label="isotropic, all pairs that carry"
            )
    axes.set_yscale("log")
    for formatter in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        formatter(lambda value, _: f"{value:g}" if f"{value:g}".strip("0.")[:1] in "1235" else "")
    axes.set_xlabel(f"mass, {unit}")
    axes.set_ylabel("compliance over that of the full sheet")
    if title:
        axes.set_title(title, fontsize=11, loc="left")
    share = axes.secondary_xaxis("top", functions=(partial(_times, 100 / whole), partial(_times, whole / 100)))
    share.set_xlabel("share of the surface, %", fontsize=9)
    axes.grid(True, which="both", color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)


def _times(factor: float, x: Any) -> Any:
    return factor * x


def _over(row: Row, key: str) -> float:
    """A compliance of the variants over that of the full sheet."""
    best, ratio = _number(row.get("compliance_J")), _number(row["ratio_to_full"])
    return _number(row.get(key)) * ratio / best


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
