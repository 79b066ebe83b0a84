"""Stripes that run into what is kept and follow it: there they are no members.

A stripe goes on below a rim, as it does below another stripe. Where it turns and runs along the rim, its middle lies in
that, and what is left of it beside the rim is a sliver:

        |   |                        |   |
        |   +---------               |   |
    ----+ - - - - - - -     ->   ----+ - + - - - -     It ends past the middle of the rim, as those do that cross it.
    rim  +-------------          rim +---+             What it had farther on, in the rim and beside it, is the rim's.
    -------------------          -----------------
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.members.components import Component, nearest_line
from dsfab.members.loose import owners
from dsfab.members.middle_lines import MiddleLine
from dsfab.slicing import Overlay

FOLLOWS, INTO = 3.0, 1.5
"""A line follows what is kept where it lies in that over more than so many of its widths: across it, at an angle of 20
degrees, it would over 2.9. And so many widths it goes in: its end is past the middle, where it meets that."""


def without_followers(overlay: Overlay, found: list[Component]) -> list[Component]:
    """The components: strips without what of them follows another one, and those with the cells that it made."""
    areas, made = overlay.sheet.surface.areas, overlay.sheet.family
    member = owners(overlay, found)
    kept = np.array([one.kind != "strip" and one.field >= 0 for one in found], dtype=bool)
    width = np.array([one.width(areas) if keeps else 0.0 for one, keeps in zip(found, kept, strict=True)] + [0.0])
    over = np.where((made >= 0) & overlay.own, member[np.arange(len(made)), made], -1)
    over[~np.append(kept, False)[over]] = -1
    left, given = list[Component](), dict[int, list[Ints]]()
    for one in found:
        if one.kind != "strip" or one.line is None:
            left.append(one)
            continue
        line, gone = _following(one.line, width[over[one.line.cells]], one.width(areas))
        parts, rest = _divided(overlay, one, line, gone)
        left += parts
        for cells, (first, last) in rest:
            beside = over[line.cells[first:last]]
            taker = int(np.bincount(beside[beside >= 0]).argmax())
            given.setdefault(taker, []).append(cells[made[cells] == one.field])
    for taker, some in given.items():
        place, taken = left.index(found[taker]), np.setdiff1d(np.concatenate(some), found[taker].cells)
        left[place] = found[taker].along(taken, core=True)
    return left


def _following(line: MiddleLine, width: Floats, own: float) -> tuple[MiddleLine, list[tuple[int, int]]]:
    """A line, one that is closed opened where it follows something, and the first and last points of those places.

    width : (k - 1,) of what hides its segments, metres, or 0.    own : its own width.
    """
    if line.closed and (bare := np.flatnonzero(width == 0)).size:
        line, width = line.opened(int(bare[0])), np.roll(width, -int(bare[0]))
    last_point, gone = len(line.points) - 1, []
    for first, last in _hidden(line, width, own):
        reach = width[first:last].max()
        if line.s[last] - line.s[first] > FOLLOWS * reach:
            into = np.searchsorted(line.s, [line.s[first] + INTO * reach, line.s[last] - INTO * reach])
            gone.append((int(into[0]) if first else 0, int(into[1]) if last < last_point else last_point))
    if line.closed and gone:
        at = gone[0][1]
        line, gone = line.opened(at), [((a - at) % last_point, (b - at) % last_point or last_point) for a, b in gone]
    return line, sorted(gone)


def _hidden(line: MiddleLine, width: Floats, own: float) -> list[tuple[int, int]]:
    """First and last points of the stretches of a line that something hides; those beside each other are one if what
    is between them is shorter than the line is wide."""
    edge = np.diff(np.concatenate([[False], width > 0, [False]]).astype(int))
    found = list[tuple[int, int]]()
    for first, last in zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True):
        if found and line.s[first] - line.s[found[-1][1]] < own:
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    return found


def _divided(
    overlay: Overlay, one: Component, line: MiddleLine, gone: list[tuple[int, int]]
) -> tuple[list[Component], list[tuple[Ints, tuple[int, int]]]]:
    """The parts of a strip that stay; and the cells of those that are gone, with their first and last points."""
    if not gone:
        return [one], []
    points = sorted({0, len(line.points) - 1, *(point for pair in gone for point in pair)})
    pieces = list(pairwise(points))
    lines = [line.between(*piece) for piece in pieces]
    owner = nearest_line(overlay, one.cells, lines)
    left, rest = list[Component](), list[tuple[Ints, tuple[int, int]]]()
    for number, piece in enumerate(pieces):
        cells = one.cells[owner == number]
        if piece in gone:
            rest.append((cells, piece))
        elif len(cells):
            left.append(replace(one, cells=cells, core=np.ones(len(cells), bool), line=lines[number]))
    return left, rest
