"""`dsfab new`: a mesh of the user's own to a commented preset."""

import os
import shlex
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.options import MaxTriangles, Unit, Up
from dsfab.app.terminal import out
from dsfab.errors import PresetError


def new(
    mesh: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="TOML file to write [NAME.toml].")] = None,
    unit: Unit = None,
    up: Up = None,
    max_triangles: MaxTriangles = None,
    material: Annotated[str | None, Parameter(help="What it is made of; `dsfab materials` lists names.")] = None,
    force: Annotated[bool, Parameter(negative=(), help="Write over a file that is there.")] = False,
) -> int:
    """Write a preset for a surface of your own: what a sensible architect would decide, a line for each decision.

    It reads the mesh, guesses its unit and its vertical axis, finds where it stands, and chooses loads, thickness,
    pattern and widths by its size. `dsfab build` takes the preset, and the mesh itself as well.

    Parameters
    ----------
    mesh
        OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP or BREP.
    """
    from dsfab.export import replacing
    from dsfab.proposal import propose

    if mesh.suffix == ".toml":
        raise PresetError(f"{mesh} is a preset already; dsfab new takes a mesh file")
    proposal = propose(mesh, unit, up, material, max_triangles)
    target = output or Path(f"{proposal.given.name}.toml")
    if target.suffix != ".toml":
        raise PresetError(f"-o {target}: a preset is a .toml file; write for instance -o {target.stem}.toml")
    if target.exists() and not force:
        raise PresetError(f"{target} is there already; choose another name with -o, or write over it with --force")
    text = proposal.text(_from(target, mesh))
    with replacing(target) as path:
        path.write_text(text, encoding="utf-8")
    for line in proposal.lines:
        out(line)
    out(f"written to {target}; build it: dsfab build {shlex.quote(str(target))}")
    return 0


def _from(preset: Path, mesh: Path) -> Path:
    """The mesh's path as the preset's folder sees it."""
    try:
        return Path(os.path.relpath(mesh.absolute(), preset.absolute().parent))
    except ValueError:  # another drive
        return mesh.absolute()
