"""Figures of a compliance report."""

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.render import band_colours
from dsfab.render.lettering import PAPER, Palette
from dsfab.render.scene import Bytes, Colour
from dsfab.render.view import up_axis
from dsfab.report.compliance.findings import LABELS, Findings, prefixed_unit, round_number_above, significant_digits
from dsfab.report.html_pages import ColourScale, ReportFigure
from dsfab.slicing.measures.widths import kept_cells
from dsfab.study.judges import AnsweredLoad
from dsfab.study.verdict.estimates import quantile
from dsfab.surface import LoadCase, Surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ResultRow = Mapping[str, Any]  # row of `results.json`: `volume`, and the keys of `study.alternatives.Competitor.row`

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
"""Colour, line and mark of each competitor in charts; they differ in black and white too."""

NAMES = {
    "design": "this design",
    "isotropic": "isotropic stripes, from the best pair of modes",
    "rotated": "rotated by 45°, best pair",
    "thinner": "whole sheet, thinner",
    "von_mises": "von Mises stripes",
    "grid": "straight grid",
    "simp": "SIMP topology optimisation, cut along a level line",
}


def write_chart(rows: Sequence[ResultRow], title: str, path: Path, names: Mapping[str, str] = NAMES) -> None:
    """Write the chart of compliance against mass as `path` with the suffixes .svg and .png.
    rows : results for several shares of material.    names : label of each competing structure."""
    import matplotlib as mpl

    settings: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "dsfab", "font.size": 10}
    with mpl.rc_context(settings):
        figure = chart_figure(rows, title, names)
        figure.savefig(path.with_suffix(".svg"), format="svg", metadata={"Date": None, "Creator": None})
        figure.savefig(path.with_suffix(".png"), format="png", dpi=110, metadata={"Software": None})


def chart_figure(rows: Sequence[ResultRow], title: str, names: Mapping[str, str] = NAMES) -> "Figure":
    """Return the chart of compliance against mass as a figure of matplotlib."""
    from matplotlib.figure import Figure

    many = len({row["name"] for row in rows}) > 6  # a long legend would hide lines of the chart
    figure = Figure(figsize=(7.6, 5.6 if many else 4.6), layout="constrained")
    axes = figure.add_subplot()
    _plot_lines(axes, rows, title, names)
    if many:
        figure.legend(*axes.get_legend_handles_labels(), frameon=False, fontsize=9, loc="outside lower left", ncols=2)
    else:
        axes.legend(frameon=False, fontsize=9)
    return figure


def _plot_lines(axes: "Axes", rows: Sequence[ResultRow], title: str, names: Mapping[str, str]) -> None:
    full = next(row for row in rows if row["name"] == "full")
    unit, scale = ("t", 1e-3) if full["mass_kg"] >= 1000 else ("kg", 1.0)
    full_mass = full["mass_kg"] * scale
    for name in (name for name in STYLES if any(row["name"] == name for row in rows)):
        colour, line, mark = STYLES[name]
        competitor_rows = sorted((row for row in rows if row["name"] == name), key=lambda row: float(row["volume"]))
        mass = [full_mass * row["volume"] for row in competitor_rows]
        ratio = [_number(row["ratio_to_full"]) for row in competitor_rows]
        width = 2.4 if name == "design" else 1.5
        label = names[name] + ("" if any(value == value for value in ratio) else ": carries nothing")
        axes.plot(mass, ratio, color=colour, linestyle=line, marker=mark, markersize=5, linewidth=width, label=label)
        if name == "isotropic" and label == names[name]:
            keys, label = ("variants_best", "variants_worst"), "isotropic stripes: from the best to the worst mode pair"
            low, high = ([_ratio_to_full_sheet(row, key) for row in competitor_rows] for key in keys)
            axes.fill_between(mass, low, high, color=colour, alpha=0.13, linewidth=0, label=label)
    axes.set_yscale("log")
    for formatter in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
        formatter(lambda value, _: f"{value:g}" if f"{value:g}".strip("0.")[:1] in "1235" else "")
    axes.set_xlabel(f"mass, {unit}")
    axes.set_ylabel("compliance / compliance of the whole sheet")
    if title:
        axes.set_title(title, fontsize=11, loc="left")
    to_share, to_mass = 100 / full_mass, full_mass / 100
    share = axes.secondary_xaxis("top", functions=(lambda mass: to_share * mass, lambda share: to_mass * share))
    share.set_xlabel("share of the surface, %", fontsize=9)
    axes.grid(True, which="both", color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)


def _ratio_to_full_sheet(row: ResultRow, key: str) -> float:
    compliance, ratio = _number(row.get("compliance_J")), _number(row["ratio_to_full"])
    return _number(row.get(key)) * ratio / compliance


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)


ChartImage = tuple[bytes, tuple[int, int]]  # Bytes of a PNG file, and its width and height in pixels.
ChartImages = Mapping[str, ChartImage]
FONT: dict[Any, Any] = {"font.family": ["Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"], "font.size": 9}


def chart_images(findings: Findings, rows: Sequence[Mapping[str, Any]]) -> dict[str, ChartImage]:
    """Return charts of the compliances: `bars` compares structures, `volumes` plots compliance against mass."""
    images: dict[str, ChartImage] = {}
    with lettering():
        if findings.compared.rivals:
            images["bars"] = png_with_size(_bar_figure(findings))
        if len(findings.volumes) > 1:
            images["volumes"] = png_with_size(chart_figure(rows, ""))
    return images


@contextmanager
def lettering(**settings_of_chart: Any) -> Iterator[None]:
    """Use the fonts of a report for all charts in a `with` block."""
    import logging

    import matplotlib as mpl

    # hide warnings of missing fonts: matplotlib uses the list's next font
    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)
    settings: dict[Any, Any] = {**FONT, **settings_of_chart}
    with mpl.rc_context(settings):
        yield


def _bar_figure(findings: Findings) -> "Figure":
    from matplotlib.figure import Figure

    competitors = [competitor for competitor in findings.compared.competitors if competitor.judgement]
    factor, unit = prefixed_unit(findings.reference_compliance, "J")
    figure = Figure(figsize=(6.7, 0.7 + 0.36 * len(competitors)), layout="constrained")
    axes = figure.add_subplot()
    values = [competitor.compliance / factor for competitor in competitors]
    judgements = [competitor.judgement for competitor in competitors if competitor.judgement]
    bounds = [value * (judgement.bound or 0.0) for value, judgement in zip(values, judgements, strict=True)]
    colours = [STYLES.get(competitor.name, ("#b9bec5", "", ""))[0] for competitor in competitors]
    axes.barh(range(len(competitors)), values, 0.62, color=colours, xerr=bounds, error_kw={"lw": 1, "capsize": 3})
    longest = max(value + bound for value, bound in zip(values, bounds, strict=True))
    for place, (value, bound) in enumerate(zip(values, bounds, strict=True)):
        axes.text(value + bound + 0.012 * longest, place, significant_digits(value), va="center", fontsize=8.5)
    axes.set_yticks(range(len(competitors)), [LABELS[competitor.name] for competitor in competitors])
    axes.invert_yaxis()
    axes.set_xlim(0, 1.1 * longest)
    axes.set_xlabel(f"compliance, {unit} (shorter is stiffer)")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    return figure


def png_with_size(figure: "Figure", dpi: int = 200) -> ChartImage:
    """Return a figure as a PNG file, with its size in pixels."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=dpi, metadata={"Software": None})
    wide, high = (round(dpi * inches) for inches in figure.get_size_inches())
    return file.getvalue(), (wide, high)


SIZE, SMALL = (1500, 1000), (1050, 760)  # Size of large pictures and of pictures of load cases, pixels.
BANDS = 10  # Largest number of bands of a colour scale.
WHITE = replace(PAPER, paper=(255, 255, 255))
RED: Colour = (200, 60, 40)  # Colour of material that reaches no support.
TEXT = 174 / 25.4 * 72  # Width of the text of a report, points.


class FindingsPictures:
    """Pictures of a design that was compared. Every method returns a figure of a report.
    width in all methods : width of the picture, divided by the width of the report's text."""

    def __init__(self, findings: Findings) -> None:
        self.findings = findings

    @cached_property
    def no_picture_reason(self) -> str:
        """Reason why this machine cannot draw, or ''."""
        from dsfab.render.opengl import why_no_pictures

        why = why_no_pictures()
        return f"no picture: {why}" if why else ""

    @cached_property
    def up(self) -> Floats:
        """Direction (3,) that is up in all pictures."""
        task = self.findings.task
        return up_axis(task.surface.V, task.surface, task.statics.load)

    def design(self, caption: str, width: float) -> ReportFigure:
        """Draw the design."""
        sheet, task = self.findings.structure.sheet.surface, self.findings.task
        return self._figure(caption, width, SIZE, sheet.V, sheet.F, task.surface, task.statics.load)

    def all_material(self, caption: str, width: float) -> ReportFigure:
        """Draw all material of the pattern. Parts that reach no support are red."""
        structure, task = self.findings.structure, self.findings.task
        family = np.where(kept_cells(structure.material, structure.sheet), -1, 0)
        red, material = replace(WHITE, families=(RED,)), structure.material.surface
        load = task.statics.load
        return self._figure(caption, width, SIZE, material.V, material.F, task.surface, load, red, family)

    def case(self, name: str, caption: str, width: float, side_by_side: bool = False) -> ReportFigure:
        """Draw the uncut surface, loads and supports of case `name`. side_by_side : True for two pictures in a row."""
        surface = self.findings.task.surface
        load = self.findings.task.all_loads[name]
        palette = replace(WHITE, members=WHITE.plain)
        letters = letter_enlargement(SMALL, width / 2 if side_by_side else width)
        return self._figure(caption, width, SMALL, surface.V, surface.F, surface, load, palette, letters=letters)

    def stress(self, answered: AnsweredLoad, caption: str) -> ReportFigure:
        """Draw the cut sheet, coloured by the largest von Mises stress in each face."""
        sheet, value = self.findings.structure.sheet.surface, answered.stress.largest
        limit = quantile(value, sheet.areas, 0.98) or 1.0  # leaves out peaks at corners, 2 % of the area
        return self.band_figure(caption, sheet.V, sheet.F, value, limit, "Pa", "von Mises stress")

    def displacement(self, answered: AnsweredLoad, limit: float, caption: str) -> ReportFigure:
        """Draw the deformed sheet, coloured by displacement, 0 to `limit` (m).
        caption : text in which `{factor}` is replaced by the enlargement."""
        sheet, u = self.findings.structure.sheet.surface, answered.equilibrium.u
        # magnifies the largest displacement to at most 7 % of the surface's size
        factor = round_number_above(0.07 * self.findings.task.surface.size / float(np.linalg.norm(u, axis=1).max())) / 2
        moved = np.linalg.norm(u, axis=1)[sheet.F].mean(axis=1)
        words = caption.format(factor=significant_digits(factor, 2))
        return self.band_figure(words, sheet.V + factor * u, sheet.F, moved, limit, "m", "displacement")

    def band_figure(
        self, caption: str, V: Floats, F: Ints, value: Floats, limit: float, unit: str, quantity_name: str
    ) -> ReportFigure:
        """Return a picture of a mesh with faces coloured in bands by their values (m,). limit : top of the scale."""
        step = round_number_above(limit / BANDS)
        count = max(2, math.ceil(limit / step - 1e-9))
        bands = band_colours(count)
        palette = replace(WHITE, families=tuple(bands))
        band = np.minimum((value / step).astype(np.int64), count - 1)
        factor, name = (1e-3, "mm") if unit == "m" and limit < 1 else prefixed_unit(limit, unit)
        labels = [f"{k * step / factor:.4g}" for k in range(count + 1)]
        over = ", and above" if float(value.max()) > count * step else ""
        scale = ColourScale(f"{quantity_name}, {name} (darkest band: up to {labels[-1]} {name}{over})", bands, labels)
        return self._figure(caption, 0.86, SIZE, V, F, None, None, palette, band, scale)

    def _figure(
        self,
        caption: str,
        width: float,
        size: tuple[int, int],
        V: Floats,
        F: Ints,
        surface: Surface | None,
        load: LoadCase | None,
        palette: Palette = WHITE,
        family: Ints | None = None,
        scale: ColourScale | None = None,
        letters: float | None = None,
    ) -> ReportFigure:
        from dsfab.render.picture import Look, picture

        if self.no_picture_reason:
            return ReportFigure(caption, b"", size, missing=self.no_picture_reason)
        look = Look(size, self.up, palette, letters or letter_enlargement(size, width))
        pixels = picture(V, F, surface=surface, load=load, family=family, look=look)
        pixels = without_empty_rows(pixels, palette.paper)
        high, wide = pixels.shape[:2]
        return ReportFigure(caption, jpeg(pixels), (wide, high), width, scale)


def letter_enlargement(size: tuple[int, int], width: float, points: float = 7.0) -> float:
    """Return the factor, at least 1, by which a picture's letters must grow to be `points` high on paper.
    size : pixels.    width : width of the picture / width of the report's text."""
    point = size[0] / (TEXT * width)
    return max(1.0, points * point / (size[1] / 46))


def without_empty_rows(pixels: Bytes, paper: Colour, margin: int = 12) -> Bytes:
    """Return a picture (height, width, 3) with fewer empty rows. paper : colour of empty rows.
    margin : number of empty rows that remain at the top and at the bottom."""
    marked_rows = np.flatnonzero((np.abs(pixels.astype(np.int16) - np.array(paper)).max(axis=2) > 6).any(axis=1))
    if not len(marked_rows):
        return pixels
    gap = 3 * margin
    rows = [np.arange(max(marked_rows[0] - margin, 0), marked_rows[0])]
    for before, row in zip(marked_rows, [*marked_rows[1:], marked_rows[-1] + margin], strict=True):
        rows.append(np.arange(before, min(row, before + gap)))
    return np.asarray(pixels[np.concatenate(rows)])


def jpeg(pixels: Bytes, quality: int = 90) -> bytes:
    """Return a picture (height, width, 3) of bytes as a JPEG file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, format="JPEG", quality=quality, subsampling=0)
    return file.getvalue()
