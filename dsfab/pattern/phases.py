"""Phases of evenly spaced stripes, at vertices and on each face."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from dsfab.core.arrays import Bools, Complexes, Floats, Ints, lock, lock_floats
from dsfab.core.sparse import one_blas_thread
from dsfab.pattern.frames import Frames, Solve, dots
from dsfab.pattern.symmetry import Projection
from dsfab.surface.fields import CornerField, hat_gradients
from dsfab.surface.mesh import Surface

SHIFT = 1e-3
"""Shift of the inverse iteration, times the squared stripe spacing. The shift makes the matrix positive definite."""
FLOW = 0.25  # 1 / duration of a step of diffusion, in units of (2 pi / spacing)^2.
LOCKED_PHASE = 0.05
"""Locked vertices with an error below this (periods) get exactly their target phase. Boundary members stay straight."""
LOCK = 3.0  # Weight of the target phases in `Flow.solve`, per area of the surface and divided by (2 pi / spacing)^2.


@dataclass(frozen=True, eq=False)
class Flow:
    """Wanted gradient of the phase of a family of stripes.
    g : (n, 3) unit direction of the gradient, across the stripes, up to sign.    density : (n,) stripes per metre."""

    frames: Frames
    g: Floats
    density: Floats

    @cached_property
    def sign(self) -> Floats:
        """For each edge (e,): 1 if the angle between the directions g at its ends is below 90 degrees, else -1."""
        i, j = self.frames.ends.T
        return self.frames.sides(self.g, i, j)

    @cached_property
    def turn(self) -> Floats:
        """Growth (e,) of the phase from the first to the second end of each edge, periods; positive along g."""
        i, j = self.frames.ends.T
        step = self.frames.surface.V[j] - self.frames.surface.V[i]
        mean = self.density[i, None] * self.g[i] + (self.sign * self.density[j])[:, None] * self.g[j]
        return dots(mean, step) / 2

    @cached_property
    def coupling(self) -> Complexes:
        """Complex weight (e,) of each edge: the cotangent weight times exp(-2 pi i `turn`)."""
        return self.frames.coupling(-2 * np.pi * self.turn)

    def solve(
        self,
        start: Floats,
        lock: Bools,
        projection: Projection | None = None,
        aim: Floats | None = None,
        free: bool = False,
        rounds: int = 10,
    ) -> Floats:
        """Return the phases (n,) of stripes at the vertices, in periods, -1/2 to 1/2. Phases grow along `g`.
        The method is diffusion with normalisation [Merriman, Bence, Osher 1992; for phases Viertel, Osting 2019].
        start : (n,) first phases.    lock : (n,) vertices with a target phase.    rounds : number of diffusion steps.
        projection : projection onto symmetric fields; default: none.
        aim   : (n,) target phases, in periods, -1/2 to 1/2; default 0: the centre line of a stripe.
        free  : True to begin the iteration without target phases."""
        surface, n = self.frames.surface, self.frames.surface.n
        mass = np.maximum(surface.vertex_areas, 1e-12 * surface.area)
        inverse_square = float(surface.vertex_areas @ self.density / surface.area) ** 2
        wave = 4 * np.pi**2 * inverse_square
        project = projection or (lambda x: x)
        lock_weight = LOCK * wave * mass * lock
        aim = np.zeros(n) if aim is None else aim
        target = lock_weight * np.exp(2j * np.pi * aim)
        from_lock = bool(lock.any()) and not free
        solve = self._factor(SHIFT * inverse_square * mass + (lock_weight if from_lock else 0.0))
        x = project(solve(target)) if from_lock else _lowest(lambda x: project(solve(mass * x)), start, mass)
        tau = FLOW * wave
        solve = self._factor(tau * mass + lock_weight)
        for _ in range(rounds):
            x = project(solve(tau * mass * _unit_numbers(x) + target))
        phase = np.angle(x) / (2 * np.pi)
        deviation = phase - aim
        return np.where(lock & (np.abs(deviation - np.rint(deviation)) < LOCKED_PHASE), aim, phase)

    def _factor(self, diagonal: Floats) -> Solve:
        return self.frames.twisted_factors.factor(self.coupling, diagonal, self.sign < 0)


def _lowest(B: Callable[[Complexes], Complexes], start: Floats, mass: Floats) -> Complexes:
    x = krylov_power(
        lambda x: _real_pairs(B(_complex_numbers(x))), _real_pairs(start.astype(complex)), np.repeat(mass, 2), 20, 12
    )
    return _complex_numbers(x)


def _real_pairs(x: Complexes) -> Floats:
    return np.ascontiguousarray(x).view(np.float64)


def _complex_numbers(x: Floats) -> Complexes:
    return np.ascontiguousarray(x).view(np.complex128)


@one_blas_thread()  # two threads took three times as long for products of vectors
def krylov_power(B: Callable[[Floats], Floats], x: Floats, mass: Floats, power: int, products: int) -> Floats:
    """Return B(B(...B(x))) with `power` calls of a linear function B on x (N,), scaled to sum(mass x^2) = 1.
    products : largest number of real calls of B; Arnoldi's method replaces further calls [Saad 1992]."""
    basis = [_unit_vector(B(x), mass)]
    H = np.zeros((products, products - 1))
    for k in range(products - 1):
        rest = B(basis[k])
        for _ in range(2):  # the second pass removes rounding errors
            for j, q in enumerate(basis):
                share = q @ (mass * rest)
                H[j, k] += share
                rest = rest - share * q
        H[k + 1, k] = np.sqrt(rest @ (mass * rest))
        if H[k + 1, k] <= 1e-12 * H[k, k]:  # the basis is complete
            H = H[: k + 1, : k + 1]
            break
        basis.append(rest / H[k + 1, k])
    y = np.eye(1, max(H.shape[1], 1))[0]
    for _ in range(power - 2 if H.size else 0):
        y = H[: len(y)] @ y
        y /= np.linalg.norm(y)
    y = H @ y if power > 1 and H.size else y
    return _unit_vector(y @ np.array(basis), mass)


def _unit_vector(x: Floats, mass: Floats) -> Floats:
    return np.asarray(x / np.sqrt(x @ (mass * x)))


def through_peaks(phase: Floats, weight: Floats) -> Floats:
    """Return the phases (n,), all shifted by half a period if this moves centre lines to larger `weight` (n,)."""
    if weight @ np.cos(2 * np.pi * phase) >= -0.02 * weight.sum():
        return phase
    return np.asarray(np.where(phase > 0, phase - 0.5, phase + 0.5))


def _unit_numbers(x: Complexes) -> Complexes:
    return np.asarray(x / np.maximum(np.abs(x), np.finfo(float).tiny))


@dataclass(frozen=True, eq=False)
class CornerPhase:
    """Phase of stripes on a surface, a whole number on each centre line.
    value    : (n,) phase at the vertices, periods.
    sign     : (m, 3) 1 or -1.    shift : (m, 3) whole numbers. The phase at a face's corner is sign * value + shift.
    singular : (m,) faces without a phase.    broken : number of faces in which a stripe ends."""

    value: Floats
    sign: Floats
    shift: Floats
    singular: Bools
    broken: int = 0

    def __post_init__(self) -> None:
        lock_floats(self, value=(None,), sign=(None, 3), shift=(len(self.sign), 3))
        lock(self, "singular", np.bool_, (len(self.sign),))

    @property
    def field(self) -> CornerField:
        """The phase as a `CornerField`."""
        return CornerField(self.value[:, None], self.sign, self.shift, self.singular)

    def corners(self, surface: Surface) -> Floats:
        """Return the phase (m, 3) at the corners of the faces."""
        return np.asarray(self.sign * self.value[surface.F] + self.shift)

    def gradients(self, surface: Surface) -> Floats:
        """Return the gradient (m, 3) of the phase on the faces, periods per metre."""
        return np.asarray(np.einsum("mcx,mc->mx", hat_gradients(surface), self.corners(surface)))

    def times(self, factor: int) -> "CornerPhase":
        """Return the phase multiplied by a whole number `factor`: `factor` stripes replace each stripe."""
        return replace(self, value=factor * self.value, shift=factor * self.shift)


def corner_phase(flow: Flow, phase: Floats, alternative: Callable[[], Floats] | None = None) -> CornerPhase:
    """Return the phases (n,) of `Flow.solve` as a `CornerPhase`.
    alternative : function that returns other phases (n,), called if stripes end within faces."""
    result = _face_phases(flow, phase)
    if alternative and result.broken:
        result = min(result, _face_phases(flow, alternative()), key=lambda one: one.broken)
    return _aligned_phase(flow.frames.surface, result)


def _face_phases(flow: Flow, phase: Floats) -> CornerPhase:
    surface, sign = flow.frames.surface, flow.sign
    i, j = flow.frames.ends.T
    miss = sign * phase[j] - phase[i] - flow.turn
    step = flow.turn + miss - np.rint(miss)
    edge, F = surface.edges.of, surface.F
    forward = i[edge] == F  # half-edges that run in their edge's direction
    growth = np.where(forward, step[edge], -sign[edge] * step[edge])  # phase growth, with the sign of g at the start
    edge_sign = sign[edge]
    s1 = edge_sign[:, 0]
    s2 = s1 * edge_sign[:, 1]
    z0 = phase[F[:, 0]]
    z1 = z0 + growth[:, 0]
    z2 = z1 + s1 * growth[:, 1]
    back = z2 + s2 * growth[:, 2]
    branch = s2 * edge_sign[:, 2] < 0
    singular = (np.rint(back - z0) != 0) | branch
    signs = np.stack([np.ones(surface.m), s1, s2], axis=1)
    z = np.stack([z0, z1, z2], axis=1)
    return CornerPhase(phase, signs, np.rint(z - signs * phase[F]), singular, int((singular & ~branch).sum()))


def _aligned_phase(surface: Surface, phase: CornerPhase) -> CornerPhase:
    h0, h1 = surface.edges.pairs.T
    f, g = h0 // 3, h1 // 3
    sign, shift = phase.sign.ravel(), phase.shift.ravel()
    starts_at_h0 = surface.F.ravel()[h0] != surface.F.ravel()[h1]
    corner_g = np.where(starts_at_h0, h1 - h1 % 3 + (h1 + 1) % 3, h1)  # corner of face g where half-edge h0 starts
    s = sign[h0] * sign[corner_g]  # z_f = s z_g + q
    q = shift[h0] - s * shift[corner_g]
    is_regular = ~(phase.singular[f] | phase.singular[g])
    f, g, s, q = f[is_regular], g[is_regular], s[is_regular], q[is_regular]
    link = csr_array((np.arange(1, len(f) + 1), (f, g)), shape=(surface.m, surface.m))
    link = csr_array(link + csr_array((-np.arange(1, len(f) + 1), (g, f)), shape=link.shape))
    signs, shifts = np.ones(surface.m), np.zeros(surface.m)
    unvisited = ~phase.singular
    while unvisited.any():
        order, predecessor = breadth_first_order(link, int(np.argmax(unvisited)), directed=False)
        unvisited[order] = False
        propagate_phases(link, order.astype(np.int64), predecessor.astype(np.int64), s, q, signs, shifts)
    shift_all = signs[:, None] * phase.shift + shifts[:, None]
    aligned = replace(phase, sign=signs[:, None] * phase.sign, shift=shift_all)
    return _seen_by_first_faces(surface, aligned)


def propagate_phases(
    link: csr_array, order: Ints, predecessor: Ints, s: Floats, q: Floats, signs: Floats, shifts: Floats
) -> None:
    """Set `signs` and `shifts` (m,) of the faces in `order`, so that the phase has no jump from face to face.
    predecessor : (m,) the neighbour from which a face is reached.    s, q : phase = s x (neighbour's phase) + q.
    link : (m, m) 1 + index into s, q for a face and its neighbour; negative in the reverse direction."""
    child = order[1:]
    if not len(child):
        return
    parent = predecessor[child]
    entry = np.asarray(link[parent, child]).ravel()
    index, forward = np.abs(entry) - 1, entry > 0  # forward: phase in parent face = s (phase in child face) + q
    step_sign, step_shift = s[index], np.where(forward, q[index], -s[index] * q[index])
    place = np.empty(len(predecessor), dtype=np.int64)
    place[order] = np.arange(len(order))
    earlier = np.concatenate([[0], place[parent]])
    sign, shift = np.concatenate([[1.0], step_sign]), np.concatenate([[0.0], step_shift])
    while earlier.any():
        shift = sign[earlier] * shift + shift[earlier]
        sign = sign[earlier] * sign
        earlier = earlier[earlier]
    signs[order], shifts[order] = sign, shift


def _seen_by_first_faces(surface: Surface, phase: CornerPhase) -> CornerPhase:
    """Return the same phase; the first non-singular face at each vertex gets sign 1 and shift 0 at this vertex."""
    first_corner = np.full(len(phase.value), -1)
    corner = surface.F.ravel()
    usable = np.flatnonzero(np.repeat(~phase.singular, 3))
    first_corner[corner[usable[::-1]]] = usable[::-1]
    has_face = first_corner >= 0
    corner_index = np.maximum(first_corner, 0)
    own_sign = np.where(has_face, phase.sign.ravel()[corner_index], 1.0)
    own_shift = np.where(has_face, phase.shift.ravel()[corner_index], 0.0)
    value = own_sign * phase.value + own_shift
    sign = phase.sign * own_sign[surface.F]
    shift = phase.shift - sign * own_shift[surface.F]
    return replace(phase, value=value, sign=sign, shift=shift)
