"""Points of the skins inside of regions, near which the surfaces of trimmed faces have to be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Bools, Floats, Ints
from dsfab.export.network.graph import ChainNet
from dsfab.export.network.lifting import Lifting
from dsfab.export.smooth.source import StripedSheet

INNER = ((1 / 3, 1 / 3, 1 / 3), (2 / 3, 1 / 6, 1 / 6), (1 / 6, 2 / 3, 1 / 6), (1 / 6, 1 / 6, 2 / 3))
"""Barycentric weights of the points where a trimmed face is held in each cell: with the middle alone it may wave."""

MORE = tuple((a / 7, b / 7, 1 - (a + b) / 7) for a in range(1, 6) for b in range(1, 7 - a))
"""Of more points in cells that are longer than the sheet is thick: between four of them a surface of degree 9 waved by
6 mm, in triangles of 180 mm of a canopy of 100 mm."""

OF_REGION = 1 / 6
"""Share of its region's size that a shorter cell is long from, too: in a notched region of 200 mm of a sheet of 60 mm
one of degree 9 waved by 4 mm between the points of cells of 50 mm."""


@dataclass(frozen=True, eq=False)
class Interior:
    """Where it is asked for.    fine : whether long cells have `MORE` points."""

    sheet: StripedSheet
    lifting: Lifting
    thickness: float
    fine: bool = False

    def points(self, net: ChainNet, regions: Sequence[int]) -> dict[int, Floats]:
        """By region, (k, 6) points of the skins over its cells; all are found at once."""
        if not regions:
            return {}
        cells = [np.flatnonzero(net.cell == net.parent.get(region, region)) for region in regions]
        F: Ints = self.sheet.F[np.concatenate(cells)]
        of = np.repeat(np.arange(len(regions)), [len(some) for some in cells])
        found, region = [self._lifted(F, INNER)], [np.tile(of, len(INNER))]
        if self.fine and (long := self._are_long(F, self._sizes(net, regions)[of])).any():
            found.append(self._lifted(F[long], MORE))
            region.append(np.tile(of[long], len(MORE)))
        order = np.argsort(np.concatenate(region), kind="stable")
        ends = np.cumsum(np.bincount(np.concatenate(region), minlength=len(regions)))[:-1]
        return dict(zip(regions, np.split(np.concatenate(found)[order], ends), strict=True))

    def _lifted(self, F: Ints, weights: Sequence[tuple[float, float, float]]) -> Floats:
        """(k m, 6) points at each of k weights of cells (m, 3)."""
        a, b, c = (self.sheet.weights[F[:, i]] for i in range(3))
        return self.lifting.points(csr_array(vstack([a * u + b * v + c * w for u, v, w in weights], format="csr")))

    def _are_long(self, F: Ints, size: Floats) -> Bools:
        """(m,) whether a side of cells (m, 3) is longer than the sheet is thick, or for its region's size (m,)."""
        P = self._on_mesh(self.sheet.weights)[F]
        long = np.linalg.norm(P - np.roll(P, 1, axis=1), axis=2).max(axis=1)
        return np.asarray(long > np.minimum(self.thickness, OF_REGION * size))

    def _sizes(self, net: ChainNet, regions: Sequence[int]) -> Floats:
        """(r,) diagonals of boxes around the outlines of regions, millimetres."""
        P = self._on_mesh(net.weights)
        outlines = ([net.chains[k].points for loop in net.loops[region] for k, _ in loop] for region in regions)
        return np.array([np.linalg.norm(np.ptp(P[np.concatenate(line)], axis=0)) for line in outlines])

    def _on_mesh(self, weights: csr_array) -> Floats:
        """(k, 3) millimetres, places of weights (k, n)."""
        return np.asarray(weights @ self.lifting.skins.points)
