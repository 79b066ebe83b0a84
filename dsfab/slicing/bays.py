"""`Bays`: the middles of a family's members, from one crossing with the other family to the next."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.limits import SLIT
from dsfab.slicing.drawn import ON
from dsfab.slicing.middles import Middles
from dsfab.surface.topology import connected


@dataclass(frozen=True, eq=False)
class Bays:
    """The pieces of `Middles`, divided where they cross the middles of the other family.

    piece  : (b,) of each part.    at : (b, 3) barycentric coordinates of its middle.    length : (b,) metres.
    bay    : (b,) the bay that it is a part of, of `count`.
    angle  : (c,) degrees between members where they cross, outside of what is kept besides the stripes.
    """

    middles: Middles
    piece: Ints
    at: Floats
    length: Floats
    bay: Ints
    count: int
    angle: Floats

    @cached_property
    def free(self) -> Floats:
        """(b,) metres outside of the members of the other family and of what is kept besides the stripes."""
        drawn, face = self.middles.drawn, self.middles.face[self.piece]
        met = drawn.inside(1 - self.middles.k, face, self.at) | drawn.is_kept(face, self.at)
        return np.where(met, 0.0, self.length)

    @cached_property
    def narrow(self) -> Bools:
        """(b,) where the opening to the next member is narrower than the member, and there is one."""
        drawn = self.middles.drawn
        corner = drawn.surface.F[self.middles.face[self.piece]]
        d = np.einsum("bc,bc->b", drawn.d[corner, self.middles.k], self.at)
        return np.asarray((d > SLIT + ON) & (d < 0.5 - ON))

    @property
    def slits(self) -> int:
        """Bays beside which the opening is narrower than the member along more than half of the free length."""
        free = np.bincount(self.bay, self.free, self.count)
        slit = np.bincount(self.bay, self.free * self.narrow, self.count)
        return int((slit > free / 2).sum())

    @property
    def slit_share(self) -> float:
        """Share of the free length along which the opening is narrower than the member."""
        total = float(self.free.sum())
        return float(self.free @ self.narrow) / total if total > 0 else 0.0


def bays(middles: Middles) -> Bays:
    """The bays of a family. Along a piece the phase of the other family is linear: it crosses at whole numbers."""
    drawn, face = middles.drawn, middles.face
    other = 1 - middles.k
    corner = drawn.surface.F[face]
    z = np.einsum("sec,sc->se", middles.at, drawn.z[corner, other])
    whole = np.rint(z)
    there = drawn.known[face, other] & (drawn.d[corner, other].max(axis=1) > 0)
    on = (np.abs(z - whole) < ON) & there[:, None]
    z = np.where(on, whole, z)
    low, high = z.min(axis=1), z.max(axis=1)
    first = np.floor(low).astype(np.int64) + 1
    inner = np.where(there, np.maximum(np.ceil(high).astype(np.int64) - first, 0), 0)
    piece = np.repeat(np.arange(len(face)), inner + 1)
    start = np.cumsum(inner + 1) - inner - 1
    number = np.arange(len(piece)) - start[piece]  # of the part, upwards in z
    z0 = np.where(number == 0, low[piece], first[piece] + number - 1)
    z1 = np.where(number == inner[piece], high[piece], first[piece] + number)
    span = (high - low)[piece]
    share = np.divide(z1 - z0, span, out=np.ones_like(span), where=inner[piece] > 0)
    middle = np.divide((z0 + z1) / 2 - low[piece], span, out=np.full_like(span, 0.5), where=inner[piece] > 0)
    end = (z.argmin(axis=1) if len(z) else np.empty(0, dtype=np.int64))[piece]
    a, b = middles.at[piece, end], middles.at[piece, 1 - end]
    at = a + middle[:, None] * (b - a)
    barrier = middles.at_nodes(on)
    count, bay = _joined(middles, piece, end, number, inner, barrier)
    crossed = np.concatenate([np.repeat(np.arange(len(face)), inner), np.nonzero(on)[0]])
    where = np.concatenate([at[number > 0], middles.at[on]])
    return Bays(middles, piece, at, share * middles.length[piece], bay, count, _angles(middles, face[crossed], where))


def _joined(middles: Middles, piece: Ints, end: Ints, number: Ints, inner: Ints, barrier: Bools) -> tuple[int, Ints]:
    """Parts that hang together at nodes which are no `barrier` (j,): how many bays that makes, and the bay of each."""
    parts, links = len(piece), []
    for last, side in ((number == 0, end), (number == inner[piece], 1 - end)):
        node = middles.node[piece, side]
        link = np.flatnonzero(last & ~barrier[node])
        links.append(np.stack([link, parts + node[link]]))
    i, j = np.concatenate(links, axis=1)
    label = connected(parts + len(middles.edge), i, j)[1][:parts]
    found, bay = np.unique(label, return_inverse=True)
    return len(found), bay.ravel()


def _angles(middles: Middles, face: Ints, at: Floats) -> Floats:
    """(c,) degrees, 0 to 90, between both families at points of faces (c,) that are not kept besides the stripes."""
    drawn = middles.drawn
    face = face[~drawn.is_kept(face, at)]
    one, two = (g[face] for g in drawn.gradients)
    cosine = np.abs(np.einsum("cx,cx->c", one, two)) / (drawn.slope[0][face] * drawn.slope[1][face])
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1))))
