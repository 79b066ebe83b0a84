"""Corrections of trimmed faces that are far from the skins of the sheet."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lstsq

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members.fillet_edges import curves_beyond
from dsfab.export.cad.step.by_members.model import NetModel
from dsfab.export.cad.step.by_members.patches import FaceLimits, differences, height_rows, places, raised_poles, rows_at
from dsfab.export.cad.step.by_members.trimmed import (
    HELD_PLACES,
    SPLIT,
    TrimmedFace,
    inside_of,
    inside_outlines,
    loop_samples,
    trimmed_face,
)
from dsfab.export.splines import bernstein

ROWS = rows_at(np.stack(np.meshgrid(*[np.arange(0.5, 12) / 12] * 2, indexing="ij"), axis=2).reshape(-1, 2))
"""Function of a surface's degree. It returns the Bezier basis at 12 x 12 places of the surface."""


def without_strays(
    model: NetModel,
    faces: Mapping[int, TrimmedFace],
    points: Mapping[int, Floats],
    away: Callable[[Floats], Floats],
    limits: FaceLimits,
) -> dict[int, TrimmedFace]:
    """Fit the faces that are too far from the skins of the sheet again, with more points.
    points : (k, 6) inner points of each face.    away : function of points (k, 6); returns vectors to both skins."""
    rounds = 2  # after a correction in one place, a face may be too far from the skins in another place
    result, todo, fit_points = dict(faces), [] if limits.beyond_mesh else list(faces), dict(points)
    for _ in range(rounds):
        if not todo:
            break
        skin_points = _skins_beside(model, [result[i] for i in todo], away, limits.off)
        added = {i: face_points for i, face_points in zip(todo, skin_points, strict=True) if len(face_points)}
        todo = []
        for i, face_points in added.items():
            fit_points[i] = np.concatenate([fit_points[i], face_points])
            try:
                result[i] = trimmed_face(model, result[i].loops, fit_points[i], limits, True)
            except ExportError:  # no surface fits the old points together with the added points
                continue
            todo.append(i)
    return result


def _skins_beside(
    model: NetModel, faces: Sequence[TrimmedFace], away: Callable[[Floats], Floats], tolerance: float
) -> list[Floats]:
    """Return, for each face farther than `tolerance` from the skins, the nearest skin points (k, 6); else (0, 6)."""
    samples = [_places(model, face) for face in faces]
    ways = away(np.concatenate(samples))
    result = list[Floats]()
    for P, vectors in zip(samples, np.split(ways, np.cumsum([len(P) for P in samples])[:-1]), strict=True):
        distance = np.linalg.norm(vectors.reshape(-1, 2, 3), axis=2).max(initial=0.0)
        result.append(P + vectors if distance > tolerance else np.zeros((0, 6)))
    return result


def _places(model: NetModel, face: TrimmedFace) -> Floats:
    P = np.concatenate([ROWS(len(poles) - 1) @ poles.reshape(-1, 3) for poles, _, _ in face.skins], axis=1)
    return np.asarray(P[inside_outlines(P, [loop_samples(model, loop) for loop in face.loops])])


SAMPLES = 23  # number of OCCT's points along an edge, ends included
BETWEEN = 8  # number of dsfab's steps between two neighbouring points of OCCT along an edge
SLOPE_STEP = 1e-3  # distance (mm) of two points that determine the slope of a surface


def with_sampled_peaks(model: NetModel, faces: list[TrimmedFace]) -> list[TrimmedFace]:
    """Change faces so that, if possible, the widest gap at each seam (edge between faces) is where OCCT measures."""
    walls = {e for wall in model.walls for e, _ in wall.steps}
    ends = {v for e in walls for v in (model.edges[e].start, model.edges[e].end)}
    exact_poles = {e: edge.poles for e, edge in enumerate(model.edges)} | curves_beyond(model)
    return [_with_peaks(face, model, walls, ends, exact_poles) for face in faces]


def _with_peaks(
    face: TrimmedFace, model: NetModel, walls: set[int], ends: set[int], exact_poles: Mapping[int, Floats]
) -> TrimmedFace:
    fine = 5e-4  # mm; if a face has a smaller gap at a seam, the poles of the face are written with all digits
    face_edges = sorted({e for loop in face.loops for e, _ in loop})
    seams = [e for e in face_edges if e not in walls and {model.edges[e].start, model.edges[e].end} & ends]
    if not seams:
        return face
    B = bernstein(np.linspace(0, 1, (SAMPLES - 1) * BETWEEN + 1))  # OCCT measures gaps at every `BETWEEN`th place
    dense = np.stack([B @ model.edges[e].poles for e in seams])
    firm = np.stack([bernstein(HELD_PLACES) @ exact_poles[e] for e in face_edges])
    edges = np.concatenate([loop_samples(model, loop) for loop in face.loops])
    surfaces = [_PeakSurface(P, axes, dense[..., s], firm[..., s], edges[:, s]) for P, axes, s in face.skins]
    outer, inner = (surface.with_peaks_at_samples(face.exact) for surface in surfaces)
    exact = face.exact or any(x.closest(P) < fine for x, P in zip(surfaces, (outer, inner), strict=True))
    if outer is face.outer and inner is face.inner:
        return replace(face, exact=exact)
    moved_face = replace(face, outer=outer, inner=inner, exact=exact)
    return replace(moved_face, gap=float(np.abs(moved_face.gaps(edges)).max()))


@dataclass(frozen=True, eq=False)
class _PeakSurface:
    """Surface of a trimmed face on one skin, with samples of the edges around it."""

    poles: Floats
    axes: Floats
    seams: Floats
    held: Floats
    edges: Floats

    def with_peaks_at_samples(self, exact: bool) -> Floats:
        more_degrees = 2  # the degree of a surface may rise by 2
        exact_gap = 1e-6  # an edge with at most this gap (mm) is exact and stays exact
        local, count = self.poles @ self.axes.T, len(self.poles)
        result, least = self.poles, int(self._misplaced(self._gaps_and_cosines(local)[0]).sum())
        for degree in range(count - 1, count + more_degrees):
            if not least:
                break
            raised = np.stack([raised_poles(local[..., i], degree) for i in range(3)], axis=2)
            for z, wrong in self._rounds(raised, exact_gap if exact else 0.0):
                if wrong < least and self._is_allowed(raised, z):
                    result, least = np.concatenate([raised[..., :2], z[..., None]], axis=2) @ self.axes, wrong
        return result

    def closest(self, poles: Floats) -> float:
        return float(np.abs(self._gaps_and_cosines(poles @ self.axes.T)[0]).max(axis=1).min())

    def _rounds(self, local: Floats, exact_gap: float) -> list[tuple[Floats, int]]:
        """Adjust the pole heights in rounds; return the heights after each round.
        Return also the number of seams with a widest gap between OCCT's sample points."""
        rounds = 6  # largest number of rounds of pole movements
        peak, smooth, still = 1e4, 1e-2, 1e-4  # weights of wanted gaps, of smooth and of small pole movements
        degree, z, result = len(local) - 1, local[..., 2].ravel().copy(), list[tuple[Floats, int]]()
        gaps, cosines = self._gaps_and_cosines(local)
        rows, pinned = self._seam_rows(degree)[0] * cosines[..., None], dict[int, tuple[int, float]]()
        exact = height_rows(self._places(self.held), degree).reshape(*self.held.shape[:2], -1)
        distances = np.abs(self.held @ self.axes[2] - exact @ z)
        firm = exact[distances.max(axis=1) < exact_gap].reshape(-1, len(z))
        calm = np.concatenate([self._edge_rows(degree), smooth * differences(degree + 1), still * np.eye(len(z))])
        for _ in range(rounds):
            pinned |= {int(e): _peak(gaps[e], e in pinned) for e in np.flatnonzero(self._misplaced(gaps))}
            pins, right = _pins(rows, gaps, pinned)
            A = np.concatenate([peak * pins, peak * firm, calm])
            b = np.concatenate([peak * right, np.zeros(len(firm) + len(calm))])
            moves = lstsq(A, b, check_finite=False)[0]
            z, gaps = z + moves, gaps - rows @ moves
            result.append((z.reshape(degree + 1, -1), int(self._misplaced(gaps).sum())))
            if not result[-1][1]:
                break
        return result

    def _is_allowed(self, local: Floats, z: Floats) -> bool:
        degree, inside = len(local) - 1, inside_of(self.edges)
        edge_rows = self._edge_rows(degree)
        before, after = (np.abs(self.edges @ self.axes[2] - edge_rows @ x.ravel()).max() for x in (local[..., 2], z))
        moved = height_rows(places(self.poles, self.axes, inside), degree) @ (z - local[..., 2]).ravel()
        return bool(after <= max(SPLIT, before) and np.abs(moved).max() <= SPLIT)

    def _places(self, points: Floats) -> Floats:
        return places(self.poles, self.axes, points.reshape(-1, 3))

    @cached_property
    def _edge_rows(self) -> Callable[[int], Floats]:
        return rows_at(self._places(self.edges))

    @cached_property
    def _step_rows(self) -> Callable[[int], Floats]:
        ways = np.array([np.zeros(3), SLOPE_STEP * self.axes[0], SLOPE_STEP * self.axes[1]])
        return rows_at(self._places(self.seams + ways[:, None, None]))

    def _seam_rows(self, degree: int) -> Floats:
        return self._step_rows(degree).reshape(3, *self.seams.shape[:2], -1)

    def _gaps_and_cosines(self, local: Floats) -> tuple[Floats, Floats]:
        heights, heights_u, heights_v = self._seam_rows(len(local) - 1) @ local[..., 2].ravel()
        cosines = 1 / np.sqrt(1 + ((heights_u - heights) / SLOPE_STEP) ** 2 + ((heights_v - heights) / SLOPE_STEP) ** 2)
        return (self.seams @ self.axes[2] - heights) * cosines, cosines

    def _misplaced(self, gaps: Floats) -> Bools:
        exact = 1e-7  # OCCT ignores a gap below this (mm)
        short = 3e-6  # largest fraction of the widest gap that OCCT's samples may miss; OCCT allows 1e-5
        wide = np.abs(gaps).max(axis=1)
        sampled = np.abs(gaps[:, ::BETWEEN]).max(axis=1)
        return np.asarray((sampled < (1 - short) * _summits(np.abs(gaps))) & (wide > exact) & (wide <= SPLIT))


def _summits(gaps: Floats) -> Floats:
    peak = gaps.argmax(axis=1)
    before, value, after = (gaps[np.arange(len(gaps)), np.clip(peak + i, 0, gaps.shape[1] - 1)] for i in (-1, 0, 1))
    bend = 2 * value - before - after
    inside = (peak > 0) & (peak < gaps.shape[1] - 1) & (bend > 0)
    return np.asarray(value + np.where(inside, (after - before) ** 2 / np.where(inside, 8 * bend, 1), 0))


def _peak(gaps: Floats, again: bool) -> tuple[int, float]:
    higher = 1.003  # factor from the widest gap of a round to the wanted gap of the next round
    peak = int(np.abs(gaps).argmax())
    return BETWEEN * round(peak / BETWEEN), higher * float(gaps[peak]) if again else 0.0


def _pins(rows: Floats, gaps: Floats, pinned: dict[int, tuple[int, float]]) -> tuple[Floats, Floats]:
    """Return linear equations (matrix, right side) for pole movements that put peaks of gaps at given samples."""
    slope = BETWEEN * np.array([[1.0, -8.0, 0.0, 8.0, -1.0]]) / 12  # derivative along a seam, from 5 points in a row
    pin_rows, pin_values = [np.zeros((0, rows.shape[2]))], [np.zeros(0)]
    for e, (k, value) in pinned.items():
        if 0 < k < gaps.shape[1] - 1:
            pin_rows.append(slope @ rows[e, k - 2 : k + 3])
            pin_values.append(slope @ gaps[e, k - 2 : k + 3])
        if value:
            pin_rows.append(rows[e, k : k + 1])
            pin_values.append(gaps[e, k : k + 1] - value)
    return np.concatenate(pin_rows), np.concatenate(pin_values)
