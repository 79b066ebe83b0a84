"""Feet of strips with tabs, and the base plate that they stand in."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, lock
from dsfab.core.messages import length
from dsfab.surface import LoadCase, Surface
from dsfab.workshop.development import Development, StripCourse
from dsfab.workshop.parts import FlatPart, label

STEEP = np.sin(np.radians(25.0))
"""A strip that comes down less steeply lies on the plate rather than standing in it: it is glued, without a tab."""


@dataclass(frozen=True, eq=False)
class StripFoot:
    """The end of a layer on the plate: arc lengths of its course.

    shoulders : (4,) where it meets the plate, at the right edge, both sides of the tab from right to left, and the
                left edge.    sides : (4,) metres to the left of the axis of these.
    tips      : (2,) where the tab ends, right and left.
    slot      : (4, 2) corners of its slot in the plate, metres.    last : whether it is at the end of the course.
    """

    shoulders: Floats
    sides: Floats
    tips: Floats
    slot: Floats
    last: bool

    def cap(self, layer: Development) -> Floats:
        """(6, 2) the outline of the end, rolled out, counter-clockwise around the part."""
        s = np.concatenate([self.shoulders[:2], self.tips, self.shoulders[2:]])
        y = np.concatenate([self.sides[:2], self.sides[1:3], self.sides[2:]])
        cap = layer.flat(s, y)
        return cap if self.last else cap[::-1]


@dataclass(frozen=True, eq=False)
class Ground:
    """The upper face of the plate: through a point (3,), square to a unit vector `up` (3,); metres.

    supports : (q, 3) places of the surface that are held.    reach : how far from these a strip may end that stands
    on the plate.    thickness : of the plate.    clearance : between tabs and slots, to each side.
    """

    point: Floats
    up: Floats
    supports: Floats
    reach: float
    thickness: float
    clearance: float

    def __post_init__(self) -> None:
        lock(self, "point", np.float64, (3,))
        lock(self, "up", np.float64, (3,))
        lock(self, "supports", np.float64, (None, 3))

    @classmethod
    def under(cls, surface: Surface, load: LoadCase, up: Floats, thickness: float, clearance: float) -> "Ground | None":
        """The plate under the lowest support of a surface; None where nothing is held."""
        held = surface.V[load.fixed.any(axis=1) | load.spring.any(axis=1)]
        if not len(held):
            return None
        lowest = held[(held @ up).argmin()]
        return cls(lowest, up, held, float(surface.mean_edge), thickness, clearance)

    def heights(self, points: Floats) -> Floats:
        """(q,) metres of points (q, 3) above the plate."""
        return np.asarray((points - self.point) @ self.up)

    def plan(self, points: Floats) -> Floats:
        """(q, 2) metres, of points (q, 3) as they are seen from above: x to the right where up is z or y."""
        right = np.array([1.0, 0.0, 0.0])
        return np.asarray(points @ np.stack([right, np.cross(self.up, right)], axis=1))

    def supported(self, point: Floats, width: float) -> bool:
        """Whether an end (3,) of a strip is at a support, and near the plate."""
        near = self.reach + width
        away = float(np.asarray(cKDTree(self.supports).query(point)[0]))
        return away < near and abs(float(self.heights(point[None])[0])) < near

    def height_near(self, point: Floats, width: float) -> float | None:
        """Metres over the plate of the support that is nearest to an end (3,); None where none is near."""
        away, k = cKDTree(self.supports).query(point)
        near = float(away) < self.reach + width
        return float(self.heights(self.supports[int(k)][None])[0]) if near else None

    def on_ground(self, course: StripCourse, height: float) -> tuple[StripCourse, tuple[StripFoot, ...]]:
        """A course that begins and ends on the plate where a support is, in a layer at a height, and its feet. What
        lies along the plate is cut off where it would reach below it."""
        if course.closed:
            return self._trimmed(course, height), ()
        layer, feet = Development(course, height), list[StripFoot]()
        for last in (False, True):
            at = course.end if last else course.begin
            point = course.at(np.array([at]))[0][0]
            if self.supported(point, float(course.width(np.array([at]))[0])) and (foot := self._foot(layer, at, last)):
                feet.append(foot)
                middle = float(foot.shoulders[1:3].mean())
                course = replace(course, end=middle) if last else replace(course, begin=middle)
        return (course if feet else self._trimmed(course, height)), tuple(feet)

    def _foot(self, layer: Development, at: float, last: bool) -> StripFoot | None:
        """The foot at an end; None where the strip is too flat for one, or does not come down to the plate."""
        course = layer.course
        _, T, B, N = (rows[0] for rows in layer.frame(np.array([at])))
        down = T if last else -T
        if -down @ self.up < STEEP:
            return None
        left, right = (float(np.interp(at, course.s, side)) for side in (course.left, course.right))
        middle, half = (left - right) / 2, 0.6 * (left + right) / 2  # the tab has .6 of the width
        sides = np.array([-right, middle - half, middle + half, left])
        shoulders = self.meeting(layer, sides, at, 0.0)
        tips = self.meeting(layer, sides[1:3], at, -self.thickness)
        if shoulders is None or tips is None:
            return None
        return StripFoot(shoulders, sides, tips, self._slot(layer, shoulders[1:3], sides[1:3], (down, N, B)), last)

    def meeting(self, layer: Development, sides: Floats, at: float, height: float) -> Floats | None:
        """(q,) arc lengths, near one, where lines at sides (q,) of a layer are at a height over the plate."""
        s, course = np.full(len(sides), at), layer.course
        for _ in range(20):  # Newton steps: strips are almost straight near the plate
            P, T, B, _ = layer.frame(s)
            slope = (T @ self.up) * np.interp(s, course.s, layer.speed)
            off = self.heights(P + sides[:, None] * B) - height
            s = np.clip(s - off / slope, course.s[0], course.s[-1])
        P, _, B, _ = layer.frame(s)
        size = float(np.ptp(course.P, axis=0).max())
        level = np.abs(self.heights(P + sides[:, None] * B) - height) < 1e-6 * size
        return s if level.all() else None

    def _slot(self, layer: Development, s: Floats, sides: Floats, frame: tuple[Floats, Floats, Floats]) -> Floats:
        """(4, 2) the rectangle in the plate that a tab needs on its way through, with the clearance around it."""
        down, N, B = frame
        P, _, across, _ = layer.frame(s)
        ends = P + sides[:, None] * across
        half = self.thickness / 2  # of the strip: it is of the same card
        corners = np.array([end + u * half * N for end in ends for u in (-1, 1)])
        corners = np.concatenate(
            [corners - ((self.heights(corners) - z) / (down @ self.up))[:, None] * down for z in (0.0, -self.thickness)]
        )
        flat, way = self.plan(corners), self.plan(B[None])[0]
        way = way / np.linalg.norm(way)
        axes = np.array([way, [-way[1], way[0]]])
        x = flat @ axes.T
        low, high = x.min(axis=0) - self.clearance, x.max(axis=0) + self.clearance
        rectangle = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
        return np.asarray(rectangle @ axes)

    def _trimmed(self, course: StripCourse, height: float) -> StripCourse:
        """A course with edges that stay above the plate."""
        P, _, B, _ = Development(course, height).frame(course.s)
        above, slope = self.heights(P), B @ self.up
        sides = list[Floats]()
        for side, way in ((course.left, slope), (course.right, -slope)):
            falls = way < -1e-9
            most = np.where(falls, above / np.where(falls, -way, 1.0), np.inf)
            least = 0.2 * (course.left + course.right) - side  # a strip keeps a fifth of its width
            sides.append(np.where(above + way * side < 0, np.clip(most, least, side), side))
        return replace(course, left=sides[0], right=sides[1])


def footed_outline(layer: Development, span: tuple[float, float], feet: tuple[StripFoot, ...]) -> Floats:
    """(k, 2) the outline of a piece over a span, counter-clockwise, with those of the feet that are at its ends."""
    ends: dict[bool, StripFoot] = {foot.last: foot for foot in feet}
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
    right, left = -np.interp(s, course.s, course.right), np.interp(t, course.s, course.left)
    if begin:
        right[0], left[-1] = begin.sides[0], begin.sides[3]
    if end:
        right[-1], left[0] = end.sides[0], end.sides[3]
    loop = [layer.flat(s, right), *_caps(end, layer), layer.flat(t, left), *_caps(begin, layer)]
    return np.concatenate(loop)


def _caps(foot: StripFoot | None, layer: Development) -> Iterator[Floats]:
    """The outline of an end between its outer shoulders."""
    if foot is not None:
        yield foot.cap(layer)[1:-1]


NAME = 0.002
"""Height of names beside slots, metres."""

NO_FEET = "no strip ends on the base plate steeply enough for a tab: glue the model on the engraved lines"


def base_parts(
    ground: Ground, surface: Surface, feet: list[tuple[str, StripFoot]], room: list[tuple[float, float]]
) -> list[FlatPart]:
    """The plate, in as few equal rectangles as fit into one of `room`, lengths and widths in metres; each where it lies
    under the model, as `Ground.plan` sees it.

    surface : as large as the model; its supports are at the ground's places.    feet : with the names of their parts.
    """
    engraved = [*_support_marks(ground, surface), *_slot_names(feet)]
    slots = [foot.slot for _, foot in feet]
    every = np.concatenate([ground.plan(ground.supports), *slots])
    border = 0.012  # metres of plate around the supports
    low, size = every.min(axis=0) - border, np.ptp(every, axis=0) + 2 * border
    turned = [*room, *((b, a) for a, b in room)]
    counts = ((int(np.ceil(size[0] / a)), int(np.ceil(size[1] / b))) for a, b in turned)
    nx, ny = min(counts, key=lambda n: n[0] * n[1])
    step = size / [nx, ny]
    found = []
    for i, j in product(range(nx), range(ny)):
        box = np.stack([low + step * [i, j], low + step * [i + 1, j + 1]])
        name = "base" if nx * ny == 1 else f"base {i + 1}-{j + 1}"
        outline = np.array([[box[x, 0], box[y, 1]] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
        inside = [clipped for slot in slots if len(clipped := clipped_polygon(slot, box)) > 2]
        title = label(name, box.mean(axis=0), 0.0, 3 * NAME)
        marks = [*_lines_inside(engraved, box), *title]
        found.append(FlatPart(name, "", (0.0, 0.0), outline, slots=tuple(inside), marks=tuple(marks)))
    return found


def clipped_polygon(P: Floats, box: Floats) -> Floats:
    """(k, 2) what a box, its low and its high corner (2, 2), has of a convex polygon (q, 2) [Sutherland, Hodgman]."""
    for axis, side in product((0, 1), (0, 1)):
        sign = 1 if side == 0 else -1
        inside = sign * (P[:, axis] - box[side, axis])
        found = list[Floats]()
        for k in range(len(P)):
            a, b = inside[k - 1], inside[k]
            if (a < 0) != (b < 0):
                found.append(P[k - 1] + a / (a - b) * (P[k] - P[k - 1]))
            if b >= 0:
                found.append(P[k])
        P = np.array(found).reshape(-1, 2)
    return P


def _lines_inside(lines: list[Floats], box: Floats) -> list[Floats]:
    """Those lines (k, 2) that lie in a box; what goes across its edge is short, and left out."""
    return [line for line in lines if ((line >= box[0]) & (line <= box[1])).all(axis=1).all()]


def _support_marks(ground: Ground, surface: Surface) -> list[Floats]:
    """Lines where edges of the surface are held, and crosses where single places are, as seen from above."""
    held = {tuple(place) for place in ground.supports.tolist()}
    on = np.array([tuple(place) in held for place in surface.V.tolist()])
    ends = surface.edges.ends[surface.edges.boundary]
    ends = ends[on[ends].all(axis=1)]
    alone = on.copy()
    alone[np.unique(ends)] = False
    alone &= np.bincount(surface.edges.ends[on[surface.edges.ends].all(axis=1)].ravel(), minlength=surface.n) == 0
    arms = 0.002 * np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]])
    lines = [ground.plan(surface.V[pair]) for pair in ends]
    return lines + [place + arm for place in ground.plan(surface.V[alone]) for arm in arms]


def _slot_names(feet: list[tuple[str, StripFoot]]) -> list[Floats]:
    """The name of each foot beside its slot, on the side that is away from the middle of all."""
    if not feet:
        return []
    middles = np.array([foot.slot.mean(axis=0) for _, foot in feet])
    centre = middles.mean(axis=0)
    found = list[Floats]()
    for (name, foot), middle in zip(feet, middles, strict=True):
        way = foot.slot[3] - foot.slot[0]
        deep = float(np.linalg.norm(way))
        way = way / deep * (1 if way @ (middle - centre) >= 0 else -1)
        angle = float(np.arctan2(*(foot.slot[1] - foot.slot[0])[::-1]))
        angle -= np.pi * round(angle / np.pi) if abs(angle) > np.pi / 2 else 0.0  # to be read from below
        found += label(name, middle + (deep / 2 + 0.002 + NAME / 2) * way, angle, NAME)
    return found


def base_notes(ground: Ground, feet: list[tuple[str, StripFoot]], plates: list[FlatPart]) -> list[str]:
    """How many feet stand in the plate, what does not, and whether it is in pieces."""
    names = {name for name, _ in feet}
    found = [f"{len(feet)} feet of {len(names)} parts stand in slots of the base plate" if feet else NO_FEET]
    highest = float(ground.heights(ground.supports).max())
    if highest > ground.reach:
        found.append(f"some supports are up to {length(highest)} above the base plate: prop what ends there")
    if len(plates) > 1:
        found.append(f"the base plate is in {len(plates)} pieces, butted: glue them on a board")
    return found
