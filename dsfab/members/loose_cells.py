"""Assign cells without a member to members, and remove parts of strips that run inside a rim."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, edge_lengths
from dsfab.members.axes import MiddleLine
from dsfab.members.components import Component, nearest_line
from dsfab.slicing import Overlay
from dsfab.surface import link_components


def owners(overlay: Overlay, components: list[Component]) -> Ints:
    """Return the number (m, f) of the component (future member) with each cell, for each of f layers; -1 for none."""
    member = np.full((overlay.sheet.surface.m, overlay.part.shape[1]), -1)
    for number, component in enumerate(components):
        if component.field >= 0:
            member[component.cells, component.field] = number
    return member


def with_loose_cells(overlay: Overlay, components: list[Component]) -> list[Component]:
    """Return the components (future members). Cells without a component join a neighbour, or form new components."""
    surface, member = overlay.sheet.surface, owners(overlay, components)
    loose = np.asarray((member < 0).all(axis=1))
    if not loose.any():
        return components
    f, g = overlay.adjacent_cells.T
    both_loose = loose[f] & loose[g]
    _, patch = np.unique(link_components(surface.m, f[both_loose], g[both_loose])[1][loose], return_inverse=True)
    patch_of_cell = np.full(surface.m, -1)
    patch_of_cell[loose] = patch.ravel()
    count = int(patch_of_cell.max()) + 1
    borders, length = _borders(overlay, member, patch_of_cell)
    area, around = _sizes(overlay, patch_of_cell, count)
    inside = np.flatnonzero(loose)[np.argsort(patch_of_cell[loose], kind="stable")]
    cells = np.split(inside, np.cumsum(np.bincount(patch_of_cell[loose]))[:-1])
    begin = np.searchsorted(borders[:, 0], np.arange(count + 1))
    result = list[Component]()
    for number, patch_cells in enumerate(cells):
        rows = slice(begin[number], begin[number + 1])
        neighbours, shared = borders[rows, 1], length[rows]
        j = int(neighbours[shared.argmax()]) if len(neighbours) else -1
        broad = len(neighbours) > 1 and 4 * area[number] / around[number] > 0.5 * components[j].width(surface.areas)
        if broad or not len(neighbours):
            core = np.ones(len(patch_cells), dtype=bool)
            result.append(Component("fill" if broad else "plate", "", 0, patch_cells, core))
        else:
            components[j] = components[j].with_cells(patch_cells, core=len(neighbours) == 1)
    return components + result


def _borders(overlay: Overlay, member: Ints, patch: Ints) -> tuple[Ints, Floats]:
    """Return sorted pairs (b, 2) of a patch and an adjacent component, and the lengths (b,) of common borders, m.
    member : (m, f) component of each cell, or -1.    patch : (m,) patch of cells without a component, or -1."""
    surface, total = overlay.sheet.surface, int(member.max()) + 1
    f, g = np.concatenate([overlay.adjacent_cells, overlay.adjacent_cells[:, ::-1]]).T
    edge = np.tile(surface.edges.of.ravel()[surface.edges.pairs[:, 0]], 2)
    across = (patch[f] >= 0) & (patch[g] < 0)
    f, g, metres = f[across], g[across], edge_lengths(surface.V, surface.edges.ends[edge[across]])
    row, field = np.nonzero(member[g] >= 0)
    key = patch[f[row]] * total + member[g[row], field]
    values, pair = np.unique(key, return_inverse=True)
    shared = np.bincount(pair.ravel(), metres[row], len(values)).astype(np.float64)
    return np.stack([values // total, values % total], axis=1).astype(np.int64), shared


def _sizes(overlay: Overlay, patch: Ints, count: int) -> tuple[Floats, Floats]:
    surface = overlay.sheet.surface
    inside = patch >= 0
    area = np.bincount(patch[inside], surface.areas[inside], count).astype(np.float64)
    size = surface.edge_lengths[surface.edges.of]
    perimeter = np.bincount(patch[inside], size[inside].sum(axis=1), count).astype(np.float64)
    f, g = overlay.adjacent_cells.T
    inner = inside[f] & (patch[f] == patch[g])
    pair = surface.edges.of.ravel()[surface.edges.pairs[:, 0]][inner]
    return area, perimeter - 2 * np.bincount(patch[f[inner]], surface.edge_lengths[pair], count)


FOLLOWS, INTO = 3.0, 1.5
"""A strip is cut if its middle line runs inside kept material, such as a rim, for over FOLLOWS widths of the material.
The strip then ends INTO widths after its entry into the material, so that the middle lines still meet."""


def without_followers(overlay: Overlay, components: list[Component]) -> list[Component]:
    """Return the components (future members) without long parts of strips inside kept material, such as a rim."""
    areas, made_by = overlay.sheet.surface.areas, overlay.sheet.family
    member = owners(overlay, components)
    is_kept = np.array([c.kind != "strip" and c.field >= 0 for c in components], dtype=bool)
    width = np.array([c.width(areas) if keeps else 0.0 for c, keeps in zip(components, is_kept, strict=True)] + [0.0])
    over = np.where((made_by >= 0) & overlay.own, member[np.arange(len(made_by)), made_by], -1)
    over[~np.append(is_kept, False)[over]] = -1
    result, gained = list[Component](), dict[int, list[Ints]]()
    for c in components:
        if c.kind != "strip" or c.line is None:
            result.append(c)
            continue
        line, gone = _hidden_parts(c.line, width[over[c.line.cells]], c.width(areas))
        parts, rest = _split_strip(overlay, c, line, gone)
        result += parts
        for cells, (first, last) in rest:
            hiding = over[line.cells[first:last]]
            taker = int(np.bincount(hiding[hiding >= 0]).argmax())
            gained.setdefault(taker, []).append(cells[made_by[cells] == c.field])
    for taker, groups in gained.items():
        place, taken = result.index(components[taker]), np.setdiff1d(np.concatenate(groups), components[taker].cells)
        result[place] = components[taker].with_cells(taken, core=True)
    return result


def _hidden_parts(line: MiddleLine, width: Floats, own_width: float) -> tuple[MiddleLine, list[tuple[int, int]]]:
    """Return a strip's middle line, and the pairs (first point, last point) of the long parts inside kept material.
    width : width (m) of the kept material along the line, 0 outside.    own_width : width of the strip, m."""
    if line.closed and (bare := np.flatnonzero(width == 0)).size:
        line, width = line.opened_at(int(bare[0])), np.roll(width, -int(bare[0]))
    last_point, gone = len(line.points) - 1, []
    for first, last in _hidden_stretches(line, width, own_width):
        reach = width[first:last].max()
        if line.s[last] - line.s[first] > FOLLOWS * reach:
            into = np.searchsorted(line.s, [line.s[first] + INTO * reach, line.s[last] - INTO * reach])
            gone.append((int(into[0]) if first else 0, int(into[1]) if last < last_point else last_point))
    if line.closed and gone:
        cut = gone[0][1]
        line = line.opened_at(cut)
        gone = [((a - cut) % last_point, (b - cut) % last_point or last_point) for a, b in gone]
    return line, sorted(gone)


def _hidden_stretches(line: MiddleLine, width: Floats, own_width: float) -> list[tuple[int, int]]:
    edge = np.diff(np.concatenate([[False], width > 0, [False]]).astype(int))
    stretches = list[tuple[int, int]]()
    for first, last in zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True):
        if stretches and line.s[first] - line.s[stretches[-1][1]] < own_width:
            stretches[-1] = stretches[-1][0], last
        else:
            stretches.append((first, last))
    return stretches


def _split_strip(
    overlay: Overlay, strip: Component, line: MiddleLine, gone: list[tuple[int, int]]
) -> tuple[list[Component], list[tuple[Ints, tuple[int, int]]]]:
    if not gone:
        return [strip], []
    points = sorted({0, len(line.points) - 1, *(point for pair in gone for point in pair)})
    pieces = list(pairwise(points))
    lines = [line.section(*piece) for piece in pieces]
    owner = nearest_line(overlay, strip.cells, lines)
    remaining, rest = list[Component](), list[tuple[Ints, tuple[int, int]]]()
    for number, piece in enumerate(pieces):
        cells = strip.cells[owner == number]
        if piece in gone:
            rest.append((cells, piece))
        elif len(cells):
            remaining.append(replace(strip, cells=cells, core=np.ones(len(cells), bool), line=lines[number]))
    return remaining, rest
