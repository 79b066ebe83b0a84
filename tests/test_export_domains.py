"""STEP by members: quadrilaterals over which surfaces of trimmed regions are, and boxes around poles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.export.network.curves import ChainCurve
from dsfab.export.network.domains import SMALLER, domain, grid, places
from dsfab.export.network.draft import member_draft
from dsfab.export.network.lines import ChainLine
from dsfab.export.network.model import _strays
from dsfab.export.network.trimmed import TrimmedFace, trimmed_face
from dsfab.export.smooth.plan import SmoothPlan
from tests.test_export_network import cylinder_strip, draft_of, flat_model, striped

ELL = [[0.0, 0], [400, 0], [390, 60], [150, 80], [80, 150], [60, 390], [0, 400]]
SQUARE = [[0.0, 0], [300, 0], [300, 300], [0, 300]]


def dense(corners: list[list[float]]) -> np.ndarray:
    """(k, 2) points along a polygon."""
    P = np.array(corners)
    x = np.linspace(0, 1, 12, endpoint=False)[:, None]
    return np.concatenate([a + x * (b - a) for a, b in zip(P, np.roll(P, -1, axis=0), strict=True)])


def area(corners: np.ndarray) -> float:
    """Of a quadrilateral by both parameters."""
    one, two = corners[1, 1] - corners[0, 0], corners[0, 1] - corners[1, 0]
    return float(np.cross(np.append(one, 0), np.append(two, 0))[2]) / 2


def test_a_domain_goes_around_a_line_and_is_no_larger_than_the_rectangle():
    square, ell = domain(dense(SQUARE)), domain(dense(ELL))
    np.testing.assert_allclose(square, [[[-1, -1], [-1, 301]], [[301, -1], [301, 301]]], atol=1e-9)
    assert 0 < area(ell) < SMALLER * 400 * 400
    for line, corners in ((dense(SQUARE), square), (dense(ELL), ell)):
        uv = places(corners, line)
        assert uv.min() > 0
        assert uv.max() < 1


def test_a_domain_is_right_handed_however_a_region_is_turned():
    for turn in np.linspace(0, 6, 7):
        c, s = np.cos(turn), np.sin(turn)
        assert area(domain(dense(ELL) @ np.array([[c, s], [-s, c]]))) > 0


def test_a_triangle_stays_in_a_rectangle():
    """The quadrilateral of least area around it would have a corner that is nearly flat, or a side of 2 mm."""
    for top in ([[250.0, 200]], [[251.0, 200], [249.0, 200]]):
        corners = domain(dense([[0, 0], [500, 0], *top]))
        np.testing.assert_allclose(corners[:, :, 0], [[-1, -1], [501, 501]])


@settings(deadline=None, max_examples=30)
@given(st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.floats(-0.4, 1.0), st.floats(-0.4, 1.0))
def test_places_are_where_the_bilinear_surface_is(u, v, x, y):
    corners = np.array([[[0.0, 0], [x - 1, 2]], [[3, y / 2], [3 + x, 2 + y]]])
    point = np.einsum("a,b,abi->i", [1 - u, u], [1 - v, v], corners)
    np.testing.assert_allclose(places(corners, point[None])[0], [u, v], atol=1e-9)


def test_no_place_between_corners_is_given_to_a_point_beyond():
    corners = np.array([[[0.0, 0], [0, 2]], [[3, 0], [1, 1]]])
    x, y = np.meshgrid(np.linspace(-9, 9, 61), np.linspace(-9, 9, 61))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    uv = places(corners, points)
    inside = ((uv > 0) & (uv < 1)).all(axis=1)
    there = np.einsum("ka,kb,abi->ki", *(np.stack([1 - w, w], axis=1) for w in uv[inside].T), corners)
    np.testing.assert_allclose(there, points[inside], atol=1e-9)
    assert inside.any()


def test_poles_of_a_bilinear_surface_are_its_points():
    corners = domain(dense(ELL))
    poles = grid(corners, 3)
    np.testing.assert_allclose(poles[[0, 0, -1, -1], [0, -1, 0, -1]], corners.reshape(4, 2), atol=1e-9)
    np.testing.assert_allclose(poles[1, 1], np.einsum("a,b,abi->i", [2 / 3, 1 / 3], [2 / 3, 1 / 3], corners))


def ell_face() -> tuple[TrimmedFace, np.ndarray]:
    """Two members that meet at the corner of a sheet which rises by a tenth along both; with poles of its edges."""
    model, loop = flat_model(np.array(ELL))
    for edge in model.edges:
        edge.poles[:, [2, 5]] += 0.1 * (edge.poles[:, :1] + edge.poles[:, 1:2])
    points = np.concatenate([edge.poles for edge in model.edges])
    return trimmed_face(model, [loop], np.zeros((0, 6)), 0.01, 1.0), points


def test_poles_of_two_members_at_a_corner_are_not_opposite_to_it():
    face, points = ell_face()
    assert face.gap < 1e-6
    top = points[:, 2].max()
    assert face.outer[..., 2].max() < top + 12, "a rectangle's corner would be 40 mm above both"


def test_heights_over_a_quadrilateral_are_those_of_its_surface():
    face, points = ell_face()
    assert np.abs(face.gaps(points)).max() < 1e-6
    lifted = points + np.array([0, 0, 1.0] * 2)
    normal = face.axes[0][2]
    np.testing.assert_allclose(face.gaps(lifted), normal[2], atol=1e-6)


def test_cubics_are_divided_until_their_poles_are_in_a_box():
    """A rim of half a turn, which rises to .975 and whose poles are at 1.3."""
    spans = np.array([[[-1.0, 0, 0], [-1, 1.3, 0], [1, 1.3, 0], [1, 0, 0]]])
    curve = ChainCurve(np.array([0.0, 1.0]), np.concatenate([spans, 0.9 * spans], axis=2))
    line = ChainLine([(0, True), (1, True)], curve, np.array([0.0, 0.4, 1.0]))
    box = np.array([[-1.01, -0.01, -1], [1.01, 1.01, 1]])
    fine = line.with_poles_in(box)
    assert fine.curve.breaks[1] == 0.4, "where a chain ends"
    assert len(fine.curve.spans) > 2
    assert (fine.curve.spans[..., :3] <= box[1]).all()
    assert fine.curve.spans[[0, -1], [0, -1], :3].tolist() == spans[0, [0, -1]].tolist()
    assert (fine.curve.spans[1:, 0] == fine.curve.spans[:-1, 3]).all()
    x = np.linspace(0, 1, 33)
    np.testing.assert_allclose(fine.curve(x), curve(x), atol=1e-12)
    assert line.with_poles_in(np.array([[-2.0] * 3, [2.0] * 3])) is line
    beyond = line.with_poles_in(np.array([[2.0] * 3, [3.0] * 3])).curve
    assert np.diff(beyond.breaks).min() > 1 / 64, "it ends where nothing helps"


def test_patches_beside_the_skins_are_told_by_their_middles():
    """Two regions over a plane, of one and of two cells; the skins rise by .1 mm per metre and have a bump of 2 mm."""
    x = np.linspace(0, 300, 4)
    flat = np.stack(np.broadcast_arrays(x[:, None], x, 20.0, x[:, None], x, -20.0), axis=2)[None, None]
    second = np.concatenate([flat, flat + np.array([300, 0, 0] * 2)])

    def away(Q: np.ndarray) -> np.ndarray:
        way = np.zeros_like(Q)
        way[:, 2] = 1e-4 * Q[:, 0]
        way[:, 5] = -2.0 * (np.abs(Q[:, 3] - 450) < 100)
        return way

    assert _strays([flat, second], away).tolist() == pytest.approx([0.015, 2.0])
    assert _strays([], away).shape == (0,)


def test_a_region_whose_patches_are_beside_the_skins_is_trimmed(monkeypatch):
    """Of two regions of a cylinder one is not near enough."""
    given = cylinder_strip()
    angle = np.arctan2(*given.centroids.T[[2, 1]]) / (np.pi / 2)
    part, _, _ = draft_of(given, striped(given, label=(2 * angle).astype(np.int64)))
    assert member_draft(part, SmoothPlan(part)).trimmed == 0
    limit = SmoothPlan(part).limits.distance
    off = limit * np.array([1.0, 1.1])
    monkeypatch.setattr("dsfab.export.network.model._strays", lambda patches, _: off[-len(patches) :])
    assert member_draft(part, SmoothPlan(part)).trimmed == 2
