"""The command `dsfab compare`, which compares a design with structures of the same mass."""

import csv
import json
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from dsfab.app.export import built_design
from dsfab.app.options import UNCHANGED, OutputName, Quiet, Source, Switch
from dsfab.app.terminal import ExitCode, Reporter, print_result
from dsfab.core.errors import DsfabError
from dsfab.core.messages import length, mass, sentence, table
from dsfab.core.messages import value_with_bound as bounded
from dsfab.export import atomic_folder, require_writable
from dsfab.report.compliance import summary_document, write_results
from dsfab.report.compliance.findings import percent, within
from dsfab.report.design.facts import versions
from dsfab.study import losing_line

if TYPE_CHECKING:
    from dsfab.design import Design
    from dsfab.preset.model import Preset
    from dsfab.report.compliance import Findings
    from dsfab.study import Comparison
    from dsfab.study.alternatives import Competitor


HEAD = (
    *("structure", "variant", "mass", "kept", "compliance", "level"),
    *("over full", "over design", "moves", "pieces", "s"),
)


def comparison_text(share: float | None, result: "Comparison") -> str:
    """Return a table of the compared structures, with notes, as text.
    share : fraction of the surface that is material (0 to 1), for a headline; None omits the headline."""
    losing_words = losing_line(result.alternatives)
    lines = [sentence(losing_words)] if losing_words else []
    lines += [] if share is None else [f"{share:.0%} of the material"]
    lines.append(table(HEAD, (_competitor_cells(entry, result) for entry in result.competitors if entry.judgement)))
    for entry in result.competitors:
        if entry.error:
            lines.append(f"{entry.name} does not carry the loads: {entry.error}")
        elif entry.spread:
            lines.append(_spread_line(entry, result))
    theories = {entry.name: entry.judgement.theory for entry in result.competitors if entry.judgement}
    if softer := [f"{name} by up to {percent(theory)}" for name, theory in theories.items() if theory]:
        lines.append(f"dsfab uses thin-shell theory: solids are softer than thin sheets ({', '.join(softer)})")
    lines += [line for entry in result.competitors for line in _mode_lines(entry)]
    for entry in result.rivals:
        gain = result.gain(entry.name)
        if entry.judgement and result.design.judgement:
            name = f"best {entry.name}" if entry.spread else entry.name
            lines.append(f"the design is {gain:.3g} x as stiff as the {name} structure of the same mass")
    return "\n".join(lines)


def _mode_lines(competitor: "Competitor") -> list[str]:
    cases = list(competitor.judgement.cases.values()) if competitor.judgement else []
    buckling_cases = [case for case in cases if case.buckling is not None]
    words = []

    def as_solid(power: float) -> str:
        loss = competitor.judgement.solid_loss(power) if competitor.judgement else 0.0
        return f", about {percent(loss)} less as a solid" if loss else ""

    if buckling_cases:
        lowest = min(buckling_cases, key=lambda case: case.buckling or 0.0)
        local = f" ({lowest.local})" if lowest.local else ""
        words.append(
            f"buckles at {bounded(lowest.buckling or 0.0, lowest.buckling_bound)} x the load{as_solid(1)}{local}"
        )
    if vibrating := [case for case in cases if case.frequency is not None]:
        hertz = bounded(vibrating[0].frequency or 0.0, vibrating[0].frequency_bound, "Hz")
        words.append(f"swings at {hertz}{as_solid(0.5)}")
    assumed = next((f" ({case.assumed})" for case in cases if case.assumed), "")
    refused = list(dict.fromkeys(text for case in cases for text in case.refusals))
    lines = [f"{competitor.name} {' and '.join(words)}{assumed}"] if words else []
    return lines + [f"{competitor.name}: {text}" for text in refused]


def _competitor_cells(competitor: "Competitor", result: "Comparison") -> tuple[str, ...]:
    gain = result.gain(competitor.name)
    displacement = competitor.judgement.worst("displacement").value if competitor.judgement else float("nan")
    return (
        competitor.name,
        competitor.variant,
        mass(competitor.mass),
        f"{competitor.area_fraction:.1%}",
        within(competitor.compliance, competitor.judgement.bound if competitor.judgement else None, "J"),
        competitor.judgement.level if competitor.judgement else "",
        f"{competitor.compliance / result.full.compliance:.2f}",
        f"{gain:.2f}" if result.design.judgement else "-",
        length(displacement),
        str(competitor.pieces),
        f"{competitor.seconds:.1f}",
    )


def _spread_line(competitor: "Competitor", result: "Comparison") -> str:
    spread, full = competitor.spread, result.full.compliance
    assert spread is not None
    best, worst, mean = (f"{value / full:.3g}" for value in (spread.best, spread.worst, spread.mean))
    words = f"{competitor.name}: {spread.carried} of {spread.tried} variants carry the loads"
    return f"{words}; their compliance is {best} to {worst} times that of the full sheet, {mean} times on average"


ComparisonAtShare = tuple[float | None, "Comparison"]  # Share of material, None for the design's own share.


@Parameter(name="*")
@dataclass(frozen=True)
class Questions:
    """Options of a comparison."""

    against: Annotated[
        str | None,
        Parameter(help="Competitors (list): isotropic, rotated, thinner, von_mises, grid, simp [isotropic,thinner]."),
    ] = None
    volumes: Annotated[
        str | None,
        Parameter(
            help="Also compare designs that keep other shares of the surface as material: "
            "LOW:HIGH:COUNT, such as 0.2:0.8:7."
        ),
    ] = None
    level: Annotated[
        Literal["quick", "full"] | None,
        Parameter(
            help="quick: solve each structure once. full: solve finer and finer meshes, and bound the error of the "
            "compliance. The default is full; with --volumes it is quick. If all full checks would take over a minute, "
            "the default for competitors with openings is quick."
        ),
    ] = None
    buckling: Annotated[bool, Switch(help="Also compute the lowest buckling factor of each compared structure.")] = (
        False
    )
    frequency: Annotated[bool, Switch(help="Also compute the lowest natural frequency of each compared structure.")] = (
        False
    )
    memory: Annotated[float, Parameter(help="Memory in GB that the solver may use for a full check.")] = 4.0

    @property
    def competitor_names(self) -> tuple[str, ...]:
        """Names of the structures to compare with the design. Raises DsfabError for an unknown name."""
        from dsfab.study.baselines import DEFAULT, baselines_by_name

        words = () if self.against is None else tuple(self.against.split(","))
        names = DEFAULT if self.against is None else tuple(word.strip() for word in words if word.strip())
        baselines_by_name(names)
        return names

    @property
    def area_shares(self) -> list[float]:
        """Fractions of material (0 to 1) to compare. Raises DsfabError if `volumes` is not LOW:HIGH:COUNT."""
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
        """Return these options as words of a command line."""
        options = {"against": self.against, "volumes": self.volumes, "level": self.level}
        options |= {"memory": str(self.memory) if self.memory != Questions.memory else None}
        words = [word for name, value in options.items() if value is not None for word in (f"--{name}", value)]
        flags = {"buckling": self.buckling, "frequency": self.frequency}
        return words + [f"--{name}" for name, is_set in flags.items() if is_set]


@Parameter(name="*")
@dataclass(frozen=True)
class Results:
    """Options for the results of a comparison."""

    output: Annotated[
        Path | None,
        OutputName(help="Folder for the results [outputs/NAME/compliance]; several presets get a subfolder each."),
    ] = None
    resume: Annotated[bool, Switch(help="Skip presets that the same command has compared already.")] = False
    report: Annotated[bool, Parameter(help="Also write report.html and report.pdf.")] = True


@dataclass(frozen=True)
class CompareTask:
    """Options of a comparison, and changes of the preset."""

    source: Source
    questions: Questions
    report: bool

    def command(self, preset: str) -> str:
        """Return the command line that repeats the comparison."""
        words = [*self.source.command_words(preset), *self.questions.words()]
        return shlex.join(["dsfab", "compare", *words, *([] if self.report else ["--no-report"])])


def compare_one(preset: "Preset", task: CompareTask, folder: Path, name: str, quiet: bool, as_json: bool) -> int:
    """Compare the design of a preset, and write all files into `folder`. name : preset on the command line.
    Return the exit code: 5 if the design does not carry its loads, else 0."""
    from dsfab.design import draft

    reporter, questions, command = Reporter(quiet or as_json), task.questions, task.command(name)
    files = ["results.csv", "results.json", *(("chart.svg", "chart.png") if len(questions.area_shares) > 1 else ())]
    with reporter:
        design = built_design(name, preset) or draft(preset, reporter)
        checks_folder = folder.with_name(f"{folder.name}.checks")
        comparisons = _comparisons(design, questions, reporter, checks_folder)
        findings = _report_findings(comparisons, command) if task.report else None
        with atomic_folder(folder) as partial_folder:
            reporter("write", str(folder))
            document = write_results(preset, comparisons, command, partial_folder)
            if findings:
                reporter("report", "drawing and writing report.html and report.pdf")
                files = [*_write_report(findings, comparisons, partial_folder, reporter), *files]
        shutil.rmtree(checks_folder, ignore_errors=True)
    if as_json:
        print_result(document)
    elif not quiet:
        _print_results(comparisons, findings, [folder / name for name in files])
    lost = any(share is None and compared.design.judgement is None for share, compared in comparisons)
    return ExitCode.DOES_NOT_CARRY if lost else ExitCode.DONE


def _comparisons(
    design: "Design", questions: Questions, reporter: Reporter, checks_folder: Path
) -> list[ComparisonAtShare]:
    from dsfab.statics import ResultRequest
    from dsfab.study import compare_at
    from dsfab.study.comparison import Checks, comparison, judges
    from dsfab.study.kept_checks import KeptChecks

    mode_questions = ResultRequest(frequencies=int(questions.frequency), buckling=int(questions.buckling))
    checks, shares = Checks(questions.level, mode_questions, 1e9 * questions.memory, reporter), questions.area_shares
    results: list[ComparisonAtShare] = []
    reused = partial(reporter, "compare", "using a finished check of the interrupted comparison again")
    store = KeptChecks(checks_folder, shlex.join(replace(questions, against=None, volumes=None).words()), reused)
    reporter("compare", "solving the design")
    try:
        design_judge, rival_judge, level_note = judges(design, questions.competitor_names, checks)
        if level_note:
            reporter.print_line(f"compare     {level_note} (--level full makes full checks of all structures)")
        report_progress = partial(reporter, "compare")
        design_check = store.keeping(design_judge, every=True)
        rival = replace(store, options=store.options + level_note).keeping(rival_judge)
        compared = comparison(design, questions.competitor_names, design_check, report_progress, rival, bool(shares))
        results.append((None, compared.with_alternatives()))
    except DsfabError as error:
        if not shares:
            raise
        reporter.print_line(f"compare     dsfab cannot compare at the design's own share of material: {error}")
    # `whole` uses several meshes, because a single coarse mesh makes uncut sheets 25 % too soft
    judge = store.keeping(checks.judge(questions.level or "whole"), every=False)
    for share in shares:

        def progress(name: str, share: float = share) -> None:
            reporter("compare", f"{share:.0%} of the material: {name}")

        progress("the design")
        results.append((share, compare_at(design, share, questions.competitor_names, judge, progress)))
    return results


def _report_findings(comparisons: list[ComparisonAtShare], command: str) -> "Findings":
    from dsfab.report.compliance import Findings

    volumes = [(share, compared) for share, compared in comparisons if share is not None]
    as_drawn = [(share, compared) for share, compared in comparisons if share is None]
    carrying = [(share, compared) for share, compared in reversed(comparisons) if compared.design.judgement]
    share, subject = (as_drawn or carrying or comparisons[-1:])[0]
    return Findings(subject, volumes, command, share)


def _write_report(
    findings: "Findings", comparisons: list[ComparisonAtShare], folder: Path, reporter: Reporter
) -> list[str]:
    from dsfab.report.compliance import write_report

    rows = [
        {"volume": share, **row}
        for share, compared in comparisons
        if share is not None
        for row in compared.record()["competitors"]
    ]
    files, missing = write_report(findings, rows, folder)
    for message in missing:
        reporter.print_line(f"report      {message}")
    return files


def _print_results(comparisons: list[ComparisonAtShare], findings: "Findings | None", files: list[Path]) -> None:
    print_result("\n\n".join(comparison_text(share, comparison) for share, comparison in comparisons))
    if findings:
        from dsfab.report.compliance.verdict_words import verdict_line

        print_result(verdict_line(findings))
    print_result("\n".join(f"  {path}" for path in files))


FILES = ("summary.html", "summary.csv")

SummaryRow = dict[str, Any]
"""Row of the summary: `name`, `folder` and `error`. A row without an error also has results, None if unknown:
`verdict`, `reason`, `mass_kg`, `area_fraction`, `compliance_J`, `bound`, `ratio_to_full`, `seconds`.
`NAME_ratio` is the compliance of a competitor, divided by the design's."""


@dataclass(frozen=True)
class Batch:
    """Comparisons of several presets. output : folder of all results, or None."""

    task: CompareTask
    output: Path | None

    def run(self, presets: Sequence[str], resume: bool, quiet: bool, as_json: bool) -> int:
        """Compare all presets and write the summary.
        Return the exit code: 4 if a preset is invalid, else 5 if a design does not carry its loads, else 0."""
        reporter = Reporter(quiet or as_json)
        rows: list[SummaryRow] = []
        for count, preset in enumerate(presets, start=1):
            reporter.print_line(f"{count} of {len(presets)}: {preset}")
            row = self._row(preset, [row["folder"] for row in rows], resume, reporter)
            rows.append(row)
            reporter.print_line(f"{row['name']}: {row['error'] or row['verdict']}\n")
        folder = self.output or Path("outputs") / "compare"
        with atomic_folder(folder) as partial_folder:
            _write_summary(rows, self.task.questions.competitor_names, folder, partial_folder)
        if as_json:
            print_result(json.dumps([row | {"folder": str(row["folder"] or "")} for row in rows], indent=2))
        elif not quiet:
            print_result("\n".join(f"  {folder / name}" for name in FILES))
        if any(row["error"] for row in rows):
            return ExitCode.NOT_MADE
        return ExitCode.DOES_NOT_CARRY if any(row["verdict"] == "fail" for row in rows) else ExitCode.DONE

    def _row(self, preset: str, taken: Sequence[Path | None], resume: bool, reporter: Reporter) -> SummaryRow:
        name, command = Path(preset).stem, self.task.command(preset)
        try:
            loaded = self.task.source.read_preset(preset)
            folder = self.output / loaded.name if self.output else Path("outputs") / loaded.name / "compliance"
            if folder in taken:
                raise DsfabError(
                    f"two presets have the name {loaded.name}; change the key `name` in one of the preset files"
                )
            name = loaded.name
            if not (resume and _is_current(folder, loaded, command, self.task.report)):
                compare_one(loaded, self.task, folder, preset, quiet=True, as_json=False)
            else:
                reporter.print_line("compared already")
            return {"name": name, "folder": folder, "error": "", **_row_of_folder(folder)}
        except DsfabError as error:
            return {"name": name, "folder": None, "error": str(error), "verdict": ""}


def _is_current(folder: Path, preset: "Preset", command: str, report: bool) -> bool:
    from dsfab.preset.file import preset_toml

    try:
        earlier = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    expected = {"command": command, "preset": preset_toml(preset), "versions": versions()}
    has_report = not report or (folder / "report.html").exists()
    return has_report and all(earlier.get(key) == value for key, value in expected.items())


def _row_of_folder(folder: Path) -> SummaryRow:
    results = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    rows = [row for row in results["competitors"] if row["volume"] is None] or results["competitors"]
    row_by_name = {row["name"]: row for row in rows}
    design_row = row_by_name.pop("design")
    keys = ("verdict", "reason", "mass_kg", "area_fraction", "compliance_J", "bound", "ratio_to_full")
    ratios = {f"{name}_ratio": row["ratio_to_design"] for name, row in row_by_name.items() if name != "full"}
    return {key: design_row.get(key) for key in keys} | ratios | {"seconds": sum(row["seconds"] for row in rows)}


def _write_summary(rows: Sequence[SummaryRow], against: Sequence[str], folder: Path, partial_folder: Path) -> None:
    from dsfab.report.html_pages import document_html

    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(partial_folder / "summary.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    page = document_html(summary_document(rows, against, folder))
    (partial_folder / "summary.html").write_text(page, encoding="utf-8")


DEFAULT_QUESTIONS, FULL_RESULTS = Questions(), Results()  # Default options.


def compare(
    preset: str,
    /,
    *more: str,
    source: Source = UNCHANGED,
    questions: Questions = DEFAULT_QUESTIONS,
    results: Results = FULL_RESULTS,
    json_: Annotated[
        bool, Switch(name="--json", help="Print the contents of results.json in place of the table.")
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each design is solved on its own cut mesh under the same loads. The stiffest design has the smallest compliance.
    The results are report.html, report.pdf, results.csv and results.json, and with --volumes a chart of compliance.
    Several presets also give a summary.html. The exit code is 5 if a design does not carry its loads.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    more
        Further presets."""
    _ = questions.competitor_names, questions.area_shares  # invalid options raise errors before the preset is read
    task = CompareTask(source, questions, results.report)
    if more or results.resume:
        return Batch(task, results.output).run((preset, *more), results.resume, quiet, json_)
    loaded_preset = source.read_preset(preset)
    folder = results.output or Path("outputs") / loaded_preset.name / "compliance"
    require_writable(folder)
    return compare_one(loaded_preset, task, folder, preset, quiet, json_)
