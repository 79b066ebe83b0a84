"""The command `dsfab new`: proposes a preset with comments for the user's mesh."""

import os
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.options import NO_MESH_FLAGS, MaxTriangles, MeshFlags, OutputName, Switch, Unit, Up
from dsfab.app.terminal import print_lines, print_result
from dsfab.core.errors import PresetError


@Parameter(name="*")
@dataclass(frozen=True)
class PresetFile:
    """Options of `dsfab new` for the file that it writes."""

    output: Annotated[Path | None, OutputName(help="TOML file to write [NAME.toml].")] = None
    force: Annotated[bool, Switch(help="Overwrite an existing file.")] = False


PRESET_FILE = PresetFile()  # The default file of a preset.


def new(
    mesh: Path,
    /,
    *,
    file: PresetFile = PRESET_FILE,
    unit: Unit = None,
    up: Up = None,
    max_triangles: MaxTriangles = None,
    material: Annotated[str | None, Parameter(help="Name of the material; `dsfab materials` lists all names.")] = None,
    flags: MeshFlags = NO_MESH_FLAGS,
) -> int:
    """Write a preset for a surface of your own, with sensible values and a line for each decision.

    dsfab proposes unit, vertical axis, supports and loads of the mesh, then thickness, pattern and widths. If dsfab is
    in doubt, it first prints questions, with options that answer them. `dsfab build` takes the preset or the mesh.

    Parameters
    ----------
    mesh
        OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP, BREP or IFC."""
    from dsfab.export import atomic_file
    from dsfab.preset.proposal import propose

    if mesh.suffix == ".toml":
        raise PresetError(f"{mesh} is a preset already; dsfab new takes a mesh file")
    proposal = propose(mesh, unit, up, material, max_triangles, wishes=flags.wishes)
    target = file.output or Path(f"{proposal.given.name}.toml")
    require_new_preset_file(target, file.force)
    text = proposal.text(_relative_path(target, mesh))
    with atomic_file(target) as path:
        path.write_text(text, encoding="utf-8")
    print_lines((*proposal.questions, *proposal.lines))
    print_result(f"the preset was written to {target}; build the design with: dsfab build {shlex.quote(str(target))}")
    return 0


def require_new_preset_file(target: Path, force: bool) -> None:
    """Raise PresetError for a name that does not end in .toml, and for an existing file unless `force` is True."""
    if target.suffix != ".toml":
        raise PresetError(f"-o {target} does not end in .toml; write for instance -o {target.stem}.toml")
    if target.exists() and not force:
        raise PresetError(f"{target} exists already; choose another name with -o, or overwrite the file with --force")


def _relative_path(preset: Path, mesh: Path) -> Path:
    try:
        return Path(os.path.relpath(mesh.absolute(), preset.absolute().parent))
    except ValueError:  # the mesh is on another drive
        return mesh.absolute()
