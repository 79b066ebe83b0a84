"""Trimmed faces of STEP by members on their edges beside sharp corners: by hand."""

from dataclasses import replace

import numpy as np

from dsfab.export.cad.step.by_members.model import NetEdge, NetWall
from dsfab.export.cad.step.by_members.patches import places
from dsfab.export.cad.step.by_members.sharp_corners import FILLET_SHARE, FLUSH_TOLERANCE, INNER_SHARE, flush_at_corners
from dsfab.export.cad.step.by_members.trimmed import SPLIT, TrimmedFace
from dsfab.export.splines import bernstein
from tests.export.member_networks import flat_model

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
            assert gap < FLUSH_TOLERANCE
            assert np.linalg.norm(P[3, :3] - P[0, :3]) >= FILLET_SHARE * THICK - 0.1
    assert ends == 8
    assert found.exact
    assert 1e-4 < found.gap <= SPLIT
    assert sorted(found.loops[0]) == sorted(step for wall in model.walls for step in wall.steps)


def test_the_inside_of_a_face_does_not_move(monkeypatch):
    """Of a sphere one went 1.4 mm away to run through four edges; where it has to, it is left as it is."""
    old, face = given(0.03)
    _, (found,) = flush_at_corners(old, [face])
    inside = np.array([[x, y, 0.0] * 2 for x in (20, 50, 80) for y in (20, 50, 80)])
    assert found.exact
    assert np.abs(found.gaps(inside) - face.gaps(inside)).max() < found.gap
    monkeypatch.setattr("dsfab.export.cad.step.by_members.sharp_corners.MOVED", 1e-6)
    _, (kept,) = flush_at_corners(old, [face])
    np.testing.assert_array_equal(kept.outer, face.outer)


def test_rims_are_moved_onto_a_face_that_stays(monkeypatch):
    """Between a corner and where it is cut; walls are along them, and what they move by fades."""
    old, face = given(0.03)
    monkeypatch.setattr("dsfab.export.cad.step.by_members.sharp_corners.MOVED", 1e-6)
    model, (kept,) = flush_at_corners(old, [face])
    x, at_corners = np.linspace(0, 1, 50), [e for wall in old.walls for e, _ in wall.steps]
    gaps = {e: np.abs(kept.gaps(bernstein(x) @ model.poles((e, True)))).max() for e, _ in kept.loops[0]}
    assert sum(gap < FLUSH_TOLERANCE for gap in gaps.values()) == 2 * len(at_corners)
    assert max(gaps.values()) <= kept.gap + 1e-4 <= 2 * face.gap
    assert kept.exact
    assert len(model.walls) == len(gaps) == 12
    for wall in model.walls:
        np.testing.assert_array_equal(wall.poles, model.poles(wall.steps[0]))
    for edge in model.edges:
        np.testing.assert_array_equal(edge.poles[[0, 3]], [model.vertices[edge.start], model.vertices[edge.end]])


def test_a_rim_stays_where_a_seam_ends_that_its_face_is_not_on(monkeypatch):
    old, face = given(0.03)
    monkeypatch.setattr("dsfab.export.cad.step.by_members.sharp_corners.MOVED", 1e-6)
    corner = old.vertices[0]
    seam = NetEdge(0, len(old.vertices), corner - np.linspace(0, 30, 4)[:, None] * np.array([1.0, 0, 0] * 2))
    more = replace(old, edges=[*old.edges, seam], vertices=[*old.vertices, seam.poles[3]])
    model, _ = flush_at_corners(more, [face])
    np.testing.assert_array_equal(model.vertices[0], corner)
    assert all(np.abs(model.vertices[v] - more.vertices[v]).max() == 0 for v in (0, len(old.vertices)))


def test_edges_are_cut_as_far_from_corners_as_a_fillet_goes_on_the_inner_skin():
    old, face = given(0.03)
    half = np.array([1, 1, 1, 0.5, 0.5, 1])
    edges = [replace(edge, poles=edge.poles * half) for edge in old.edges]
    model, _ = flush_at_corners(replace(old, edges=edges, vertices=[v * half for v in old.vertices]), [face])
    ends = {e for e, edge in enumerate(model.edges) if min(edge.start, edge.end) < 4}
    short = [np.linalg.norm(model.edges[e].poles[3, 3:] - model.edges[e].poles[0, 3:]) for e in ends]
    assert min(short) >= INNER_SHARE * FILLET_SHARE * THICK - 0.1


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


def test_a_face_without_corners_is_unchanged():
    old, face = given(0.03)
    model, (found,) = flush_at_corners(replace(old, walls=[]), [face])
    assert model.edges == old.edges
    assert found.outer is face.outer
