"""The command `dsfab size`: the thinnest sheet of the stock with which a structure meets its targets."""

import shlex
from pathlib import Path
from typing import Annotated

from dsfab.app.options import UNCHANGED, OutputName, Quiet, Source, Switch
from dsfab.app.terminal import ExitCode, Reporter, print_lines, print_result


def size(
    preset: str,
    /,
    *,
    source: Source = UNCHANGED,
    output: Annotated[Path | None, OutputName(help="TOML file for the new preset.")] = None,
    force: Annotated[bool, Switch(help="Overwrite an existing file.")] = False,
    quiet: Quiet = False,
) -> int:
    """Choose the thinnest sheet of the stock with which the cut structure meets the targets of [sizing].

    dsfab solves the cut sheet at two thicknesses, which give the results at all thicknesses. Then dsfab cuts and solves
    the design with the chosen thickness. If no thickness suffices, dsfab tries a larger fraction of material, then a
    smaller spacing of members. The exit code is 5 if nothing suffices.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a mesh file."""
    from dsfab.app.new import require_new_preset_file
    from dsfab.export import atomic_file
    from dsfab.preset.file import preset_toml
    from dsfab.study import sized_design, sizing_result

    if output:
        require_new_preset_file(output, force)
    with Reporter(quiet) as reporter:
        design = sized_design(source.read_preset(preset, thickness="open"), reporter)
    result = sizing_result(design)
    assert result is not None  # `sized_design` gives every design a result
    if not quiet:
        print_lines(result.lines(every=True))
        print_result(f"statics.thickness = {design.preset.statics.thickness:g}")
    if output:
        with atomic_file(output) as path:
            path.write_text(preset_toml(design.preset), encoding="utf-8")
        print_result(
            f"the preset was written to {output}; build the design with: dsfab build {shlex.quote(str(output))}"
        )
    return ExitCode.DONE if result.fits else ExitCode.DOES_NOT_CARRY
