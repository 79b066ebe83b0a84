"""`bridged_necks`: where an opening is narrower than a width, the members beside it become one.

room  `--.  .--`  room      Discs of the width have room on both sides of a neck and none in it. The bridge is a
- - -   bridge   - - -      strip of material across the narrowest place, as broad as the width; what is left of
      .--'  '--.            the neck beside it are tips of two openings.
"""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.clean import Snapping, clean_split
from dsfab.slicing.flat_openings import FlatOpenings
from dsfab.slicing.narrow_gaps import narrow_gaps
from dsfab.slicing.narrow_parts import narrow_parts
from dsfab.slicing.openings import Openings
from dsfab.slicing.recut import Recut
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.walls import Walls
from dsfab.surface import nearest

ROUNDS = 4
"""A bridge may leave necks on both of its sides, and two bridges that would touch are made one after the other."""
POCKET = 1.6
"""What a bridge parts off is filled where 4 area / perimeter is under this many widths."""
REACH = 0.25
"""A bridge runs so many widths past its neck, along walls that it meets askew."""
SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3
"""Vertices nearer to the side of a bridge than this share of half its width are on it."""


@dataclass(frozen=True, eq=False)
class Neck:
    """A place where an opening is too narrow: points (2, 3) on both of its walls, and the numbers of these."""

    ends: Floats
    walls: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Bridge:
    """Void cells (c,) that a strip crosses, the first of which it begins in, and the family that it takes.

    middle : (3,).    axes : (2, 3) unit vectors along and across.    half : (2,) half of its length and width, metres.
    """

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    def within(self, X: Floats) -> Floats:
        """(2, k) coordinates of points X (k, 3) along and across; the sides are at -1 and 1."""
        return np.asarray(self.axes @ (X - self.middle).T / self.half[:, None])


def bridged_necks(cells: Sheet, width: float) -> tuple[Sheet, int]:
    """The cells with openings bridged wherever they are narrower than `width` metres, and how many bridges it took.

    Openings that are nowhere so wide, and small ones that a bridge parts off, become material. Openings that the edge
    of the surface cuts open stay as they are, and so do tips, which `rounded_corners` rounds.
    """
    count = 0
    for _ in range(ROUNDS):
        if cells.material.all() or not cells.material.any():
            break
        walls = Walls.of(cells)
        necks, lost = _narrow(cells, walls, width)
        cells, more = _with_bridges(_filled(cells, lost), walls, necks, width)
        if not more:
            break
        count += more
    return cells, count


def bridged_gaps(cells: Sheet, rounded: Sheet, least: float, width: float) -> tuple[Sheet, int]:
    """The cells with bridges, `width` metres broad, where openings are narrower than `least` metres once their corners
    are `rounded`; and how many bridges that took.

    Necks are found in openings laid flat. What that does not see, where a surface is folded, or where walls leave no
    room for an arc, is found here as `features` measures it.
    """
    if cells.material.all() or not cells.material.any() or not len(gaps := narrow_gaps(rounded, least, 2 * width)):
        return cells, 0
    walls = Walls.of(cells)
    edges = np.stack([walls.start, walls.end], axis=1)
    found = nearest(gaps.reshape(-1, 3), cells.surface.V, edges)
    ends, on = found.place.reshape(-1, 2, 3), found.simplex.reshape(-1, 2)
    necks = [Neck(place, (int(wall[0]), int(wall[1]))) for place, wall in zip(ends, on, strict=True)]
    return _with_bridges(cells, walls, necks, width)


def _with_bridges(cells: Sheet, walls: Walls, necks: list[Neck], width: float) -> tuple[Sheet, int]:
    """The cells with as many necks bridged as can be at once, and how many."""
    bridges = [bridge for neck in necks if (bridge := _bridge(cells, walls, neck, width)) is not None]
    if not (bridges := _apart(cells, bridges)):
        return cells, 0
    return _without_pockets(_bridged(cells, bridges), cells.surface.n, width), len(bridges)


def _narrow(cells: Sheet, walls: Walls, width: float) -> tuple[list[Neck], list[int]]:
    """The necks of openings, and a void cell of each opening that is all too narrow."""
    flat = FlatOpenings.of(cells, walls)
    necks, lost = [], list[int]()
    for part in narrow_parts(flat, width / 2):
        if not part.runs:
            lost.append(int(walls.inside[flat.wall[flat.touched(part.outline[:1])[0][0]]]) // 3)
            continue
        number, share = flat.touched(part.narrowest())
        wall = flat.wall[number]
        ends = walls.points(cells.surface.V, wall, share)
        if np.linalg.norm(ends[1] - ends[0]) < width:  # else the opening is curved, and only looks narrow from there
            necks.append(Neck(ends, (int(wall[0]), int(wall[1]))))
    return necks, lost


def _filled(cells: Sheet, lost: list[int]) -> Sheet:
    """The openings of these void cells made material."""
    every = Openings.of(cells) if lost else None
    if every is None:
        return cells
    wanted = np.zeros(every.count, dtype=bool)
    wanted[every.label[np.searchsorted(every.face, lost)]] = True
    return every.filled(wanted)


def _bridge(cells: Sheet, walls: Walls, neck: Neck, width: float) -> Bridge | None:
    """The void cells between both walls of a neck that its bridge crosses; None where it would not end there."""
    surface, void = cells.surface, ~cells.material
    first, last = (int(walls.inside[wall]) // 3 for wall in neck.walls)
    way, middle = neck.ends[1] - neck.ends[0], neck.ends.mean(axis=0)
    gap = float(np.linalg.norm(way))
    if not gap or not (void[first] and void[last]):
        return None
    along = way / gap
    across = np.cross(surface.normals[first], along)
    across /= np.linalg.norm(across)
    family = int(cells.family[walls.outside[neck.walls[0]] // 3])
    half = np.array([gap / 2 + REACH * width, width / 2])
    bridge = Bridge(np.array([first]), family, middle, np.stack([along, across]), half)
    seen, waiting = [first], [first]
    while waiting:
        cell = waiting.pop()
        here = bridge.within(surface.V[surface.F[cell]])
        there = np.roll(here, -1, axis=1)
        crossed = ((np.minimum(here, there) < 1) & (np.maximum(here, there) > -1)).all(axis=0)
        others = [c for c in cells.void_beside[cell][crossed].tolist() if c >= 0 and c not in seen]
        seen += others
        waiting += others
    return replace(bridge, cells=np.array(seen)) if last in seen else None


def _apart(cells: Sheet, bridges: list[Bridge]) -> list[Bridge]:
    """Those that have no vertex in common with one before them."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for bridge in bridges:
        vertices = cells.surface.F[bridge.cells]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(bridge)
    return chosen


def _bridged(cells: Sheet, bridges: list[Bridge]) -> Sheet:
    """The strips made material."""
    some = Recut.of(cells, np.concatenate([bridge.cells for bridge in bridges]))
    mesh, owner, root = some.mesh, np.full(len(some.cells), -1), np.arange(len(some.cells))
    for k, bridge in enumerate(bridges):
        owner[np.searchsorted(some.cells, bridge.cells)] = k
    inside = owner >= 0
    for axis in range(2):
        x = np.full(len(mesh.X), 2.0)
        for k, bridge in enumerate(bridges):
            slots = mesh.cells.slots(np.flatnonzero(inside & (owner[root] == k)))
            vertex = np.unique(mesh.cells.corner[slots])
            x[vertex] = bridge.within(mesh.X[vertex])[axis]
        near = np.abs(np.abs(x) - 1) < SNAP
        x[near] = np.sign(x[near])
        split = clean_split(mesh.cells, mesh.X, x, SIDES, inside, Snapping(0.0, cells.surface.size))
        mesh, root, inside = mesh.after(split), root[split.source], inside[split.source] & (split.strip == 1)
    part, first = mesh.parts(inside), np.searchsorted(some.cells, [bridge.cells[0] for bridge in bridges])
    chosen = inside & np.isin(part, part[inside & np.isin(root, first)])
    family = np.array([bridge.family for bridge in bridges])[owner[root]]
    return some.together(replace(mesh, family=np.where(chosen, family, mesh.family)), root)


def _without_pockets(cells: Sheet, before: int, width: float) -> Sheet:
    """The cells with the small openings beside bridges, whose vertices are not among the first `before`, filled."""
    every = Openings.of(cells)
    if every is None:
        return cells
    beside = np.zeros(every.count, dtype=bool)
    beside[every.label[(cells.surface.F[every.face] >= before).any(axis=1)]] = True
    small: Bools = beside & (every.round_sizes < POCKET * width)
    return every.filled(small) if small.any() else cells
