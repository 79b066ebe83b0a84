"""Openings of a sheet, projected to a plane."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, unit_vectors
from dsfab.core.derived import derived
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.cutting.walls import next_in_chains
from dsfab.surface import NearestPlaces, nearest_places

if TYPE_CHECKING:
    import manifold3d


SMOOTH = 1e-3  # Largest rounding error of an outline after an offset, as a fraction of the offset.


@dataclass(frozen=True, eq=False)
class FlatOpenings:
    """The enclosed openings of a sheet, each projected to its mean plane.
    wall  : (k,) walls (edges at openings) of the sheet.    chain : (k,) the chain of each wall, numbered from 0.
    after : (k,) the next wall in the chain, as an index into `wall`.
    start : (k, 2) start points of the walls, metres.    frame : (k, 2, 3) axes of the plane of each wall's opening."""

    wall: Ints
    chain: Ints
    after: Ints
    start: Floats
    frame: Floats

    @cached_property
    def shape(self) -> "manifold3d.CrossSection":
        """The openings as regions of a plane."""
        import manifold3d

        loops = np.split(self.start, np.flatnonzero(np.diff(self.chain)) + 1)
        return manifold3d.CrossSection(loops if len(self.wall) else [], manifold3d.FillRule.Positive)

    def room(self, radius: float) -> "manifold3d.CrossSection":
        """Return the region in which the centre of a disc can lie, if the disc fits in an opening. radius : metres."""
        return offset_shape(self.shape, -radius)

    def nearest_walls(self, points: Floats) -> tuple[Ints, Floats]:
        """Return the walls (indices into `wall`) nearest to points (p, 2), and positions (p,) on the walls, 0 to 1."""
        nearest = self._nearest(points)
        start, finish = self.start[nearest.simplex], self.start[self.after[nearest.simplex]]
        size = np.maximum(np.linalg.norm(finish - start, axis=1), np.finfo(float).tiny)
        return nearest.simplex, np.clip(np.linalg.norm(nearest.place[:, :2] - start, axis=1) / size, 0, 1)

    def distance(self, points: Floats) -> Floats:
        """Return the distance (p,) from points (p, 2) to the nearest wall, metres."""
        return self._nearest(points).distance

    def _nearest(self, points: Floats) -> NearestPlaces:
        return nearest_in_plane(points, self.start, np.stack([np.arange(len(self.wall)), self.after], axis=1))


@derived
def flat_openings_of(sheet: Sheet) -> FlatOpenings:
    """Project each enclosed opening of a sheet to its mean plane; return the openings side by side in a plane."""
    walls, void, (count, label) = sheet.walls, sheet.void_part, sheet.void_part.surface.pieces
    opening = np.empty(sheet.surface.m, dtype=np.int64)
    opening[void.cells] = label
    opening_of_wall = opening[walls.void_cells]
    is_closed = np.ones(count, dtype=bool)
    is_closed[opening_of_wall[~walls.closed[walls.chain]]] = False
    wall = np.flatnonzero(is_closed[opening_of_wall])
    opening_of_wall = opening_of_wall[wall]
    frame = _mean_planes(void.surface.normals * void.surface.areas[:, None], label, count)[opening_of_wall]
    start = np.einsum("wi,wji->wj", sheet.surface.V[walls.start[wall]], frame)
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, opening_of_wall, start)
    np.maximum.at(high, opening_of_wall, start)
    size = float(np.max((high - low)[is_closed], initial=0.0))
    across = int(np.ceil(np.sqrt(count)))
    place = np.stack([np.arange(count) % across, np.arange(count) // across], axis=1) * 2 * size
    chain = np.cumsum(np.diff(walls.chain[wall], prepend=walls.chain[wall[:1]]) != 0)
    start = start - low[opening_of_wall] + place[opening_of_wall]
    return FlatOpenings(wall, chain, next_in_chains(chain), start, frame)


def nearest_in_plane(points: Floats, V: Floats, simplices: Ints) -> NearestPlaces:
    """Return the places nearest to points (k, 2). simplices : edges (m, 2) or vertices (m, 1) of V (n, 2)."""
    return nearest_places(np.pad(points, ((0, 0), (0, 1))), np.pad(V, ((0, 0), (0, 1))), simplices)


def offset_shape(shape: "manifold3d.CrossSection", by: float) -> "manifold3d.CrossSection":
    """Offset a shape outwards by the length `by`, or inwards if `by` is negative."""
    import manifold3d

    return shape.offset(by, manifold3d.JoinType.Round, circular_segments=48).simplify(SMOOTH * abs(by))


def _mean_planes(normal: Floats, label: Ints, count: int) -> Floats:
    mean = unit_vectors(group_sums(label, normal, count))
    first_axis = unit_vectors(np.cross(np.eye(3)[np.abs(mean).argmin(axis=1)], mean))
    return np.stack([first_axis, np.cross(mean, first_axis)], axis=1)


LONG, BULKY = 4.0, 0.7
"""A dead end of an opening is long if length > LONG x disc radius, and area > BULKY x length x width of the mouth."""


@dataclass(frozen=True, eq=False)
class NarrowPart:
    """A narrow part of an opening. outline : (k, 2) metres.
    runs : (r, 2) stretches of the outline along walls; empty if the part is a whole opening."""

    outline: Floats
    runs: tuple[Floats, ...]

    def narrowest(self) -> Floats:
        """Return two points (2, 2), metres, on different `runs` with the least distance."""
        pairs = [_nearest_points(a, b) for a, b in combinations(self.runs, 2)]
        return min(pairs, key=lambda points: float(np.linalg.norm(points[1] - points[0])))


def narrow_parts(flat: FlatOpenings, radius: float) -> Iterator[NarrowPart]:
    """Yield parts of openings that are too narrow for a disc of `radius` metres."""
    if not len(flat.wall):
        return
    parts = (flat.shape - offset_shape(flat.room(radius), (1 + 4 * SMOOTH) * radius)).decompose()
    loops = [
        part.to_polygons() for part in parts if part.area() > 1e-3 * radius**2
    ]  # parts with a smaller area are rounding errors
    outlines = [np.asarray(loop[0]) for loop in loops if len(loop) == 1]
    if not outlines:
        return
    middles = np.concatenate([(loop + np.roll(loop, -1, axis=0)) / 2 for loop in outlines])
    on_wall = flat.distance(middles) < 4e-4 * radius
    start = np.cumsum([0, *(len(loop) for loop in outlines)])
    for k in _outlines_to_check(np.concatenate(outlines), on_wall, start[:-1], LONG * radius).tolist():
        outline, touches_wall = outlines[k], on_wall[start[k] : start[k + 1]]
        if touches_wall.all():
            yield NarrowPart(outline, ())
        elif len(runs := _runs(outline, touches_wall, 0.02 * radius)) > 1:
            yield NarrowPart(outline, runs)
        elif len(runs) == 1 and _is_alley(runs[0], radius):
            yield NarrowPart(outline, _mouth_sides(runs[0], radius))


def _outlines_to_check(points: Floats, on_wall: Bools, start: Ints, least_length: float) -> Ints:
    before = np.arange(len(points)) - 1
    before[start] = np.append(start[1:], len(points)) - 1
    runs = np.add.reduceat((on_wall & ~on_wall[before]).astype(np.int64), start)
    box = np.maximum.reduceat(points, start) - np.minimum.reduceat(points, start)
    all_on_wall = np.logical_and.reduceat(on_wall, start)
    return np.flatnonzero(all_on_wall | (runs > 1) | ((runs == 1) & (np.linalg.norm(box, axis=1) > least_length)))


def _runs(outline: Floats, on_wall: Bools, wide: float) -> tuple[Floats, ...]:
    count = len(outline)
    begin = np.flatnonzero(~on_wall & np.roll(on_wall, 1))
    end = np.flatnonzero(on_wall & ~np.roll(on_wall, 1))  # the outline returns to a wall
    if not len(begin):
        return ()
    end = end[np.searchsorted(end, begin) % len(end)]
    arcs = np.linalg.norm(outline[end] - outline[begin], axis=1) > wide
    begin, end = begin[arcs], end[arcs]
    following = np.roll(begin, -1)
    size = (following - end) % count + 1
    return tuple(outline[(e + np.arange(k)) % count] for e, k in zip(end.tolist(), size.tolist(), strict=True))


def _is_alley(run: Floats, radius: float) -> bool:
    mouth, middle = float(np.linalg.norm(run[-1] - run[0])), (run[0] + run[-1]) / 2
    length = float(np.linalg.norm(run - middle, axis=1).max())
    x, y = (run - middle).T
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    return length > LONG * radius and area > BULKY * mouth * length


def _mouth_sides(run: Floats, radius: float) -> tuple[Floats, Floats]:
    place = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
    low, high = 1.2 * radius, 3.2 * radius  # range (m) of a mouth's side, measured from an end of `run`
    sides = []
    for begin, end in ((low, high), (place[-1] - high, place[-1] - low)):
        stations = np.concatenate([[begin], place[(place > begin) & (place < end)], [end]])
        sides.append(np.stack([np.interp(stations, place, x) for x in run.T], axis=1))
    return sides[0], sides[1]


def _nearest_points(line_a: Floats, line_b: Floats) -> Floats:
    candidates = []
    for points, line, turned in ((line_a, line_b, False), (line_b, line_a, True)):
        simplex = np.arange(len(line))[:, None]
        edges = simplex if len(line) == 1 else np.hstack([simplex[:-1], simplex[1:]])
        nearest = nearest_in_plane(points, line, edges)
        k = int(nearest.squared.argmin())
        pair = np.stack([points[k], nearest.place[k, :2]])
        candidates.append((float(nearest.squared[k]), pair[::-1] if turned else pair))
    return min(candidates, key=lambda each: each[0])[1]
