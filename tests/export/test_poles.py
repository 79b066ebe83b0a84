"""STEP by members: poles of curves stay in the box, and patches near the skins."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.export.cad.step.by_members.curves import ChainCurve
from dsfab.export.cad.step.by_members.draft import member_draft
from dsfab.export.cad.step.by_members.lines import ChainLine
from dsfab.export.cad.step.by_members.patches import FaceLimits, PatchBuilder, stray_distances
from dsfab.export.cad.step.by_members.trimmed import height_surface
from dsfab.export.cad.step.shared.plan import SolidPlan
from tests.export.member_networks import cylinder_strip, draft_of, striped


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


def test_patches_off_the_skins_are_found_by_their_middles():
    """Two regions over a plane, of one and of two cells; the skins rise by .1 mm per metre and have a bump of 2 mm."""
    x = np.linspace(0, 300, 4)
    flat = np.stack(np.broadcast_arrays(x[:, None], x, 20.0, x[:, None], x, -20.0), axis=2)[None, None]
    second = np.concatenate([flat, flat + np.array([300, 0, 0] * 2)])

    def away(Q: np.ndarray) -> np.ndarray:
        way = np.zeros_like(Q)
        way[:, 2] = 1e-4 * Q[:, 0]
        way[:, 5] = -2.0 * (np.abs(Q[:, 3] - 450) < 100)
        return way

    assert stray_distances([flat, second], away).tolist() == pytest.approx([0.015, 2.0])


def test_patches_are_made_anew_only_where_a_curve_around_is_another():
    """Of two regions over a plane, of which one has a side that is another, and then both as they were."""
    x, asked_at = np.linspace(0, 300, 4), list[int]()

    def region(left: float, bow: float) -> list[np.ndarray]:
        low, right, high = (
            np.stack(np.broadcast_arrays(left + u, v, 20.0, left + u, v, -20.0), axis=1)[None]
            for u, v in ((x, bow * x * (300 - x)), (np.full(4, 300.0), x), (x, np.full(4, 300.0)))
        )
        return [low, right, high, right - np.array([300, 0, 0] * 2)]

    def away(Q: np.ndarray) -> np.ndarray:
        asked_at.append(len(Q))
        return np.where(Q[:, :1] > 700, 5.0, 0.0) * np.ones(6)

    covering = PatchBuilder(away, FaceLimits(0.01, 1.0, np.zeros((2, 3))))
    first = covering([3, 4], [region(0, 0), region(600, 0)])
    assert first[0] is not None
    assert first[1] is None, "it is 5 mm off the skins"
    assert np.ptp(first[0][..., 0]) == pytest.approx(300)
    count = len(asked_at)
    assert count > 0
    again = covering([4, 3], [region(600, 0), region(0, 0)])
    assert again[0] is None
    assert again[1] is first[0]
    assert len(asked_at) == count
    (other,) = covering([3], [region(0, 1e-4)])
    assert len(asked_at) > count
    assert np.ptp(other - first[0]) > 1


def test_a_region_whose_patches_are_beside_the_skins_is_trimmed(monkeypatch):
    """Of two regions of a cylinder one is not near enough."""
    given = cylinder_strip()
    angle = np.arctan2(*given.centroids.T[[2, 1]]) / (np.pi / 2)
    part, _, _ = draft_of(given, striped(given, label=(2 * angle).astype(np.int64)))
    assert member_draft(part, SolidPlan(part)).trimmed == 0
    limit = SolidPlan(part).limits.distance
    off = limit * np.array([1.0, 1.1])
    monkeypatch.setattr(
        "dsfab.export.cad.step.by_members.patches.stray_distances", lambda patches, _: off[-len(patches) :]
    )
    assert member_draft(part, SolidPlan(part)).trimmed == 2


@pytest.mark.parametrize("turn", [1, -1])
def test_a_face_at_a_slanted_corner_is_over_a_parallelogram_if_a_rectangle_leaves_the_box(turn):
    """A rhombus on a paraboloid, whose sides are along no axis: those of a rectangle's corners that it has not are out
    of the box. Along which way an outline runs its sides is nothing to the face's direction."""
    way = np.array([[np.cos(a), np.sin(a), 0] for a in np.radians([25, 85])])
    x, rng = np.linspace(0, 300, 40)[:, None], np.random.default_rng(3)
    a, b = 300 * way
    edges = np.concatenate([x * way[0], a + x * way[1], a + b - x * way[0], b - x * way[1]])
    inside = 300 * rng.random((60, 2)) @ way
    for points in (edges, inside):
        points[:, 2] = 1e-4 * (points[:, 0] ** 2 + points[:, 1] ** 2)
    box = np.array([edges.min(axis=0), edges.max(axis=0)]) + [[-3.0] * 3, [3.0] * 3]
    free = FaceLimits(1e-3, 1.0, np.array([[-np.inf] * 3, [np.inf] * 3]))
    ways = turn * way[::turn]
    along = np.stack([way[0], np.cross([0, 0, 1], way[0]), [0, 0, 1]])
    poles, axes, gap, _ = height_surface(inside, edges, ways, along, replace(free, box=box))
    assert gap < 1e-6
    assert (poles >= box[0]).all()
    assert (poles <= box[1]).all()
    u, v = poles[-1, 0] - poles[0, 0], poles[0, -1] - poles[0, 0]
    assert np.cross(u, v) @ axes[2] > 0
    rectangle, *_ = height_surface(inside, edges, ways, along, free)
    assert (rectangle > box[1]).any()
