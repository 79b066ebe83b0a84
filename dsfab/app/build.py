"""`dsfab build`: a preset to a folder of files."""

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab import __version__
from dsfab.app.answers import answer_facts, answer_lines
from dsfab.app.balance import case_facts, case_lines, equilibrium_facts
from dsfab.app.choice import choice_facts, choice_lines
from dsfab.app.fabrication import fabrication_facts, fabrication_lines
from dsfab.app.folder import whole_or_nothing
from dsfab.app.pattern_told import quality_facts, quality_lines
from dsfab.app.report import Reporter, length, mass, out, size
from dsfab.app.step_options import EstimateOnly, MaxFaces, MaxMb, Step, estimated, overrides
from dsfab.errors import ExportError

if TYPE_CHECKING:
    from dsfab.design import Design
    from dsfab.preset import Preset

Set = Annotated[tuple[str, ...], Parameter(name="--set", negative=(), help="Override a value: KEY=VALUE (repeatable).")]
Mesh = Annotated[Path | None, Parameter(name="--mesh", help="Mesh file that takes the place of the preset's surface.")]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative=(), help="Say nothing but errors.")]
Unit = Annotated[str | None, Parameter(name="--unit", help="Unit of the mesh file: mm, cm, m, in, ft.")]


def read_preset(
    name: str, changes: tuple[str, ...] = (), mesh: Path | None = None, unit: str | None = None
) -> "Preset":
    """The preset of a command line, with its overrides."""
    from dsfab.preset_file import load_preset, parse_override

    overrides = dict(parse_override(text) for text in changes)
    if unit is not None:
        overrides["surface.unit"] = unit
    return load_preset(name, overrides, mesh)


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
    from dsfab.app.workshop import write_workshop_picture
    from dsfab.pipeline import run
    from dsfab.pipeline.measures import measured_pattern
    from dsfab.study.fabrication import fabrication

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
        with whole_or_nothing(folder) as partial:
            reporter("fabrication", "measuring members, gaps and walls")
            measured = fabrication(design)
            made = fabrication_facts(measured)
            even = quality_facts(measured_pattern(design))
            if marked and drawn:
                write_workshop_picture(partial / "fabrication.png", design, measured, (1600, 1200))
            refused = write_all(design, partial, reporter, picture and drawn, {"fabrication": made, "pattern": even})
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        _summary(design, folder, [*quality_lines(even), *fabrication_lines(made)])
    if refused:
        raise ExportError(refused)
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
    from dsfab.app.gl import why_no_pictures

    if why := why_no_pictures():
        reporter.say(f"preview     no picture: {why}")
    return not why


def write_all(design: "Design", folder: Path, reporter: Reporter, picture: bool, made: dict[str, Any]) -> str:
    """Write every file of a design, and what was `made` of measuring it; returns why a format was refused, or ''."""
    import time

    from dsfab.export import write
    from dsfab.preset_file import preset_toml
    from dsfab.study.archive import keep
    from dsfab.study.delivery import delivered

    preset, ask = design.preset, design.preset.export
    seconds, files, refused, told = dict(design.seconds), list[Path](), list[str](), list[str]()
    reports = list[str]()
    start = time.perf_counter()
    for suffix in ask.formats:
        reporter("export", f"writing and reading back {preset.name}.{suffix}")
        try:
            thing, how = delivered(design, f".{suffix}")
            how |= {"note": told.append, "report": lambda done: reports.append(done.told)}
            files.append(write(thing, folder / f"{preset.name}.{suffix}", **how))
            if suffix == "stl":
                files += _write_parts(design, folder)
        except ExportError as error:
            if suffix not in ("step", "stpz", "brep"):
                raise
            refused.append(str(error))
    for text in (*reports, *told):
        reporter.say(f"export      {text}")
    write(design.sheet.surface, folder / "sheet.ply")
    keep(design, folder)
    seconds["export"] = time.perf_counter() - start
    if picture:
        reporter("preview", "drawing preview.png")
        _draw(design, folder / "preview.png")
    (folder / "preset.toml").write_text(preset_toml(design.settled), encoding="utf-8")
    names = [path.name for path in files]
    (folder / "design.json").write_text(
        json.dumps(facts(design, seconds, names, refused, told) | made, indent=2) + "\n",
        encoding="utf-8",
    )
    return "; ".join(refused)


def _write_parts(design: "Design", folder: Path) -> list[Path]:
    """Of a solid that was split for a machine one STL file for each part; other formats keep parts in one file."""
    from dsfab.export import write
    from dsfab.thickening import Split, parts

    if design.solid.pieces == 1 or not any(isinstance(extra, Split) for extra in design.preset.thickening.extra):
        return []
    name = design.preset.name
    return [write(part, folder / f"{name}_{number}.stl") for number, part in enumerate(parts(design.solid), 1)]


def _draw(design: "Design", path: Path) -> None:
    from dsfab.app.preview import write_picture

    write_picture(
        path, design.solid.V, design.solid.F, surface=design.surface, load=design.load, caption=caption(design)
    )


def caption(design: "Design") -> str:
    """One line under the picture."""
    pieces = design.solid.pieces
    share = design.sheet.surface.area / design.surface.area
    return (
        f"{design.preset.name} - {share:.0%} of the surface kept, {length(design.preset.statics.thickness)} thick, "
        f"{mass(design.mass)}, {pieces} {'piece' if pieces == 1 else 'pieces'}"
    )


def facts(
    design: "Design", seconds: dict[str, float], files: list[str], refused: list[str], told: Sequence[str] = ()
) -> dict[str, Any]:
    """What `design.json` holds: sizes and results in SI units, seconds per stage, notes, versions."""
    solid, sheet, uncut = design.solid, design.sheet.surface, design.surface
    box = solid.V.min(axis=0).tolist(), solid.V.max(axis=0).tolist()
    return {
        "name": design.preset.name,
        "preset": design.settled.model_dump(mode="json", exclude_none=True),
        "surface": {"vertices": uncut.n, "triangles": uncut.m, "area_m2": uncut.area, "mean_edge_m": uncut.mean_edge},
        "statics": {
            **equilibrium_facts(design, design.statics.load, design.statics.equilibrium),
            **answer_facts(design, design.statics),
            "cases": case_facts(design),
            "followed": design.preset.followed,
        },
        "modes": {"major": design.diffusion.major.lam.tolist(), "minor": design.diffusion.minor.lam.tolist()},
        **choice_facts(design.pattern.choice),
        "sheet": {
            "vertices": sheet.n,
            "triangles": sheet.m,
            "area_m2": sheet.area,
            "kept_share": sheet.area / uncut.area,
            "pinches": design.slicing.pinches,
            "pieces": [piece._asdict() for piece in design.slicing.pieces],
        },
        "solid": {
            "vertices": len(solid.V),
            "triangles": len(solid.F),
            "volume_m3": solid.volume,
            "mass_kg": design.mass,
            "genus": solid.genus,
            "pieces": solid.pieces,
            "box_m": box,
        },
        "thickening": {"side": design.preset.thickening.side, **asdict(solid.repairs)},
        "files": files,
        "refused": refused,
        "warnings": [*(f"{note.stage}: {note.text}" for note in design.notes), *(f"export: {text}" for text in told)],
        "seconds": {row: round(value, 4) for row, value in seconds.items()},
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """dsfab, Python and the libraries that a result depends on."""
    from dsfab.sparse import solver_name

    libraries = ("numpy", "scipy", "libigl", "manifold3d", "trimesh", "build123d", "pyvista", "vtk")
    found = {name: version(name) for name in libraries}
    return {"dsfab": __version__, "python": platform.python_version(), "solver": solver_name(), **found}


def _summary(design: "Design", folder: Path, measured: Sequence[str]) -> None:
    solid = design.solid
    pieces = design.solid.pieces
    if design.preset.description:
        out(design.preset.description)
    out(caption(design))
    out(
        f"solid: {len(solid.F):,} triangles, {solid.volume:.4g} m3, genus {solid.genus}, "
        f"{pieces} {'piece' if pieces == 1 else 'pieces'}, closed"
    )
    told = (*choice_lines(design.pattern.choice), *case_lines(design), *answer_lines(design), *measured)
    for line in told:
        out(line)
    for note in design.notes:
        out(f"note ({note.stage}): {note.text}")
    for path in sorted(folder.iterdir()):
        if path.is_file():
            out(f"  {path}  {size(path.stat().st_size)}")
