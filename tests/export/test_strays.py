"""STEP by members: trimmed faces that stray from the skins where none of their points are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.arrays import Floats
from dsfab.export.cad.step.by_members.trimmed import trimmed_face
from dsfab.export.cad.step.by_members.trimmed_corrections import without_strays
from tests.export.member_networks import asked, flat_model

SQUARE = np.array([[0, 0], [200, 0], [200, 200], [0, 200.0]])


def to_bump(height: float) -> Callable[[Floats], Floats]:
    """The way from points (k, 6) to skins that rise between the edges of `SQUARE_ANGLE`, which they hold."""

    def away(Q: Floats) -> Floats:
        way = np.zeros_like(Q)
        x, y = (Q[:, :2] + Q[:, 3:5]).T / 400
        for i, z in ((2, 20), (5, -20)):
            way[:, i] = z + 16 * height * x * (1 - x) * y * (1 - y) - Q[:, i]
        return way

    return away


@pytest.mark.parametrize(("height", "moved"), [(0.5, False), (9.0, True)])
def test_a_face_without_points_follows_the_skins(height, moved):
    """What is near enough stays as it is, to the last digit."""
    model, loop = flat_model(SQUARE)
    limits, none, away = asked(0.01, 1.0), np.zeros((0, 6)), to_bump(height)
    face = trimmed_face(model, [loop], none, limits)
    (found,) = without_strays(model, {7: face}, {7: none}, away, limits).values()
    assert (found is not face) == moved
    middle = found.gaps(np.array([[100.0, 100, 20 + height, 100, 100, -20 + height]]))
    assert np.abs(middle).max() < limits.off
    assert found.gap < limits.gap


def test_upright_skins_beside_a_face_do_not_count_as_the_face():
    model, loop = flat_model(SQUARE)
    limits, none = asked(0.01, 1.0), np.zeros((0, 6))
    face = trimmed_face(model, [loop], none, limits)

    def upright(Q: Floats) -> Floats:
        return np.tile([50.0, 0, 30, 10, 0, 70], (len(Q), 1))

    (found,) = without_strays(model, {7: face}, {7: none}, upright, limits).values()
    np.testing.assert_allclose(found.outer, face.outer, atol=1e-9)


def test_faces_with_a_measured_distance_from_the_mesh_stay():
    model, loop = flat_model(SQUARE)
    limits, none = replace(asked(0.01, 1.0), beyond_mesh=lambda points: np.ones(len(points))), np.zeros((0, 6))
    face = trimmed_face(model, [loop], none, limits)
    assert without_strays(model, {7: face}, {7: none}, to_bump(9), limits) == {7: face}


def test_a_model_without_faces_needs_no_distance():
    assert without_strays(flat_model(SQUARE)[0], {}, {}, to_bump(9), asked(0.01, 1.0)) == {}
