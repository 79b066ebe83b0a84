"""Guides: the user's directions of stripes, and curves that members follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from annotated_types import Ge, Gt

from dsfab.core.arrays import Bools, Complexes, Floats, Ints, distances_from_segments, unit_vectors
from dsfab.core.errors import PatternError, SurfaceError
from dsfab.pattern.frames import Frames, dots
from dsfab.pattern.phases import CornerPhase
from dsfab.surface import Picker, nearest_places
from dsfab.surface.loads.pickers import STRICT, Real, Vector
from dsfab.surface.mesh import Surface


class GuideError(PatternError, ValueError):
    """Error for a guide with contradictory settings."""


@dataclass(frozen=True)
class Guide:
    """A curve that stripes follow, or a direction of stripes in a region.
    curve     : points of a polyline on the surface or near it, metres.
    reach     : distance from the curve at which the weight falls to 0, m; default: the smaller stripe spacing.
    at        : a region, instead of a curve.    direction : direction (3,) of stripes in the region.
    weight    : 1 is as strong as a clear stress; 100 or more overrules the stress.
    family    : family of the stripes that follow the guide.    member : True if the curve itself becomes a member.
    Raises GuideError unless exactly one of `curve` and `at` is set, or if a region has no direction."""

    __pydantic_config__: ClassVar[Any] = STRICT
    curve: tuple[Vector, ...] | None = None
    reach: Annotated[Real, Gt(0)] | None = None
    at: Picker | None = None
    direction: Vector | None = None
    weight: Annotated[Real, Ge(0)] = 1.0
    family: Literal["major", "minor"] = "major"
    member: bool = False

    def __post_init__(self) -> None:
        if (self.curve is None) == (self.at is None):
            raise GuideError("give either curve = [[x, y, z], ...] or at = { pick = ... } with a direction")
        if self.at is not None and self.reach is not None:
            raise GuideError("the key reach is for a curve; remove the key, because pick gives the size of the region")
        if self.at is not None and self.member:
            raise GuideError("only a guide that is a curve can be a member; remove the key member from the region")
        if self.curve is not None and self.direction is not None:
            raise GuideError("a guide that is a curve defines its own directions; leave the key direction out")
        if self.curve is not None and len(set(self.curve)) < 2:
            raise GuideError("the key curve needs at least two different points")
        if self.at is not None and not any(self.direction or ()):
            raise GuideError("a region needs a direction that is not zero, such as [1.0, 0.0, 0.0]")

    @property
    def pull(self) -> float:
        """Weight of the guide relative to the stress: `weight`, but at least 100 if the guide becomes a member."""
        return max(self.weight, 100.0) if self.member else self.weight


@dataclass(frozen=True, eq=False)
class Guidance:
    """Directions of stripes that a guide demands at the vertices.    weight : (n,) weight of the guide.
    square : (n,) weight x e^2. The complex number e is the direction of major stripes in the vertex's frame."""

    weight: Floats
    square: Complexes

    @classmethod
    def from_guides(cls, frames: Frames, guides: tuple[Guide, ...], spacing: float) -> tuple[Self, ...]:
        """Return a `Guidance` for each guide with a `pull` above 0. spacing : default `reach` of curves, m.
        Raises PatternError for a guide that does not fit the surface."""
        squares = [(guide, _guide_squares(frames, k, guide, spacing)) for k, guide in enumerate(guides)]
        weighted = [guide.pull * square * (1 if guide.family == "major" else -1) for guide, square in squares]
        return tuple(cls(np.abs(square), square) for square in weighted if np.abs(square).any())

    def tensors(self, frames: Frames) -> Floats:
        """Return the guide's directions as symmetric tensors (n, 3, 3) of trace 0."""
        e1, e2 = frames.t1[:, :, None], frames.t2[:, :, None]
        x, y = e1.transpose(0, 2, 1), e2.transpose(0, 2, 1)
        strength = self.square / (1 + self.weight)
        tensor = strength.real[:, None, None] * (e1 * x - e2 * y) + strength.imag[:, None, None] * (e1 * y + e2 * x)
        return np.asarray(tensor / np.sqrt(2))


def _guide_squares(frames: Frames, number: int, guide: Guide, spacing: float) -> Complexes:
    surface = frames.surface
    if guide.at is not None:
        assert guide.direction is not None
        try:
            inside = guide.at.vertices(surface)
        except SurfaceError as error:
            raise PatternError(f"pattern.guide.{number}: {error}") from None
        square = np.where(inside, _tangent(frames, unit_vectors(np.array(guide.direction))) ** 2, 0.0)
    else:
        square = _curve_squares(frames, number, guide, guide.reach or spacing)
    if np.abs(square).max() < 0.1**2:  # the direction is under 6 degrees from the normal
        subject = "the direction is" if guide.at is not None else "the curve is"
        raise PatternError(
            f"pattern.guide.{number}: {subject} perpendicular to the surface, so stripes cannot follow this guide; "
            "choose a guide along the surface"
        )
    return np.asarray(square)


def _curve_squares(frames: Frames, number: int, guide: Guide, reach: float) -> Complexes:
    surface, points = frames.surface, np.array(guide.curve)
    points = points[np.append(True, np.diff(points, axis=0).any(axis=1))]
    start, step = points[:-1], np.diff(points, axis=0)
    square, nearest = np.zeros(surface.n, dtype=np.complex128), np.inf
    chunk = max(1_000_000 // len(step), 1)  # to limit the memory
    for start_row in range(0, surface.n, chunk):
        rows = np.arange(start_row, min(start_row + chunk, surface.n))
        distances = distances_from_segments(surface.V[rows, None], start, start + step)
        nearest_piece = distances.min(axis=1)
        nearest = min(nearest, float(nearest_piece.min()))
        share = np.maximum(1 - (distances - nearest_piece[:, None]) / (0.1 * reach), 0.0)
        z = np.stack([_tangent(frames, t, rows) for t in unit_vectors(step)], axis=1)
        mean = (share * z**2).sum(axis=1) / share.sum(axis=1)
        square[rows] = np.maximum(1 - (nearest_piece / reach) ** 2, 0.0) ** 2 * mean
    if not nearest < reach:
        raise PatternError(
            f"pattern.guide.{number}: the curve is {nearest:.3g} m from the nearest vertex of the surface, but the "
            f"reach of the guide is {reach:.3g} m; move the curve onto the surface, or raise reach (the mean edge "
            f"length is {surface.mean_edge:.3g} m)"
        )
    return square


def _tangent(frames: Frames, direction: Floats, rows: Any = slice(None)) -> Complexes:
    return np.asarray(frames.t1[rows] @ direction + 1j * (frames.t2[rows] @ direction))


ON_EDGE = 1e-9  # A point is on an edge if its barycentric coordinate for the opposite corner is below this.


@dataclass(frozen=True, eq=False)
class GuideLine:
    """Curve of a guide, which becomes a member. number : of the guide, from 0.    family : of the member.
    points : (k, 3) points along the curve, metres.    faces : (k,) the face that contains each point."""

    number: int
    family: str
    points: Floats
    faces: Ints

    @classmethod
    def from_guides(cls, surface: Surface, guides: Sequence[Guide]) -> "list[GuideLine]":
        """Return the curve of each guide with `member` = True, on the surface. Raises PatternError."""
        lines = []
        for k, guide in enumerate(guides):
            if not guide.member:
                continue
            points, faces = _points_on_surface(surface, np.array(guide.curve))
            if len(points) < 2:
                raise PatternError(
                    f"pattern.guide.{k}: the curve is outside the surface and cannot be a member; move the curve onto "
                    f"the surface, or remove the key member"
                )
            lines.append(cls(k, guide.family, points, faces))
        return lines

    def target_phases(self, frames: Frames, g: Floats, density: Floats) -> tuple[Ints, Floats]:
        """Return the vertices (v,) beside the curve, and phases (v,), periods, that put a stripe on the curve.
        g : (n, 3) unit direction of the phase's gradient, up to sign.    density : (n,) periods per m."""
        surface = frames.surface
        vertices = np.unique(surface.F[self.faces])
        begin = np.arange(len(self.points) - 1)
        nearest_points = nearest_places(surface.V[vertices], self.points, np.stack([begin, begin + 1], axis=1))
        piece = nearest_points.simplex
        left_direction = np.cross(frames.normal[vertices], unit_vectors(np.diff(self.points, axis=0))[piece])
        away = dots(surface.V[vertices] - nearest_points.place, left_direction) * np.where(
            dots(left_direction, g[vertices]) < 0, -1.0, 1.0
        )
        F = surface.F[self.faces[piece]]
        phase = away * np.einsum("vc,vc->v", density[F], _barycentric(surface.V[F], self.points[piece]))
        return vertices, phase - np.rint(phase)

    def followed_share(self, surface: Surface, phase: CornerPhase, step: int) -> float:
        """Return the fraction of the curve on centre lines of stripes. step : distance of centre lines, in periods."""
        F = surface.F[self.faces]
        z = np.einsum("kc,kc->k", phase.corners(surface)[self.faces], _barycentric(surface.V[F], self.points))
        distance = np.abs(z - step * np.rint(z / step))
        return float(((distance < 0.05) & ~phase.singular[self.faces]).mean())

    def runs_across(self, directions: Floats) -> bool:
        """Return True if the curve is more perpendicular than parallel to the unit vectors `directions` (m, 3)."""
        step = unit_vectors(np.diff(self.points, axis=0))
        return bool((dots(step, directions[self.faces[:-1]]) ** 2).mean() < 0.5)


def guide_phases(lines: Sequence[GuideLine], frames: Frames, g: Floats, density: Floats) -> tuple[Bools, Floats]:
    """Return a mask (n,) of vertices beside the curves, and phases (n,), periods, that put stripes on the curves."""
    lock, aim = np.zeros(frames.surface.n, dtype=bool), np.zeros(frames.surface.n)
    for line in lines:
        vertices, phase = line.target_phases(frames, g, density)
        lock[vertices], aim[vertices] = True, phase
    return lock, aim


def _points_on_surface(surface: Surface, curve: Floats) -> tuple[Floats, Ints]:
    step = surface.mean_edge / 8
    points = [curve[:1]]
    for begin, end in pairwise(curve):
        count = max(int(np.ceil(np.linalg.norm(end - begin) / step)), 1)
        points.append(begin + np.linspace(0, 1, count + 1)[1:, None] * (end - begin))
    projection = nearest_places(np.concatenate(points), surface.V, surface.F)
    edge = np.zeros((surface.m, 3), dtype=bool)  # column c: the edge opposite corner c
    edge[:, [2, 0, 1]] = surface.edges.boundary[surface.edges.of]
    beyond = (
        (_barycentric(surface.V[surface.F[projection.simplex]], projection.place) < ON_EDGE) & edge[projection.simplex]
    ).any(axis=1)
    moved = np.append(True, np.linalg.norm(np.diff(projection.place, axis=0), axis=1) > ON_EDGE * surface.size)
    is_kept = moved & ~(beyond & (projection.distance > ON_EDGE * surface.size))
    return projection.place[is_kept], projection.simplex[is_kept]


def _barycentric(corners: Floats, points: Floats) -> Floats:
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    sides = [np.cross(q - p, points - p) for p, q in ((b, c), (c, a), (a, b))]
    return np.stack([dots(side, normal) for side in sides], axis=1) / dots(normal, normal)[:, None]
