"""Components of a sheet that become members: bands of the pattern, their cells and middle lines, and regions."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.members.axes import SPECK, MiddleLine, middle_lines, straight_parts, without_specks
from dsfab.results import PatternResult
from dsfab.slicing import DrawnBand, Overlay, Sheet, divided_at_vertices, overlaid
from dsfab.surface import CornerField, DividedField, Surface, connected

Kind = Literal["strip", "stub", "rim", "band", "ring", "disc", "plate", "fill"]
"""What members are, see `dsfab.members.graph.Member`; what is kept is a "keep" before its shape is known."""
FAMILIES = {"major": "A", "minor": "B"}
"""Letters of the families of stripes."""
FULL = 0.5
"""Half-width in periods at which stripes touch: then there is one sheet, without members."""
NOWHERE = 10.0
"""Where the middle line of a region is that has none: farther away than any of its values."""


class NamedBand(NamedTuple):
    """A band, and what its parts are: "strip" of a family, or "rim", "band", "keep" or "plate"."""

    kind: str
    family: str
    drawn: DrawnBand


def pattern_bands(surface: Surface, sheet: Sheet, pattern: PatternResult) -> list[NamedBand]:
    """One for each field that the sheet was cut by, from `surface`, in their order."""
    found = []
    for k, (name, field, levels) in enumerate(zip(pattern.names, pattern.fields, pattern.levels, strict=True)):
        if name in FAMILIES:
            found.append(NamedBand("strip", name, _striped(sheet, pattern, k)))
            continue
        assert not isinstance(field, CornerField)
        x = divided_at_vertices(sheet, surface, field) if isinstance(field, DividedField) else sheet.carry(field)
        kind, drawn = _kept(f"{name} {k}", x, float(levels[0]))
        found.append(NamedBand(name if kind == "reach" else kind, name, drawn))
    return found


def _striped(sheet: Sheet, pattern: PatternResult, k: int) -> DrawnBand:
    """The stripes of a family: between whole numbers of a phase, as wide as they were drawn."""
    name, field, levels = pattern.names[k], pattern.fields[k], pattern.levels[k]
    if isinstance(field, CornerField):
        return DrawnBand(name, field, levels)
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return DrawnBand(name, sheet.carry(field), levels)
    which, d = list(FAMILIES).index(name), pattern.half_widths[k]
    if (d >= FULL).all():
        return DrawnBand(name, np.tile([1.0, -1.0], (sheet.surface.n, 1)), np.zeros(1), NOWHERE)
    z = pattern.frequency[which] * field + pattern.phase[which]
    whole = np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2)
    return DrawnBand(name, sheet.carry(np.stack([z + d, z - d], axis=1)), whole)


def _kept(name: str, x: Floats, level: float) -> tuple[str, DrawnBand]:
    """What is kept besides the stripes, by values at the vertices of the sheet, and whether that is what is within
    "reach" of something (n,), a "plate" (n,), or a "band" along an outline (n, 2)."""
    zero = np.zeros(1)
    if x.ndim == 2:  # over 0 in the region, and minus the width at its outline
        width = -float(x[:, 1].min())
        inward = np.where(x[:, 0] >= 0, -x[:, 1], x[:, 1] + 2 * width)
        return "band", DrawnBand(name, np.stack([inward, inward - width], axis=1), zero, hides=True)
    if level == 0:
        both = np.stack([x, np.full(len(x), -2.0)], axis=1)
        return "plate", DrawnBand(name, both, zero, NOWHERE, hides=True)
    reach = -level
    return "reach", DrawnBand(name, np.stack([x + reach, x - reach], axis=1), zero, -reach / 2, hides=True)


DISC = 0.4
"""What is kept and has more than this share of the area of a circle with the same outline is a disc."""
HIDDEN, COVERED = 0.05, 0.3
"""A strip, and what is kept, that made less than this share of its cells material is below others all along: it is no
member."""


@dataclass(frozen=True, eq=False)
class Component:
    """The cells of a member before it has a name.

    kind   : "strip", "rim", "band", "ring", "disc", "plate" or "fill".    family : of the pattern, or "".
    stripe : the number of its stripe, as most of it sees it; 0 where there is none.
    cells  : (c,) of the overlay, ascending.    core : (c,) those that make its width: fillets do not.
    line : along its middle, or None.         field : of the pattern; -1 for none.
    group  : the connected stripe that it is a part of, a number of the overlay; -1 for none.
    """

    kind: str
    family: str
    stripe: int
    cells: Ints
    core: Bools
    line: MiddleLine | None = None
    field: int = -1
    group: int = -1

    def width(self, areas: Floats) -> float:
        """Mean width, metres, of areas (m,) of all cells; the side of a square where there is no line."""
        area = float(areas[self.cells[self.core]].sum())
        return area / self.line.length if self.line else float(np.sqrt(area))

    def along(self, more: Ints, core: bool) -> "Component":
        """With more cells (k,)."""
        cells = np.concatenate([self.cells, more])
        order = np.argsort(cells, kind="stable")
        marks = np.concatenate([self.core, np.full(len(more), core)])
        return replace(self, cells=cells[order], core=marks[order])


def components(overlay: Overlay, bands: list[NamedBand], normals: Floats, edge: float) -> list[Component]:
    """Those of all stripes; cells of crossings are in two or more, those of slivers may be in none.

    normals : (n, 3) unit normals at the vertices of the overlay.    edge : of the uncut mesh, metres.
    """
    found = list[Component]()
    round_ = roundness(overlay)
    for k, band in enumerate(bands):
        lines = _lines(overlay, k, normals)
        for stripe in np.flatnonzero(overlay.of == k).tolist():
            cells = np.flatnonzero(overlay.part[:, k] == stripe)
            if band.drawn.centre < NOWHERE and _is_sliver(overlay, k, cells, lines.get(stripe, [])):
                continue
            kind = _kind(band.kind, round_[stripe], lines.get(stripe, []))
            whole = Component(
                kind, band.family, int(overlay.level[stripe]), cells, np.ones(len(cells), bool), None, k, stripe
            )
            found += _parts(overlay, whole, lines.get(stripe, []), edge)
    return _visible(overlay, found)


def _lines(overlay: Overlay, k: int, normals: Floats) -> dict[int, list[MiddleLine]]:
    """The middle lines of the stripes of a field.

    Where the middle runs beside the sheet, as of half a stripe along its edge, it is a line at the mean offset.
    """
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
    other = np.full_like(offset, np.nan)
    other[cells] = away - mean[part[cells], None]
    other[other == 0] = np.finfo(float).tiny
    flat = np.ptp(away, axis=1).max(initial=0) < 1e-12
    return lines if flat else lines | middle_lines(overlay, k, other, normals)


def _is_sliver(overlay: Overlay, k: int, cells: Ints, lines: list[MiddleLine]) -> bool:
    """Whether connected cells (c,) of field k lie beside its middle and are shorter than its band would be wide there.

    Where a wall was moved, by snapping or rounding, bits between it and the exact one hang on their stripe by a vertex.
    They are millimetres long: an axis along one would tell the curvature of nothing.
    """
    offset, surface = overlay.offset[cells, :, k], overlay.sheet.surface
    if not lines or ((offset.min(axis=1) < 0) & (offset.max(axis=1) > 0)).any():
        return False
    away, length = np.abs(offset), lines[0].length
    own = float(surface.areas[cells].sum()) / length
    return bool(length < SPECK * own * 2 * away.max() / np.ptp(away))


def _kind(kind: str, roundness: float, lines: list[MiddleLine]) -> str:
    """Of what is kept around points and curves, and where."""
    if kind != "keep":
        return kind
    if roundness > DISC:
        return "disc"
    return "ring" if lines and lines[0].closed else "band"


def roundness(overlay: Overlay) -> Floats:
    """(count,) 4 pi area / outline^2 of each stripe: 1 for a disc."""
    surface, found = overlay.sheet.surface, np.zeros(len(overlay.of))
    size = surface.edge_lengths
    f, g = overlay.linked.T
    pair = surface.edges.of.ravel()[surface.edges.pairs[:, 0]]
    alone = surface.edges.boundary
    single = surface.edges.order[surface.edges.start[:-1][alone]] // 3
    for k in range(overlay.part.shape[1]):
        part = overlay.part[:, k]
        around = np.zeros(len(overlay.of))
        differ = part[f] != part[g]
        for side, length in ((f[differ], size[pair[differ]]), (g[differ], size[pair[differ]]), (single, size[alone])):
            here = part[side] >= 0
            around += np.bincount(part[side][here], length[here], len(around))
        here = part >= 0
        area = np.bincount(part[here], surface.areas[here], len(around))
        mine = overlay.of == k
        found[mine] = 4 * np.pi * area[mine] / around[mine] ** 2
    return found


def _parts(overlay: Overlay, whole: Component, lines: list[MiddleLine], edge: float) -> list[Component]:
    """A stripe as one component for each line that it has, and for each part of it that does not turn back."""
    if not lines:
        kind = "plate" if whole.kind in ("strip", "disc") else whole.kind
        return [replace(whole, kind=kind)]
    if whole.kind == "disc":
        return [replace(whole, line=lines[0])]
    width = float(overlay.sheet.surface.areas[whole.cells].sum()) / sum(line.length for line in lines)
    parts = [part for line in without_specks(lines, width) for part in straight_parts(line, width, edge)]
    owner = nearest_line(overlay, whole.cells, parts)
    found = []
    for number, line in enumerate(parts):
        cells = whole.cells[owner == number]
        if len(cells):
            found.append(replace(whole, cells=cells, core=np.ones(len(cells), bool), line=line))
    return found


def nearest_line(overlay: Overlay, cells: Ints, lines: list[MiddleLine]) -> Ints:
    """(c,) the line that is nearest to each of connected cells (c,), from cell to cell."""
    if len(lines) == 1:
        return np.zeros(len(cells), dtype=np.int64)
    place = np.full(overlay.sheet.surface.m, -1)
    place[cells] = np.arange(len(cells))
    f, g = place[overlay.linked.T]
    both = (f >= 0) & (g >= 0)
    f, g = f[both], g[both]
    middle = overlay.sheet.surface.centroids[cells]
    metres = np.linalg.norm(middle[f] - middle[g], axis=1)
    graph = coo_array((metres, (f, g)), shape=(len(cells),) * 2).tocsr()
    of = np.full(len(cells), -1)
    for number, line in reversed(list(enumerate(lines))):
        of[place[line.cells]] = number
    starts = np.flatnonzero(of >= 0)
    _, _, source = dijkstra(graph, directed=False, indices=starts, min_only=True, return_predecessors=True)
    return np.asarray(of[np.where(source >= 0, source, starts[0])])


def _visible(overlay: Overlay, found: list[Component]) -> list[Component]:
    """Without those that lie below others all along: a rim where what is kept around supports is on top of it."""
    made, areas = overlay.sheet.family, overlay.sheet.surface.areas
    shares = [areas[one.cells[made[one.cells] == one.field]].sum() / areas[one.cells].sum() for one in found]
    least = [HIDDEN if one.kind == "strip" else COVERED for one in found]
    return [one for one, share, limit in zip(found, shares, least, strict=True) if share > limit]


class StripedCells(NamedTuple):
    """sheet : m cells, divided along hidden edges too.   label : (m,) equal for cells that lie in the same stripes.
    loose : (m,) cells that lie in none."""

    sheet: Sheet
    label: Ints
    loose: Bools


def striped_cells(surface: Surface, sheet: Sheet, pattern: PatternResult) -> StripedCells:
    """The cells of a kept sheet that was cut from `surface` along a pattern, by the stripes that they lie in.

    A disc that is kept around a point is one region: stripes that end below it would cut it to pieces.
    """
    bands = pattern_bands(surface, sheet, pattern)
    overlay = overlaid(sheet, surface, [band.drawn for band in bands])
    part, round_ = overlay.part.copy(), roundness(overlay)
    for k, band in enumerate(bands):
        disc = part[:, k] >= 0
        disc &= (round_[part[:, k]] > DISC) & band.drawn.hides
        part[disc] = np.where(np.arange(part.shape[1]) == k, part[disc], -1)
    label = np.unique(part, axis=0, return_inverse=True)[1].ravel()
    return _without_slivers(overlay.sheet, label.astype(np.int64), np.asarray((part < 0).all(axis=1)))


def _without_slivers(sheet: Sheet, label: Ints, loose: Bools) -> StripedCells:
    """Loose cells that hang together and have neighbours of one label only take it: slivers at the edge of a stripe,
    where its walls were made fair."""
    f, g = sheet.surface.edges.pairs.T // 3
    both = loose[f] & loose[g]
    count, part = connected(len(label), f[both], g[both])
    f, g = np.concatenate([f, g]), np.concatenate([g, f])
    beside = loose[f] & ~loose[g]
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, part[f[beside]], label[g[beside]])
    np.maximum.at(high, part[f[beside]], label[g[beside]])
    sliver = loose & (low == high)[part]
    return StripedCells(sheet, np.where(sliver, low[part], label), loose & ~sliver)
