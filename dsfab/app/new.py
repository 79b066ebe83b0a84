"""The command `dsfab new`: proposes a preset with comments for the user's mesh."""

import os
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.options import NO_MESH_FLAGS, MaxTriangles, MeshFlags, Unit, Up
from dsfab.app.terminal import print_lines, print_result
from dsfab.core.errors import DsfabError, PresetError

if TYPE_CHECKING:
    from dsfab.preset.proposal import Proposal


@Parameter(name="*")
@dataclass(frozen=True)
class PresetFile:
    """File of the preset."""

    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="TOML file to write [NAME.toml].")] = None
    force: Annotated[bool, Parameter(negative=(), help="Overwrite an existing file.")] = False


PRESET_FILE = PresetFile()  # The default file of a preset.


def new(
    mesh: Path,
    /,
    *,
    file: PresetFile = PRESET_FILE,
    unit: Unit = None,
    up: Up = None,
    max_triangles: MaxTriangles = None,
    material: Annotated[str | None, Parameter(help="Material; `dsfab materials` lists names.")] = None,
    flags: MeshFlags = NO_MESH_FLAGS,
) -> int:
    """Write a preset for a surface of your own, with sensible values and a line for each decision.

    It reads the mesh and judges by their statics what its unit, its vertical axis and its supports may be. Loads follow
    from the kind of surface; thickness, pattern and widths from its size. Doubts come first, each as a question with
    the option that settles it. `dsfab build` takes the preset, and the mesh itself as well.

    Parameters
    ----------
    mesh
        OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP or BREP."""
    from dsfab.export import atomic_file
    from dsfab.preset.proposal import propose

    if mesh.suffix == ".toml":
        raise PresetError(f"{mesh} is a preset already; dsfab new takes a mesh file")
    proposal = propose(mesh, unit, up, material, max_triangles, wishes=flags.wishes)
    target = file.output or Path(f"{proposal.given.name}.toml")
    if target.suffix != ".toml":
        raise PresetError(f"-o {target} does not end in .toml; write for instance -o {target.stem}.toml")
    if target.exists() and not file.force:
        raise PresetError(f"{target} exists already; choose another name with -o, or overwrite the file with --force")
    text = proposal.text(_relative_path(target, mesh))
    with atomic_file(target) as path:
        path.write_text(text, encoding="utf-8")
    print_lines((*proposal.questions, *proposal.lines))
    if warning := strength_warning(proposal):
        print_result(warning)
    print_result(f"written to {target}; build it: dsfab build {shlex.quote(str(target))}")
    return 0


def strength_warning(proposal: "Proposal") -> str:
    """Return a warning if a sheet with a span over 50 m is overstressed before the cut; else ''.
    Such a sheet may fail under its own weight at any thickness. The solution takes seconds. After an error the text is
    empty, because `dsfab build` reports the error."""
    from dsfab.design import Design
    from dsfab.report.design.statics import answer_facts

    size = proposal.plan.size
    if not proposal.preset.statics.strength or max(size.span, size.bridged) < 50:
        return ""
    try:
        design = Design.from_preset(proposal.preset)
        parts, areas = design.load.parts, design.surface.areas[:, None]
        facts = [answer_facts(design, case) for case in design.statics.cases.values()]
    except DsfabError:
        return ""
    largest_share, usual_share = (max(fact[key] for fact in facts) for key in ("utilisation", "utilisation_99"))
    if largest_share <= 1 or parts is None:
        return ""
    weight = abs((parts.weight * areas).sum(axis=0)[2] / (parts.traction * areas).sum(axis=0)[2])
    advice = "make it thicker (statics.thickness)"
    if weight > 0.6:  # a thicker sheet is heavier, so its stress is no lower
        weight_words = f"{weight:.0%} of its load is its own weight, and a thicker one weighs more"
        advice = f"{weight_words}: give it more feet, or more rise"
    topic = f"{'bears':<{max(len(decision.topic) for decision in proposal.decisions)}}"
    shares = f"{largest_share:.0%} of its strength, {usual_share:.0%} on 99 % of it"
    return f"{topic}  {shares}, and more once it is cut; {advice}"


def _relative_path(preset: Path, mesh: Path) -> Path:
    try:
        return Path(os.path.relpath(mesh.absolute(), preset.absolute().parent))
    except ValueError:  # the mesh is on another drive
        return mesh.absolute()
