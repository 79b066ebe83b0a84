"""The command `dsfab report`: utilisation of each member by a Eurocode."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dsfab.app.export import built_design, preset_and_folder
from dsfab.app.options import UNCHANGED, OutputName, Quiet, Source
from dsfab.app.terminal import Reporter, print_lines

if TYPE_CHECKING:
    from dsfab.design import Design, Progress

TABLES = ("member_utilisation.csv", "member_forces.csv")


def report(
    preset: str,
    /,
    *,
    output: Annotated[Path | None, OutputName(help="Folder for the files [outputs/NAME/members].")] = None,
    source: Source = UNCHANGED,
    quiet: Quiet = False,
) -> int:
    """Report the utilisation of each member by Eurocode 3 or 5: the worst members on the structure, diagrams, clauses.

    The material of the preset decides the code. Without a code, the report compares stress with strength.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote."""
    from dsfab.design import Design
    from dsfab.export import require_writable

    loaded, folder = preset_and_folder(preset, source)
    loaded.statics.require_strength()
    folder = output or folder / "members"
    require_writable(folder)
    with Reporter(quiet) as reporter:
        design = built_design(preset, loaded) or Design.from_preset(loaded, progress=reporter).until("slicing")
        command = shlex.join(["dsfab", "report", *source.command_words(preset)])
        files, lines = write_members(design, command, folder, reporter)
    if not quiet:
        print_lines((*lines, *(f"  {folder / name}" for name in files)))
    return 0


def write_members(design: "Design", command: str, folder: Path, progress: "Progress") -> tuple[list[str], list[str]]:
    """Write the report on the members, with tables, into `folder`. command : command line that the report shows.
    Return the names of the files, and the lines of a summary."""
    from dsfab.export import atomic_folder
    from dsfab.report.members import write_member_report

    progress("members", "summing up forces of members and checking each bay between two nodes")
    lines = [design.member_utilisation.standard, design.member_utilisation.summary]
    with atomic_folder(folder) as build_folder:
        progress("report", "drawing and writing report.html and report.pdf")
        files, missing = write_member_report(design, command, build_folder)
        for name in TABLES:
            design.write(build_folder / f"{design.preset.name}.{name}")
    return [*files, *(f"{design.preset.name}.{name}" for name in TABLES)], [*lines, *missing]
