"""The chords that round the corners of openings, each arc with the void cells that it cuts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.arcs import Arcs
from dsfab.slicing.opening_corners import SMALLER, Corners
from dsfab.slicing.rolled_corners import rolled_arcs

SNAP = 2e-3
"""Vertices nearer to a chord than this share of the radius are on it: no slivers."""
SMALLEST = 0.02
"""Corners with room for a smaller share of the radius stay sharp."""
TRIES = 12
"""Radii that are tried, each smaller than the last."""


@dataclass(frozen=True, eq=False)
class Fillets:
    """Chords of the arcs that are to round corners (k,): normals (k, c, 3), metres from the origin of space (k, c).

    wall : (k,) the walls that begin at the corners.    radius : (k,) metres.
    pair : (p, 2) an arc, and a void cell that lies beyond its chords in part, reached from the corner through others.
    """

    wall: Ints
    radius: Floats
    normal: Floats
    distance: Floats
    pair: Ints

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.wall)

    def beyond(self, arc: Ints, X: Floats) -> Floats:
        """(p,) metres that points X (p, 3) lie beyond the chord of an arc (p,) that they are farthest beyond."""
        return np.asarray((np.einsum("pci,pi->pc", self.normal[arc], X) - self.distance[arc]).max(axis=1))

    def some(self, chosen: Bools) -> "Fillets":
        """Those that are marked (k,), with their void cells."""
        number = np.cumsum(chosen) - 1
        pair = self.pair[chosen[self.pair[:, 0]]]
        pair = np.stack([number[pair[:, 0]], pair[:, 1]], axis=1)
        return Fillets(self.wall[chosen], self.radius[chosen], self.normal[chosen], self.distance[chosen], pair)

    @classmethod
    def joined(cls, parts: Sequence["Fillets"]) -> "Fillets":
        """All fillets of several, one behind the other."""
        before = np.cumsum([0, *(part.count for part in parts)])
        pair = np.concatenate([part.pair + [begin, 0] for part, begin in zip(parts, before[:-1], strict=True)])
        columns = zip(*((part.wall, part.radius, part.normal, part.distance) for part in parts), strict=True)
        wall, radius, normal, distance = (np.concatenate(column) for column in columns)
        return cls(wall, radius, normal, distance, pair)


def fitting_fillets(corners: Corners, radius: float) -> Fillets:
    """Arcs for all corners: where a disc of that radius stops, beyond which may be several; then for each of the
    others, made smaller until they fit between the walls; without those that do not."""
    tips, arcs = rolled_arcs(corners, radius)
    rolled, clear = _cutting(tips, np.arange(len(tips.first)), arcs)
    done = [rolled.some(clear)]
    corners = corners.beside(tips.some(clear), arcs.some(clear))
    wanted = corners.largest(radius)
    waiting = np.flatnonzero(wanted >= SMALLEST * radius)
    for _ in range(TRIES):
        arcs, factor = corners.arcs(waiting, wanted[waiting])
        fits = factor == 1
        fillets, clear = _cutting(corners, waiting[fits], arcs.some(fits))
        done.append(fillets.some(clear))
        factor[np.flatnonzero(fits)[~clear]] = SMALLER
        wanted[waiting] *= factor
        waiting = waiting[factor < 1]
        waiting = waiting[wanted[waiting] >= SMALLEST * radius]
        if not len(waiting):
            break
    return Fillets.joined(done)


def _cutting(corners: Corners, at: Ints, arcs: Arcs) -> tuple[Fillets, Bools]:
    """Chords in space for arcs at corners `at`, and which arcs are clear: beyond them is no other wall, and no end."""
    surface, walls, beside = corners.sheet.surface, corners.walls, corners.sheet.void_beside
    flat, distance = arcs.chords()
    normal = np.einsum("kcj,kji->kci", flat, corners.frames[at])
    distance = distance + np.einsum("kci,ki->kc", normal, corners.origin[at])
    arc, cell = np.arange(len(at)), walls.inside[corners.first[at]] // 3
    fillets = Fillets(corners.first[at], arcs.radius, normal, distance, np.stack([arc, cell], axis=1))
    seen = key = arc * surface.m + cell
    clear = np.ones(len(at), dtype=bool)
    edge = np.zeros(surface.n, dtype=bool)
    edge[surface.edges.ends[surface.edges.boundary]] = True
    edge[walls.start] = True
    while len(key):
        arc, cell = key // surface.m, key % surface.m
        vertex = surface.F[cell]
        beyond = np.stack([fillets.beyond(arc, surface.V[v]) for v in vertex.T], axis=1)
        row, c = np.nonzero((beyond > -SNAP * arcs.radius[arc][:, None]) & edge[vertex])
        stray = ~corners.between_feet(at[arc[row]], arcs.some(arc[row]), vertex[row, c])
        clear[arc[row[stray]]] = False
        through = (np.maximum(beyond, np.roll(beyond, -1, axis=1)) > 0) & (beside[cell] >= 0)
        row, c = np.nonzero(through & clear[arc][:, None])
        key = np.setdiff1d(arc[row] * surface.m + beside[cell][row, c], seen)
        seen = np.concatenate([seen, key])
    pair = np.stack([seen // surface.m, seen % surface.m], axis=1)
    return replace(fillets, pair=pair), clear
