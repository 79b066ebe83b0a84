"""Shape factors of snow and wind on roofs, by EN 1991-1-3 and EN 1991-1-4."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.pickers import Vector, unit_vector
from dsfab.surface.mesh import Surface

STEEP = 60.0  # degrees; steeper parts of a roof keep no snow [EN 1991-1-3:2003, 5.3.2 and 5.3.5]
LARGEST_MU3 = 2.0  # upper value of mu_3 [EN 1991-1-3:2003, 5.3.5, recommended value]
STRIPS = 100  # strips across a roof in which the length of its arc is summed


@dataclass(frozen=True, eq=False)
class RoofProfile:
    """Section through a roof along a horizontal direction; lengths in metres.
    roof  : (m,) mask of the faces that belong to the roof: picked faces that look upwards. Other faces have 0 below.
    place : (m,) position of each face along the direction, 0 at the first face and 1 at the last.
    arc   : (m,) the same position, measured along the arc of the roof.
    slope : (m,) slope of each face along the direction as rise / run, positive if the roof rises.
    depth : length of the roof in plan.    rise : height of the roof.
    halves : mean slopes before and behind the middle; an arch has a positive and a negative slope."""

    roof: Bools
    place: Floats
    arc: Floats
    slope: Floats
    depth: float
    rise: float
    halves: tuple[float, float]

    def require_arch(self, kind: str, shape: str) -> None:
        """Raise SurfaceError if the roof rises and falls along the direction by less than half of its height."""
        if (self.halves[0] - self.halves[1]) * self.depth < 2 * self.rise:
            raise SurfaceError(
                f"a load of kind '{kind}' with shape '{shape}': the roof is no arch along the load's direction, as the "
                "standard assumes; turn the direction across the roof, or use another shape"
            )

    @classmethod
    def of_pieces(
        cls, surface: Surface, faces: Bools, normals: Floats, direction: Vector, kind: str
    ) -> list["RoofProfile"]:
        """Return the profile of each connected piece with picked `faces` (m,) that look upwards.
        normals : (m, 3) to the outside.    kind : kind of the load, for messages.
        Raises SurfaceError for a vertical direction, and if no face looks upwards."""
        d = np.array(unit_vector(direction, f"a load of kind '{kind}'")) * (1.0, 1.0, 0.0)
        roof = faces & (normals[:, 2] > 1e-6)
        if not roof.any() or np.linalg.norm(d) < 1e-6:
            what = "its direction is vertical" if roof.any() else "no picked face looks upwards"
            raise SurfaceError(f"a load of kind '{kind}' with a shape of roofs: {what}; pick a roof, and give x and y")
        d /= np.linalg.norm(d)
        count, piece = surface.pieces
        parts = (roof & (piece == k) for k in range(count))
        return [cls._from_roof(surface, part, normals, d) for part in parts if part.any()]

    @classmethod
    def _from_roof(cls, surface: Surface, roof: Bools, normals: Floats, d: Floats) -> "RoofProfile":
        corners = surface.V[surface.F[roof]]
        start, end = (corners @ d).min(), (corners @ d).max()
        place = (surface.centroids[roof] @ d - start) / (end - start)
        slope = -(normals[roof] @ d) / normals[roof, 2]
        areas = surface.areas[roof]
        in_plan = areas / np.sqrt(1 + slope**2)
        halves = (in_plan * (place < 0.5), in_plan * (place >= 0.5))
        before, behind = (float(slope @ half / max(half.sum(), 1e-300)) for half in halves)
        on_faces = np.zeros((3, surface.m))
        on_faces[:, roof] = place, _along_arc(place, areas, in_plan), slope
        depth, rise = float(end - start), float(np.ptp(corners[..., 2]))
        return cls(roof, on_faces[0], on_faces[1], on_faces[2], depth, rise, (before, behind))


def _along_arc(place: Floats, areas: Floats, in_plan: Floats) -> Floats:
    """Return positions along the arc, 0 to 1. In each strip the arc is as much longer as its faces are larger."""
    strip = np.minimum((place * STRIPS).astype(int), STRIPS - 1)
    flat = np.bincount(strip, in_plan, STRIPS)
    longer = np.where(flat > 0, np.bincount(strip, areas, STRIPS) / np.maximum(flat, 1e-300), 1.0)
    length = np.concatenate([[0.0], np.cumsum(longer)])
    return np.asarray(np.interp(place * STRIPS, np.arange(STRIPS + 1), length) / length[-1])


def snow_shape_factor(slope: Floats) -> Floats:
    """Return the shape factor mu_1 (m,) of roofs by their slope (m,), degrees [EN 1991-1-3:2003, table 5.2].
    The factor is 0.8 up to 30 degrees, falls linearly up to 60 degrees, and is 0 on steeper roofs."""
    return np.asarray(0.8 * np.clip((STEEP - slope) / 30.0, 0.0, 1.0))


def half_cleared(profile: RoofProfile, slope: Floats) -> Floats:
    """Return mu_1 (m,) on parts that fall along the direction, and half of it elsewhere [EN 1991-1-3:2003, 5.3.3 (4)].
    slope : (m,) degrees of each face."""
    return np.where(profile.roof, np.where(profile.slope <= 0, 1.0, 0.5) * snow_shape_factor(slope), 0.0)


def drifted_on_arch(profile: RoofProfile, slope: Floats) -> Floats:
    """Return the factor (m,) of drifted snow on a cylindrical roof [EN 1991-1-3:2003, 5.3.5, figure 5.6, case (ii)].

    Snow lies where the slope (m,) is at most 60 degrees. On each half of this part the factor rises from 0 to its peak
    in the middle of the half, and falls to 0. The peak is mu_3 = 0.2 + 10 rise / depth, at most 2, on the half towards
    the direction, and mu_3 / 2 on the other half."""
    profile.require_arch("snow", "drifted")
    lies = (slope <= STEEP) & profile.roof
    if not lies.any():
        return np.zeros(len(slope))
    low, high = profile.place[lies].min(), profile.place[lies].max()
    along = (profile.place - low) / max(high - low, 1e-12)
    peak = min(0.2 + 10 * profile.rise / profile.depth, LARGEST_MU3)
    triangle = np.interp(along, [0.0, 0.25, 0.5, 0.75, 1.0], [0.0, peak / 2, 0.0, peak, 0.0])
    return np.where(lies, triangle, 0.0)


def vault_pressure(profile: RoofProfile, eaves: float) -> Floats:
    """Return the pressure coefficients c_pe,10 (m,) of a vault across the wind; suction is negative.

    The arc has four equal parts: zone A (first part), B (the two in the middle) and C (last). With f = rise / depth,
    A is 1.6 f on the ground, and 8/3 (f - 0.2) if the eaves are half of the depth or more above it, or -1.2 for f below
    0.2; B is -0.7 - f; C is -0.4. Between these heights A is linear [EN 1991-1-4:2005, 7.2.8, figure 7.11].
    eaves : height of the eaves above the ground, metres. Raises SurfaceError for f outside of the figure, 0.05 to 0.5;
    up to 0.55 counts as 0.5, because the edge of a mesh of half a circle is ragged."""
    profile.require_arch("wind", "vault")
    f, high = profile.rise / profile.depth, min(2 * eaves / profile.depth, 1.0)
    if not 0.05 <= f <= 0.55:
        raise SurfaceError(
            f"a load of kind 'wind' with shape 'vault': rise / depth is {f:.2f} along the wind; EN 1991-1-4, figure "
            "7.11 covers 0.05 to 0.5; turn the wind across the vault, or give coefficients without a shape"
        )
    f = min(f, 0.5)
    windward = (1 - high) * 1.6 * f + high * (8 / 3 * (f - 0.2) if f >= 0.2 else -1.2)
    zones = np.array([windward, -0.7 - f, -0.7 - f, -0.4])
    return np.where(profile.roof, zones[np.minimum((4 * profile.arc).astype(int), 3)], 0.0)


MONOPITCH = np.array(
    [(0, 5, 10, 15, 20, 25, 30), (0.2, 0.4, 0.5, 0.7, 0.8, 1.0, 1.2), (-0.5, -0.7, -0.9, -1.1, -1.3, -1.6, -1.8)]
)
"""Rows: slope (degrees), largest and smallest force coefficient of open canopies with one slope and nothing below them
[EN 1991-1-4:2005, table 7.6, phi = 0]."""
DUOPITCH = np.array(
    [
        (-20, -15, -10, -5, 5, 10, 15, 20, 25, 30),
        (0.7, 0.5, 0.4, 0.3, 0.3, 0.4, 0.4, 0.6, 0.7, 0.9),
        (-0.7, -0.6, -0.6, -0.5, -0.6, -0.7, -0.8, -0.9, -1.0, -1.0),
    ]
)
"""Rows: slope (degrees, negative for a trough), largest and smallest force coefficient of open canopies with two slopes
[EN 1991-1-4:2005, table 7.7, phi = 0]."""


def canopy_coefficients(profile: RoofProfile) -> tuple[float, float]:
    """Return the largest (downward) and smallest (upward) force coefficient of an open canopy.

    Half of the sum of the mean slopes before and behind the middle is the slope of a roof with one slope, half of their
    difference that of a roof with two slopes. The larger coefficient of both counts.
    Raises SurfaceError for slopes outside of the tables."""
    before, behind = profile.halves
    plane_slope = abs(float(np.degrees(np.arctan((before + behind) / 2))))
    ridge_slope = float(np.degrees(np.arctan((before - behind) / 2)))  # negative for a trough
    if plane_slope > 30.5 or not -20.5 <= ridge_slope <= 30.5:
        steep = plane_slope if plane_slope > 30.5 else ridge_slope
        raise SurfaceError(
            f"a load of kind 'wind' on an open canopy: its slope is {steep:.0f} degrees; EN 1991-1-4, 7.3 covers "
            "-20 (a trough) to 30; use shape 'vault', or give coefficients without a shape"
        )
    pairs = ((plane_slope, MONOPITCH), (ridge_slope, DUOPITCH))
    down, up = ([float(np.interp(angle, table[0], table[k])) for angle, table in pairs] for k in (1, 2))
    return max(down), min(up)
