"""`dsfab compare`: a design against others of the same mass under the same loads."""

import shlex
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from cyclopts import Parameter

from dsfab.app.build import Mesh, Quiet, Set, Unit, read_preset
from dsfab.app.compare_files import write_results
from dsfab.app.folder import whole_or_nothing
from dsfab.app.report import Reporter, out
from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from dsfab.app.compliance import Findings
    from dsfab.preset import Preset
    from dsfab.study import Comparison
    from dsfab.study.judging import Judge
    from dsfab.study.sweeps.making import Making

PATIENCE = 60.0
"""Seconds that full checks may take in all where no level is asked for."""

Compared = tuple[float | None, "Comparison"]
"""A share of the surface, None for the design as it is, and the comparison there."""


def compare(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    against: Annotated[
        str | None,
        Parameter(help="Comma list: isotropic, rotated, thinner, von_mises, grid, simp [isotropic,thinner]."),
    ] = None,
    volumes: Annotated[
        str | None,
        Parameter(help="LOW:HIGH:COUNT shares of the surface, such as 0.2:0.8:7: compare at each of them too."),
    ] = None,
    level: Annotated[
        Literal["quick", "full"] | None,
        Parameter(
            help="quick: one solve each. full: finer and finer meshes, for a compliance with a tested bound [full for "
            "the design, and for the best of each competitor if all take less than a minute; quick for --volumes]."
        ),
    ] = None,
    buckling: Annotated[bool, Parameter(negative=(), help="Also the lowest load factor of each.")] = False,
    frequency: Annotated[bool, Parameter(negative=(), help="Also the lowest natural frequency of each.")] = False,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the results [outputs/NAME/compliance].")
    ] = None,
    report: Annotated[bool, Parameter(help="Also write report.html and report.pdf.")] = True,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print results.json, no table.")] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer. Writes a report
    for an engineer (report.html, report.pdf), results.csv and results.json, and with --volumes a chart of compliance
    over mass.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.study.baselines import DEFAULT, chosen

    names = DEFAULT if against is None else tuple(word.strip() for word in against.split(",") if word.strip())
    chosen(names)
    shares = shares_of(volumes)
    given = read_preset(preset, set_, mesh, unit)
    folder = output if output is not None else Path("outputs") / given.name / "compliance"
    options = {"mesh": mesh, "unit": unit, "against": against, "volumes": volumes, "level": level}
    command = _command(preset, set_, options, {"buckling": buckling, "frequency": frequency})
    reporter = Reporter(quiet or json_)
    files = ["results.csv", "results.json", *(("chart.svg", "chart.png") if len(shares) > 1 else ())]
    try:
        found = _compared(given, names, shares, level, (buckling, frequency), reporter)
        subject = _findings(found, command) if report else None
        with whole_or_nothing(folder) as partial_folder:
            reporter("write", str(folder))
            document = write_results(given, found, partial_folder)
            if subject:
                reporter("report", "drawing and writing report.html and report.pdf")
                files = [*_reported(subject, found, partial_folder, reporter), *files]
        reporter.done()
    finally:
        reporter.stop()
    if json_:
        out(document)
    elif not quiet:
        _say(found, subject, [folder / name for name in files])
    return int(any(share is None and one.design.judgement is None for share, one in found))


def _command(preset: str, set_: tuple[str, ...], options: Mapping[str, object], flags: dict[str, bool]) -> str:
    """The command line that makes the same again, wherever it writes."""
    words = ["dsfab", "compare", preset, *(word for text in set_ for word in ("--set", text))]
    words += [word for name, value in options.items() if value is not None for word in (f"--{name}", str(value))]
    return shlex.join([*words, *(f"--{name}" for name, asked in flags.items() if asked)])


def shares_of(text: str | None) -> list[float]:
    """'0.2:0.8:7' -> seven shares; none for None. Raises DsfabError for anything else."""
    if text is None:
        return []
    try:
        low, high, count = text.split(":")
        shares = [round(float(share), 6) for share in np.linspace(float(low), float(high), int(count))]
    except ValueError:
        shares = []
    if not shares or not (min(shares) > 0 and max(shares) < 1):
        raise DsfabError(
            f"--volumes {text!r} is not LOW:HIGH:COUNT with shares between 0 and 1; write for instance 0.2:0.8:7"
        )
    return shares


def _compared(
    preset: "Preset",
    names: tuple[str, ...],
    shares: list[float],
    level: str | None,
    asked: tuple[bool, bool],
    reporter: Reporter,
) -> list[Compared]:
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
        own, rival = _judges(making, names, level, asked, reporter)
        beside = partial(reporter, "compare")
        found.append((None, compared(making, names, own, beside, rival, bool(shares))))
    except DsfabError as error:
        if not shares:
            raise
        reporter.say(f"compare     the design as its preset draws it is left out: {error}")
    judge = _judge("full" if level == "full" else "quick", asked, reporter)
    for share in shares:
        reporter("compare", f"{share:.0%} of the material: the design")
        told = lambda name, share=share: reporter("compare", f"{share:.0%} of the material: {name}")  # noqa: E731
        found.append((share, compare_at(making.draft, share, names, judge, told)))
    return found


def _judges(
    making: "Making", names: tuple[str, ...], level: str | None, asked: tuple[bool, bool], reporter: Reporter
) -> "tuple[Judge, Judge]":
    """Of the design, each case, and of its competitors; says where these are judged by one solve only."""
    from dsfab.statics import flat_axis
    from dsfab.study.full_check import seconds_needed

    made = making.draft
    if level is None and _cuts(making):
        plane = flat_axis(made.surface, *(case.load for case in made.statics.cases.values())) is not None
        whole = 1 + ("thinner" in names)
        triangles = whole * made.surface.m + (2 + len(names) - whole) * making.sheet.surface.m
        seconds = seconds_needed(triangles, plane)
        if seconds > PATIENCE:
            told = f"full checks of all would take about {seconds:.0f} s: those that are cut are judged by one solve"
            reporter.say(f"compare     {told} (--level full checks all)")
            return _judge("full", asked, reporter, True), _judge("whole", asked, reporter)
    depth = level or "full"
    return _judge(depth, asked, reporter, True), _judge(depth, asked, reporter)


def _cuts(making: "Making") -> bool:
    """Whether its pattern can be cut at all."""
    try:
        return bool(making.sheet)
    except DsfabError:
        return False


def _judge(depth: str, asked: tuple[bool, bool], reporter: Reporter, every: bool = False) -> "Judge":
    """depth : quick, full, or whole: full for whole sheets, on whose meshes one solve is far off, quick for others.
    asked : for buckling, and for the frequency.      every : whether all cases are judged.
    """
    from dsfab.statics import Ask
    from dsfab.study.full_check import full
    from dsfab.study.judging import quick

    with_buckling, with_frequency = asked
    ask = Ask(frequencies=int(with_frequency), buckling=int(with_buckling))
    if depth == "whole":
        whole, cut = _judge("full", asked, reporter), _judge("quick", asked, reporter)
        return lambda brief, made: (whole if made.cells is made.sheet else cut)(brief, made)
    if depth == "full":
        return partial(full, ask=ask, every=every, progress=reporter)
    return partial(quick, ask=ask, every=every) if ask or every else quick


def _findings(found: list[Compared], command: str) -> "Findings":
    """What the report is about: the design as it is, or else at the largest share at which it carries its loads."""
    from dsfab.app.compliance import Findings

    volumes = [(share, one) for share, one in found if share is not None]
    asked = [(share, one) for share, one in found if share is None]
    carrying = [(share, one) for share, one in reversed(found) if one.design.judgement]
    share, subject = (asked or carrying or found[-1:])[0]
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
