"""How far the solid in a file is from the design: from its sheet, and from the solid that was to be written."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.delivery import curved_design
from dsfab.errors import ExportError
from dsfab.export import Limits, smooth_limits
from dsfab.limits import DEFLECTION, FURTHER, OFF_SURFACE
from dsfab.pipeline.design import Design
from dsfab.preset import Preset
from dsfab.study.file_check.reading import FileContents
from dsfab.surface import Surface, nearest
from dsfab.thickening.offset import SHIFT
from dsfab.units import MM_PER_M

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
    beyond    : the largest of both beyond what is allowed there, below 0 where all is within.
    allowed   : at the place of `beyond`.
    scale     : diagonal of the file's box over that of the design.
    """

    skin: float
    skin_place: Floats
    skin_mean: float
    to_design: float
    to_place: Floats
    from_design: float
    from_place: Floats
    beyond: float
    allowed: float
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


@dataclass(frozen=True, eq=False)
class Allowance:
    """How far a file's solid may be off a design's, as a build has it.

    flat   : metres, everywhere.     limits : of the smooth solid; None where the file has no curved faces.
    """

    flat: float
    limits: Limits | None = None

    @classmethod
    def of(cls, found: FileContents, design: Design) -> "Allowance":
        """For a file: triangles of STL and 3MF are exact; planar faces of STEP may be simplified, curved ones may be
        off by the mesh's own chord error, and their triangles, here, by their deflection."""
        flat, asked = off_surface(design.preset), design.preset.export.step_tolerance
        if found.reader != "OCCT":
            return cls(OFF_SURFACE * design.preset.statics.thickness)
        if not found.deflection:
            return cls(asked or FURTHER * flat)
        try:
            curved = curved_design(design)  # of a surface that may have been cut open
            limits = smooth_limits(Surface(curved.V, curved.F), curved, MM_PER_M * asked)
        except ExportError:  # nothing but planes is made of it
            limits = None
        return cls(flat + found.deflection, limits)

    def at(self, points: Floats) -> Floats:
        """(k,) metres, at points (k, 3)."""
        flat = np.full(len(points), self.flat)
        if self.limits is None:
            return flat
        chord = self.limits.chord[self.limits.nearest(MM_PER_M * points)] / MM_PER_M
        return np.asarray(flat + chord)


def off_surface(preset: Preset) -> float:
    """Metres that curves of a file may be off a design, beside the mesh's own chord error."""
    return preset.export.step_tolerance or OFF_SURFACE * preset.statics.thickness


def deflection_for(preset: Preset) -> float:
    """Metres that triangles of a file's curved faces may be off them, to compare it with a design."""
    return DEFLECTION * off_surface(preset)


def distance(found: FileContents, design: Design) -> Distance:
    """Measured at vertices and centres of faces, on both sides."""
    V, F, allowed = found.V, found.F, Allowance.of(found, design)
    to, to_place, to_excess = _farthest(V, F, design.solid.V, design.solid.F, allowed)
    back, back_place, back_excess = _farthest(design.solid.V, design.solid.F, V, F, allowed)
    skin, place, mean = _off_the_sheet(V, F, design)
    scale = float(np.linalg.norm(np.ptp(V, axis=0)) / np.linalg.norm(np.ptp(design.solid.box, axis=0)))
    return Distance(skin, place, mean, to, to_place, back, back_place, *max(to_excess, back_excess), scale)


def _farthest(
    V: Floats, F: Ints, onto_V: Floats, onto_F: Ints, allowed: Allowance
) -> tuple[float, Floats, tuple[float, float]]:
    """The largest distance of vertices and centres of faces from another mesh, and where; the largest excess over what
    is allowed, and what that is there."""
    P = np.concatenate([V, V[F].mean(axis=1)])
    far = nearest(P, onto_V, onto_F).distance
    k = int(far.argmax())
    some = np.flatnonzero(far > allowed.flat)  # chord errors of the others need not be asked for
    some = some if len(some) else np.array([k])
    most = allowed.at(P[some])
    worst = int((far[some] - most).argmax())
    return float(far[k]), P[k], (float(far[some][worst] - most[worst]), float(most[worst]))


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
