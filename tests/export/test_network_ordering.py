"""Walls and edges of STEP by members, so ordered that corners take a fillet: by hand, and by OCCT (slow)."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.export.cad.step.by_members import draft
from dsfab.export.cad.step.by_members.draft import member_draft
from dsfab.export.cad.step.by_members.fillet_edges import CLEAR_EDGE, LONGEST_SHARE, edge_stops, with_ordered_walls
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetPatch, NetWall
from dsfab.export.cad.step.by_members.trimmed import TrimmedFace
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.worker import use
from dsfab.export.cad.step.worker.shapes import read
from dsfab.surface import Surface
from tests.export.member_networks import RADIUS, cylinder_strip, draft_of, flat_model, striped

THICK = 40.0


def plate_model(corners: np.ndarray, turned: set[int], order: list[int]) -> NetModel:
    """A plate with straight sides, a wall each, in an order; some of its edges run clockwise."""
    model, loop = flat_model(corners)
    edges = [NetEdge(e.end, e.start, e.poles[::-1]) if i in turned else e for i, e in enumerate(model.edges)]
    steps = [(i, i not in turned) for i, _ in loop]
    walls = [NetWall([steps[i]], model.edges[i].poles) for i in order]
    vertices = [edge.poles[0] for edge in model.edges]
    return NetModel(vertices, edges, walls, [NetPatch(steps, np.zeros((4, 4, 6)))])


def line(model: NetModel, loop) -> np.ndarray:
    """(k, 4, 6) the poles along a loop."""
    return np.array([model.edges[e].poles[:: 1 if ahead else -1] for e, ahead in loop])


def ends_at(model: NetModel, wall: NetWall, first: bool) -> bool:
    """Whether the edge of a wall where it begins, or ends, ends there."""
    return wall.steps[0 if first else -1][1] != first


def following(walls: list[NetWall], model: NetModel) -> bool:
    last, start = ([line(model, wall.steps)[i, i] for wall in walls] for i in (-1, 0))
    return all(np.array_equal(a, b) for a, b in zip(last, [*start[1:], start[0]], strict=True))


SQUARE = np.array([[0, 0], [100, 0], [100, 100], [0, 100.0]])


@pytest.mark.parametrize("turned", [set(), {0, 1, 2, 3}, {1}, {0, 3}])
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 0, 3, 1]])
def test_at_each_corner_an_edge_ends_of_the_wall_that_is_first(turned, order):
    given = plate_model(SQUARE, turned, order)
    model, _ = with_ordered_walls(given, [])
    assert following(model.walls, model)
    for i, wall in enumerate(model.walls[:-1]):
        assert ends_at(model, wall, first=False), i
    assert ends_at(model, model.walls[0], first=True)
    assert len(model.walls[0].steps) == 2
    assert {len(wall.steps) for wall in model.walls[1:]} == {1}
    for e, edge in enumerate(model.edges):
        for node, end in ((edge.start, 0), (edge.end, -1)):
            np.testing.assert_array_equal(model.vertices[node], edge.poles[end], err_msg=str(e))


def test_faces_have_the_same_edges_as_walls_the_other_way_and_the_outline_stays():
    model, _ = with_ordered_walls(plate_model(SQUARE, {1}, [2, 0, 3, 1]), [])
    loop = model.patches[0].loop
    assert sorted(loop) == sorted(step for wall in model.walls for step in wall.steps)
    points = line(model, loop)[:, [0, -1]]
    np.testing.assert_array_equal(points[:-1, 1], points[1:, 0])
    assert {tuple(p[:2]) for p in points[:, 0]} == {*map(tuple, SQUARE.tolist()), *_middles(model)}


def _middles(model: NetModel) -> set[tuple[float, ...]]:
    return {tuple(p[:2].tolist()) for p in model.vertices[4:]}


def test_an_outline_begins_at_a_smooth_vertex():
    """A pentagon with a vertex in the middle of a side."""
    model, _ = with_ordered_walls(plate_model(np.insert(SQUARE, 1, [50.0, 0], axis=0), set(), [3, 4, 0, 1, 2]), [])
    assert [len(wall.steps) for wall in model.walls] == [1] * 5
    np.testing.assert_array_equal(line(model, model.walls[0].steps)[0, 0, :2], [50, 0])
    assert all(ends_at(model, wall, first=False) for wall in model.walls)


@pytest.mark.parametrize("size", [LONGEST_SHARE, 30.0])
def test_long_edges_are_cut_near_their_end_corners(size):
    model, _ = with_ordered_walls(plate_model(size * THICK * SQUARE / 100, set(), [0, 1, 2, 3]), [])
    assert [len(wall.steps) for wall in model.walls] == ([2, 1, 1, 1] if size <= LONGEST_SHARE else [3, 2, 2, 1])
    ending = [line(model, wall.steps)[-1] for wall in model.walls[:-1]]
    assert max(np.linalg.norm(P[-1, :3] - P[0, :3]) for P in ending) <= LONGEST_SHARE * THICK + 1e-9


@pytest.mark.parametrize("turn", [30, 60, 90, 120])
def test_fillets_of_asked_radius_take_a_share_of_edges_that_occt_finds(turn):
    """An eighth of the thickness, or 10 mm, of a sheet of 150; with 1.4 % it found the wrong end."""
    poles, half = flat_model(30 * THICK * SQUARE / 100)[0].edges[0].poles, np.tan(np.radians(turn / 2))
    (at,) = edge_stops(poles, None, (0.0, half), (False, True))
    assert 0.015 < half / 15 / (30 * (1 - at)) < 0.05
    assert edge_stops(poles, None, (0.0, half), (False, False)) == []


def test_an_edge_is_cut_at_its_largest_distance_from_the_trimmed_face():
    """Heights 3 x^2 (1 - x) above a plane are largest at 2/3; the tolerance is met there whatever a fillet takes."""
    given = plate_model(SQUARE, set(), [0, 1, 2, 3])
    edges = list(given.edges)
    edges[1] = replace(edges[1], poles=edges[1].poles + 0.01 * np.eye(4)[2][:, None] * np.array([0, 0, 1, 0, 0, 1]))
    flat = np.array([[[x, y, 20.0] for y in (-1, 101)] for x in (-1, 101)])
    face = TrimmedFace([given.patches[0].loop], flat, flat - [0, 0, 40], (np.eye(3), np.eye(3)), 0.01, 0.0)
    model, (found,) = with_ordered_walls(replace(given, edges=edges, patches=[]), [face])
    (wall,) = [
        wall for wall in model.walls if line(model, wall.steps)[0, 0, 0] == 100 == line(model, wall.steps)[-1, -1, 0]
    ]
    assert [len(w.steps) for w in model.walls if w is not wall] == [2, 1, 1]
    assert sorted(found.loops[0]) == sorted(step for one in model.walls for step in one.steps)
    inside = line(model, wall.steps)[1:, 0, 1] / 100
    assert inside == pytest.approx([2 / 3], abs=1 / 128)
    assert CLEAR_EDGE * THICK < 100 * inside[0] < 100 - CLEAR_EDGE * THICK


@pytest.mark.parametrize(
    ("outer", "inner", "at"),
    [
        ((0, 0, 1, 0), (0, 0, 0, 0), [2 / 3]),
        ((0, 0, 1, 0), (1, 0, 0, 0), [2 / 3]),
        ((0, 0, 1, 0), (0, 0, 0, 1), [2 / 3]),
        ((1, 0, 0, 0), (0, 0, 0, 1), []),
    ],
)
def test_a_gap_may_be_widest_at_the_corner_or_where_an_edge_is_cut(outer, inner, at):
    """Where it is widest between its ends, above one skin at least, an edge is cut."""
    poles = flat_model(SQUARE)[0].edges[0].poles
    poles = poles + 0.01 * np.outer(outer, np.eye(6)[2]) + 0.01 * np.outer(inner, np.eye(6)[5])
    flat = np.array([[[x, y, 20.0] for y in (-1, 101)] for x in (-1, 101)])
    face = TrimmedFace([], flat, flat - [0, 0, 40], (np.eye(3), np.eye(3)), 0.01, 0.0)
    assert edge_stops(poles, face, (1.0, 0.0), (False, False)) == pytest.approx(at, abs=1 / 128)


def ball_grid() -> tuple[Surface, object]:
    """Three members along a part of a sphere and three across, with four openings between them."""
    a, b = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.3, 0.3, 25), indexing="ij")
    V = RADIUS * np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=2).reshape(-1, 3)
    surface = Surface(V, cylinder_strip(40, 24).F)
    C = surface.centroids
    x, y = np.arctan2(C[:, 1], C[:, 0]), np.arcsin(C[:, 2] / np.linalg.norm(C, axis=1))
    along, across = (np.abs(y) > 0.15) | (np.abs(y) < 0.03), (np.abs(x) > 0.4) | (np.abs(x) < 0.05)
    return surface, striped(surface, along | across, (along + 2 * across).astype(np.int64))


@pytest.mark.slow
def test_occt_rounds_all_corners_of_openings_in_a_sphere(tmp_path, monkeypatch):
    """8 of 20, were walls in no order."""
    surface, sheet = ball_grid()
    part, _, _ = draft_of(surface, sheet)
    (path := tmp_path / "grid.step").write_text(member_draft(part, SolidPlan(part)).text)
    monkeypatch.setattr(use, "FILLETS", 20)
    assert use.fillet_counts(read(path)) == (20, 20)
    monkeypatch.setattr(draft, "with_ordered_walls", lambda model, faces: (model, faces))
    path.write_text(member_draft(part, SolidPlan(part)).text)
    assert use.fillet_counts(read(path))[0] < 12
