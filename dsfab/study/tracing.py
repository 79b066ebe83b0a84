"""Lines along the principal stresses, traced one after another and about evenly apart, as earlier work draws them.

A line goes straight through each face and turns at its edges. A new one starts where the surface is farthest from all
others, and ends where it comes nearer to one than half of the distance that is asked [Jobard and Lefer 1997].
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.pipeline import Design
from dsfab.study.integration import along, drawn_families, typical_slope
from dsfab.surface import Surface

NEAR = 0.5
"""Of the distance asked: nearer to another line a line ends."""

SHORT = 1.0
"""Lines shorter than this many distances are left out; their place counts as taken."""

ROUND = 3.0
"""Distances along a line after which it is looked for whether it comes back to itself."""

TURN = 0.5
"""Cosine of the largest turn from face to face: at a sharper one the directions are none."""

End = Literal["boundary", "inside", "round"]


@dataclass(frozen=True, eq=False)
class StressLine:
    """points : (k, 3) metres, in order; the first again at the end where it came round.
    faces  : (k - 1,) the face of each piece.
    loose  : how many of its ends lie inside the surface.
    """

    points: Floats
    faces: tuple[int, ...]
    loose: int

    @property
    def length(self) -> float:
        """Metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def traced(design: Design) -> tuple[list[StressLine], list[StressLine]]:
    """The lines of both families, as far apart as the stripes are in the median, of a design on modes by number."""
    surface, clear = design.surface, ~design.diffusion.tensors.isotropic
    major, minor = (
        stress_lines(surface, along(one.D), clear, 1 / (one.frequency * typical_slope(surface, one.mode)))
        for one in drawn_families(design)
    )
    return major, minor


def stress_lines(surface: Surface, direction: Floats, clear: Bools, apart: float) -> list[StressLine]:
    """Lines along a direction (m, 3), units up to sign, in faces that are clear (m,), about `apart` metres apart."""
    walk = _Walk(surface, direction, clear, apart)
    centres = surface.centroids
    distance = np.where(clear, np.inf, 0.0)
    lines = []
    while (seed := int(np.argmax(distance))) >= 0 and distance[seed] > apart:
        line = walk.line(seed)
        distance = np.minimum(distance, cKDTree(np.vstack([line.points, centres[seed]])).query(centres)[0])
        if line.length > SHORT * apart:
            lines.append(line)
            walk.others = cKDTree(np.vstack([each.points for each in lines]))
    return lines


@dataclass(eq=False)
class _Walk:
    """Through the faces of a surface, along their directions, away from the lines that are there."""

    surface: Surface
    direction: Floats
    clear: Bools
    apart: float
    others: cKDTree | None = None

    def line(self, seed: int) -> StressLine:
        """From the middle of a face, both ways."""
        start = self.surface.centroids[seed]
        ahead, faces, end = self._half(seed, start, self.direction[seed])
        if end == "round":
            return StressLine(np.array(ahead), tuple(faces), loose=0)
        behind, back, other = self._half(seed, start, -self.direction[seed])
        loose = (end == "inside") + (other == "inside")
        return StressLine(np.array(behind[:0:-1] + ahead), (*back[::-1], *faces), loose)

    def _half(self, face: int, start: Floats, t: Floats) -> tuple[list[Floats], list[int], End]:
        """Points from the start on, the face of each piece, and where the line ends."""
        points, runs, faces, entered = [start], [0.0], list[int](), -1
        while True:
            half_edge, p = self._exit(face, points[-1], t, entered)
            if half_edge < 0:
                break
            runs.append(runs[-1] + float(np.linalg.norm(p - points[-1])))
            points.append(p)
            faces.append(face)
            passed = int(np.searchsorted(runs, runs[-1] - ROUND * self.apart))
            if (back := self._came_back(points[:passed], p)) is not None:
                came = back * 2 < passed
                return ([*points, start], [*faces, face], "round") if came else (points, faces, "inside")
            entered = int(self.surface.edges.twins[half_edge])
            if entered < 0:
                return points, faces, "boundary"
            if not self.clear[face := entered // 3] or self._is_near(p):
                break
            turned = self.direction[face] * np.sign(self.direction[face] @ t)
            if turned @ t < TURN:
                break
            t = turned
        return points, faces, "inside"

    def _came_back(self, passed: list[Floats], p: Floats) -> int | None:
        """Which of the points that a line passed long ago it has come near to again, if any."""
        if not passed:
            return None
        far = np.linalg.norm(np.array(passed) - p, axis=1)
        best = int(np.argmin(far))
        return best if far[best] < NEAR * self.apart else None

    def _exit(self, face: int, p: Floats, t: Floats, entered: int) -> tuple[int, Floats]:
        """The half-edge by which a ray leaves a face, and where; -1 where it would go back through where it came."""
        corners = self.surface.V[self.surface.F[face]]
        outward = np.cross(np.roll(corners, -1, axis=0) - corners, self.surface.normals[face])
        speed = outward @ t
        ways = [k for k in range(3) if speed[k] > 0 and 3 * face + k != entered]
        if not ways:
            return -1, p
        far = [max(float((corners[k] - p) @ outward[k]) / speed[k], 0.0) for k in ways]
        best = int(np.argmin(far))
        return 3 * face + ways[best], p + far[best] * t

    def _is_near(self, p: Floats) -> bool:
        reach = NEAR * self.apart
        return self.others is not None and bool(self.others.query(p, distance_upper_bound=reach)[0] < reach)


def ribbons(surface: Surface, lines: list[StressLine], width: float, lift: float) -> tuple[Floats, Ints]:
    """Lines as flat bands above the surface: (n, 3) vertices, metres, and (m, 3) faces."""
    V, F, count = [], [], 0
    for line in lines:
        normal = surface.normals[[*line.faces, line.faces[-1]]]
        side = np.cross(normal, np.gradient(line.points, axis=0))
        side *= width / 2 / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
        k = len(line.points)
        V += [line.points + lift * normal + side, line.points + lift * normal - side]
        i = count + np.arange(k - 1)
        F += [np.stack([i, i + k, i + 1], axis=1), np.stack([i + 1, i + k, i + k + 1], axis=1)]
        count += 2 * k
    return np.vstack(V), np.vstack(F)
