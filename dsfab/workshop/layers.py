"""Layers of strips: the height of each family over the surface, and strip ends that collide within a layer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats
from dsfab.members import Member, Node
from dsfab.workshop.development import StripCourse
from dsfab.workshop.parts import LABEL, WORKSHOP_SMALL

OWN = ("rim", "keep")
"""Families that cross both families of stripes have layers of their own, below all others."""
END = 3.0
"""Bolt diameters from the middle of a bolt to the end of a part."""
PITCH = 4.0
"""Bolt diameters from bolt to bolt of a splice."""


@dataclass(frozen=True)
class Layering:
    """Layers of one thickness, metres, from the top (where normals point to) down; bolts of a diameter, metres.

    major  ═══════════════     0      of two layers; of four the families take turns
    minor  ─┤ ├─── ┤ ├────     1
    rim    ═══════════════     2      edges; what is kept: below them
                               4      plates: below all

    own : those of `OWN` that there are layers for; a model leaves out those that it does not have.
    letters : heights of names of parts and of nodes, metres, at most.
    """

    thickness: float
    count: int
    bolt: float
    own: tuple[str, ...] = OWN
    letters: tuple[float, float] = (LABEL, WORKSHOP_SMALL)

    def numbers(self, family: str) -> tuple[int, ...]:
        """The layers that a family is in, counted from the top."""
        if family in self.own:
            return (self.count + self.own.index(family),)
        return tuple(range(0 if family == "major" else 1, self.count, 2))

    @property
    def sparing(self) -> bool:
        """Whether names of nodes stand only where there is room for them: letters of a model are large for it."""
        return self.letters[0] < LABEL

    @property
    def plates(self) -> int:
        """The layer of plates: below all others, where nothing else lies."""
        return self.count + len(self.own)

    def height(self, number: int) -> float:
        """Metres from the surface to the middle of a layer: 0 is in the middle of those of the stripes."""
        return ((self.count - 1) / 2 - number) * self.thickness

    def cover(self, family: str, number: int) -> float:
        """Height of the cover plate of a splice: on the side where no crossing member lies between nodes."""
        return self.height(number - 1 if family == "major" else number + 1)

    def packing(self, node: Node, families: dict[str, str]) -> int:
        """How many layers of packing a node needs between its two members, by the families of all members."""
        one, two = (self.numbers(families[name]) for name in node.members)
        upper, lower = (one, two) if one[0] < two[0] else (two, one)
        return max(lower[0] - upper[-1] - 1, 0)

    @property
    def half_cover(self) -> float:
        """Metres from a splice to the end of its cover plate: two bolts to each side."""
        return (END + PITCH + END) * self.bolt

    def splice_bolts(self, width: float) -> tuple[tuple[float, float], ...]:
        """Places of the bolts of a splice, metres along from it and to the left, in one row or two."""
        rows = (-width / 4, width / 4) if width / 4 >= 3 * self.bolt else (0.0,)  # two rows need wide parts
        along = (END * self.bolt, (END + PITCH) * self.bolt)
        return tuple((side * x, y) for side in (-1, 1) for x in along for y in rows)


@dataclass(frozen=True, eq=False)
class _End:
    """The end of a strip, its last or its first one, as places (k, 3) from there inwards, with arc lengths (k,)."""

    name: str
    last: bool
    width: float
    places: Floats
    s: Floats

    @classmethod
    def of(cls, name: str, course: StripCourse, last: bool) -> "_End":
        width = float(np.median(course.left + course.right))
        count = max(int(6 * (course.end - course.begin) / width), 2)  # six places on each width
        s = np.linspace(course.begin, course.end, count)
        s = s[::-1] if last else s
        return cls(name, last, width, course.at(s)[0], s)

    def clear_of(self, other: "_End") -> float | None:
        """The arc length from which on it is clear of another one, where both overlap at their ends; else None."""
        least = 0.98 * (self.width + other.width) / 2
        away = np.asarray(cKDTree(other.places).query(self.places)[0])
        far = np.linalg.norm(other.places[0] - self.places[0]) > least
        if far or away[0] > least or (away <= least).all():
            return None
        return float(self.s[int((away > least).argmax())])


def stopped_courses(
    courses: Mapping[str, StripCourse], nodes: Mapping[str, Sequence[float]], joined: set[frozenset[str]], past: float
) -> dict[str, StripCourse]:
    """Those courses of strips of one layer that stop before they run into others: `past` metres beyond their last node
    before that, or where they would touch if there is none.

    nodes : arc lengths of the nodes on each.    joined : pairs that share a node, and are to be notched there.
    """
    ends = [_End.of(name, one, last) for name, one in courses.items() if not one.closed for last in (False, True)]
    near = _near_pairs(ends)
    kept, stopped = list[_End](), dict[str, StripCourse]()
    for k, end in enumerate(ends):
        rivals = [one for one in kept if (one in near[k]) and frozenset((one.name, end.name)) not in joined]
        clear = [s for one in rivals if (s := end.clear_of(one)) is not None]
        if not clear:
            kept.append(end)
            continue
        course = stopped.get(end.name, courses[end.name])
        stopped[end.name] = _stopped(course, end.last, min(clear) if end.last else max(clear), nodes[end.name], past)
    return stopped


def curled_courses(courses: Mapping[str, StripCourse], members: Sequence[Member]) -> dict[str, StripCourse]:
    """Those of the courses of members, by their names, that stop where these curl up at an end (see `uncurled`)."""
    lengths = {member.id: member.length for member in members}
    return {name: one for name, one in courses.items() if not one.closed and (one.begin > 0 or one.end < lengths[name])}


def courses_without_rest(stopped: Mapping[str, StripCourse], widths: Mapping[str, float]) -> set[str]:
    """Names of those stopped courses of which less is left than they are wide, metres: others lie where they would be,
    and they are not built."""
    return {name for name, one in stopped.items() if one.end - one.begin < widths[name]}


def _near_pairs(ends: Sequence[_End]) -> list[set[_End]]:
    """Of each end those others that are as near to it as they are wide."""
    found = [set[_End]() for _ in ends]
    for (i, one), (j, other) in combinations(enumerate(ends), 2):
        if one.name != other.name and np.linalg.norm(one.places[0] - other.places[0]) < (one.width + other.width) / 2:
            found[i].add(other)
            found[j].add(one)
    return found


def _stopped(course: StripCourse, last: bool, clear: float, nodes: Sequence[float], past: float) -> StripCourse:
    """A course that ends at its last node before it is no more clear, or there."""
    if last:
        before = [s + past for s in nodes if course.begin < s and s + past <= clear]
        return replace(course, end=max(before, default=clear))
    after = [s - past for s in nodes if s < course.end and s - past >= clear]
    return replace(course, begin=min(after, default=clear))
