"""The command `dsfab compare`: designs against competitors of the same mass."""

import csv
import json
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Quiet, Source
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import DsfabError
from dsfab.core.messages import bounded, length, mass, sentence, table
from dsfab.export import require_writable, whole_or_nothing
from dsfab.report.comparison_files import write_results
from dsfab.report.compliance.findings import percent, within
from dsfab.report.design.facts import versions
from dsfab.study import losing_line

if TYPE_CHECKING:
    from dsfab.preset.model import Preset
    from dsfab.report.compliance import Findings
    from dsfab.study import Comparison
    from dsfab.study.alternatives import Competitor


HEAD = (
    "structure",
    "variant",
    "mass",
    "kept",
    "compliance",
    "level",
    "over full",
    "over design",
    "moves",
    "pieces",
    "s",
)


def comparison_text(share: float | None, result: "Comparison") -> str:
    """Return a table of the structures that carry the loads, then remarks."""
    lost = losing_line(result.alternatives)
    lines = [sentence(lost)] if lost else []
    lines += [] if share is None else [f"{share:.0%} of the material"]
    lines.append(table(HEAD, (_cells(one, result) for one in result.competitors if one.judgement)))
    for one in result.competitors:
        if one.error:
            lines.append(f"{one.name} does not carry the loads: {one.error}")
        elif one.spread:
            lines.append(_spread(one, result))
    lines += _theory(result)
    lines += [line for one in result.competitors for line in _modes(one)]
    for one in result.rivals:
        gain = result.gain(one.name)
        if one.judgement and result.design.judgement:
            best = "best " if one.spread else ""
            lines.append(f"the design is {gain:.3g} x as stiff as the {best}{one.name} structure of the same mass")
    return "\n".join(lines)


def _theory(result: "Comparison") -> list[str]:
    judged = {one.name: one.judgement.theory for one in result.competitors if one.judgement}
    known = [f"{name} by up to {percent(theory)}" for name, theory in judged.items() if theory]
    return [f"thin-shell theory: solids are softer, {', '.join(known)}"] if known else []


def _modes(one: "Competitor") -> list[str]:
    cases = list(one.judgement.cases.values()) if one.judgement else []
    pressed = [case for case in cases if case.buckling is not None]
    told = []
    if pressed:
        least = min(pressed, key=lambda case: case.buckling or 0.0)
        told.append(f"buckles at {bounded(least.buckling or 0.0, least.buckling_bound)} x the load")
    if swinging := [case for case in cases if case.frequency is not None]:
        told.append(f"swings at {bounded(swinging[0].frequency or 0.0, swinging[0].frequency_bound, 'Hz')}")
    assumed = next((f" ({case.assumed})" for case in cases if case.assumed), "")
    refused = list(dict.fromkeys(text for case in cases for text in case.refusals))
    return [f"{one.name} {' and '.join(told)}{assumed}"] * bool(told) + [f"{one.name}: {text}" for text in refused]


def _cells(one: "Competitor", result: "Comparison") -> tuple[str, ...]:
    gain = result.gain(one.name)
    moved = one.judgement.worst("displacement").value if one.judgement else float("nan")
    return (
        one.name,
        one.variant,
        mass(one.mass),
        f"{one.area_fraction:.1%}",
        within(one.compliance, one.judgement.bound if one.judgement else None, "J"),
        one.judgement.level if one.judgement else "",
        f"{one.compliance / result.full.compliance:.2f}",
        f"{gain:.2f}" if result.design.judgement else "-",
        length(moved),
        str(one.pieces),
        f"{one.seconds:.1f}",
    )


def _spread(one: "Competitor", result: "Comparison") -> str:
    spread, full = one.spread, result.full.compliance
    assert spread is not None
    return (
        f"{one.name}: {spread.carried} of {spread.tried} variants carry the loads, from {spread.best / full:.3g} to "
        f"{spread.worst / full:.3g} x the full sheet, {spread.mean / full:.3g} x in the mean"
    )


Compared = tuple[float | None, "Comparison"]
"""A share of the surface, None for the design as it is, and its comparison."""


@Parameter(name="*")
@dataclass(frozen=True)
class Questions:
    """Options of a comparison."""

    against: Annotated[
        str | None,
        Parameter(help="Comma list: isotropic, rotated, thinner, von_mises, grid, simp [isotropic,thinner]."),
    ] = None
    volumes: Annotated[
        str | None,
        Parameter(help="LOW:HIGH:COUNT shares of the surface, such as 0.2:0.8:7: compare at each of them too."),
    ] = None
    level: Annotated[
        Literal["quick", "full"] | None,
        Parameter(
            help="quick: one solve each. full: finer and finer meshes, for a compliance with a tested bound [full for "
            "the design, and for the best of each competitor if all take less than a minute; quick for --volumes]."
        ),
    ] = None
    buckling: Annotated[bool, Parameter(negative=(), help="Also the lowest load factor of each.")] = False
    frequency: Annotated[bool, Parameter(negative=(), help="Also the lowest natural frequency of each.")] = False
    memory: Annotated[float, Parameter(help="GB that the solver may take for a full check.")] = 4.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the competitors. Raises DsfabError for an unknown one."""
        from dsfab.study.baselines import DEFAULT, chosen

        words = () if self.against is None else tuple(self.against.split(","))
        names = DEFAULT if self.against is None else tuple(word.strip() for word in words if word.strip())
        chosen(names)
        return names

    @property
    def shares(self) -> list[float]:
        """Shares of the surface for further comparisons: '0.2:0.8:7' are seven. Raises DsfabError for another form."""
        if self.volumes is None:
            return []
        try:
            low, high, count = self.volumes.split(":")
            shares = [round(float(share), 6) for share in np.linspace(float(low), float(high), int(count))]
        except ValueError:
            shares = []
        if not shares or not (min(shares) > 0 and max(shares) < 1):
            raise DsfabError(
                f"--volumes {self.volumes!r} is not LOW:HIGH:COUNT with shares between 0 and 1; write for instance "
                "0.2:0.8:7"
            )
        return shares

    def words(self) -> list[str]:
        """Return the words of a command line with the same options."""
        options = {"against": self.against, "volumes": self.volumes, "level": self.level}
        options |= {"memory": str(self.memory) if self.memory != Questions.memory else None}
        words = [word for name, value in options.items() if value is not None for word in (f"--{name}", value)]
        flags = {"buckling": self.buckling, "frequency": self.frequency}
        return words + [f"--{name}" for name, asked in flags.items() if asked]


@Parameter(name="*")
@dataclass(frozen=True)
class Results:
    """Folder and files of the results."""

    output: Annotated[
        Path | None,
        Parameter(
            name=["-o", "--output"],
            help="Folder for the results [outputs/NAME/compliance]; of several presets, a folder each in it.",
        ),
    ] = None
    resume: Annotated[
        bool, Parameter(negative=(), help="Leave out presets that were compared already, by the same command.")
    ] = False
    report: Annotated[bool, Parameter(help="Also write report.html and report.pdf.")] = True


@dataclass(frozen=True)
class Task:
    """A comparison: the preset with its changes, the options, and whether to write a report."""

    source: Source
    questions: Questions
    report: bool

    def command(self, preset: str) -> str:
        """Return the command line that repeats it, without its folder."""
        more = [] if self.report else ["--no-report"]
        return shlex.join(["dsfab", "compare", *self.source.words(preset), *self.questions.words(), *more])


def compare_one(given: "Preset", task: Task, folder: Path, command: str, quiet: bool, as_json: bool) -> int:
    """Compare, write all files and print the result; return 1 if the design does not carry its loads, else 0."""
    reporter, asked = Reporter(quiet or as_json), task.questions
    files = ["results.csv", "results.json", *(("chart.svg", "chart.png") if len(asked.shares) > 1 else ())]
    with reporter:
        found = _compared(given, asked, reporter)
        subject = _findings(found, command) if task.report else None
        with whole_or_nothing(folder) as partial_folder:
            reporter("write", str(folder))
            document = write_results(given, found, command, partial_folder)
            if subject:
                reporter("report", "drawing and writing report.html and report.pdf")
                files = [*_reported(subject, found, partial_folder, reporter), *files]
    if as_json:
        out(document)
    elif not quiet:
        _say(found, subject, [folder / name for name in files])
    return int(any(share is None and one.design.judgement is None for share, one in found))


def _compared(preset: "Preset", asked: Questions, reporter: Reporter) -> list[Compared]:
    """Compare the design as it is, then at each share of the surface.

    A design without equilibrium raises DsfabError; with shares it is reported and left out.
    """
    from dsfab.design import draft
    from dsfab.statics import Ask
    from dsfab.study import compare_at
    from dsfab.study.comparison import Checks, comparison, judges

    design = draft(preset, reporter)
    ask = Ask(frequencies=int(asked.frequency), buckling=int(asked.buckling))
    checks, shares = Checks(asked.level, ask, 1e9 * asked.memory, reporter), asked.shares
    found: list[Compared] = []
    reporter("compare", "solving the design")
    try:
        own, rival, told = judges(design, asked.names, checks)
        if told:
            reporter.say(f"compare     {told} (--level full checks all)")
        beside = partial(reporter, "compare")
        compared = comparison(design, asked.names, own, beside, rival, bool(shares))
        found.append((None, compared.with_alternatives()))
    except DsfabError as error:
        if not shares:
            raise
        reporter.say(f"compare     the design as its preset draws it is left out: {error}")
    # a whole sheet on its coarse mesh would look a quarter too soft beside a cut sheet judged by one solve
    judge = checks.judge(asked.level or "whole")
    for share in shares:

        def progress(name: str, share: float = share) -> None:
            reporter("compare", f"{share:.0%} of the material: {name}")

        progress("the design")
        found.append((share, compare_at(design, share, asked.names, judge, progress)))
    return found


def _findings(found: list[Compared], command: str) -> "Findings":
    """Findings on the design as it is, or else at the largest share at which it carries its loads."""
    from dsfab.report.compliance import Findings

    volumes = [(share, one) for share, one in found if share is not None]
    drawn = [(share, one) for share, one in found if share is None]
    carrying = [(share, one) for share, one in reversed(found) if one.design.judgement]
    share, subject = (drawn or carrying or found[-1:])[0]
    return Findings(subject, volumes, command, share)


def _reported(subject: "Findings", found: list[Compared], folder: Path, reporter: Reporter) -> list[str]:
    from dsfab.report.compliance import write_report

    rows = [
        {"volume": share, **row} for share, one in found if share is not None for row in one.record()["competitors"]
    ]
    files, missing = write_report(subject, rows, folder)
    for told in missing:
        reporter.say(f"report      {told}")
    return files


def _say(found: list[Compared], subject: "Findings | None", files: list[Path]) -> None:

    out("\n\n".join(comparison_text(share, comparison) for share, comparison in found))
    if subject:
        from dsfab.report.compliance.verdict_words import one_line

        out(one_line(subject))
    out("\n".join(f"  {path}" for path in files))


FILES = ("summary.html", "summary.csv")

Row = dict[str, Any]
"""A line of the summary: `name`, `folder`, `error`; without an error also the results of the design.

These are `verdict`, `reason`, `mass_kg`, `area_fraction`, `compliance_J`, `bound`, `ratio_to_full` and `seconds`, and
`NAME_ratio` of each competitor: its compliance over the design's. None for unknown values.
"""


@dataclass(frozen=True)
class Batch:
    """Comparisons of several presets. output : folder of the summary and of a folder for each, None for
    outputs/compare.
    """

    task: Task
    output: Path | None

    def run(self, presets: Sequence[str], resume: bool, quiet: bool, as_json: bool) -> int:
        """Compare all and write the summary; return 1 if a preset was refused or does not carry its loads, else 0.

        A refused preset is reported in a sentence, and the next one follows.
        """
        reporter = Reporter(quiet or as_json)
        rows: list[Row] = []
        for count, preset in enumerate(presets, start=1):
            reporter.say(f"{count} of {len(presets)}: {preset}")
            row = self._row(preset, [row["folder"] for row in rows], resume, reporter)
            rows.append(row)
            reporter.say(f"{row['name']}: {row['error'] or row['verdict']}\n")
        folder = self.output or Path("outputs") / "compare"
        with whole_or_nothing(folder) as partial_folder:
            _write(rows, self.task.questions.names, folder, partial_folder)
        if as_json:
            out(json.dumps([row | {"folder": str(row["folder"] or "")} for row in rows], indent=2))
        elif not quiet:
            out("\n".join(f"  {folder / name}" for name in FILES))
        return int(any(row["error"] or row["verdict"] == "fail" for row in rows))

    def _row(self, preset: str, taken: Sequence[Path | None], resume: bool, reporter: Reporter) -> Row:
        name, command = Path(preset).stem, self.task.command(preset)
        try:
            given = self.task.source.read(preset)
            folder = self.output / given.name if self.output else Path("outputs") / given.name / "compliance"
            if folder in taken:
                raise DsfabError(f"a preset before it is called {given.name} too; change `name` in one of the files")
            name = given.name
            if not (resume and _made(folder, given, command, self.task.report)):
                compare_one(given, self.task, folder, command, quiet=True, as_json=False)
            else:
                reporter.say("compared already")
            return {"name": name, "folder": folder, "error": "", **_found(folder)}
        except DsfabError as error:
            return {"name": name, "folder": None, "error": str(error), "verdict": ""}


def _made(folder: Path, given: "Preset", command: str, report: bool) -> bool:
    """True if the folder has the results of this command, preset and version."""
    from dsfab.preset.file import preset_toml

    try:
        told = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    wanted = {"command": command, "preset": preset_toml(given), "versions": versions()}
    whole = not report or (folder / "report.html").exists()
    return whole and all(told.get(key) == value for key, value in wanted.items())


def _found(folder: Path) -> Row:
    told = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    rows = [row for row in told["competitors"] if row["volume"] is None] or told["competitors"]
    of = {row["name"]: row for row in rows}
    own = of.pop("design")
    keys = ("verdict", "reason", "mass_kg", "area_fraction", "compliance_J", "bound", "ratio_to_full")
    beside = {f"{name}_ratio": row["ratio_to_design"] for name, row in of.items() if name != "full"}
    return {key: own.get(key) for key in keys} | beside | {"seconds": sum(row["seconds"] for row in rows)}


def _write(rows: Sequence[Row], against: Sequence[str], folder: Path, partial_folder: Path) -> None:
    from dsfab.report.comparison_files import summary_page
    from dsfab.report.html_pages import page

    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(partial_folder / "summary.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    (partial_folder / "summary.html").write_text(page(summary_page(rows, against, folder)), encoding="utf-8")


ORDINARY, FULL_RESULTS = Questions(), Results()
"""Default options and files."""


def compare(
    preset: str,
    /,
    *more: str,
    source: Source = UNCHANGED,
    questions: Questions = ORDINARY,
    results: Results = FULL_RESULTS,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print results.json, no table.")] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer. Writes a report
    for an engineer (report.html, report.pdf), results.csv and results.json, and with --volumes a chart of compliance
    over mass. Several presets are compared in turn, also after an error, and summary.html has a line for each. The
    exit code is 1 if a design does not carry its loads.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    more
        Further presets.
    """
    _ = questions.names, questions.shares  # raises for wrong options before the preset is read
    task = Task(source, questions, results.report)
    if more or results.resume:
        return Batch(task, results.output).run((preset, *more), results.resume, quiet, json_)
    given = source.read(preset)
    folder = results.output or Path("outputs") / given.name / "compliance"
    require_writable(folder)
    return compare_one(given, task, folder, task.command(preset), quiet, json_)
