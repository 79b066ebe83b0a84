"""Trimmed faces of STEP by members on their edges beside sharp corners: by hand."""

from dataclasses import replace

import numpy as np

from dsfab.export.network.flush import CLEAR, NEARLY, flush_at_corners
from dsfab.export.network.heights import places
from dsfab.export.network.model import NetWall
from dsfab.export.network.trimmed import SPLIT, TrimmedFace
from dsfab.export.splines import bernstein
from tests.test_export_network import flat_model

SQUARE, THICK = np.array([[0, 0], [100, 0], [100, 100], [0, 100.0]]), 40.0


def given(bump: float):
    """A plate whose edges are bent out of its surfaces, between their ends."""
    model, loop = flat_model(SQUARE)
    bent = bump * np.eye(4)[1][:, None] * np.array([0, 0, 1, 0, 0, 1])
    slow = np.array([0, 0, 0.2, 0])[:, None]  # so that heights are no polynomials of places
    edges = [replace(e, poles=e.poles + bent + slow * (e.poles[3] - e.poles[0])) for e in model.edges]
    walls = [NetWall([step], edges[step[0]].poles) for step in loop]
    flat = np.array([[[x, y, THICK / 2] for y in (-1, 33, 67, 101)] for x in (-1, 33, 67, 101)])
    face = TrimmedFace([loop], flat, flat - [0, 0, THICK], (np.eye(3), np.eye(3)), 4 * bump / 9, 0.0)
    return replace(model, edges=edges, walls=walls, vertices=[edge.poles[0] for edge in edges]), face


def test_at_corners_a_face_is_on_its_edges_as_far_as_a_fillet_goes():
    old, face = given(0.03)
    model, (found,) = flush_at_corners(old, [face])
    assert len(found.loops[0]) == 12
    x, ends = np.linspace(0, 1, 50), 0
    for e, ahead in found.loops[0]:
        P = model.poles((e, ahead))
        gap = float(np.abs(found.gaps(bernstein(x) @ P)).max())
        assert gap <= found.gap + 1e-4
        if {tuple(P[0, :2]), tuple(P[3, :2])} & set(map(tuple, SQUARE.tolist())):
            ends += 1
            assert gap < NEARLY
            assert np.linalg.norm(P[3, :3] - P[0, :3]) >= CLEAR * THICK - 0.1
    assert ends == 8
    assert found.exact
    assert 1e-4 < found.gap <= SPLIT
    assert sorted(found.loops[0]) == sorted(step for wall in model.walls for step in wall.steps)


def test_inside_a_face_stays_where_it_was(monkeypatch):
    """Of a sphere one went 1.4 mm away to run through four edges; where it has to, it is left as it is."""
    old, face = given(0.03)
    _, (found,) = flush_at_corners(old, [face])
    inside = np.array([[x, y, 0.0] * 2 for x in (20, 50, 80) for y in (20, 50, 80)])
    assert found.exact
    assert np.abs(found.gaps(inside) - face.gaps(inside)).max() < found.gap
    monkeypatch.setattr("dsfab.export.network.flush.MOVED", 1e-6)
    _, (kept,) = flush_at_corners(old, [face])
    assert not kept.exact


def test_a_face_that_would_be_too_far_off_its_other_edges_stays():
    old, face = given(30.0)
    _, (found,) = flush_at_corners(old, [face])
    assert not found.exact
    np.testing.assert_array_equal(found.outer, face.outer)


def test_places_are_found_over_a_parallelogram_in_a_plane_of_any_direction():
    rng = np.random.default_rng(1)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    x, y, uv = *np.meshgrid(*[np.linspace(0, 1, 4)] * 2, indexing="ij"), rng.random((20, 2))
    skew, heights = np.array([[100.0, 20], [-30, 60]]), [rng.normal(size=(k, 1)) for k in (16, 20)]
    poles, points = (
        np.hstack([[5, 7] + at @ skew, z]) @ axes
        for at, z in zip((np.stack([x, y], axis=2).reshape(16, 2), uv), heights, strict=True)
    )
    np.testing.assert_allclose(places(poles.reshape(4, 4, 3), axes, points), uv, atol=1e-12)


def test_a_face_without_corners_stays_as_it_is():
    old, face = given(0.03)
    model, (found,) = flush_at_corners(replace(old, walls=[]), [face])
    assert model.edges == old.edges
    assert found.outer is face.outer
