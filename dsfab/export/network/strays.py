"""Trimmed faces that stray from the skins where none of their points are, made anew.

The points of a region are over its cells. Borders are moved, straightened and joined after that: of one whose end went
150 mm along a member, two thirds had no point, and a surface of degree 9 was 8 mm off there.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import ExportError
from dsfab.export.network.heights import rows_at
from dsfab.export.network.model import NetModel
from dsfab.export.network.straying import FaceLimits
from dsfab.export.network.trimmed import TrimmedFace, loop_samples, surrounded, trimmed_face

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
