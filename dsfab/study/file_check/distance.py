"""How far the solid in a file is from the design: from its sheet, and from the solid that was to be written."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.pipeline.design import Design
from dsfab.surface import Surface, nearest
from dsfab.thickening.offset import SHIFT

SKIN = 0.9
"""A face is one of the skins where its normal and the sheet's are parallel to this cosine; others are walls."""

UNITS_APART = 0.02
"""Boxes whose sizes differ by a unit's factor to this share are the same thing in another unit."""

MIXED_UP = {1e-3: "m", 1e-2: "dm", 1e-1: "cm", 25.4: "mm", 1e3: "mm", 1 / 25.4: "in", 1 / 304.8: "ft"}
"""What the numbers of a file were meant to be, by how many times too large the file, read in millimetres, is."""


@dataclass(frozen=True, eq=False)
class Distance:
    """Metres between a file's solid and a design; each with its place (3,).

    skin      : how far the skins are from lying half a thickness off the sheet, at most and on average (`skin_mean`).
                Thickness that the design itself took back in tight bends counts; feet and other extras have no part.
    to_design : from the file's surface to the design's solid, at most: what is too much or displaced.
    from_design : from the design's solid to the file's surface, at most: what is missing or displaced.
    scale     : diagonal of the file's box over that of the design.
    """

    skin: float
    skin_place: Floats
    skin_mean: float
    to_design: float
    to_place: Floats
    from_design: float
    from_place: Floats
    scale: float

    def __post_init__(self) -> None:
        for name in ("skin_place", "to_place", "from_place"):
            lock(self, name, np.float64, (3,))

    @property
    def largest(self) -> float:
        """Of both ways to the design's solid, metres."""
        return max(self.to_design, self.from_design)

    @property
    def meant_unit(self) -> str | None:
        """The unit that the file's numbers seem to be in, when the whole file is another unit's factor off."""
        close = (unit for factor, unit in MIXED_UP.items() if abs(self.scale / factor - 1) < UNITS_APART)
        return next(close, None)


def distance(V: Floats, F: Ints, design: Design) -> Distance:
    """Measured at vertices and centres of faces, on both sides. V (n, 3) metres, F (m, 3) of the file."""
    to, to_place = _farthest(V, F, design.solid.V, design.solid.F)
    back, back_place = _farthest(design.solid.V, design.solid.F, V, F)
    skin, place, mean = _off_the_sheet(V, F, design)
    scale = float(np.linalg.norm(np.ptp(V, axis=0)) / np.linalg.norm(np.ptp(design.solid.box, axis=0)))
    return Distance(skin, place, mean, to, to_place, back, back_place, scale)


def _farthest(V: Floats, F: Ints, onto_V: Floats, onto_F: Ints) -> tuple[float, Floats]:
    """The largest distance of vertices and centres of faces from another mesh, and where."""
    P = np.concatenate([V, V[F].mean(axis=1)])
    far = nearest(P, onto_V, onto_F).distance
    k = int(far.argmax())
    return float(far[k]), P[k]


def _off_the_sheet(V: Floats, F: Ints, design: Design) -> tuple[float, Floats, float]:
    """Largest and, by area, mean difference of the skins from where they should run; 0 where there is no skin."""
    sheet: Surface = design.sheet.surface
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    twice = np.linalg.norm(cross, axis=1)
    P = V[F].mean(axis=1)
    close = nearest(P, sheet.V, sheet.F)
    far, face = close.distance, close.simplex
    along = np.abs(np.einsum("mi,mi->m", cross, sheet.normals[face]))
    skin = (twice > 0) & (along > SKIN * twice)
    half = design.preset.statics.thickness / 2
    shift = abs(SHIFT[design.preset.thickening.side])
    meant = np.array([half * (1 - shift), half * (1 + shift)])
    off = np.abs(far[:, None] - meant).min(axis=1)
    if not skin.any():
        return 0.0, np.zeros(3), 0.0
    k = int(np.where(skin, off, -1).argmax())
    return float(off[k]), P[k], float((off * twice)[skin].sum() / twice[skin].sum())
