"""Readings of a shape, that is, ways in which the shape may be supported."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, lock, point_tuple
from dsfab.preset.proposal.shape import DEPTH, NECK, RISE, STRIP, Edge, Shape, is_scalloped
from dsfab.surface import Ball, Boundary, Box, Surface, link_components

DRAWN, USUAL, ANYWHERE = 1.0, 0.6, 0.25  # `SupportReading.form` of supports: shown by the shape, usual, possible.
RARER = 0.8  # Factor on `SupportReading.form` for hanging surfaces and for walls, because roofs are more frequent.
LEFT = 0.7  # Factor on the score `SupportReading.form` if necks or hollows (see `Shape`) have no support.
SAG = 0.15  # Smallest sag of a hanging roof, divided by its height.
WALLS = 0.8  # Smallest `_edge_form` of an outer edge that is level and low enough to stand on walls.
APART = 12.0  # Largest distance between posts along a strip, metres.
FRAGMENT = 0.1  # Smallest size of a support, divided by the size of the largest support.
LOWEST_SILL = 0.005  # Smallest height of a window above the base, divided by the wall's height.
BAY = 7.5  # Usual distance between the columns of a grid, metres.
MOST = 200  # Largest number of columns, and of posts along a side.
SOLE = 0.03  # A closed surface stands on its vertices below this fraction of its height.
Kind = Literal["roof", "hung", "floor", "wall", "object"]


@dataclass(frozen=True, eq=False)
class SupportPlace:
    """A supported part of a surface.
    points : (k, 3) points along the free edge or on the surface, metres.    is_loop : True for a whole closed edge.
    length : length of the supported free edge (m), 0 inside the sheet.
    loop   : number of the supported boundary loop, 0 for the longest; None if another loop is about as long.
    radius : radius of a supported disc inside the sheet, metres."""

    name: str
    points: Floats
    length: float = 0.0
    is_loop: bool = False
    loop: int | None = None
    radius: float = 0.0

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 3))

    def with_offset(self, offset: Floats) -> "SupportPlace":
        """Return this supported part with `offset` (3,), metres, subtracted from its points."""
        return replace(self, points=self.points - offset)

    def picker(self, margin: float = 0.0, digits: int = 9) -> Boundary | Ball | Box:
        """Return an object that selects the vertices of this supported part on any mesh of the surface.
        margin : distance (m) added around the part.    digits : decimals of coordinates."""
        if self.loop is not None:
            return Boundary(self.loop)
        if self.length:
            steps = [0] if self.is_loop else [0, len(self.points) // 2, -1]
            return Boundary(points=tuple(point_tuple(self.points[k].round(digits)) for k in steps))
        if self.radius:
            middle = point_tuple(self.points.mean(axis=0).round(digits))
            return Ball(middle, max(round(self.radius, digits), 1.5 * margin))
        low, high = self.points.min(axis=0) - margin, self.points.max(axis=0) + margin
        return Box(point_tuple(low.round(digits)), point_tuple(high.round(digits)))


@dataclass(frozen=True, eq=False)
class SupportReading:
    """A way in which a shape may be supported.
    word : name for the option `--stand`.    form : score of the shape alone, 0 to 1 (best)."""

    word: str
    kind: Kind
    places: tuple[SupportPlace, ...]
    form: float

    def vertices(self, surface: Surface) -> Bools:
        """Return the supported vertices (n,) of a mesh of the surface."""
        return np.asarray(np.logical_or.reduce([place.picker().vertices(surface) for place in self.places]))


def readings(shape: Shape) -> list[SupportReading]:
    """Return all ways to support a shape that has edges, the best first."""
    candidates = [_of_what_it_leaves(shape, reading) for read in READINGS for reading in read(shape) if reading.places]
    return sorted((reading for reading in candidates if reading.form > 0.02), key=lambda reading: -reading.form)


def distinct_readings(shape: Shape) -> list[SupportReading]:
    """Return ways to support a shape, the best first, without nearly equal ways."""
    distinct = list[tuple[SupportReading, Bools]]()
    for reading in readings(shape):
        supported = reading.vertices(shape.surface)
        alike = (rival for earlier, rival in distinct if earlier.kind == reading.kind)
        if not any((supported & rival).sum() > 0.75 * (supported | rival).sum() for rival in alike):
            distinct.append((reading, supported))
    return [reading for reading, _ in distinct]


def _of_what_it_leaves(shape: Shape, reading: SupportReading) -> SupportReading:
    free = len(shape.heads) * (reading.word not in ("loops", "walls")) + len(shape.lugs) * (reading.word != "hung")
    ponds = len(shape.inner_hollows) > 0 and not shape.heads and reading.kind == "roof"
    ponds = ponds and reading.word not in ("hollows", "columns")
    sideways = [edge for edge in shape.small if np.hypot(*(neck := shape.neck(edge))[:2]) > max(0.4, abs(neck[2]))]
    is_partial = ponds or (free > 1 and reading.kind in ("roof", "hung"))
    is_partial |= reading.word == "loops" and _edge_form(shape) > WALLS
    is_partial |= reading.word == "corners" and bool(_masts(shape))
    return replace(reading, form=reading.form * (LEFT if is_partial else 1.0) * (LEFT if len(sideways) > 1 else 1.0))


def _mean(values: Iterator[float] | Sequence[float]) -> float:
    array = list(values)
    return float(np.mean(array)) if array else 0.0


def _roof(shape: Shape) -> float:
    return (1 - shape.wall) * (0.5 if shape.is_floor else 1.0)


def numbered_places(name: str, places: Sequence[SupportPlace]) -> tuple[SupportPlace, ...]:
    """Return the places, named "name 1", "name 2" ...; a single place has no number."""
    several = len(places) > 1
    return tuple(replace(place, name=f"{name} {k}" if several else name) for k, place in enumerate(places, 1))


def _edge_place(edge: Edge) -> SupportPlace:
    return SupportPlace("", edge.points, edge.length, is_loop=edge.closed)


def _whole(shape: Shape, edges: Sequence[Edge], name: str) -> tuple[SupportPlace, ...]:
    places = []
    for edge in edges:
        rivals = [rival for rival in shape.edges if abs(rival.length / edge.length - 1) < 0.05]
        places.append(replace(_edge_place(edge), loop=edge.loop if len(rivals) == 1 else None))
    return numbered_places(name, places)


def _discs(shape: Shape, points: Floats) -> tuple[SupportPlace, ...]:
    return numbered_places("column", [SupportPlace("", point[None], radius=0.03 * shape.width) for point in points])


def _column_heads(shape: Shape) -> Iterator[SupportReading]:
    form = DRAWN * (1 - shape.wall) * min(1, 2 * _mean([shape.neck(edge)[2] for edge in shape.heads]))
    yield SupportReading("loops", "roof", numbered_places("column", [_edge_place(edge) for edge in shape.heads]), form)


def _edge_form(shape: Shape) -> float:
    """Return a score of the outer edges: 1 for level and low edges that could rest on walls, less for other edges."""
    return _mean([edge.levelness * shape.lowness(edge) for edge in shape.outer])


def _walls(shape: Shape) -> Iterator[SupportReading]:
    if shape.heads and (form := _edge_form(shape)) > WALLS:
        places = (
            *_whole(shape, shape.outer, "wall"),
            *numbered_places("column", [_edge_place(edge) for edge in shape.heads]),
        )
        yield SupportReading("walls", "roof", places, DRAWN * _roof(shape) * form)


def _masts(shape: Shape) -> list[Edge]:
    is_tent = 3 <= len(shape.corners) <= 8 and is_scalloped(shape.edges[0], shape.corners)
    return [edge for edge in shape.small if is_tent and shape.neck(edge)[2] < -2 * NECK]


def _tent(shape: Shape) -> Iterator[SupportReading]:
    if masts := _masts(shape):
        top = numbered_places("mast", [_edge_place(edge) for edge in masts])
        yield SupportReading("tent", "roof", (*top, *_tips(shape, "anchor")), DRAWN * _roof(shape))


def _tips(shape: Shape, name: str) -> tuple[SupportPlace, ...]:
    edge = shape.edges[0]
    n, half = len(edge.points), max(round(shape.width / 50 / edge.length * len(edge.points)), 1)
    return numbered_places(name, [_edge_place(edge.part((k - half) % n, (k + half) % n)) for k in shape.corners])


def _lugs(shape: Shape) -> Iterator[SupportReading]:
    form = DRAWN * RARER * (1 - shape.wall) * min(1, -2 * _mean([shape.neck(edge)[2] for edge in shape.lugs]))
    yield SupportReading("hung", "hung", numbered_places("hanger", [_edge_place(edge) for edge in shape.lugs]), form)


def _valleys(shape: Shape) -> list[tuple[Edge, float]]:
    if shape.rise <= 0.05 * shape.width:
        return []
    return [valley for edge in shape.outer for valley in edge.valleys(shape.rise, shape.width / 25)]


def _feet(shape: Shape) -> Iterator[SupportReading]:
    valleys, count = _valleys(shape), 0
    ground = min((float(edge.z.min()) for edge, _ in valleys), default=0.0)
    for word, reach in (("feet", 0.35), ("all-feet", 0.7)):
        low = [(edge, depth) for edge, depth in valleys if edge.z.min() <= ground + reach * shape.rise]
        if len(low) > count:
            form = _mean([min(1, depth / (2 * DEPTH * shape.rise)) for _, depth in low])
            name = "springing line" if min(edge.length for edge, _ in low) > shape.width / 2 else "foot"
            places = numbered_places(name, [_edge_place(edge) for edge, _ in low])
            yield SupportReading(word, "roof", places, (USUAL if shape.is_raised else DRAWN) * _roof(shape) * form)
        count = len(low)


def _whole_edges(shape: Shape) -> Iterator[SupportReading]:
    outer, inner = ([edge.levelness * shape.lowness(edge) for edge in edges] for edges in (shape.outer, shape.large))
    kind: Kind = "floor" if shape.is_floor else "roof"
    name = "edge" if shape.is_floor else "base ring"
    floor = max(_roof(shape), float(shape.is_floor))
    drop = _mean([edge.z.mean() for edge in shape.outer]) - _mean([edge.z.mean() for edge in shape.large])
    is_vault = bool(shape.large) and shape.rise > 0.05 * shape.width and abs(drop) < 0.05 * shape.rise
    loss = LEFT if is_vault else 1.0  # a vault's inner and outer edge are equally low, so both probably have supports
    yield SupportReading("edge", kind, _whole(shape, shape.outer, name), DRAWN * loss * floor * _mean(outer))
    below = drop > max(0.3 * shape.rise, 0.015 * shape.width)
    usual = loss * (DRAWN if below else USUAL) * _roof(shape)
    yield SupportReading("ring", "roof", _whole(shape, shape.large, "inner edge"), usual * _mean(inner))
    if shape.large:
        form = (DRAWN if is_vault else USUAL) * _roof(shape) * (_mean(outer) + _mean(inner)) / 2
        yield SupportReading("edges", "roof", _whole(shape, [*shape.outer, *shape.large], "edge"), form)
    high = _mean([edge.levelness * (1 - shape.lowness(edge)) for edge in shape.outer])
    word = "rim" if shape.lugs else "hung"
    yield SupportReading(word, "hung", _whole(shape, shape.outer, "upper rim"), USUAL * RARER * _roof(shape) * high)


def _pairs(shape: Shape) -> tuple[list[Edge], list[Edge]]:
    return shape.sides[::2], shape.sides[1::2]


def _hangs_between(shape: Shape, two: Sequence[Edge], crossing: Sequence[Edge]) -> bool:
    if not two:
        return False
    low = min(float(side.z.min()) for side in two)
    middles = [float(side.z[len(side.z) // 4 : -len(side.z) // 4].max()) for side in crossing]
    return bool(low - SAG * shape.rise > max(shape.middle[2], *middles))


def _sides(shape: Shape) -> Iterator[SupportReading]:
    kind: Kind = "floor" if shape.is_deck else "roof"
    usual = DRAWN if shape.is_deck else USUAL * _roof(shape)
    for word, two, crossing in (("ends", *_pairs(shape)), ("sides", *_pairs(shape)[::-1])):
        sags = shape.ratio <= STRIP and _hangs_between(shape, two, crossing)
        low = [1.0 if sags or (shape.is_deck and word == "ends") else shape.lowness(side) for side in two]
        form = _mean([side.straight_levelness * share for side, share in zip(two, low, strict=True)])
        form *= DRAWN * _roof(shape) if sags else usual
        yield SupportReading(word, kind, numbered_places(word[:-1], [_edge_place(side) for side in two]), form)
    if shape.ratio > STRIP:
        apart = min(1.2 * min(end.length for end in shape.sides[::2]), APART)
        sides = [side for side in shape.sides[1::2] if side.length < MOST * apart]
        posts = [post for side in sides for post in side.posts(apart, shape.width / 25)]
        yield SupportReading(
            "posts", "roof", numbered_places("post", [_edge_place(post) for post in posts]), USUAL * _roof(shape)
        )


def _corners(shape: Shape) -> Iterator[SupportReading]:
    edge, corners = shape.edges[0], shape.corners
    if not 3 <= len(corners) <= 8:
        return
    feet = [valley.points for valley, _ in _valleys(shape)]
    away = np.asarray(cKDTree(np.concatenate(feet)).query(edge.points[corners])[0]) if feet else np.array([np.inf])
    if away.max() > shape.width / 12:
        form = DRAWN if is_scalloped(edge, corners) else ANYWHERE
        yield SupportReading("corners", "roof", _tips(shape, "mast"), form * _roof(shape))


def _columns(shape: Shape) -> Iterator[SupportReading]:
    if len(shape.inner_hollows) and not shape.heads:
        V = shape.surface.V
        rises = min(float(edge.z.min()) for edge in shape.outer) > V[:, 2].min() + 0.1 * shape.rise
        places = _discs(shape, V[shape.hollows])
        yield SupportReading("hollows", "roof", places, (DRAWN if rises else USUAL) * _roof(shape))
    low, high = shape.surface.V[:, :2].min(axis=0), shape.surface.V[:, :2].max(axis=0)
    counts = np.maximum(np.round((high - low) / BAY).astype(int), 1)
    if counts.prod() > MOST:
        return
    shares = np.stack(np.meshgrid(*((np.arange(count) + 0.5) / count for count in counts)), axis=-1).reshape(-1, 2)
    places = _discs(shape, shape.below(low + (high - low) * shares))
    yield SupportReading("columns", "roof", places, ANYWHERE * _roof(shape))


def _base(shape: Shape) -> Iterator[SupportReading]:
    if shape.wall:
        ground = shape.surface.V[:, 2].min() + LOWEST_SILL * shape.rise
        windows = [edge for edge in shape.large if edge.z.min() > ground]
        edges = [edge for edge in (*shape.outer, *shape.large) if edge not in windows]
        places = low_places(shape, RISE * shape.rise, edges)
        cover = sum(place.length for place in places) / np.ptp(shape.surface.V[:, :2], axis=0).max()
        form = DRAWN * RARER * shape.wall * min(1, cover)
        yield SupportReading("base", "wall", numbered_places("base", places), form)


def low_places(shape: Shape, reach: float, edges: Sequence[Edge] = ()) -> list[SupportPlace]:
    """Return the parts of edges at most `reach` metres above the lowest point."""
    highest, places = shape.surface.V[:, 2].min() + reach, list[SupportPlace]()
    for edge in edges or (*shape.outer, *shape.large):
        low = edge.z <= highest
        if low.all():
            places.append(_whole(shape, [edge], "base")[0])
            continue
        starts, ends = np.flatnonzero(low & ~np.roll(low, 1)), np.flatnonzero(low & ~np.roll(low, -1))
        for start in starts:
            end = ends[(ends - start) % len(low) == ((ends - start) % len(low)).min()][0]
            if end != start:
                places.append(_edge_place(edge.part(int(start), int(end))))
    enough = FRAGMENT * max((place.length for place in places), default=0.0)
    return [place for place in places if place.length >= enough]


def soles(surface: Surface) -> tuple[SupportPlace, ...]:
    """Return the lowest parts of a closed surface as supports; very small parts are left out."""
    z = surface.V[:, 2]
    low = z <= z.min() + SOLE * np.ptp(z)
    ends = surface.edges.ends[low[surface.edges.ends].all(axis=1)]
    _, part = link_components(surface.n, ends[:, 0], ends[:, 1])
    groups: list[Ints] = [np.flatnonzero(low & (part == k)) for k in np.unique(part[low])]
    enough = FRAGMENT * max(map(len, groups))
    return numbered_places("foot", [SupportPlace("", surface.V[group]) for group in groups if len(group) >= enough])


READINGS: tuple[Callable[[Shape], Iterator[SupportReading]], ...] = (
    _column_heads, _walls, _lugs, _tent, _feet, _whole_edges, _sides, _corners, _columns, _base,
)  # fmt: skip
