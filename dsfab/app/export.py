"""The command `dsfab export`: writes one file of a preset or of a built folder."""

import difflib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import NO_FLAGS, UNCHANGED, OutputName, Quiet, Source, StepFlags, built_folder, estimate_step
from dsfab.app.terminal import Reporter, print_lines, print_result
from dsfab.core.errors import ExportError
from dsfab.core.messages import byte_size, length
from dsfab.design import Progress

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.preset.model import Preset
    from dsfab.study.check_model import CheckModel
    from dsfab.surface import Surface
    from dsfab.thickening import Solid

CALCULIX = "calculix"
CALCULIX_SUFFIX = ".inp"
ALIASES = {".stp": ".step"}  # Suffixes that stand for the format of another suffix.
SHORT_WORDS = {"saf": ".saf.xlsx", "opensees": ".tcl"}  # Short words for --to, with the suffix of their format.
ELSEWHERE = {
    "pdf": "`dsfab compare` and `dsfab report` write reports as PDF",
    "html": "`dsfab compare` and `dsfab report` write reports as HTML",
    "png": "`dsfab build` and `dsfab preview` draw pictures",
    "dwg": "write dxf, which programs for DWG can read",
}
"""Formats that `dsfab export` does not write, each with a sentence on how to get a similar file."""
GROUPS = {
    "solid and lines": "the solid",
    "lines": "lines and drawings",
    "shapes": "members",
    "frame": "beam models",
    "section_forces": "section forces",
    "member_forces": "forces of members",
    "utilisation": "forces of members",
}
"""Titles of groups of file formats, by the content of the files. For other contents, the content is the title."""

TO_HELP = (
    "The solid: stl, 3mf, step, stpz (compressed), brep, obj, ply, off, glb; ifc with its material and mass; 3dm with "
    "edges and centre lines. Lines by family: dxf (with plan and elevations), svg (a drawing to scale), lines.step "
    "(curves), csv, json. Members by name: members.json, members.csv, nodes.csv; as "
    "objects on layers members.3dm, members.ifc, members.glb, members.dxf (lines). Fields on the uncut surface: vtu. "
    "Section forces n, m and q of the cut sheet, in every face: forces.vtu, forces.csv; N, V and M along each member: "
    "member_forces.csv, member_forces.xlsx (a worksheet for each member); utilisation by Eurocode 3 or 5: "
    "member_utilisation.csv. A beam model for SCIA, RFEM and others: saf.xlsx, or saf for short; for OpenSees: tcl, or "
    "opensees; for CalculiX: beams.inp. Finite elements of the sheet for CalculiX: calculix. [as the suffix of -o]"
)

SheetName = Literal["uncut", "cut"]


@dataclass(frozen=True)
class ExportRequest:
    """A request to write a file. suffix : its suffix.    sheet : sheet to write, cut or uncut; None for the solid."""

    suffix: str
    path: Path
    sheet: SheetName | None


def export(
    preset: str,
    /,
    *,
    to: Annotated[str | None, Parameter(help=TO_HELP)] = None,
    output: Annotated[Path | None, OutputName(help="Name of the file to write [outputs/NAME/NAME.ext].")] = None,
    sheet: Annotated[
        SheetName | None,
        Parameter(
            help="Write the uncut sheet or the cut sheet in place of the solid; the format calculix writes the uncut "
            "sheet by default."
        ),
    ] = None,
    source: Source = UNCHANGED,
    step: StepFlags = NO_FLAGS,
    quiet: Quiet = False,
) -> int:
    """Write one file: the solid, a sheet, lines, a drawing, fields, or a finite element model to check the statics.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote. The design of
        a folder is used again if its preset.toml has not changed, and --set changes no value."""
    loaded_preset, folder = preset_and_folder(preset, source.with_overrides(*step.overrides()))
    reporter, built = Reporter(quiet), built_design(preset, loaded_preset)
    if step.estimate:
        return estimate_step(loaded_preset, reporter, built)
    from dsfab.export import require_writable_file

    request = _export_request(to, output, folder, loaded_preset.name, sheet)
    require_writable_file(request.path)
    with reporter:
        lines = write_file(loaded_preset, built, request, reporter)
    if not quiet:
        print_lines(lines)
        print_result(f"  {request.path}  {byte_size(request.path.stat().st_size)}")
    return 0


def write_file(preset: "Preset", built: "Design | None", request: ExportRequest, progress: Progress) -> list[str]:
    """Write the requested file; return lines about it. built : existing design, or None. Raises DsfabError."""
    if request.suffix == ".member_utilisation.csv":
        preset.statics.require_strength()
    if request.suffix == CALCULIX_SUFFIX:
        return _write_model(preset, request, progress)
    return _write_solid_or_sheet(preset, built, request, progress)


def offered_formats() -> list[dict[str, str]]:
    """Return a record for each file format: name, group, and what this machine lacks to write the format, or ''."""
    from dsfab.export.formats import FORMATS, MeshFormat

    offered = []
    for suffix, form in FORMATS.items():
        if suffix in ALIASES:
            continue
        try:
            form.ready()
            missing = ""
        except ExportError as error:
            missing = str(error)
        content = "the solid" if isinstance(form, MeshFormat) else form.content
        offered.append({"format": suffix[1:], "group": GROUPS.get(content, content), "missing": missing})
    return [*offered, {"format": CALCULIX, "group": "a check", "missing": ""}]


def preset_and_folder(name: str, source: Source) -> tuple["Preset", Path]:
    """Return a preset, and the folder for its files. name : preset, preset file, mesh file or folder of a build."""
    if folder := built_folder(name):
        return source.read_preset(str(folder / "preset.toml")), folder
    loaded_preset = source.read_preset(name)
    return loaded_preset, Path("outputs") / loaded_preset.name


def built_design(name: str, preset: "Preset") -> "Design | None":
    """Return the design that `dsfab build` wrote into folder `name` if its preset equals `preset`; else None."""
    from dsfab.design.output.archive import read_archive

    folder = built_folder(name)
    return read_archive(folder, preset) if folder else None


def _suffix_by_word() -> dict[str, str]:
    from dsfab.export import FORMATS

    return {CALCULIX: CALCULIX_SUFFIX, **{suffix[1:]: suffix for suffix in FORMATS}, **SHORT_WORDS}


def format_suffix(word: str) -> str:
    """Return a format's suffix: '.step' for 'step'. Raises ExportError for an unknown format or a missing library."""
    from dsfab.export import FORMATS

    suffixes = _suffix_by_word()
    suffix = CALCULIX_SUFFIX if word == CALCULIX_SUFFIX[1:] else suffixes.get(word)
    if suffix is None:
        if word in ELSEWHERE:
            raise ExportError(f"dsfab export does not write {word!r}; {ELSEWHERE[word]}")
        suggestions = difflib.get_close_matches(word, suffixes, n=1)
        hint = f"did you mean {suggestions[0]}? " if suggestions else ""
        raise ExportError(f"{word!r} is not a format; {hint}use one of {', '.join(suffixes)}")
    if suffix in FORMATS:
        FORMATS[suffix].ready()
    return suffix


def _export_request(
    to: str | None, output: Path | None, folder: Path, name: str, sheet: SheetName | None
) -> ExportRequest:
    from dsfab.export.formats import FORMATS, MeshFormat, suffix_of

    if to is None and output is None:
        raise ExportError(f"the command names no format; add --to with one of {', '.join(_suffix_by_word())}")
    word = (to if to is not None else suffix_of(output) if output else "").lower().removeprefix(".")
    suffix = format_suffix(word)
    path = output if output is not None else folder / f"{name}{suffix}"
    if suffix_of(path) != suffix:
        raise ExportError(f"-o {path} does not end in {suffix}; --to {word} writes {path.stem}{suffix}")
    if sheet is None or suffix == CALCULIX_SUFFIX:
        return ExportRequest(suffix, path, sheet)
    meshes = {key: form for key, form in FORMATS.items() if isinstance(form, MeshFormat)}
    if suffix in meshes and not meshes[suffix].sheets:
        holds = ", ".join(key[1:] for key, form in meshes.items() if form.sheets)
        raise ExportError(f"a {suffix} file holds only solids; leave out --sheet, or write one of {holds}")
    if suffix not in meshes:
        raise ExportError(f"--sheet has no effect on a {suffix} file; leave out --sheet")
    return ExportRequest(suffix, path, sheet)


def _make_folder(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(
            f"cannot make the folder {path.parent}: {error.strerror}; choose another folder with -o"
        ) from None


def _write_model(preset: "Preset", request: ExportRequest, reporter: Progress) -> list[str]:
    from dsfab.design import run
    from dsfab.export.analysis.calculix import write_calculix
    from dsfab.study.check_model import cut_model, uncut_model

    model = cut_model(run(preset, reporter), reporter) if request.sheet == "cut" else uncut_model(preset, reporter)
    reporter("export", f"writing {request.path.name}")
    _make_folder(request.path)
    write_calculix(model.model, request.path)
    return _model_lines(model, request)


def _model_lines(check_model: "CheckModel", request: ExportRequest) -> list[str]:
    model = check_model.model
    lines = [f"warning: {text}" for text in check_model.warnings]
    kind = "six-node shells" if model.element == "S6" else "six-node triangles in plane stress"
    shells = f"{request.sheet or 'uncut'} sheet: {len(model.triangles):,} {kind} ({model.element})"
    lines.append(f"{shells}, {len(model.nodes):,} nodes; metres, newtons, pascals")
    for name, answer in check_model.answers.items():
        lines.append(
            f"{name}: dsfab computes a largest displacement of {length(answer.largest_displacement)} and a strain "
            f"energy of {answer.compliance / 2:.4g} J (half of the compliance)"
        )
    change_folder = "" if request.path.parent == Path() else f"cd {request.path.parent} && "
    lines.append(f"to compare, run {change_folder}ccx {request.path.stem}, then read {request.path.stem}.dat")
    return lines


def _write_solid_or_sheet(
    preset: "Preset", built: "Design | None", request: ExportRequest, reporter: Progress
) -> list[str]:
    from dsfab.design import Design, run
    from dsfab.design.output.files import deliverable
    from dsfab.export import write
    from dsfab.study import require_fit

    lines: list[str] = []
    options: dict[str, Any] = {}
    if request.sheet == "uncut":
        reporter("surface", "making the surface")
        content: Solid | Surface = (built or Design.from_preset(preset)).surface
    else:
        design = built or run(preset, reporter)
        if built is None:
            require_fit(design)
        content, options = deliverable(design, request.suffix)
        content = design.sheet.surface if request.sheet == "cut" else content
        options["note"] = lines.append
    reporter("export", f"writing and reading back {request.path.name}")
    _make_folder(request.path)
    write(content, request.path, name=preset.name, report=lambda done: lines.append(done.summary), **options)
    return lines
