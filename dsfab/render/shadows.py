"""Shadow maps: what lamps far away see first, and which points they light (Williams 1978)."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dsfab.arrays import Floats
from dsfab.render.scene import LAMP_AWAY, LAMP_DEPTHS, Floats32, Scene

GRAIN = 1.2
"""A map is sampled at random places so many of its pixels around a point: its steps become a grain that the eye
averages."""

LIFT = 2.5
"""Points are asked about so many shares of a map's side above their surface, in radii: on the surface itself the map's
pixels, which are steps, would throw shadows."""

BEFORE_NOTHING = np.float32(0.9999)
"""Nothing has depth 1; whatever a map shows lies before this."""

_DEEP = LAMP_DEPTHS[1] - LAMP_DEPTHS[0]


def frame_towards(towards: Floats) -> Floats:
    """Rows: two unit vectors across and the unit vector `towards` (3,) itself."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


@dataclass(frozen=True, eq=False)
class ShadowMaps:
    """The maps of some lamps, asked together: one by one the products of vectors would take most of the time.

    maps    : (b, s, s) depth that each sees, see `Scene.lamp`.
    placing : (3 b, 6) from a point, its grain and 1 to columns and rows of the maps, and to depths as far as which
              nothing may be seen.
    towards : (b, 3) unit vectors times the strengths of the lamps.
    """

    maps: Floats32
    placing: Floats32
    towards: Floats32

    @classmethod
    def drawn(cls, scene: Scene, towards: Floats, strength: Floats, side: int) -> Self:
        """Those of lamps in directions (b, 3), with strengths (b,); inside `scene.lamps()`."""
        frames = np.stack([frame_towards(one) for one in towards])
        maps = np.empty((len(frames), side, side), dtype=np.float32)
        for into, frame in zip(maps, frames, strict=True):
            into[:] = scene.lamp(frame, side)
        placing = np.zeros((3, len(frames), 6))
        placing[:2, :, :3] = frames.swapaxes(0, 1)[:2] * (side / 2)
        placing[:2, :, 5] = side / 2
        placing[0, :, 3] = placing[1, :, 4] = 1.0
        placing[2, :, :3] = -frames[:, 2] / _DEEP
        placing[2, :, 5] = (LAMP_AWAY - LAMP_DEPTHS[0] - LIFT / side) / _DEEP
        weighed = towards * strength[:, None]
        return cls(maps, placing.reshape(-1, 6).astype(np.float32), weighed.astype(np.float32))

    def light(self, points: Floats32, normals: Floats32, grain: Floats32) -> Floats32:
        """(k,) light of these lamps on points that face along `normals`, both (3, k), radii; grain (2, k or more)."""
        count, side = self.maps.shape[:2]
        asked = np.ones((6, points.shape[1]), dtype=np.float32)
        np.add(points, np.float32(LIFT / side) * normals, out=asked[:3])
        asked[3:5] = grain[:, : points.shape[1]]
        # what no map holds is lit: the ground far out, and marks that stand aside
        reach = np.einsum("ik,ik->k", asked[:3], asked[:3]).max()
        far = reach >= (1 - 2 * (GRAIN + 1) / side) ** 2
        column, row, depth = (self.placing @ asked).reshape(3, count, -1)
        i, j = column.astype(np.int32), row.astype(np.int32)
        outside = None
        if far:
            outside = (i < 0) | (j < 0) | (i >= side) | (j >= side)
            np.minimum(depth, BEFORE_NOTHING, out=depth)
        j *= np.int32(side)
        j += i
        j += np.arange(0, count * side * side, side * side, dtype=np.int32)[:, None]
        seen = self.maps.ravel().take(j, mode="clip") > depth
        if outside is not None:
            seen |= outside
        light = self.towards @ normals
        np.maximum(light, 0, out=light)
        light *= seen
        return np.asarray(light.sum(axis=0))
