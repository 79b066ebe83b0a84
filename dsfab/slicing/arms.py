"""`arms`: where members leave a place on a sheet. A tip has one arm, a bend or a member that goes on has two."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected


def arms(sheet: Surface, place: Floats, radius: float) -> Floats:
    """(a, 3) unit directions of the strips of material in which a sheet leaves the ball of `radius` metres around a
    place (3,) on it; two of size 0 where material surrounds it, none where no vertex of the sheet is in the ball.
    """
    far = np.linalg.norm(sheet.V - place, axis=1)
    inside = far < radius
    if not inside.any():
        return np.empty((0, 3))
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
    middle = sheet.V[ends[edge]].mean(axis=1) - place
    towards = np.stack([np.bincount(strip[rows], x, count) for x in middle.T], axis=1)
    towards = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    return np.concatenate([towards[~around], np.zeros((2 * int(around.sum()), 3))])
