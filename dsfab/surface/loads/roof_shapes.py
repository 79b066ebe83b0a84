"""Shape factors of snow and wind on roofs, by EN 1991-1-3 and EN 1991-1-4."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.pickers import Vector, unit_vector
from dsfab.surface.mesh import Surface

STEEP = 60.0  # degrees; steeper parts of a roof keep no snow [EN 1991-1-3:2003, 5.3.2 and 5.3.5]
LARGEST_MU3 = 2.0  # upper value of mu_3 [EN 1991-1-3:2003, 5.3.5, recommended value]
ROOF_RISE = 0.5  # An open piece is a roof if its mean normal's vertical part is above this: slopes under 60 degrees.
ARCH_FIT = 0.85  # least `fit` of an arch: 1 for a circle, 0.94 for two slopes on each side, 0.75 for a gable roof
LEVEL = 0.02  # slopes (rise / run) up to this count as level: coordinates and directions are rounded
STRIPS = 100  # strips across a roof in which the length of its arc is summed


@dataclass(frozen=True, eq=False)
class RoofProfile:
    """Section through a connected roof along a horizontal direction; lengths in metres.
    roof   : (m,) mask of the roof's faces. Other faces have 0 below.
    place  : (m,) position of each face along the direction, 0 at the first face and 1 at the last.
    front  : (m,) mask of the first half of the plan area.
    aside  : (m,) position of each face across the direction, 0 to 1.
    arc    : (m,) position along the direction, measured along the arc of the roof.
    slope  : (m,) slope of each face along the direction as rise / run, positive if the roof rises.
    depth  : length of the roof in plan.    width : length across the direction.
    rise   : height of the section; an axis across the direction may slope.
    halves : mean slopes before and behind the middle; an arch has a positive and a negative slope.
    fit    : share of the variance of sin(slope angle) that a straight line over `place` explains, negative if the line
             rises; 1 for an arch of a circle.
    tilt   : slope of the mean plane.
    uneven : mean distance of the faces' slopes from the slope of the mean plane, in all directions."""

    roof: Bools
    place: Floats
    front: Bools
    aside: Floats
    arc: Floats
    slope: Floats
    depth: float
    width: float
    rise: float
    halves: tuple[float, float]
    fit: float
    tilt: float
    uneven: float

    def require_arch(self, kind: str, shape: str) -> None:
        """Raise SurfaceError for a roof that rises and falls along the direction by less than half of its height, and
        for a roof with a slope that does not decrease evenly, such as a gable."""
        ridge = self.halves[0] - self.halves[1]
        if ridge * self.depth < 2 * self.rise or self.fit < ARCH_FIT:
            raise SurfaceError(
                f"a load of kind '{kind}' with shape '{shape}': the roof is no arch along the load's direction, as the "
                "standard assumes; turn the direction across the roof, or use another shape"
            )

    @classmethod
    def of_roofs(
        cls, surface: Surface, faces: Bools, normals: Floats, direction: Vector, kind: str
    ) -> list["RoofProfile"]:
        """Return the profile of each roof with picked `faces` (m,), see `roofs`.
        normals : (m, 3) to the outside.    kind : kind of the load, for messages.
        Raises SurfaceError for a direction that is not horizontal, and if no picked face belongs to a roof."""
        d = np.array(unit_vector(direction, f"a load of kind '{kind}'"))
        parts = roofs(surface, faces, normals)
        if abs(d[2]) > 1e-6 or not parts:
            what = "no picked face looks upwards" if abs(d[2]) <= 1e-6 else "its direction is not horizontal"
            raise SurfaceError(
                f"a load of kind '{kind}' with a shape of roofs: {what}; pick a roof, and give a direction [x, y, 0]"
            )
        return [cls.of_roof(surface, part, normals, d) for part in parts]

    @classmethod
    def all_around(cls, surface: Surface, roof: Bools, normals: Floats) -> list["RoofProfile"]:
        """Return profiles of a roof (m,) in `DIRECTIONS` directions; the first is the axis of the largest slopes."""
        n = normals[roof, :2]
        x, y = np.linalg.eigh((n * surface.areas[roof][:, None]).T @ n)[1][:, -1]
        turns = np.arctan2(y, x) + np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        axes = (np.array([np.cos(turn), np.sin(turn), 0.0]) for turn in turns)
        return [cls.of_roof(surface, roof, normals, axis) for axis in axes]

    @classmethod
    def of_roof(cls, surface: Surface, roof: Bools, normals: Floats, d: Floats) -> "RoofProfile":
        """Return the profile of a roof (m,) along the horizontal unit vector d (3,)."""
        across = np.array([-d[1], d[0], 0.0])
        corners = surface.V[surface.F[roof]]
        slope, cross_slope = (-(normals[roof] @ axis) / normals[roof, 2] for axis in (d, across))
        in_plan = surface.areas[roof] * normals[roof, 2]
        (start, end), (low, high) = ((x.min(), x.max()) for x in (corners @ d, corners @ across))
        place = (surface.centroids[roof] @ d - start) / (end - start)
        tilt, cross_tilt = _mean(slope, in_plan), _mean(cross_slope, in_plan)
        before = place < 0.5
        order = np.argsort(place)
        median = place[order][np.searchsorted(np.cumsum(in_plan[order]), in_plan.sum() / 2)]

        def on_faces(values: Floats) -> Floats:
            spread = np.zeros(surface.m)
            spread[roof] = values
            return spread

        return cls(
            roof,
            place=on_faces(place),
            front=on_faces(place <= median) > 0,
            aside=on_faces((surface.centroids[roof] @ across - low) / (high - low)),
            arc=on_faces(_along_arc(place, np.hypot(1, slope) * in_plan, in_plan)),
            slope=on_faces(slope),
            depth=float(end - start),
            width=float(high - low),
            rise=float(np.ptp(corners[..., 2] - cross_tilt * (corners @ across))),
            halves=(_mean(slope[before], in_plan[before]), _mean(slope[~before], in_plan[~before])),
            fit=_straightness(place, slope / np.hypot(1, slope), in_plan),
            tilt=float(np.hypot(tilt, cross_tilt)),
            uneven=_mean(np.hypot(slope - tilt, cross_slope - cross_tilt), in_plan),
        )


def roofs(surface: Surface, faces: Bools, normals: Floats) -> list[Bools]:
    """Return a mask (m,) for each roof with picked `faces` (m,): the faces of a piece that look upwards.
    normals : (m, 3) to the outside. A mean slope of 60 degrees or more makes an open piece a wall."""
    count, piece = surface.pieces
    rise = np.bincount(piece, normals[:, 2] * surface.areas, count) / np.bincount(piece, surface.areas, count)
    is_open = np.bincount(piece, surface.edges.boundary[surface.edges.of].any(axis=1), count) > 0
    upwards = (normals[:, 2] > 1e-6) & ~(is_open & (rise <= ROOF_RISE))[piece]
    masks = (upwards & (piece == k) for k in range(count))
    return [mask for mask in masks if (faces & mask).any()]


def side_of_plan(surface: Surface) -> Floats:
    """Return the direction (3,) of a side of the smallest rectangle around the plan; of a plane wall, its own."""
    from scipy.spatial import QhullError
    from trimesh.bounds import oriented_bounds_2D

    plan = surface.V[:, :2]
    try:
        side = oriented_bounds_2D(plan)[0][0, :2]
    except QhullError:
        side = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
    return np.array([*side, 0.0])


def _straightness(x: Floats, y: Floats, weights: Floats) -> float:
    """Return the squared correlation of x and y, negative if y rises with x, and 0 if one of them is constant."""
    dx, dy = x - _mean(x, weights), y - _mean(y, weights)
    xy, squares = _mean(dx * dy, weights), _mean(dx**2, weights) * _mean(dy**2, weights)
    return -np.sign(xy) * xy**2 / squares if squares > 1e-12 else 0.0


def _mean(values: Floats, weights: Floats) -> float:
    return float(values @ weights / max(weights.sum(), 1e-300))


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
    """Return mu_1 (m,) on parts that fall along the direction or are level, and half of it elsewhere
    [EN 1991-1-3:2003, 5.3.3 (4)]. slope : (m,) degrees of each face."""
    return np.where(profile.roof, np.where(profile.slope <= LEVEL, 1.0, 0.5) * snow_shape_factor(slope), 0.0)


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


def vault_pressure(profile: RoofProfile, eaves: float, suction: bool = False) -> Floats:
    """Return the pressure coefficients c_pe,10 (m,) of a vault across the wind; suction is negative.

    The arc has four equal parts: zone A (first part), B (the two in the middle) and C (last). With f = rise / depth,
    A is 1.6 f on the ground, and 8/3 (f - 0.2) if the eaves are half of the depth or more above it, or -1.2 for f below
    0.2; B is -0.7 - f; C is -0.4. Between these heights A is linear [EN 1991-1-4:2005, 7.2.8, figure 7.11].
    eaves   : height of the eaves above the ground, metres.
    suction : True for the second value of A that the figure asks for if f is between 0.2 and 0.3: here -1.2 too.
    Raises SurfaceError for f outside of the figure, 0.05 to 0.5; up to 0.55 counts as 0.5, because the edge of a mesh
    of half a circle is ragged."""
    profile.require_arch("wind", "vault")
    f, high = profile.rise / profile.depth, min(2 * eaves / profile.depth, 1.0)
    if not 0.05 <= f <= 0.55:
        raise SurfaceError(
            f"a load of kind 'wind' with shape 'vault': rise / depth is {f:.2f} along the wind; EN 1991-1-4, figure "
            "7.11 covers 0.05 to 0.5; turn the wind across the vault, or give coefficients without a shape"
        )
    f = min(f, 0.5)
    on_high_walls = -1.2 if f < (0.3 if suction else 0.2) else 8 / 3 * (f - 0.2)
    windward = (1 - high) * 1.6 * f + high * on_high_walls
    zones = np.array([windward, -0.7 - f, -0.7 - f, -0.4])
    return np.where(profile.roof, zones[np.minimum((4 * profile.arc).astype(int), 3)], 0.0)


FLAT_ZONES = (-1.8, -1.2, -0.7)  # c_pe,10 of zones F, G and H, sharp eaves [EN 1991-1-4:2005, table 7.2]
INNER_ZONE = {"flat down": 0.2, "flat up": -0.2}  # c_pe,10 of zone I [EN 1991-1-4:2005, table 7.2]


def flat_roof_pressure(profile: RoofProfile, eaves: float, inner: float) -> Floats:
    """Return the pressure coefficients c_pe,10 (m,) of a flat roof on walls with sharp eaves; suction is negative.

    With e = min(width, 2 h) and h = eaves + rise, zone F lies within e/10 of the windward edge and e/4 of the sides, G
    between them, H up to e/2, and I behind [EN 1991-1-4:2005, 7.2.3, figure 7.6, table 7.2].
    inner : c_pe,10 of zone I.    eaves : height of the eaves above the ground, metres.
    Raises SurfaceError for a slope of more than 5 degrees, and for eaves on the ground."""
    slope = float(np.degrees(np.arctan(profile.tilt + profile.uneven)))
    if slope > 5.5:
        raise SurfaceError(
            f"a load of kind 'wind' on a flat roof: it slopes by {slope:.0f} degrees; EN 1991-1-4, 7.2.3 covers up to "
            "5; use another shape"
        )
    if eaves <= 0:
        raise SurfaceError(
            "a load of kind 'wind' on a flat roof: eaves is 0; give eaves, the height of the roof above the ground, "
            "metres"
        )
    e = min(profile.width, 2 * (eaves + profile.rise))
    to_edge, to_side = profile.place * profile.depth, np.minimum(profile.aside, 1 - profile.aside) * profile.width
    zones = [to_edge > e / 2, to_edge > e / 10, to_side > e / 4]
    return np.where(profile.roof, np.select(zones, [inner, FLAT_ZONES[2], FLAT_ZONES[1]], FLAT_ZONES[0]), 0.0)


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


DIRECTIONS = 18  # directions in half a turn in which the slope of a canopy is measured; 0.4 % less than the steepest
TWO_SLOPES = 5.0  # degrees; smallest slope of table 7.7


@dataclass(frozen=True)
class CanopyCoefficients:
    """Force coefficients of an open canopy with nothing below it; positive coefficients press down.
    full : largest and smallest coefficient on the whole roof.
    half : largest and smallest coefficient if the wind loads one half only.
    has_one_axis : True for two slopes: then only wind across the ridge or trough loads one half."""

    full: tuple[float, float]
    half: tuple[float, float]
    has_one_axis: bool

    @classmethod
    def of_roof(cls, profiles: Sequence[RoofProfile]) -> "CanopyCoefficients":
        """Return the coefficients of a roof. profiles : of the roof in directions all around.

        The slope of the mean plane is that of a roof with one slope [EN 1991-1-4:2005, 7.3, table 7.6]. The rest of the
        roof counts as a roof with two slopes in each direction, ridge or trough [table 7.7]: half of the difference of
        the mean slopes before and behind the middle. Slopes that cancel in these means, as on pyramids and waves, are
        added to the steepest ridge and to the deepest trough. The larger coefficient counts.

        On one half, two slopes have the same coefficient, and the other half has none [figure 7.17]. On one slope the
        resultant acts at a quarter of the depth [figure 7.16]: half of the roof has twice the coefficient.
        Raises SurfaceError for slopes outside of the tables."""
        plane = float(np.degrees(np.arctan(profiles[0].tilt)))
        ridges = np.array([(profile.halves[0] - profile.halves[1]) / 2 for profile in profiles])
        cancelled = max(profiles[0].uneven - float(np.abs(ridges).max()), 0.0)
        low, high = (float(np.degrees(np.arctan(x))) for x in (ridges.min() - cancelled, ridges.max() + cancelled))
        if plane > 30.5 or not (low > -20.5 and high < 30.5):
            steep = plane if plane > 30.5 else low if low <= -20.5 else high
            raise SurfaceError(
                f"a load of kind 'wind' on an open canopy: its slope is {steep:.0f} degrees; EN 1991-1-4, 7.3 covers "
                "-20 (a trough) to 30; use shape 'vault', or give coefficients without a shape"
            )
        least = float(np.tan(np.radians(TWO_SLOPES)))
        has_two_slopes = np.abs(ridges) >= least
        has_one_slope = plane >= TWO_SLOPES or not has_two_slopes.any()
        mono = [float(np.interp(plane, MONOPITCH[0], row)) for row in MONOPITCH[1:]]
        angles = [angle for angle in (low, high) if abs(angle) >= TWO_SLOPES] or [low, high]
        duo = [np.interp(angles, DUOPITCH[0], row).tolist() for row in DUOPITCH[1:]]
        eccentric = [2 * c if has_one_slope else 0.0 for c in mono]
        full, half = ((max(c[0], *duo[0]), min(c[1], *duo[1])) for c in (mono, eccentric))
        across = has_two_slopes[DIRECTIONS // 2]
        return cls(full, half, has_one_axis=bool(has_two_slopes[0] and not across and not has_one_slope))
