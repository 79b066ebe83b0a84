"""Options that several commands share, and what they mean."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.errors import DsfabError

if TYPE_CHECKING:
    from dsfab.preset import Preset

SMALLEST, LARGEST = 64, 8000
"""Pixels of a side of a picture."""

Set = Annotated[tuple[str, ...], Parameter(name="--set", negative=(), help="Override a value: KEY=VALUE (repeatable).")]
Mesh = Annotated[Path | None, Parameter(name="--mesh", help="Mesh file that takes the place of the preset's surface.")]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative=(), help="Say nothing but errors.")]
Unit = Annotated[str | None, Parameter(name="--unit", help="Unit of the mesh file: mm, cm, m, in, ft.")]


View = Annotated[str, Parameter(help="iso, top, front, side, or azimuth,elevation in degrees.")]
Show = Annotated[
    str,
    Parameter(
        help="structure, families, stress, major, minor; of the uncut sheet: loads, directions, major_mode, "
        "minor_mode, vonmises, utilisation, energy, displacement, buckling, frequency; fabrication (preview only): the "
        "finished solid and where its smallest member, gap, wall and edge are."
    ),
]


def picture_size(text: str) -> tuple[int, int]:
    """'1600x1200' as (1600, 1200); raises DsfabError for anything else."""
    words = text.lower().split("x")
    if len(words) == 2 and all(word.isdigit() for word in words):
        width, height = int(words[0]), int(words[1])
        if all(SMALLEST <= side <= LARGEST for side in (width, height)):
            return width, height
    raise DsfabError(
        f"--size {text!r} is not WIDTHxHEIGHT, sides of {SMALLEST} to {LARGEST} pixels; write for instance 1600x1200"
    )


def read_preset(
    name: str, changes: tuple[str, ...] = (), mesh: Path | None = None, unit: str | None = None
) -> "Preset":
    """The preset of a command line, with its overrides."""
    from dsfab.preset_file import load_preset, parse_override

    overrides = dict(parse_override(text) for text in changes)
    if unit is not None:
        overrides["surface.unit"] = unit
    return load_preset(name, overrides, mesh)
