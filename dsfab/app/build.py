"""The command `dsfab build`: from a preset to a folder of files."""

import json
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.build_page import USUAL, BuildPage, Output
from dsfab.app.export import ALIASES, CALCULIX, CALCULIX_SUFFIX, format_suffix
from dsfab.app.options import NO_FLAGS, UNCHANGED, OutputName, Source, StepFlags, Switch, estimate_step
from dsfab.app.terminal import ExitCode, Reporter
from dsfab.core.errors import ExportError, NotMadeError

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.preset.model import Export, Preset


@Parameter(name="*")
@dataclass(frozen=True)
class Files:
    """Options of a build: folder, formats, and permission to write a faulty design."""

    output: Annotated[Path | None, OutputName(help="Folder for the files [outputs/NAME].")] = None
    format_: Annotated[
        str | None, Parameter(name=["--format", "-f"], help="Formats (comma list); `dsfab export --help` lists all.")
    ] = None

    accept: Annotated[
        bool,
        Switch(help="Write the files even if a load has no support, or if the sheet has become as thin as a film."),
    ] = False

    def preset_overrides(self) -> tuple[str, ...]:
        """Return these options as changes of the preset (texts KEY=VALUE). Raises ExportError for an unknown format."""
        accepted = ("fabrication.accept=true",) * self.accept
        if self.format_ is None:
            return accepted
        formats = [word.strip().lower() for word in self.format_.split(",") if word.strip()]
        formats = list(dict.fromkeys(_format(word) for word in formats))
        return (*accepted, f"export.formats={json.dumps(formats)}")


@Parameter(name="*")
@dataclass(frozen=True)
class PictureFlags:
    """Options for the pictures of a build."""

    picture: Annotated[bool, Parameter(name=["--preview", "--picture"], help="Also make preview.png.")] = True
    marked: Annotated[
        bool, Switch(help="Also make fabrication.png, which marks the smallest member, gap and wall.")
    ] = False

    def check_ahead(self) -> None:
        """Start to check in the background whether this machine can draw."""
        from dsfab.render.opengl import probe_ahead

        if self.picture or self.marked:
            probe_ahead()

    def drawable(self, reporter: Reporter) -> "PictureFlags":
        """Return these options; without pictures if this machine cannot draw."""
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
        bool, Switch(help="Change widths and stripe spacings until the limits of [fabrication] are met.")
    ] = False,
    pictures: PictureFlags = PictureFlags(),
    output: Output = USUAL,
) -> int:
    """Build a preset: verdict, picture, solid, sheet and numbers, in one folder.

    For a mesh file, dsfab proposes a preset and prints each decision, like `dsfab new`. The exit code is 5 if the
    structure does not carry its loads; dsfab then writes the files nevertheless.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, a folder that `dsfab build` wrote, or a mesh
        file."""
    if not step.estimate:
        pictures.check_ahead()
    from dsfab.export import FORMATS, require_writable
    from dsfab.report.design.save import ready_to_draw, save
    from dsfab.study import run_sized

    source, page = source.with_overrides(*files.preset_overrides(), *step.overrides()), BuildPage(output)
    proposal = source.proposal(preset)
    if proposal:
        page.print_lines((*proposal.questions, *(proposal.lines if output.verbose else proposal.main_lines)))
    loaded = source.read_preset(preset, proposal, "open")
    for suffix in loaded.export.formats:
        FORMATS["." + suffix].ready()
    reporter = Reporter(output.quiet, steps=output.verbose)
    if step.estimate:
        return estimate_step(loaded, reporter, run_sized(loaded, reporter))
    drawable, folder = pictures.drawable(reporter), files.output or Path("outputs") / loaded.name
    require_writable(folder)
    with reporter:
        with ready_to_draw(drawable.picture):
            design = run_sized(loaded, reporter)
            if fix:
                design = _fix_design(design, reporter)
            announce = page.announcements(design, reporter, drawable.picture)
            saved = save(design, folder, reporter, drawable.picture, drawable.marked, announce)
        reporter.done()
    is_optional = page.faulty or (files.format_ is None and (proposal or _step_is_optional(design.preset.export)))
    refused = [_refusal_line(saved.refused, design.preset, folder)] if saved.refused and is_optional else []
    page.print_rest(design, folder, saved, refused)
    if saved.refused and not is_optional:
        raise NotMadeError(saved.refused)
    return ExitCode.DOES_NOT_CARRY if page.faulty else ExitCode.DONE


def _format(word: str) -> str:
    suffix = format_suffix(word)
    if suffix == CALCULIX_SUFFIX:
        raise ExportError(f"a build does not write the format {word!r}; use dsfab export --to {CALCULIX}")
    return ALIASES.get(suffix, suffix)[1:]


def _step_is_optional(export: "Export") -> bool:
    return export.step == "quick" and len(export.formats) > 1


def _refusal_line(why: str, preset: "Preset", folder: Path) -> str:
    longer = (
        f"; dsfab export {shlex.quote(str(folder))} --to step --step auto takes minutes, but may write the STEP file"
    )
    return f"left out: {why}{longer if preset.export.step == 'quick' else ''}"


def _fix_design(design: "Design", reporter: Reporter) -> "Design":
    from dsfab.study.fabrication import fixed_design

    fix_result = fixed_design(design, reporter)
    reporter.done()
    for key, (value_before, value_after) in fix_result.changes.items():
        reporter.print_line(f"fix         {key}: {value_before} -> {value_after}")
    if not fix_result.changes:
        reporter.print_line("fix         no change: the design meets all limits of [fabrication]")
    return fix_result.design
