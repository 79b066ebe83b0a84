"""Corrections of trimmed faces that leave the skins, or that lie too far from their edges at sample points."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import lstsq

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members.fillet_edges import curves_beyond
from dsfab.export.cad.step.by_members.model import NetModel
from dsfab.export.cad.step.by_members.patches import FaceLimits, differences, height_rows, places, raised, rows_at
from dsfab.export.cad.step.by_members.trimmed import (
    SPLIT,
    TrimmedFace,
    inside_of,
    loop_samples,
    surrounded,
    trimmed_face,
)
from dsfab.export.splines import bernstein

PLACES = np.stack(np.meshgrid(*[np.arange(0.5, 12) / 12] * 2, indexing="ij"), axis=2).reshape(-1, 2)
"""(k, 2) sample parameters of a surface."""

ROWS = rows_at(PLACES)


def without_strays(
    model: NetModel,
    faces: Mapping[int, TrimmedFace],
    points: Mapping[int, Floats],
    away: Callable[[Floats], Floats],
    limits: FaceLimits,
) -> dict[int, TrimmedFace]:
    """Refit faces that are too far off the skins between their points, with more points.

    points : (k, 6) of each fit.    away : returns the vectors from points to both skins. Faces with a limit from the
    mesh stay unchanged, because the division judges them.
    """
    rounds = 2  # a face that was corrected in one place may stray in another
    found, todo, known = dict(faces), [] if limits.beyond_mesh else list(faces), dict(points)
    for _ in range(rounds):
        if not todo:
            break
        new = _skins_beside(model, [found[i] for i in todo], away, limits.off)
        more = {i: some for i, some in zip(todo, new, strict=True) if len(some)}
        todo = []
        for i, some in more.items():
            known[i] = np.concatenate([known[i], some])
            try:
                found[i] = trimmed_face(model, found[i].loops, known[i], limits, True)
            except ExportError:  # with the new points the face bends too much
                continue
            todo.append(i)
    return found


def _skins_beside(
    model: NetModel, faces: Sequence[TrimmedFace], away: Callable[[Floats], Floats], near: float
) -> list[Floats]:
    """For each face (k, 6) points of the skins beside its samples if one sample is farther off than `tolerance`; else
    none."""
    at = [_places(model, face) for face in faces]
    ways = away(np.concatenate(at))
    found = list[Floats]()
    for P, way in zip(at, np.split(ways, np.cumsum([len(P) for P in at])[:-1]), strict=True):
        off = np.linalg.norm(way.reshape(-1, 2, 3), axis=2).max(initial=0.0)
        found.append(P + way if off > near else np.zeros((0, 6)))
    return found


def _places(model: NetModel, face: TrimmedFace) -> Floats:
    """(k, 6) sample points of a face inside its outline."""
    skins = [ROWS(len(poles) - 1) @ poles.reshape(-1, 3) for poles in (face.outer, face.inner)]
    P = np.concatenate(skins, axis=1)
    return np.asarray(P[surrounded(P, [loop_samples(model, loop) for loop in face.loops])])


SAMPLES = 23
"""Number of points along an edge, ends included, at which OCCT measures the gap."""

BETWEEN = 8
"""Steps between two of them, where this module measures the gap."""

FAST, SMOOTH, SMALL = 1e4, 1e-2, 1e-4
"""Weights of peaks and exact edges, of second differences of the movement of poles, and of that movement, against 1 of
points along edges."""

SAMPLING_ROUNDS, MORE = 6, 2
"""Number of rounds of moving peaks, and of degrees that a surface may gain."""

STEP = 1e-3
"""Millimetres between two points for the slope of a surface."""

DENSE = np.linspace(0, 1, (SAMPLES - 1) * BETWEEN + 1)
"""Parameters where gaps are measured; OCCT looks at every `BETWEEN`th."""

SLOPE = BETWEEN * np.array([[1.0, -8.0, 0.0, 8.0, -1.0]]) / 12
"""Coefficients of five consecutive gaps for the slope in the middle."""

HOLD = (1 - np.cos(np.pi * np.arange(6) / 5)) / 2
"""Parameters where exact edges are held."""


def with_sampled_peaks(model: NetModel, faces: list[TrimmedFace]) -> list[TrimmedFace]:
    """Move the widest gap of each seam that ends at an outline to a sample of OCCT, so that the measured tolerance is
    right.

    A face stays if that opens a gap above `SPLIT`, or moves its inside by more.
    """
    walls = {e for wall in model.walls for e, _ in wall.steps}
    ends = {v for e in walls for v in (model.edges[e].start, model.edges[e].end)}
    held = {e: edge.poles for e, edge in enumerate(model.edges)} | curves_beyond(model)
    return [_with_peaks(face, model, walls, ends, held) for face in faces]


def _with_peaks(
    face: TrimmedFace, model: NetModel, walls: set[int], ends: set[int], held: Mapping[int, Floats]
) -> TrimmedFace:
    """Return a face with as many peaks as possible at samples. exact_poles : poles of edges that stay exact."""
    fine = 5e-4  # gap under which all digits of the poles count, because rounding moves its peak
    mine = sorted({e for loop in face.loops for e, _ in loop})
    seams = [e for e in mine if e not in walls and {model.edges[e].start, model.edges[e].end} & ends]
    if not seams:
        return face
    dense = np.stack([bernstein(DENSE) @ model.edges[e].poles for e in seams])
    firm = np.stack([bernstein(HOLD) @ held[e] for e in mine])
    edges = np.concatenate([loop_samples(model, loop) for loop in face.loops])
    skins = (face.outer, face.axes[0], np.s_[..., :3]), (face.inner, face.axes[1], np.s_[..., 3:])
    surfaces = [_Surface(poles, axes, dense[s], firm[s], edges[s]) for poles, axes, s in skins]
    outer, inner = (surface.moved(face.exact) for surface in surfaces)
    exact = face.exact or any(x.closest(P) < fine for x, P in zip(surfaces, (outer, inner), strict=True))
    if outer is face.outer and inner is face.inner:
        return replace(face, exact=exact)
    new = replace(face, outer=outer, inner=inner, exact=exact)
    return replace(new, gap=float(np.abs(new.gaps(edges)).max()))


@dataclass(frozen=True, eq=False)
class _Surface:
    """One surface of a face: poles (p + 1, p + 1, 3), axes (3, 3), and points in mm.

    seams : (e, k, 3) along seams.    held : (h, 6, 3) along edges that may be exact.    edges : (j, 3) along all edges.
    """

    poles: Floats
    axes: Floats
    seams: Floats
    held: Floats
    edges: Floats
    over: dict[int, Floats] = field(default_factory=dict)
    """By degree: (3, e, k, poles) basis at points of seams, and a step along both axes beside them."""
    around: dict[int, Floats] = field(default_factory=dict)
    """By degree: (j, poles) basis along all edges."""

    def moved(self, exact: bool) -> Floats:
        """Return the poles with the fewest peaks off the samples, in the lowest degree. exact : keep exact edges
        exact."""
        held = 1e-6  # largest gap of an exact edge of a flush face, which stays exact
        local, count = self.poles @ self.axes.T, len(self.poles)
        best, least = self.poles, int(self._wrong(self._gaps(local)).sum())
        for degree in range(count - 1, count + MORE):
            if not least:
                break
            new = np.stack([raised(local[..., i], degree) for i in range(3)], axis=2)
            for z, wrong in self._rounds(new, held if exact else 0.0):
                if wrong < least and self._allowed(new, z):
                    best, least = np.concatenate([new[..., :2], z[..., None]], axis=2) @ self.axes, wrong
        return best

    def closest(self, poles: Floats) -> float:
        return float(np.abs(self._gaps(poles @ self.axes.T)).max(axis=1).min())

    def _rounds(self, local: Floats, near: float) -> list[tuple[Floats, int]]:
        """Heights of the poles after each round with the number of misplaced peaks. Edges with gaps below `exact_gap`
        keep them."""
        degree, z, found = len(local) - 1, local[..., 2].ravel().copy(), list[tuple[Floats, int]]()
        gaps, cosines = self._across(local)
        rows, pinned = self._over(degree)[0] * cosines[..., None], dict[int, tuple[int, float]]()
        exact = self._rows(self.held, degree)
        off = np.abs(self.held @ self.axes[2] - exact @ z)
        firm = exact[off.max(axis=1) < near].reshape(-1, len(z))
        around = self._around(degree)
        calm = np.concatenate([around, SMOOTH * differences(degree + 1), SMALL * np.eye(len(z))])
        for _ in range(SAMPLING_ROUNDS):
            pinned |= {int(e): _peak(gaps[e], e in pinned) for e in np.flatnonzero(self._wrong(gaps))}
            pins, right = _pins(rows, gaps, pinned)
            A = np.concatenate([FAST * pins, FAST * firm, calm])
            b = np.concatenate([FAST * right, np.zeros(len(firm) + len(calm))])
            more = lstsq(A, b, check_finite=False)[0]
            z, gaps = z + more, gaps - rows @ more
            found.append((z.reshape(degree + 1, -1), int(self._wrong(gaps).sum())))
            if not found[-1][1]:
                break
        return found

    def _allowed(self, local: Floats, z: Floats) -> bool:
        degree, inside = len(local) - 1, inside_of(self.edges)
        at = self._around(degree)
        before, after = (np.abs(self.edges @ self.axes[2] - at @ x.ravel()).max() for x in (local[..., 2], z))
        moved = height_rows(places(self.poles, self.axes, inside), degree) @ (z - local[..., 2]).ravel()
        return bool(after <= max(SPLIT, before) and np.abs(moved).max() <= SPLIT)

    def _rows(self, points: Floats, degree: int) -> Floats:
        """(e, k, poles) basis at points (e, k, 3)."""
        rows = height_rows(places(self.poles, self.axes, points.reshape(-1, 3)), degree)
        return rows.reshape(*points.shape[:2], rows.shape[1])

    def _around(self, degree: int) -> Floats:
        if degree not in self.around:
            self.around[degree] = height_rows(places(self.poles, self.axes, self.edges), degree)
        return self.around[degree]

    def _over(self, degree: int) -> Floats:
        if degree not in self.over:
            ways = np.array([np.zeros(3), STEP * self.axes[0], STEP * self.axes[1]])
            points = self.seams + ways[:, None, None]
            self.over[degree] = self._rows(points.reshape(-1, *points.shape[2:]), degree).reshape(*points.shape[:3], -1)
        return self.over[degree]

    def _gaps(self, local: Floats) -> Floats:
        """(e, k) gaps of seams above the surface, normal to it."""
        return self._across(local)[0]

    def _across(self, local: Floats) -> tuple[Floats, Floats]:
        """(e, k) gaps, and cosines between the direction of heights and the surface's normals."""
        here, right, left = self._over(len(local) - 1) @ local[..., 2].ravel()
        cosines = 1 / np.sqrt(1 + ((right - here) / STEP) ** 2 + ((left - here) / STEP) ** 2)
        return (self.seams @ self.axes[2] - here) * cosines, cosines

    def _wrong(self, gaps: Floats) -> Bools:
        """(e,) whether the widest gap lies between two of OCCT's samples."""
        exact = 1e-7  # millimetres of a gap that OCCT ignores
        short = 3e-6  # share by which the widest sampled gap may be less than the widest gap; OCCT allows 1e-5
        wide = np.abs(gaps).max(axis=1)
        found = np.abs(gaps[:, ::BETWEEN]).max(axis=1)
        wrong = (found < (1 - short) * _summits(np.abs(gaps))) & (wide > exact) & (wide <= SPLIT)
        return np.asarray(wrong)


def _summits(gaps: Floats) -> Floats:
    """(e,) largest of gaps (e, k), refined by a parabola through it and its neighbours."""
    at = gaps.argmax(axis=1)
    before, here, after = (gaps[np.arange(len(gaps)), np.clip(at + i, 0, gaps.shape[1] - 1)] for i in (-1, 0, 1))
    bend = 2 * here - before - after
    inside = (at > 0) & (at < gaps.shape[1] - 1) & (bend > 0)
    return np.asarray(here + np.where(inside, (after - before) ** 2 / np.where(inside, 8 * bend, 1), 0))


def _peak(gaps: Floats, again: bool) -> tuple[int, float]:
    """Sample nearest to the peak of gaps (k,), and the gap wanted there; 0 (any) in the first round."""
    higher = 1.003  # the moved peak exceeds the old one, because another peak may be as high
    at = int(np.abs(gaps).argmax())
    return BETWEEN * round(at / BETWEEN), higher * float(gaps[at]) if again else 0.0


def _pins(rows: Floats, gaps: Floats, pinned: dict[int, tuple[int, float]]) -> tuple[Floats, Floats]:
    """Rows (j, poles) and right sides (j,) that fix gaps at samples and, except at ends, make them flat there."""
    left, right = [np.zeros((0, rows.shape[2]))], [np.zeros(0)]
    for e, (k, value) in pinned.items():
        if 0 < k < gaps.shape[1] - 1:
            left.append(SLOPE @ rows[e, k - 2 : k + 3])
            right.append(SLOPE @ gaps[e, k - 2 : k + 3])
        if value:
            left.append(rows[e, k : k + 1])
            right.append(gaps[e, k : k + 1] - value)
    return np.concatenate(left), np.concatenate(right)
