"""The page of `dsfab reproduce`: every figure of the paper step by step, its parameters and its seconds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from dsfab.report.html import html_page, image, why
from dsfab.report.paper.claim import claim_section
from dsfab.report.paper.drawing import PaperComparison
from dsfab.report.paper.figures import RUNS, FigurePictures
from dsfab.report.paper.measures import again, measured, picture_cell
from dsfab.study.paper import Parameters, Timings

PAGE_NAME = "index.html"

TIMED = ("membrane", "bending", "statics", "stress", "diffusion", "modes")
"""The columns of Table 2 in seconds."""

FACTS_AT = 4
"""The words about a figure fill the place after its structure and three pictures: then families begin a row."""

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
"""Columns of Table 1, as the paper writes them and in words."""


@dataclass(frozen=True)
class PageFacts:
    """What the page says about itself: how much coarser than the presets it is, what made it, and how busy that was."""

    coarser: float
    machine: str
    load: str = ""


def page(figures: Sequence[FigurePictures], about: PageFacts, volumes: Sequence[Mapping[str, Any]] = ()) -> str:
    """The whole page; its pictures are files beside it. volumes : rows of sphere_volumes.json, whose chart is shown."""
    compared = [
        _comparison(one, again(figure.figure.preset, about.coarser)) for figure in figures for one in figure.comparisons
    ]
    sections = [_section(figure, about.coarser) for figure in figures]
    body = [_header(about), _overview(figures), *sections, *compared, claim_section(volumes)]
    return html_page("The paper's figures, made again", "\n".join(body), STYLE)


def pictures_of(folder: Path) -> set[str]:
    """Names of the pictures that the page in a folder shows; of an earlier page, for none of them to be left behind."""
    try:
        return set(re.findall(r'src="([\w.-]+\.webp)"', (folder / PAGE_NAME).read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError):
        return set()


def _header(about: PageFacts) -> str:
    load = f"; {escape(about.load)}" if about.load else ""
    rough = "" if about.coarser == 1 else f" The meshes are {about.coarser:g} times coarser than the presets' own."
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
    for made in figures:
        shown, name = made.structure, made.figure.preset
        inside = image(shown.file, f"{name}, structure", shown.size) if shown and shown.file else why("not made")
        tiles.append(f'<a href="#{name}">{inside}<span>{escape(made.figure.label)}</span> {escape(name)}</a>')
    return f'<nav aria-label="All figures">{"".join(tiles)}</nav>'


def _section(made: FigurePictures, coarser: float) -> str:
    figure = made.figure
    head = (
        f'<section id="{figure.preset}"><h2>{escape(figure.preset)} <span>{escape(figure.label)}</span></h2>'
        f"<p>{escape(figure.caption)}</p>"
    )
    if made.error:
        return f"{head}{why(f'Not made: {made.error}')}</section>"
    shown = [picture_cell(one, figure.preset, "large" if i == 0 else "") for i, one in enumerate(made.shown)]
    cells = "".join([*shown[:FACTS_AT], _facts(made, coarser), *shown[FACTS_AT:]])
    return f'{head}{measured(made, coarser)}<div class="steps">{cells}</div>{_tables(made)}</section>'


def _facts(made: FigurePictures, coarser: float) -> str:
    figure = made.figure
    edge = "" if coarser == 1 else " (on its own mesh)"
    finer = f"No mesh {coarser:g} times coarser has all its details: it was made {made.coarser:.3g} times coarser."
    lines = [escape(f"{made.carried[0].upper()}{made.carried[1:]}.")]
    if made.coarser != coarser:
        lines.append(finer)
    if figure.stand_in:
        lines.append(f"The surface stands in for the paper's: {escape(figure.stand_in)}.")
    lines += [f'<span class="quiet">Note on {escape(note)}.</span>' for note in made.notes]
    lines.append(f"<code>dsfab build {figure.preset}</code>{edge}")
    return f'<div class="facts">{"".join(f"<p>{line}</p>" for line in lines)}</div>'


def _tables(made: FigurePictures) -> str:
    row = made.figure.row
    first = _parameters(row) if row else "<p>Table 1 has no row for it.</p>"
    return f'<div class="tables">{first}{_seconds(made, made.figure.timings)}</div>'


def _parameters(row: Parameters) -> str:
    values = (row.gamma, row.r, *row.modes, *row.thresholds, *row.frequencies, *row.phases)
    head = "".join(f'<th title="{words}">{sign}</th>' for sign, words in PARAMETERS)
    cells = "".join(f"<td>{value:g}</td>" for value in values)
    return f"<table><caption>Table 1</caption><tr>{head}</tr><tr>{cells}</tr></table>"


def _seconds(made: FigurePictures, paper: Timings) -> str:
    theirs: dict[str, float | None] = {name: getattr(paper, name) for name in TIMED}
    given = made.seconds or {}
    ours: dict[str, float | None] = {name: given.get(name) for name in TIMED}
    head = "".join(f"<th>{word}</th>" for word in ("", "|V|", "|T|", *(name.capitalize() for name in TIMED), "Sum"))
    lines = [_timing("paper", paper.vertices, paper.triangles, theirs)]
    lines.append(_timing("dsfab", made.vertices, made.triangles, ours))
    return f"<table><caption>Table 2, seconds</caption><tr>{head}</tr>{''.join(lines)}</table>"


def _timing(who: str, vertices: int, triangles: int, seconds: dict[str, float | None]) -> str:
    known = [value for value in seconds.values() if value is not None]
    cells = "".join("<td>n/a</td>" if value is None else f"<td>{value:.3f}</td>" for value in seconds.values())
    return f"<tr><th>{who}</th><td>{vertices:,}</td><td>{triangles:,}</td>{cells}<td>{sum(known):.3f}</td></tr>"


def _comparison(one: PaperComparison, command: str) -> str:
    """command : what makes it again."""
    rows = "".join(
        f'<div class="compared" style="--across: {len(row)}">{"".join(picture_cell(s, one.title) for s in row)}</div>'
        for row in one.rows
    )
    words = f'<p>{escape(one.words)}</p><p class="quiet">Again by {command}</p>'
    return f"<section><h2>{escape(one.title)}</h2>{words}{rows}</section>"


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
"""What is its own: four pictures in a row, the structure as large as four."""
