"""Assignment of cells outside all stripes to members, and removal of stripes that follow a rim or kept band."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, edge_lengths
from dsfab.members.axes import MiddleLine
from dsfab.members.components import Component, nearest_line
from dsfab.slicing import Overlay
from dsfab.surface import connected


def owners(overlay: Overlay, found: list[Component]) -> Ints:
    """(m, f) component of each cell for each field, -1 for none; components without a field have no column."""
    member = np.full((overlay.sheet.surface.m, overlay.part.shape[1]), -1)
    for number, one in enumerate(found):
        if one.field >= 0:
            member[one.cells, one.field] = number
    return member


def with_loose(overlay: Overlay, found: list[Component]) -> list[Component]:
    """Return the components with all loose cells; together they have every cell."""
    surface, member = overlay.sheet.surface, owners(overlay, found)
    loose = np.asarray((member < 0).all(axis=1))
    if not loose.any():
        return found
    f, g = overlay.linked.T
    both = loose[f] & loose[g]
    _, patch = np.unique(connected(surface.m, f[both], g[both])[1][loose], return_inverse=True)
    of = np.full(surface.m, -1)
    of[loose] = patch.ravel()
    count = int(of.max()) + 1
    beside, length = _borders(overlay, member, of)
    area, around = _sizes(overlay, of, count)
    inside = np.flatnonzero(loose)[np.argsort(of[loose], kind="stable")]
    cells = np.split(inside, np.cumsum(np.bincount(of[loose]))[:-1])
    begin = np.searchsorted(beside[:, 0], np.arange(count + 1))
    more = list[Component]()
    for number, mine in enumerate(cells):
        here = slice(begin[number], begin[number + 1])
        others, shared = beside[here, 1], length[here]
        most = int(others[shared.argmax()]) if len(others) else -1
        broad = len(others) > 1 and 4 * area[number] / around[number] > 0.5 * found[most].width(surface.areas)
        if broad or not len(others):
            more.append(Component("fill" if broad else "plate", "", 0, mine, np.ones(len(mine), dtype=bool)))
        else:
            found[most] = found[most].along(mine, core=len(others) == 1)
    return found + more


def _borders(overlay: Overlay, member: Ints, patch: Ints) -> tuple[Ints, Floats]:
    """(b, 2) pairs of patch and adjacent component (m, f), ascending, and (b,) shared lengths (m)."""
    surface, total = overlay.sheet.surface, int(member.max()) + 1
    f, g = np.concatenate([overlay.linked, overlay.linked[:, ::-1]]).T
    edge = np.tile(surface.edges.of.ravel()[surface.edges.pairs[:, 0]], 2)
    across = (patch[f] >= 0) & (patch[g] < 0)
    f, g, metres = f[across], g[across], edge_lengths(surface.V, surface.edges.ends[edge[across]])
    row, field = np.nonzero(member[g] >= 0)
    key = patch[f[row]] * total + member[g[row], field]
    values, of = np.unique(key, return_inverse=True)
    shared = np.bincount(of.ravel(), metres[row], len(values)).astype(np.float64)
    return np.stack([values // total, values % total], axis=1).astype(np.int64), shared


def _sizes(overlay: Overlay, patch: Ints, count: int) -> tuple[Floats, Floats]:
    """(count,) areas of patches (m,), and (count,) lengths of their outlines."""
    surface = overlay.sheet.surface
    here = patch >= 0
    area = np.bincount(patch[here], surface.areas[here], count).astype(np.float64)
    size = surface.edge_lengths[surface.edges.of]
    whole = np.bincount(patch[here], size[here].sum(axis=1), count).astype(np.float64)
    f, g = overlay.linked.T
    inner = here[f] & (patch[f] == patch[g])
    pair = surface.edges.of.ravel()[surface.edges.pairs[:, 0]][inner]
    return area, whole - 2 * np.bincount(patch[f[inner]], surface.edge_lengths[pair], count)


FOLLOWS, INTO = 3.0, 1.5
"""A line follows kept material if it runs inside of it over more than FOLLOWS widths of that; a crossing at 20 degrees
takes 2.9. It ends INTO widths after it enters, beyond the middle, so that both meet.
"""


def without_followers(overlay: Overlay, found: list[Component]) -> list[Component]:
    """Return the components; strips lose the parts that follow another one, which takes over their cells."""
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
    """A line, opened where it is free if closed, and the first and last points of its parts inside of kept material.

    width : (k - 1,) width of the material that hides each segment, metres, or 0.    own_width : of the line's member.
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
    """First and last points of the hidden stretches of a line; gaps shorter than the line's width are closed."""
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
    """The remaining parts of a strip, and the cells of the removed parts with their first and last points."""
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
