"""Guides that become members: on a plate in uniform tension, where the curve and all distances from it are known."""

import numpy as np
import pytest

from dsfab.core.errors import PatternError, PresetError
from dsfab.pattern import Guide, Stripes
from dsfab.pattern.guides import GuideError, GuideLine
from dsfab.preset.file import load_preset
from dsfab.surface.mesh import nearest_places
from tests.pattern.pulled_plates import pulled, towards
from tests.shapes import grid

MIDDLE = np.array([1.5, 1.5, 0.0])
SPACING = 0.375


def straight(angle: float, aside: float = 0.0, half: float = 1.0) -> list[list[float]]:
    """A straight curve at an angle, degrees, through the middle of the plate or so many metres aside."""
    along = np.array(towards(angle))
    across = np.array([-along[1], along[0], 0.0])
    return [(MIDDLE + aside * across + t * along).tolist() for t in (-half, half)]


def guided(*curves, **more):
    return pulled(guide=[{"curve": curve, "member": True, **more} for curve in curves])


def crossings(given, distance, near, family: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Places (k, 3) where a curve crosses edges of faces, by distances (n,) of the vertices from it, in faces of which
    all corners are `near` (n,); and how far the phase is from a whole number there."""
    surface, phase = given.surface, given.even.phases[family]
    rows = np.flatnonzero(near[surface.F].all(axis=1))
    places, off = [], []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        one, two = (distance[surface.F[rows, k]] for k in (a, b))
        cut = one * two < 0
        t = one[cut] / (one - two)[cut]
        at, z = surface.F[rows[cut]], phase.corners(surface)[rows[cut]]
        places.append((1 - t)[:, None] * surface.V[at[:, a]] + t[:, None] * surface.V[at[:, b]])
        value = (1 - t) * z[:, a] + t * z[:, b]
        off.append(np.where(phase.singular[rows[cut]], np.inf, np.abs(value - np.rint(value))))
    return np.concatenate(places), np.concatenate(off)


@pytest.mark.parametrize(("angle", "aside", "family"), [(0, 0.1, "major"), (25, -0.07, "major"), (70, 0.2, "minor")])
def test_a_stripe_runs_on_a_straight_curve(angle, aside, family):
    given = guided(straight(angle, aside), family=family, weight=0.0)
    along = np.array(towards(angle))
    to = given.surface.V - MIDDLE
    distance = to @ np.array([-along[1], along[0], 0.0]) - aside
    near = np.abs(to @ along) < 0.9
    _, off = crossings(given, distance, near, ("major", "minor").index(family))
    assert len(off) > 40
    assert off.max() < 0.004  # 1.5 mm: lines are not as near to each other everywhere
    assert given.even.steered.told == f"a {family} member follows the whole curve of pattern.guide.0"


def test_the_member_of_a_guide_has_the_usual_width_and_is_joined():
    given = guided(straight(25))
    sheet = given.sheet.subset()
    along = np.array(towards(25))
    across = np.array([-along[1], along[0], 0.0])
    width = 2 * Stripes(1.0, 0.0, 0.5).half_width * SPACING
    points = MIDDLE + np.linspace(-0.9, 0.9, 91)[:, None] * along
    for side in (-1, 1):
        off = nearest_places(points + side * 0.45 * width * across, sheet.surface.V, sheet.surface.F).distance
        assert off.max() < 0.03 * width
        beyond = nearest_places(points + side * 0.65 * width * across, sheet.surface.V, sheet.surface.F).distance
        assert 0.3 < (beyond > 0.05 * width).mean() < 0.95  # void, but where the other family joins it


def test_a_curve_that_bends_is_followed_within_a_face():
    """A circle: faces are flat and the curve is not, by edge^2 / 8 r between their corners."""
    turn = np.linspace(0, 2 * np.pi, 121)
    ring = (MIDDLE + 0.9 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)).tolist()
    given = guided(ring)
    radius = np.linalg.norm(given.surface.V - MIDDLE, axis=1)
    _, off = crossings(given, radius - 0.9, radius > 0)
    assert off.max() * SPACING < 1.5 * given.surface.mean_edge**2 / (8 * 0.9)
    assert "a major member follows the whole curve" in given.even.steered.told


def test_the_part_of_a_guide_beyond_the_surface_is_ignored():
    given = guided(straight(25, 0.0, 6.0))
    assert given.even.steered.told == "a major member follows the whole curve of pattern.guide.0"
    lifted = guided([[x, y, 0.05] for x, y, _ in straight(25, 0.0, 1.0)])
    assert lifted.even.steered.told == "a major member follows the whole curve of pattern.guide.0"


def test_a_guide_that_no_member_can_follow_gives_a_note():
    told = guided(straight(20), straight(-20)).even.steered.told
    assert "% of the curve of pattern.guide.0, because of another guide, an edge or a point" in told


def test_a_curve_across_the_stress_names_the_family_that_runs_there():
    told = guided(straight(80)).even.steered.told
    assert told.endswith(
        "stripes of the minor family already run along this curve: family = 'minor' bends members less"
    )


def test_invalid_member_guides_are_refused_in_one_sentence():
    with pytest.raises(GuideError, match="only a guide that is a curve can be a member; remove the key"):
        Guide(at={"pick": "all"}, direction=(1.0, 0.0, 0.0), member=True)
    with pytest.raises(PresetError, match=r"guide\.0 is a major member, but families = 'minor'; set the family"):
        load_preset("dome", {"pattern.families": "minor", "pattern.guide": [{"curve": straight(0), "member": True}]})
    with pytest.raises(PresetError, match="member"):
        load_preset("dome", {"pattern.guide": [{"curve": straight(0), "member": 3}]})
    with pytest.raises(PatternError, match=r"guide\.0: the curve is outside the surface"):
        guided([[0.5, -0.1, 0.0], [2.5, -0.1, 0.0]]).even  # noqa: B018


@pytest.mark.parametrize(("beyond", "is_kept"), [(0.7e-9, True), (1.4e-9, False)])
def test_a_guide_may_begin_beyond_the_edge_of_the_surface_by_a_rounding_error(beyond, is_kept):
    """Such as a curve that was drawn up to the edge; what is farther beyond is cut off."""
    plate = grid(4, 4, 1.0, 1.0)
    guide = Guide(curve=((-beyond * plate.size, 0.4, 0.0), (0.5, 0.4, 0.0)), member=True)
    (line,) = GuideLine.from_guides(plate, [guide])
    assert (line.points[0, 0] < 1e-6) == is_kept
