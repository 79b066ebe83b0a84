"""A figure's renditions side by side, and what was measured of each, with the command that measures it again."""

from html import escape

import numpy as np

from dsfab.render.colouring import Bar
from dsfab.report.html import image, why
from dsfab.report.paper.drawing import PaperPicture
from dsfab.report.paper.figures import WAYS, FigurePictures
from dsfab.study.renditions import Rendition

COLUMNS = (
    ("kept", "share of the surface that is material, loose pieces among it"),
    ("pieces", "of the drawn pattern; in brackets those that reach no support"),
    ("loads carried", "share of the loads that stand on pieces which reach a support"),
    ("over the uncut sheet", "compliance, of one solve each; of cut sheets 15 % off at most"),
    ("over a thinner sheet", "compliance over that of an uncut sheet of the same mass: above 1 it is the softer one"),
    ("off the stress", "degrees between members and principal directions, of the family that is further off"),
    ("P95 / P5 spacing", "1 where members are evenly spaced, of the family that is less even"),
)
"""What is measured, and what it means."""


def measured(made: FigurePictures, coarser: float) -> str:
    """The pictures of the renditions, a table of what was measured, departures, and the command."""
    if not made.ways:
        return ""
    name = made.figure.preset
    cells = "".join(picture_cell(one.picture, name) for one in made.ways)
    head = "".join(f'<th title="{escape(words)}">{escape(column)}</th>' for column, words in COLUMNS)
    rows = "".join(_row(one.rendition) for one in made.ways)
    findings = "".join(
        f"<p><b>{escape(WAYS[one.rendition.name])}:</b> {escape(one.found)}.</p>" for one in made.ways if one.found
    )
    return (
        f'{findings}<div class="compared ways" style="--across: {len(made.ways)}">{cells}</div>'
        f'<table class="measured"><caption>Measured, again by {again(name, coarser)}</caption>'
        f"<tr><th></th>{head}</tr>{rows}</table>{_built(made)}"
    )


def again(name: str, coarser: float) -> str:
    """The command that makes a figure of the page again, with all that is measured on it."""
    return f"<code>{escape(f'dsfab reproduce {name}' + (f' --coarser {coarser:g}' if coarser != 1 else ''))}</code>"


def rendition_facts(made: Rendition) -> tuple[str, ...]:
    """The cells of a rendition under `COLUMNS`, in words."""
    if made.refused:
        return ("none", *("" for _ in COLUMNS[1:]))
    pieces = f"{made.pieces} ({made.loose} loose)" if made.loose else f"{made.pieces}"
    return (
        f"{made.share:.0%}",
        pieces,
        "no load" if np.isnan(made.carried) else f"{made.carried:.0%}",
        _ratio(made.over_uncut),
        _ratio(made.over_thinner),
        f"{made.deviation:.1f}",
        f"{made.evenness:.3g}",
    )


def _row(made: Rendition) -> str:
    cells = "".join(f"<td>{escape(cell)}</td>" for cell in rendition_facts(made))
    return f"<tr><th>{escape(WAYS[made.name])}</th>{cells}</tr>"


def _ratio(x: float) -> str:
    """A ratio of compliances in words."""
    return "no load" if np.isnan(x) else "not carried" if np.isinf(x) else f"{x:.3g}"


def _built(made: FigurePictures) -> str:
    """Where each departs from the paper, and how its structure is built."""
    lines = []
    for way in made.ways:
        one = way.rendition
        told = one.refused or "; ".join(one.departures) or "no departure but the scale of the modes"
        told += f"; not carried: {one.uncarried}" if one.uncarried else ""
        mesh = f" --set surface.edge={way.edge:.6g}" if made.coarser != 1 and way.edge else ""
        lines.append(
            f'<p class="quiet"><b>{escape(WAYS[one.name])}</b>: {escape(told)}. '
            f"<code>dsfab build {escape(made.figure.preset + mesh + one.command)}</code></p>"
        )
    return "".join(lines)


def picture_cell(shown: PaperPicture, name: str, kind: str = "") -> str:
    inside = image(shown.file, f"{name}: {shown.title}", shown.size) if shown.file else why(shown.words)
    if shown.file:
        inside = f'<a href="{shown.file}">{inside}</a>'
    words = f"<small>{escape(shown.words)}</small>" if shown.file and shown.words else ""
    bar = _bar(shown.bar) if shown.bar else ""
    return f'<figure class="{kind}">{inside}<figcaption><b>{escape(shown.title)}</b>{bar}{words}</figcaption></figure>'


def _bar(bar: Bar) -> str:
    """The scale of colours, with what stands at its ends."""
    colours = ", ".join(f"rgb({r:.0f}, {g:.0f}, {b:.0f})" for r, g, b in bar.colours)
    left, right = (f"{label} {name}".strip() for label, name in zip(bar.labels[::2], bar.names, strict=True))
    strip = f'<i style="background: linear-gradient(to right, {colours})"></i>'
    return f'<span class="bar">{escape(left)}{strip}{escape(right)}</span>'
