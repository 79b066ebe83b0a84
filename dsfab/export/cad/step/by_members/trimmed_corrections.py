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
"""(k, 2) where surfaces are asked, over their squares."""

ROWS = rows_at(PLACES)

ROUNDS = 2
"""Looks at a face; what a first one brings back may stray elsewhere."""


def without_strays(
    model: NetModel,
    faces: Mapping[int, TrimmedFace],
    points: Mapping[int, Floats],
    away: Callable[[Floats], Floats],
    limits: FaceLimits,
) -> dict[int, TrimmedFace]:
    """The faces, those made anew with more points that are too far off the skins between these; as they are where they
    are asked how far off the mesh they are, which divides them.

    points : (k, 6) that each was made with.    away : see `net_model`.
    """
    found, todo, known = dict(faces), [] if limits.beyond_mesh else list(faces), dict(points)
    for _ in range(ROUNDS):
        if not todo:
            break
        new = _skins_beside(model, [found[i] for i in todo], away, limits.off)
        more = {i: some for i, some in zip(todo, new, strict=True) if len(some)}
        todo = []
        for i, some in more.items():
            known[i] = np.concatenate([known[i], some])
            try:
                found[i] = trimmed_face(model, found[i].loops, known[i], limits, True)
            except ExportError:  # it bends too much there, which its own points did not tell
                continue
            todo.append(i)
    return found


def _skins_beside(
    model: NetModel, faces: Sequence[TrimmedFace], away: Callable[[Floats], Floats], near: float
) -> list[Floats]:
    """By face, points (k, 6) of the skins beside places of it if one of these is farther off than `near`; else none."""
    at = [_places(model, face) for face in faces]
    ways = away(np.concatenate(at))
    found = list[Floats]()
    for P, way in zip(at, np.split(ways, np.cumsum([len(P) for P in at])[:-1]), strict=True):
        off = np.linalg.norm(way.reshape(-1, 2, 3), axis=2).max(initial=0.0)
        found.append(P + way if off > near else np.zeros((0, 6)))
    return found


def _places(model: NetModel, face: TrimmedFace) -> Floats:
    """(k, 6) points of a face that its outline goes around."""
    skins = [ROWS(len(poles) - 1) @ poles.reshape(-1, 3) for poles in (face.outer, face.inner)]
    P = np.concatenate(skins, axis=1)
    return np.asarray(P[surrounded(P, [loop_samples(model, loop) for loop in face.loops])])


SAMPLES = 23
"""At which OCCT looks, ends among them."""

BETWEEN = 8
"""Steps from one to the next, where a gap is measured here."""

SHORT = 3e-6
"""Share that the widest of the places may be less than the widest gap; OCCT allows 1e-5."""

HIGHER = 1.003
"""Of the widest gap, what it is to be where it is moved to: another peak may be as high."""

EXACT = 1e-7
"""Millimetres of a gap that is none to OCCT."""

HELD = 1e-6
"""Gap up to which an edge is exact, of a face that `flush` made so, and has to stay so."""

FINE = 5e-4
"""Gap under which all digits of poles count: rounded ones move its peak."""

FAST, SMOOTH, SMALL = 1e4, 1e-2, 1e-4
"""Weights of peaks and exact edges, of second differences of what poles move by, and of that itself, against 1 of
points along edges."""

SAMPLING_ROUNDS, MORE = 6, 2
"""How often peaks are looked for anew, and degrees that a surface may get more."""

STEP = 1e-3
"""Millimetres between two points that tell how steep a surface is."""

DENSE = np.linspace(0, 1, (SAMPLES - 1) * BETWEEN + 1)
"""Where gaps are measured; every `BETWEEN`th is where OCCT looks."""

SLOPE = BETWEEN * np.array([[1.0, -8.0, 0.0, 8.0, -1.0]]) / 12
"""Times five gaps in a row: how steep they are in the middle."""

HOLD = (1 - np.cos(np.pi * np.arange(6) / 5)) / 2
"""Where exact edges are held."""


def with_sampled_peaks(model: NetModel, faces: list[TrimmedFace]) -> list[TrimmedFace]:
    """The faces, whose gaps to seams that end at an outline are the widest at one of `PLACES` places.

    A face stays as it is where that makes a gap of more than `SPLIT`, or moves its inside by more.
    """
    walls = {e for wall in model.walls for e, _ in wall.steps}
    ends = {v for e in walls for v in (model.edges[e].start, model.edges[e].end)}
    held = {e: edge.poles for e, edge in enumerate(model.edges)} | curves_beyond(model)
    return [_with_peaks(face, model, walls, ends, held) for face in faces]


def _with_peaks(
    face: TrimmedFace, model: NetModel, walls: set[int], ends: set[int], held: Mapping[int, Floats]
) -> TrimmedFace:
    """A face with all peaks that can be moved where they should be; held : poles of what stays exact."""
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
    exact = face.exact or any(x.closest(P) < FINE for x, P in zip(surfaces, (outer, inner), strict=True))
    if outer is face.outer and inner is face.inner:
        return replace(face, exact=exact)
    new = replace(face, outer=outer, inner=inner, exact=exact)
    return replace(new, gap=float(np.abs(new.gaps(edges)).max()))


@dataclass(frozen=True, eq=False)
class _Surface:
    """One of a face: poles (p + 1, p + 1, 3), axes (3, 3), and points (e, k, 3) of its seams, (h, 6, 3) of edges that
    may be exact, and (j, 3) along all edges, millimetres."""

    poles: Floats
    axes: Floats
    seams: Floats
    held: Floats
    edges: Floats
    over: dict[int, Floats] = field(default_factory=dict)
    """By degree: (3, e, k, poles) what each pole counts at points of seams, and a step along both axes beside them."""
    around: dict[int, Floats] = field(default_factory=dict)
    """By degree: (j, poles) what each counts along all edges."""

    def moved(self, exact: bool) -> Floats:
        """The poles with the fewest peaks at wrong places, of the lowest degree; exact edges stay so where asked."""
        local, count = self.poles @ self.axes.T, len(self.poles)
        best, least = self.poles, int(self._wrong(self._gaps(local)).sum())
        for degree in range(count - 1, count + MORE):
            if not least:
                break
            new = np.stack([raised(local[..., i], degree) for i in range(3)], axis=2)
            for z, wrong in self._rounds(new, HELD if exact else 0.0):
                if wrong < least and self._allowed(new, z):
                    best, least = np.concatenate([new[..., :2], z[..., None]], axis=2) @ self.axes, wrong
        return best

    def closest(self, poles: Floats) -> float:
        """The widest gap to the seam that such a surface is nearest to, millimetres."""
        return float(np.abs(self._gaps(poles @ self.axes.T)).max(axis=1).min())

    def _rounds(self, local: Floats, near: float) -> list[tuple[Floats, int]]:
        """Heights of poles after each round, and how many peaks are then at wrong places; edges with gaps that are less
        than `near` keep these."""
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
        """Whether a surface with other heights is near enough to its edges, and to what it was."""
        degree, inside = len(local) - 1, inside_of(self.edges)
        at = self._around(degree)
        before, after = (np.abs(self.edges @ self.axes[2] - at @ x.ravel()).max() for x in (local[..., 2], z))
        moved = height_rows(places(self.poles, self.axes, inside), degree) @ (z - local[..., 2]).ravel()
        return bool(after <= max(SPLIT, before) and np.abs(moved).max() <= SPLIT)

    def _rows(self, points: Floats, degree: int) -> Floats:
        """(e, k, poles) what each pole counts at points (e, k, 3)."""
        rows = height_rows(places(self.poles, self.axes, points.reshape(-1, 3)), degree)
        return rows.reshape(*points.shape[:2], rows.shape[1])

    def _around(self, degree: int) -> Floats:
        """(j, poles) the same along all edges."""
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
        """(e, k) how far seams are above the surface, across it."""
        return self._across(local)[0]

    def _across(self, local: Floats) -> tuple[Floats, Floats]:
        """(e, k) these gaps, and the cosines of the angles between the heights and the surface's normals there."""
        here, right, left = self._over(len(local) - 1) @ local[..., 2].ravel()
        cosines = 1 / np.sqrt(1 + ((right - here) / STEP) ** 2 + ((left - here) / STEP) ** 2)
        return (self.seams @ self.axes[2] - here) * cosines, cosines

    def _wrong(self, gaps: Floats) -> Bools:
        """(e,) whether the widest gap is between two of the places at which OCCT looks."""
        wide = np.abs(gaps).max(axis=1)
        found = np.abs(gaps[:, ::BETWEEN]).max(axis=1)
        wrong = (found < (1 - SHORT) * _summits(np.abs(gaps))) & (wide > EXACT) & (wide <= SPLIT)
        return np.asarray(wrong)


def _summits(gaps: Floats) -> Floats:
    """(e,) the largest of gaps (e, k), or what a parabola through that and both beside it has."""
    at = gaps.argmax(axis=1)
    before, here, after = (gaps[np.arange(len(gaps)), np.clip(at + i, 0, gaps.shape[1] - 1)] for i in (-1, 0, 1))
    bend = 2 * here - before - after
    inside = (at > 0) & (at < gaps.shape[1] - 1) & (bend > 0)
    return np.asarray(here + np.where(inside, (after - before) ** 2 / np.where(inside, 8 * bend, 1), 0))


def _peak(gaps: Floats, again: bool) -> tuple[int, float]:
    """The one of the places that is nearest to the peak of gaps (k,), and what the gap is to be there: 0 is anything,
    unless this is asked `again`."""
    at = int(np.abs(gaps).argmax())
    return BETWEEN * round(at / BETWEEN), HIGHER * float(gaps[at]) if again else 0.0


def _pins(rows: Floats, gaps: Floats, pinned: dict[int, tuple[int, float]]) -> tuple[Floats, Floats]:
    """Rows (j, poles) and right sides (j,) for gaps that have a value at a place, and are flat there but at ends."""
    left, right = [np.zeros((0, rows.shape[2]))], [np.zeros(0)]
    for e, (k, value) in pinned.items():
        if 0 < k < gaps.shape[1] - 1:
            left.append(SLOPE @ rows[e, k - 2 : k + 3])
            right.append(SLOPE @ gaps[e, k - 2 : k + 3])
        if value:
            left.append(rows[e, k : k + 1])
            right.append(gaps[e, k : k + 1] - value)
    return np.concatenate(left), np.concatenate(right)
