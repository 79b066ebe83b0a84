"""One comparison of `dsfab compare`: what is asked, the judges that answer, and the files with what they find."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dsfab.app.terminal import Reporter, out
from dsfab.errors import DsfabError
from dsfab.export.folder import whole_or_nothing
from dsfab.report.comparison_files import write_results

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.report.compliance import Findings
    from dsfab.study import Comparison

Compared = tuple[float | None, "Comparison"]
"""A share of the surface, None for the design as it is, and the comparison there."""


@dataclass(frozen=True)
class Asked:
    """What is asked of a comparison.

    against : names of competitors.     shares : of the surface, at which all are compared too.
    level   : quick, full or None.      buckling, frequency : whether they are wanted.
    memory  : bytes that a full check may take.                report : whether report.html and report.pdf are written.
    """

    against: tuple[str, ...]
    shares: Sequence[float] = ()
    level: str | None = None
    buckling: bool = False
    frequency: bool = False
    memory: float = 4e9
    report: bool = True


def compare_one(given: "Preset", asked: Asked, folder: Path, command: str, quiet: bool, as_json: bool) -> int:
    """Compare, write everything into the folder and say it; 1 where the design does not carry its loads, else 0."""
    reporter = Reporter(quiet or as_json)
    files = ["results.csv", "results.json", *(("chart.svg", "chart.png") if len(asked.shares) > 1 else ())]
    try:
        found = _compared(given, asked, reporter)
        subject = _findings(found, command) if asked.report else None
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


def _compared(preset: "Preset", asked: Asked, reporter: Reporter) -> list[Compared]:
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
    checks = Checks(asked.level, ask, asked.memory, reporter)
    found: list[Compared] = []
    reporter("compare", "solving the design")
    try:
        own, rival, told = judges(design, asked.against, checks)
        if told:
            reporter.say(f"compare     {told} (--level full checks all)")
        beside = partial(reporter, "compare")
        found.append((None, comparison(design, asked.against, own, beside, rival, bool(asked.shares))))
    except DsfabError as error:
        if not asked.shares:
            raise
        reporter.say(f"compare     the design as its preset draws it is left out: {error}")
    # beside a cut sheet judged by one solve, a whole one on its own coarse mesh would look a quarter too soft, or more
    judge = checks.judge(asked.level or "whole")
    for share in asked.shares:
        reporter("compare", f"{share:.0%} of the material: the design")
        doing = lambda name, share=share: reporter("compare", f"{share:.0%} of the material: {name}")  # noqa: E731
        found.append((share, compare_at(design, share, asked.against, judge, doing)))
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
