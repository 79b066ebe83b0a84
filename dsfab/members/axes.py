"""Middle lines of stripes, and smooth axes of members."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, lock, lock_floats, positions_on_segments, read_only_copy, unit_vectors
from dsfab.slicing import Overlay
from dsfab.surface import Surface, chains

TURN = np.radians(60)
"""Largest bend (radians) of a member within the surface over `WINDOW` widths. Lines with larger bends are divided."""
WINDOW, STEPS = 1.5, 4  # Bends are measured over 1.5 times the width of the line, in 4 steps.
SPECK = 1.0  # Shortest middle line that is kept, in stripe widths; the stripe's longest line is always kept.


@dataclass(frozen=True, eq=False)
class MiddleLine:
    """A polyline on a surface. points : (k, 3) points, metres; a closed line repeats its first point.
    normals : (k, 3) unit normals.    cells : (k - 1,) number of the triangle that contains each segment."""

    points: Floats
    normals: Floats
    cells: Ints

    def __post_init__(self) -> None:
        lock_floats(self, points=(None, 3), normals=(len(self.points), 3))
        lock(self, "cells", np.int64, (len(self.points) - 1,))

    @cached_property
    def s(self) -> Floats:
        """Arc length (k,) at each point, metres."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])

    @property
    def length(self) -> float:
        return float(self.s[-1])

    @cached_property
    def closed(self) -> bool:
        return len(self.points) > 3 and bool((self.points[0] == self.points[-1]).all())

    def place(self, point: Floats) -> float:
        """Return the arc length (m) at the point of the line that is nearest to `point` (3,)."""
        a, b = self.points[:-1], self.points[1:]
        t = positions_on_segments(point, a, b)
        nearest = int(np.linalg.norm(a + t[:, None] * (b - a) - point, axis=1).argmin())
        return float(self.s[nearest] + t[nearest] * (self.s[nearest + 1] - self.s[nearest]))

    def opened_at(self, index: int) -> "MiddleLine":
        """Return a closed line that starts and ends at the point with number `index`."""
        around = np.concatenate([np.arange(index, len(self.points)), np.arange(1, index + 1)])
        return MiddleLine(self.points[around], self.normals[around], np.roll(self.cells, -index))

    def section(self, first: int, last: int) -> "MiddleLine":
        """Return the part of the line between its points with the numbers `first` and `last`."""
        return MiddleLine(self.points[first : last + 1], self.normals[first : last + 1], self.cells[first:last])


def middle_lines(overlay: Overlay, k: int, offset: Floats, normals: Floats) -> dict[int, list[MiddleLine]]:
    """Return the middle lines of each stripe of field k, by the stripe's number. The longest line comes first.
    offset  : (m, 3) field at corners of triangles, minus its value on the stripe's middle line; never 0.
    normals : (n, 3) unit normals at the vertices of the sheet."""
    surface, part = overlay.sheet.surface, overlay.part[:, k]
    sign = np.sign(offset)
    crossed = sign * np.roll(sign, -1, axis=1) < 0
    live = np.flatnonzero((part >= 0) & (crossed.sum(axis=1) == 2))
    if not len(live):
        return {}
    side = np.nonzero(crossed[live])[1].reshape(-1, 2)
    edge = surface.edges.of[live[:, None], side]
    key, node = np.unique(part[live, None] * len(surface.edges.ends) + edge, return_inverse=True)
    node = node.reshape(-1, 2)
    t = np.zeros(len(key))
    t[node] = _shares(surface, live, side, offset[live])
    p, q = surface.edges.ends[key % len(surface.edges.ends)].T
    points, along = (x[p] + t[:, None] * (x[q] - x[p]) for x in (surface.V, normals))
    along = unit_vectors(along)
    by_stripe: dict[int, list[MiddleLine]] = {}
    for order, chord in chains(node[:, 0], node[:, 1], len(key)):
        moved = (np.diff(points[order], axis=0) != 0).any(axis=1)
        if moved.any():
            order = order[np.concatenate([[True], moved])]
            line = MiddleLine(points[order], along[order], live[chord][moved])
            by_stripe.setdefault(int(part[line.cells[0]]), []).append(line)
    return {stripe: sorted(lines, key=lambda one: -one.length) for stripe, lines in by_stripe.items()}


def _shares(surface: Surface, cells: Ints, side: Ints, offset: Floats) -> Floats:
    """Return where `offset` is 0 on triangle sides (c, 2): 0 at the lower vertex number, 1 at the higher."""
    row = np.arange(len(cells))[:, None]
    a, b = np.abs(offset[row, side]), np.abs(offset[row, (side + 1) % 3])
    ascending = surface.F[cells[:, None], side] < surface.F[cells[:, None], (side + 1) % 3]
    share = np.where(ascending, a, b) / (a + b)
    return np.where(share < 1e-6, 0.0, np.where(share > 1 - 1e-6, 1.0, share))


def without_specks(lines: list[MiddleLine], width: float) -> list[MiddleLine]:
    """Return the first line, and the further lines longer than a fraction of the stripe's `width`."""
    return [line for k, line in enumerate(lines) if k == 0 or line.length > SPECK * width]


def straight_parts(line: MiddleLine, width: float, edge: float) -> list[MiddleLine]:
    """Divide a line at bends of more than `TURN`, and return its parts. edge : length of a mesh edge, metres."""
    window = max(WINDOW * width, edge)
    count = max(2 * STEPS, int(np.ceil(line.length * STEPS / window)))
    x = np.linspace(0, line.length, count + 1)
    turn = _turns(line, x)
    cuts = []
    while turn.max() > TURN:
        first, last = _bend(turn)
        cuts.append(_corner(line, x[max(first - STEPS // 2, 0)], x[min(last + STEPS // 2, count)]))
        away = np.abs(x - (x[first] + x[last]) / 2)
        turn[np.minimum(away, line.length - away) < window if line.closed else away < window] = 0.0
    cuts = sorted(set(cuts))
    if not cuts:
        return [line]
    closed = line.closed
    if closed:
        line, cuts = line.opened_at(cuts[0]), [cut - cuts[0] for cut in cuts[1:]]
    ends = [0, *cuts, len(line.points) - 1]
    parts = [line.section(a, b) for a, b in pairwise(ends) if b > a]
    return parts if closed else _without_hooks(parts, width)


def _without_hooks(parts: list[MiddleLine], width: float) -> list[MiddleLine]:
    longest = max(range(len(parts)), key=lambda k: parts[k].length)
    first, last = 0, len(parts)
    while first < longest and parts[first].length < SPECK * width:
        first += 1
    while last - 1 > longest and parts[last - 1].length < SPECK * width:
        last -= 1
    return parts[first:last]


def _turns(line: MiddleLine, x: Floats) -> Floats:
    """Return the angles (k,), radians, by which a line bends within the surface around arc lengths x (k,)."""
    columns = ([np.interp(x, line.s, column) for column in y.T] for y in (line.points, line.normals))
    points, normals = (np.stack(column, axis=1) for column in columns)
    turn = _turning(np.diff(points, axis=0), normals, line.closed)
    around = np.concatenate([turn[-STEPS:], turn, turn[:STEPS]]) if line.closed else np.pad(turn, STEPS)
    summed = np.convolve(around, np.ones(STEPS + 1), mode="same")[STEPS:-STEPS]
    angles = np.zeros(len(x))
    angles[np.arange(len(turn)) + (0 if line.closed else 1)] = np.abs(summed)
    return angles


def _turning(step: Floats, normals: Floats, closed: bool) -> Floats:
    a, b = (np.roll(step, 1, axis=0), step) if closed else (step[:-1], step[1:])
    N = normals[:-1] if closed else normals[1:-1]
    a, b = (y - np.einsum("ki,ki->k", y, N)[:, None] * N for y in (a, b))
    return np.asarray(np.arctan2(np.einsum("ki,ki->k", np.cross(a, b), N), np.einsum("ki,ki->k", a, b)))


def _corner(line: MiddleLine, begin: float, end: float) -> int:
    inner = np.flatnonzero((line.s[1:-1] >= begin) & (line.s[1:-1] <= end)) + 1
    if len(inner) < 2:
        return int(np.clip(np.searchsorted(line.s, (begin + end) / 2), 1, len(line.points) - 2))
    stretch = slice(inner[0] - 1, inner[-1] + 2)
    turned = np.cumsum(_turning(np.diff(line.points[stretch], axis=0), line.normals[stretch], closed=False))
    return int(inner[np.argmax(np.abs(turned) >= np.abs(turned[-1]) / 2)])


def _bend(turn: Floats) -> tuple[int, int]:
    begin = end = int(turn.argmax())
    while begin > 0 and turn[begin - 1] > TURN:
        begin -= 1
    while end < len(turn) - 1 and turn[end + 1] > TURN:
        end += 1
    return begin, end


KNOTS, COARSE = 4.0, 2.0  # First knot distance of an axis: the larger of KNOTS widths and COARSE mesh edges.


@dataclass(frozen=True, eq=False)
class MemberAxis:
    """Axis of a member: k stations along a curve on a surface; lengths in metres, curvatures per metre.
    s  : (k,) arc length from 0.    P : (k, 3) points.    T : (k, 3) unit tangents.    N : (k, 3) unit normals.
    kg : (k,) geodesic curvature, positive to the left: T' . B with B = N x T.
    kn : (k,) normal curvature, positive towards N: T' . N.    tg : (k,) geodesic torsion: -N' . B.
    closed  : True if the last station equals the first.    strayed : largest distance of the axis from its middle line.
    traced  : (k,) length of the middle line up to each station."""

    s: Floats
    P: Floats
    T: Floats
    N: Floats
    kg: Floats
    kn: Floats
    tg: Floats
    closed: bool
    traced: Floats
    strayed: float

    def __post_init__(self) -> None:
        k = len(self.s)
        lock_floats(self, s=(k,), kg=(k,), kn=(k,), tg=(k,), traced=(k,), P=(k, 3), T=(k, 3), N=(k, 3))

    @property
    def length(self) -> float:
        return float(self.s[-1])

    @cached_property
    def B(self) -> Floats:  # noqa: N802 - its name in the field
        """Unit vectors (k, 3) N x T, which point to the left in the surface."""
        return read_only_copy(np.cross(self.N, self.T), np.float64, (None, 3))

    def frames_at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points, unit tangents and unit normals (q, 3) at arc lengths s (q,)."""
        P, T, N = (np.stack([np.interp(s, self.s, x) for x in y.T], axis=-1) for y in (self.P, self.T, self.N))
        return P, unit_vectors(T), unit_vectors(N)

    def station(self, traced: float) -> float:
        """Return the arc length (m) on the axis for an arc length `traced` (m) on the middle line."""
        return float(np.interp(traced, self.traced, self.s))


def fitted_axis(line: MiddleLine, width: float, edge: float) -> MemberAxis:
    """Fit a smooth axis to a middle line. width : of the member, m.    edge : mean length of a mesh edge, m."""
    step = max(KNOTS * width, COARSE * edge)
    # the tolerance shrinks with edge^2, like the error of the mesh
    axis, tolerance = _axis_with_knots(line, step), 0.05 * edge * edge / max(edge, width)
    while axis.strayed > tolerance and step >= 2 * edge:
        step /= 2
        axis = _axis_with_knots(line, step)
    return axis


def _axis_with_knots(line: MiddleLine, step: float) -> MemberAxis:
    L = line.length
    spans = max(4 if line.closed else 1, round(L / step))
    count = max(16, 8 * spans)
    sampled = np.linspace(0, L, 4 * count + 1)
    samples = np.concatenate([line.points, line.normals], axis=1)
    samples = np.stack([np.interp(sampled, line.s, column) for column in samples.T], axis=1)
    spline = _spline(sampled, samples, L / spans, spans, line.closed)
    x = np.linspace(0, L, count + 1)
    (P, n), (d1, dn), (d2, _) = (np.split(spline(x, order), 2, axis=1) for order in range(3))
    speed = np.linalg.norm(d1, axis=1)
    T = d1 / speed[:, None]
    N = unit_vectors(n - np.einsum("ki,ki->k", n, T)[:, None] * T)
    B = np.cross(N, T)
    bent = d2 / speed[:, None] ** 2
    kg, kn = np.einsum("ki,ki->k", bent, B), np.einsum("ki,ki->k", bent, N)
    tg = -np.einsum("ki,ki->k", dn, B) / (np.linalg.norm(n, axis=1) * speed)
    s = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(x))])
    strayed = float(np.linalg.norm((spline(sampled) - samples)[:, :3], axis=1).max())
    return MemberAxis(s, P, T, N, kg, kn, tg, line.closed, x, strayed)


def _spline(x: Floats, y: Floats, step: float, spans: int, closed: bool) -> BSpline:
    degree, penalty = 3, 1e-3  # degree of the spline; weight of the third differences of the spline's coefficients
    t = step * np.arange(-degree, spans + degree + 1)
    design = csr_array(BSpline.design_matrix(np.clip(x, 0, step * spans), t, degree))
    count = design.shape[1]
    free = spans if closed else count  # a closed spline repeats three coefficients
    fold = csr_array((np.ones(count), (np.arange(count), np.arange(count) % free)), shape=(count, free))
    design = csr_array(design @ fold)
    bend = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(count - 3, count)) @ fold
    weight = penalty * len(x) / count
    c = splu(csc_array(design.T @ design + weight * (bend.T @ bend))).solve(np.asarray(design.T @ y))
    return BSpline(t, np.asarray(fold @ c), degree)


def sides(surface: Surface, cells: Ints, axis: MemberAxis) -> Floats:
    """Return the distances (k, 2), m, from the axis to the outline of the mesh faces `cells`, to the left and right."""
    a, b = _outline(surface, cells)
    middle, direction = (a + b) / 2, b - a
    station = np.asarray(cKDTree(axis.P).query(middle)[1])
    cosine = np.abs(np.einsum("ei,ei->e", direction, axis.T[station])) / np.linalg.norm(direction, axis=1)
    is_left = np.einsum("ei,ei->e", middle - axis.P[station], axis.B[station]) >= 0
    widths = np.zeros((len(axis.s), 2))
    for column, side in enumerate((is_left, ~is_left)):
        rows = np.flatnonzero(side & (cosine > 0.5))  # edges at a large angle to the axis are ends of the member
        if len(rows):
            offset = np.concatenate([a[rows], b[rows]]) - np.tile(axis.P[station[rows]], (2, 1))
            T, B = (np.tile(x[station[rows]], (2, 1)) for x in (axis.T, axis.B))
            s = np.tile(axis.s[station[rows]], 2) + np.einsum("ei,ei->e", offset, T)
            y = np.abs(np.einsum("ei,ei->e", offset, B))
            order = np.argsort(s, kind="stable")
            widths[:, column] = np.interp(axis.s, s[order], y[order], period=axis.length if axis.closed else None)
    return widths


def _outline(surface: Surface, cells: Ints) -> tuple[Floats, Floats]:
    edge, count = np.unique(surface.edges.of[cells], return_counts=True)
    ends = surface.edges.ends[edge[count == 1]]
    return surface.V[ends[:, 0]], surface.V[ends[:, 1]]
