"""Strips of material across the openings of a sheet: bridges, and what makes members wider."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.clean import Snapping, clean_split
from dsfab.slicing.openings import Openings
from dsfab.slicing.recut import Recut
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.walls import Walls

POCKET = 1.6
"""What a strip parts off is filled where 4 area / perimeter is under this many widths."""
SIDES = np.array([-1.0, 1.0])
SNAP = 2e-3
"""Vertices nearer to the side of a strip than this share of half its width are on it."""


@dataclass(frozen=True, eq=False)
class Strip:
    """Void cells (c,) that a strip crosses, the first of which it begins in, and the family that it takes.

    middle : (3,).    axes : (2, 3) unit vectors along and across.    half : (2,) half of its length and width, metres.
    """

    cells: Ints
    family: int
    middle: Floats
    axes: Floats
    half: Floats

    @classmethod
    def of(cls, cells: Sheet, walls: Walls, wall: int, ends: Floats, half: Floats) -> "Strip | None":
        """In the opening at a wall, along the line between two ends (2, 3); None where there is none."""
        surface, first = cells.surface, int(walls.inside[wall]) // 3
        way = ends[1] - ends[0]
        gap = float(np.linalg.norm(way))
        if not gap or cells.material[first]:
            return None
        along = way / gap
        across = np.cross(surface.normals[first], along)
        across /= np.linalg.norm(across)
        family = int(cells.family[walls.outside[wall] // 3])
        strip = cls(np.array([first]), family, ends.mean(axis=0), np.stack([along, across]), half)
        seen, waiting = [first], [first]
        while waiting:
            cell = waiting.pop()
            here = strip.within(surface.V[surface.F[cell]])
            there = np.roll(here, -1, axis=1)
            crossed = ((np.minimum(here, there) < 1) & (np.maximum(here, there) > -1)).all(axis=0)
            others = [c for c in cells.void_beside[cell][crossed].tolist() if c >= 0 and c not in seen]
            seen += others
            waiting += others
        return replace(strip, cells=np.array(seen))

    def within(self, X: Floats) -> Floats:
        """(2, k) coordinates of points X (k, 3) along and across; the sides are at -1 and 1."""
        return np.asarray(self.axes @ (X - self.middle).T / self.half[:, None])


def with_strips(cells: Sheet, strips: list[Strip], width: float, snap: float = SNAP) -> tuple[Sheet, int]:
    """The cells with as many strips as can be made at once, and small openings that these part off, as material; and
    how many strips. `width`, metres, is what small refers to; for `snap` see `SNAP`."""
    if not (strips := [strips[k] for k in apart(cells, [strip.cells for strip in strips])]):
        return cells, 0
    return _without_pockets(_filled(cells, strips, snap), cells.surface.n, width), len(strips)


def apart(cells: Sheet, groups: Sequence[Ints]) -> list[int]:
    """The numbers of those groups (c,) of cells that have no vertex in common with one chosen before."""
    taken, chosen = np.zeros(cells.surface.n, dtype=bool), []
    for k, group in enumerate(groups):
        vertices = cells.surface.F[group]
        if not taken[vertices].any():
            taken[vertices] = True
            chosen.append(k)
    return chosen


def _filled(cells: Sheet, strips: list[Strip], snap: float) -> Sheet:
    """The strips made material."""
    some = Recut.of(cells, np.concatenate([strip.cells for strip in strips]))
    mesh, owner, root = some.mesh, np.full(len(some.cells), -1), np.arange(len(some.cells))
    for k, strip in enumerate(strips):
        owner[np.searchsorted(some.cells, strip.cells)] = k
    inside = owner >= 0
    for axis in range(2):
        x = np.full(len(mesh.X), 2.0)
        for k, strip in enumerate(strips):
            slots = mesh.cells.slots(np.flatnonzero(inside & (owner[root] == k)))
            vertex = np.unique(mesh.cells.corner[slots])
            x[vertex] = strip.within(mesh.X[vertex])[axis]
        near = np.abs(np.abs(x) - 1) < snap
        x[near] = np.sign(x[near])
        split = clean_split(mesh.cells, mesh.X, x, SIDES, inside, Snapping(0.0, cells.surface.size))
        mesh, root, inside = mesh.after(split), root[split.source], inside[split.source] & (split.strip == 1)
    part, first = mesh.parts(inside), np.searchsorted(some.cells, [strip.cells[0] for strip in strips])
    chosen = inside & np.isin(part, part[inside & np.isin(root, first)])
    family = np.array([strip.family for strip in strips])[owner[root]]
    return some.together(replace(mesh, family=np.where(chosen, family, mesh.family)), root)


def _without_pockets(cells: Sheet, before: int, width: float) -> Sheet:
    """The cells with the small openings beside strips, whose vertices are not among the first `before`, filled."""
    every = Openings.of(cells)
    if every is None:
        return cells
    beside = np.zeros(every.count, dtype=bool)
    beside[every.label[(cells.surface.F[every.face] >= before).any(axis=1)]] = True
    small: Bools = beside & (every.round_sizes < POCKET * width)
    return every.filled(small) if small.any() else cells
