"""Halving of two families of lines in the openings between them.

Lines that run together crowd. There every second line is left out, or three of four: line k stays if it is a multiple
of 2^level. Lines must end on other lines. So a level belongs to an opening between lines that are drawn in any case:
first the coarse lines of both families, then also the finer ones of the first family.
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

GAIN = 0.45
"""Least gain of evenness, as a power of two of P95 over P5 of the spacings, for leaving out more lines.

Crowded lines are stressed; structures are up to a tenth softer without them.
"""


@dataclass(frozen=True, eq=False)
class Halved:
    """A surface divided along the lines at which levels change.

    mesh   : its polygons.    level : (c, 2) number of halvings of each family in each polygon.
    phases : the fields, moved onto vertices that a line nearly meets.
    first  : the family whose lines came first; lines of the other one may end on them.
    """

    mesh: PolygonMesh
    level: Ints
    phases: tuple[CornerField, CornerField]
    first: int = 0

    def wanted(self, surface: Surface, family: int, level: int) -> Floats:
        """(m,) share of each face with at most `level` halvings, where the lines of that level are drawn."""
        area = self.mesh.cells.areas(self.mesh.X)[0]
        here = area * (self.level[:, family] <= level)
        return np.asarray(np.bincount(self.mesh.parent, here, surface.m) / surface.areas)

    def scale(self, surface: Surface, family: int) -> Floats:
        """(m,) mean share of the lines that remain."""
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
    """Halve two families of lines, at whole numbers of phases (n, 1), in the openings between them.

    target         : (m,) each, wanted number of halvings; an opening takes the whole number under its mean.
    level_limits   : largest number of halvings of each family: multiples of 2^limit are drawn everywhere.
    uncapped_target : (m,) each, targets without limits; taken if spacings become more even by `GAIN`.
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
    cutting = Cutting(Seen.of(mesh, field), every, 0.05, size, ~field.blank, ~mesh.void).tipped(0)
    seen = cutting.seen
    return replace(field, x=seen.values, sign=seen.sign.reshape(-1, 3), shift=seen.shift.reshape(-1, 3))


def _multiples(field: CornerField, F: Ints, period: int, offset: int) -> Floats:
    """offset + j period, j whole, over all values of a field."""
    reach = np.ceil(max(np.abs(field.corners(F)).max(), np.abs(field.x).max()) / period) + 1
    return np.asarray(offset + period * np.arange(-reach, reach + 1))


def _with_lines(
    mesh: PolygonMesh, field: CornerField, period: int, offset: int, active: Bools, size: float
) -> tuple[PolygonMesh, Ints]:
    """Divide active polygons along field = offset + j period; return also the old polygon of each."""
    active = active & ~field.blank[mesh.parent]
    levels = _multiples(field, mesh.F, period, offset)
    cutting = Cutting(Seen.of(mesh, field), levels, 0.0, size, active, np.zeros_like(active))
    cutting, _ = cutting.along(0, above=False)
    assert cutting.source is not None
    return cutting.seen.mesh, cutting.source


def _walls(mesh: PolygonMesh, field: CornerField, period: Ints) -> Bools:
    """(p,) for the pairs of neighbours: True if a line between them is a multiple of the smaller of their periods (c,).

    Neighbours see the field with their own sign and shift. The strip between two lines is identified by its middle,
    half of a whole number, which is converted without rounding. Blank faces are all walls.
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
    """(c,) the whole number under the mean target of each opening, 0 to the limit; see `split_value`.

    A part of an opening may want more than the limit. That counts if spacings become more even by `GAIN`. For example,
    an opening with targets 2 and 0.4 is halved once under a limit of 1; otherwise it would never be.
    """
    one, two, _ = mesh.neighbours
    owner, open_ = mesh.cells.owner, ~walls
    count, opening = connected(len(mesh.parent), owner[one[open_]], owner[two[open_]])
    area, here = mesh.cells.areas(mesh.X)[0], free[mesh.parent]
    total, found = np.bincount(opening, area, count), list[Ints]()
    for counted in (wish[mesh.parent], here):
        mean = np.bincount(opening, area * counted, count) / total
        limits = np.array([limit(mean, k) for k in range(1, most + 1)])
        found.append(np.asarray((mean[:, None] >= limits).sum(axis=1), dtype=np.int64)[opening])
    gain = _spread(found[0] - here, area) - _spread(found[1] - here, area)
    return found[1] if gain > GAIN else found[0]


def _spread(x: Floats, area: Floats) -> float:
    low, high = weighted_quantiles(x, area, (0.05, 0.95))
    return float(high - low)
