"""One comparison of `dsfab compare`: what is asked, the judges that answer, and the files with what they find."""

import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from dsfab.app.options import Source
from dsfab.app.terminal import Reporter, out
from dsfab.errors import DsfabError
from dsfab.export import whole_or_nothing
from dsfab.report.comparison_files import write_results

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.report.compliance import Findings
    from dsfab.study import Comparison

Compared = tuple[float | None, "Comparison"]
"""A share of the surface, None for the design as it is, and the comparison there."""


@Parameter(name="*")
@dataclass(frozen=True)
class Questions:
    """What is asked of a comparison."""

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
        """Of the competitors. Raises DsfabError for one that there is not."""
        from dsfab.study.baselines import DEFAULT, chosen

        words = () if self.against is None else tuple(self.against.split(","))
        names = DEFAULT if self.against is None else tuple(word.strip() for word in words if word.strip())
        chosen(names)
        return names

    @property
    def shares(self) -> list[float]:
        """Of the surface, at which all are compared too: '0.2:0.8:7' are seven. Raises DsfabError for no such text."""
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
        """The words of a command line that asks the same."""
        options = {"against": self.against, "volumes": self.volumes, "level": self.level}
        options |= {"memory": str(self.memory) if self.memory != Questions.memory else None}
        words = [word for name, value in options.items() if value is not None for word in (f"--{name}", value)]
        flags = {"buckling": self.buckling, "frequency": self.frequency}
        return words + [f"--{name}" for name, asked in flags.items() if asked]


@Parameter(name="*")
@dataclass(frozen=True)
class Results:
    """Where a comparison is written, and what of it."""

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
    """What is compared, and how: the preset as the command line changes it, and what is asked of it."""

    source: Source
    questions: Questions
    report: bool

    def command(self, preset: str) -> str:
        """The command line that makes the same again, wherever it writes."""
        more = [] if self.report else ["--no-report"]
        return shlex.join(["dsfab", "compare", *self.source.words(preset), *self.questions.words(), *more])


def compare_one(given: "Preset", task: Task, folder: Path, command: str, quiet: bool, as_json: bool) -> int:
    """Compare, write everything into the folder and say it; 1 where the design does not carry its loads, else 0."""
    reporter, asked = Reporter(quiet or as_json), task.questions
    files = ["results.csv", "results.json", *(("chart.svg", "chart.png") if len(asked.shares) > 1 else ())]
    try:
        found = _compared(given, asked, reporter)
        subject = _findings(found, command) if task.report else None
        with whole_or_nothing(folder) as partial_folder:
            reporter("write", str(folder))
            document = write_results(given, found, command, partial_folder)
            if subject:
                reporter("report", "drawing and writing report.html and report.pdf")
                files = [*_reported(subject, found, partial_folder, reporter), *files]
        reporter.done()
    finally:
        reporter.stop()
    if as_json:
        out(document)
    elif not quiet:
        _say(found, subject, [folder / name for name in files])
    return int(any(share is None and one.design.judgement is None for share, one in found))


def _compared(preset: "Preset", asked: Questions, reporter: Reporter) -> list[Compared]:
    """The comparison of the design as it is, then those at each share of the surface.

    A design that does not carry its loads is told as an error of it; with shares it is left out, and they are made.
    """
    from dsfab.pipeline import draft
    from dsfab.statics import Ask
    from dsfab.study import compare_at
    from dsfab.study.comparison import comparison
    from dsfab.study.judges import Checks, judges

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
    # beside a cut sheet judged by one solve, a whole one on its own coarse mesh would look a quarter too soft, or more
    judge = checks.judge(asked.level or "whole")
    for share in shares:

        def progress(name: str, share: float = share) -> None:
            reporter("compare", f"{share:.0%} of the material: {name}")

        progress("the design")
        found.append((share, compare_at(design, share, asked.names, judge, progress)))
    return found


def _findings(found: list[Compared], command: str) -> "Findings":
    """What the report is about: the design as it is, or else at the largest share at which it carries its loads."""
    from dsfab.report.compliance import Findings

    volumes = [(share, one) for share, one in found if share is not None]
    drawn = [(share, one) for share, one in found if share is None]
    carrying = [(share, one) for share, one in reversed(found) if one.design.judgement]
    share, subject = (drawn or carrying or found[-1:])[0]
    return Findings(subject, volumes, command, share)


def _reported(subject: "Findings", found: list[Compared], folder: Path, reporter: Reporter) -> list[str]:
    """Write the report; returns the names of its files, and says what could not be done."""
    from dsfab.report.compliance import write_report

    rows = [
        {"volume": share, **row} for share, one in found if share is not None for row in one.record()["competitors"]
    ]
    files, missing = write_report(subject, rows, folder)
    for told in missing:
        reporter.say(f"report      {told}")
    return files


def _say(found: list[Compared], subject: "Findings | None", files: list[Path]) -> None:
    from dsfab.app.compare_text import comparison_text

    out("\n\n".join(comparison_text(share, comparison) for share, comparison in found))
    if subject:
        from dsfab.report.compliance.verdict_words import one_line

        out(one_line(subject))
    out("\n".join(f"  {path}" for path in files))
