"""Strips of one layer that run into each other at a crown: in a plane, where all of it is known."""

import numpy as np
import pytest
from shapely import Polygon

from dsfab.workshop.development import StripCourse
from dsfab.workshop.layers import shortened_courses

WIDTH, INNER, OUTER, RING, PAST = 0.1, 0.15, 2.0, 0.8, 0.036


def meridian(angle, inner=INNER, width=WIDTH):
    """A strip from the outside to the inside along a ray."""
    s = np.linspace(0, OUTER - inner, 40)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    rows = {"T": np.tile(-way, (40, 1)), "N": np.tile([0.0, 0.0, 1.0], (40, 1))}
    none = dict.fromkeys(("kg", "kn", "tg"), np.zeros(40))
    half = np.full(40, width / 2)
    P = (OUTER - s)[:, None] * way
    return StripCourse(s=s, P=P, **rows, **none, left=half, right=half, begin=0.0, end=float(s[-1]), closed=False)


def outline(course):
    (P, T, N), half = course.frame_at(np.array([course.begin, course.end])), WIDTH / 2
    left = half * np.cross(N, T)
    return Polygon([*(P - left)[:, :2], *(P + left)[::-1, :2]])


def crown(count):
    courses = {f"B{k:02d}": meridian(2 * np.pi * k / count) for k in range(count)}
    nodes = {name: [OUTER - RING, OUTER - INNER] for name in courses}
    return courses, nodes


@pytest.mark.parametrize("count", [12, 24, 25])
def test_meridians_beyond_the_room_at_the_crown_stop_at_their_last_node(count):
    """Two ends at a radius r, m of n meridians apart, are 2 r sin(pi m / n) from each other."""
    courses, nodes = crown(count)
    stopped = shortened_courses(courses, nodes, set(), PAST)
    apart = next(m for m in range(1, count) if 2 * INNER * np.sin(np.pi * m / count) > 0.98 * WIDTH)
    assert count - len(stopped) == count // apart
    assert [one.end for one in stopped.values()] == pytest.approx(np.full(len(stopped), OUTER - RING + PAST))
    built = [outline(one) for one in (courses | stopped).values()]
    shared = [one.intersection(other).area for k, one in enumerate(built) for other in built[:k]]
    assert max(shared) < 0.05 * WIDTH**2  # corners of ends that touch by a fiftieth of their width


def test_separate_or_notched_strips_stay_whole():
    courses, nodes = crown(8)
    assert shortened_courses(courses, nodes, set(), PAST) == {}
    courses, nodes = crown(24)
    every = {frozenset((one, other)) for one in courses for other in courses}
    assert shortened_courses(courses, nodes, every, PAST) == {}


def test_meridians_without_nodes_stop_before_they_touch():
    courses, _ = crown(24)
    stopped = shortened_courses(courses, {name: [] for name in courses}, set(), PAST)
    for one in stopped.values():
        radius = OUTER - one.end
        assert INNER < radius < 0.98 * WIDTH / (2 * np.sin(np.pi / 24)) + WIDTH
