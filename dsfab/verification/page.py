"""The verification page: tests with drawings, plots and numbers."""

import io
import platform
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.export import atomic_folder
from dsfab.report.html_pages import html_page
from dsfab.statics import REPORTED, USES, elements_of
from dsfab.verification import Problem, Standing, Test, VerificationRow, pattern_spread, shortfalls, standings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


COLOURS = ("#c0653c", "#3d7fc4", "#2c9a62", "#9a6fc0", "#b0892a", "#c0507f")
"""Colours of the pairs of membrane and bending elements, readable on white and on black."""

PUBLISHED, SUPPORT, LOAD = "#8d8d8d", "#2c9a62", "#c0653c"
MARKS = "xd+^v*sp<>hDPX"
INK, FAINT = "#010203", "#040506"  # Placeholders for the page's colours of text and faint lines.


def curves(test: Test, rows: Sequence[VerificationRow], against: Sequence[Standing]) -> str:
    """Return an SVG plot of the error (%) over the number of unknowns."""
    with _figure(6.6, 3.1) as (figure, axes):
        for colour, name in zip(COLOURS, dict.fromkeys(row.elements for row in rows), strict=False):
            for k, mesh in enumerate(test.meshes):
                plotted = [row for row in rows if (row.elements, row.mesh) == (name, mesh) and row.ratio is not None]
                axes.loglog(
                    [row.unknowns for row in plotted],
                    [_percent((row.ratio or 0) - 1) for row in plotted],
                    color=colour,
                    linestyle=("-", "--", ":")[k],
                    marker="o",
                    markersize=3.5,
                    linewidth=1.6,
                    label=(name if k == 0 else None) if plotted else None,
                )
        comparable = [standing for standing in against if standing.unknowns is not None]
        names = list(dict.fromkeys(standing.published.element for standing in comparable))
        for mark, name in zip(MARKS, names, strict=False):
            of_element = [standing for standing in comparable if standing.published.element == name]
            axes.plot(
                [standing.unknowns or 0 for standing in of_element],
                [_percent(standing.published.ratio - 1) for standing in of_element],
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
    """Return an SVG drawing of the mesh with its supports and loads."""
    V = problem.surface.V
    view = np.eye(2, 3) if problem.plane_axis == 2 else _isometric()
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
    if not size.any():  # a free vibration has no load
        return
    loaded = np.flatnonzero(size > 0.2 * size.max())
    loaded = loaded[np.unique(np.linspace(0, len(loaded) - 1, 8).round().astype(int))]  # at most 8 arrows are drawn
    reach = 0.2 * np.ptp(shown, axis=0).max() / size.max()
    for vertex in loaded:
        tip, tail = shown[vertex], shown[vertex] - reach * seen[vertex]
        style = {"arrowstyle": "-|>", "color": LOAD, "linewidth": 1.1, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7}
        axes.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=style)
        axes.update_datalim([tail])


def _isometric() -> Floats:
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    return np.array([[c, c, 0.0], [-s, s, 1.0]])


def _percent(error: float) -> float:
    return 100 * max(abs(error), 1e-5)  # a logarithmic scale cannot show 0


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
    text = io.StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r' id="[a-zA-Z]+[a-z0-9]*_\d+"', "", svg)  # remove the ids of groups; nothing uses them
    svg = re.sub(r"font: ([\d.]+)px[^;\"]*", r"font-size: \1px", svg)
    svg = re.sub(r"(?<![>\d.])(\d+\.\d\d)\d+", r"\1", svg)  # round coordinates, but not the labels of axes
    svg = svg.replace(INK, "currentColor").replace(FAINT, "var(--faint)")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{title}" ', 1).strip()


WORST_FIRST = ("off", "refused", "theory", "coarse", "not run", "ok")
"""Verdicts, the worst first; the summary shows the worst verdict of each test."""
PAIR = str(elements_of("displacement"))  # Elements whose results are compared with targets and published values.

STYLE = """
:root { --faint: rgb(138, 134, 128); }
@media screen and (prefers-color-scheme: dark) { :root { color-scheme: dark; --text: rgb(228, 226, 220);
  --paper: rgb(23, 24, 26); --quiet: rgb(150, 153, 157); --faint: rgb(132, 135, 139); --hair: rgb(58, 60, 64);
  --tint: rgb(36, 38, 41); --good: rgb(88, 196, 138); --bad: rgb(240, 129, 90); } }
body { font-size: 15px; max-width: 76rem; } h2 { margin: 2.4rem 0 .3rem; font-size: 1.15rem; }
table { margin: .6rem 0; } th, td { padding: .1rem .4rem; }
th:first-child, td:first-child, .left { text-align: left; } td.left { white-space: normal; }
.ok, .better, .met { color: var(--good); } .off, .refused, .worse, .missed { color: var(--bad); }
.coarse { color: var(--quiet); }
figure { display: flex; flex-wrap: wrap; gap: 1rem; align-items: center; margin: .4rem 0; }
svg { max-width: 100%; height: auto; font-family: var(--sans); } a { color: inherit; }
.wide { overflow-x: auto; }
@media print { section { break-inside: avoid; } }
"""


def write_page(folder: Path, tests: Sequence[Test], rows: Sequence[VerificationRow]) -> Path:
    """Write `index.html` with the results of the tests; return its path. Raises ExportError."""
    text = page(tests, rows)
    with atomic_folder(folder) as partial:
        (partial / "index.html").write_text(text, encoding="utf-8")
    return folder / "index.html"


def page(tests: Sequence[Test], rows: Sequence[VerificationRow]) -> str:
    """Return the HTML text of the page."""
    against = standings(rows, {test.name: test for test in tests})
    short = shortfalls(rows)
    parts = [_head(tests, rows), _uses(), _summary(tests, rows), _published_counts(against)]
    parts += [_section(test, rows, against, short) for test in tests]
    return html_page("dsfab verify", "\n".join(parts), STYLE)


def _head(tests: Sequence[Test], rows: Sequence[VerificationRow]) -> str:
    limits = {test.name: test.limit for test in tests}
    aimed = [row for row in rows if row.met is not None]
    missed = "".join(
        f"<li>{row.test}, {_cells(row.cells)}, {row.mesh.replace('_', ' ')}: {_error(row, limits[row.test])}</li>"
        for row in aimed
        if not row.met
    )
    met = sum(bool(row.met) for row in aimed)
    spread = {key: value for key, value in pattern_spread(rows).items() if key[1:] == (PAIR, 16)}
    widest = max(spread, key=lambda key: spread[key], default=None)
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy"))
    versions = f"dsfab {__version__}, Python {platform.python_version()}, {libraries}"
    return "\n".join(
        [
            "<h1>Can the statics be trusted?</h1>",
            "<p>Structures with known answers, each on at least three meshes. <b>Ratio</b> is the value found over ",
            "the reference. Thin sheets may converge to another limit L: a second ratio, value / L, is then what the ",
            f"targets are about. Numbers are reported from <b>{' and '.join(map(str, REPORTED))}</b>, which must be ",
            "ok on each test's finest mesh; otherwise the command fails. Other elements are for comparison. Verdicts: ",
            "<span class=ok>ok</span> within the tolerance of what the test is about, ",
            "<span class=coarse>coarse</span> not yet but on a finer mesh, ",
            "<span class=off>off</span> not on the finest either, <span class=quiet>not run</span> ",
            "for 'hinge' elements, which cannot clamp the edges of a test. In plots, each mesh pattern has a line, in "
            "the order of ",
            "the table (solid, dashed, dotted), grey marks are published values, the grey line is the tolerance.</p>",
            f"<p>Targets of {PAIR}: {met} of {len(aimed)} met{'; missed:' if missed else '.'}</p><ul>{missed}</ul>",
            f"<p>Widest spread between mesh patterns at 16 cells: {100 * spread[widest]:.2g} % ({widest[0]}).</p>"
            if widest
            else "",
            f"<p class=quiet>Made by <code>dsfab verify --page</code> with {escape(versions)}.</p>",
        ]
    )


def _uses() -> str:
    lines = "".join(
        f"<tr><td class=left>{escape(use.about)}</td><td>{use.pair}</td>"
        f"<td>{'not tested' if use.tolerance is None else f'{100 * use.tolerance:g} %'}</td></tr>"
        for use in USES.values()
    )
    return (
        "<h2>What is reported by which elements</h2><table><tr><th class=left>what</th><th>elements</th>"
        f"<th>tolerance</th></tr>{lines}</table>"
    )


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"


def _error(row: VerificationRow, limit: float | None) -> str:
    if row.value is None:
        return "no value"
    limit_text = f" of the value {limit:.5g} to which thin sheets converge" if limit else ""
    return f"{row.value / (limit or row.reference):.4f}{limit_text}; wanted within {100 * (row.target or 0):.2g} %"


def _summary(tests: Sequence[Test], rows: Sequence[VerificationRow]) -> str:
    pairs = list(dict.fromkeys(row.elements for row in rows))
    head = "".join(f"<th colspan=2>{escape(pair)}</th>" for pair in pairs)
    lines = []
    for test in tests:
        cells = ""
        for pair in pairs:
            finest = [row for row in rows if (row.test, row.elements, row.cells) == (test.name, pair, test.cells[-1])]
            ratios = sorted(row.ratio for row in finest if row.ratio is not None)
            verdicts = Counter(row.verdict for row in finest)
            worst = next((name for name in WORST_FIRST if name in verdicts), "")
            apart = ratios and ratios[-1] - ratios[0] >= 5e-4
            shown = "" if not ratios else f"{ratios[0]:.3f}" + (f" to {ratios[-1]:.3f}" if apart else "")
            cells += f"<td>{shown}</td>" + _verdict(worst)
        lines.append(f'<tr><td><a href="#{test.name}">{test.name}</a></td><td>{test.cells[-1]}</td>{cells}</tr>')
    return (
        f"<h2>Ratio on the finest mesh, over all patterns</h2><div class=wide><table><tr><th>test</th><th>cells</th>"
        f"{head}</tr>{''.join(lines)}</table></div>"
    )


def _published_counts(against: Sequence[Standing]) -> str:
    if not against:
        return ""
    counts: dict[str, Counter[str]] = {}
    for standing in against:
        counts.setdefault(standing.published.element, Counter())[standing.outcome] += 1
    lines = "".join(
        f"<tr><td>{escape(name)}</td>"
        + "".join(f"<td>{count[outcome] or ''}</td>" for outcome in ("better", "alike", "worse", "unknown"))
        + "</tr>"
        for name, count in counts.items()
    )
    return (
        f"<h2>Against the field</h2><p>{PAIR} beside published values: its error at as many unknowns, or on the "
        "same cells where even its coarsest mesh has more; a value that passes through the reference by chance counts "
        "as on the finer meshes that follow. Errors closer than half a percent are alike; not comparable "
        "where the source does not tell its mesh. Each value stands in the table of its test.</p>"
        "<table><tr><th>published element</th><th>better</th><th>alike</th><th>worse</th><th>not comparable</th></tr>"
        f"{lines}</table>"
    )


def _section(test: Test, rows: Sequence[VerificationRow], against: Sequence[Standing], short: Mapping[str, str]) -> str:
    test_rows = [row for row in rows if row.test == test.name]
    test_standings = [standing for standing in against if standing.published.test == test.name]
    mesh = test.meshes[-1] if len(test.meshes) < 3 else "union_jack"
    problem = test.problem(test.cells[min(1, len(test.cells) - 1)], mesh)
    if len(problem.surface.edges.ends) > 3000:  # with more edges the lines of the drawing would merge
        problem = test.problem(test.cells[0], mesh)
    sketch = drawing(problem, test.about)
    plot = "" if test.tolerance < 1e-6 else curves(test, test_rows, test_standings)
    remarks = (test.beyond and f"Verdict theory: {test.beyond}", short.get(test.name, ""))
    note = "".join(f"<p>{escape(remark)}.</p>" for remark in remarks if remark)
    return (
        f'<section id="{test.name}"><h2>{test.name}</h2><p>{escape(test.about.capitalize())}. Reference '
        f"{test.reference:.6g}: {escape(test.source)}.{_limit(test)}</p><figure>{sketch}{plot}</figure>"
        f"{_table(test, test_rows)}{note}{_published_table(test_standings)}</section>"
    )


def _limit(test: Test) -> str:
    return (
        ""
        if test.limit is None
        else f" Targets refer to the limit {test.limit:.6g}, and so does each ratio after a slash."
    )


def _table(test: Test, rows: Sequence[VerificationRow]) -> str:
    colours = dict(zip(dict.fromkeys(row.elements for row in rows), COLOURS, strict=False))
    pairs = list(reversed(colours))
    head = "".join(f'<th colspan=4 style="color: {colours[pair]}">{escape(pair)}</th>' for pair in pairs)
    lines = ""
    for mesh in test.meshes:
        for cells in test.cells:
            row_by_pair = {row.elements: row for row in rows if (row.mesh, row.cells) == (mesh, cells)}
            target = next((row for row in row_by_pair.values() if row.met is not None), None)
            state = "" if target is None or target.target is None else f"{100 * target.target:.2g} % "
            word = "" if target is None else "met" if target.met else "missed"
            lines += (
                f"<tr><td>{mesh.replace('_', ' ')}</td><td>{cells}</td><td class={word or 'quiet'}>{state}{word}</td>"
            )
            lines += f"{''.join(_numbers(row_by_pair[pair]) for pair in pairs)}</tr>"
    return (
        f"<div class=wide><table><tr><th>mesh</th><th>cells</th><th>target</th>{head}</tr><tr class=quiet><td></td>"
        f"<td></td><td></td>{'<td>unknowns</td><td>ratio</td><td>rate</td><td></td>' * len(pairs)}</tr>{lines}"
        "</table></div>"
    )


def _numbers(row: VerificationRow) -> str:
    ratio = "" if row.ratio is None else f"{row.ratio:.4f}"
    if row.of_limit is not None:
        ratio += f" <span class=quiet>/ {row.of_limit:.4f}</span>"
    rate = "" if row.rate is None else f"{row.rate:.1f}"
    return f"<td class=quiet>{row.unknowns}</td><td>{ratio}</td><td>{rate}</td>{_verdict(row.verdict)}"


def _verdict(verdict: str) -> str:
    return f'<td class="{"quiet" if verdict in ("not run", "") else verdict}">{verdict}</td>'


def _published_table(against: Sequence[Standing]) -> str:
    if not against:
        return ""
    lines = ""
    for standing in against:
        published = standing.published
        mesh = published.note or _cells(published.cells or 0)
        ours = "" if standing.ours is None else f"{100 * standing.ours:.2f} %, equal {standing.basis}"
        outcome = "" if standing.outcome == "unknown" else standing.outcome
        lines += (
            f"<tr><td>{escape(published.element)}</td><td>{escape(mesh)}</td><td>{standing.unknowns or ''}</td>"
            f"<td>{published.ratio:.3f}</td><td>{ours}</td><td class={outcome or 'quiet'}>{outcome}</td>"
            f"<td class=left>{escape(str(published.source))}</td></tr>"
        )
    return (
        "<div class=wide><table><tr><th>published</th><th>mesh</th><th>unknowns</th><th>ratio</th>"
        f"<th>error of {PAIR}</th><th></th><th class=left>source</th></tr>{lines}</table></div>"
    )
