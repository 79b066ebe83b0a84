"""The smallest things on a cut sheet, each with its place: how narrow its members are, its gaps, its edges."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.slicing.across import Crossings, crossings
from dsfab.slicing.sheet import VOID, Sheet
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import pieces

BINS = 20
"""Bins of the histogram of member widths."""
SLENDER = 3.0
"""4 area / perimeter is at most twice the width of a slit, and some more where it widens."""
LONG_TAIL = 0.99
"""The histogram ends at the width that this share of the walls does not exceed; what is wider is in the last bin."""


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

    member : the narrowest member, also between two openings that nearly meet.    gap : the narrowest opening.
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
        return _quantiles(self.widths, self.weight, shares)

    def histogram(self) -> tuple[Floats, Floats]:
        """(b + 1,) limits of the bins, metres, from 0, and (b,) the share of the walls in each; none without widths."""
        if not self.weight.sum():
            return np.empty(0), np.empty(0)
        limits = np.linspace(0, self.quantiles([LONG_TAIL])[0] * (1 + 1e-9), BINS + 1)
        share, _ = np.histogram(np.minimum(self.widths, limits[-1]), limits, weights=self.weight)
        return limits, np.asarray(share / self.weight.sum())


def features(cells: Sheet, kept: Bools, names: Sequence[str]) -> Features:
    """Measure a cut sheet.

    cells : all cells, material and void.    kept : (m',) those that are built.    names : of the fields, see `cut`.

    Widths and gaps are those of the lines in `crossings`, on the sheet itself: exact between straight walls, and where
    walls bend from edge to edge by an angle a, right to 1 - cos a. Members are also measured where they are short or
    end in a tip; corners between walls that meet at more than 20 degrees are not. Pieces and openings too small or too
    round for lines across count with 4 area / perimeter, the diameter of the circle in a triangle or a square.
    """
    sheet, holes = cells.surface, ~kept
    material, from_material = _part(sheet, kept)
    mesh = _mesh_width(cells)
    across = crossings(material, material.edges.boundary)
    of = from_material[across.face]
    member = _smallest(across, mesh[of], [_member(names, f) for f in cells.family[of]])
    member = _smaller(member, _round(material, material.edges.boundary, across, mesh[from_material], "a loose piece"))
    gap = None
    if holes.any():
        void, from_void = _part(sheet, holes)
        walls = _inner(void, sheet, from_void)
        between = crossings(void, walls)
        gap = _smallest(between, mesh[from_void[between.face]], ["a gap"] * len(between.width))
        gap = _smaller(gap, _round(void, walls, between, mesh[from_void], "an opening"))
    return Features(member, gap, _shortest(material, mesh[from_material]), across.width, across.weight)


def filled_openings(cells: Sheet, size: float) -> tuple[Sheet, int]:
    """The cells with every opening smaller than `size` metres made material, and how many there were.

    An opening is void that material encloses. Its size is the width that half of its walls do not exceed, or 4 area /
    perimeter if that is less. It takes the family of a material cell beside it.
    """
    sheet, void = cells.surface, ~cells.material
    if not void.any():
        return cells, 0
    part, faces = _part(sheet, void)
    count, label = pieces(part.F, part.edges)
    sizes = _round_sizes(part, _inner(part, sheet, faces), label, count)
    near = sizes < SLENDER * size
    if not near.any():
        return cells, 0
    part, left = _part(part, near[label])  # looking across those alone takes a tenth of the time
    faces, label = faces[left], np.cumsum(near)[label[left]] - 1
    sizes = sizes[near]
    across = crossings(part, _inner(part, sheet, faces))
    for k in range(len(sizes)):
        mine = label[across.face] == k
        if across.weight[mine].any():
            sizes[k] = min(sizes[k], _quantiles(across.width[mine], across.weight[mine], [0.5])[0])
    small = sizes < size
    family = cells.family.copy()
    family[faces[small[label]]] = _families_beside(cells, faces, label)[label[small[label]]]
    return replace(cells, family=family), int(small.sum())


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


def _part(surface: Surface, mask: Bools) -> tuple[Surface, Ints]:
    """The marked faces as a surface, and the faces that they were."""
    F = surface.F[mask]
    used = np.unique(F)
    return Surface(surface.V[used], np.searchsorted(used, F)), np.flatnonzero(mask)


def _mesh_width(cells: Sheet) -> Floats:
    """(m',) side of the equilateral triangle of the same area as the uncut face, metres."""
    area = np.bincount(cells.parent, cells.surface.areas)
    return np.asarray(np.sqrt(4 / np.sqrt(3) * area[cells.parent]))


def _inner(void: Surface, whole: Surface, faces: Ints) -> Bools:
    """(e,) the boundary edges of a part that are not on the boundary of the whole."""
    outer = np.zeros(len(void.edges.ends), dtype=bool)
    outer[void.edges.of] = whole.edges.boundary[whole.edges.of[faces]]
    return np.asarray(void.edges.boundary & ~outer)


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
    sizes = _round_sizes(part, walls, label, count)
    sizes[label[across.face]] = np.inf
    k = int(sizes.argmin())
    if not np.isfinite(sizes[k]):
        return None
    here = np.flatnonzero(label == k)
    return Feature(float(sizes[k]), part.centroids[here].mean(axis=0), what, float(mesh[here].mean()))


def _round_sizes(part: Surface, walls: Bools, label: Ints, count: int) -> Floats:
    """(count,) 4 area / perimeter of the pieces of a part; infinite for those that walls do not enclose wholly."""
    length = np.linalg.norm(np.diff(part.V[part.edges.ends], axis=1)[:, 0], axis=1)
    edge = np.flatnonzero(part.edges.boundary)
    whose = label[part.edges.order[part.edges.start[:-1]][edge] // 3]
    around = np.bincount(whose, length[edge], count)
    enclosed = (np.bincount(whose, ~walls[edge], count) == 0) & (around > 0)
    areas = np.bincount(label, part.areas, count)
    sizes: Floats = np.divide(4 * areas, around, out=np.full(count, np.inf), where=enclosed)
    return sizes


def _families_beside(cells: Sheet, faces: Ints, label: Ints) -> Ints:
    """(count,) the largest family of the material that shares an edge with each piece of the void `faces`."""
    piece = np.full(cells.surface.m, -1)
    piece[faces] = label
    found = np.full(int(label.max()) + 1, VOID)
    f, g = (cells.surface.edges.pairs // 3).T
    for here, there in ((f, g), (g, f)):
        at = (piece[here] >= 0) & (piece[there] < 0)
        np.maximum.at(found, piece[here[at]], cells.family[there[at]])
    return found


def _quantiles(values: Floats, weight: Floats, shares: Sequence[float]) -> Floats:
    order = np.argsort(values)
    upto = np.cumsum(weight[order]) / weight.sum()
    return np.asarray(values[order][np.minimum(np.searchsorted(upto, shares), len(order) - 1)])


def _shortest(part: Surface, mesh: Floats) -> Feature:
    """The shortest edge of the triangles."""
    ends = part.V[part.edges.ends]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    k = int(length.argmin())
    face = int(part.edges.order[part.edges.start[k]] // 3)
    return Feature(float(length[k]), ends[k].mean(axis=0), "an edge of a triangle", float(mesh[face]))
