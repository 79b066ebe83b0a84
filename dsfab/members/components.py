"""Components (groups of mesh faces) of a sheet that become members."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.members.axes import SPECK, MiddleLine, middle_lines, straight_parts, without_specks
from dsfab.results import PatternResult
from dsfab.slicing import DrawnBand, Overlay, Sheet, divided_field_values, stripe_overlay
from dsfab.surface import CornerField, DividedField, Surface, link_components

Kind = Literal["strip", "stub", "rim", "band", "ring", "disc", "plate", "fill"]
"""Kinds of members, see `dsfab.members.graph.Member`. At first, material around supports has the kind "keep"."""
FAMILIES = {"major": "A", "minor": "B"}  # First letter of the names of members, for each family of stripes.
NOWHERE = 10.0  # Value of `DrawnBand.centre` for material without a middle line, larger than all real values.


class NamedBand(NamedTuple):
    """Stripes of a field of the pattern, with the kind of their members and the field's name `family`."""

    kind: str
    family: str
    drawn: DrawnBand


def pattern_bands(surface: Surface, sheet: Sheet, pattern: PatternResult) -> list[NamedBand]:
    """Return the stripes along which the sheet was cut, for each field of the pattern."""
    bands = []
    for k, (name, field, levels) in enumerate(zip(pattern.names, pattern.fields, pattern.levels, strict=True)):
        if name in FAMILIES:
            bands.append(NamedBand("strip", name, _stripe_band(sheet, pattern, k)))
            continue
        assert not isinstance(field, CornerField)
        x = divided_field_values(sheet, surface, field) if isinstance(field, DividedField) else sheet.carry(field)
        kind, band = _kept_band(f"{name} {k}", x, float(levels[0]))
        bands.append(NamedBand(name if kind == "reach" else kind, name, band))
    return bands


def _stripe_band(sheet: Sheet, pattern: PatternResult, k: int) -> DrawnBand:
    name, field, levels = pattern.names[k], pattern.fields[k], pattern.levels[k]
    if isinstance(field, CornerField):
        return DrawnBand(name, field, levels)
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return DrawnBand(name, sheet.carry(field), levels)
    which, d = list(FAMILIES).index(name), pattern.half_widths[k]
    if (d >= 0.5).all():  # stripes that touch form no members
        return DrawnBand(name, np.tile([1.0, -1.0], (sheet.surface.n, 1)), np.zeros(1), NOWHERE)
    z = pattern.frequency[which] * field + pattern.phase[which]
    whole_numbers = np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2)
    return DrawnBand(name, sheet.carry(np.stack([z + d, z - d], axis=1)), whole_numbers)


def _kept_band(name: str, x: Floats, level: float) -> tuple[str, DrawnBand]:
    """Return the kind and the stripes of material that a field x keeps uncut.
    The kind is "reach" (within a distance), "plate" (region) or "band" (along an outline)."""
    zero = np.zeros(1)
    if x.ndim == 2:  # band: column 0 is positive inside the outline, column 1 is distance from the outline - width
        width = -float(x[:, 1].min())
        inward = np.where(x[:, 0] >= 0, -x[:, 1], x[:, 1] + 2 * width)
        return "band", DrawnBand(name, np.stack([inward, inward - width], axis=1), zero, hides=True)
    if level == 0:
        return "plate", DrawnBand(name, np.stack([x, np.full(len(x), -2.0)], axis=1), zero, NOWHERE, hides=True)
    reach = -level
    return "reach", DrawnBand(name, np.stack([x + reach, x - reach], axis=1), zero, -reach / 2, hides=True)


DISC = 0.4  # Kept material is a disc if its area is over DISC x the area of a circle with the same perimeter.
HIDDEN, COVERED = 0.05, 0.3
"""A member is dropped if at most this fraction of its area is visible: HIDDEN for strips, COVERED otherwise."""


@dataclass(frozen=True, eq=False)
class Component:
    """The mesh faces ("cells") of a future member.
    kind   : "strip", "rim", "band", "ring", "disc", "plate" or "fill".    family : family of the pattern, or "".
    stripe : number of the stripe; 0 for none.    group : equal number for all parts of a stripe; -1 for none.
    cells  : (c,) numbers of faces of the divided sheet, ascending.
    core   : (c,) True for cells that define the member's width.
    line   : middle line, or None.    field : number of the field; -1 for none."""

    kind: str
    family: str
    stripe: int
    cells: Ints
    core: Bools
    line: MiddleLine | None = None
    field: int = -1
    group: int = -1

    def width(self, areas: Floats) -> float:
        """Return the width (m): area / length of the middle line, or the root of the area without a line.
        areas : (m,) areas of all mesh faces, m2."""
        area = float(areas[self.cells[self.core]].sum())
        return area / self.line.length if self.line else float(np.sqrt(area))

    def with_cells(self, extra_cells: Ints, core: bool) -> "Component":
        """Return the component with additional mesh faces (k,). core : True if these faces count for the width."""
        cells = np.concatenate([self.cells, extra_cells])
        order = np.argsort(cells, kind="stable")
        marks = np.concatenate([self.core, np.full(len(extra_cells), core)])
        return replace(self, cells=cells[order], core=marks[order])


def components(overlay: Overlay, bands: list[NamedBand], normals: Floats, edge: float) -> list[Component]:
    """Return the components of a sheet with its stripes (`overlay`). A face at a crossing is in several components.
    normals : (n, 3) unit normals at the vertices of the sheet.    edge : mean edge of the uncut mesh, metres."""
    pieces = list[Component]()
    round_ = roundness(overlay)
    for k, band in enumerate(bands):
        lines = _lines(overlay, k, normals)
        for stripe in np.flatnonzero(overlay.of == k).tolist():
            cells = np.flatnonzero(overlay.part[:, k] == stripe)
            if band.drawn.centre < NOWHERE and _is_sliver(overlay, k, cells, lines.get(stripe, [])):
                continue
            kind = _kind(band.kind, round_[stripe], lines.get(stripe, []))
            level, core = int(overlay.level[stripe]), np.ones(len(cells), bool)
            component = Component(kind, band.family, level, cells, core, None, k, stripe)
            pieces += _parts(overlay, component, lines.get(stripe, []), edge)
    return _visible(overlay, pieces)


def _lines(overlay: Overlay, k: int, normals: Floats) -> dict[int, list[MiddleLine]]:
    offset = overlay.offset[:, :, k]
    lines = middle_lines(overlay, k, offset, normals)
    part = overlay.part[:, k]
    bare = np.setdiff1d(np.flatnonzero(overlay.of == k), list(lines))
    cells = np.flatnonzero(np.isin(part, bare))
    if not len(cells):
        return lines
    area, away = overlay.sheet.surface.areas[cells], np.abs(offset[cells])
    total = np.bincount(part[cells], area, len(overlay.of))
    mean = np.bincount(part[cells], area * away.mean(axis=1), len(overlay.of)) / np.where(total > 0, total, 1)
    shifted = np.full_like(offset, np.nan)
    shifted[cells] = away - mean[part[cells], None]
    shifted[shifted == 0] = np.finfo(float).tiny
    flat = np.ptp(away, axis=1).max(initial=0) < 1e-12
    return lines if flat else lines | middle_lines(overlay, k, shifted, normals)


def _is_sliver(overlay: Overlay, k: int, cells: Ints, lines: list[MiddleLine]) -> bool:
    offset, surface = overlay.offset[cells, :, k], overlay.sheet.surface
    if not lines or ((offset.min(axis=1) < 0) & (offset.max(axis=1) > 0)).any():
        return False
    away, length = np.abs(offset), lines[0].length
    width = float(surface.areas[cells].sum()) / length
    return bool(length < SPECK * width * 2 * away.max() / np.ptp(away))


def _kind(kind: str, roundness: float, lines: list[MiddleLine]) -> str:
    if kind != "keep":
        return kind
    if roundness > DISC:
        return "disc"
    return "ring" if lines and lines[0].closed else "band"


def roundness(overlay: Overlay) -> Floats:
    """Return the roundness (k,) of each stripe: 4 pi area / (length of the outline)^2, which is 1 for a disc."""
    surface, result = overlay.sheet.surface, np.zeros(len(overlay.of))
    size = surface.edge_lengths
    f, g = overlay.adjacent_cells.T
    pair = surface.edges.of.ravel()[surface.edges.pairs[:, 0]]
    alone = surface.edges.boundary
    single = surface.edges.order[surface.edges.start[:-1][alone]] // 3
    for k in range(overlay.part.shape[1]):
        part = overlay.part[:, k]
        around = np.zeros(len(overlay.of))
        differ = part[f] != part[g]
        for side, length in ((f[differ], size[pair[differ]]), (g[differ], size[pair[differ]]), (single, size[alone])):
            inside = part[side] >= 0
            around += np.bincount(part[side][inside], length[inside], len(around))
        inside = part >= 0
        area = np.bincount(part[inside], surface.areas[inside], len(around))
        of_field = overlay.of == k
        result[of_field] = 4 * np.pi * area[of_field] / around[of_field] ** 2
    return result


def _parts(overlay: Overlay, component: Component, lines: list[MiddleLine], edge: float) -> list[Component]:
    if not lines:
        kind = "plate" if component.kind in ("strip", "disc") else component.kind
        return [replace(component, kind=kind)]
    if component.kind == "disc":
        return [replace(component, line=lines[0])]
    width = float(overlay.sheet.surface.areas[component.cells].sum()) / sum(line.length for line in lines)
    parts = [part for line in without_specks(lines, width) for part in straight_parts(line, width, edge)]
    owner = nearest_line(overlay, component.cells, parts)
    pieces = []
    for number, line in enumerate(parts):
        cells = component.cells[owner == number]
        if len(cells):
            pieces.append(replace(component, cells=cells, core=np.ones(len(cells), bool), line=line))
    return pieces


def nearest_line(overlay: Overlay, cells: Ints, lines: list[MiddleLine]) -> Ints:
    """Return the number (c,) of the line that is nearest to each mesh face, along paths through the faces `cells`."""
    if len(lines) == 1:
        return np.zeros(len(cells), dtype=np.int64)
    place = np.full(overlay.sheet.surface.m, -1)
    place[cells] = np.arange(len(cells))
    f, g = place[overlay.adjacent_cells.T]
    inside = (f >= 0) & (g >= 0)
    f, g = f[inside], g[inside]
    middle = overlay.sheet.surface.centroids[cells]
    metres = np.linalg.norm(middle[f] - middle[g], axis=1)
    graph = coo_array((metres, (f, g)), shape=(len(cells),) * 2).tocsr()
    line_number = np.full(len(cells), -1)
    for number, line in reversed(list(enumerate(lines))):
        line_number[place[line.cells]] = number
    starts = np.flatnonzero(line_number >= 0)
    _, _, source = dijkstra(graph, directed=False, indices=starts, min_only=True, return_predecessors=True)
    return np.asarray(line_number[np.where(source >= 0, source, starts[0])])


def _visible(overlay: Overlay, pieces: list[Component]) -> list[Component]:
    made_by, areas = overlay.sheet.family, overlay.sheet.surface.areas
    shares = [
        areas[component.cells[made_by[component.cells] == component.field]].sum() / areas[component.cells].sum()
        for component in pieces
    ]
    least = [HIDDEN if component.kind == "strip" else COVERED for component in pieces]
    return [component for component, share, limit in zip(pieces, shares, least, strict=True) if share > limit]


class CellsByStripes(NamedTuple):
    """Sheet with a label on each mesh face ("cell") for the stripes that cover it.
    sheet : sheet with m faces, divided along all edges of stripes.
    label : (m,) number of the combination of stripes on a face.    loose : (m,) True outside of all stripes."""

    sheet: Sheet
    label: Ints
    loose: Bools


def cells_by_stripes(surface: Surface, sheet: Sheet, pattern: PatternResult) -> CellsByStripes:
    """Return the mesh faces of a sheet that was cut along a pattern, each labelled by the stripes that cover it."""
    bands = pattern_bands(surface, sheet, pattern)
    overlay = stripe_overlay(sheet, surface, [band.drawn for band in bands])
    part, round_ = overlay.part.copy(), roundness(overlay)
    for k, band in enumerate(bands):
        disc = part[:, k] >= 0
        disc &= (round_[part[:, k]] > DISC) & band.drawn.hides
        part[disc] = np.where(np.arange(part.shape[1]) == k, part[disc], -1)
    label = np.unique(part, axis=0, return_inverse=True)[1].ravel()
    return without_slivers(overlay.sheet, label.astype(np.int64), np.asarray((part < 0).all(axis=1)))


def without_slivers(sheet: Sheet, label: Ints, loose: Bools) -> CellsByStripes:
    """Give a connected group of faces outside of stripes the label of its neighbours, if their labels are equal.
    label : (m,) number of the combination of stripes.    loose : (m,) True outside of all stripes."""
    f, g = sheet.surface.edges.pairs.T // 3
    both_loose = loose[f] & loose[g]
    count, part = link_components(len(label), f[both_loose], g[both_loose])
    f, g = np.concatenate([f, g]), np.concatenate([g, f])
    touching = loose[f] & ~loose[g]
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, part[f[touching]], label[g[touching]])
    np.maximum.at(high, part[f[touching]], label[g[touching]])
    sliver = loose & (low == high)[part]
    return CellsByStripes(sheet, np.where(sliver, low[part], label), loose & ~sliver)
