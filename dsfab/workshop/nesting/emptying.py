"""Fewer sheets by spyrrow: the least used one is emptied into others, part by part, each of which is nested anew.

Sparrow, which spyrrow is the Python side of, packs one strip as short as it can; a sheet is one that may be so long.
It is asked only whether the parts of a sheet and one more have room. What it says is measured by our own
`least_clearance`; where it says nothing, what we had stays.
"""

import importlib.util
import json
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsfab.errors import PatternError
from dsfab.export import ProgramError, last_line, temporary_folder
from dsfab.workshop.nesting import spyrrow_program
from dsfab.workshop.nesting.clearance import least_clearance
from dsfab.workshop.nesting.columns import NEAR
from dsfab.workshop.nesting.filling import NestedPart
from dsfab.workshop.nesting.sheets import NestedSheet
from dsfab.workshop.parts import TOLERANCE, FlatPart

SECONDS = 10.0
"""Of the processor, for one sheet: of a score of parts it finds a way in some tenths of a second, or mostly never."""
SHEETS = 3
"""Sheets that a part is tried on, those with most room first."""
TRIES = 24
"""Sheets that are nested anew, at most: counted, for seconds would give other sheets on other machines."""
FULLEST = 0.92
"""Share of a sheet that parts may use: fuller ones are not tried."""
ROUNDED = 1e-5
"""Metres that are asked for besides the gap, for spyrrow reckons in single precision."""
SEED = 1


def require_spyrrow() -> None:
    """Raise PatternError where spyrrow is not installed."""
    if importlib.util.find_spec("spyrrow") is None:
        raise PatternError(
            "workshop.nesting = 'spyrrow' needs the library spyrrow; install it with: pip install \"dsfab[nesting]\""
        )


def emptied(sheets: Sequence[NestedSheet], gap: float, grain: bool = False) -> list[NestedSheet]:
    """The same parts on as many sheets or fewer, `gap` metres apart and from the edges.

    grain : whether parts of members lie along the sheets only.
    """
    found, tries = list(sheets), iter(range(TRIES))
    while len(found) > 1:
        fewer = _without_least(found, gap, grain, tries)
        if fewer is None:
            break
        found = fewer
    return found


def _without_least(
    sheets: Sequence[NestedSheet], gap: float, grain: bool, tries: Iterator[int]
) -> list[NestedSheet] | None:
    """The parts of all sheets without the least used one; None where one of its parts found no room, or tries ran
    out."""
    least = min(sheets, key=_area)
    others = [sheet for sheet in sheets if sheet is not least]
    for part in sorted((one.part for one in least.parts), key=lambda part: -part.area):
        for k in sorted(range(len(others)), key=lambda k: others[k].used)[:SHEETS]:
            full = _area(others[k]) + part.area > FULLEST * others[k].size[0] * others[k].size[1]
            if full or next(tries, None) is None:
                continue
            if tried := _with_part(others[k], part, gap, grain):
                others[k] = tried
                break
        else:
            return None
    return others


def _area(sheet: NestedSheet) -> float:
    """Square metres of its parts."""
    return sum(one.part.area for one in sheet.parts)


def _with_part(sheet: NestedSheet, part: FlatPart, gap: float, grain: bool) -> NestedSheet | None:
    """A sheet with one part more, all of its parts nested anew; None where that was not found, or does not hold."""
    parts = [*(one.part for one in sheet.parts), part]
    placed = _by_spyrrow(parts, sheet.size, gap, grain)
    if sorted(one.part.id for one in placed) != sorted(one.id for one in parts):
        return None
    outlines = [one.placed.outline for one in placed]
    if least_clearance(outlines, sheet.size, gap) < gap - NEAR:
        return None
    return replace(sheet, parts=tuple(placed))


def _by_spyrrow(parts: Sequence[FlatPart], size: tuple[float, float], gap: float, grain: bool) -> list[NestedPart]:
    """All parts on a sheet; none where it did not find a way, or came to a bad end."""
    apart = gap + ROUNDED + 2 * TOLERANCE  # outlines are asked for without corners that lie on a line
    job = {
        "items": [[part.contours[0].tolist(), _turns(part, size[1] - 2 * gap, grain)] for part in parts],
        "height": size[1],
        "length": size[0],  # it stays away from the edges by itself
        "gap": apart,
        "seed": SEED,
    }
    with temporary_folder("dsfab") as folder:
        path = Path(folder) / "job.json"
        path.write_text(json.dumps(job), encoding="utf-8")
        try:
            said = json.loads(last_line(spyrrow_program.__file__, str(path), seconds=SECONDS))
            return [NestedPart(parts[k], float(np.radians(turn % 360)), (x, y)) for k, turn, x, y in said or []]
        except (subprocess.TimeoutExpired, ProgramError, ValueError, TypeError, IndexError):
            return []


def _turns(part: FlatPart, tallest: float, grain: bool) -> list[float]:
    """Degrees by which a part may be turned: across the sheet where it is short enough."""
    across = part.size[0] <= tallest and not (grain and part.member)
    return [0.0, 90.0, 180.0, 270.0] if across else [0.0, 180.0]
