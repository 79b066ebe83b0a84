"""Feet with tabs at the ends of strips of card, and the base plate on which the feet stand.

layer   ║ ║         shoulders stand on the plate;
      ──╨─╨──       the tab between the shoulders goes through a slot of the plate
     ▒▒▒▒│▒│▒▒▒     plate"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, lock_floats
from dsfab.core.messages import length
from dsfab.surface import LoadCase, Surface
from dsfab.workshop.development import Development, StripCourse
from dsfab.workshop.parts import FlatPart, half_plane_clip, label

STEEP_SINE = np.sin(np.radians(25.0))  # smallest slope (sine) of a strip with a tab


@dataclass(frozen=True, eq=False)
class StripFoot:
    """Foot of a strip: an end with a tab on the base plate. Arc lengths are measured on the strip's axis.
    shoulders : (4,) arc lengths of the points on the plate: strip's right edge, tab's two sides, strip's left edge.
    sides     : (4,) distances of these points from the axis, positive to the left, metres.
    tips      : (2,) arc lengths of the right and left corner of the tab's end.
    slot      : (4, 2) corners of the foot's slot in the plate, metres.
    at_end    : True if the foot is at the end of the axis, False if at its beginning."""

    shoulders: Floats
    sides: Floats
    tips: Floats
    slot: Floats
    at_end: bool

    def cap(self, layer: Development) -> Floats:
        """Return the corners (6, 2) of the foot on the flat strip `layer`, counter-clockwise, metres."""
        s = np.concatenate([self.shoulders[:2], self.tips, self.shoulders[2:]])
        cap = layer.to_plane(s, np.concatenate([self.sides[:2], self.sides[1:3], self.sides[2:]]))
        return cap if self.at_end else cap[::-1]


@dataclass(frozen=True, eq=False)
class BasePlane:
    """Upper face of the base plate of a model.
    point, up : (3,) point in the face, m, and unit normal.    clearance : gap between a tab and its slot, metres.
    supports  : (q, 3) vertices of the surface with a support, metres.
    reach     : metres; a strip stands on a support if their distance is less than `reach` plus the strip's width."""

    point: Floats
    up: Floats
    supports: Floats
    reach: float
    thickness: float
    clearance: float

    def __post_init__(self) -> None:
        lock_floats(self, point=(3,), up=(3,), supports=(None, 3))

    @classmethod
    def from_supports(
        cls, surface: Surface, load: LoadCase, up: Floats, thickness: float, clearance: float
    ) -> "BasePlane | None":
        """Return the plate under the lowest support of a surface; None without supports."""
        support_points = surface.V[load.fixed.any(axis=1) | load.spring.any(axis=1)]
        if not len(support_points):
            return None
        lowest = support_points[(support_points @ up).argmin()]
        return cls(lowest, up, support_points, float(surface.mean_edge), thickness, clearance)

    def heights(self, points: Floats) -> Floats:
        """Return heights (q,) of points (q, 3) above the plate (m)."""
        return np.asarray((points - self.point) @ self.up)

    def plan_view(self, points: Floats) -> Floats:
        """Return points (q, 3) as seen from above, (q, 2) metres, with x to the right. `up` must be normal to x."""
        right = np.array([1.0, 0.0, 0.0])
        return np.asarray(points @ np.stack([right, np.cross(self.up, right)], axis=1))

    def support_height(self, point: Floats, width: float) -> float | None:
        """Return the height (m) above the plate of the support nearest to a point (3,); None if no support is near."""
        distance, k = cKDTree(self.supports).query(point)
        is_near = float(distance) < self.reach + width
        return float(self.heights(self.supports[int(k)][None])[0]) if is_near else None

    def cut_course(self, course: StripCourse, height: float) -> tuple[StripCourse, tuple[StripFoot, ...]]:
        """Cut a strip at the base plate. Return the remaining part of the strip, and the feet at its ends.
        height : height of the strip above the surface, metres."""
        if course.closed:
            return self._trim_course(course, height), ()
        layer, feet = Development(course, height), list[StripFoot]()
        for at_end in (False, True):
            s = course.end if at_end else course.begin
            p = course.frame_at(np.array([s]))[0][0]
            limit = self.reach + float(course.width(np.array([s]))[0])
            away = float(np.asarray(cKDTree(self.supports).query(p)[0]))
            is_near = max(away, abs(float(self.heights(p[None])[0]))) < limit
            if is_near and (foot := self._foot(layer, s, at_end)):
                feet.append(foot)
                middle = float(foot.shoulders[1:3].mean())
                course = replace(course, end=middle) if at_end else replace(course, begin=middle)
        return (course if feet else self._trim_course(course, height)), tuple(feet)

    def _foot(self, layer: Development, station: float, at_end: bool) -> StripFoot | None:
        course = layer.course
        _, T, B, N = (rows[0] for rows in layer.frame(np.array([station])))
        down = T if at_end else -T
        if -down @ self.up < STEEP_SINE:
            return None
        left_width, right_width = (float(np.interp(station, course.s, side)) for side in (course.left, course.right))
        middle, half = (left_width - right_width) / 2, 0.6 * (left_width + right_width) / 2  # tab's axis, half width
        sides = np.array([-right_width, middle - half, middle + half, left_width])
        shoulders = self.stations_at_height(layer, sides, station, 0.0)
        tips = self.stations_at_height(layer, sides[1:3], station, -self.thickness)
        if shoulders is None or tips is None:
            return None
        return StripFoot(shoulders, sides, tips, self._slot(layer, shoulders[1:3], sides[1:3], (down, N, B)), at_end)

    def stations_at_height(self, layer: Development, sides: Floats, station: float, height: float) -> Floats | None:
        """Return arc lengths (q,) at which lines along a strip are `height` metres above the plate; None if impossible.
        sides : (q,) distances of the lines from the axis, positive to the left, metres."""
        s, course = np.full(len(sides), station), layer.course
        for _ in range(20):  # these are Newton steps
            P, T, B, _ = layer.frame(s)
            slope = (T @ self.up) * np.interp(s, course.s, layer.length_ratio)
            excess = self.heights(P + sides[:, None] * B) - height
            s = np.clip(s - excess / slope, course.s[0], course.s[-1])
        P, _, B, _ = layer.frame(s)
        size = float(np.ptp(course.P, axis=0).max())
        level = np.abs(self.heights(P + sides[:, None] * B) - height) < 1e-6 * size
        return s if level.all() else None

    def _slot(self, layer: Development, s: Floats, sides: Floats, frame: tuple[Floats, Floats, Floats]) -> Floats:
        down, N, B = frame
        P, _, across, _ = layer.frame(s)
        ends = P + sides[:, None] * across
        half = self.thickness / 2  # the strip is as thick as the plate
        corners = np.array([end + u * half * N for end in ends for u in (-1, 1)])
        drops = [(self.heights(corners) - z) / (down @ self.up) for z in (0.0, -self.thickness)]
        corners = np.concatenate([corners - drop[:, None] * down for drop in drops])
        flat, direction = self.plan_view(corners), self.plan_view(B[None])[0]
        direction = direction / np.linalg.norm(direction)
        axes = np.array([direction, [-direction[1], direction[0]]])
        x = flat @ axes.T
        low, high = x.min(axis=0) - self.clearance, x.max(axis=0) + self.clearance
        rectangle = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
        return np.asarray(rectangle @ axes)

    def _trim_course(self, course: StripCourse, height: float) -> StripCourse:
        P, _, B, _ = Development(course, height).frame(course.s)
        above, slope = self.heights(P), B @ self.up
        sides = list[Floats]()
        for side, rise in ((course.left, slope), (course.right, -slope)):
            falls = rise < -1e-9
            limit = np.where(falls, above / np.where(falls, -rise, 1.0), np.inf)
            least = 0.2 * (course.left + course.right) - side  # at least a fifth of the width remains
            sides.append(np.where(above + rise * side < 0, np.clip(limit, least, side), side))
        return replace(course, left=sides[0], right=sides[1])


def outline_with_feet(layer: Development, span: tuple[float, float], feet: tuple[StripFoot, ...]) -> Floats:
    """Return the outline (k, 2) of a strip between arc lengths `span`, counter-clockwise, with tabs."""
    ends: dict[bool, StripFoot] = {foot.at_end: foot for foot in feet}
    course = layer.course
    begin = ends.get(False) if span[0] == course.begin else None
    end = ends.get(True) if span[1] == course.end else None
    if begin is None and end is None:
        return layer.outline(*span)

    def edge(corner: int) -> Floats:
        low = float(begin.shoulders[corner]) if begin else span[0]
        high = float(end.shoulders[corner]) if end else span[1]
        return layer.stations(low, high)

    s, t = edge(0), edge(3)[::-1]
    right_edge, left_edge = -np.interp(s, course.s, course.right), np.interp(t, course.s, course.left)
    if begin:
        right_edge[0], left_edge[-1] = begin.sides[0], begin.sides[3]
    if end:
        right_edge[-1], left_edge[0] = end.sides[0], end.sides[3]
    end_cap, begin_cap = ([foot.cap(layer)[1:-1]] if foot else [] for foot in (end, begin))
    return np.concatenate([layer.to_plane(s, right_edge), *end_cap, layer.to_plane(t, left_edge), *begin_cap])


NAME_HEIGHT = 0.002  # height of names beside slots (m)
NO_FEET_NOTE = "no strip meets the base plate steeply enough for a tab: glue the model onto the engraved lines"


def base_parts(
    ground: BasePlane, surface: Surface, feet: list[tuple[str, StripFoot]], room: list[tuple[float, float]]
) -> list[FlatPart]:
    """Return the base plate of a model in as few equal rectangles as possible.
    feet : pairs of a part's name and its foot.    room : lengths and widths of the stock, metres."""
    engraved = [*_support_marks(ground, surface), *_slot_names(feet)]
    slots = [foot.slot for _, foot in feet]
    every = np.concatenate([ground.plan_view(ground.supports), *slots])
    border = 0.012  # metres: width of the plate's border around the supports
    low, size = every.min(axis=0) - border, np.ptp(every, axis=0) + 2 * border
    turned = [*room, *((b, a) for a, b in room)]
    counts = ((int(np.ceil(size[0] / a)), int(np.ceil(size[1] / b))) for a, b in turned)
    nx, ny = min(counts, key=lambda n: n[0] * n[1])
    step = size / [nx, ny]
    plates = []
    for i, j in product(range(nx), range(ny)):
        box = np.stack([low + step * [i, j], low + step * [i + 1, j + 1]])
        name = "base" if nx * ny == 1 else f"base {i + 1}-{j + 1}"
        outline = np.array([[box[x, 0], box[y, 1]] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
        inside = [clipped for slot in slots if len(clipped := clipped_polygon(slot, box)) > 2]
        lines = [line for line in engraved if ((line >= box[0]) & (line <= box[1])).all(axis=1).all()]
        marks = [*lines, *label(name, box.mean(axis=0), 0.0, 3 * NAME_HEIGHT)]
        plates.append(FlatPart(name, "", (0.0, 0.0), outline, slots=tuple(inside), marks=tuple(marks)))
    return plates


def clipped_polygon(P: Floats, box: Floats) -> Floats:
    """Return the part (k, 2) of a convex polygon (q, 2) inside a box (2, 2), lowest and highest corner."""
    for axis, side in product((0, 1), (0, 1)):
        sign = -1 if side == 0 else 1
        P = half_plane_clip(P, sign * np.eye(2)[axis], sign * box[side, axis])
    return P


def _support_marks(ground: BasePlane, surface: Surface) -> list[Floats]:
    support_places = {tuple(place) for place in ground.supports.tolist()}
    support = np.array([tuple(place) in support_places for place in surface.V.tolist()])
    ends = surface.edges.ends[surface.edges.boundary]
    ends = ends[support[ends].all(axis=1)]
    alone = support.copy()
    alone[np.unique(ends)] = False
    alone &= np.bincount(surface.edges.ends[support[surface.edges.ends].all(axis=1)].ravel(), minlength=surface.n) == 0
    arms = 0.002 * np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]])
    lines = [ground.plan_view(surface.V[pair]) for pair in ends]
    return lines + [place + arm for place in ground.plan_view(surface.V[alone]) for arm in arms]


def _slot_names(feet: list[tuple[str, StripFoot]]) -> list[Floats]:
    if not feet:
        return []
    middles = np.array([foot.slot.mean(axis=0) for _, foot in feet])
    centre = middles.mean(axis=0)
    lines = list[Floats]()
    for (name, foot), middle in zip(feet, middles, strict=True):
        direction = foot.slot[3] - foot.slot[0]
        deep = float(np.linalg.norm(direction))
        direction = direction / deep * (1 if direction @ (middle - centre) >= 0 else -1)
        angle = float(np.arctan2(*(foot.slot[1] - foot.slot[0])[::-1]))
        angle -= np.pi * round(angle / np.pi) if abs(angle) > np.pi / 2 else 0.0  # names are never upside down
        lines += label(name, middle + (deep / 2 + 0.002 + NAME_HEIGHT / 2) * direction, angle, NAME_HEIGHT)
    return lines


def base_notes(ground: BasePlane, feet: list[tuple[str, StripFoot]], plates: list[FlatPart]) -> list[str]:
    """Return notes on the feet and the base plate."""
    names = {name for name, _ in feet}
    notes = [f"{len(feet)} feet of {len(names)} parts stand in slots of the base plate" if feet else NO_FEET_NOTE]
    highest = float(ground.heights(ground.supports).max())
    if highest > ground.reach:
        notes.append(f"some supports are up to {length(highest)} above the base plate: prop the strips that end there")
    if len(plates) > 1:
        notes.append(f"the base plate consists of {len(plates)} pieces, side by side: glue these pieces on a board")
    return notes
