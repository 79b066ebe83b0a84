"""The HTML page of `dsfab reproduce`."""

import base64
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.messages import value_with_bound
from dsfab.render.colouring import ColourBar
from dsfab.report.html_pages import html_page, image_tag, reason_paragraph
from dsfab.reproduction.drawing import PaperComparison, PaperPicture
from dsfab.reproduction.figures import RENDITION_TITLES, RUNS, FigurePictures
from dsfab.reproduction.published import Parameters, Timings
from dsfab.reproduction.renditions import Rendition
from dsfab.reproduction.volumes import RIVALS

Row = Mapping[str, Any]  # Row of sphere_volumes.json.
OURS = ("row", "design", "stripes")
OTHERS = (("isotropic", "the best isotropic stripes"), ("thinner", "a thinner sheet"))
"""Diffusion structures (`OURS`) and their competitors (`OTHERS`). The HTML page compares their stiffness."""


def claim_section(rows: Sequence[Row]) -> str:
    """Return HTML on the compliance of the sphere at several masses; '' without rows."""
    if not rows:
        return ""
    row_by_key = {(row["name"], row["volume"]): row for row in rows}
    shares = sorted({row["volume"] for row in rows})
    head = "".join(f"<th>{share:.0%}</th>" for share in shares)
    lines = []
    for name in (name for name in RIVALS if any(key[0] == name for key in row_by_key)):
        cells = "".join(_cell(row_by_key.get((name, share))) for share in shares)
        lines.append(f"<tr><th>{escape(RIVALS[name])}</th>{cells}</tr>")
    words = (
        "<p>The paper's claim, tested: how stiff is a sphere of one mass, held at a pole and pressed at the other?</p>"
        f"<ul>{''.join(f'<li>{line}</li>' for line in _claim_lines(row_by_key, shares))}</ul>"
        f"<p>{_verdict_text(rows)} The numbers are "
        'in <a href="sphere_volumes.json">its data</a>, again by <code>dsfab reproduce sphere --volumes</code>.</p>'
    )
    table = (
        '<table class="measured"><caption>Compliance, mJ, of the share of the surface that is kept, with its bound'
        f"</caption><tr><th></th>{head}</tr>{''.join(lines)}</table>"
    )
    image = '<img src="sphere_volumes.svg" alt="Compliance over mass on the sphere" style="max-width: 54rem">'
    return f'<section id="volumes"><h2>Compliance over mass</h2>{words}{table}{image}</section>'


def stiffness_ratio(own_row: Row | None, rival: Row | None) -> tuple[float, float, float] | None:
    """Return a design's stiffness / a rival's stiffness, and its lower and upper bound.
    Returns None if a compliance is unknown."""
    if not own_row or not rival or not own_row["compliance_J"] or not rival["compliance_J"]:
        return None
    ratio = rival["compliance_J"] / own_row["compliance_J"]
    own_bound, rival_bound = (float(row.get("bound") or 0.0) for row in (own_row, rival))
    return ratio, ratio * (1 - rival_bound) / (1 + own_bound), ratio * (1 + rival_bound) / (1 - own_bound)


def _cell(row: Row | None) -> str:
    if not row or not row["compliance_J"]:
        reason = (row or {}).get("error") or "not judged"
        return f'<td title="{escape(reason, quote=True)}">not carried</td>'
    value, bound = 1000 * row["compliance_J"], row.get("bound")
    text = value_with_bound(value, bound) if bound else f"{value:.3g}"
    if row["verdict"] != "pass":
        text = f"<i>{text}</i>"
    return f'<td title="{escape(row["reason"], quote=True)}">{text}</td>'


def _claim_lines(row_by_key: Mapping[tuple[str, float], Row], shares: Sequence[float]) -> Iterator[str]:
    for name in OURS:
        for rival, called in OTHERS:
            parts = []
            for share in shares:
                if bounded_ratio := stiffness_ratio(row_by_key.get((name, share)), row_by_key.get((rival, share))):
                    ratio, lowest, highest = bounded_ratio
                    alike = " (too close to tell)" if lowest <= 1 <= highest else ""
                    how = f"{ratio:.3g} times as stiff" if ratio >= 1 else f"{1 / ratio:.3g} times as soft"
                    parts.append(f"{how} at {share:.0%}{alike}")
            if parts:
                yield f"{RIVALS[name][0].upper()}{RIVALS[name][1:]} against {called}: {', '.join(parts)}."


def _verdict_text(rows: Sequence[Row]) -> str:
    judged = [row for row in rows if row["compliance_J"]]
    sure = [row for row in judged if row["verdict"] == "pass"]
    if not sure:
        return "Every number comes from one solve on the cut mesh; no number was checked on finer meshes."
    lowest, highest = (f"{100 * end(row['bound'] for row in sure):.1f}" for end in (min, max))
    text = (
        f"{len(sure)} of {len(judged)} numbers converge on finer and finer meshes, with error bounds of {lowest} to "
        f"{highest} %. All numbers are computed for thin sheets."
    )
    open_ones = [f"{RIVALS[row['name']]} at {row['volume']:.0%}" for row in judged if row["verdict"] != "pass"]
    return text + (f" Without a verdict, in italics: {', '.join(open_ones)}." if open_ones else "")


COLUMNS = (
    ("kept", "share of the surface that is material, including loose pieces"),
    ("pieces", "number of pieces of the drawn pattern; in brackets, the number of pieces without a support"),
    ("loads carried", "share of the loads that stand on pieces which reach a support"),
    ("over the uncut sheet", "compliance / compliance of the uncut sheet, by one solve each; error up to 15 %"),
    ("over a thinner sheet", "compliance / compliance of an equally heavy uncut sheet; above 1, the design is softer"),
    (
        "off the stress",
        "mean angle between members and principal directions, degrees; the larger value of both families",
    ),
    (
        "P95 / P5 spacing",
        "large / small distance between members (1 for even spacing); the larger value of both families",
    ),
)
"""Columns of the table of measures, with their meaning."""


def rendition_section(pictures: FigurePictures, coarser: float) -> str:
    """Return HTML that compares the versions of a figure. coarser : factor on the lengths of mesh edges."""
    if not pictures.ways:
        return ""
    name = pictures.figure.preset
    cells = "".join(picture_cell(entry.picture, name) for entry in pictures.ways)
    head = "".join(f'<th title="{escape(words)}">{escape(column)}</th>' for column, words in COLUMNS)
    rows = "".join(_row(entry.rendition) for entry in pictures.ways)
    findings = "".join(
        f"<p><b>{escape(RENDITION_TITLES[entry.rendition.name])}:</b> {escape(entry.found)}.</p>"
        for entry in pictures.ways
        if entry.found
    )
    return (
        f'{findings}<div class="compared ways" style="--across: {len(pictures.ways)}">{cells}</div>'
        f'<table class="measured"><caption>Measured, again by {command_html(name, coarser)}</caption>'
        f"<tr><th></th>{head}</tr>{rows}</table>{_built(pictures)}"
    )


def command_html(name: str, coarser: float) -> str:
    """Return the `dsfab reproduce` command of a figure as HTML."""
    return f"<code>{escape(f'dsfab reproduce {name}' + (f' --coarser {coarser:g}' if coarser != 1 else ''))}</code>"


def rendition_facts(rendition: Rendition) -> tuple[str, ...]:
    """Return the measures of a version of a figure as texts, in the order of `COLUMNS`."""
    if rendition.refused:
        return ("none", *("" for _ in COLUMNS[1:]))
    pieces = f"{rendition.pieces} ({rendition.loose} loose)" if rendition.loose else f"{rendition.pieces}"
    return (
        f"{rendition.share:.0%}",
        pieces,
        "no load" if np.isnan(rendition.carried) else f"{rendition.carried:.0%}",
        _ratio(rendition.over_uncut),
        _ratio(rendition.over_thinner),
        f"{rendition.deviation:.1f}",
        f"{rendition.evenness:.3g}",
    )


def _row(rendition: Rendition) -> str:
    cells = "".join(f"<td>{escape(cell)}</td>" for cell in rendition_facts(rendition))
    return f"<tr><th>{escape(RENDITION_TITLES[rendition.name])}</th>{cells}</tr>"


def _ratio(x: float) -> str:
    return "no load" if np.isnan(x) else "not carried" if np.isinf(x) else f"{x:.3g}"


def _built(pictures: FigurePictures) -> str:
    lines = []
    for entry in pictures.ways:
        rendition = entry.rendition
        text = (
            rendition.refused
            or "; ".join(rendition.departures)
            or "made as in the paper, except for the scale of the modes"
        )
        text += f"; not carried: {rendition.uncarried}" if rendition.uncarried else ""
        mesh = f" --set surface.edge={entry.edge:.6g}" if pictures.coarser != 1 and entry.edge else ""
        lines.append(
            f'<p class="quiet"><b>{escape(RENDITION_TITLES[rendition.name])}</b>: {escape(text)}. '
            f"<code>dsfab build {escape(pictures.figure.preset + mesh + rendition.command)}</code></p>"
        )
    return "".join(lines)


def picture_cell(shown: PaperPicture, name: str, kind: str = "") -> str:
    inside = reason_paragraph(shown.words)
    if shown.file:
        inside = f'<a href="{shown.file}">{image_tag(shown.file, f"{name}: {shown.title}", shown.size)}</a>'
    words = f"<small>{escape(shown.words)}</small>" if shown.file and shown.words else ""
    bar = _bar(shown.bar) if shown.bar else ""
    return f'<figure class="{kind}">{inside}<figcaption><b>{escape(shown.title)}</b>{bar}{words}</figcaption></figure>'


def _bar(bar: ColourBar) -> str:
    colours = ", ".join(f"rgb({r:.0f}, {g:.0f}, {b:.0f})" for r, g, b in bar.colours)
    left, right = (f"{label} {name}".strip() for label, name in zip(bar.labels[::2], bar.names, strict=True))
    strip = f'<i style="background: linear-gradient(to right, {colours})"></i>'
    return f'<span class="bar">{escape(left)}{strip}{escape(right)}</span>'


PAGE_NAME = "index.html"
TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes")  # Table 2's columns that hold seconds.
PARAMETERS = (
    ("&gamma;", "force magnitude"),
    ("r", "anisotropy"),
    ("a", "major mode"),
    ("b", "minor mode"),
    ("m<sub>U</sub>", "major threshold"),
    ("m<sub>W</sub>", "minor threshold"),
    ("&alpha;<sub>U</sub>", "major frequency"),
    ("&alpha;<sub>W</sub>", "minor frequency"),
    ("&beta;<sub>U</sub>", "major phase"),
    ("&beta;<sub>W</sub>", "minor phase"),
)
"""Columns of the paper's Table 1, by symbol and in words."""


@dataclass(frozen=True)
class PageFacts:
    """Facts about a page. coarser : factor on the lengths of mesh edges.    load : words on the processor's load."""

    coarser: float
    machine: str
    load: str = ""


def page(figures: Sequence[FigurePictures], about: PageFacts, volumes: Sequence[Mapping[str, Any]] = ()) -> str:
    """Return the page with the paper's figures as HTML. volumes : rows of sphere_volumes.json."""
    compared = [
        _comparison_section(comparison, command_html(figure.figure.preset, about.coarser))
        for figure in figures
        for comparison in figure.comparisons
    ]
    sections = [_section(figure, about.coarser) for figure in figures]
    body = [_header(about), _overview(figures), *sections, *compared, claim_section(volumes)]
    return html_page("The paper's figures, made again", "\n".join(body), STYLE)


def pictures_of(folder: Path) -> set[str]:
    """Return the file names of the pictures on the page in a folder."""
    try:
        return set(re.findall(r'src="([\w.-]+\.webp)"', (folder / PAGE_NAME).read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError):
        return set()


def _header(about: PageFacts) -> str:
    load = f"; {escape(about.load)}" if about.load else ""
    rough = "" if about.coarser == 1 else f" Edges of the meshes are {about.coarser:g} times as long as in the presets."
    return (
        "<header><h1>The paper's figures, made again</h1><p>A. Madan, A. Jacobson and D. I. W. Levin, "
        "<i>Diffusion Structures for Architectural Stripe Pattern Generation</i>: every result from its surface to its "
        "structure, with the parameters of the paper's Table 1. Where a surface of the paper cannot be had, one of "
        "dsfab's own stands in. Arrows are loads, cones supports; crosses are red along tension and blue along "
        "compression; a mode runs from teal through zero to ochre, green arrows lie along its gradient, "
        "and stripes across. Structures are drawn before pieces that reach no support are dropped.</p>"
        "<p>Every figure is made three ways: the paper to the letter, the preset that dsfab ships, and dsfab's own "
        "stripes; beneath them stands what was measured, where each departs from the paper, and the command that makes "
        "it again. One departure is everywhere: the paper does not say how its modes are scaled, and dsfab's are as "
        "large as on a sphere of radius 1 of the same area. Captions say what was measured.</p>"
        f'<p class="quiet">Made by <code>dsfab reproduce</code>: {escape(about.machine)}.{rough} Seconds are those of '
        f"the processor, all cores together, the median of {RUNS} runs{load}. The paper's stand above them, those of a "
        "laptop of 2015 (dual-core i5): it gives one row for each mesh.</p></header>"
    )


def _overview(figures: Sequence[FigurePictures]) -> str:
    tiles = []
    for pictures in figures:
        shown, name = pictures.structure, pictures.figure.preset
        inside = (
            image_tag(shown.file, f"{name}, structure", shown.size)
            if shown and shown.file
            else reason_paragraph("not made")
        )
        tiles.append(f'<a href="#{name}">{inside}<span>{escape(pictures.figure.label)}</span> {escape(name)}</a>')
    return f'<nav aria-label="All figures">{"".join(tiles)}</nav>'


def _section(pictures: FigurePictures, coarser: float) -> str:
    figure = pictures.figure
    head = (
        f'<section id="{figure.preset}"><h2>{escape(figure.preset)} <span>{escape(figure.label)}</span></h2>'
        f"<p>{escape(figure.caption)}</p>"
    )
    if pictures.error:
        return f"{head}{reason_paragraph(f'Not made: {pictures.error}')}</section>"
    shown = [picture_cell(image, figure.preset, "large" if i == 0 else "") for i, image in enumerate(pictures.shown)]
    cells = "".join([*shown[:4], _facts(pictures, coarser), *shown[4:]])
    return f'{head}{rendition_section(pictures, coarser)}<div class="steps">{cells}</div>{_tables(pictures)}</section>'


def _facts(pictures: FigurePictures, coarser: float) -> str:
    figure = pictures.figure
    edge = "" if coarser == 1 else " (on its own mesh)"
    finer = (
        f"Edges {coarser:g} times as long as in the preset would lose details of the surface, so this figure uses the "
        f"factor {pictures.coarser:.3g}."
    )
    lines = [escape(f"{pictures.carried[0].upper()}{pictures.carried[1:]}.")]
    if pictures.coarser != coarser:
        lines.append(finer)
    if figure.stand_in:
        lines.append(f"This surface replaces the surface in the paper: {escape(figure.stand_in)}.")
    lines += [f'<span class="quiet">Note on {escape(note)}.</span>' for note in pictures.notes]
    lines.append(f"<code>dsfab build {figure.preset}</code>{edge}")
    return f'<div class="facts">{"".join(f"<p>{line}</p>" for line in lines)}</div>'


def _tables(pictures: FigurePictures) -> str:
    row = pictures.figure.row
    parameters = _parameters_table(row) if row else "<p>Table 1 has no row for it.</p>"
    return f'<div class="tables">{parameters}{_seconds_table(pictures, pictures.figure.timings)}</div>'


def _parameters_table(row: Parameters) -> str:
    values = (row.gamma, row.r, *row.modes, *row.thresholds, *row.frequencies, *row.phases)
    head = "".join(f'<th title="{words}">{sign}</th>' for sign, words in PARAMETERS)
    cells = "".join(f"<td>{value:g}</td>" for value in values)
    return f"<table><caption>Table 1</caption><tr>{head}</tr><tr>{cells}</tr></table>"


def _seconds_table(pictures: FigurePictures, paper: Timings) -> str:
    theirs: dict[str, float | None] = {name: getattr(paper, name) for name in TIMED}
    own_seconds = pictures.seconds or {}
    ours: dict[str, float | None] = {name: own_seconds.get(name) for name in TIMED}
    head = "".join(f"<th>{word}</th>" for word in ("", "|V|", "|T|", *(name.capitalize() for name in TIMED), "Sum"))
    lines = [_timing("paper", paper.vertices, paper.triangles, theirs)]
    lines.append(_timing("dsfab", pictures.vertices, pictures.triangles, ours))
    return f"<table><caption>Table 2, seconds</caption><tr>{head}</tr>{''.join(lines)}</table>"


def _timing(who: str, vertices: int, triangles: int, seconds: dict[str, float | None]) -> str:
    values = [value for value in seconds.values() if value is not None]
    cells = "".join("<td>n/a</td>" if value is None else f"<td>{value:.3f}</td>" for value in seconds.values())
    return f"<tr><th>{who}</th><td>{vertices:,}</td><td>{triangles:,}</td>{cells}<td>{sum(values):.3f}</td></tr>"


def _comparison_section(comparison: PaperComparison, command: str) -> str:
    rows = "".join(
        f'<div class="compared" style="--across: {len(row)}">'
        f"{''.join(picture_cell(s, comparison.title) for s in row)}</div>"
        for row in comparison.rows
    )
    words = f'<p>{escape(comparison.words)}</p><p class="quiet">Again by {command}</p>'
    return f"<section><h2>{escape(comparison.title)}</h2>{words}{rows}</section>"


STYLE = """
body { max-width: 96rem; } h1 { margin: 0 0 .6rem; }
h2 span, nav span { font-weight: 400; color: var(--quiet); } h2 span { margin-left: .5rem; font-size: 1rem; }
header p, section > p { max-width: 54rem; margin: .35rem 0 1rem; }
.quiet { font-size: .9rem; } small { color: var(--quiet); }
nav { display: grid; grid-template-columns: repeat(auto-fill, minmax(12.5rem, 1fr)); gap: 1.2rem; margin: 2rem 0; }
nav a { color: inherit; text-decoration: none; font-size: .9rem; } nav a:hover { text-decoration: underline; }
section { border-top: 1px solid var(--hair); padding-top: 1.6rem; margin-top: 3rem; }
.steps, .compared { display: grid; gap: 1.4rem 1.2rem; grid-template-columns: repeat(4, minmax(0, 1fr)); }
.compared { grid-template-columns: repeat(var(--across), minmax(0, 24rem)); margin-top: 1rem; }
.large { grid-column: span 2; grid-row: span 2; }
@media (max-width: 60rem) { .steps { grid-template-columns: repeat(2, minmax(0, 1fr)); } }
figcaption { font-size: .86rem; line-height: 1.4; padding-top: .35rem; }
figcaption b { display: block; font-weight: 600; } small { display: block; }
.bar { display: flex; gap: .5rem; align-items: center; margin: .15rem 0; font-variant-numeric: tabular-nums; }
.bar i { flex: 0 1 7rem; height: .5rem; }
section > .why { aspect-ratio: auto; padding: 2rem; }
.facts { font-size: .92rem; padding-top: .4rem; } .facts p { margin: 0 0 .55rem; }
.tables { margin-top: 1.6rem; display: flex; flex-wrap: wrap; gap: 1rem 3rem; overflow-x: auto; }
.measured th { white-space: normal; } .measured th:first-child { text-align: left; min-width: 11rem; }
.measured { margin: 1rem 0 1.2rem; font-size: .86rem; } .ways { margin-bottom: 1rem; }
.tables th:first-child, .tables td:first-child { padding-left: 0; } .tables td + td { padding-left: .6rem; }
@media print { section { break-inside: avoid; } }
"""
"""CSS of the page: four columns; the picture of the structure is two columns wide."""

SMALL_NAME = "small.html"
LINKED = re.compile(r'<a href="[\w.-]+\.webp">(<img[^>]*>)</a>')
PICTURE = re.compile(r'src="([\w.-]+\.(?:webp|svg))"')


def small_page(text: str, folders: Sequence[Path]) -> str:
    """Return the page as a single HTML file that contains its pictures, made smaller.
    text : HTML of the page.    folders : folders in which its pictures are searched."""
    data_by_name: dict[str, str] = {}

    def inside(match: re.Match[str]) -> str:
        name = match.group(1)
        if name not in data_by_name:
            data_by_name[name] = _data(next(path for folder in folders if (path := folder / name).is_file()))
        return f'src="{data_by_name[name]}"'

    return PICTURE.sub(inside, LINKED.sub(r"\1", text))


def _data(path: Path) -> str:
    if path.suffix == ".svg":
        return f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
    from PIL import Image

    buffer = io.BytesIO()
    with Image.open(path) as picture:
        size = max(picture.width // 2, 1), max(picture.height // 2, 1)
        half = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    half.save(buffer, format="WEBP", quality=40, method=6)  # all figures together stay below 1.5 MB
    return f"data:image/webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"
