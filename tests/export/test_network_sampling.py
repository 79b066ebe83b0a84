"""Where trimmed faces of STEP by members are farthest from their seams: by hand."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.export.cad.step.by_members.model import NetWall
from dsfab.export.cad.step.by_members.trimmed import SPLIT, TrimmedFace
from dsfab.export.cad.step.by_members.trimmed_corrections import SAMPLES, with_sampled_peaks
from dsfab.export.splines import bernstein
from tests.export.member_networks import flat_model

SQUARE, THICK = np.array([[0, 0], [100, 0], [100, 100], [0, 100.0]]), 40.0
ALLOWED = 1e-5
"""Share of its tolerance that OCCT lets an edge's gap be more."""


def given(bumps: list[float], steep: float = 0.0):
    """A plate with walls on two sides and seams on the others; edges are bent out of it by a share of their length."""
    model, loop = flat_model(SQUARE)
    edges = list(model.edges)
    for (e, ahead), bump in zip(loop, bumps, strict=True):
        row = 1 if ahead else 2
        edges[e] = replace(edges[e], poles=edges[e].poles + bump * np.eye(4)[row][:, None] * [0, 0, 1, 0, 0, 1])
    tilt = np.array([[1, 0, steep], [0, 1, 0], [0, 0, 1.0]])
    both = np.kron(np.eye(2), tilt)
    edges = [replace(e, poles=e.poles @ both) for e in edges]
    walls = [NetWall([step], edges[step[0]].poles) for step in (loop[0], loop[2])]
    flat = np.array([[[x, y, THICK / 2] for y in (-1, 33, 67, 101)] for x in (-1, 33, 67, 101)]) @ tilt
    gap = 4 * max(map(abs, bumps)) / 9
    face = TrimmedFace([loop], flat, flat - [0, 0, THICK], (np.eye(3), np.eye(3)), gap, 0.0)
    return replace(model, edges=edges, walls=walls, vertices=[edge.poles[0] for edge in edges]), face


def short(model, face, step):
    """By what share the widest of the places at which OCCT looks is less than the widest gap of an edge."""
    P = model.poles(step)
    dense, seen = (np.abs(face.gaps(bernstein(np.linspace(0, 1, k)) @ P)).max(axis=0) for k in (4001, SAMPLES))
    return float((1 - seen / dense).max())


@pytest.mark.parametrize("steep", [0.0, 0.5])
@pytest.mark.parametrize("bumps", [[0.03, 0.02, -0.03, 0.025], [0.0, 0.02, 0.0, -0.004]])
def test_seams_have_their_widest_gap_where_occt_looks(bumps, steep):
    model, face = given(bumps, steep)
    (found,) = with_sampled_peaks(model, [face])
    seams, walls = (face.loops[0][1], face.loops[0][3]), (face.loops[0][0], face.loops[0][2])
    assert min(short(model, face, step) for step in seams) > 100 * ALLOWED
    assert max(short(model, found, step) for step in seams) < ALLOWED
    for step in walls:
        assert np.abs(found.gaps(bernstein(np.linspace(0, 1, 9)) @ model.poles(step))).max() <= 1.2 * face.gap
    assert found.outer.shape == face.outer.shape
    assert abs(found.gap / face.gap - 1) < 0.2


def test_the_inside_of_a_face_hardly_moves():
    model, face = given([0.03, 0.02, -0.03, 0.025])
    (found,) = with_sampled_peaks(model, [face])
    inside = np.array([[x, y, 0.0] * 2 for x in (20, 50, 80) for y in (20, 50, 80)])
    assert 0 < np.abs(found.gaps(inside) - face.gaps(inside)).max() < face.gap / 4


def test_a_face_whose_gap_is_too_wide_to_be_split_stays():
    model, face = given([0.0, 4 * SPLIT, 0.0, 4 * SPLIT])
    (found,) = with_sampled_peaks(model, [face])
    assert found.outer is face.outer
    assert found.inner is face.inner


def test_inner_edges_are_unchanged():
    """No fillet of an outline ends there."""
    model, face = given([0.03, 0.02, -0.03, 0.025])
    (found,) = with_sampled_peaks(replace(model, walls=[]), [face])
    assert found is face


def test_all_digits_of_a_face_very_near_to_a_seam_count():
    model, face = given([0.0, 0.02, 0.0, 0.03])
    assert not with_sampled_peaks(model, [face])[0].exact
    model, face = given([0.0, 0.02, 0.0, 1e-4])
    assert with_sampled_peaks(model, [face])[0].exact


def arched(model, face, bend):
    """The same, bent upwards along the seams by `bend` times the square of y."""
    B = bernstein(np.linspace(0, 1, 4))
    rise = np.linalg.inv(B) @ (bend * (B @ np.array([-1, 33, 67, 101.0])) ** 2)
    edges = []
    for edge in model.edges:
        z = np.linalg.inv(B) @ (bend * (B @ edge.poles[:, 1]) ** 2)
        edges.append(replace(edge, poles=edge.poles + z[:, None] * [0, 0, 1, 0, 0, 1]))
    outer, inner = (skin + rise[:, None] * [0, 0, 1] for skin in (face.outer, face.inner))
    vertices = [edge.poles[0] for edge in edges]
    return replace(model, edges=edges, vertices=vertices), replace(face, outer=outer, inner=inner)


@pytest.mark.parametrize(("bump", "exact"), [(0.00176, True), (0.00185, False)])
def test_gaps_beside_an_arched_face_are_measured_at_right_angles_to_it(bump, exact):
    """The face rises by 4 in 3 where a gap is widest: .8 um along z are .5 um, the limit of an exact face."""
    model, face = arched(*given([0.0, bump, 0.0, bump]), 0.01)
    (found,) = with_sampled_peaks(model, [face])
    assert found.exact == exact
