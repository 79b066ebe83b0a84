"""`halved`: openings between two families of lines, and how often the lines are left out in each.

Lines that run together crowd. Where they do, every second one is left out, or three of four: k stays where it is a
multiple of 2^level. So that lines end on other lines, and nowhere else, the level belongs to an opening between lines
that are drawn in any case and those of the other family: the coarse ones of both, then those that were added in them.
"""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, weighted_quantiles
from dsfab.slicing.cutting.corner_fields import Cutting, Seen
from dsfab.slicing.cutting.loose_ends import limit
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import connected

SNAP = 0.05
"""Lines this near to a vertex, as a share of an edge, go through it."""
ALIKE = 0.05
"""Openings whose wishes differ by less may be the same but for the mesh."""
GAIN = 0.45
"""Of a power of two: what P95 over P5 of the spacings is to gain. For less than that more lines are not left out: where
they crowd they are stressed, and structures are up to a tenth softer without them."""


@dataclass(frozen=True, eq=False)
class Halved:
    """A surface divided along the lines at which levels change.

    mesh   : its polygons.    level : (c, 2) how often the lines of each family are halved in each.
    phases : the fields, moved onto vertices that a line nearly meets.
    first  : the family whose lines were added first, and at which those of the other one may end.
    """

    mesh: PolygonMesh
    level: Ints
    phases: tuple[CornerField, CornerField]
    first: int = 0

    def wanted(self, surface: Surface, family: int, level: int) -> Floats:
        """(m,) share of each face where lines that are left out above a level are drawn."""
        area = self.mesh.cells.areas(self.mesh.X)[0]
        here = area * (self.level[:, family] <= level)
        return np.asarray(np.bincount(self.mesh.parent, here, surface.m) / surface.areas)

    def scale(self, surface: Surface, family: int) -> Floats:
        """(m,) mean share of the lines that are left."""
        area = self.mesh.cells.areas(self.mesh.X)[0]
        left = area * 0.5 ** self.level[:, family]
        return np.asarray(np.bincount(self.mesh.parent, left, surface.m) / surface.areas)


def halved(
    surface: Surface,
    phases: tuple[CornerField, CornerField],
    wish: tuple[Floats, Floats],
    most: tuple[int, int],
    free: tuple[Floats, Floats] | None = None,
) -> Halved:
    """Halve two families of lines, where phases (n, 1) are whole numbers, in the openings between them.

    wish : (m,) each, how often lines should be halved; an opening takes the whole number under the mean of that.
    most : how often they are halved at most: multiples of 2^most are drawn everywhere.
    free : (m,) each, wishes that are not cut off at 0 and at the most; taken where spacings are more even for it.
    """
    mesh, free = PolygonMesh.of(surface), free or wish
    level = np.zeros((surface.m, 2), dtype=np.int64)
    if not any(most):
        return Halved(mesh, level, phases)
    phases = tuple(_snapped(mesh, field, surface.size) for field in phases)  # type: ignore[assignment]
    for field, c in zip(phases, most, strict=True):
        mesh, _ = _with_lines(mesh, field, 2**c, 0, mesh.void, surface.size)
    first, second = sorted((0, 1), key=lambda k: float(np.ptp(np.percentile(wish[k], (5, 95)))))
    whole = [np.full(len(mesh.parent), 2 ** most[k]) for k in (0, 1)]
    walls = _walls(mesh, phases[first], whole[first]) | _walls(mesh, phases[second], whole[second])
    own = _levels(mesh, walls, wish[first], free[first], most[first])
    for finer in range(most[first] - 1, -1, -1):
        mesh, source = _with_lines(mesh, phases[first], 2 ** (finer + 1), 2**finer, own <= finer, surface.size)
        own = own[source]
    every = np.full(len(own), 2 ** most[second])
    walls = _walls(mesh, phases[first], 2**own) | _walls(mesh, phases[second], every)
    level = np.empty((len(own), 2), dtype=np.int64)
    level[:, first], level[:, second] = own, _levels(mesh, walls, wish[second], free[second], most[second])
    return Halved(mesh, level, phases, first)


def _snapped(mesh: PolygonMesh, field: CornerField, size: float) -> CornerField:
    every = _multiples(field, mesh.F, 1, 0)
    cutting = Cutting(Seen.of(mesh, field), every, SNAP, size, ~field.blank, ~mesh.void).tipped(0)
    seen = cutting.seen
    return replace(field, x=seen.values, sign=seen.sign.reshape(-1, 3), shift=seen.shift.reshape(-1, 3))


def _multiples(field: CornerField, F: Ints, period: int, offset: int) -> Floats:
    """offset + j period, j whole, over all that any face sees of a field."""
    reach = np.ceil(max(np.abs(field.corners(F)).max(), np.abs(field.x).max()) / period) + 1
    return np.asarray(offset + period * np.arange(-reach, reach + 1))


def _with_lines(
    mesh: PolygonMesh, field: CornerField, period: int, offset: int, active: Bools, size: float
) -> tuple[PolygonMesh, Ints]:
    """The mesh with active polygons divided along field = offset + j period, and what each of its polygons was."""
    active = active & ~field.blank[mesh.parent]
    levels = _multiples(field, mesh.F, period, offset)
    cutting = Cutting(Seen.of(mesh, field), levels, 0.0, size, active, np.zeros_like(active))
    cutting, _ = cutting.along(0, above=False)
    assert cutting.source is not None
    return cutting.seen.mesh, cutting.source


def _walls(mesh: PolygonMesh, field: CornerField, period: Ints) -> Bools:
    """(p,) for the pairs of neighbours whether a line between them is a multiple of the smaller of their periods (c,).

    Neighbours see the field at its own sign and shift. What is between two lines is told by its middle, which is
    carried from one to the other without rounding: halves of whole numbers. Blank faces are all walls.
    """
    one, two, there = mesh.neighbours
    seen, owner = Seen.of(mesh, field), mesh.cells.owner
    y = seen.slots(0)
    middle = mesh.cells.reduced(np.add, y) / mesh.cells.sizes
    f, g = owner[one], owner[two]
    sign = seen.sign[one] * seen.sign[there]
    shift = seen.shift[one] - sign * seen.shift[there]
    p = np.minimum(period[f], period[g])
    here, other = ((np.floor(middle[of] / p) + 0.5) * p for of in (f, g))
    return np.asarray((here != sign * other + shift) | seen.blank[one] | seen.blank[two])


def _levels(mesh: PolygonMesh, walls: Bools, wish: Floats, free: Floats, most: int) -> Ints:
    """(c,) the whole number under the mean wish of each opening, 0 to most; see `limit`.

    A part of an opening may wish for more than the most. That counts where spacings are more even for it by `GAIN`: an
    opening that asks for 2 and for 0.4 halvings is halved once, if once is the most, and else it would never be.
    """
    one, two, _ = mesh.neighbours
    owner, open_ = mesh.cells.owner, ~walls
    count, opening = connected(len(mesh.parent), owner[one[open_]], owner[two[open_]])
    area, here = mesh.cells.areas(mesh.X)[0], free[mesh.parent]
    total, found = np.bincount(opening, area, count), list[Ints]()
    for counted in (wish[mesh.parent], here):
        mean = np.bincount(opening, area * counted, count) / total
        limits = np.array([limit(mean, k, ALIKE) for k in range(1, most + 1)])
        found.append(np.asarray((mean[:, None] >= limits).sum(axis=1), dtype=np.int64)[opening])
    gain = _spread(found[0] - here, area) - _spread(found[1] - here, area)
    return found[1] if gain > GAIN else found[0]


def _spread(x: Floats, area: Floats) -> float:
    """How far the values (c,) lie apart that 5 % of the area exceed and fall below."""
    low, high = weighted_quantiles(x, area, (0.05, 0.95))
    return float(high - low)
