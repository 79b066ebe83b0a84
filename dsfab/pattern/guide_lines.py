"""`GuideLine`: a curve of a guide that becomes a member: on the surface, and what the phase is to be beside it.

    V          s : signed distance of a vertex V from the curve, along the gradient g of the phase. There the phase
    | s            is to be s times the lines per metre: it is 0, the middle of a stripe, on the curve itself, in all
----+-----         faces that this passes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, unit_vectors
from dsfab.errors import PatternError
from dsfab.pattern.corners import CornerPhase
from dsfab.pattern.frames import Frames, dots
from dsfab.pattern.guides import Guide
from dsfab.surface import Surface, nearest

FINE = 8
"""Points of a curve for each mean edge of the mesh: few faces that it passes are missed, by a corner."""
ALONG = 0.05
"""A member runs along a curve where its middle is off that by less than this share of the distance to the next."""
ON_EDGE = 1e-9
"""A point is on an edge of a face where the share of the third corner is smaller."""


@dataclass(frozen=True, eq=False)
class GuideLine:
    """Points (k, 3) of a curve on a surface, metres, one after the other, and the faces (k,) that they are on.

    number : of the guide.    family : whose member it is to be.
    """

    number: int
    family: str
    points: Floats
    faces: Ints

    @classmethod
    def of(cls, surface: Surface, guides: Sequence[Guide]) -> "list[GuideLine]":
        """Those of the guides that are to be members, where they are on the surface and not beyond its boundary.

        Raises PatternError for one that is nowhere on it.
        """
        found = []
        for k, guide in enumerate(guides):
            if not guide.member:
                continue
            points, faces = _on_surface(surface, np.array(guide.curve))
            if len(points) < 2:
                raise PatternError(
                    f"pattern.guide.{k}: the curve lies beyond the edge of the surface and cannot be a member; move it "
                    "onto the surface, or leave member out"
                )
            found.append(cls(k, guide.family, points, faces))
        return found

    def aims(self, frames: Frames, g: Floats, density: Floats) -> tuple[Ints, Floats]:
        """Vertices (v,) of the faces that it passes, and (v,) what the phase is to be there, in periods, -1/2 to 1/2.

        g : (n, 3) unit direction of its gradient at the vertices, up to sign.    density : (n,) periods per metre.
        """
        surface = frames.surface
        at = np.unique(surface.F[self.faces])
        first = np.arange(len(self.points) - 1)
        found = nearest(surface.V[at], self.points, np.stack([first, first + 1], axis=1))
        piece = found.simplex
        left = np.cross(frames.normal[at], unit_vectors(np.diff(self.points, axis=0))[piece])
        away = dots(surface.V[at] - found.place, left) * np.where(dots(left, g[at]) < 0, -1.0, 1.0)
        F = surface.F[self.faces[piece]]
        shares = _shares(surface.V[F], self.points[piece])
        phase = away * np.einsum("vc,vc->v", density[F], shares)
        return at, phase - np.rint(phase)

    def followed(self, surface: Surface, phase: CornerPhase, every: int) -> float:
        """The share of the curve along which the middle of a stripe runs, of a phase of which `every` line is drawn."""
        F = surface.F[self.faces]
        weight = _shares(surface.V[F], self.points)
        z = np.einsum("kc,kc->k", phase.corners(surface)[self.faces], weight)
        off = np.abs(z - every * np.rint(z / every))
        return float(((off < ALONG) & ~phase.singular[self.faces]).mean())

    def across(self, directions: Floats) -> bool:
        """Whether the curve runs mostly across directions (m, 3) on the faces, unit vectors."""
        step = unit_vectors(np.diff(self.points, axis=0))
        return bool((dots(step, directions[self.faces[:-1]]) ** 2).mean() < 0.5)


def aimed(lines: Sequence[GuideLine], frames: Frames, g: Floats, density: Floats) -> tuple[Bools, Floats]:
    """(n,) vertices beside the curves of guides, and (n,) what the phase is to be there, in periods; 0 elsewhere."""
    lock, aim = np.zeros(frames.surface.n, dtype=bool), np.zeros(frames.surface.n)
    for line in lines:
        at, phase = line.aims(frames, g, density)
        lock[at], aim[at] = True, phase
    return lock, aim


def _on_surface(surface: Surface, curve: Floats) -> tuple[Floats, Ints]:
    """(k, 3) points along a polyline, moved onto the surface, and their faces."""
    step = surface.mean_edge / FINE
    points = [curve[:1]]
    for begin, end in pairwise(curve):
        count = max(int(np.ceil(np.linalg.norm(end - begin) / step)), 1)
        points.append(begin + np.linspace(0, 1, count + 1)[1:, None] * (end - begin))
    found = nearest(np.concatenate(points), surface.V, surface.F)
    edge = np.zeros((surface.m, 3), dtype=bool)  # by the corner that is across from it
    edge[:, [2, 0, 1]] = surface.edges.boundary[surface.edges.of]
    beyond = ((_shares(surface.V[surface.F[found.simplex]], found.place) < ON_EDGE) & edge[found.simplex]).any(axis=1)
    moved = np.append(True, np.linalg.norm(np.diff(found.place, axis=0), axis=1) > ON_EDGE * surface.size)
    kept = moved & ~(beyond & (found.distance > ON_EDGE * surface.size))
    return found.place[kept], found.simplex[kept]


def _shares(corners: Floats, points: Floats) -> Floats:
    """(k, 3) barycentric coordinates of points (k, 3) in the planes of triangles (k, 3, 3)."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    sides = [np.cross(q - p, points - p) for p, q in ((b, c), (c, a), (a, b))]
    return np.stack([dots(side, normal) for side in sides], axis=1) / dots(normal, normal)[:, None]
