"""STEP by members: curves and patches of degree 2 where cubics are nearly that, and what is written of them."""

import re

import numpy as np
import pytest

from dsfab.export.cad.step.by_members.curves import (
    BOW_FACTOR,
    PARABOLA_SHARE,
    ChainCurve,
    as_parabolas,
    curves_as_parabolas,
    fewest_poles,
    patches_as_parabolas,
)
from dsfab.export.cad.step.by_members.draft import NetWriter, member_draft, wanted_gap
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetPatch
from dsfab.export.cad.step.by_members.patches import FaceLimits, coons
from dsfab.export.cad.step.by_members.trimmed import height_surface
from dsfab.export.cad.step.entities import StepEntities
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.splines import bernstein
from tests.export.member_networks import cylinder_grid, cylinder_strip, draft_of

ANYWHERE = np.array([[-np.inf] * 3, [np.inf] * 3])


def both_skins(line: np.ndarray) -> np.ndarray:
    """(k, 6) poles of a curve on two skins, 40 mm apart in z, from those of one (k, 3)."""
    return np.concatenate([line + [0, 0, 20.0], line - [0, 0, 20.0]], axis=1)


def wavy(x: float, y: float = 0.0, z: float = 0.0) -> ChainCurve:
    """A parabola 300 mm long, 8 mm deep, with a third difference of (x, y, z) millimetres."""
    line = np.array([[0.0, 0, 0], [100, 5, 3], [200, 5, 3], [300, 0, 0]])
    line[1] += np.array([x, y, z]) / 6
    line[2] -= np.array([x, y, z]) / 6
    return ChainCurve(np.array([0.0, 1.0]), both_skins(line)[None])


def test_the_parabola_of_a_cubic_goes_through_its_ends_and_its_middle():
    P = np.random.default_rng(3).uniform(-1e3, 1e3, (4, 6))
    Q, x = as_parabolas(P, 0), np.linspace(0, 1, 2001)
    away = bernstein(x) @ (Q - P)
    np.testing.assert_allclose(away[[0, 1000, -1]], 0, atol=1e-9)
    third = np.abs(P[3] - P[0] - 3 * (P[2] - P[1]))
    np.testing.assert_allclose(np.abs(away).max(axis=0), BOW_FACTOR * third, rtol=1e-5)
    np.testing.assert_allclose(as_parabolas(Q, 0), Q, atol=1e-9)
    three = fewest_poles(Q, 0)
    assert three.shape == (3, 6)
    y = x[:, None]
    np.testing.assert_allclose(
        (1 - y) ** 2 * three[0] + 2 * y * (1 - y) * three[1] + y**2 * three[2], bernstein(x) @ Q, atol=1e-9
    )
    assert fewest_poles(P, 0) is not P
    np.testing.assert_array_equal(fewest_poles(P, 0), P)
    np.testing.assert_array_equal(fewest_poles(Q[::-1], 0), three[::-1])


@pytest.mark.parametrize(
    ("curve", "distance", "three"),
    [
        (wavy(2.0), 1.1, True),
        (wavy(2.0), 0.9, False),  # .096 mm off
        (wavy(0, 5.0), 9.0, True),
        (wavy(0, 5.5), 9.0, False),  # turned by more than half a degree in the sheet
        (wavy(0, 0, 2.5), 9.0, True),
        (wavy(0, 0, 2.8), 9.0, False),  # and by a quarter out of it
    ],
)
def test_nearly_parabolic_cubics_become_parabolas(curve, distance, three):
    (found,) = curves_as_parabolas([curve], distance, ANYWHERE)
    assert (len(fewest_poles(found.spans[0], 0)) == 3) == three
    assert (found is curve) != three


def test_curves_with_a_non_parabolic_span_or_a_far_pole_are_cubics():
    good, bad = wavy(1.0).spans, wavy(9.0).spans
    two = ChainCurve(np.array([0.0, 0.5, 1.0]), np.concatenate([good, bad + [300, 0, 0] * 2]))
    assert curves_as_parabolas([two], 1.0, ANYWHERE) == [two]
    curve, box = wavy(1.0), np.array([[-1.0, -1, -30], [301.0, 6, 30]])
    assert (curve.spans[0, :, 1] < 5.1).all(), "poles of the cubic are inside"
    assert curves_as_parabolas([curve], 1.0, box) == [curve]
    box[1, 1] = 7
    assert curves_as_parabolas([curve], 1.0, box) != [curve]


def patch(bump: float, wave: float) -> np.ndarray:
    """(1, 1, 4, 4, 6) a patch between parabolas; its bump is of degree 3, and one of its sides waves."""
    line = both_skins(np.array([[0.0, 0, 0], [100, 0, 6], [200, 0, 6], [300, 0, 0]]))
    side = both_skins(np.array([[0.0, 0, 0], [0, 80, 2], [0, 160, 2], [0, 240, 0]]))
    top = line + [0, 240, 0] * 2
    top[1:3, [2, 5]] += [[wave], [-wave]]
    P = coons(line[None], (side + [300, 0, 0] * 2)[None], top[None], side[None])
    P[0, 0, 1, 1:3, [2, 5]] += bump
    return P


def test_patches_between_parabolas_are_of_degree_2_where_that_is_near():
    def degrees(P: np.ndarray) -> tuple[int, ...]:
        return tuple(k - 1 for k in fewest_poles(fewest_poles(P[0, 0], 0), 1).shape[:2])

    P = patch(0.02, 0.0)
    Q = patches_as_parabolas(P, 1.0)
    assert degrees(P) == (3, 2)
    assert degrees(Q) == (2, 2)
    assert np.abs(Q - P).max() <= PARABOLA_SHARE
    for side in (np.s_[:, :, 0], np.s_[:, :, -1], np.s_[:, :, :, 0], np.s_[:, :, :, -1]):
        np.testing.assert_allclose(Q[side], P[side], atol=1e-9)
    assert degrees(patches_as_parabolas(patch(2.0, 0.0), 1.0)) == (3, 2), "it would be half a millimetre off"
    assert degrees(patches_as_parabolas(patch(0.02, 1.0), 1.0)) == (3, 2), "a side is a cubic"


def test_parabolas_have_three_poles_and_bound_their_faces():
    P = patch(0.0, 1.0)[0, 0]
    sides = [P[:, 0], P[3], P[::-1, 3], P[0, ::-1]]
    model = NetModel(vertices=[side[0] for side in sides])
    model.edges += [NetEdge(i, (i + 1) % 4, side) for i, side in enumerate(sides)]
    model.patches.append(NetPatch([(i, True) for i in range(4)], P))
    NetWriter(new := StepEntities(), model, 40.0).faces([], {})
    text = "".join(new.text)
    assert sorted(re.findall(r"B_SPLINE_CURVE_WITH_KNOTS\('',(\d)", text)) == ["2"] * 6 + ["3"] * 2  # on each skin
    assert re.findall(r"B_SPLINE_SURFACE_WITH_KNOTS\('',(\d),(\d)", text) == [("3", "2")] * 2
    points = {n: np.array(x.split(","), float) for n, x in re.findall(r"(#\d+)=CARTESIAN_POINT\('',\((.*?)\)\)", text)}
    *curves, outer, inner = (
        np.array([points[n] for n in re.findall(r"#\d+", line)[1:]]) for line in text.splitlines() if "B_SPLINE" in line
    )
    x = np.linspace(0, 1, 23)[:, None]
    hats = {3: np.hstack([(1 - x) ** 2, 2 * x * (1 - x), x**2]), 4: bernstein(x[:, 0])}
    for s, surface in enumerate((outer, inner)):
        grid = surface.reshape(4, 3, 3)
        for i, side in enumerate((grid[:, 0], grid[3], grid[::-1, 2], grid[0, ::-1])):
            curve = curves[2 * i + s]
            np.testing.assert_allclose(hats[len(curve)] @ curve, hats[len(side)] @ side, atol=1e-7, rtol=0)


def test_faces_across_a_cylinder_have_degree_2_and_faces_around_it_degree_3():
    """The outlines of these are curves of a quarter of a turn."""
    part, _, _ = draft_of(surface := cylinder_strip(), cylinder_grid(surface))
    text = member_draft(part, SolidPlan(part)).text
    degrees = re.findall(r"B_SPLINE_SURFACE_WITH_KNOTS\('',(\d),(\d)", text)
    assert [degrees.count(both) for both in (("2", "2"), ("2", "1"))] == [4, 4]
    assert degrees.count(("3", "3")) >= 8
    assert text.count("B_SPLINE_CURVE_WITH_KNOTS('',2,") > 0.3 * text.count("B_SPLINE_CURVE_WITH_KNOTS('',3,")


@pytest.mark.parametrize(("bend", "degree"), [(1e-3, 2), (1.0, 3)])
def test_a_trimmed_face_with_quadric_edges_is_a_quadric(bend, degree):
    """A square of 200 mm on a paraboloid, which rises by some millimetres with the third power of x."""

    def point(x, y):
        return np.stack([x, y, (x**2 + y**2) / 4000 + bend * (x / 100) ** 3], axis=1)

    t = np.linspace(-100, 100, 41)
    one = np.full_like(t, 100.0)
    edges = np.concatenate([point(t, -one), point(one, t), point(-t, one), point(-one, -t)])
    u, v = np.meshgrid(t[5:-5:5], t[5:-5:5])
    inside = point(u.ravel(), v.ravel())
    poles, _, gap, _ = height_surface(inside, edges, np.zeros((0, 3)), np.eye(3), FaceLimits(0.01, 3.0, ANYWHERE))
    assert len(poles) - 1 == degree
    assert gap <= 0.01


def test_a_quadric_with_far_poles_is_written_with_the_poles_of_a_cubic():
    """The ends of a dome's face of 1 m are 50 mm lower than its middle: OCCT draws its box around poles."""
    t = np.linspace(-500, 500, 41)
    x, y = (np.concatenate(some) for some in ((t, 0 * t + 500, -t, 0 * t - 500), (0 * t - 500, t, 0 * t + 500, -t)))
    edges = np.stack([x, y, -(x**2 + y**2) / 10000], axis=1)
    for flatter, count in ((1, 4), (10, 3)):
        given = edges / [1, 1, flatter]
        inside = np.array([[0, 0, 0], [200, 0, -4 / flatter]])
        poles, *_ = height_surface(inside, given, np.zeros((0, 3)), np.eye(3), FaceLimits(0.01, 3.0, ANYWHERE))
        assert len(poles) == count
        assert poles[..., 2].max() < 18


def test_gaps_are_narrow_enough_at_a_hundredth_of_a_millimetre_but_in_thin_sheets():
    assert [wanted_gap(t) for t in (60.0, 16.0, 3.0)] == pytest.approx([0.015, 0.01, 0.002])
