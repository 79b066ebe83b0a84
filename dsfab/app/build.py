"""The command `dsfab build`: from a preset to a folder of files."""

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.export import ALIASES, CALCULIX, CALCULIX_SUFFIX, format_suffix
from dsfab.app.options import NO_FLAGS, UNCHANGED, Quiet, Source, StepFlags, estimate_step
from dsfab.app.terminal import Reporter, print_lines, print_result
from dsfab.core.errors import ExportError
from dsfab.core.messages import byte_size, sentence

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.preset.model import Export, Preset


@Parameter(name="*")
@dataclass(frozen=True)
class Files:
    """Folder and formats of a build, and permission to write a faulty design."""

    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME].")] = (
        None
    )
    format_: Annotated[
        str | None, Parameter(name=["--format", "-f"], help="Formats with commas; `dsfab export --help` lists all.")
    ] = None

    accept: Annotated[
        bool,
        Parameter(
            negative=(), help="Write the files even if a load has no support, or if the sheet is as thin as a film."
        ),
    ] = False

    def preset_overrides(self) -> tuple[str, ...]:
        """Return these options as KEY=VALUE texts for the preset. Raises ExportError for an unknown format."""
        accepted = ("fabrication.accept=true",) * self.accept
        if self.format_ is None:
            return accepted
        formats = [word.strip().lower() for word in self.format_.split(",") if word.strip()]
        formats = list(dict.fromkeys(_format(word) for word in formats))
        return (*accepted, f"export.formats={json.dumps(formats)}")


@Parameter(name="*")
@dataclass(frozen=True)
class PictureFlags:
    """Pictures that a build draws."""

    picture: Annotated[bool, Parameter(name=["--preview", "--picture"], help="Also make preview.png.")] = True
    marked: Annotated[
        bool, Parameter(negative=(), help="Also make fabrication.png, which marks the smallest member, gap and wall.")
    ] = False

    def check_ahead(self) -> None:
        """Start to check in the background whether this machine can draw."""
        from dsfab.render.opengl import probe_ahead

        if self.picture or self.marked:
            probe_ahead()

    def drawable(self, reporter: Reporter) -> "PictureFlags":
        """Return these flags, or flags without pictures if this machine cannot draw."""
        from dsfab.render.opengl import why_no_pictures

        why = why_no_pictures() if self.picture or self.marked else ""
        if why:
            reporter.print_line(f"preview     no picture: {why}")
        return PictureFlags(picture=False) if why else self


def build(
    preset: str,
    /,
    *,
    source: Source = UNCHANGED,
    files: Files = Files(),
    step: StepFlags = NO_FLAGS,
    fix: Annotated[
        bool, Parameter(negative=(), help="Change widths and frequencies until the limits of [fabrication] are met.")
    ] = False,
    pictures: PictureFlags = PictureFlags(),
    quiet: Quiet = False,
) -> int:
    """Build a preset: solid, sheet, picture and numbers, in one folder.

    For a mesh file, dsfab proposes a preset as `dsfab new` does, and prints each decision.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, a folder that `dsfab build` wrote, or a mesh file.
    """
    if not step.estimate:
        pictures.check_ahead()
    from dsfab.design import run
    from dsfab.export import FORMATS, require_writable
    from dsfab.report.design.save import ready_to_draw, save

    source = source.with_overrides(*files.preset_overrides(), *step.overrides())
    proposal = source.proposal(preset)
    print_lines((*proposal.questions, *proposal.lines) if proposal and not quiet else ())
    loaded = source.read_preset(preset, proposal)
    for suffix in loaded.export.formats:
        FORMATS["." + suffix].ready()
    reporter = Reporter(quiet)
    if step.estimate:
        return estimate_step(loaded, reporter)
    drawable, folder = pictures.drawable(reporter), files.output or Path("outputs") / loaded.name
    require_writable(folder)
    with reporter:
        with ready_to_draw(drawable.picture):
            design = run(loaded, reporter)
            if fix:
                design = _fix_design(design, reporter)
            saved = save(design, folder, reporter, drawable.picture, drawable.marked)
        reporter.done()
        for text in saved.messages:
            reporter.print_line(f"export      {text}")
    if not quiet:
        _summary(design, folder, saved.facts)
    if saved.refused:
        is_optional = files.format_ is None and (proposal or _step_is_optional(design.preset.export))
        _report_refusal(saved.refused, design.preset, folder if is_optional else None, reporter)
    return 0


def _format(word: str) -> str:
    suffix = format_suffix(word)
    if suffix == CALCULIX_SUFFIX:
        raise ExportError(f"format {word!r} is not a file of a build; write it with dsfab export --to {CALCULIX}")
    return ALIASES.get(suffix, suffix)[1:]


def _step_is_optional(export: "Export") -> bool:
    return export.step == "quick" and len(export.formats) > 1


def _report_refusal(why: str, preset: "Preset", folder: Path | None, reporter: Reporter) -> None:
    """Report a file that dsfab refused to write; raise ExportError if the user requested it (`folder` is None)."""
    if folder is None:
        raise ExportError(why)
    longer = f"; dsfab export {shlex.quote(str(folder))} --to step --step auto tries more ways, for minutes"
    reporter.print_line(f"export      left out: {why}{longer if preset.export.step == 'quick' else ''}")


def _fix_design(design: "Design", reporter: Reporter) -> "Design":
    from dsfab.study.fabrication import fixed_design

    fix_result = fixed_design(design, reporter)
    reporter.done()
    for key, (value_before, value_after) in fix_result.changes.items():
        reporter.print_line(f"fix         {key}: {value_before} -> {value_after}")
    if not fix_result.changes:
        reporter.print_line("fix         nothing to change: no limit of [fabrication] is missed")
    return fix_result.design


def _summary(design: "Design", folder: Path, facts: Mapping[str, Any]) -> None:
    from dsfab.render.design_picture import caption
    from dsfab.report.design.facts import alternative_lines, attempt_lines, choice_lines
    from dsfab.report.design.inspection import fabrication_lines, load_lines, quality_lines
    from dsfab.report.design.statics import answer_lines, case_lines

    solid, pieces = design.solid, design.solid.pieces
    if losing_words := facts.get("loses_to"):
        print_result(sentence(losing_words))
    if design.preset.description:
        print_result(design.preset.description)
    print_result(caption(design))
    print_result(
        f"solid: {len(solid.F):,} triangles, {solid.volume:.4g} m3, genus {solid.genus}, "
        f"{pieces} {'piece' if pieces == 1 else 'pieces'}, closed"
    )
    measures = (*quality_lines(facts["pattern"]), *fabrication_lines(facts["fabrication"]))
    choices = (*attempt_lines(design.pattern.attempts), *choice_lines(design.pattern.choice), *alternative_lines(facts))
    print_lines((*load_lines(facts), *choices, *case_lines(design), *answer_lines(design), *measures))
    print_lines(f"note ({note.stage}): {note.text}" for note in design.notes)
    for path in sorted(folder.iterdir()):
        if path.is_file():
            print_result(f"  {path}  {byte_size(path.stat().st_size)}")
