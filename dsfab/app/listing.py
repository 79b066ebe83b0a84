"""The commands `dsfab presets`, `materials` and `inspect`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Source
from dsfab.app.terminal import ExitCode, Reporter, print_lines, print_result
from dsfab.core.errors import PresetError, SurfaceError
from dsfab.core.messages import count_phrase, length
from dsfab.report.design.carrying import reaction_lines
from dsfab.report.design.inspection import (
    fabrication_facts,
    fabrication_lines,
    load_facts,
    load_lines,
    quality_facts,
    quality_lines,
)

if TYPE_CHECKING:
    from dsfab.surface import MeshFacts, RawMesh


def presets() -> int:
    """List the presets that come with dsfab."""
    from dsfab.core.toml_files import preset_headline, shipped_presets

    shipped = shipped_presets()
    width = max(map(len, shipped), default=0)
    for name, path in shipped.items():
        print_result(f"{name:<{width}}  {preset_headline(path)}")
    return 0


def materials() -> int:
    """List the materials that [statics] may name (`material = "GL24h"`), with their values and sources."""
    from dsfab.core.materials import MATERIALS

    for name, material in MATERIALS.items():
        print_result(
            f"{name:<15}  young {material.young / 1e9:g} GPa, poisson {material.poisson:g}, density "
            f"{material.density:g} kg/m3, "
            f"strength {material.strength / 1e6:g} MPa, expansion {material.expansion * 1e6:g}e-6/K"
        )
        print_result(f"{'':<15}  strength: {material.says}")
        print_result(f"{'':<15}  source: {material.source}")
    return 0


def inspect(
    file: str,
    /,
    *,
    source: Source = UNCHANGED,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="PNG file that marks the smallest member, gap and wall.")
    ] = None,
    report: Annotated[
        bool, Parameter(negative=(), help="Return the exit code 0 even for a mesh that `dsfab build` refuses.")
    ] = False,
) -> int:
    """Describe a mesh file: size, pieces, boundary, likely unit, and whether it is manifold or why not.

    The command also lists what dsfab reads, repairs and drops. The exit code is 1 if `dsfab build` refuses the mesh.

    For a preset or a built folder, the command lists supports, loads and dead ends of the pattern. It also compares
    members, gaps and walls with the limits of [fabrication].

    Parameters
    ----------
    file
        OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP, BREP or IFC; a preset (a name or a TOML file); or a folder
        of results."""
    from dsfab.core.toml_files import shipped_presets

    path, is_shipped = Path(file), file in shipped_presets()  # `dome` names a preset, `./dome` names a folder
    if not (is_shipped or path.is_dir() or path.suffix == ".toml"):
        if output is not None or source.set_ or source.mesh is not None:
            flag = f"-o {output}" if output is not None else "--set" if source.set_ else "--mesh"
            raise PresetError(
                f"{flag} works with a preset or a folder of results, not with a mesh file; leave this option out"
            )
        return ExitCode.DONE if _show_mesh(path, source) or report else ExitCode.REFUSED
    built = _built_facts(path) if path.is_dir() and not is_shipped else None
    if built is None or output is not None or source != UNCHANGED:
        built = _measured_facts(file if built is None else str(path / "preset.toml"), source, output)
    else:
        reactions = built["carrying"]["reactions"] if "carrying" in built else ()
        print_lines((*load_lines(built), *reaction_lines(reactions)))
    print_lines((*(quality_lines(built["pattern"]) if "pattern" in built else ()), *fabrication_lines(built)))
    return 0


def _built_facts(folder: Path) -> dict[str, Any]:
    try:
        facts = json.loads((folder / "design.json").read_text(encoding="utf-8"))
        return {
            **facts["fabrication"],
            **{k: facts[k] for k in ("pattern", "supports", "loads", "carrying") if k in facts},
        }
    except (OSError, ValueError, KeyError, TypeError):
        raise PresetError(
            f"the folder {folder} has no design.json with widths of members, gaps and walls; build the design again"
        ) from None


def _measured_facts(preset: str, source: Source, picture: Path | None) -> dict[str, Any]:
    from dsfab.design import Design
    from dsfab.render.fabrication import write_workshop_picture
    from dsfab.study.fabrication import fabrication

    with Reporter() as reporter:
        design = Design.from_preset(source.read_preset(preset, thickness="guessed"), None, reporter).until("surface")
        try:
            design.until("statics")
        finally:
            reporter.done()
            print_lines(load_lines(load_facts(design)))
        measures = fabrication(design.until("thickening"))
        if picture is not None:
            reporter("preview", f"drawing {picture.name}")
            write_workshop_picture(picture, design, measures, (1600, 1200))
    return {**fabrication_facts(measures), "pattern": quality_facts(design.quality())}


def _show_mesh(path: Path, source: Source) -> bool:
    from dsfab.surface import DEFAULT_TRIANGLES, mesh_facts, raw_mesh

    raw = raw_mesh(path, source.max_triangles or DEFAULT_TRIANGLES, source.unit, source.only)
    accepted, verdict, built_unit = _verdict(path, source, raw)
    facts = mesh_facts(path, raw, built_unit if raw.unit is None else source.unit)
    print_result(str(path))
    rows = [(label, value) for label, value in [*_fact_rows(facts), ("build", verdict)] if value]
    width = max(len(label) for label, _ in rows)
    print_lines(f"  {label:<{width}}  {value}" for label, value in rows)
    return accepted


def _verdict(path: Path, source: Source, raw: "RawMesh") -> tuple[bool, str, str | None]:
    """Return True if `dsfab build` accepts a mesh, a text on this decision, and the unit of the mesh or None."""
    from dsfab.core.arrays import polygon_perimeter
    from dsfab.preset.proposal import propose
    from dsfab.surface import unit_guess

    try:
        proposal = propose(path, source.unit, source.up, None, source.max_triangles, raw, source.wishes)
    except (SurfaceError, PresetError) as error:
        return False, "refuses it: " + str(error).removeprefix(f"{path}: "), source.unit or unit_guess(raw)
    unit = proposal.given.choice.unit
    choices = {decision.topic: decision.choice for decision in proposal.decisions}
    if "pieces" in choices:
        return False, "refuses it: " + choices["pieces"], unit
    mended, sheets = ([x.choice for x in proposal.decisions if x.topic == topic] for topic in ("mended", "sheets"))
    turned = [text for text in proposal.given.repaired if "turned over" in text]
    surface = proposal.given.surface
    lengths = [polygon_perimeter(surface.V[loop]) for loop in surface.loops]
    then = f"the surface then has {count_phrase(surface.m, 'triangle')}, {surface.area:.4g} m2 and {_loops(lengths)}"
    size = [then] if mended else []
    return True, "; ".join(["takes it", *(f"it mends: {text}" for text in mended), *size, *turned, *sheets]), unit


def _unit_words(facts: "MeshFacts") -> str:
    from dsfab.preset.proposal import size_doubt, sizes_in_other_units

    if facts.unit_said:
        doubt = size_doubt(facts.box, facts.unit) if facts.unit == facts.unit_guess else ""
        return f"{facts.unit_guess}, as the file says{doubt}"
    return "; ".join([facts.unit, *sizes_in_other_units(facts.box, facts.unit)])


def _loops(lengths: Sequence[float]) -> str:
    if not lengths:
        return "no boundary: the surface is closed"
    shown = ", ".join(map(length, lengths[:6])) + (" ..." if len(lengths) > 6 else "")
    return f"{count_phrase(len(lengths), 'boundary loop')}: {shown}"


def _fact_rows(facts: "MeshFacts") -> list[tuple[str, str]]:
    return [
        ("size", " x ".join(length(side) for side in facts.box) + f" (read as {facts.unit})"),
        ("likely unit", _unit_words(facts)),
        (
            "mesh",
            f"{facts.vertices:,} vertices, {count_phrase(facts.faces, 'triangle')}, edges of "
            f"{length(facts.mean_edge)} on average",
        ),
        (
            "polygons",
            f"the file has {facts.polygons:,}, which dsfab reads as triangles" if facts.polygons < facts.faces else "",
        ),
        ("area", f"{facts.area:.4g} m2"),
        ("volume", "" if facts.volume is None else f"{facts.volume:.4g} m3"),
        ("pieces", f"{facts.pieces:,}"),
        ("boundary", _loops(facts.boundary_lengths).replace("boundary loop", "loop")),
        ("genus", "" if facts.genus is None else str(facts.genus)),
        ("sharpest", f"the smallest angle of a triangle is {facts.smallest_angle:.1f} degrees"),
        ("manifold", "yes, and oriented" if facts.manifold else "no"),
        *(("because", fault) for fault in facts.faults),
        *(("read", text) for text in facts.record.read),
        ("taken", facts.record.surface_words),
        ("marks", facts.record.mark_words),
        ("beside", facts.record.other_words and f"{facts.record.other_words}: no surface"),
        *(("repaired", text) for text in facts.record.repaired),
        *(("dropped", text) for text in facts.record.dropped),
    ]
