"""What a smooth piece must be to be taken: OCCT's findings, gaps, its volume, and its distance from the mesh.

BRepCheck's word alone is not enough: it calls edges valid within whatever tolerance they have. And a valid solid may
be another one than the mesh: every piece is compared with the mesh of its own solid, from both sides.
"""

from dataclasses import dataclass, field
from functools import cached_property

import igl
import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.part import Part
from dsfab.export.shells import solids_of
from dsfab.export.smooth.ask import Finding
from dsfab.export.smooth.outline import Sheet
from dsfab.export.smooth.solid import Piece

GAP = 1 / 20
"""Widest gap between a skin and the edges on it, as a share of the thickness."""

DISTANCE = 1 / 20
"""Largest distance from the mesh unless asked otherwise, as a share of the thickness, beside its chord error."""

VOLUME = 5e-3
"""Largest change of a volume, beside what the smooth surface has more than the triangles between its points."""


@dataclass(frozen=True)
class Limits:
    """Millimetres: the thickness, how far the smooth solid may be off the mesh, and the mesh's own chord error on top.

    rounder : by what share the volume may be larger, since the mesh cuts its curves short.
    """

    thickness: float
    distance: float
    chord: float
    rounder: float

    @property
    def far(self) -> float:
        """The largest distance."""
        return self.distance + self.chord


@dataclass(frozen=True, eq=False)
class Verdict:
    """reason : why a piece is refused, '' when it is accepted.    bad : (k, 3) places where tighter curves may help.

    there, back : largest distance of the piece from the mesh and of the mesh from the piece.    volume : of the piece.
    """

    reason: str
    bad: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    there: float = 0.0
    back: float = 0.0
    volume: float = 0.0


@dataclass(frozen=True, eq=False)
class Gate:
    """Judges the pieces of a sheet against a part, millimetres."""

    part: Part
    sheet: Sheet
    limits: Limits

    @cached_property
    def solid(self) -> Ints:
        """The solid of the mesh that each piece is: that of the vertex nearest to one of its own."""
        shell, solids = self._shells
        first = self.sheet.F[np.unique(self.sheet.piece, return_index=True)[1], 0]
        nearest = cKDTree(self.part.V).query((self.sheet.V + self.sheet.D)[first])[1]
        at = np.full(len(self.part.V), -1)
        at[self.part.F] = shell[:, None]
        of = np.empty(int(shell.max()) + 1, dtype=np.int64)
        for i, some in enumerate(solids):
            of[some] = i
        return np.asarray(of[at[nearest]])

    @cached_property
    def _shells(self) -> tuple[Ints, list[list[int]]]:
        return solids_of(self.part)

    def mesh(self, solid: int) -> Ints:
        """(m, 3) the triangles of a solid."""
        shell, solids = self._shells
        return np.asarray(self.part.F[np.isin(shell, solids[solid])])

    def without(self, accepted: Bools) -> Ints:
        """(m, 3) the triangles of the solids none of whose pieces was accepted."""
        shell, solids = self._shells
        taken = set(self.solid[accepted].tolist())
        left = [shell for i, some in enumerate(solids) if i not in taken for shell in some]
        return np.asarray(self.part.F[np.isin(shell, left)])

    def verdicts(self, pieces: dict[int, Piece], found: dict[int, Finding]) -> dict[int, Verdict]:
        """About pieces by their numbers, with what OCCT says about those that it read."""
        away = self._distances({k: found[k] for k in pieces if k in found and found[k].tessellates})
        return {k: self._verdict(k, piece, found.get(k), away.get(k, [])) for k, piece in pieces.items()}

    def _verdict(self, k: int, piece: Piece, found: Finding | None, away: list[tuple[float, Floats]]) -> Verdict:
        if piece.refused or found is None:
            return Verdict(piece.refused or "OCCT did not read it within the time limit")
        limits, wanted, gap = self.limits, self.volumes[k], max(piece.gap, found.gap)
        (there, off), (back, missed) = away or [(0.0, np.zeros((0, 3)))] * 2
        sound = found.valid and found.closed
        near = max(there, back) <= limits.far
        tests = (
            (sound, "OCCT finds it invalid"),
            (found.faces == piece.faces, f"OCCT reads {found.faces} faces instead of {piece.faces}"),
            (found.tessellates, "OCCT makes no triangles of a face"),
            (gap <= GAP * limits.thickness, f"a gap of {gap:.2g} mm is wider than {GAP * limits.thickness:.2g} mm"),
            (near, f"it is {max(there, back):.2g} mm off the mesh, more than {limits.far:.2g} mm"),
            (
                abs(found.volume - wanted) <= (VOLUME + limits.rounder) * wanted,
                f"its volume is off by {found.volume / wanted - 1:.1%}",
            ),
        )
        reason = next((text for good, text in tests if not good), "")
        bad = found.bad if not sound else np.concatenate([off, missed])
        if sound and found.tessellates and near and gap <= GAP * limits.thickness:
            return Verdict(reason, bad[:0], there, back, found.volume)
        return Verdict(reason, bad if len(bad) else piece.ends, there, back, found.volume)

    @cached_property
    def volumes(self) -> Floats:
        """Millimetres cubed of the mesh solid of each piece: the sum over its faces of the prisms between the skins."""
        sheet = self.sheet
        low, high = ((sheet.V + side * sheet.D)[sheet.F] for side in (-1, 1))
        d = sheet.D[sheet.F]
        total = np.zeros(len(sheet.F))
        for s, weight in ((-np.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (np.sqrt(0.6), 5 / 9)):  # cubic in s: exact
            P = (low + high) / 2 + s * d
            cross = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
            total += weight * np.einsum("mi,mi->m", cross, d.mean(axis=1)) / 2
        return np.asarray(np.bincount(sheet.piece, total, sheet.count), dtype=np.float64)

    def _distances(self, found: dict[int, Finding]) -> dict[int, list[tuple[float, Floats]]]:
        """By piece, from it to the mesh and back: the largest distance, and the places that are too far off."""
        away = dict[int, list[tuple[float, Floats]]]()
        for solid in {int(self.solid[k]) for k in found}:
            mesh, these = self.mesh(solid), [k for k in found if self.solid[k] == solid]
            V = np.concatenate([found[k].V for k in these])
            start = np.cumsum([0, *(len(found[k].V) for k in these)])
            F = np.concatenate([found[k].F + i for k, i in zip(these, start, strict=False)])
            back = self._farthest(self.part.V, mesh, V, F)
            for k in these:
                away[k] = [self._farthest(found[k].V, found[k].F, self.part.V, mesh), back]
        return away

    def _farthest(self, V: Floats, F: Ints, V2: Floats, F2: Ints) -> tuple[float, Floats]:
        """Of the vertices and the middles of triangles, from the other triangles."""
        points = np.concatenate([V[np.unique(F)], V[F].mean(axis=1)])
        away = np.sqrt(np.asarray(igl.point_mesh_squared_distance(points, np.array(V2), np.array(F2))[0]))
        return float(away.max()), points[away > self.limits.far]
