"""The ground of a model: feet of strips with tabs, and the plate that these go into.

layer   ║ ║         shoulders stand on the plate, which is one thickness of card;
      ──╨─╨──       the tab between them goes through its slot
     ▒▒▒▒│▒│▒▒▒     plate
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, lock
from dsfab.surface import LoadCase, Surface
from dsfab.workshop.course import StripCourse
from dsfab.workshop.development import Development

TAB = 0.6
"""Width of a tab over that of its strip."""
STEEP = np.sin(np.radians(25.0))
"""A strip that comes down less steeply lies on the plate rather than standing in it: it is glued, without a tab."""
LEVEL = 1e-6
"""Share of a structure's size that a foot may be above or below the plate."""
STEPS = 20
"""Newton steps to where a strip meets the plate; few are enough, as strips are all but straight there."""
LEAST = 0.2
"""A strip keeps this share of its width where it is cut off along the plate."""


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
        middle, half = (left - right) / 2, TAB * (left + right) / 2
        sides = np.array([-right, middle - half, middle + half, left])
        shoulders = self.meeting(layer, sides, at, 0.0)
        tips = self.meeting(layer, sides[1:3], at, -self.thickness)
        if shoulders is None or tips is None:
            return None
        return StripFoot(shoulders, sides, tips, self._slot(layer, shoulders[1:3], sides[1:3], (down, N, B)), last)

    def meeting(self, layer: Development, sides: Floats, at: float, height: float) -> Floats | None:
        """(q,) arc lengths, near one, where lines at sides (q,) of a layer are at a height over the plate."""
        s, course = np.full(len(sides), at), layer.course
        for _ in range(STEPS):
            P, T, B, _ = layer.frame(s)
            slope = (T @ self.up) * np.interp(s, course.s, layer.speed)
            off = self.heights(P + sides[:, None] * B) - height
            s = np.clip(s - off / slope, course.s[0], course.s[-1])
        P, _, B, _ = layer.frame(s)
        size = float(np.ptp(course.P, axis=0).max())
        level = np.abs(self.heights(P + sides[:, None] * B) - height) < LEVEL * size
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
            least = LEAST * (course.left + course.right) - side
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
