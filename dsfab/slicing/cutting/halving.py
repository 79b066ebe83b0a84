"""Halving: where lines of a family lie too close together, only each second or fourth line remains.

At halving level h, line k remains if k is a multiple of 2^h. A line may end only on a line of the other family."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, split_value, weighted_quantiles
from dsfab.slicing.cutting.corner_fields import PolygonField, StripeCut
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import link_components

GAIN = 0.45
"""`halve_lines` uses `uncapped_target` if log2(P95 / P5) of the line spacing then falls by more than GAIN.
P5, P95 : percentiles. `uncapped_target` removes more lines; structures become up to a tenth softer."""


@dataclass(frozen=True, eq=False)
class LineHalving:
    """Polygons between the lines that remain after halving (the removal of every second line).
    mesh   : the polygons.    level : (c, 2) number of halvings of each family in each polygon.
    phases : phase of each family. Before halving, a line lies where the phase is a whole number.
    first  : the family that was halved first."""

    mesh: PolygonMesh
    level: Ints
    phases: tuple[CornerField, CornerField]
    first: int = 0

    def drawn_share(self, surface: Surface, family: int, level: int) -> Floats:
        """Return the fraction (m,) of each face where a family lost every second line at most `level` times."""
        area = self.mesh.cells.areas(self.mesh.X)[0]
        drawn_area = area * (self.level[:, family] <= level)
        return np.asarray(np.bincount(self.mesh.parent, drawn_area, surface.m) / surface.areas)

    def mean_scale(self, surface: Surface, family: int) -> Floats:
        """Return the mean fraction (m,) of a family's lines that remain on each face."""
        area = self.mesh.cells.areas(self.mesh.X)[0]
        scaled_area = area * 0.5 ** self.level[:, family]
        return np.asarray(np.bincount(self.mesh.parent, scaled_area, surface.m) / surface.areas)


def halve_lines(
    surface: Surface,
    phases: tuple[CornerField, CornerField],
    target: tuple[Floats, Floats],
    level_limits: tuple[int, int],
    uncapped_target: tuple[Floats, Floats] | None = None,
) -> LineHalving:
    """Remove every second line of two families (halving), once or more. Lines have whole numbers as phases (n, 1).
    target          : (m,) ideal number of halvings, for each family.
    level_limits    : largest number of halvings of each family.
    uncapped_target : (m,) ideal numbers without limits, used if spacings become more even."""
    mesh, uncapped_target = PolygonMesh.from_surface(surface), uncapped_target or target
    level = np.zeros((surface.m, 2), dtype=np.int64)
    if not any(level_limits):
        return LineHalving(mesh, level, phases)
    phases = tuple(_snapped_field(mesh, field, surface.size) for field in phases)  # type: ignore[assignment]
    for field, c in zip(phases, level_limits, strict=True):
        mesh, _ = _with_lines(mesh, field, 2**c, 0, mesh.void, surface.size)
    first_family, second_family = sorted((0, 1), key=lambda k: float(np.ptp(np.percentile(target[k], (5, 95)))))
    periods = [np.full(len(mesh.parent), 2 ** level_limits[k]) for k in (0, 1)]
    walls = _walls(mesh, phases[first_family], periods[first_family]) | _walls(
        mesh, phases[second_family], periods[second_family]
    )
    first_level = _levels(mesh, walls, target[first_family], uncapped_target[first_family], level_limits[first_family])
    for finer in range(level_limits[first_family] - 1, -1, -1):
        mesh, source = _with_lines(
            mesh, phases[first_family], 2 ** (finer + 1), 2**finer, first_level <= finer, surface.size
        )
        first_level = first_level[source]
    all_periods = np.full(len(first_level), 2 ** level_limits[second_family])
    walls = _walls(mesh, phases[first_family], 2**first_level) | _walls(mesh, phases[second_family], all_periods)
    level = np.empty((len(first_level), 2), dtype=np.int64)
    level[:, first_family], level[:, second_family] = (
        first_level,
        _levels(mesh, walls, target[second_family], uncapped_target[second_family], level_limits[second_family]),
    )
    return LineHalving(mesh, level, phases, first_family)


def _snapped_field(mesh: PolygonMesh, field: CornerField, size: float) -> CornerField:
    every = _multiples(field, mesh.F, 1, 0)
    cutting = StripeCut(
        PolygonField.from_field(mesh, field), every, 0.05, size, ~field.blank, ~mesh.void
    ).with_snapped_values(0)
    seen = cutting.seen
    return replace(field, x=seen.values, sign=seen.sign.reshape(-1, 3), shift=seen.shift.reshape(-1, 3))


def _multiples(field: CornerField, F: Ints, period: int, offset: int) -> Floats:
    reach = np.ceil(max(np.abs(field.corners(F)).max(), np.abs(field.x).max()) / period) + 1
    return np.asarray(offset + period * np.arange(-reach, reach + 1))


def _with_lines(
    mesh: PolygonMesh, field: CornerField, period: int, offset: int, active: Bools, size: float
) -> tuple[PolygonMesh, Ints]:
    active = active & ~field.blank[mesh.parent]
    levels = _multiples(field, mesh.F, period, offset)
    cutting = StripeCut(PolygonField.from_field(mesh, field), levels, 0.0, size, active, np.zeros_like(active))
    cutting, _ = cutting.cut_along_levels(0, above=False)
    assert cutting.source is not None
    return cutting.seen.mesh, cutting.source


def _walls(mesh: PolygonMesh, field: CornerField, period: Ints) -> Bools:
    """Return a mask (p,) of inner edges on remaining lines. period : (c,) k if every k-th line remains."""
    slot_a, slot_b, slot_at_start = mesh.neighbours
    seen, owner = PolygonField.from_field(mesh, field), mesh.cells.owner
    y = seen.slot_values(0)
    middle = mesh.cells.per_polygon(np.add, y) / mesh.cells.sizes
    f, g = owner[slot_a], owner[slot_b]
    sign = seen.sign[slot_a] * seen.sign[slot_at_start]
    shift = seen.shift[slot_a] - sign * seen.shift[slot_at_start]
    p = np.minimum(period[f], period[g])
    strip_a, strip_b = ((np.floor(middle[polygon] / p) + 0.5) * p for polygon in (f, g))
    return np.asarray((strip_a != sign * strip_b + shift) | seen.blank[slot_a] | seen.blank[slot_b])


def _levels(mesh: PolygonMesh, walls: Bools, target: Floats, uncapped_target: Floats, level_limit: int) -> Ints:
    slot_a, slot_b, _ = mesh.neighbours
    owner, open_ = mesh.cells.owner, ~walls
    count, opening = link_components(len(mesh.parent), owner[slot_a[open_]], owner[slot_b[open_]])
    area, uncapped = mesh.cells.areas(mesh.X)[0], uncapped_target[mesh.parent]
    total, levels = np.bincount(opening, area, count), list[Ints]()
    for counted in (target[mesh.parent], uncapped):
        mean = np.bincount(opening, area * counted, count) / total
        limits = np.array([split_value(mean, k) for k in range(1, level_limit + 1)])
        levels.append(np.asarray((mean[:, None] >= limits).sum(axis=1), dtype=np.int64)[opening])
    gain = _spread(levels[0] - uncapped, area) - _spread(levels[1] - uncapped, area)
    return levels[1] if gain > GAIN else levels[0]


def _spread(x: Floats, area: Floats) -> float:
    low, high = weighted_quantiles(x, area, (0.05, 0.95))
    return float(high - low)
