"""What a smooth piece must be to be taken: OCCT's findings, gaps, its volume, and its distance from the mesh.

BRepCheck's word alone is not enough: it calls edges valid within whatever tolerance they have. And a valid solid may
be another one than the mesh: every piece is compared with the mesh of its own solid, from both sides.
"""

from collections.abc import Container
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.export.part import Part
from dsfab.export.shells import solids_of
from dsfab.export.smooth.dense import prisms
from dsfab.export.smooth.limits import Limits
from dsfab.export.smooth.occt_check import OcctFinding
from dsfab.export.smooth.outline import SheetOutline
from dsfab.export.smooth.solid import SmoothPiece
from dsfab.export.smooth.touching import crossings
from dsfab.limits import CHANGED_VOLUME
from dsfab.surface import nearest
from dsfab.surface.neighbours import corners_of

GAP = 1 / 20
"""Widest gap between a skin and the edges on it, as a share of the thickness."""

NEAR = 1 / 2
"""Share of the distance that is allowed under which points are near, whatever else is allowed there."""


@dataclass(frozen=True, eq=False)
class Acceptance:
    """reason : why a piece is refused, '' when it is accepted.    bad : (k, 3) places where tighter curves may help.

    there, back : largest distance of the piece from the mesh and of the mesh from the piece.    volume : of the piece.
    """

    reason: str
    bad: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    there: float = 0.0
    back: float = 0.0
    volume: float = 0.0


class Away(NamedTuple):
    """Distances between a piece and the mesh, one way: the largest, the largest excess over what is allowed with the
    distance and the allowance there, and the places that are too far off."""

    most: float
    worst: float
    allowed: float
    bad: Floats


_NOWHERE = Away(0.0, 0.0, 0.0, np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Solids:
    """The solids of a part's mesh, millimetres."""

    part: Part

    @cached_property
    def _shells(self) -> tuple[Ints, list[list[int]]]:
        return solids_of(self.part)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.part.V)

    def away(self, points: Floats) -> Floats:
        """(k,) distances of points (k, 3) from all triangles."""
        P, V, F = (np.ascontiguousarray(x) for x in (points, self.part.V, self.part.F))
        return np.asarray(np.sqrt(self._triangles.squared_distance(V, F, P)[0]))

    @cached_property
    def _triangles(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(np.ascontiguousarray(self.part.V), np.ascontiguousarray(self.part.F))
        return tree

    def at(self, points: Floats) -> Ints:
        """(k,) the solids of the vertices nearest to points."""
        shell, solids = self._shells
        at = np.full(len(self.part.V), -1)
        at[self.part.F] = shell[:, None]
        of = np.empty(int(shell.max()) + 1, dtype=np.int64)
        for i, some in enumerate(solids):
            of[some] = i
        return np.asarray(of[at[self._tree.query(points)[1]]])

    def faces(self, chosen: Container[int]) -> Ints:
        """(m, 3) the triangles of some solids."""
        shell, solids = self._shells
        shells = [k for i, some in enumerate(solids) if i in chosen for k in some]
        return np.asarray(self.part.F[np.isin(shell, shells)])

    @property
    def count(self) -> int:
        """Number of solids."""
        return len(self._shells[1])


@dataclass(frozen=True, eq=False)
class Gate:
    """Judges the pieces of a sheet against the solids of a part, millimetres."""

    solids: Solids
    sheet: SheetOutline
    limits: Limits

    @cached_property
    def solid(self) -> Ints:
        """(p,) the solid of the mesh that each piece is: that of the vertex nearest to one of its own."""
        first = self.sheet.F[np.unique(self.sheet.piece, return_index=True)[1], 0]
        return self.solids.at((self.sheet.V + self.sheet.D)[first])

    def without(self, done: set[int]) -> Ints:
        """(m, 3) the triangles of all other solids."""
        return self.solids.faces(set(range(self.solids.count)) - done)

    def verdicts(self, pieces: dict[int, SmoothPiece], found: dict[int, OcctFinding]) -> dict[int, Acceptance]:
        """About pieces by their numbers, with what OCCT says about those that it read."""
        away = self._distances({k: found[k] for k in pieces if k in found and found[k].tessellates})
        return {
            k: self._verdict(k, piece, found.get(k), away.get(k, (_NOWHERE, _NOWHERE))) for k, piece in pieces.items()
        }

    def _verdict(self, k: int, piece: SmoothPiece, found: OcctFinding | None, away: tuple[Away, Away]) -> Acceptance:
        if piece.refused or found is None:
            return Acceptance(piece.refused or "OCCT did not read it within the time limit")
        limits, wanted, gap = self.limits, self.volumes[k], max(piece.gap, found.gap)
        there, back = away
        far = max(away, key=lambda way: way.worst - way.allowed)
        sound = found.valid and found.closed
        near = far.worst <= far.allowed
        tests = (
            (sound, "OCCT finds it invalid"),
            (found.faces == piece.faces, f"OCCT reads {found.faces} faces instead of {piece.faces}"),
            (found.tessellates, "OCCT makes no triangles of a face"),
            (gap <= GAP * limits.thickness, f"a gap of {gap:.3g} mm is wider than {GAP * limits.thickness:.3g} mm"),
            (near, f"it is {far.worst:.2g} mm off the mesh, more than {far.allowed:.2g} mm"),
            (
                abs(found.volume - wanted) <= (CHANGED_VOLUME + self.rounder[k]) * wanted,
                f"its volume is off by {found.volume / wanted - 1:.1%}",
            ),
        )
        reason = next((text for good, text in tests if not good), "")
        bad = np.concatenate([there.bad, back.bad])
        if not (sound and found.tessellates):
            bad = found.bad if len(found.bad) else crossings(piece)
        if sound and found.tessellates and near and gap <= GAP * limits.thickness:
            bad = bad[:0]
        elif not len(bad):
            bad = piece.ends
        return Acceptance(reason, bad, there.most, back.most, found.volume)

    @cached_property
    def volumes(self) -> Floats:
        """(p,) millimetres cubed of the mesh solid of each piece: the sum over its faces of the prisms between the
        skins."""
        return self._sum(np.ones(len(self.sheet.F)))

    @cached_property
    def rounder(self) -> Floats:
        """(p,) by what share the volume of each piece may be larger, since the mesh cuts its curves short."""
        sheet = self.sheet
        upper = (sheet.V + sheet.D)[sheet.F].mean(axis=1)  # on a skin, whose triangles are found in half the time
        share = self.limits.rounder[self.limits.nearest(upper)]
        return np.maximum(self._sum(share) / self.volumes, 0.0)

    def _sum(self, share: Floats) -> Floats:
        """By piece, of a share of the volume over each face."""
        sheet = self.sheet
        of = share * prisms(sheet.V, sheet.D, sheet.F)
        return np.asarray(np.bincount(sheet.piece, of, sheet.count), dtype=np.float64)

    def _distances(self, found: dict[int, OcctFinding]) -> dict[int, tuple[Away, Away]]:
        """By piece, from it to the mesh, and back."""
        away = dict[int, tuple[Away, Away]]()
        points = self.solids.part.V
        for solid in {int(self.solid[k]) for k in found}:
            mesh, these = self.solids.faces({solid}), [k for k in found if self.solid[k] == solid]
            V = np.concatenate([found[k].V for k in these])
            start = np.cumsum([0, *(len(found[k].V) for k in these)])
            F = np.concatenate([found[k].F + i for k, i in zip(these, start, strict=False)])
            back = self._farthest(points, mesh, V, F)
            for k in these:
                away[k] = (self._farthest(found[k].V, found[k].F, points, mesh), back)
        return away

    def distances(self, V: Floats, F: Ints) -> tuple[Away, Away]:
        """Of the triangles V (n, 3), F (m, 3) of all solids from those of the part, and back."""
        part = self.solids.part
        return self._farthest(V, F, part.V, part.F), self._farthest(part.V, part.F, V, F)

    def beyond(self, points: Floats) -> Floats:
        """(k,) how much farther points (k, 3) are from the mesh than they may be, less than 0 where they are nearer."""
        away = self.solids.away(points)
        far = away > NEAR * self.limits.distance  # the others need not be asked
        away[far] -= self.limits.allowed(points[far])
        away[~far] -= self.limits.distance
        return away

    def _farthest(self, V: Floats, F: Ints, V2: Floats, F2: Ints) -> Away:
        """Of the vertices and the middles of triangles, from the other triangles."""
        corners = corners_of(F, np.ones(len(F), dtype=bool), len(V))
        points = np.concatenate([V[corners], V[F].mean(axis=1)])
        away = nearest(points, V2, F2).distance
        far = points[away > self.limits.distance]  # the others need not be asked
        if not len(far):
            return Away(float(away.max()), float(away.max()), self.limits.distance, far)
        most, allowed = away[away > self.limits.distance], self.limits.allowed(far)
        k = int((most - allowed).argmax())
        return Away(float(away.max()), float(most[k]), float(allowed[k]), far[most > allowed])
