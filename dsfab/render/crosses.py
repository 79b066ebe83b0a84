"""Principal directions as short crosses on the surface: tension in one colour, compression in another.

Of stresses that are combined of several cases, which have no sign: the first direction in one, the second in another.
"""

from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import DsfabError
from dsfab.render.marks import Mesh, Spacing, thinned
from dsfab.render.palette import Palette
from dsfab.render.scene import Body

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design

CROSSES = Spacing(0.034, 500)
"""How crosses are thinned; their number bounds the time."""

LONG, WIDE = 0.8, 0.09
"""Length and width of a bar, as shares of the distance between neighbouring crosses."""


def crosses(design: "Design", palette: Palette) -> Body:
    """Bars along the two directions that diffusion follows, at places evenly apart; none where neither is preferred.

    Raises DsfabError where no direction is preferred anywhere: at r = 1, or without a stress.
    """
    surface, tensors, r = design.surface, design.diffusion.tensors, design.preset.diffusion.r
    if r <= 1 or tensors.isotropic.all():
        why = f"r = {r:g}" if r <= 1 else "the stress is the same in all directions"
        raise DsfabError(f"there are no directions to show: {why}, so that diffusion prefers none")
    at = thinned(surface.centroids, surface.size, CROSSES)
    apart = float(np.sqrt(1.3 * surface.area / len(at)))  # of places that are evenly spread
    at = at[~tensors.isotropic[at]]
    along = np.linalg.eigh(tensors.major[at])[1][:, :, 2]  # r along the first direction, 1 and 0 across
    normal = surface.normals[at]
    both = np.concatenate([along, np.cross(normal, along)])
    vertices, faces = _bars(np.tile(surface.centroids[at], (2, 1)), both, np.tile(normal, (2, 1)), apart)
    if design.preset.combines:  # sizes of the stress in several cases: they pull in one and push in another
        red = (np.arange(2 * len(at)) < len(at))[:, None]
        colour = np.where(red, *(np.array(tint, dtype=np.uint8) for tint in palette.tints[:2]))
    else:
        pulled = tensors.principal[at].T.reshape(-1, 1) > 0
        colour = np.where(pulled, palette.of("tension"), palette.of("compression"))
    return Body(vertices, faces, np.repeat(colour, len(_BOX), axis=0))


def _bars(middle: Floats, along: Floats, normal: Floats, apart: float) -> Mesh:
    """Boxes around `middle` (k, 3), seen from both sides of the surface."""
    across = np.cross(normal, along)
    half = apart / 2 * np.array([LONG, WIDE, WIDE])
    frame = np.stack([along, across, normal], axis=1) * half[:, None]
    corners = np.einsum("ci,kij->kcj", _CORNERS, frame) + middle[:, None]
    faces = _BOX[None] + (len(_CORNERS) * np.arange(len(middle)))[:, None, None]
    return corners.reshape(-1, 3), faces.reshape(-1, 3)


_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX = np.array([
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
    (1, 5, 7), (1, 7, 3),
])  # fmt: skip
