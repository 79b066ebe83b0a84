"""Flat parts with holes and openings, and engraved letters.

A letter is a few polylines on a grid 4 wide and 6 high."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, distances_from_segments, lock, lock_floats, read_only_copy
from dsfab.surface import as_circle, as_polyline, simplified_line

if TYPE_CHECKING:
    import compas.geometry

GLYPH_HEIGHT, GLYPH_WIDTH, GLYPH_GAP = 6, 4, 2
SMALL_LETTER_SHARE = 0.7  # height of small letters divided by the height of capitals
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
    """Return a line of text as polylines (k, 2), in the unit of `height` (height of capital letters)."""
    lines, x = list[Floats](), 0.0
    for letter in text:
        scale = height / GLYPH_HEIGHT * (SMALL_LETTER_SHARE if letter.islower() else 1.0)
        for line in filter(None, GLYPHS.get(letter.upper(), GLYPHS["-"]).split("|")):
            points = np.array([[int(xy[0]), int(xy[1])] for xy in line.split()], dtype=np.float64)
            lines.append(points * scale + [x, 0.0])
        x += (GLYPH_WIDTH + GLYPH_GAP) * scale
    return lines


def text_length(text: str, height: float) -> float:
    """Return the length of a line of text, in the unit of its height."""
    width = sum((GLYPH_WIDTH + GLYPH_GAP) * (SMALL_LETTER_SHARE if letter.islower() else 1.0) for letter in text)
    return (width - GLYPH_GAP) * height / GLYPH_HEIGHT


NAME_SHARE = 0.9  # largest share of the available length that a name fills
SAME_DISTANCE = 2e-4  # largest distance (m) between matching corners or holes of two equal parts
OUTLINE_TOLERANCE = 2e-5  # largest distance between a written outline and the outline of the part (m)
PART_LETTERS, NODE_LETTERS = 0.02, 0.008  # largest heights of part names and of node names (m)


@dataclass(frozen=True, eq=False)
class Hole:
    """Round hole: its centre (2,) and diameter (m), and the name of its bolt."""

    at: Floats
    diameter: float
    bolt: str

    def __post_init__(self) -> None:
        lock(self, "at", np.float64, (2,))


@dataclass(frozen=True, eq=False)
class Fold:
    """Fold of a part along a line (2, 2) by an angle (radians); positive angles fold away from the viewer."""

    line: Floats
    angle: float

    def __post_init__(self) -> None:
        lock(self, "line", np.float64, (2, 2))


@dataclass(frozen=True, eq=False)
class FlatPart:
    """Part to cut, as seen from the side to which the surface normals point.
    id        : "A07.2" for the second piece of member A07, "A07.c1" for the cover plate of its first splice.
    member    : name of the member; "" for pieces of a sheet.
    span      : arc lengths of the member's axis at the part's two ends, metres; (0, 0) without an axis.
    outline   : (k, 2) corners, counter-clockwise, metres.
    slots     : (k, 2) closed cuts, metres.    marks : (k, 2) lines to engrave, metres.
    layer     : height of the part's middle over the surface, metres.    axis : (k, 2) middle line, metres, or (0, 2).
    thickness : thickness, metres; 0 for the thickness of the whole plan."""

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
        lock_floats(self, outline=(None, 2), axis=(None, 2))
        for name in ("slots", "marks"):
            object.__setattr__(self, name, tuple(read_only_copy(x, np.float64, (None, 2)) for x in getattr(self, name)))

    @cached_property
    def area(self) -> float:
        """Area without openings (m2)."""
        return polygon_area(self.outline) - sum(abs(polygon_area(slot)) for slot in self.slots)

    @cached_property
    def size(self) -> Floats:
        """Length and width (2,) of the bounding box (m)."""
        return np.asarray(np.ptp(self.outline, axis=0))

    @cached_property
    def contours(self) -> tuple[Floats, ...]:
        """Outline, then slots, (k, 2) each, without corners on straight lines (m)."""
        loops = (_without_straight_corners(loop) for loop in (self.outline, *self.slots))
        return tuple(read_only_copy(loop, np.float64, (None, 2)) for loop in loops)

    @cached_property
    def radii(self) -> Floats:
        """Distances (k,) of the outline's corners from the origin (m), sorted."""
        return np.sort(np.linalg.norm(self.outline, axis=1))

    @cached_property
    def features(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Points for comparison of parts: corners, hole middles, slot corners and fold middles, (k, 2) each."""
        slots = np.concatenate(self.slots) if self.slots else np.zeros((0, 2))
        folds = np.array([fold.line.mean(axis=0) * (1 + fold.angle) for fold in self.folds]).reshape(-1, 2)
        return self.outline, np.array([hole.at for hole in self.holes]).reshape(-1, 2), slots, folds

    def to_compas(self) -> "dict[str, list[compas.geometry.Curve]]":
        """Return closed polylines `cut`, circles `drilled`, polylines `engraved` and lines `folded`, in metres.
        Raises SurfaceError without compas."""
        return {
            "cut": [as_polyline(np.vstack([loop, loop[:1]])) for loop in self.contours],
            "drilled": [as_circle(hole.at, hole.diameter / 2) for hole in self.holes],
            "engraved": [as_polyline(mark) for mark in self.marks],
            "folded": [as_polyline(fold.line) for fold in self.folds],
        }

    def moved_by(self, turn: float, shift: Floats) -> "FlatPart":
        """Return the part rotated by an angle (radians), then shifted by (2,) metres."""
        R = rotation_matrix(turn)
        part = replace(
            self,
            outline=self.outline @ R + shift,
            holes=tuple(Hole(hole.at @ R + shift, hole.diameter, hole.bolt) for hole in self.holes),
            slots=tuple(x @ R + shift for x in self.slots),
            marks=tuple(x @ R + shift for x in self.marks),
            axis=self.axis @ R + shift,
            folds=tuple(Fold(fold.line @ R + shift, fold.angle) for fold in self.folds),
        )
        if "contours" in self.__dict__:  # moving contours is faster than computing new contours
            part.__dict__["contours"] = tuple(x @ R + shift for x in self.contours)
        return part

    def along_x(self) -> "FlatPart":
        """Return the part with its longer direction along x and its middle at the origin."""
        line = self.axis if len(self.axis) > 1 else longest_direction(self.outline)
        direction = line[-1] - line[0]
        return self.moved_by(-float(np.arctan2(direction[1], direction[0])), np.zeros(2)).at_origin()

    def at_origin(self) -> "FlatPart":
        """Return the part with the middle of its bounding box at the origin."""
        return self.moved_by(0.0, -(self.outline.min(axis=0) + self.outline.max(axis=0)) / 2)


def _without_straight_corners(P: Floats) -> Floats:
    closed = np.concatenate((P, P[:1]))
    return np.asarray(simplified_line(np.pad(closed, ((0, 0), (0, 1))), OUTLINE_TOLERANCE)[:-1, :2])


def rotation_matrix(angle: float) -> Floats:
    """Return the matrix (2, 2) that rotates rows of points (k, 2) by an angle (radians)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def polygon_area(P: Floats) -> float:
    """Return the area of a closed polygon (k, 2), positive if counter-clockwise [shoelace formula]."""
    x, y = P.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def longest_direction(P: Floats) -> Floats:
    """Return two points (2, 2) on the line along which points (k, 2) spread most."""
    middle = P.mean(axis=0)
    direction = np.linalg.svd(P - middle, full_matrices=False)[2][0]
    direction = direction if direction[np.abs(direction).argmax()] > 0 else -direction
    return np.stack([middle, middle + direction])


def shape_key(part: FlatPart) -> tuple[int, int]:
    """Return the numbers of corners and holes of a part."""
    return len(part.outline), len(part.holes)


def congruent(part_a: FlatPart, part_b: FlatPart) -> bool:
    """Return whether two parts, placed by `FlatPart.along_x`, have equal shapes, directly or after half a turn."""
    keys = [(shape_key(part), part.thickness, len(part.slots)) for part in (part_a, part_b)]
    if keys[0] != keys[1] or (np.abs(part_a.size - part_b.size) > 2 * SAME_DISTANCE).any():
        return False
    if (np.abs(part_a.radii - part_b.radii) > SAME_DISTANCE).any():
        return False
    pairs = list(zip(part_a.features, part_b.features, strict=True))
    return any(all(_same_points(P, turn * Q) for P, Q in pairs) for turn in (1, -1))


def _same_points(points_a: Floats, points_b: Floats) -> bool:
    if len(points_a) != len(points_b):
        return False
    pairs = ((points_a, points_b), (points_b, points_a)) if len(points_a) else ()
    return all(bool((np.asarray(cKDTree(P).query(Q)[0]) < SAME_DISTANCE).all()) for P, Q in pairs)


def alike_parts(parts: Sequence[FlatPart], distance: float, fit: float) -> list[FlatPart]:
    """Return the parts with fewer shapes: a part that is nearly equal to an earlier part gets the earlier shape.
    parts : parts, placed by `FlatPart.along_x`.    distance : largest distance between nearly equal outlines, metres.
    fit      : largest distance between matching holes, metres."""
    first_parts = dict[tuple[int, float], list[FlatPart]]()
    result = list[FlatPart]()
    for part in parts:
        candidates = first_parts.setdefault((len(part.holes), part.thickness), [])
        is_plain = not (part.slots or part.folds)
        turned = (_in_place_of(model, part, turn, distance, fit) for model in candidates for turn in (1, -1))
        alike = next(filter(None, turned), None) if is_plain else None
        if alike is None and is_plain:
            candidates.append(part)
        result.append(alike or part)
    return result


def _in_place_of(model: FlatPart, part: FlatPart, turn: int, distance: float, fit: float) -> FlatPart | None:
    """Return `part` in the shape of `model`; None if the shapes differ too much."""
    if (np.abs(model.size - part.size) > 2 * distance).any() or bool(len(model.axis)) != bool(len(part.axis)):
        return None
    holes, model_holes = part.features[1], turn * model.features[1]
    shift = model_holes.mean(axis=0) - holes.mean(axis=0) if len(holes) else np.zeros(2)
    between_holes = np.linalg.norm((holes + shift)[:, None] - model_holes, axis=2)
    rows, order = linear_sum_assignment(between_holes)
    if (between_holes[rows, order] > fit).any():
        return None
    if _outline_distance(turn * model.outline, part.outline + shift) > distance:
        return None
    # outlines begin with the right edge; half a turn makes the left edge the right edge
    outline = model.outline if turn == 1 else -np.roll(model.outline, len(model.axis), axis=0)
    drilled = tuple(replace(hole, at=model_holes[k]) for hole, k in zip(part.holes, order, strict=True))
    marks = tuple(mark + shift for mark in part.marks)
    return replace(part, outline=outline, holes=drilled, marks=marks, axis=turn * model.axis[::turn])


def _outline_distance(P: Floats, Q: Floats) -> float:
    return max(float(distances_from_outline(*pair).max()) for pair in ((P, Q), (Q, P)))


def distances_from_outline(points: Floats, outline: Floats) -> Floats:
    """Return the distances (q,) of points (q, 2) from the sides of a closed polygon (k, 2)."""
    return np.asarray(distances_from_segments(points[:, None], outline, np.roll(outline, -1, axis=0)).min(axis=1))


def inside_outline(points: Floats, outline: Floats) -> Bools:
    """Return a mask (q,) of the points (q, 2) inside a closed polygon (k, 2)."""
    a, b = outline, np.roll(outline, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing_x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray((spans & (x < crossing_x)).sum(axis=1) % 2 == 1)


def half_plane_clip(P: Floats, a: Floats, b: float) -> Floats:
    """Return the part (k, 2) of a convex polygon (q, 2) where a . x <= b [Sutherland, Hodgman 1974]."""
    excess = P @ a - b
    corners = list[Floats]()
    for k in range(len(P)):
        before, after = excess[k - 1], excess[k]
        if (before <= 0) != (after <= 0):
            corners.append(P[k - 1] + before / (before - after) * (P[k] - P[k - 1]))
        if after <= 0:
            corners.append(P[k])
    return np.array(corners).reshape(-1, 2)


def label(text: str, middle: Floats, angle: float, height: float) -> tuple[Floats, ...]:
    """Return a text as polylines (k, 2). angle : radians.    middle : (2,) metres."""
    lines = strokes(text, height)
    width = max(float(line[:, 0].max()) for line in lines)
    return tuple((line - [width / 2, height / 2]) @ rotation_matrix(angle) + middle for line in lines)
