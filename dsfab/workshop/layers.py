r"""Layers of strips: the height of each family over the surface, and strip ends that collide within a layer.

 \ | /        three strips of one layer are too close at their ends:
──┼─┼─┼──     every second one stops at its last node before the collision
  | | |
"""

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
"""Families that cross both families of stripes and have layers of their own, below all others."""
END = 3.0
"""Distance from a bolt to the end of a part, over the bolt diameter."""
PITCH = 4.0
"""Distance between bolts of a splice, over the bolt diameter."""


@dataclass(frozen=True)
class Layering:
    """Layers of a thickness (m) from the top, to which normals point, downwards; bolts of a diameter (m).

    major  ═══════════════     0      of two layers; of four the families take turns
    minor  ─┤ ├─── ┤ ├────     1
    rim    ═══════════════     2      edges, then kept regions, below the stripes
                               4      plates, below all

    families_below : families of `FAMILIES_BELOW` that have layers; a model leaves out the absent ones.
    letters : largest heights of part names and of node names (m).
    """

    thickness: float
    count: int
    bolt: float
    own: tuple[str, ...] = OWN
    letters: tuple[float, float] = (LABEL, WORKSHOP_SMALL)

    def numbers(self, family: str) -> tuple[int, ...]:
        """Return the layers of a family, counted from the top."""
        if family in self.own:
            return (self.count + self.own.index(family),)
        return tuple(range(0 if family == "major" else 1, self.count, 2))

    @property
    def sparing(self) -> bool:
        """True if node names are omitted where they have no room, as on models."""
        return self.letters[0] < LABEL

    @property
    def plates(self) -> int:
        """Layer of plates, below all others."""
        return self.count + len(self.own)

    def height(self, number: int) -> float:
        """Return the height of the middle of a layer over the surface (m)."""
        return ((self.count - 1) / 2 - number) * self.thickness

    def cover(self, family: str, number: int) -> float:
        """Return the height of a splice's cover plate (m), on the side without crossing members."""
        return self.height(number - 1 if family == "major" else number + 1)

    def packing(self, node: Node, families: dict[str, str]) -> int:
        """Return the number of packing layers between the two members of a node, by the families of all members."""
        one, two = (self.numbers(families[name]) for name in node.members)
        upper, lower = (one, two) if one[0] < two[0] else (two, one)
        return max(lower[0] - upper[-1] - 1, 0)

    @property
    def half_cover(self) -> float:
        """Distance from a splice to the end of its cover plate (m): two bolts to each side."""
        return (END + PITCH + END) * self.bolt

    def splice_bolts(self, width: float) -> tuple[tuple[float, float], ...]:
        """Return places (along, left) of a splice's bolts (m), in one row or two."""
        rows = (-width / 4, width / 4) if width / 4 >= 3 * self.bolt else (0.0,)  # two rows need wide parts
        along = (END * self.bolt, (END + PITCH) * self.bolt)
        return tuple((side * x, y) for side in (-1, 1) for x in along for y in rows)


@dataclass(frozen=True, eq=False)
class _End:
    """First or last end of a strip: places (k, 3) inwards from it, with arc lengths (k,)."""

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
        """Return the arc length from which the end is clear of a rival that it overlaps; None without an overlap."""
        least = 0.98 * (self.width + other.width) / 2
        away = np.asarray(cKDTree(other.places).query(self.places)[0])
        far = np.linalg.norm(other.places[0] - self.places[0]) > least
        if far or away[0] > least or (away <= least).all():
            return None
        return float(self.s[int((away > least).argmax())])


def stopped_courses(
    courses: Mapping[str, StripCourse], nodes: Mapping[str, Sequence[float]], joined: set[frozenset[str]], past: float
) -> dict[str, StripCourse]:
    """Return courses of one layer that stop before they run into others.

    A course ends `overhang` metres beyond its last node before the collision; without such a node, at the collision.
    nodes : arc lengths of nodes on each course.    joined : pairs of members that share a node, where they are notched.
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
    """Return those courses of members, by name, that stop because the member curls up at an end (see `uncurled`)."""
    lengths = {member.id: member.length for member in members}
    return {name: one for name, one in courses.items() if not one.closed and (one.begin > 0 or one.end < lengths[name])}


def courses_without_rest(stopped: Mapping[str, StripCourse], widths: Mapping[str, float]) -> set[str]:
    """Return the names of shortened courses that are shorter than wide (m), and so are not built."""
    return {name for name, one in stopped.items() if one.end - one.begin < widths[name]}


def _near_pairs(ends: Sequence[_End]) -> list[set[_End]]:
    found = [set[_End]() for _ in ends]
    for (i, one), (j, other) in combinations(enumerate(ends), 2):
        if one.name != other.name and np.linalg.norm(one.places[0] - other.places[0]) < (one.width + other.width) / 2:
            found[i].add(other)
            found[j].add(one)
    return found


def _stopped(course: StripCourse, last: bool, clear: float, nodes: Sequence[float], past: float) -> StripCourse:
    if last:
        before = [s + past for s in nodes if course.begin < s and s + past <= clear]
        return replace(course, end=max(before, default=clear))
    after = [s - past for s in nodes if s < course.end and s - past >= clear]
    return replace(course, begin=min(after, default=clear))
