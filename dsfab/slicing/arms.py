"""`arms`: where members leave a place on a sheet. A tip has one arm, a bend or a member that goes on has two."""

from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats, Ints, group_sums, unfolded, unit_vectors
from dsfab.surface.mesh import Surface
from dsfab.surface.refine import refined
from dsfab.surface.topology import connected

BROAD = 3.0
"""An arm that is so many times wider than a member is more than the end of one: members join there."""

FINE = 0.5
"""Edges around a place are at most so many times the radius of the ball that is looked at."""


class Arms(NamedTuple):
    """Strips of material in which a sheet leaves a ball.

    direction : (a, 3) unit vectors towards where they do; two of size 0 where material surrounds the place.
    normal    : (a, 3) mean unit normals there.    width : (a,) metres across.
    """

    direction: Floats
    normal: Floats
    width: Floats

    def tip(self, width: float) -> bool:
        """Whether a member of a width in metres ends here."""
        return len(self.width) == 0 or (len(self.width) == 1 and float(self.width[0]) < BROAD * width)

    def hairpin(self, width: float) -> bool:
        """Whether a member ends here or turns back. One around a sharp edge of the surface goes on straight: the second
        arm is seen as if the surface were unfolded."""
        if len(self.width) != 2 or not self.direction.any():
            return self.tip(width)
        return float(self.direction[0] @ unfolded(self.normal[:1], self.normal[1:], self.direction[1:])[0]) > 0


def arms(sheet: Surface, place: Floats, radius: float) -> Arms:
    """How material goes on from the ball of `radius` metres around a place (3,) on a sheet: nowhere if no vertex of the
    sheet is in it. Faces that are large beside it are divided."""
    sheet = _near(sheet, place, radius)
    far = np.linalg.norm(sheet.V - place, axis=1)
    inside = far < radius
    if not inside.any():
        return Arms(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    ends, of = sheet.edges.ends, sheet.edges.of
    joined = ends[inside[ends].all(axis=1)]
    label = connected(sheet.n, joined[:, 0], joined[:, 1])[1]
    here = inside & (label == label[far.argmin()])
    faces = np.flatnonzero(here[sheet.F].any(axis=1) & ~here[sheet.F].all(axis=1))
    crossed = here[ends].sum(axis=1) == 1
    rows, sides = np.nonzero(crossed[of[faces]])  # two of each face: the ball's limit enters and leaves it
    edge = of[faces][rows, sides]
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(np.diff(edge[order]) == 0)
    one, two = rows[order[same]], rows[order[same + 1]]
    count, strip = connected(len(faces), one, two)
    around = np.bincount(strip[one], minlength=count) == np.bincount(strip, minlength=count)
    at = _limit(sheet, far, edge, radius) - place
    towards, normal = group_sums(strip[rows], at, count), group_sums(strip, sheet.normals[faces], count)
    width = np.bincount(strip, np.linalg.norm(at[::2] - at[1::2], axis=1), count)
    closed = 2 * int(around.sum())
    return Arms(
        np.concatenate([unit_vectors(towards[~around]), np.zeros((closed, 3))]),
        np.concatenate([unit_vectors(normal[~around]), np.zeros((closed, 3))]),
        np.concatenate([width[~around], np.zeros(closed)]),
    )


def _near(sheet: Surface, place: Floats, radius: float) -> Surface:
    """The faces that may meet the ball, none with an edge that is long beside it; the whole sheet where none does."""
    corners = sheet.V[sheet.F]
    away = np.linalg.norm(corners - place, axis=2).min(axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    meet = away < radius + longest
    if not meet.any():
        return sheet
    used, F = np.unique(sheet.F[meet], return_inverse=True)
    return refined(Surface(sheet.V[used], F.reshape(-1, 3)), FINE * radius)


def _limit(sheet: Surface, far: Floats, edge: Ints, radius: float) -> Floats:
    """(k, 3) where edges (k,) leave the ball; far (n,) are the distances of the vertices from its middle."""
    a, b = sheet.edges.ends[edge].T
    share = np.clip((radius - far[a]) / np.where(far[a] == far[b], 1.0, far[b] - far[a]), 0, 1)[:, None]
    return np.asarray(sheet.V[a] + share * (sheet.V[b] - sheet.V[a]))
