"""`dsfab build`: a preset to a folder of files."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import Mesh, Quiet, Set, Unit, read_preset
from dsfab.app.step_options import EstimateOnly, MaxFaces, MaxMb, Step, estimated, overrides
from dsfab.app.terminal import Reporter, out
from dsfab.errors import ExportError
from dsfab.wording import size

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design


def build(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME].")
    ] = None,
    format_: Annotated[
        str | None, Parameter(name=["--format", "-f"], help="Comma list; `dsfab export --help` names them all.")
    ] = None,
    step: Step = None,
    max_faces: MaxFaces = None,
    max_mb: MaxMb = None,
    estimate: EstimateOnly = False,
    fix: Annotated[
        bool, Parameter(negative=(), help="Change widths and frequencies until the limits of [fabrication] are met.")
    ] = False,
    picture: Annotated[bool, Parameter(name=["--preview", "--picture"], help="Also make preview.png.")] = True,
    marked: Annotated[
        bool, Parameter(negative=(), help="Also make fabrication.png: where the smallest member, gap and wall are.")
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Build a preset: solid, sheet, picture and numbers, in one folder.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.pipeline import run
    from dsfab.report.design.save import save

    if format_ is not None:
        formats = [word.strip().lower() for word in format_.split(",") if word.strip()]
        set_ = (*set_, f"export.formats={json.dumps(formats)}")
    given = read_preset(preset, (*set_, *overrides(step, max_faces, max_mb)), mesh, unit)
    _require(given.export.formats)
    reporter = Reporter(quiet)
    if estimate:
        return estimated(given, reporter)
    drawn = (picture or marked) and _can_draw(reporter)
    folder = output if output is not None else Path("outputs") / given.name
    try:
        design = run(given, reporter)
        if fix:
            design = _fixed(design, reporter)
        saved = save(design, folder, reporter, picture and drawn, marked and drawn)
        reporter.done()
        for text in saved.told:
            reporter.say(f"export      {text}")
    finally:
        reporter.stop()
    if not quiet:
        _summary(design, folder, saved.measured)
    if saved.refused:
        raise ExportError(saved.refused)
    return 0


def _fixed(design: "Design", reporter: Reporter) -> "Design":
    """The design as `--fix` changes it, every change told."""
    from dsfab.study.fix import fixed

    done = fixed(design, reporter)
    reporter.done()
    for key, (old, new) in done.changes.items():
        reporter.say(f"fix         {key}: {old} -> {new}")
    if not done.changes:
        reporter.say("fix         nothing to change: no limit of [fabrication] is missed")
    return done.design


def _require(formats: Sequence[str]) -> None:
    """Raise ExportError before the work begins if a format needs a library that is not there."""
    from dsfab.export import FORMATS

    for suffix in formats:
        FORMATS["." + suffix].ready()


def _can_draw(reporter: Reporter) -> bool:
    """Whether pictures can be drawn here, asked before the work begins; without them everything else is still built."""
    from dsfab.render.opengl import why_no_pictures

    if why := why_no_pictures():
        reporter.say(f"preview     no picture: {why}")
    return not why


def _summary(design: "Design", folder: Path, measured: Mapping[str, Any]) -> None:
    from dsfab.render.caption import caption
    from dsfab.report.design.answers import answer_lines
    from dsfab.report.design.balance import case_lines
    from dsfab.report.design.choice import attempt_lines, choice_lines
    from dsfab.report.design.fabrication import fabrication_lines
    from dsfab.report.design.pattern import quality_lines

    solid = design.solid
    pieces = design.solid.pieces
    if design.preset.description:
        out(design.preset.description)
    out(caption(design))
    out(
        f"solid: {len(solid.F):,} triangles, {solid.volume:.4g} m3, genus {solid.genus}, "
        f"{pieces} {'piece' if pieces == 1 else 'pieces'}, closed"
    )
    measures = (*quality_lines(measured["pattern"]), *fabrication_lines(measured["fabrication"]))
    tried = (*attempt_lines(design.pattern.attempts), *choice_lines(design.pattern.choice))
    for line in (*tried, *case_lines(design), *answer_lines(design), *measures):
        out(line)
    for note in design.notes:
        out(f"note ({note.stage}): {note.text}")
    for path in sorted(folder.iterdir()):
        if path.is_file():
            out(f"  {path}  {size(path.stat().st_size)}")
