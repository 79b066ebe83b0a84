"""One of the sides that mirrors make of a surface, cut out along their planes, and all sides from that one."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface.mesh import Surface
from dsfab.surface.remesh.mirrored import Mirrors
from dsfab.surface.topology import connected, euler_characteristic, half_edges, pieces

NEAR = 1e-3
"""Of the edge: vertices that are so near to a plane are on it, and images that are so near to each other are one."""
SAME = 1e-9
"""Of the surface's size: what is as near to a plane after its cut is in it, but for rounding."""
LIKE = 0.05
"""The length of all boundaries may change by this share: chords are shorter than curves."""


@dataclass(frozen=True, eq=False)
class Chamber:
    """The side of a surface on which `toward` is, of all planes of its mirrors.

    toward : (k, 3) unit normals of the planes, turned to the side.
    """

    whole: Surface
    mirrors: Mirrors
    toward: Floats
    edge: float

    @classmethod
    def of(cls, surface: Surface, mirrors: Mirrors, edge: float) -> "Chamber":
        """The side of a point that turns with the surface, and lies in none of the planes."""
        mix = np.cos(np.arange(surface.n) + 1.0) @ (surface.V - mirrors.centre)
        side = np.where(mirrors.normals @ mix < 0, -1.0, 1.0)
        return cls(surface, mirrors, side[:, None] * mirrors.normals, edge)

    @cached_property
    def piece(self) -> Surface | None:
        """What of the surface is on the side; None where it has faces within the planes."""
        V, F = self.whole.V, self.whole.F
        for normal in self.toward:
            cut = _kept(V - self.mirrors.centre, F, normal, NEAR * self.edge)
            if cut is None:
                return None
            V, F = cut[0] + self.mirrors.centre, cut[1]
        return Surface(V, F) if len(F) else None

    def within(self, V: Floats) -> Bools:
        """(k, p) in which of the planes points V (p, 3) are."""
        return np.asarray(np.abs(self.toward @ (V - self.mirrors.centre).T) < SAME * self.whole.size)

    def flat(self, V: Floats, planes: Bools) -> Floats:
        """Points V (p, 3) moved into their planes (k, p)."""
        found = V.copy()
        for _ in range(2 * len(self.toward)):  # where several planes meet, in turns
            for normal, on in zip(self.toward, planes, strict=True):
                found[on] -= np.outer((found[on] - self.mirrors.centre) @ normal, normal)
        return found

    def all_sides(self, V: Floats, F: Ints) -> tuple[Surface, Ints] | None:
        """The whole surface of the side's new vertices V (p, 3) and faces F, and (n,) which of V each vertex is an
        image of; None where that is another surface."""
        n, centre = len(V), self.mirrors.centre
        images = [(V - centre) @ R.T + centre for R in self.mirrors.group]
        faces = [F[:, ::-1] if np.linalg.det(R) < 0 else F for R in self.mirrors.group]
        every = np.concatenate(images)
        pairs = cKDTree(every).query_pairs(NEAR * self.edge, output_type="ndarray").astype(np.int64)
        count, label = connected(len(every), pairs[:, 0], pairs[:, 1])
        first = np.full(count, len(every))
        np.minimum.at(first, label, np.arange(len(every)))
        order = np.argsort(first)
        number = np.empty(count, dtype=np.int64)
        number[order] = np.arange(count)
        found = Surface(every[first[order]], number[label[np.concatenate([f + k * n for k, f in enumerate(faces)])]])
        return (found, first[order] % n) if self._same(found) else None

    def _same(self, found: Surface) -> bool:
        """Whether a surface has the pieces, the holes and the edges of the whole."""
        old = self.whole

        def facts(s: Surface) -> tuple[int, ...]:
            return pieces(s.F, s.edges)[0], euler_characteristic(s.F, s.edges), len(s.loops), len(s.pinches)

        if found.edges.count.max() > 2 or facts(found) != facts(old):
            return False
        one, two = (float(s.edge_lengths[s.edges.boundary].sum()) for s in (found, old))
        return abs(one - two) <= LIKE * two


def _kept(x: Floats, F: Ints, normal: Floats, near: float) -> tuple[Floats, Ints] | None:
    """Points x (n, 3) and faces on the side of a plane through the origin that its normal points to."""
    d = x @ normal
    on = np.abs(d) <= near
    x, d = x - np.outer(np.where(on, d, 0.0), normal), np.where(on, 0.0, d)
    sign = np.sign(d[F]).astype(np.int64)
    if (sign == 0).all(axis=1).any():
        return None
    whole, cut = F[sign.min(axis=1) >= 0], F[(sign.min(axis=1) < 0) & (sign.max(axis=1) > 0)]
    a, b = half_edges(cut)
    ends = np.sort(np.stack([a, b], axis=1), axis=1)
    crossed, at = np.unique(ends[np.sign(d[a]) * np.sign(d[b]) < 0], axis=0, return_inverse=True)
    t = (d[crossed[:, 0]] / (d[crossed[:, 0]] - d[crossed[:, 1]]))[:, None]
    new = np.full(len(a), -1)
    new[np.sign(d[a]) * np.sign(d[b]) < 0] = len(x) + at.ravel()
    points = (1 - t) * x[crossed[:, 0]] + t * x[crossed[:, 1]]
    points -= np.outer(points @ normal, normal)
    made = [whole]
    corner = np.stack([cut, new.reshape(-1, 3)], axis=2).reshape(-1, 6)  # a, ab, b, bc, c, ca
    stays = (corner >= 0) & (np.concatenate([d, np.zeros(len(points))])[corner] >= 0)
    for k in (3, 4):
        mine = corner[stays.sum(axis=1) == k][stays[stays.sum(axis=1) == k]].reshape(-1, k)
        made += [mine[:, [0, i, i + 1]] for i in range(1, k - 1)]
    F = np.concatenate(made)
    used, F = np.unique(F, return_inverse=True)
    return np.concatenate([x, points])[used], F.reshape(-1, 3)
