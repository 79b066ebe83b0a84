"""Charts of a report, as PNG."""

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from dsfab.report.comparison_chart import STYLES, chart_figure
from dsfab.report.compliance.findings import LABELS, Findings
from dsfab.report.compliance.words import digits_of, unit_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 200

Chart = tuple[bytes, tuple[int, int]]
"""PNG, and its width and height in pixels."""

Charts = Mapping[str, Chart]

FONT: dict[Any, Any] = {"font.family": ["Helvetica", "Arial", "Liberation Sans", "DejaVu Sans"], "font.size": 9}


def charts(found: Findings, rows: Sequence[Mapping[str, Any]]) -> dict[str, Chart]:
    """`bars` of the structures of one mass; `volumes` where several masses were asked for. rows : of these."""
    made: dict[str, Chart] = {}
    with lettering():
        if found.compared.rivals:
            made["bars"] = png(_bars(found))
        if len(found.volumes) > 1:
            made["volumes"] = png(chart_figure(rows, ""))
    return made


@contextmanager
def lettering(**more: Any) -> Iterator[None]:
    """Charts with the letters of a report; more : settings of matplotlib."""
    import logging

    import matplotlib as mpl

    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)  # one of the fonts is enough
    settings: dict[Any, Any] = {**FONT, **more}
    with mpl.rc_context(settings):
        yield


def _bars(found: Findings) -> "Figure":
    """Compliance of each that carries, with its bound."""
    from matplotlib.figure import Figure

    shown = [one for one in found.compared.competitors if one.judgement]
    factor, unit = unit_for(found.unit_of, "J")
    figure = Figure(figsize=(6.7, 0.7 + 0.36 * len(shown)), layout="constrained")
    axes = figure.add_subplot()
    values = [one.compliance / factor for one in shown]
    bounds = [value * (one.judgement.bound or 0.0) for one, value in zip(shown, values, strict=True) if one.judgement]
    colours = [STYLES.get(one.name, ("#b9bec5", "", ""))[0] for one in shown]
    axes.barh(range(len(shown)), values, 0.62, color=colours, xerr=bounds, error_kw={"lw": 1, "capsize": 3})
    most = max(value + bound for value, bound in zip(values, bounds, strict=True))
    for place, (value, bound) in enumerate(zip(values, bounds, strict=True)):
        axes.text(value + bound + 0.012 * most, place, digits_of(value), va="center", fontsize=8.5)
    axes.set_yticks(range(len(shown)), [LABELS[one.name] for one in shown])
    axes.invert_yaxis()
    axes.set_xlim(0, 1.1 * most)
    axes.set_xlabel(f"compliance, {unit} (shorter is stiffer)")
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    return figure


def png(figure: "Figure") -> Chart:
    """A figure as a file, with its size in pixels."""
    written = io.BytesIO()
    figure.savefig(written, format="png", dpi=DPI, metadata={"Software": None})
    wide, high = (round(DPI * inches) for inches in figure.get_size_inches())
    return written.getvalue(), (wide, high)
