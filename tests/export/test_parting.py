"""STEP by members: trimmed regions whose surface does not meet their edges are divided by seams."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.limits import DEFLECTION
from dsfab.export.cad.step.by_members import trimmed_division
from dsfab.export.cad.step.by_members.model import NetModel, NetPatch, NetWall
from dsfab.export.cad.step.by_members.patches import FaceLimits
from dsfab.export.cad.step.by_members.trimmed import SPLIT, trimmed_face
from dsfab.export.cad.step.by_members.trimmed_division import HalvedOutline, allowance_used, divided_faces
from dsfab.export.splines import bernstein
from tests.export.member_networks import flat_model

LIMITS = FaceLimits(0.01, 1.0, np.array([[-np.inf] * 3, [np.inf] * 3]))


def folded_model(corners: list[list[float]], fold: float) -> tuple[NetModel, list]:
    """A region over corners (k, 2) that rises by a tenth beyond a line in its middle, if `fold` is 1."""
    model, loop = flat_model(np.array(corners, dtype=float))
    for i, edge in enumerate(model.edges):
        P = edge.poles.copy()
        P[:, [2, 5]] += fold * np.maximum(P[:, :1] - 300, 0) / 10
        model.edges[i] = replace(edge, poles=P)
    model.vertices = [edge.poles[0] for edge in model.edges]
    model.trimmed[7] = [loop]
    return model, loop


def divided(model: NetModel, loop: list):
    """The face of a region before, and its faces after."""
    face = trimmed_face(model, [loop], np.zeros((0, 6)), LIMITS)
    return face, divided_faces(model, {7: face}, lambda some: {7: np.zeros((0, 6))}, np.zeros_like, LIMITS)


HALVES = [[0, 0], [300, 0], [600, 0], [600, 200], [300, 200], [0, 200]]


def test_a_region_with_a_fold_is_divided_along_it():
    model, loop = folded_model(HALVES, 1)
    before, after = divided(model, loop)
    assert before.gap > SPLIT
    assert len(after) == 2
    assert max(face.gap for face in after) < 1e-6
    steps = Counter(step for face in after for step in face.loops[0])
    assert set(steps.values()) == {1}
    assert {e for e, ahead in steps if not ahead} == {6}, "both sides of the seam"
    assert {e for e, ahead in steps if ahead} == set(range(7))
    seam = model.edges[6]
    assert {seam.start, seam.end} == {1, 4}
    for face in after:
        ends = [(model.edges[e].start, model.edges[e].end)[:: 1 if ahead else -1] for e, ahead in face.loops[0]]
        assert [end for _, end in ends] == [start for start, _ in [*ends[1:], ends[0]]]


def test_a_seam_ends_in_the_middle_of_an_edge_which_is_two_to_all_faces():
    """In a strip of 600 x 40 mm with a fold and no corner opposite, chords to other corners are too flat."""
    model, loop = folded_model([[0, 0], [300, 0], [600, 0], [600, 40], [0, 40]], 1)
    whole = model.edges[3].poles
    model.walls, model.patches = [NetWall([(3, True)], whole)], [NetPatch([(3, False)], np.zeros((4, 4, 6)))]
    before, after = divided(model, loop)
    assert before.gap > 2 * max(face.gap for face in after)
    assert len(after) == 2
    (one, _), (two, _) = steps = model.walls[0].steps
    assert model.patches[0].loop == [(two, False), (one, False)]
    assert sum(step in face.loops[0] for face in after for step in steps) == 2
    assert model.edges[one].end == model.edges[two].start == 5
    assert (model.edges[one].start, model.edges[two].end) == (3, 4)
    x = np.linspace(0, 1, 5)
    found = np.concatenate([bernstein(x) @ model.edges[e].poles for e in (one, two)])
    np.testing.assert_allclose(found, bernstein(np.concatenate([x, 1 + x]) / 2) @ whole, atol=1e-9)
    np.testing.assert_allclose(model.vertices[5], bernstein(np.array([0.5]))[0] @ whole, atol=1e-9)
    assert set(range(len(model.edges))) == {e for face in after for e, _ in face.loops[0]}


@pytest.mark.parametrize(("gap", "parts"), [(0.9, 1), (1.1, 2)])
def test_a_part_may_have_a_wider_gap_where_no_edge_could_be_split_before(monkeypatch, gap, parts):
    """Of a region whose inside is far off: else what could be cut could not be any more."""
    model, loop = folded_model(HALVES, 1)
    face = replace(trimmed_face(model, [loop], np.zeros((0, 6)), LIMITS), gap=gap * SPLIT, off=5.0)
    some = [replace(face, gap=share * SPLIT, off=0.5, loops=[each]) for share, each in ((1.2, loop), (0.1, loop))]
    monkeypatch.setattr(trimmed_division.FaceDivision, "part_faces", lambda *given: some)
    two = trimmed_division.FaceDivision(model, np.zeros_like, LIMITS).two_parts(face, np.zeros((0, 6)))
    assert (len(two) or 1) == parts


def test_a_region_without_a_gap_stays_undivided():
    model, loop = folded_model(HALVES, 0)
    edges = list(model.edges)
    before, after = divided(model, loop)
    assert after == [before]
    assert model.edges == edges


def test_a_region_whose_inside_strays_is_divided_even_if_its_edges_fit(monkeypatch):
    monkeypatch.setattr(trimmed_division, "SPLIT", 1e3)
    model, loop = folded_model(HALVES, 1)
    x, y = (some.ravel() for some in np.meshgrid(np.linspace(30, 570, 19), np.linspace(20, 180, 9)))
    outer = np.stack([x, y, 20 + np.maximum(x - 300, 0) / 10], axis=1)
    thick = model.edges[0].poles[0, 3:] - model.edges[0].poles[0, :3]
    points = np.hstack([outer, outer + thick])
    limits = replace(LIMITS, off=0.05)
    face = trimmed_face(model, [loop], points, limits)
    assert face.off > 2 * limits.off
    after = divided_faces(model, {7: face}, lambda some: {7: points}, np.zeros_like, limits)
    assert len(after) == 2
    assert max(part.off for part in after) < 1e-3


def folded_mesh(points: np.ndarray) -> np.ndarray:
    """(k,) how much more than .05 mm points (k, 3) of both skins are off the sheet of a model with a fold."""
    rise = np.maximum(points[:, 0] - 300, 0) / 10
    return np.abs(np.abs(points[:, 2] - rise) - 20) - 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("mesh", "parts"), [(None, 1), (folded_mesh, 2)])
def test_a_region_that_strays_from_the_mesh_is_divided_on_request(monkeypatch, mesh, parts):
    monkeypatch.setattr(trimmed_division, "SPLIT", 1e3)
    model, loop = folded_model(HALVES, 1)
    limits, nothing = replace(LIMITS, beyond_mesh=mesh), np.zeros((0, 6))
    face = trimmed_face(model, [loop], nothing, limits)
    after = divided_faces(model, {7: face}, lambda some: {7: nothing}, np.zeros_like, limits)
    assert len(after) == parts
    assert face.astray == -np.inf if mesh is None else face.astray > 0.5 > max(part.astray for part in after) + 0.5


@pytest.mark.parametrize(
    ("mesh", "tried"), [(None, 1), (lambda points: np.ones(len(points)), sum(range(1, trimmed_division.TIMES + 1)))]
)
def test_further_seams_are_tried_if_the_usual_seams_fail(monkeypatch, mesh, tried):
    model, loop = folded_model(HALVES, 1)
    limits, nothing, times = replace(LIMITS, beyond_mesh=mesh), np.zeros((0, 6)), list[int]()
    work = trimmed_division.FaceDivision(model, np.zeros_like, limits)
    monkeypatch.setattr(work, "two_parts", lambda *given: times.append(work.times) or [])
    face = replace(trimmed_face(model, [loop], nothing, limits), gap=9 * SPLIT)
    assert len(work.parts(face, nothing)) == 1
    assert sum(times) == tried


@pytest.mark.parametrize(("times", "gap"), [(1, 0.8), (2, 0.3)])
def test_of_many_seams_the_best_is_taken_and_else_the_first_that_helps(monkeypatch, times, gap):
    model, loop = folded_model(HALVES, 1)
    edges, work, nothing = (
        len(model.edges),
        trimmed_division.FaceDivision(model, np.zeros_like, LIMITS),
        np.zeros((0, 6)),
    )
    work.times, face = times, replace(trimmed_face(model, [loop], nothing, LIMITS), gap=9 * SPLIT)
    shares = {1: 0.8, 2: 0.3, 3: 0.5}
    seams = [((0, 2 * k), np.full((1, 4, 6), k)) for k in shares]
    monkeypatch.setattr(work, "seams", lambda *given: seams)
    by_seam = lambda *given: [replace(face, gap=shares[int(model.edges[-1].poles[0, 0])] * SPLIT)] * 2  # noqa: E731
    monkeypatch.setattr(work, "part_faces", by_seam)
    assert [part.gap / SPLIT for part in work.two_parts(face, nothing)] == pytest.approx([gap, gap])
    assert len(model.edges) == edges + 1, "those of no other seam are left"


def test_an_edge_that_a_neighbour_halved_is_not_halved_again(monkeypatch):
    """A cow's nostril had two faces beside a seam, each with halves of its own of it, and OCCT read an open shell."""
    model, loop = folded_model(HALVES, 1)
    work, nothing, seen = (
        trimmed_division.FaceDivision(model, np.zeros_like, LIMITS),
        np.zeros((0, 6)),
        list[HalvedOutline](),
    )
    face = trimmed_face(model, [loop], nothing, LIMITS)
    work.halve(1)
    monkeypatch.setattr(work, "seams", lambda outline, points: seen.append(outline) or [])
    assert work.two_parts(face, nothing) == []
    assert len(seen[0].poles) == 2 * (len(loop) + 1)


def test_seams_follow_the_mesh_on_request():
    """Of a region whose seams in the middle do not, as beside a crease, others are taken."""

    def off_mesh(points: np.ndarray) -> np.ndarray:
        return np.where((np.abs(points[:, 0] - 300) < 60) & (np.abs(points[:, 1] - 100) < 20), 1.0, -1.0)

    model, loop = folded_model(HALVES, 1)
    outline, nothing, through = HalvedOutline.from_loop(model, loop), np.zeros((0, 6)), list[bool]()
    for mesh in (None, off_mesh):
        seams = trimmed_division.FaceDivision(model, np.zeros_like, replace(LIMITS, beyond_mesh=mesh)).seams(
            outline, nothing
        )
        points = [(bernstein(np.linspace(0, 1, 99)) @ poles).reshape(-1, 3) for _, poles in seams]
        through.append(any((off_mesh(P) > 0).any() for P in points))
        assert seams
    assert through == [True, False]


def test_the_worst_misfit_stops_at_the_first_outline_that_is_too_far(monkeypatch):
    """A flat square, and one that waves: the second is not asked where the first one, or its outer skin, is too bad."""
    x = np.linspace(0, 300, 24, endpoint=False)
    plan = np.concatenate([[[t, 0], [300, t], [300 - t, 300], [0, 300 - t]] for t in x], axis=0)
    plan = plan.reshape(-1, 4, 2).swapaxes(0, 1).reshape(-1, 2)
    waves = np.sin(np.arange(len(plan)) / 2)
    flat, waved = (np.column_stack([plan, z + 20, plan, z - 20]) for z in (0 * waves, waves))
    asked_of, inside = list[int](), np.array([[150, 150, 20, 150, 150, -20.0]])
    given = trimmed_division.misfits

    def counted(*some):
        for distances in given(*some):
            asked_of.append(1)
            yield distances

    monkeypatch.setattr(trimmed_division, "misfits", counted)
    worst = trimmed_division.worst_misfit(inside, [flat, waved], np.inf)
    assert 0.2 < worst < 2
    assert len(asked_of) == 4
    assert trimmed_division.worst_misfit(inside, [flat, waved], 1.01 * worst) == worst
    assert trimmed_division.worst_misfit(inside, [waved, flat], worst / 2) == np.inf
    assert len(asked_of) == 4 + 4 + 1


def test_a_face_is_judged_by_its_gap_its_inside_and_its_poles():
    model, loop = folded_model(HALVES, 0)
    face = trimmed_face(model, [loop], np.zeros((0, 6)), LIMITS)
    assert allowance_used(face, LIMITS) < 1
    assert allowance_used(replace(face, gap=2 * SPLIT), LIMITS) == 2
    assert allowance_used(replace(face, off=3.0), LIMITS) == 3 / trimmed_division.OFF
    assert allowance_used(replace(face, astray=3.0), LIMITS) == 4 + DEFLECTION
    box = np.array([[0.0, 0, -100], [600, 200, 100]]) + np.array([[-2.0], [2.0]])
    diagonal = np.linalg.norm(box[1] - box[0])
    out = face.inner + np.array([30.0, 0, 0])
    beyond = out[..., 0].max() - 602
    found = allowance_used(replace(face, inner=out), replace(LIMITS, box=box))
    np.testing.assert_allclose(found, beyond / (trimmed_division.OUT * diagonal))
    assert found > 1


def test_chords_are_inside_of_the_outline_and_clear_of_it():
    """Of a U: none is between its arms, and none runs beside an edge."""
    arms = [[300, 400], [200, 400], [200, 100], [100, 100], [100, 400], [0, 400]]
    model, loop = flat_model(np.array([[0, 0], [300, 0], *arms], dtype=float))
    outline = HalvedOutline.from_loop(model, loop)
    pairs = list(outline.chords(np.array([6])))
    assert any(6 in pair for pair in pairs)
    assert any(6 not in pair for pair in pairs)
    for some in pairs:
        start, end = outline.poles[list(some), 0, :2]
        x, y = (start + np.linspace(0, 1, 33)[1:-1, None] * (end - start)).T
        assert ((x > 0) & (x < 300) & (y > 0) & (y < 400) & ((x < 100) | (x > 200) | (y < 100))).all()
        beside = np.linalg.norm(outline.line[:, :2] - (start + end) / 2, axis=1).min()
        assert beside > 0.15 * np.linalg.norm(end - start)


def test_no_chord_cuts_off_a_narrow_lens_beside_an_edge_that_wiggles(monkeypatch):
    """An edge of 2 mm that bows out by .5 mm: its own chord is clear of it, and cuts off a face of two edges that
    OCCT draws no triangles of."""
    monkeypatch.setattr(trimmed_division, "TRIED", 1000)
    model, loop = flat_model(np.array([[0, 0], [150, 0], [152, 0], [300, 0], [300, 200], [0, 200]], dtype=float))
    poles = model.edges[1].poles.copy()
    poles[1:3, [1, 4]] -= 0.75
    model.edges[1] = replace(model.edges[1], poles=poles)
    outline = HalvedOutline.from_loop(model, loop)
    pairs = list(outline.chords(np.array([2, 3, 4])))
    assert (2, 4) not in pairs
    assert any(2 in pair for pair in pairs)


def to_waves(height: float):
    """The way from points (k, 6) to skins that wave twice over 600 mm along x, which points at 0, 300 and 600 lie
    on."""

    def away(Q):
        way = np.zeros_like(Q)
        for i, z in ((2, 20), (5, -20)):
            way[:, i] = z + height * (1 - np.cos(np.pi * Q[:, i - 2] / 150)) - Q[:, i]
        return way

    return away


@pytest.mark.parametrize(("height", "cubics"), [(0.1, 1), (10.0, 4)])
def test_a_seam_over_skins_that_wave_is_several_cubics(height, cubics):
    """One is not near to them in two waves; where they hardly wave it is."""
    model, loop = flat_model(np.array(HALVES, dtype=float))
    model.vertices = [edge.poles[0] for edge in model.edges]
    away, edges = to_waves(height), len(model.edges)
    work = trimmed_division.FaceDivision(model, away, LIMITS)
    chord = (model.vertices[0], model.vertices[2] + np.array([0, 90.0, 0, 0, 90, 0]))
    (seam,) = work.chord_cubics([chord])
    assert seam.shape == (cubics, 4, 6)
    work.limits = replace(LIMITS, beyond_mesh=lambda points: np.ones(len(points)))  # which refuses those too far off
    assert [one.shape for one in work.chord_cubics([chord])] == [(1, 4, 6)]
    work.limits = LIMITS
    off = np.abs(away((bernstein(np.linspace(0, 1, 9)) @ seam).reshape(-1, 6))).max()
    assert off < trimmed_division.STRAY_SHARE * LIMITS.off
    loops = work.seam_loops(loop, 4, 10, seam)
    assert len(model.edges) == edges + cubics
    assert len(model.vertices) == 6 + cubics - 1
    for some in loops:
        ends = [(model.edges[e].start, model.edges[e].end)[:: 1 if ahead else -1] for e, ahead in some]
        assert [end for _, end in ends] == [start for start, _ in [*ends[1:], ends[0]]]
    steps = Counter(step for some in loops for step in some)
    assert steps == Counter([*loop, *((edges + i, ahead) for i in range(cubics) for ahead in (True, False))])


def test_an_outline_goes_back_along_all_cubics_of_a_seam():
    model, loop = flat_model(np.array(HALVES, dtype=float))
    outline = HalvedOutline.from_loop(model, loop)
    a, b = outline.poles[2, 0], outline.poles[8, 0]
    whole = a + np.linspace(0, 1, 7)[:, None] * (b - a)
    one, two = (outline.part(2, 8, seam) for seam in (whole[None, ::2], np.stack([whole[:4], whole[3:]])))
    steps = 2 * trimmed_division.POINTS
    back = b + np.arange(2 * steps)[:, None] / (2 * steps) * (a - b)
    np.testing.assert_allclose(two[-2 * steps :], back, atol=1e-9)
    np.testing.assert_allclose(one[-steps:], back[::2], atol=1e-9)
