"""`CornerPhase`: phases that every face sees in its own sign and period, so that they are linear on each.

Around a singular point of the direction field no choice of signs and periods fits all faces at once. Each face has its
own, chosen from face to face such that neighbours differ along a few seams only.

    z = sign * value + shift     value (n,) at the vertices, sign 1 or -1 and shift (whole periods) at each corner
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from dsfab.arrays import Bools, Floats, Ints, lock
from dsfab.pattern.phase import Flow
from dsfab.surface.corner_field import CornerField
from dsfab.surface.hats import hat_gradients
from dsfab.surface.mesh import Surface


@dataclass(frozen=True, eq=False)
class CornerPhase:
    """A phase of stripes on a surface: the middles of stripes are where it is a whole number.

    value    : (n,) at the vertices, periods.
    sign     : (m, 3) 1 or -1, and shift : (m, 3) whole numbers: how a face sees the value at each of its corners.
    singular : (m,) faces in which a stripe ends or the direction turns over: there the phase means nothing.
    broken   : how many of them a stripe ends in.
    """

    value: Floats
    sign: Floats
    shift: Floats
    singular: Bools
    broken: int = 0

    def __post_init__(self) -> None:
        lock(self, "value", np.float64, (None,))
        lock(self, "sign", np.float64, (None, 3))
        lock(self, "shift", np.float64, (len(self.sign), 3))
        lock(self, "singular", np.bool_, (len(self.sign),))

    @property
    def field(self) -> CornerField:
        """The phase as a field whose levels are whole numbers."""
        return CornerField(self.value[:, None], self.sign, self.shift, self.singular)

    def corners(self, surface: Surface) -> Floats:
        """(m, 3) the phase at the corners of the faces."""
        return np.asarray(self.sign * self.value[surface.F] + self.shift)

    def gradients(self, surface: Surface) -> Floats:
        """(m, 3) of the phase on the faces, periods per metre."""
        return np.asarray(np.einsum("mcx,mc->mx", hat_gradients(surface), self.corners(surface)))

    def times(self, factor: int) -> "CornerPhase":
        """The same with so many stripes between each two; factor is a whole number."""
        return replace(self, value=factor * self.value, shift=factor * self.shift)

    @cached_property
    def single_valued(self) -> bool:
        """Whether one number at each vertex serves all faces."""
        return not self.singular.any() and bool((self.sign == 1).all() and (self.shift == 0).all())


def corner_phase(flow: Flow, phase: Floats, other: Callable[[], Floats] | None = None) -> CornerPhase:
    """The phases (n,), in periods, of `Flow.solve` as the faces see them.

    other : makes phases (n,) that are taken where they break off on fewer faces; asked where there is any.
    """
    found = _seen(flow, phase)
    if other and found.broken:
        found = min(found, _seen(flow, other()), key=lambda one: one.broken)
    return _aligned(flow.frames.surface, found)


def _seen(flow: Flow, phase: Floats) -> CornerPhase:
    """Phases (n,) as each face sees them by itself.

    From corner to corner a phase grows by what is nearest to `flow.turn`; where it does not come back to where it
    began, or to its own sign, the face is singular.
    """
    surface, sign = flow.frames.surface, flow.sign
    i, j = flow.frames.ends.T
    miss = sign * phase[j] - phase[i] - flow.turn
    step = flow.turn + miss - np.rint(miss)
    of, F = surface.edges.of, surface.F
    forward = i[of] == F  # half-edges that run along their edge
    seen = np.where(forward, step[of], -sign[of] * step[of])  # by the corner that each starts from
    turned = sign[of]
    s1 = turned[:, 0]
    s2 = s1 * turned[:, 1]
    z0 = phase[F[:, 0]]
    z1 = z0 + seen[:, 0]
    z2 = z1 + s1 * seen[:, 1]
    back = z2 + s2 * seen[:, 2]
    branch = s2 * turned[:, 2] < 0
    singular = (np.rint(back - z0) != 0) | branch
    signs = np.stack([np.ones(surface.m), s1, s2], axis=1)
    z = np.stack([z0, z1, z2], axis=1)
    return CornerPhase(phase, signs, np.rint(z - signs * phase[F]), singular, int((singular & ~branch).sum()))


def _aligned(surface: Surface, given: CornerPhase) -> CornerPhase:
    """The same phase with signs and periods of the faces carried from neighbour to neighbour, from one face on.

    Seen by the corner where its half-edge starts, the phase of face g is s times that of face f plus q.
    """
    h0, h1 = surface.edges.pairs.T
    f, g = h0 // 3, h1 // 3
    sign, shift = given.sign.ravel(), given.shift.ravel()
    same = surface.F.ravel()[h0] != surface.F.ravel()[h1]
    other = np.where(same, h1 - h1 % 3 + (h1 + 1) % 3, h1)  # the corner of g at the vertex that h0 starts from
    s = sign[h0] * sign[other]  # z_f = s z_g + q
    q = shift[h0] - s * shift[other]
    whole = ~(given.singular[f] | given.singular[g])
    f, g, s, q = f[whole], g[whole], s[whole], q[whole]
    link = csr_array((np.arange(1, len(f) + 1), (f, g)), shape=(surface.m, surface.m))
    link = csr_array(link + csr_array((-np.arange(1, len(f) + 1), (g, f)), shape=link.shape))
    signs, shifts = np.ones(surface.m), np.zeros(surface.m)
    todo = ~given.singular
    while todo.any():
        root = int(np.argmax(todo))
        order, before = breadth_first_order(link, root, directed=False)
        todo[order] = False
        _carry(link, order.astype(np.int64), before.astype(np.int64), s, q, signs, shifts)
    shift_all = signs[:, None] * given.shift + shifts[:, None]
    aligned = replace(given, sign=signs[:, None] * given.sign, shift=shift_all)
    return _from_majority(surface, aligned)


def _carry(link: csr_array, order: Ints, before: Ints, s: Floats, q: Floats, signs: Floats, shifts: Floats) -> None:
    """Signs and shifts (m,) of the faces in the order of a search, each from that of the face before it.

    Each face knows its step from an earlier one, and in every round the earlier one's step is put before it: paths to
    the root are halved.
    """
    child = order[1:]
    if not len(child):
        return
    parent = before[child]
    at = np.asarray(link[parent, child]).ravel()
    index, forward = np.abs(at) - 1, at > 0  # forward: parent is f, child is g: z_parent = s z_child + q
    own, add = s[index], np.where(forward, q[index], -s[index] * q[index])
    place = np.empty(len(before), dtype=np.int64)
    place[order] = np.arange(len(order))
    earlier = np.concatenate([[0], place[parent]])
    sign, shift = np.concatenate([[1.0], own]), np.concatenate([[0.0], add])  # z_earlier = sign z + shift
    while earlier.any():
        shift = sign[earlier] * shift + shift[earlier]
        sign = sign[earlier] * sign
        earlier = earlier[earlier]
    signs[order], shifts[order] = sign, shift


def _from_majority(surface: Surface, given: CornerPhase) -> CornerPhase:
    """The same phase with the value at each vertex as its first face sees it: 1 and 0 but along seams."""
    first = np.full(len(given.value), -1)
    corner = surface.F.ravel()
    usable = np.flatnonzero(np.repeat(~given.singular, 3))
    first[corner[usable[::-1]]] = usable[::-1]
    found = first >= 0
    at = np.maximum(first, 0)
    own_sign = np.where(found, given.sign.ravel()[at], 1.0)
    own_shift = np.where(found, given.shift.ravel()[at], 0.0)
    value = own_sign * given.value + own_shift
    sign = given.sign * own_sign[surface.F]
    shift = given.shift - sign * own_shift[surface.F]
    return replace(given, value=value, sign=sign, shift=shift)
