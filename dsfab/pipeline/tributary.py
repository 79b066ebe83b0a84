"""`Tributary`: which material carries what lies on a covering, face by face of the uncut surface.

    +-----+-----------------+-----+
    | rib |  <----   ---->  | rib |     each face gives its load to the nearest material along the surface
    +-----+-----------------+-----+

A face keeps what lies on it if it has material, else the load goes over the faces between to the nearest that has some
(tributary areas). Nearest is what is fewest metres away from middle to middle of neighbouring faces: a covering spans
openings, and not from one fold of a surface to another.

That keeps the resultant, but not the moment: a load on one side of a window would turn the structure. The covering of
an opening lies on its rim as a stiff plate does, so what moment M is lacking is added to the forces on the rim as to
the bolts of a group, each for the area w that it is nearest to, and in proportion to its distance from their middle:

    F_t + w_t theta x r_t,   sum w_t r_t = 0,   sum w_t r_t x (theta x r_t) = M.

That is done where no more is added, by magnitude, than lies on the opening. Elsewhere (a pane that hangs on one side
only) it would twist that rib; instead what moment is left, of such openings and of faces that are partly open, is
shared out in the same way over all material of that piece of the surface: coverings hold each other. So the moment of
all is kept to the last digit, unless the material is all on one line.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from dsfab.arrays import Bools, Floats, Ints, group_sums
from dsfab.errors import StaticsError
from dsfab.slicing import Sheet
from dsfab.surface import Surface, connected

BEARS = 0.02
"""Share of a face that has to be material for it to carry anything: a sliver is no bearing."""

ON_LINE = 1e-9
"""Bolts whose group is thinner than the root of this, of its length, are on a line: no arm takes a moment about it."""


@dataclass(frozen=True, eq=False)
class Tributary:
    """What the faces of an uncut surface (m,) give to what a sheet has of them.

    to      : (m,) the face that carries the covering of each; itself where it has material, -1 where none can.
    area    : (m,) m2 of material in each face.         place : (m, 3) the middle of it, metres.
    opening : (m,) the number of the opening that a face is part of, -1 for those that carry.
    """

    surface: Surface
    to: Ints
    area: Floats
    place: Floats
    opening: Ints

    @classmethod
    def of(cls, surface: Surface, sheet: Sheet) -> Self:
        """Of a sheet of the surface."""
        cells, m = sheet.surface, surface.m
        area: Floats = np.bincount(sheet.parent, cells.areas, m).astype(np.float64)
        first = group_sums(sheet.parent, cells.areas[:, None] * cells.centroids, m)
        bears = area > BEARS * surface.areas
        bears = bears if bears.any() else area > 0
        place = np.where(bears[:, None], first / np.where(area > 0, area, 1.0)[:, None], surface.centroids)
        f, g, _ = _steps(surface)
        inner = ~bears[f] & ~bears[g]
        _, part = connected(m, f[inner], g[inner])
        return cls(surface, nearest_faces(surface, bears), area, place, np.where(bears, -1, part))

    def forces(self, covered: Floats) -> Floats:
        """(m, 3) newtons on the material in each face, of tractions (m, 3), Pa, on the uncut surface.

        Raises StaticsError for a load on a piece of the surface that has no material.
        """
        load = covered * self.surface.areas[:, None]
        lost = np.flatnonzero((self.to < 0) & load.any(axis=1))
        if len(lost):
            place = ", ".join(f"{x:.3g}" for x in self.surface.centroids[lost[0]])
            raise StaticsError(
                f"what lies on the surface near ({place}) m is carried by nothing: no material is left of that piece "
                "of it; load other faces, or change a phase, a mode or pattern.rim"
            )
        force = self._by_opening(load)
        turning = np.cross(self.surface.centroids, load) - np.cross(self.place, force)
        count, piece = self.surface.pieces
        bears = np.flatnonzero(self.opening < 0)
        lacking = group_sums(piece, turning, count)
        force[bears] += _bolted(piece[bears], self.place[bears], self.area[bears], lacking)
        return force

    def _by_opening(self, load: Floats) -> Floats:
        """(m, 3) newtons, of loads (m, 3), with the moment of each opening where its rim takes that."""
        given = np.flatnonzero((self.opening >= 0) & (self.to >= 0))
        force = group_sums(self.to[self.to >= 0], load[self.to >= 0], len(load))
        # a face of the rim may carry several openings: of each it takes its own part
        pair, of = np.unique(np.stack([self.opening[given], self.to[given]]), axis=1, return_inverse=True)
        group, number = np.unique(pair[0], return_inverse=True)
        turning = np.cross(self.surface.centroids[given] - self.place[self.to[given]], load[given])
        moment, weight = (
            group_sums(number[of], turning, len(group)),
            np.bincount(of, self.surface.areas[given]).astype(np.float64),
        )
        added = _bolted(number, self.place[pair[1]], weight, moment)
        lies = np.bincount(number[of], np.linalg.norm(load[given], axis=1), len(group))
        far = np.bincount(number, np.linalg.norm(added, axis=1), len(group)) > lies
        added[far[number]] = 0.0
        np.add.at(force, pair[1], added)
        return force


def nearest_faces(surface: Surface, marked: Bools) -> Ints:
    """(m,) the marked face (m,) that is nearest along the surface, over the middles of faces and of edges between them;
    -1 where none can be reached."""
    f, g, length = _steps(surface)
    steps = coo_array((length, (f, g)), shape=(surface.m, surface.m)).tocsr()
    found = dijkstra(steps, directed=False, indices=np.flatnonzero(marked), min_only=True, return_predecessors=True)[2]
    return np.where(found < 0, -1, found).astype(np.int64)


def _steps(surface: Surface) -> tuple[Ints, Ints, Floats]:
    """Pairs of neighbouring faces (k,), and metres from middle to middle over the middle of their edge."""
    edges = surface.edges
    face, of = edges.order // 3, edges.of.ravel()[edges.order]
    same = np.flatnonzero(of[1:] == of[:-1])
    f, g, middle = face[same], face[same + 1], surface.V[edges.ends[of[same]]].mean(axis=1)
    reach = [np.linalg.norm(surface.centroids[x] - middle, axis=1) for x in (f, g)]
    return f, g, reach[0] + reach[1]


def _bolted(group: Ints, place: Floats, weight: Floats, moment: Floats) -> Floats:
    """(k, 3) newtons at places (k, 3) without a resultant that give each group (k,) its moment (g, 3), Nm, as bolts of
    these sizes (k,) take it. About a line that all places of a group are on nothing is given."""
    count = len(moment)
    total = np.bincount(group, weight, count)
    middle = group_sums(group, weight[:, None] * place, count) / np.where(total > 0, total, 1.0)[:, None]
    r = place - middle[group]
    inertia = np.zeros((count, 3, 3))
    each = (r * r).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
    np.add.at(inertia, group, weight[:, None, None] * each)
    theta = np.einsum("gij,gj->gi", np.linalg.pinv(inertia, rcond=ON_LINE, hermitian=True), moment)
    return np.asarray(weight[:, None] * np.cross(theta[group], r))
