"""Which closed shells of a mesh bound which solid: an outer shell, and the voids inside it."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.surface import signed_volume
from dsfab.surface.topology import edge_table, pieces


def solids_of(part: Part) -> tuple[Ints, list[list[int]]]:
    """The shell (m,) of each triangle, and the shells of each solid: the outer one first, then its voids.

    Shells with positive volume are outer; a void (its triangles face inwards) belongs to the smallest outer shell
    around it. Raises ExportError for a void around which there is none.
    """
    count, shell = pieces(part.F, edge_table(part.F))
    volumes = [signed_volume(part.V, part.F[shell == i]) for i in range(count)]
    outer = sorted((i for i in range(count) if volumes[i] > 0), key=lambda i: volumes[i])
    voids: dict[int, list[int]] = {i: [] for i in outer}
    for i in range(count):
        if volumes[i] > 0:
            continue
        point = part.V[part.F[(shell == i).argmax(), 0]]
        around = (o for o in outer if volumes[o] > -volumes[i] and winding(point, part.V, part.F[shell == o]) > 0.5)
        owner = next(around, None)
        if owner is None:
            raise ExportError(f"piece {i} of the solid {part.name!r} is inside out; turn its faces")
        voids[owner].append(i)
    return shell, [[i, *voids[i]] for i in sorted(outer)]


def winding(point: Floats, V: Floats, F: Ints) -> float:
    """How often the closed mesh V (n, 3), F (m, 3) goes around a point (3,): 1 inside, 0 outside [van Oosterom,
    Strackee 1983]."""
    a, b, c = (V[F[:, i]] - point for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    dot = [np.einsum("mi,mi->m", x, y) for x, y in ((a, b), (b, c), (c, a))]
    half = np.arctan2(np.einsum("mi,mi->m", a, np.cross(b, c)), la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb)
    return float(half.sum() / (2 * np.pi))
