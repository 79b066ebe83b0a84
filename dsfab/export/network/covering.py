"""The patches of regions with four sides, made once for the curves around each, and whether they are good."""

from collections.abc import Callable, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.parabolas import lowered_patches
from dsfab.export.network.patches import coons, least_jacobian, pulled
from dsfab.export.network.straying import FaceLimits
from dsfab.export.splines import bernstein

FOLDED = 0.1
"""Least relative Jacobian of a patch: one that is less is trimmed instead."""

ASKED = np.linspace(0, 1, 7)
"""Where a patch is asked how far it is off the mesh, in both directions."""


class Covering:
    """Makes the patches of regions. A net is changed some times, each time in a few places: regions with the curves
    that they had have the patches that they had.

    away : the ways (k, 6) to both skins from points there.    limits : of patches, with `off` what they may be off the
    skins in their middles.
    """

    def __init__(self, away: Callable[[Floats], Floats], limits: FaceLimits) -> None:
        self.away, self.limits = away, limits
        self.known = dict[int, tuple[list[bytes], Floats | None]]()

    def __call__(self, regions: Sequence[int], sides: Sequence[Sequence[Floats]]) -> list[Floats | None]:
        """(ku, kv, 4, 4, 6) poles for each region, or none where its patches are folded or too far off; sides : for
        each, bottom, right, top and left as `coons` takes them."""
        poles = [[side.tobytes() for side in four] for four in sides]
        new = [i for i, (r, now) in enumerate(zip(regions, poles, strict=True)) if self.known.get(r, ((),))[0] != now]
        for i, P in zip(new, self._made([sides[i] for i in new]), strict=True):
            self.known[regions[i]] = poles[i], P
        return [self.known[region][1] for region in regions]

    def _made(self, sides: Sequence[Sequence[Floats]]) -> list[Floats | None]:
        """The same for regions that are new."""
        if not sides:
            return []
        patches = [lowered_patches(P, self.limits.off) for P in pulled([coons(*four) for four in sides], self.away)]
        far = (_strays(patches, self.away) > self.limits.off) | (_beyond_mesh(patches, self.limits) > 0)
        return [None if is_far or _folded(P) else P for P, is_far in zip(patches, far, strict=True)]


def _folded(P: Floats) -> bool:
    """Whether one of the patches of a region is, on either skin."""
    return least_jacobian(np.concatenate([P[..., :3], P[..., 3:]])) < FOLDED


def _strays(patches: Sequence[Floats], away: Callable[[Floats], Floats]) -> Floats:
    """(k,) how far patches (ku, kv, 4, 4, 6) of regions are off the skins in the middles of their cells, at most: on a
    coarse mesh these wave, and splines from border to border pass by."""
    if not patches:
        return np.zeros(0)
    half = bernstein(np.array([0.5]))[0]
    middles = [np.einsum("a,b,uvabi->uvi", half, half, P).reshape(-1, 6) for P in patches]
    off = np.linalg.norm(away(np.concatenate(middles)).reshape(-1, 2, 3), axis=2).max(axis=1)
    return np.array([some.max() for some in np.split(off, np.cumsum([len(some) for some in middles])[:-1])])


def _beyond_mesh(patches: Sequence[Floats], limits: FaceLimits) -> Floats:
    """(k,) how much farther patches (ku, kv, 4, 4, 6) of regions are from the mesh than they may be, if that is asked:
    beside a crease one was on the skins in its middle, and 1.4 mm off where 1.1 are allowed."""
    if not patches or limits.beyond_mesh is None:
        return np.full(len(patches), -np.inf)
    poles, ends = [P.reshape(-1, 4, 4, 6) for P in patches], np.cumsum([P.shape[0] * P.shape[1] for P in patches])
    points = np.einsum("xa,yb,kabi->kxyi", bernstein(ASKED), bernstein(ASKED), np.concatenate(poles))
    beyond = limits.beyond_mesh(points.reshape(-1, 3)).reshape(len(points), -1).max(axis=1)
    return np.array([some.max() for some in np.split(beyond, ends[:-1])])
