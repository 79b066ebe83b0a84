"""One comparison of `dsfab compare`: what is asked, the judges that answer, and the files with what they find."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dsfab.app.compare_files import write_results
from dsfab.app.folder import whole_or_nothing
from dsfab.app.report import Reporter, out
from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from dsfab.app.compliance import Findings
    from dsfab.preset import Preset
    from dsfab.study import Comparison
    from dsfab.study.baselines import Brief, Structure
    from dsfab.study.judging import Judge, Judgement
    from dsfab.study.sweeps.making import Making

PATIENCE = 60.0
"""Seconds that full checks may take in all where no level is asked for."""

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
    from dsfab.study import compare as compared
    from dsfab.study import compare_at
    from dsfab.study.sweeps.making import Making

    making = Making(draft(preset, reporter))
    found: list[Compared] = []
    reporter("compare", "solving the design")
    try:
        own, rival = _judges(making, asked, reporter)
        beside = partial(reporter, "compare")
        found.append((None, compared(making, asked.against, own, beside, rival, bool(asked.shares))))
    except DsfabError as error:
        if not asked.shares:
            raise
        reporter.say(f"compare     the design as its preset draws it is left out: {error}")
    # beside a cut sheet judged by one solve, a whole one on its own coarse mesh would look a quarter too soft, or more
    judge = _judge(asked.level or "whole", asked, reporter)
    for share in asked.shares:
        reporter("compare", f"{share:.0%} of the material: the design")
        told = lambda name, share=share: reporter("compare", f"{share:.0%} of the material: {name}")  # noqa: E731
        found.append((share, compare_at(making.draft, share, asked.against, judge, told)))
    return found


def _judges(making: "Making", asked: Asked, reporter: Reporter) -> "tuple[Judge, Judge]":
    """Of the design, each case, and of its competitors; says where these are judged by one solve only."""
    from dsfab.statics import flat_axis
    from dsfab.study.full_check import seconds_needed

    made = making.draft
    if asked.level is None and _cuts(making):
        plane = flat_axis(made.surface, *(case.load for case in made.statics.cases.values())) is not None
        whole = 1 + ("thinner" in asked.against)
        triangles = whole * made.surface.m + (2 + len(asked.against) - whole) * making.sheet.surface.m
        seconds = seconds_needed(triangles, plane)
        if seconds > PATIENCE:
            told = f"full checks of all would take about {seconds:.0f} s: those that are cut are judged by one solve"
            reporter.say(f"compare     {told} (--level full checks all)")
            return _judge("full", asked, reporter, True), _judge("whole", asked, reporter)
    depth = asked.level or "full"
    return _judge(depth, asked, reporter, True), _judge(depth, asked, reporter)


def _cuts(making: "Making") -> bool:
    """Whether its pattern can be cut at all."""
    try:
        return bool(making.sheet)
    except DsfabError:
        return False


def _judge(depth: str, asked: Asked, reporter: Reporter, every: bool = False) -> "Judge":
    """depth : quick, full, or whole: full for whole sheets, on whose meshes one solve is far off, quick for others.
    every : whether all cases are judged.
    """
    from dsfab.statics import Ask
    from dsfab.study.full_check import full
    from dsfab.study.judging import quick

    ask = Ask(frequencies=int(asked.frequency), buckling=int(asked.buckling))
    if depth == "whole":
        return _full_for_whole_sheets(_judge("full", asked, reporter), _judge("quick", asked, reporter))
    if depth == "full":
        return partial(full, ask=ask, every=every, budget=asked.memory, progress=reporter)
    return partial(quick, ask=ask, every=every) if ask or every else quick


def _full_for_whole_sheets(whole: "Judge", cut: "Judge") -> "Judge":
    """`whole` for what is not cut, once for each thickness, and `cut` for the rest."""
    known: dict[float, Judgement] = {}

    def judge(brief: "Brief", made: "Structure") -> "Judgement":
        if made.cells is not made.sheet:
            return cut(brief, made)
        if made.thickness not in known:
            known[made.thickness] = whole(brief, made)
        return known[made.thickness]

    return judge


def _findings(found: list[Compared], command: str) -> "Findings":
    """What the report is about: the design as it is, or else at the largest share at which it carries its loads."""
    from dsfab.app.compliance import Findings

    volumes = [(share, one) for share, one in found if share is not None]
    drawn = [(share, one) for share, one in found if share is None]
    carrying = [(share, one) for share, one in reversed(found) if one.design.judgement]
    share, subject = (drawn or carrying or found[-1:])[0]
    return Findings(subject, volumes, command, share)


def _reported(subject: "Findings", found: list[Compared], folder: Path, reporter: Reporter) -> list[str]:
    """Write the report; returns the names of its files, and says what could not be done."""
    from dsfab.app.compliance import write_report

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
        from dsfab.app.compliance.verdict_words import one_line

        out(one_line(subject))
    out("\n".join(f"  {path}" for path in files))
