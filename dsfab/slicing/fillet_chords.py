"""The chords that round the corners of openings, each arc with the void cells that it cuts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.arcs import Arcs
from dsfab.slicing.opening_corners import SMALLER, Corners
from dsfab.slicing.rolled_corners import rolled_arcs
from dsfab.slicing.stretches import Stretches

SNAP = 2e-3
"""Vertices nearer to a chord than this share of the radius are on it: no slivers."""
SMALLEST = 0.02
"""Corners with room for a smaller share of the radius stay sharp."""
TRIES = 12
"""Radii that are tried, each smaller than the last."""
FARTHEST = 1.1
"""What an arc rounds off is no farther from its corner than so many times the farther foot."""

COLUMNS = ("wall", "radius", "normal", "distance", "ray", "ray_distance")


@dataclass(frozen=True, eq=False)
class Fillets:
    """Chords of the arcs that are to round corners (k,), and the rays beside some: planes of outward normals (k, c, 3)
    and (k, 2, 3), metres from the origin of space (k, c) and (k, 2). A plane that is none has a normal of 0.

    Rounded off is what lies beyond a chord and within both rays. Rays are those from the middle through the feet, where
    the walls turn away so sharply at a foot that the void beside it lies beyond the chord as well.

    wall : (k,) the walls that begin at the corners.    radius : (k,) metres.
    pair : (p, 2) an arc, and a void cell that lies beyond its chords in part, reached from the corner through others.
    """

    wall: Ints
    radius: Floats
    normal: Floats
    distance: Floats
    ray: Floats
    ray_distance: Floats
    pair: Ints

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.wall)

    def beyond(self, arc: Ints, X: Floats) -> Floats:
        """(p,) metres that points X (p, 3) lie beyond the chord of an arc (p,) that they are farthest beyond."""
        return np.asarray((np.einsum("pci,pi->pc", self.normal[arc], X) - self.distance[arc]).max(axis=1))

    def outside(self, arc: Ints, X: Floats) -> Floats:
        """(p,) metres that points X (p, 3) lie outside the ray of an arc (p,) that they are farthest outside of."""
        return np.asarray((np.einsum("pci,pi->pc", self.ray[arc], X) - self.ray_distance[arc]).max(axis=1))

    def some(self, chosen: Bools) -> "Fillets":
        """Those that are marked (k,), with their void cells."""
        number = np.cumsum(chosen) - 1
        pair = self.pair[chosen[self.pair[:, 0]]]
        pair = np.stack([number[pair[:, 0]], pair[:, 1]], axis=1)
        return Fillets(**{name: getattr(self, name)[chosen] for name in COLUMNS}, pair=pair)

    @classmethod
    def joined(cls, parts: Sequence["Fillets"]) -> "Fillets":
        """All fillets of several, one behind the other."""
        before = np.cumsum([0, *(part.count for part in parts)])
        pair = np.concatenate([part.pair + [begin, 0] for part, begin in zip(parts, before[:-1], strict=True)])
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
        return cls(**columns, pair=pair)


def fitting_fillets(corners: Corners, radius: float) -> Fillets:
    """Arcs for all corners: where a disc of that radius stops, beyond which may be several; then for each of the
    others, made smaller until they fit between the walls; without those that do not."""
    done, taken = list[Fillets](), list[Stretches]()
    for tips, arcs in rolled_arcs(corners, radius, taken):
        for rays in (False, True):
            for before in taken:
                free = ~tips.stretches(arcs).meet(before, len(tips.first))
                tips, arcs = tips.some(free), arcs.some(free)
            rolled, clear = _cutting(tips, np.arange(len(tips.first)), arcs, rays)
            done.append(rolled.some(clear))
            taken.append(tips.some(clear).stretches(arcs.some(clear)))
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


def _cutting(corners: Corners, at: Ints, arcs: Arcs, rays: bool = False) -> tuple[Fillets, Bools]:
    """Chords in space for arcs at corners `at`, and which arcs are clear: beyond them is no other wall, and no end."""
    surface, walls, beside = corners.sheet.surface, corners.walls, corners.sheet.void_beside
    flat, distance = arcs.chords()
    normal = np.einsum("kcj,kji->kci", flat, corners.frames[at])
    distance = distance + np.einsum("kci,ki->kc", normal, corners.origin[at])
    arc, cell = np.arange(len(at)), walls.inside[corners.first[at]] // 3
    ray, ray_distance = np.zeros((len(at), 2, 3)), np.ones((len(at), 2))
    if rays:
        flat, ray_distance = arcs.rays()
        ray = np.einsum("kcj,kji->kci", flat, corners.frames[at])
        ray_distance = ray_distance + np.einsum("kci,ki->kc", ray, corners.origin[at])
    pair = np.stack([arc, cell], axis=1)
    fillets = Fillets(corners.first[at], arcs.radius, normal, distance, ray, ray_distance, pair)
    seen = key = arc * surface.m + cell
    clear = np.ones(len(at), dtype=bool)
    edge = np.zeros(surface.n, dtype=bool)
    edge[surface.edges.ends[surface.edges.boundary]] = True
    edge[walls.start] = True
    while len(key):
        arc, cell = key // surface.m, key % surface.m
        vertex = surface.F[cell]
        beyond = np.stack([fillets.beyond(arc, surface.V[v]) for v in vertex.T], axis=1)
        outside = np.stack([fillets.outside(arc, surface.V[v]) for v in vertex.T], axis=1)
        least = SNAP * arcs.radius[arc][:, None]
        row, c = np.nonzero((beyond > -least) & edge[vertex])
        between = corners.between_feet(at[arc[row]], arcs.some(arc[row]), vertex[row, c])
        out = outside[row, c]
        stray = np.where(between, out > least[row, 0], out < -least[row, 0])
        clear[arc[row[stray]]] = False
        through = (np.maximum(beyond, np.roll(beyond, -1, axis=1)) > 0) & (beside[cell] >= 0)
        through &= np.minimum(outside, np.roll(outside, -1, axis=1)) < 0
        row, c = np.nonzero(through & clear[arc][:, None])
        key = np.setdiff1d(arc[row] * surface.m + beside[cell][row, c], seen)
        seen = np.concatenate([seen, key])
    fillets = replace(fillets, pair=np.stack([seen // surface.m, seen % surface.m], axis=1))
    return fillets, clear & _within_feet(corners, at, arcs, fillets)


def _within_feet(corners: Corners, at: Ints, arcs: Arcs, fillets: Fillets) -> Bools:
    """(k,) which arcs at corners `at` (k,) round off nothing farther from the corner, in its plane, than their feet.

    What an arc and the walls between its feet enclose is not. At a fold the void may turn back under itself and lie
    beyond a chord again, where no wall parts it from the corner: an arc would fill the opening all along the fold.
    """
    surface, (arc, cell) = corners.sheet.surface, fillets.pair.T
    most = FARTHEST * np.maximum(arcs.way_a, arcs.way_b)

    def farther(arc: Ints, X: Floats) -> Bools:
        flat = np.einsum("p...i,pji->p...j", X - corners.origin[at[arc]][:, None], corners.frames[at[arc]])
        return np.asarray(np.linalg.norm(flat, axis=-1) > most[arc][:, None])

    some = farther(arc, surface.V[surface.F[cell]]).any(axis=1)  # points of the others are between near ones
    arc, X = arc[some], surface.V[surface.F[cell[some]]]
    bad = np.zeros(len(at), dtype=bool)
    for c in range(fillets.normal.shape[1]):
        here = np.einsum("pvi,pi->pv", X, fillets.normal[arc, c]) - fillets.distance[arc, c][:, None]
        there = np.roll(here, -1, axis=1)
        crossed = here * there < 0
        share = np.divide(here, here - there, out=np.zeros_like(here), where=crossed)
        ends = X + share[:, :, None] * (np.roll(X, -1, axis=1) - X)
        out = np.einsum("pvi,pri->pvr", ends, fillets.ray[arc]) - fillets.ray_distance[arc][:, None]
        far = (crossed | (here > 0)) & (out < 0).all(axis=2) & farther(arc, ends)
        bad[arc[far.any(axis=1)]] = True
    return ~bad
