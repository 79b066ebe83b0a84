"""Middle lines of stripes, smooth member axes with frame and curvatures, and the widths to both sides of them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, along_segments, lock, locked, unit_vectors
from dsfab.slicing import Overlay
from dsfab.surface import Surface, chains

TURN = np.radians(60)
"""A line that turns by more than this in the surface, within `WINDOW` widths, makes two members."""
WINDOW, STEPS = 1.5, 4
"""Widths over which a turn is measured, and points along them."""
SPECK = 1.0
"""Lines that are shorter than so many widths are left out beside a longer one of the same stripe."""


@dataclass(frozen=True, eq=False)
class MiddleLine:
    """A polyline on a surface.

    points : (k, 3) metres; the last is the first again where it is closed.    normals : (k, 3) unit normals there.
    cells  : (k - 1,) the cell in which each of its segments lies.
    """

    points: Floats
    normals: Floats
    cells: Ints

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 3))
        lock(self, "normals", np.float64, (len(self.points), 3))
        lock(self, "cells", np.int64, (len(self.points) - 1,))

    @cached_property
    def s(self) -> Floats:
        """(k,) metres along it."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.s[-1])

    @cached_property
    def closed(self) -> bool:
        """Whether it ends where it begins."""
        return len(self.points) > 3 and bool((self.points[0] == self.points[-1]).all())

    def place(self, point: Floats) -> float:
        """Metres along it to where it is nearest to a point (3,)."""
        a, b = self.points[:-1], self.points[1:]
        t = along_segments(point, a, b)
        near = int(np.linalg.norm(a + t[:, None] * (b - a) - point, axis=1).argmin())
        return float(self.s[near] + t[near] * (self.s[near + 1] - self.s[near]))

    def opened(self, at: int) -> "MiddleLine":
        """The same closed line, beginning and ending at another of its points."""
        around = np.concatenate([np.arange(at, len(self.points)), np.arange(1, at + 1)])
        return MiddleLine(self.points[around], self.normals[around], np.roll(self.cells, -at))

    def between(self, first: int, last: int) -> "MiddleLine":
        """From one of its points to another one."""
        return MiddleLine(self.points[first : last + 1], self.normals[first : last + 1], self.cells[first:last])

    def turned(self) -> "MiddleLine":
        """The other way round."""
        return MiddleLine(self.points[::-1], self.normals[::-1], self.cells[::-1])


def middle_lines(overlay: Overlay, k: int, offset: Floats, normals: Floats) -> dict[int, list[MiddleLine]]:
    """The lines of field k where an offset (m, 3) at the corners of cells is 0, by stripe, the longest first.

    normals : (n, 3) unit normals at the vertices of the overlay.
    An offset is nowhere 0 and its signs at an edge are those that the cell beyond sees, or all are turned over.
    """
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
    found: dict[int, list[MiddleLine]] = {}
    for order, chord in chains(node[:, 0], node[:, 1], len(key)):
        moved = (np.diff(points[order], axis=0) != 0).any(axis=1)
        if moved.any():
            order = order[np.concatenate([[True], moved])]
            line = MiddleLine(points[order], along[order], live[chord][moved])
            found.setdefault(int(part[line.cells[0]]), []).append(line)
    return {stripe: sorted(lines, key=lambda one: -one.length) for stripe, lines in found.items()}


def _shares(surface: Surface, cells: Ints, side: Ints, offset: Floats) -> Floats:
    """(c, 2) where offsets (c, 3) are 0 on sides (c, 2) of cells (c,): 0 at the vertex with the lower number, 1 at the
    other."""
    row = np.arange(len(cells))[:, None]
    a, b = np.abs(offset[row, side]), np.abs(offset[row, (side + 1) % 3])
    first = surface.F[cells[:, None], side] < surface.F[cells[:, None], (side + 1) % 3]
    share = np.where(first, a, b) / (a + b)
    return np.where(share < 1e-6, 0.0, np.where(share > 1 - 1e-6, 1.0, share))


def without_specks(lines: list[MiddleLine], width: float) -> list[MiddleLine]:
    """Lines, the longest first, without the short ones beside it."""
    return [line for k, line in enumerate(lines) if k == 0 or line.length > SPECK * width]


def straight_parts(line: MiddleLine, width: float, edge: float) -> list[MiddleLine]:
    """The parts of a line between the places where it turns back in the surface.

    At an end a part shorter than the width is none: around a kept support's end the middle runs square to the rim.
    width : of the member, and edge : of the mesh, metres: turns are measured over 1.5 times the one, or the other.
    """
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
        line, cuts = line.opened(cuts[0]), [cut - cuts[0] for cut in cuts[1:]]
    ends = [0, *cuts, len(line.points) - 1]
    parts = [line.between(a, b) for a, b in pairwise(ends) if b > a]
    return parts if closed else _without_hooks(parts, width)


def _without_hooks(parts: list[MiddleLine], width: float) -> list[MiddleLine]:
    """Parts of a line without those at its ends that are shorter than it is wide; the longest one stays."""
    longest = max(range(len(parts)), key=lambda k: parts[k].length)
    first, last = 0, len(parts)
    while first < longest and parts[first].length < SPECK * width:
        first += 1
    while last - 1 > longest and parts[last - 1].length < SPECK * width:
        last -= 1
    return parts[first:last]


def _turns(line: MiddleLine, x: Floats) -> Floats:
    """(k,) by how much a line turns in the surface, radians, within half a window of places x (k,) along it."""
    points, normals = (
        np.stack([np.interp(x, line.s, column) for column in y.T], axis=1) for y in (line.points, line.normals)
    )
    turn = _turning(np.diff(points, axis=0), normals, line.closed)
    around = np.concatenate([turn[-STEPS:], turn, turn[:STEPS]]) if line.closed else np.pad(turn, STEPS)
    summed = np.convolve(around, np.ones(STEPS + 1), mode="same")[STEPS:-STEPS]
    found = np.zeros(len(x))
    found[np.arange(len(turn)) + (0 if line.closed else 1)] = np.abs(summed)
    return found


def _turning(step: Floats, normals: Floats, closed: bool) -> Floats:
    """Angles, radians, between the steps (k - 1, 3) of a line in the planes across the normals (k, 3) at its points:
    (k - 2,) at the inner ones, or of a closed line (k - 1,) at the first and those."""
    before, after = (np.roll(step, 1, axis=0), step) if closed else (step[:-1], step[1:])
    N = normals[:-1] if closed else normals[1:-1]
    before, after = (y - np.einsum("ki,ki->k", y, N)[:, None] * N for y in (before, after))
    return np.asarray(
        np.arctan2(np.einsum("ki,ki->k", np.cross(before, after), N), np.einsum("ki,ki->k", before, after))
    )


def _corner(line: MiddleLine, begin: float, end: float) -> int:
    """The inner point of a line, between two places along it, before and after which it turns equally much."""
    inner = np.flatnonzero((line.s[1:-1] >= begin) & (line.s[1:-1] <= end)) + 1
    if len(inner) < 2:
        return int(np.clip(np.searchsorted(line.s, (begin + end) / 2), 1, len(line.points) - 2))
    some = slice(inner[0] - 1, inner[-1] + 2)
    turned = np.cumsum(_turning(np.diff(line.points[some], axis=0), line.normals[some], closed=False))
    return int(inner[np.argmax(np.abs(turned) >= np.abs(turned[-1]) / 2)])


def _bend(turn: Floats) -> tuple[int, int]:
    """The first and last of the points about the sharpest one (k,) at which a line turns too much."""
    first = last = int(turn.argmax())
    while first > 0 and turn[first - 1] > TURN:
        first -= 1
    while last < len(turn) - 1 and turn[last + 1] > TURN:
        last += 1
    return first, last


KNOTS, COARSE = 4.0, 2.0
"""Knots are so many widths of the member apart, or so many edges of the mesh if these are longer."""
PER_KNOT = 8
"""Stations from knot to knot."""
SAMPLES = 4
"""Points of the line that are fitted, for each station."""
LEAST = 16
"""Stations of a short axis."""
PENALTY = 1e-3
"""Weight of third differences of the coefficients, over that of the points."""
CLOSE = 0.05
"""Where the spline is farther from the line on the mesh than this share of an edge, it gets twice as many knots, and
again, until they are an edge apart. On meshes that are finer than the member is wide the share is less by that ratio: a
mesh is off its smooth surface by the square of its edges."""
DEGREE = 3


@dataclass(frozen=True, eq=False)
class MemberAxis:
    """Stations along a curve on a surface; all lengths in metres, all curvatures per metre.

    s : (k,) arc length from 0.    P : (k, 3) points.    T : (k, 3) unit tangents.    N : (k, 3) unit normals.
    kg : (k,) bends in the surface, to the left if positive: T' . B with B = N x T.
    kn : (k,) bends with the surface, towards N if positive: T' . N.    tg : (k,) twists with it: -N' . B.
    closed  : whether the last station is the first one again.
    traced  : (k,) length of the line on the mesh up to there.    strayed : the farthest that the two are apart.
    """

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
        for name in ("s", "kg", "kn", "tg", "traced"):
            lock(self, name, np.float64, (len(self.s),))
        for name in ("P", "T", "N"):
            lock(self, name, np.float64, (len(self.s), 3))

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.s[-1])

    @cached_property
    def B(self) -> Floats:  # noqa: N802 - its name in the field
        """(k, 3) unit vectors to the left in the surface, N x T."""
        return locked(np.cross(self.N, self.T), np.float64, (None, 3))

    def at(self, s: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, tangents and normals (q, 3) each at arc lengths (q,), between the stations."""
        P, T, N = (np.stack([np.interp(s, self.s, x) for x in y.T], axis=-1) for y in (self.P, self.T, self.N))
        return P, unit_vectors(T), unit_vectors(N)

    def station(self, traced: float) -> float:
        """Arc length where the line on the mesh is so long."""
        return float(np.interp(traced, self.traced, self.s))


def fitted_axis(line: MiddleLine, width: float, edge: float) -> MemberAxis:
    """The axis along a line (k, 3) of a member with a width, metres, on a mesh with an edge, metres."""
    step = max(KNOTS * width, COARSE * edge)
    axis, close = _fitted(line, step), CLOSE * edge * edge / max(edge, width)
    while axis.strayed > close and step >= 2 * edge:
        step /= 2
        axis = _fitted(line, step)
    return axis


def _fitted(line: MiddleLine, step: float) -> MemberAxis:
    L = line.length
    spans = max(4 if line.closed else 1, round(L / step))
    count = max(LEAST, PER_KNOT * spans)
    sampled = np.linspace(0, L, SAMPLES * count + 1)
    given = np.concatenate([line.points, line.normals], axis=1)
    given = np.stack([np.interp(sampled, line.s, column) for column in given.T], axis=1)
    both = _spline(sampled, given, L / spans, spans, line.closed)
    x = np.linspace(0, L, count + 1)
    (P, n), (d1, dn), (d2, _) = (np.split(both(x, order), 2, axis=1) for order in range(3))
    speed = np.linalg.norm(d1, axis=1)
    T = d1 / speed[:, None]
    N = unit_vectors(n - np.einsum("ki,ki->k", n, T)[:, None] * T)
    B = np.cross(N, T)
    bent = d2 / speed[:, None] ** 2
    kg, kn = np.einsum("ki,ki->k", bent, B), np.einsum("ki,ki->k", bent, N)
    tg = -np.einsum("ki,ki->k", dn, B) / (np.linalg.norm(n, axis=1) * speed)
    s = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(x))])
    strayed = float(np.linalg.norm((both(sampled) - given)[:, :3], axis=1).max())
    return MemberAxis(s, P, T, N, kg, kn, tg, line.closed, x, strayed)


def _spline(x: Floats, y: Floats, step: float, spans: int, closed: bool) -> BSpline:
    """The penalised spline through values y (q, d) at x (q,), 0 to spans x step, with knots a step apart."""
    t = step * np.arange(-DEGREE, spans + DEGREE + 1)
    design = csr_array(BSpline.design_matrix(np.clip(x, 0, step * spans), t, DEGREE))
    count = design.shape[1]
    free = spans if closed else count  # of a closed one the last three coefficients are the first three again
    fold = csr_array((np.ones(count), (np.arange(count), np.arange(count) % free)), shape=(count, free))
    design = csr_array(design @ fold)
    bend = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(count - 3, count)) @ fold
    weight = PENALTY * len(x) / count
    c = splu(csc_array(design.T @ design + weight * (bend.T @ bend))).solve(np.asarray(design.T @ y))
    return BSpline(t, np.asarray(fold @ c), DEGREE)


ALONG = 0.5
"""Edges of the outline that run along the axis, by this cosine at least, are its sides; others end it."""


def sides(surface: Surface, cells: Ints, axis: MemberAxis) -> Floats:
    """(k, 2) metres from the stations of an axis to the outline of cells (c,), to the left and to the right of it."""
    a, b = _outline(surface, cells)
    middle, way = (a + b) / 2, b - a
    near = np.asarray(cKDTree(axis.P).query(middle)[1])
    cosine = np.abs(np.einsum("ei,ei->e", way, axis.T[near])) / np.linalg.norm(way, axis=1)
    left = np.einsum("ei,ei->e", middle - axis.P[near], axis.B[near]) >= 0
    found = np.zeros((len(axis.s), 2))
    for column, side in enumerate((left, ~left)):
        here = np.flatnonzero(side & (cosine > ALONG))
        if len(here):
            off = np.concatenate([a[here], b[here]]) - np.tile(axis.P[near[here]], (2, 1))
            T, B = (np.tile(x[near[here]], (2, 1)) for x in (axis.T, axis.B))
            s = np.tile(axis.s[near[here]], 2) + np.einsum("ei,ei->e", off, T)
            y = np.abs(np.einsum("ei,ei->e", off, B))
            order = np.argsort(s, kind="stable")
            found[:, column] = np.interp(axis.s, s[order], y[order], period=axis.length if axis.closed else None)
    return found


def _outline(surface: Surface, cells: Ints) -> tuple[Floats, Floats]:
    """(e, 3) both ends of the edges around cells (c,)."""
    edge, count = np.unique(surface.edges.of[cells], return_counts=True)
    ends = surface.edges.ends[edge[count == 1]]
    return surface.V[ends[:, 0]], surface.V[ends[:, 1]]
