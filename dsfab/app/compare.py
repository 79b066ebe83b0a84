"""`dsfab compare`: a design against others of the same mass under the same loads."""

import shlex
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from dsfab.app.compare_one import Asked, compare_one
from dsfab.app.options import Mesh, Quiet, Set, Unit, read_preset
from dsfab.errors import DsfabError


def compare(
    preset: str,
    /,
    *more: str,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    against: Annotated[
        str | None,
        Parameter(help="Comma list: isotropic, rotated, thinner, von_mises, grid, simp [isotropic,thinner]."),
    ] = None,
    volumes: Annotated[
        str | None,
        Parameter(help="LOW:HIGH:COUNT shares of the surface, such as 0.2:0.8:7: compare at each of them too."),
    ] = None,
    level: Annotated[
        Literal["quick", "full"] | None,
        Parameter(
            help="quick: one solve each. full: finer and finer meshes, for a compliance with a tested bound [full for "
            "the design, and for the best of each competitor if all take less than a minute; quick for --volumes]."
        ),
    ] = None,
    buckling: Annotated[bool, Parameter(negative=(), help="Also the lowest load factor of each.")] = False,
    frequency: Annotated[bool, Parameter(negative=(), help="Also the lowest natural frequency of each.")] = False,
    memory: Annotated[float, Parameter(help="GB that the solver may take for a full check.")] = 4.0,
    output: Annotated[
        Path | None,
        Parameter(
            name=["-o", "--output"],
            help="Folder for the results [outputs/NAME/compliance]; of several presets, a folder each in it.",
        ),
    ] = None,
    resume: Annotated[
        bool, Parameter(negative=(), help="Leave out presets that were compared already, by the same command.")
    ] = False,
    report: Annotated[bool, Parameter(help="Also write report.html and report.pdf.")] = True,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print results.json, no table.")] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer. Writes a report
    for an engineer (report.html, report.pdf), results.csv and results.json, and with --volumes a chart of compliance
    over mass. Several presets are compared one after the other, whatever happens to one of them; a page with one line
    for each stands at the end. Exit code 1 where a design does not carry its loads.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    more
        Further ones.
    """
    from dsfab.study.baselines import DEFAULT, chosen

    names = DEFAULT if against is None else tuple(word.strip() for word in against.split(",") if word.strip())
    chosen(names)
    asked = Asked(names, shares_of(volumes), level, buckling, frequency, 1e9 * memory, report)
    options: dict[str, object] = {"mesh": mesh, "unit": unit, "against": against, "volumes": volumes, "level": level}
    options["memory"] = memory if memory != 4 else None
    flags = {"buckling": buckling, "frequency": frequency, "no-report": not report}
    command = partial(_command, changes=set_, options=options, flags=flags)
    if more or resume:
        from dsfab.app.compare_many import Batch

        batch = Batch(partial(read_preset, changes=set_, mesh=mesh, unit=unit), asked, command, output)
        return batch.run((preset, *more), resume, quiet, json_)
    given = read_preset(preset, set_, mesh, unit)
    folder = output if output is not None else Path("outputs") / given.name / "compliance"
    return compare_one(given, asked, folder, command(preset), quiet, json_)


def _command(preset: str, changes: tuple[str, ...], options: Mapping[str, object], flags: dict[str, bool]) -> str:
    """The command line that makes the same again, wherever it writes."""
    words = ["dsfab", "compare", preset, *(word for text in changes for word in ("--set", text))]
    words += [word for name, value in options.items() if value is not None for word in (f"--{name}", str(value))]
    return shlex.join([*words, *(f"--{name}" for name, asked in flags.items() if asked)])


def shares_of(text: str | None) -> list[float]:
    """'0.2:0.8:7' -> seven shares; none for None. Raises DsfabError for anything else."""
    if text is None:
        return []
    try:
        low, high, count = text.split(":")
        shares = [round(float(share), 6) for share in np.linspace(float(low), float(high), int(count))]
    except ValueError:
        shares = []
    if not shares or not (min(shares) > 0 and max(shares) < 1):
        raise DsfabError(
            f"--volumes {text!r} is not LOW:HIGH:COUNT with shares between 0 and 1; write for instance 0.2:0.8:7"
        )
    return shares
