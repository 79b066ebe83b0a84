"""Options that `dsfab preview` and `dsfab explore` share, and what they mean."""

from typing import Annotated

from cyclopts import Parameter

from dsfab.errors import DsfabError

SMALLEST, LARGEST = 64, 8000
"""Pixels of a side of a picture."""

View = Annotated[str, Parameter(help="iso, top, front, side, or azimuth,elevation in degrees.")]
Show = Annotated[
    str,
    Parameter(
        help="structure, families, stress, major, minor; of the uncut sheet: loads, directions, major_mode, "
        "minor_mode, vonmises, utilisation, energy, displacement, buckling, frequency."
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
