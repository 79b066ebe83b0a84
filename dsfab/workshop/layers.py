r"""Layers of strips.

 \ | /        three strips of one layer are too close at their ends:
──┼─┼─┼──     every second strip stops at its last node before the collision
  | | |"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats
from dsfab.members import Member, Node
from dsfab.workshop.development import StripCourse
from dsfab.workshop.parts import NODE_LETTERS, PART_LETTERS

FAMILIES_BELOW = ("rim", "keep")
"""Families (edge strips, kept regions) that cross all stripes; their layers are below all layers of stripes."""
END_DISTANCE = 3.0  # distance from a bolt to the end of a part, in bolt diameters
BOLT_PITCH = 4.0  # distance between bolts of a splice, in bolt diameters


@dataclass(frozen=True)
class Layering:
    """Layers of strips of equal thickness (m), above each other. Layer 0 is outermost, on the side of the normals.

    major  ═══════════════     0      numbers for two layers; with four layers both families alternate
    minor  ─┤ ├─── ┤ ├────     1
    rim    ═══════════════     2, 3   strips along edges (2); strips of kept regions (3)
                               4      plates (members that are not strips), below all strips
    count          : number of layers of stripes.    bolt : diameter of the bolts, metres.
    families_below : families of `FAMILIES_BELOW` that exist in this structure.
    letters        : largest heights of part names and of node names, metres.
    alike          : parts with outlines that differ by at most this length (m) become equal; 0 changes no part."""

    thickness: float
    count: int
    bolt: float
    families_below: tuple[str, ...] = FAMILIES_BELOW
    letters: tuple[float, float] = (PART_LETTERS, NODE_LETTERS)
    alike: float = 0.0

    def family_layers(self, family: str) -> tuple[int, ...]:
        """Return the numbers of a family's layers, from the top."""
        if family in self.families_below:
            return (self.count + self.families_below.index(family),)
        return tuple(range(0 if family == "major" else 1, self.count, 2))

    @property
    def skips_crowded_names(self) -> bool:
        """True if names of nodes are omitted where they do not fit."""
        return self.letters[0] < PART_LETTERS

    @property
    def plate_layer(self) -> int:
        """Number of the layer of plates."""
        return self.count + len(self.families_below)

    def layer_height(self, number: int) -> float:
        """Return the height of the middle of a layer over the surface, metres."""
        return ((self.count - 1) / 2 - number) * self.thickness

    def cover_height(self, family: str, number: int) -> float:
        """Return the height over the surface (m) of the cover plate of a splice."""
        return self.layer_height(number - 1 if family == "major" else number + 1)

    def packing_layers(self, node: Node, families: dict[str, str]) -> int:
        """Return the number of spacers between the two members of a node. families : family of each member, by name."""
        layers_a, layers_b = (self.family_layers(families[name]) for name in node.members)
        upper, lower = (layers_a, layers_b) if layers_a[0] < layers_b[0] else (layers_b, layers_a)
        return max(lower[0] - upper[-1] - 1, 0)

    @property
    def half_cover_length(self) -> float:
        """Distance from a splice to each end of its cover plate, metres."""
        return (END_DISTANCE + BOLT_PITCH + END_DISTANCE) * self.bolt

    def splice_bolts(self, width: float) -> tuple[tuple[float, float], ...]:
        """Return the positions of a splice's bolts (m): along the strip from the splice, and left of the axis."""
        row = round(width / 4 / self.alike) * self.alike if self.alike else width / 4
        rows = (-row, row) if width / 4 >= 3 * self.bolt else (0.0,)  # only wide parts have two rows of bolts
        along = (END_DISTANCE * self.bolt, (END_DISTANCE + BOLT_PITCH) * self.bolt)
        return tuple((side * x, y) for side in (-1, 1) for x in along for y in rows)


@dataclass(frozen=True, eq=False)
class _StripEnd:
    name: str
    at_end: bool
    width: float
    places: Floats
    s: Floats

    @classmethod
    def from_course(cls, name: str, course: StripCourse, at_end: bool) -> "_StripEnd":
        width = float(np.median(course.left + course.right))
        count = max(int(6 * (course.end - course.begin) / width), 2)  # six points per width of the strip
        s = np.linspace(course.begin, course.end, count)
        s = s[::-1] if at_end else s
        return cls(name, at_end, width, course.frame_at(s)[0], s)

    def is_beside(self, rival: "_StripEnd") -> bool:
        width = (self.width + rival.width) / 2
        return self.name != rival.name and bool(np.linalg.norm(self.places[0] - rival.places[0]) < width)

    def clear_station(self, rival: "_StripEnd") -> float | None:
        least = 0.98 * (self.width + rival.width) / 2
        away = np.asarray(cKDTree(rival.places).query(self.places)[0])
        is_far = np.linalg.norm(rival.places[0] - self.places[0]) > least
        if is_far or away[0] > least or (away <= least).all():
            return None
        return float(self.s[int((away > least).argmax())])


def shortened_courses(
    courses: Mapping[str, StripCourse],
    nodes: Mapping[str, Sequence[float]],
    joined: set[frozenset[str]],
    overhang: float,
) -> dict[str, StripCourse]:
    """Return shorter courses (built parts of axes) for strips that would collide with a strip of the same layer.
    overhang : length of a strip beyond its last node, metres.    nodes : arc lengths of each member's nodes, metres.
    joined   : pairs of members that may overlap."""
    open_courses = {name: course for name, course in courses.items() if not course.closed}
    ends = [_StripEnd.from_course(name, c, at_end) for name, c in open_courses.items() for at_end in (False, True)]
    accepted, stopped = list[_StripEnd](), dict[str, StripCourse]()
    for end in ends:
        rivals = [x for x in accepted if end.is_beside(x) and frozenset((x.name, end.name)) not in joined]
        clear = [s for rival in rivals if (s := end.clear_station(rival)) is not None]
        if not clear:
            accepted.append(end)
            continue
        course, limit = stopped.get(end.name, courses[end.name]), min(clear) if end.at_end else max(clear)
        stopped[end.name] = _shortened_course(course, end.at_end, limit, nodes[end.name], overhang)
    return stopped


def courses_without_curls(courses: Mapping[str, StripCourse], members: Sequence[Member]) -> dict[str, StripCourse]:
    """Return, by member, the courses (built parts of axes) that lost a sharply turning end."""
    lengths = {member.id: member.length for member in members}
    return {name: c for name, c in courses.items() if not c.closed and (c.begin > 0 or c.end < lengths[name])}


def vanished_courses(stopped: Mapping[str, StripCourse], widths: Mapping[str, float]) -> set[str]:
    """Return the names of members whose courses in `stopped` are shorter than `widths`."""
    return {name for name, course in stopped.items() if course.end - course.begin < widths[name]}


def _shortened_course(
    course: StripCourse, at_end: bool, clear: float, nodes: Sequence[float], overhang: float
) -> StripCourse:
    if at_end:
        before = [s + overhang for s in nodes if course.begin < s and s + overhang <= clear]
        return replace(course, end=max(before, default=clear))
    after = [s - overhang for s in nodes if s < course.end and s - overhang >= clear]
    return replace(course, begin=min(after, default=clear))
