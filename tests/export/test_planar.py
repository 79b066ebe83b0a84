"""Planar STEP: flat sheets as lines and splines, within the tolerance, with their corners, or faceted with a reason."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from dsfab.app.build import Files, PictureFlags, build
from dsfab.app.build_page import Output
from dsfab.app.options import Source, StepFlags
from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.export import StepOptions, write
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.flat_sheets import outlines_of, plate
from dsfab.export.cad.step.worker.shapes import step_facts
from dsfab.export.curves import (
    SPANS,
    Curve,
    SampledLine,
    SplineSystem,
    curves_through,
    fitted_curve,
    halves,
    split_at_knots,
    turning,
)
from dsfab.export.part import part_of
from dsfab.slicing import cut
from dsfab.slicing.measures.lines import outline_corners
from dsfab.surface import Surface
from dsfab.thickening import thicken
from tests.export.holed_sheets import THICKNESS, holed_sheet, thickened
from tests.shapes import fan, grid, sphere, subsurface


def moved(surface: Surface) -> Surface:
    """The surface turned in space and far from the origin."""
    a, b = 0.7, -0.4
    turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    turn = turn @ np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    return Surface(surface.V @ turn.T + [3.0, -2.0, 5.0], surface.F)


def distances(points: Floats, loop: Floats) -> Floats:
    """(k,) distance of points from a closed polyline."""
    a, along = loop, np.roll(loop, -1, axis=0) - loop
    t = np.einsum("pli,li->pl", points[:, None] - a, along) / np.einsum("li,li->l", along, along)
    return np.linalg.norm(points[:, None] - a - np.clip(t, 0, 1)[..., None] * along, axis=2).min(axis=1)


def outline_in(path, height: float) -> tuple[Floats, Floats]:
    """What build123d finds in a file: points along the edges of the skin at z = height, and the ends of edges."""
    from build123d import import_step

    edges = [e for e in import_step(path).edges() if all(abs((e @ u).Z - height) < 1e-6 for u in (0, 0.3, 1))]
    points = [tuple(e.position_at(u))[:2] for e in edges for u in np.linspace(0, 1, 80)]
    ends = [tuple(e @ u)[:2] for e in edges for u in (0, 1)]
    return np.array(points), np.array(ends)


def test_a_plate_with_round_holes_is_two_skins_four_planes_and_curved_walls_of_few_spans(tmp_path, inspected):
    solid = thickened(holed_sheet())
    said: list[str] = []
    path = write(solid, tmp_path / "plate.step", note=said.append)
    assert said == ["STEP is planar, its outline within 0.5 mm of the mesh"]
    assert (inspected["solids"], inspected["faces"], inspected["valid"], inspected["tessellates"]) == (
        1,
        16,
        True,
        True,
    )
    text = path.read_text("ascii")
    assert text.count("SURFACE_OF_LINEAR_EXTRUSION") == text.count("B_SPLINE_CURVE") / 2 == 10
    assert text.count("=PLANE(") == 6
    assert inspected["volume"] == pytest.approx(solid.volume * 1e9, rel=5e-4)
    discs = np.pi * (0.06**2 + 0.08**2 + 0.05**2)
    assert inspected["volume"] == pytest.approx((0.18 - discs) * THICKNESS * 1e9, rel=5e-3)
    faceted = write(solid, tmp_path / "faceted.step", step="faceted")
    assert path.stat().st_size < faceted.stat().st_size / 3


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [0.5, 0.1])
def test_curves_in_the_file_keep_the_tolerance_both_ways(tmp_path, inspected, tolerance):
    """Measured on what build123d reads, against the boundary of the sheet."""
    sheet = holed_sheet()
    path = write(thickened(sheet), tmp_path / "plate.step", step=StepOptions("planar", tolerance=tolerance / 1000))
    points, _ = outline_in(path, 1000 * THICKNESS / 2)
    loops = outlines_of(strategies.prepare(part_of(thickened(sheet), "a", 99))).pieces[0]
    assert len(loops) == 4
    off = np.min([distances(points, loop) for loop in loops], axis=0).max()
    assert 0.3 * tolerance < off <= tolerance + 1e-5
    spacing = 2 * np.pi * 80 / 2 / 79
    nearest = max(np.linalg.norm(points - p, axis=1).min() for loop in loops[1:] for p in loop)
    assert nearest <= tolerance + spacing / 2


def test_pieces_in_a_tilted_plane_become_solids_of_their_own(tmp_path, inspected):
    sheet = holed_sheet(12)
    left = sheet.centroids[:, 0] < 0.2
    right = sheet.centroids[:, 0] > 0.4
    apart = moved(subsurface(sheet, left | right))
    solid = thickened(apart)
    write(solid, tmp_path / "a.step", step=StepOptions("planar", tolerance=2e-4))
    assert (inspected["solids"], inspected["valid"]) == (2, True)
    assert inspected["volume"] == pytest.approx(solid.volume * 1e9, rel=5e-4)


def blunt_outline(angle: float) -> tuple[Floats, Floats]:
    """A rectangle of 0.4 x 0.2 m whose long upper side turns by `angle` in its middle, in short steps; and where."""
    x = np.linspace(0.2, -0.2, 41)
    upper = np.c_[x, 0.1 + 0.2 * np.tan(angle / 2) * (1 - np.abs(x) / 0.2)]
    return np.r_[[[-0.2, -0.1], [0.2, -0.1]], upper], upper[20]


def test_blunt_corners_are_kept_on_request_and_sharp_corners_always(tmp_path, inspected, monkeypatch):
    monkeypatch.setattr("dsfab.export.curves.SPANS", 99)  # else the curve is cut near there
    rim, tip = blunt_outline(np.deg2rad(12))
    solid = thickened(fan(rim))
    told = write(solid, tmp_path / "told.step", step=StepOptions("planar", corners=np.array([[*tip, 0.0]])))
    alone = write(solid, tmp_path / "alone.step", step="planar")
    ends = [outline_in(path, 1000 * THICKNESS / 2)[1] for path in (told, alone)]
    near = [np.linalg.norm(e - 1000 * tip, axis=1).min() for e in ends]
    assert near[0] < 1e-6
    assert near[1] > 50
    for corner in rim[[0, 1, 2, -1]]:
        assert all(np.linalg.norm(e - 1000 * corner, axis=1).min() < 1e-6 for e in ends)
    assert told.read_text("ascii").count("B_SPLINE_CURVE") == 0
    assert alone.read_text("ascii").count("B_SPLINE_CURVE") == 2


def test_outline_corners_lie_at_crossings_and_ends_of_stripes():
    """Stripes |x - 1/2| < 1/8 and |y - (x + 1/2) / 2| < 1/8 on the unit square: four crossings, and eight ends."""
    surface = grid(16, 16, 1.0, 1.0)
    x, y = surface.V[:, 0], surface.V[:, 1]
    fields = [x, y - (x + 0.5) / 2]
    cells = cut(surface, fields, [np.array([0.375, 0.625]), np.array([-0.11, 0.11])], snap=0.0)
    found = outline_corners(cells.subset())
    crossings = [(s, (s + 0.5) / 2 + d) for s in (0.375, 0.625) for d in (-0.11, 0.11)]
    ends = [(s, e) for s in (0.375, 0.625) for e in (0, 1)] + [
        (e, 0.25 + e / 2 + d) for e in (0, 1) for d in (-0.11, 0.11)
    ]
    expected = np.array(sorted(crossings + ends))
    assert np.array(sorted(map(tuple, np.round(found[:, :2], 12)))) == pytest.approx(expected, abs=1e-9)


def entities_in(text: str) -> dict[int, tuple[str, str]]:
    """Kind and arguments of the numbered entities of a file."""
    found = re.finditer(r"^#(\d+)=([A-Z0-9_]+)\('',?(.*)\);$", text, re.M)
    return {int(m[1]): (m[2], m[3]) for m in found}


def references(arguments: str) -> list[int]:
    return [int(k) for k in re.findall(r"#(\d+)", arguments)]


def faces_in(text: str) -> list[tuple[Floats, Floats]]:
    """Per face of a file: the vertices of its outer loop, in order, and the normal of its surface at the first."""
    of, faces = entities_in(text), []

    def numbers(k: int) -> Floats:
        return np.array([float(x) for x in of[k][1].strip("()").split(",")])

    for kind, arguments in list(of.values()):
        if kind != "ADVANCED_FACE":
            continue
        bound, *_, surface = references(arguments)
        steps = [of[k][1] for k in references(of[references(of[bound][1])[0]][1])]
        ends = [references(of[references(s)[0]][1])[:2][:: 1 if ".T." in s else -1] for s in steps]
        assert all(a[1] == b[0] for a, b in zip(ends, [*ends[1:], ends[0]], strict=True))
        loop = np.array([numbers(references(of[v][1])[0]) for v, _ in ends])
        if of[surface][0] == "PLANE":
            normal = numbers(references(of[references(of[surface][1])[0]][1])[1])
        else:
            curve, vector = references(of[surface][1])
            start, after = (numbers(k) for k in references(of[curve][1])[:2])
            normal = np.cross(after - start, numbers(references(of[vector][1])[0]))
        faces.append((loop, normal))
    return faces


@pytest.mark.parametrize("across", [1.0, -1.0])
def test_planar_faces_are_oriented_outwards_with_consistent_loops(tmp_path, inspected, across):
    """OCCT would turn wrong ones round without a word; other readers may not. A quarter of a disc is convex."""
    turn = np.linspace(0, np.pi / 2, 40)
    quarter = fan(0.2 * np.r_[np.c_[np.cos(turn), np.sin(turn)], [[0, 0]]] - 0.08)
    solid = thickened(moved(Surface(quarter.V * [1, across, 1], quarter.F[:, :: int(across)])))
    faces = faces_in(write(solid, tmp_path / "a.step", step="planar").read_text("ascii"))
    assert sorted(len(loop) for loop, _ in faces) == [3, 3, 4, 4, 4]
    middle = np.mean([loop.mean(axis=0) for loop, _ in faces], axis=0)
    for loop, normal in faces:
        assert (loop.mean(axis=0) - middle) @ normal > 0
        around = np.cross(loop - middle, np.roll(loop, -1, axis=0) - middle).sum(axis=0)
        assert around @ normal > 0


def test_the_same_solid_gives_the_same_bytes(tmp_path, inspected):
    solid = thickened(moved(holed_sheet(8)))
    one, two = (write(solid, tmp_path / f"{k}.step", name="plate", step="planar").read_bytes() for k in "ab")
    assert one == two


def test_a_dome_is_faceted_with_a_reason(tmp_path, inspected):
    ball = sphere(2)
    cap = thickened(subsurface(ball, ball.centroids[:, 2] > 0.3))
    said: list[str] = []
    write(cap, tmp_path / "cap.step", note=said.append)
    assert said == ["STEP is faceted: the sheet is not flat, or its thickness varies"]
    assert inspected["faces"] > 50
    with pytest.raises(ExportError, match="not flat"):
        write(cap, tmp_path / "never.step", step="planar")
    write(cap, tmp_path / "cap.step", step="faceted", note=said.append)
    assert said[1:] == ["STEP is faceted"]
    assert [p.name for p in tmp_path.iterdir()] == ["cap.step"]


def test_a_plate_that_is_thicker_at_one_end_is_not_planar():
    sheet = grid(4, 4, 0.4, 0.4)
    wedge = thicken(sheet, np.c_[np.zeros((sheet.n, 2)), 0.01 + 0.01 * sheet.V[:, 0]])
    with pytest.raises(ExportError, match="its thickness varies"):
        outlines_of(part_of(wedge, "wedge", 99))
    tapered = thicken(sheet, np.c_[0.05 * (sheet.V[:, :2] - 0.2), np.full(sheet.n, 0.01)])
    with pytest.raises(ExportError, match="different outlines"):
        outlines_of(part_of(tapered, "tapered", 99))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("refusals", "said"), [(1, "STEP is planar, its outline within 0.125 mm"), (2, "STEP is faceted: ")]
)
def test_a_refused_file_is_made_again_closer_and_then_faceted(tmp_path, monkeypatch, refusals, said):
    asked: list[str] = []

    def doubtful(part, path):
        asked.append(part.step)
        return step_facts(path) | ({"valid": False} if len(asked) <= refusals else {})

    monkeypatch.setattr(file, "inspection", doubtful)
    lines: list[str] = []
    write(thickened(holed_sheet(8)), tmp_path / "a.step", note=lines.append)
    assert asked == ["planar", "planar", "faceted"][: refusals + 1]
    assert lines[0].startswith(said)
    assert "invalid" in lines[0]
    assert [p.name for p in tmp_path.iterdir()] == ["a.step"]


def wavy_slits(gap: float) -> Surface:
    """A plate with two long wavy slits of different length, `gap` apart."""
    x = np.linspace(0, 0.6, 121)
    y = np.array([0, 0.1, 0.14, 0.14 + gap, 0.18 + gap, 0.3])
    sheet = grid(120, 5, 1.0, 1.0)
    i, j = np.round(sheet.V[:, :2] * [120, 5]).astype(int).T
    c = sheet.V[sheet.F].mean(axis=1) * [120, 5, 1]
    below = (c[:, 1] > 1) & (c[:, 1] < 2) & (c[:, 0] > 10) & (c[:, 0] < 104)
    above = (c[:, 1] > 3) & (c[:, 1] < 4) & (c[:, 0] > 23) & (c[:, 0] < 91)
    return subsurface(
        Surface(np.c_[x[i], y[j] + 0.02 * np.sin(14 * x[i]), np.zeros(sheet.n)], sheet.F), ~(below | above)
    )


def test_curves_do_not_cross_a_member_narrower_than_the_tolerance():
    """Each side may move by a quarter of the member, so that half of it is left."""
    gap, tolerance = 0.4, 3.0
    outlines = outlines_of(part_of(thickened(wavy_slits(gap / 1000)), "a", 99))
    shape = plate(outlines, np.zeros((0, 3)), tolerance)
    _, below, above = ([c(np.linspace(c.knots[0], c.knots[-1], 4000)) for c in loop] for loop in shape.pieces[0])
    near = cKDTree(np.concatenate(below)).query(np.concatenate(above))[0].min()
    assert near >= 0.5 * gap * 0.9
    loose = [curves_through(loop, np.zeros(len(loop), dtype=bool), tolerance) for loop in outlines.pieces[0]]
    assert max(c.deviation for chain in loose for c in chain) > gap


def test_a_plate_with_a_narrow_member_stays_valid(tmp_path, inspected):
    solid = thickened(wavy_slits(4e-4))
    said: list[str] = []
    write(solid, tmp_path / "a.step", step=StepOptions(tolerance=3e-3), note=said.append)
    assert said == ["STEP is planar, its outline within 3 mm of the mesh"]
    assert (inspected["solids"], inspected["valid"], inspected["faces"]) == (1, True, 18)


def test_an_unknown_way_is_refused(tmp_path):
    with pytest.raises(ExportError, match="step = 'round' is not known"):
        write(thickened(grid(2, 2, 0.1, 0.1)), tmp_path / "a.step", step="round")


def test_too_many_walls_are_over_the_budget(tmp_path, inspected):
    solid = thickened(holed_sheet())
    with pytest.raises(ExportError, match="64 planar faces, more than step_faces = 11"):
        write(solid, tmp_path / "a.step", step=StepOptions("planar", faces=11))


def test_a_circle_closes_smoothly_and_converges():
    """A polygon of 720 corners is within 4e-4 mm of a circle of 40 mm."""
    turn = 2 * np.pi * np.arange(720) / 720
    loop = 40 * np.c_[np.cos(turn), np.sin(turn)]
    for tolerance in (0.4, 0.02):
        one, two = curves_through(loop, np.zeros(720, dtype=bool), tolerance)
        both = [one(np.linspace(one.knots[0], one.knots[-1], 99)), two(np.linspace(two.knots[0], two.knots[-1], 99))]
        assert np.abs(np.linalg.norm(np.concatenate(both), axis=1) - 40).max() < tolerance + 4e-4
        for a, b in ((one, two), (two, one)):
            assert a.poles[-1] == pytest.approx(b.poles[0], abs=1e-9)
            leaving, arriving = b.poles[1] - b.poles[0], a.poles[-1] - a.poles[-2]
            assert leaving / np.linalg.norm(leaving) == pytest.approx(arriving / np.linalg.norm(arriving), abs=1e-7)


def test_parts_of_a_spline_are_the_spline():
    x = np.linspace(0, 100, 60)
    whole = fitted_curve(np.c_[x, 10 * np.sin(x / 9)], 0.05)
    assert whole is not None
    short = split_at_knots(whole)
    assert len(short) > 2
    assert all(len(np.unique(one.knots)) - 1 <= SPANS for one in short)
    assert [one.knots[0] for one in short[1:]] == [one.knots[-1] for one in short[:-1]]
    for part in (*halves(whole), *short):
        at = np.linspace(part.knots[0], part.knots[-1], 50)
        assert part(at) == pytest.approx(whole(at), abs=1e-9)
    assert isinstance(whole, Curve)
    assert not whole.is_straight


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.lists(st.floats(0.4, 1.6), min_size=5, max_size=60), st.sampled_from([2.0, 0.3]), st.integers(0, 2**31))
def test_any_star_is_followed_within_the_tolerance_and_closed(radii, tolerance, seed):
    k = len(radii)
    turn = 2 * np.pi * (np.arange(k) + 0.3 * np.random.default_rng(seed).random(k)) / k
    loop = 100 * np.array(radii)[:, None] * np.c_[np.cos(turn), np.sin(turn)]
    chain = curves_through(loop, np.zeros(k, dtype=bool), tolerance)
    assert chain is not None
    assert len(chain) >= 2
    for a, b in zip(chain, [*chain[1:], chain[0]], strict=True):
        assert a.poles[-1] == pytest.approx(b.poles[0], abs=1e-9)
        points = a(np.linspace(a.knots[0], a.knots[-1], 300))
        assert distances(points, loop).max() <= tolerance + 1e-9
    starts = np.array([c.poles[0] for c in chain])
    for corner in loop[np.abs(turning(loop)) > np.deg2rad(36)]:
        assert np.linalg.norm(starts - corner, axis=1).min() < 1e-9


def test_loops_keep_their_sense_and_pieces_their_holes():
    outlines = outlines_of(part_of(thickened(moved(holed_sheet())), "a", 99))
    assert outlines.thickness == pytest.approx(20, abs=1e-9)
    assert np.linalg.det(outlines.axes) == pytest.approx(1)
    shape = plate(outlines, np.zeros((0, 3)), 0.2)
    assert [len(loops) for loops in shape.pieces] == [4]
    assert [len(loop) for loop in shape.pieces[0]] == [4, 14, 15, 10]  # of at most 4 spans each
    assert shape.faces == 45
    assert 0 < shape.deviation <= 0.2


@pytest.mark.slow
def test_a_build_reports_the_way_of_its_step_file(tmp_path, inspected):
    how = {"source": Source(("surface.edge=0.08",)), "files": Files(tmp_path, "step"), "pictures": PictureFlags(False)}
    build("cantilever", **how, output=Output(quiet=True))
    notes = json.loads((tmp_path / "design.json").read_text())["warnings"]
    assert "export: STEP is planar, its outline within 0.25 mm of the mesh" in notes
    build("cantilever", **how, step=StepFlags("faceted"), output=Output(quiet=True))
    assert "export: STEP is faceted" in json.loads((tmp_path / "design.json").read_text())["warnings"]


@pytest.mark.parametrize("smooth", [False, True])
def test_poles_are_those_of_dense_least_squares(smooth):
    """Against numpy on all samples; a closed curve leaves as it arrives: one more unknown, outside of the band."""
    x = np.linspace(0, 10, 81)
    points = np.c_[np.cos(x * np.pi / 5), np.sin(x * np.pi / 5) + 0.1 * np.cos(3 * x)]
    points[-1] = points[0]
    knots = np.array([0.0] * 4 + [1.5, 4.0, 7.0, 8.0] + [10.0] * 4)
    basis = BSpline.design_matrix(x, knots, 3).toarray()
    fixed = np.zeros((8, 2))
    fixed[[0, -1]] = points[[0, -1]]
    free = np.eye(8)[:, 1:-1]
    if smooth:
        fixed[[1, -2]] = points[[0, -1]]
        free = np.c_[np.eye(8)[:, 2:-2], np.r_[0, 1.5 / 3, np.zeros(4), -2.0 / 3, 0]]
    expected = fixed + free @ np.linalg.lstsq(basis @ free, points - basis @ fixed, rcond=None)[0]
    rows = SplineSystem([SampledLine(points, x, 10.0, 80, smooth)], [np.unique(knots)])
    assert rows.poles() == pytest.approx(expected, abs=1e-9)
