"""`Component`: the cells of a sheet that become one member, and the line along their middle.

The connected stripes of an overlay are divided where their lines branch or turn back. What lies in no stripe is added
by `dsfab.members.loose`.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dsfab.arrays import Bools, Floats, Ints
from dsfab.members.bands import NOWHERE, NamedBand
from dsfab.members.middle_lines import SPECK, MiddleLine, middle_lines, straight_parts, without_specks
from dsfab.slicing import Overlay

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
