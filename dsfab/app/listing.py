"""The commands `dsfab presets`, `materials` and `inspect`."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Source
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import PresetError, SurfaceError
from dsfab.core.messages import length
from dsfab.report.design.inspection import (
    acting_facts,
    acting_lines,
    fabrication_facts,
    fabrication_lines,
    quality_facts,
    quality_lines,
)

if TYPE_CHECKING:
    from dsfab.surface import MeshFacts, RawMesh

DONE, REFUSED = 0, 1
"""Exit codes of `inspect`."""


def presets() -> int:
    """List the presets that come with dsfab."""
    from dsfab.core.toml_files import headline, shipped_presets

    found = shipped_presets()
    width = max(map(len, found), default=0)
    for name, path in found.items():
        out(f"{name:<{width}}  {headline(path)}")
    return 0


def materials() -> int:
    """List the materials that [statics] may name (`material = "GL24h"`), with their values and sources."""
    from dsfab.core.materials import MATERIALS

    for name, one in MATERIALS.items():
        out(
            f"{name:<15}  young {one.young / 1e9:g} GPa, poisson {one.poisson:g}, density {one.density:g} kg/m3, "
            f"strength {one.strength / 1e6:g} MPa, expansion {one.expansion * 1e6:g}e-6/K"
        )
        out(f"{'':<15}  strength: {one.says}")
        out(f"{'':<15}  source: {one.source}")
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
        bool, Parameter(negative=(), help="Exit with 0 also for a mesh that `dsfab build` refuses.")
    ] = False,
) -> int:
    """Describe a mesh file: size, pieces, boundary, likely unit, and whether it is manifold or why not.

    It also lists what dsfab reads, repairs and drops, and whether `dsfab build` takes the mesh: exit code 1 if not.

    For a preset or a built folder: supports and loads, also of a design that cannot be built; evenness and dead ends
    of its pattern; and members, gaps and walls, against the limits of [fabrication].

    Parameters
    ----------
    file
        OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP or BREP; a preset (a name or a TOML file); or a folder of
        results.
    """
    from dsfab.core.toml_files import shipped_presets

    path, named = Path(file), file in shipped_presets()  # a shipped preset goes before a folder of its name
    if not (named or path.is_dir() or path.suffix == ".toml"):
        if output is not None or source.set_ or source.mesh is not None:
            flag = f"-o {output}" if output is not None else "--set" if source.set_ else "--mesh"
            raise PresetError(f"{flag} is for a preset or a folder of results, not for a mesh file; leave it out")
        return DONE if _show_mesh(path, source) or report else REFUSED
    built = _built(path) if path.is_dir() and not named else None
    if built is None or output is not None or source != UNCHANGED:
        built = _made(file if built is None else str(path / "preset.toml"), source, output)
    else:
        _show(acting_lines(built))
    _show((*(quality_lines(built["pattern"]) if "pattern" in built else ()), *fabrication_lines(built)))
    return 0


def _show(lines: Iterable[str]) -> None:
    for line in lines:
        out(line)


def _built(folder: Path) -> dict[str, Any]:
    """Measures in the design.json of a built folder; raises PresetError for other folders."""
    try:
        facts = json.loads((folder / "design.json").read_text(encoding="utf-8"))
        beside = {key: facts[key] for key in ("pattern", "supports", "loads") if key in facts}
        found: dict[str, Any] = {**facts["fabrication"], **beside}
    except (OSError, ValueError, KeyError, TypeError):
        raise PresetError(f"{folder} has no design.json with a part on fabrication; build it again") from None
    return found


def _made(preset: str, source: Source, picture: Path | None) -> dict[str, Any]:
    """Measures of a preset, which is run for it; draw them if `picture` is a path.

    Supports and loads are printed first, so that they appear also for a refused design.
    """
    from dsfab.design import Design
    from dsfab.render.fabrication import write_workshop_picture
    from dsfab.study.fabrication import fabrication

    with Reporter() as reporter:
        design = Design.of(source.read(preset), None, reporter).until("surface")
        try:
            design.until("statics")
        finally:
            reporter.done()
            _show(acting_lines(acting_facts(design, solved=design.has("statics"))))
        made = fabrication(design.until("thickening"))
        if picture is not None:
            reporter("preview", f"drawing {picture.name}")
            write_workshop_picture(picture, design, made, (1600, 1200))
    return {**fabrication_facts(made), "pattern": quality_facts(design.quality())}


def _show_mesh(path: Path, source: Source) -> bool:
    from dsfab.surface import DEFAULT_TRIANGLES, mesh_facts, raw_mesh

    raw = raw_mesh(path, source.max_triangles or DEFAULT_TRIANGLES)
    facts = mesh_facts(path, raw, source.unit)
    taken, verdict = _verdict(path, source, raw)
    out(str(path))
    rows = [(label, value) for label, value in [*_lines(facts), ("build", verdict)] if value]
    width = max(len(label) for label, _ in rows)
    _show(f"  {label:<{width}}  {value}" for label, value in rows)
    return taken


def _verdict(path: Path, source: Source, raw: "RawMesh") -> tuple[bool, str]:
    from dsfab.preset.proposal import propose

    try:
        proposal = propose(path, source.unit, source.up, None, source.max_triangles, raw)
    except SurfaceError as error:
        return False, "refuses it: " + str(error).removeprefix(f"{path}: ")
    told = {one.topic: one.choice for one in proposal.decisions}
    if "pieces" in told:
        return False, "refuses it: " + told["pieces"]
    mended = [one.choice for one in proposal.decisions if one.topic == "mended"]
    turned = [text for text in proposal.given.repaired if "turned over" in text]
    sheets = [one.choice for one in proposal.decisions if one.topic == "sheets"]
    return True, "; ".join(["takes it", *(f"it mends: {text}" for text in mended), *turned, *sheets])


def _unit(facts: "MeshFacts") -> str:
    from dsfab.preset.proposal import size_doubt, sizes_in_other_units

    if facts.unit_said:
        doubt = size_doubt(facts.box, facts.unit) if facts.unit == facts.unit_guess else ""
        return f"{facts.unit_guess}, as the file says{doubt}"
    return "; ".join([facts.unit_guess, *sizes_in_other_units(facts.box, facts.unit)])


def _lines(facts: "MeshFacts") -> list[tuple[str, str]]:
    loops = facts.boundary_lengths
    counted = f"{len(loops)} {'loop' if len(loops) == 1 else 'loops'}: {', '.join(length(x) for x in loops[:6])}"
    return [
        ("size", " x ".join(length(side) for side in facts.box) + f" (read as {facts.unit})"),
        ("likely unit", _unit(facts)),
        (
            "mesh",
            f"{facts.vertices:,} vertices, {facts.faces:,} triangles, edges of {length(facts.mean_edge)} on average",
        ),
        ("polygons", f"{facts.polygons:,} in the file, cut into triangles" if facts.polygons < facts.faces else ""),
        ("area", f"{facts.area:.4g} m2"),
        ("volume", "" if facts.volume is None else f"{facts.volume:.4g} m3"),
        ("pieces", f"{facts.pieces:,}"),
        ("boundary", "none: the surface is closed" if facts.closed else counted + (" ..." if len(loops) > 6 else "")),
        ("genus", "" if facts.genus is None else str(facts.genus)),
        ("sharpest", f"{facts.smallest_angle:.1f} degrees is the smallest angle"),
        ("manifold", "yes, and oriented" if facts.manifold else "no"),
        *(("because", fault) for fault in facts.faults),
        *(("read", text) for text in facts.record.read),
        *(("repaired", text) for text in facts.record.repaired),
        *(("dropped", text) for text in facts.record.dropped),
    ]
