"""Phases of evenly spaced stripes: complex numbers at vertices, and corner phases that are linear on each face."""

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
"""Shift of the inverse iteration times the squared spacing: it makes the matrix definite and keeps its eigenvectors."""
FLOW = 0.25  # A round of diffusion lasts the time 1 / tau with tau = `FLOW` (2 pi / spacing)^2.
LOCKED_PHASE = 0.05
"""A locked phase within this number of periods of its target becomes the target, so that edges get straight members."""
LOCK = 3.0  # Weight of a locked phase, as a multiple of (2 pi / spacing)^2.


@dataclass(frozen=True, eq=False)
class Flow:
    """Gradient that the phase of a family follows.
    g : (n, 3) unit direction of the gradient at the vertices, up to sign. density : (n,) periods per metre."""

    frames: Frames
    g: Floats
    density: Floats

    @cached_property
    def sign(self) -> Floats:
        """Sign (e,): 1 if g points to the same side at both ends of an edge, else -1."""
        i, j = self.frames.ends.T
        return self.frames.sides(self.g, i, j)

    @cached_property
    def turn(self) -> Floats:
        """Growth (e,) of the phase along each edge, periods, from the first end and with the sign of g at that end."""
        i, j = self.frames.ends.T
        step = self.frames.surface.V[j] - self.frames.surface.V[i]
        mean = self.density[i, None] * self.g[i] + (self.sign * self.density[j])[:, None] * self.g[j]
        return dots(mean, step) / 2

    @cached_property
    def coupling(self) -> Complexes:
        """Coupling of the phases (e,) at both ends of the edges; see `Frames.coupling`."""
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
        """Return phases (n,) at the vertices, in periods, -1/2 to 1/2, each with the sign of g at its vertex.

        The phases are angles of complex numbers psi. These minimise the sum of w |psi_j - e^{2 pi i turn} psi_i|^2 over
        the edges of weight w, with psi_i conjugated if g is reversed. The first minimum is over all psi with a common
        norm. The second minimum is over psi of size 1 everywhere, by diffusion and normalisation in turns [Merriman,
        Bence, Osher 1992; on phases Viertel, Osting 2019].

        start : (n,) start of the iteration; without locked vertices, a line runs through its peak.
        lock  : (n,) vertices on the centre line of a stripe.
        aim   : (n,) target phases at locked vertices, in periods, -1/2 to 1/2; 0 by default.
        free  : true to begin without locked vertices, because phases that start from two of these may not fit together.
        rounds : number of rounds of diffusion and normalisation, in which pairs of dislocations meet and vanish."""
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
    """Return the result (n,) of 20 inverse iterations with B from start (n,), approximated to 1e-5 by 12 solves.
    More iterations are useless, because the lowest eigenvectors are almost equally good. B conjugates some numbers, and
    is linear only for their real and imaginary parts."""
    x = krylov_power(
        lambda x: _real_pairs(B(_complex_numbers(x))), _real_pairs(start.astype(complex)), np.repeat(mass, 2), 20, 12
    )
    return _complex_numbers(x)


def _real_pairs(x: Complexes) -> Floats:
    return np.ascontiguousarray(x).view(np.float64)


def _complex_numbers(x: Floats) -> Complexes:
    return np.ascontiguousarray(x).view(np.complex128)


@one_blas_thread()  # on two busy cores, threads took three times as long for products of vectors
def krylov_power(B: Callable[[Floats], Floats], x: Floats, mass: Floats, power: int, products: int) -> Floats:
    """Return B^power x, with norm 1 for the mass (N,), from the Krylov space of `products` products with a linear B.
    Arnoldi's method [Saad 1992] writes B as a small matrix H on an orthonormal basis of B x, B B x, ..., and takes
    powers of H. With as many products as powers the result is exact."""
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
        if H[k + 1, k] <= 1e-12 * H[k, k]:  # the basis spans the whole space
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
    """Return phases (n,), in periods, shifted by half a period if this brings more weight (n,) onto centre lines.
    `Flow.solve` finds both phases equally good, because both have the same sum of squares. Shifts by 1/2 and by -1/2
    are equal, so signs of phases do not matter. Phases stay if the weighted mean of their cosine is above -0.02."""
    if weight @ np.cos(2 * np.pi * phase) >= -0.02 * weight.sum():
        return phase
    return np.asarray(np.where(phase > 0, phase - 0.5, phase + 0.5))


def _unit_numbers(x: Complexes) -> Complexes:
    return np.asarray(x / np.maximum(np.abs(x), np.finfo(float).tiny))


@dataclass(frozen=True, eq=False)
class CornerPhase:
    """A phase of stripes on a surface, with centre lines at its integers.
    value    : (n,) at the vertices, periods.
    sign     : (m, 3) 1 or -1, and shift : (m, 3) integers: the phase of a face at its corner is sign * value + shift.
    singular : (m,) faces in which a stripe ends or the direction reverses, so that the phase is meaningless.
    broken   : number of faces in which a stripe ends."""

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
        """The phase as a field with integer levels."""
        return CornerField(self.value[:, None], self.sign, self.shift, self.singular)

    def corners(self, surface: Surface) -> Floats:
        """Return the phase (m, 3) at the corners of the faces."""
        return np.asarray(self.sign * self.value[surface.F] + self.shift)

    def gradients(self, surface: Surface) -> Floats:
        """Return the gradient (m, 3) of the phase on the faces, periods per metre."""
        return np.asarray(np.einsum("mcx,mc->mx", hat_gradients(surface), self.corners(surface)))

    def times(self, factor: int) -> "CornerPhase":
        """Return the phase with `factor` stripes in place of each stripe; factor is an integer."""
        return replace(self, value=factor * self.value, shift=factor * self.shift)


def corner_phase(flow: Flow, phase: Floats, alternative: Callable[[], Floats] | None = None) -> CornerPhase:
    """Return the phases (n,), in periods, of `Flow.solve` as a phase at the corners of the faces.
    alternative : function that returns other phases (n,), called only if stripes end within faces. Its phases replace
                  `phase` if stripes then end in fewer faces."""
    result = _face_phases(flow, phase)
    if alternative and result.broken:
        result = min(result, _face_phases(flow, alternative()), key=lambda one: one.broken)
    return _aligned_phase(flow.frames.surface, result)


def _face_phases(flow: Flow, phase: Floats) -> CornerPhase:
    """Return phases (n,) at the corners of each face, without regard to its neighbours. From corner to corner a phase
    grows by the value nearest to `flow.turn`. A face is singular unless the phase returns to its start and its sign."""
    surface, sign = flow.frames.surface, flow.sign
    i, j = flow.frames.ends.T
    miss = sign * phase[j] - phase[i] - flow.turn
    step = flow.turn + miss - np.rint(miss)
    edge, F = surface.edges.of, surface.F
    forward = i[edge] == F  # half-edges in the direction of their edge
    growth = np.where(forward, step[edge], -sign[edge] * step[edge])  # in the sign of g at its start
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
    """Return the phase with equal signs and periods in adjacent faces, carried from face to face from a first face.
    In adjacent faces f and g, z_f = s z_g + q holds at the corner where their half-edge h0 starts."""
    h0, h1 = surface.edges.pairs.T
    f, g = h0 // 3, h1 // 3
    sign, shift = phase.sign.ravel(), phase.shift.ravel()
    starts_at_h0 = surface.F.ravel()[h0] != surface.F.ravel()[h1]
    corner_g = np.where(starts_at_h0, h1 - h1 % 3 + (h1 + 1) % 3, h1)  # the corner of g at which h0 starts
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
    """Set signs and shifts (m,) of the faces in the `order` of a search from a first face, by pointer doubling.
    Each face has its sign and shift relative to an earlier face. Each round halves the paths to the first face."""
    child = order[1:]
    if not len(child):
        return
    parent = predecessor[child]
    entry = np.asarray(link[parent, child]).ravel()
    index, forward = np.abs(entry) - 1, entry > 0  # forward: parent is f, child is g: z_parent = s z_child + q
    step_sign, step_shift = s[index], np.where(forward, q[index], -s[index] * q[index])
    place = np.empty(len(predecessor), dtype=np.int64)
    place[order] = np.arange(len(order))
    earlier = np.concatenate([[0], place[parent]])
    sign, shift = np.concatenate([[1.0], step_sign]), np.concatenate([[0.0], step_shift])  # z_earlier = sign z + shift
    while earlier.any():
        shift = sign[earlier] * shift + shift[earlier]
        sign = sign[earlier] * sign
        earlier = earlier[earlier]
    signs[order], shifts[order] = sign, shift


def _seen_by_first_faces(surface: Surface, phase: CornerPhase) -> CornerPhase:
    """Return the phase with the value of a vertex from its first face: signs are 1 and shifts 0 except along seams."""
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
