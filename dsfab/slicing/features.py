"""The smallest things on a cut sheet, each with its place: how narrow its members are, its gaps, its edges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, lock, weighted_quantiles
from dsfab.slicing.across import Crossings, crossings
from dsfab.slicing.parts import inner_walls, part_of, round_sizes
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.surface import pieces
from dsfab.surface.mesh import Surface

BINS = 20
"""Bins of the histogram of member widths."""
MOST_BINS = 60
"""As many at most, where a limit far under the usual widths asks for narrow ones."""
ROUNDING = 1e-6
"""Share of a limit by which what was widened to it may miss it, and counts as that wide."""
LONG_TAIL, WIDE = 0.99, 3.0
"""The histogram ends at the width that this share of the walls does not exceed, or at so many times their median, if
that is less: plates at a crown or a foot would leave one bin to all members. What is wider is in the last bin."""


@dataclass(frozen=True, eq=False)
class Feature:
    """The smallest of something: metres, its place (3,), what it is, and the mesh width of the uncut surface there."""

    size: float
    place: Floats
    what: str
    mesh: float

    def __post_init__(self) -> None:
        lock(self, "place", np.float64, (3,))


@dataclass(frozen=True, eq=False)
class Features:
    """What a sheet's members and gaps measure, in metres; None where there is none.

    member : the narrowest member, also between two openings that nearly meet.
    gap    : the narrowest opening.
    edge   : the shortest edge of a triangle.
    widths : (k,) widths of members along their walls, and weight : (k,) the metres of wall that each stands for.
    """

    member: Feature | None
    gap: Feature | None
    edge: Feature
    widths: Floats
    weight: Floats

    def quantiles(self, shares: Sequence[float]) -> Floats:
        """(q,) the widths that these shares of the walls do not exceed, metres; none without widths."""
        if not self.weight.sum():
            return np.empty(0)
        return weighted_quantiles(self.widths, self.weight, shares)

    def histogram(self, limit: float = 0.0) -> tuple[Floats, Floats]:
        """(b + 1,) limits of the bins, metres, from 0, and (b,) the share of the walls in each; none without widths.

        limit : a width, metres, at which a bin ends, so that none holds widths on both sides of it; 0 for none.
        """
        if not self.weight.sum():
            return np.empty(0), np.empty(0)
        usual, widest = self.quantiles([0.5, LONG_TAIL]).tolist()
        limits = _bins(min(widest, WIDE * usual) * (1 + 1e-9), limit * (1 - ROUNDING))
        share, _ = np.histogram(np.minimum(self.widths, limits[-1]), limits, weights=self.weight)
        return limits, np.asarray(share / self.weight.sum())


def under(sizes: float | Floats, limit: float) -> Bools:
    """Whether widths are under a limit, metres: what was widened to it may miss it by `ROUNDING`."""
    return np.asarray(np.asarray(sizes) < limit * (1 - ROUNDING))


def _bins(end: float, limit: float) -> Floats:
    """(b + 1,) limits of equal bins from 0 to about `end`, one of them at `limit`, where that is neither beyond the end
    nor so little that this would take too many bins: then the first is narrower, and ends there."""
    if not 0 < limit < end:
        return np.linspace(0, end, BINS + 1)
    step = limit / max(1, round(limit / end * BINS))
    if end / step > MOST_BINS:
        return np.concatenate([[0.0], np.linspace(limit, end, BINS + 1)])
    return step * np.arange(np.ceil(end / step) + 1)


def features(cells: Sheet, kept: Bools, names: Sequence[str], tips: bool = False) -> Features:
    """Measure a cut sheet.

    cells : all cells, material and void.    kept : (m',) those that are built.    names : of the fields, see `cut`.

    Widths and gaps are those of the lines in `crossings`, on the sheet itself: exact between straight walls, and where
    walls bend from edge to edge by an angle a, right to 1 - cos a. Members are also measured where they are short or
    end in a tip, gaps if `tips` says so; corners between walls that meet at more than 20 degrees are not. Pieces and
    openings too small or too round for lines across count with 4 area / perimeter, the diameter of the circle in a
    triangle or a square.
    """
    sheet, holes = cells.surface, ~kept
    material, from_material = part_of(sheet, kept)
    mesh = _mesh_width(cells)
    across = crossings(material, material.edges.boundary)
    of = from_material[across.face]
    member = _smallest(across, mesh[of], [_member(names, f) for f in cells.family[of]])
    member = _smaller(member, _round(material, material.edges.boundary, across, mesh[from_material], "a loose piece"))
    gap = None
    if holes.any():
        void, from_void = part_of(sheet, holes)
        walls = inner_walls(void, sheet, from_void)
        between = crossings(void, walls, tips=tips)
        gap = _smallest(between, mesh[from_void[between.face]], ["a gap"] * len(between.width))
        gap = _smaller(gap, _round(void, walls, between, mesh[from_void], "an opening"))
    return Features(member, gap, _shortest(material, mesh[from_material]), across.width, across.weight)


def kept_cells(cells: Sheet, sheet: Sheet) -> Bools:
    """(m',) which of all cells are in the sheet that was kept of them: whole pieces of the material."""
    kept = cells.material
    if kept.sum() == sheet.surface.m:
        return np.asarray(kept)
    there = {row.tobytes() for row in sheet.surface.centroids}
    at = np.flatnonzero(kept)
    count, label = pieces(cells.surface.F[at], cells.kept().surface.edges)
    _, first = np.unique(label, return_index=True)
    built = np.array([cells.surface.centroids[at[first[k]]].tobytes() in there for k in range(count)])
    result = np.zeros(cells.surface.m, dtype=bool)
    result[at] = built[label]
    return result


def _mesh_width(cells: Sheet) -> Floats:
    """(m',) side of the equilateral triangle of the same area as the uncut face, metres."""
    area = np.bincount(cells.parent, cells.surface.areas)
    return np.asarray(np.sqrt(4 / np.sqrt(3) * area[cells.parent]))


def _member(names: Sequence[str], family: int) -> str:
    if family == VOID or family >= len(names):
        return "a member"
    return {"keep": "a kept region", "rim": "the rim"}.get(names[family], f"a {names[family]} stripe")


def _smallest(across: Crossings, mesh: Floats, what: Sequence[str]) -> Feature | None:
    if not len(across.width):
        return None
    k = int(across.width.argmin())
    return Feature(float(across.width[k]), across.place[k], what[k], float(mesh[k]))


def _smaller(one: Feature | None, two: Feature | None) -> Feature | None:
    given = [feature for feature in (one, two) if feature is not None]
    return min(given, key=lambda feature: feature.size, default=None)


def _round(part: Surface, walls: Bools, across: Crossings, mesh: Floats, what: str) -> Feature | None:
    """The smallest piece that no line crosses and that walls enclose wholly."""
    count, label = pieces(part.F, part.edges)
    sizes = round_sizes(part, walls, label, count)
    sizes[label[across.face]] = np.inf
    k = int(sizes.argmin())
    if not np.isfinite(sizes[k]):
        return None
    here = np.flatnonzero(label == k)
    return Feature(float(sizes[k]), part.centroids[here].mean(axis=0), what, float(mesh[here].mean()))


def _shortest(part: Surface, mesh: Floats) -> Feature:
    """The shortest edge of the triangles."""
    length = part.edge_lengths
    k = int(length.argmin())
    face = int(part.edges.order[part.edges.start[k]] // 3)
    return Feature(
        float(length[k]), part.V[part.edges.ends[k]].mean(axis=0), "an edge of a triangle", float(mesh[face])
    )
