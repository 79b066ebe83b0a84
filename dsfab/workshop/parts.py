"""Flat parts with holes and openings, and the single-stroke letters that are engraved on them."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, lock, locked
from dsfab.surface import as_circle, as_polyline, simplified_line

if TYPE_CHECKING:
    import compas.geometry


HIGH, WIDE, SPACE = 6, 4, 2
LETTERS_SMALL = 0.7
"""Height of small letters over that of capitals."""

GLYPHS = {
    "A": "00 26 40|12 32", "B": "00 06 36 45 34 03|33 42 41 30 00", "C": "45 36 16 05 01 10 30 41",
    "D": "00 06 26 44 42 20 00", "E": "46 06 00 40|03 33", "F": "46 06 00|03 33", "G": "45 36 16 05 01 10 30 41 43 23",
    "H": "00 06|40 46|03 43", "I": "20 26|10 30|16 36", "J": "46 41 30 10 01", "K": "00 06|46 03 40", "L": "06 00 40",
    "M": "00 06 23 46 40", "N": "00 06 40 46", "O": "10 01 05 16 36 45 41 30 10", "P": "00 06 36 45 44 33 03",
    "Q": "10 01 05 16 36 45 41 30 10|22 40", "R": "00 06 36 45 44 33 03|23 40",
    "S": "45 36 16 05 04 13 33 42 41 30 10 01",
    "T": "20 26|06 46", "U": "06 01 10 30 41 46", "V": "06 20 46", "W": "06 10 23 30 46", "X": "00 46|06 40",
    "Y": "06 23 46|23 20", "Z": "06 46 00 40", "0": "10 01 05 16 36 45 41 30 10|01 45", "1": "05 26 20|10 30",
    "2": "05 16 36 45 44 00 40", "3": "05 16 36 45 44 33 42 41 30 10 01|13 33", "4": "30 36 02 42",
    "5": "46 06 03 33 42 41 30 10 01", "6": "45 36 16 05 01 10 30 41 42 33 03", "7": "06 46 10",
    "8": "13 04 05 16 36 45 44 33 13 02 01 10 30 41 42 33", "9": "01 10 30 41 45 36 16 05 04 13 43",
    ".": "20 21", "-": "13 33", "+": "13 33|22 24", "/": "00 46", "_": "00 40", " ": "",
}  # fmt: skip


def strokes(text: str, height: float) -> list[Floats]:
    """(k, 2) polylines of a line of text, its lower left corner at the origin, in the unit of its height.

    What is no letter, digit or one of . - + / _ is drawn as a dash.
    """
    found, x = list[Floats](), 0.0
    for letter in text:
        scale = height / HIGH * (LETTERS_SMALL if letter.islower() else 1.0)
        for line in filter(None, GLYPHS.get(letter.upper(), GLYPHS["-"]).split("|")):
            points = np.array([[int(xy[0]), int(xy[1])] for xy in line.split()], dtype=np.float64)
            found.append(points * scale + [x, 0.0])
        x += (WIDE + SPACE) * scale
    return found


def text_length(text: str, height: float) -> float:
    """How long a line of text is, in the unit of its height."""
    wide = sum((WIDE + SPACE) * (LETTERS_SMALL if letter.islower() else 1.0) for letter in text)
    return (wide - SPACE) * height / HIGH


FILLED = 0.9
"""Share of the available length that a name fills, at most."""
SAME = 2e-4
"""Metres within which the corners and holes of parts agree that are one part, cut several times."""
TOLERANCE = 2e-5
"""Metres that a drawn outline may be off the part's."""
LABEL, WORKSHOP_SMALL = 0.02, 0.008
"""Heights of the names of parts and of nodes, metres; less on narrow parts."""


@dataclass(frozen=True, eq=False)
class Hole:
    """A round hole: its middle (2,) and its diameter, metres; `bolt` names the node or the splice that it is for."""

    at: Floats
    diameter: float
    bolt: str

    def __post_init__(self) -> None:
        lock(self, "at", np.float64, (2,))


@dataclass(frozen=True, eq=False)
class Fold:
    """A part is folded along a line (2, 2) by an angle, radians: away from who sees its drawing if it is positive."""

    line: Floats
    angle: float

    def __post_init__(self) -> None:
        lock(self, "line", np.float64, (2, 2))


@dataclass(frozen=True, eq=False)
class FlatPart:
    """A part as it is cut, seen from the side to which the normals of the surface point.

    id      : "A07.2" is the second piece of member A07; "A07.c1" the cover plate of its first splice.
    member  : its name; "" for pieces of a sheet.
    span    : from where to where along its axis, metres; (0, 0) for what has none.
    outline : (k, 2) corners, counter-clockwise.    slots : (k, 2) closed cuts within it, each.
    holes   : for bolts.                            marks : (k, 2) lines to engrave, each.
    layer   : height of its middle over the surface, metres.
    strain  : the largest that building it takes, with that of bending.
    folds   : where it is folded, if it is.    thickness : metres, where it is not that of most parts; else 0.
    axis    : (k, 2) the middle line, not to be cut; (0, 2) where it has none.
    """

    id: str
    member: str
    span: tuple[float, float]
    outline: Floats
    holes: tuple[Hole, ...] = ()
    slots: tuple[Floats, ...] = ()
    marks: tuple[Floats, ...] = ()
    layer: float = 0.0
    strain: float = 0.0
    axis: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    folds: tuple[Fold, ...] = ()
    thickness: float = 0.0

    def __post_init__(self) -> None:
        lock(self, "outline", np.float64, (None, 2))
        lock(self, "axis", np.float64, (None, 2))
        for name in ("slots", "marks"):
            object.__setattr__(self, name, tuple(locked(x, np.float64, (None, 2)) for x in getattr(self, name)))

    @cached_property
    def area(self) -> float:
        """Square metres, without its openings."""
        return polygon_area(self.outline) - sum(abs(polygon_area(slot)) for slot in self.slots)

    @cached_property
    def size(self) -> Floats:
        """(2,) length and width of the box around it, metres."""
        return np.asarray(np.ptp(self.outline, axis=0))

    @cached_property
    def contours(self) -> tuple[Floats, ...]:
        """(k, 2) each: the outline, then the slots, without corners that lie on a line with others; metres."""
        return tuple(locked(_closed(loop), np.float64, (None, 2)) for loop in (self.outline, *self.slots))

    @cached_property
    def radii(self) -> Floats:
        """(k,) ascending, of the corners of the outline from the origin, metres: of equal parts they are alike."""
        return np.sort(np.linalg.norm(self.outline, axis=1))

    @cached_property
    def features(self) -> tuple[Floats, Floats, Floats, Floats]:
        """(k, 2) corners of the outline, middles of the holes, corners of the slots, and middles of the folds, these
        farther out the more they are folded: a fifth of a degree makes parts differ."""
        slots = np.concatenate(self.slots) if self.slots else np.zeros((0, 2))
        folds = np.array([fold.line.mean(axis=0) * (1 + fold.angle) for fold in self.folds]).reshape(-1, 2)
        return self.outline, np.array([hole.at for hole in self.holes]).reshape(-1, 2), slots, folds

    def to_compas(self) -> "dict[str, list[compas.geometry.Curve]]":
        """`cut`, `drilled`, `engraved` and `folded`: closed polylines, circles, polylines, and lines of two points, in
        the plane, metres. Raises SurfaceError where compas is not installed."""
        return {
            "cut": [as_polyline(np.vstack([loop, loop[:1]])) for loop in self.contours],
            "drilled": [as_circle(hole.at, hole.diameter / 2) for hole in self.holes],
            "engraved": [as_polyline(mark) for mark in self.marks],
            "folded": [as_polyline(fold.line) for fold in self.folds],
        }

    def moved(self, turn: float, shift: Floats) -> "FlatPart":
        """Turned by an angle, radians, then shifted by (2,) metres."""
        R = turning(turn)
        made = replace(
            self,
            outline=self.outline @ R + shift,
            holes=tuple(Hole(hole.at @ R + shift, hole.diameter, hole.bolt) for hole in self.holes),
            slots=tuple(x @ R + shift for x in self.slots),
            marks=tuple(x @ R + shift for x in self.marks),
            axis=self.axis @ R + shift,
            folds=tuple(Fold(fold.line @ R + shift, fold.angle) for fold in self.folds),
        )
        if "contours" in self.__dict__:  # they move along, which takes less than finding them again
            made.__dict__["contours"] = tuple(x @ R + shift for x in self.contours)
        return made

    def lying(self) -> "FlatPart":
        """With its longer direction along x, its middle at the origin: how it lies on a drawing and on the stock."""
        line = self.axis if len(self.axis) > 1 else longest_direction(self.outline)
        way = line[-1] - line[0]
        return self.moved(-float(np.arctan2(way[1], way[0])), np.zeros(2)).centred()

    def centred(self) -> "FlatPart":
        """With the middle of its box at the origin."""
        return self.moved(0.0, -(self.outline.min(axis=0) + self.outline.max(axis=0)) / 2)


def _closed(P: Floats) -> Floats:
    """(k, 2) corners of a closed polygon, without those that lie on a line with others."""
    closed = np.concatenate((P, P[:1]))
    return np.asarray(simplified_line(np.pad(closed, ((0, 0), (0, 1))), TOLERANCE)[:-1, :2])


def turning(angle: float) -> Floats:
    """(2, 2) what rows of points (k, 2) are multiplied by to turn them, radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def polygon_area(P: Floats) -> float:
    """Of a closed polygon with corners (k, 2), positive if it runs counter-clockwise [shoelace formula]."""
    x, y = P.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def longest_direction(P: Floats) -> Floats:
    """(2, 2) the beginning and the end of a line along the direction in which points (k, 2) reach farthest."""
    middle = P.mean(axis=0)
    way = np.linalg.svd(P - middle, full_matrices=False)[2][0]
    way = way if way[np.abs(way).argmax()] > 0 else -way
    return np.stack([middle, middle + way])


def shape_key(part: FlatPart) -> tuple[int, int]:
    """What parts have in common that may be one part: how many corners and holes they have."""
    return len(part.outline), len(part.holes)


def congruent(one: FlatPart, two: FlatPart) -> bool:
    """Whether two parts, as they lie, are the same piece to cut, whatever is engraved; half a turn makes no
    difference."""
    if shape_key(one) != shape_key(two) or len(one.slots) != len(two.slots) or one.thickness != two.thickness:
        return False
    if (np.abs(one.size - two.size) > 2 * SAME).any():
        return False
    if (np.abs(one.radii - two.radii) > SAME).any():
        return False
    pairs = list(zip(one.features, two.features, strict=True))
    return any(all(_near(P, turn * Q) for P, Q in pairs) for turn in (1, -1))


def _near(one: Floats, two: Floats) -> bool:
    """Whether each of points (k, 2) has one of the others (k, 2) at its place."""
    if len(one) != len(two):
        return False
    pairs = ((one, two), (two, one)) if len(one) else ()
    return all(bool((np.asarray(cKDTree(P).query(Q)[0]) < SAME).all()) for P, Q in pairs)


def label(text: str, at: Floats, angle: float, height: float) -> tuple[Floats, ...]:
    """(k, 2) strokes of a text in the middle of (2,) metres, along an angle, radians."""
    c, s = np.cos(angle), np.sin(angle)
    drawn = strokes(text, height)
    wide = max(float(line[:, 0].max()) for line in drawn)
    return tuple((line - [wide / 2, height / 2]) @ np.array([[c, s], [-s, c]]) + at for line in drawn)
