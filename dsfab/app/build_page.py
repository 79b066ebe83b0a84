"""The printed page of `dsfab build`."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import Quiet, Switch
from dsfab.app.terminal import Reporter, print_result
from dsfab.core.messages import byte_size, sentence

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.report.design.save import Announcements, SavedDesign
    from dsfab.study.carrying import Carrying

LINES = 25  # Number of lines that a build prints by default, for a small terminal.

USER_STAGES = ("surface", "statics")
"""Stages with important notes for the user, on how dsfab interpreted the surface and the loads. Notes of later stages
describe changes that make the structure buildable."""


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """Options for the printed output."""

    quiet: Quiet = False
    verbose: Annotated[
        bool, Switch(name=["--verbose", "-v"], help="Print every note, measure and step, with its time in seconds.")
    ] = False


USUAL = Output()


class BuildPage:
    """Printer of the results of a build. faulty : True if the design does not carry its loads."""

    def __init__(self, output: Output) -> None:
        self.output, self.faulty, self._count = output, False, 0
        self._know: list[str] = []

    def print_lines(self, lines: Iterable[str]) -> None:
        """Print lines, unless the build is quiet."""
        for line in lines:
            if not self.output.quiet:
                print_result(line)
            self._count += 1 + line.count("\n")

    def announcements(self, design: "Design", reporter: Reporter, picture: bool) -> "Announcements":
        """Return functions that print the verdict and the picture's path. picture : False if the build draws none."""
        from dsfab.report.design.save import Announcements

        def print_verdict(judged: "Carrying") -> None:
            reporter.done()
            self._print_verdict(design, judged)

        def print_picture(folder: Path) -> None:
            reporter.done()
            self.print_lines([f"picture is ready: {folder / 'preview.png'}"] if picture else [])
            sys.stdout.flush()

        return Announcements(print_verdict, print_picture)

    def _print_verdict(self, design: "Design", judged: "Carrying") -> None:
        from dsfab.report.design.carrying import carrying_notes, cure_line, figure_lines, verdict_line
        from dsfab.study import sizing_result

        name = design.preset.name
        self.faulty = judged.outcome == "does not carry"
        self.print_lines([verdict_line(name, judged)])
        if self.faulty:
            if self.output.quiet:  # a failed verdict is an error, and --quiet prints errors
                sys.stderr.write(f"dsfab: {verdict_line(name, judged)}\n")
            self.print_lines([f"you must act: {cure_line(judged, sizing_result(design) is not None)}"])
        self.print_lines(figure_lines(judged))
        self._know = [*carrying_notes(judged)]
        sys.stdout.flush()

    def print_rest(self, design: "Design", folder: Path, saved: "SavedDesign", refused: Sequence[str]) -> None:
        """Print support reactions, notes and the files. refused : a reason for each unwritten file."""
        from dsfab.render.design_picture import caption
        from dsfab.report.design.carrying import reaction_lines
        from dsfab.study import sizing_result

        facts, verbose = saved.facts, self.output.verbose
        self.print_lines([caption(design)] if verbose else [])
        if sizing := sizing_result(design):
            self.print_lines(sizing.lines(every=verbose))
        self.print_lines(reaction_lines(facts["carrying"]["reactions"], verbose))
        loses = [sentence(words)] if (words := facts.get("loses_to")) else []
        failed = [line for line in _fabrication_lines(facts) if "fail" in line or line.startswith("narrower")]
        know = [*loses, *refused, *self._know, *failed]
        know += [note.text for note in design.notes if note.stage in USER_STAGES]
        changes = [f"pattern: {facts['pattern']['summary']}"]
        changes += [note.text for note in design.notes if note.stage not in USER_STAGES]
        self._print_list("you should know", know, LINES - 5 - self._count)
        self._print_list("done for you", changes, LINES - 1 - self._count)
        if verbose:
            self.print_lines(_verbose_lines(design, saved))
        self.print_lines(_file_lines(folder, verbose))

    def _print_list(self, title: str, lines: Sequence[str], room: int) -> None:
        if not lines:
            return
        count = len(lines) if self.output.verbose or len(lines) < room else max(1, room - 2)
        self.print_lines([f"{title}:", *(f"  {line}" for line in lines[:count])])
        if rest := len(lines) - count:
            self.print_lines([f"  and {rest} more lines: see them with --verbose, or in design.json"])


def _fabrication_lines(facts: Mapping[str, Any]) -> list[str]:
    from dsfab.report.design.inspection import fabrication_lines

    return [*fabrication_lines(facts["fabrication"])]


def _verbose_lines(design: "Design", saved: "SavedDesign") -> list[str]:
    from dsfab.report.design.facts import alternative_lines, attempt_lines, choice_lines, mode_lines
    from dsfab.report.design.inspection import load_lines, quality_lines

    facts, solid, description = saved.facts, design.solid, design.preset.description
    pieces = "1 piece" if solid.pieces == 1 else f"{solid.pieces} pieces"
    closed = f"{len(solid.F):,} triangles, {solid.volume:.4g} m3, genus {solid.genus}, {pieces}, closed"
    choices = (*attempt_lines(design.pattern.attempts), *choice_lines(design.pattern.choice), *alternative_lines(facts))
    measures = (*quality_lines(facts["pattern"]), *_fabrication_lines(facts))
    exported = (f"export: {text}" for text in saved.messages)
    lines = (description, f"solid: {closed}", *load_lines(facts), *choices, *mode_lines(design), *measures, *exported)
    return [line for line in lines if line]


def _file_lines(folder: Path, verbose: bool) -> list[str]:
    files = sorted(path for path in folder.iterdir() if path.is_file())
    sizes = [path.stat().st_size for path in files]
    if verbose:
        return [f"  {path}  {byte_size(size)}" for path, size in zip(files, sizes, strict=True)]
    return [f"{len(files)} files in {folder}, {byte_size(sum(sizes))}: {', '.join(path.name for path in files)}"]
