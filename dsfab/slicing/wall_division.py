"""`divided_walls`: the walls of a sheet divided where they bend from one straight piece to the next.

      m                    A wall a - b of a curve is a chord. A new vertex m is put on the curve, as far beside
   .  |  .                 the middle of the chord as the turns at both ends tell, in the face that the wall is in;
a ----+---- b              both cells beside the wall are divided.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Bools, Floats, Ints
from dsfab.slicing.fairing import CORNER, freedom, least_angles
from dsfab.slicing.mesh_edit import independent
from dsfab.slicing.sheet import Sheet
from dsfab.slicing.walls import Walls
from dsfab.surface import Surface

BENT = float(np.radians(3))
"""Walls are divided where they turn by more than this from end to end."""
ROUNDS = 3
"""How often: each time about halves the turns."""
SLIM, WORSE = 4.0, 0.5
"""Cells are not divided where the smallest angle becomes less than so many degrees, or than it was, by this factor."""
WITHIN = 1e-3
"""Least weight of a new vertex on each corner of its face."""


@dataclass(frozen=True, eq=False)
class Division:
    """Walls (k,) of a sheet, no two of them at one cell, with the places V (k, 3) and the weights (k, n) of the new
    vertices on them."""

    wall: Ints
    V: Floats
    weights: csr_array

    def some(self, chosen: Bools) -> "Division":
        """Those that are marked (k,)."""
        at = np.flatnonzero(chosen)
        return Division(self.wall[at], self.V[at], self.weights[at])


def divided_walls(sheet: Sheet) -> Sheet:
    """The cells of a sheet, walls between material and void divided where they bend, so that outlines look round.

    sheet : all cells, material and void, without pinches; its walls are fair.

    Only walls inside of one uncut face are divided, and only where cells stay plump enough: the new vertex stays in
    that face. Corners stay as sharp as they are.
    """
    for _ in range(ROUNDS):
        walls = Walls.of(sheet)
        division = _division(sheet, walls)
        if not len(division.wall):
            break
        sheet = _divided(sheet, walls, division)
    return sheet


def _bows(sheet: Sheet, walls: Walls) -> Floats:
    """(w,) metres that the middle of the curve through each wall's ends lies to the right of it; 0 where it hardly
    bends."""
    if not len(walls.start):
        return np.empty(0)
    turn, every = walls.turns(sheet), np.arange(len(walls.start))
    (before, there), (after, too) = (walls.ahead(every, np.full(len(every), k)) for k in (-1, 1))
    plain = there & (np.abs(turn) < CORNER)
    curvature = np.zeros(len(turn))
    curvature[plain] = (turn / ((walls.length[before] + walls.length) / 2))[plain]
    ends = plain.astype(np.int64) + (plain[after] & too)
    mean = (curvature + np.where(too, curvature[after], 0.0)) / np.maximum(ends, 1)
    bent = np.abs(mean) * walls.length > BENT
    return np.asarray(np.where(bent, mean * walls.length**2 / 8, 0.0))


def _division(sheet: Sheet, walls: Walls) -> Division:
    """The walls that are divided next: of two at one cell the one that bows more."""
    bow = _bows(sheet, walls)
    one, two = walls.inside // 3, walls.outside // 3
    wall = np.flatnonzero((bow != 0) & (sheet.parent[one] == sheet.parent[two]))
    wall = wall[np.argsort(-np.abs(bow[wall]), kind="stable")]
    middle = csr_array(0.5 * (sheet.weights[walls.start[wall]] + sheet.weights[walls.end[wall]]))
    free = freedom(sheet, np.arange(len(wall)), middle)
    face = free.along[:, 1].any(axis=1)
    wall, middle, along, share = wall[free.vertex], middle[free.vertex], free.along, free.share
    V = sheet.surface.V
    a, b = V[walls.start[wall]], V[walls.end[wall]]
    left = np.cross(sheet.surface.normals[one[wall]], b - a) / walls.length[wall][:, None]
    step = -bow[wall][:, None] * np.einsum("kji,ki->kj", along, left)
    row = np.repeat(np.arange(len(wall)), 3)
    change = (np.einsum("kj,kjc->kc", step, share).ravel(), (row, free.column.ravel()))
    weights = csr_array(middle + csr_array(change, shape=middle.shape))
    new = Division(wall, (a + b) / 2 + np.einsum("kj,kji->ki", step, along), weights)
    within = np.full(len(wall), np.inf)
    np.minimum.at(within, np.repeat(np.arange(len(wall)), np.diff(weights.indptr)), weights.data)
    return _apart(sheet, walls, new.some(face & (within > WITHIN)))


def _apart(sheet: Sheet, walls: Walls, new: Division) -> Division:
    """Of divisions, the best first, those that leave cells plump, and no two of which are at one cell."""
    new = new.some(_plump(sheet, walls, new))
    rank = np.arange(len(new.wall))
    cells = np.concatenate([walls.inside[new.wall], walls.outside[new.wall]]) // 3
    return new.some(independent(np.concatenate([rank, rank]), cells, rank, sheet.surface.m))


def _halves(sheet: Sheet, half_edge: Ints, new: Ints) -> tuple[Ints, Ints]:
    """The cells (k, 3) before and behind new vertices (k,) on the half-edges of cells (k,)."""
    cell, side = np.divmod(half_edge, 3)
    a, b, c = (sheet.surface.F[cell, (side + j) % 3] for j in range(3))
    return np.stack([a, new, c], axis=1), np.stack([new, b, c], axis=1)


def _plump(sheet: Sheet, walls: Walls, new: Division) -> Bools:
    """(k,) whether the four cells at each new vertex have angles that are large enough."""
    surface = sheet.surface
    V, number = np.concatenate([surface.V, new.V]), surface.n + np.arange(len(new.wall))
    good = np.ones(len(new.wall), dtype=bool)
    for h in (walls.inside[new.wall], walls.outside[new.wall]):
        normals = surface.normals[h // 3]
        least = WORSE * np.minimum(SLIM, least_angles(surface.V[surface.F[h // 3]], normals))
        for F in _halves(sheet, h, number):
            good &= least_angles(V[F], normals) >= least
    return good


def _divided(sheet: Sheet, walls: Walls, new: Division) -> Sheet:
    """The sheet with new vertices behind its own, and the halves of cells one behind the other."""
    surface = sheet.surface
    number = surface.n + np.arange(len(new.wall))
    F, rows, came = surface.F.copy(), list[Ints](), list[Ints]()
    for h in (walls.inside[new.wall], walls.outside[new.wall]):
        first, second = _halves(sheet, h, number)
        F[h // 3] = first
        rows.append(second)
        came.append(h // 3)
    source = np.concatenate([np.arange(surface.m), *came])
    order = np.argsort(source, kind="stable")
    source = source[order]
    done = Surface(np.concatenate([surface.V, new.V]), np.concatenate([F, *rows])[order])
    weights = csr_array(vstack([sheet.weights, new.weights], format="csr"))
    return replace(sheet, surface=done, parent=sheet.parent[source], family=sheet.family[source], weights=weights)
