"""The command `dsfab blender`, which writes the add-on for Blender."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.terminal import print_result
from dsfab.core.errors import DsfabError

UNSET = 'PYTHON = ""'  # Line of the add-on's text in which `addon` inserts the path of a Python with dsfab.


def addon(python: str) -> str:
    """Return the text of the add-on for Blender. python : path of a Python with dsfab."""
    text = Path(__file__).with_name("addon.py").read_text(encoding="utf-8")
    return text.replace(UNSET, f"PYTHON = {python!r}", 1)


def blender(
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"], help="Python file to write.")] = Path(
        "dsfab_blender.py"
    ),
    force: Annotated[bool, Parameter(negative=(), help="Overwrite an existing file.")] = False,
) -> int:
    """Write a Blender add-on that builds a structure from the active object's mesh, by this installation of dsfab."""
    from dsfab.export import atomic_file

    if output.suffix != ".py":
        raise DsfabError(f"-o {output} does not end in .py; write for instance -o {output.stem}.py")
    if output.exists() and not force:
        raise DsfabError(f"{output} exists already; choose another name with -o, or overwrite the file with --force")
    with atomic_file(output) as path:
        path.write_text(addon(sys.executable), encoding="utf-8")
    print_result(
        f"the add-on is in {output}; in Blender: Preferences > Add-ons > Install from Disk, then sidebar (N) > dsfab"
    )
    return 0
