"""Lines as smooth curves: near the exact level lines, with their corners, in DXF, 3DM and STEP as others read them."""

from collections import defaultdict

import ezdxf
import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.interpolate import BSpline

from dsfab.core.arrays import distances_from_segments
from dsfab.core.errors import ExportError
from dsfab.design import run
from dsfab.design.output.files import deliverable
from dsfab.export import FORMATS, Details, curves, write
from dsfab.export import curves as along
from dsfab.export import curves as refining
from dsfab.export.curves import CLOSEST, all_curves_along, check_curves, curves_along, joined_segments
from dsfab.export.part import part_of
from dsfab.export.splines import LeastSquares
from dsfab.pattern import Stripes
from dsfab.preset.file import load_preset
from dsfab.slicing import cut
from dsfab.slicing.measures.lines import centre_lines, edge_lines
from dsfab.surface.fields import StructureLine, polyline_length
from tests.presets import DOME_MODES
from tests.shapes import grid, lifted


def rings(surface, tolerance: float) -> tuple:
    """A sheet of rings about the middle of a mesh with their exact lines: full circles, arcs, and the boundary."""
    x = np.linalg.norm(surface.V - surface.V.mean(axis=0), axis=1)
    stripes = Stripes(5.0, phase=0.2)
    sheet = cut(surface, [x], [stripes.levels(x)]).subset()
    z, d = stripes.phases(x), np.full(surface.n, stripes.half_width)
    lines = edge_lines(sheet, surface, ["major"], [z]) + centre_lines(sheet, "major", z, d)
    return sheet.surface, Details(tuple(lines), tolerance)


FLAT = rings(grid(30, 30, 1.0, 1.0), 2e-4)
DOMED = rings(lifted(lambda x, y: 0.8 * x * (1 - x) * (1 + y), 16), 2e-3)
both = pytest.mark.parametrize("made", [FLAT, DOMED], ids=["flat", "domed"])


def off(points: np.ndarray, line: np.ndarray) -> float:
    """Largest distance of points from a polyline."""
    return float(distances_from_segments(points[:, None], line[:-1], line[1:]).min(axis=1).max())


def judged(details: Details, found: dict[str, list[np.ndarray]]) -> None:
    """The curves of a file, as points along them, against the exact lines: both ways within the tolerance."""
    for line in details.lines:
        points, exact = np.concatenate(found[line.id]), 1000 * line.points
        assert off(points, exact) <= 1000 * details.tolerance * (1 + 1e-9), line.id
        if len(found[line.id]) == 1:
            assert off(exact, points) <= 1000 * details.tolerance * 1.1, line.id
        assert sum(map(polyline_length, found[line.id])) == pytest.approx(1000 * line.length, rel=5e-3), line.id


@both
def test_dxf_holds_splines_within_the_tolerance_of_the_exact_lines(made, tmp_path):
    sheet, details = made
    document = ezdxf.readfile(write(sheet, tmp_path / "a.dxf", details=details))
    assert (document.audit().errors, document.audit().fixes) == ([], [])
    found, kinds = defaultdict(list), defaultdict(int)
    for entity in document.modelspace():
        if entity.has_xdata("DSFAB"):
            points = (
                [tuple(p)[:3] for p in entity.flattening(0.001)] if entity.dxftype() == "SPLINE" else corners(entity)
            )
            found[entity.get_xdata("DSFAB")[0].value].append(np.array(points))
            kinds[entity.dxftype()] += 1
    judged(details, found)
    assert kinds["SPLINE"] > 0.5 * len(details.lines)
    assert ("curves within", f"{1000 * details.tolerance:.2g} mm") in document.header.custom_vars.properties


def corners(entity) -> list[tuple[float, float, float]]:
    flat = entity.dxftype() == "LWPOLYLINE"
    points = [(x, y, entity.dxf.elevation) for x, y in entity.get_points("xy")] if flat else list(entity.points())
    return [*points, points[0]] if entity.is_closed else points


@both
def test_rhino3dm_finds_nurbs_curves_of_the_right_length_near_the_exact_lines(made, tmp_path):
    rhino3dm = pytest.importorskip("rhino3dm")
    sheet, details = made
    model = rhino3dm.File3dm.Read(str(write(sheet, tmp_path / "a.3dm", details=details)))
    curves = {item.Attributes.Name: item for item in model.Objects if item.Attributes.Name != "a"}
    judged(details, {name: rhino_points(item.Geometry) for name, item in curves.items()})
    closed = [line for line in details.lines if line.is_closed]
    whole = [line for line in closed if type(curves[line.id].Geometry) is rhino3dm.NurbsCurve]  # others have corners
    assert len(whole) >= 3
    for line in whole:
        geometry = curves[line.id].Geometry
        assert (geometry.IsClosed, geometry.IsValid, geometry.Degree) == (True, True, 3)
        domain = geometry.Domain
        speed = lambda x, g=geometry: np.linalg.norm(vector(g.DerivativeAt(x, 1)[1]))  # noqa: E731
        length, _ = quad_vec(speed, domain.T0, domain.T1, epsrel=1e-6, limit=200)
        assert length == pytest.approx(1000 * line.length, rel=5e-3)
        start, end = (vector(geometry.TangentAt(x)) for x in (domain.T0, domain.T1))
        assert not (sheet.is_flat and line.length > 0.7) or start == pytest.approx(
            end, abs=1e-6
        )  # it leaves as it arrives
        assert curves[line.id].Attributes.GetUserString("tolerance_mm") == f"{1000 * details.tolerance:.2g}"


def vector(p) -> np.ndarray:
    return np.array([p.X, p.Y, p.Z])


def rhino_points(curve) -> list[np.ndarray]:
    if hasattr(curve, "SegmentCount"):
        return [points for i in range(curve.SegmentCount) for points in rhino_points(curve.SegmentCurve(i))]
    ends = curve.Domain
    if not hasattr(curve, "Knots"):
        return [np.array([vector(curve.Point(i)) for i in range(curve.PointCount)])]
    return [np.array([vector(curve.PointAt(x)) for x in np.linspace(ends.T0, ends.T1, 1000)])]


def test_step_wires_are_near_the_exact_lines(tmp_path, inspected):
    from build123d import import_step

    sheet, details = DOMED
    shape = import_step(write(sheet, tmp_path / "a.lines.step", details=details))
    exact = [1000 * line.points for line in details.lines]
    for edge in shape.edges():
        points = np.array([tuple(edge @ x) for x in np.linspace(0, 1, 60)])
        assert min(off(points, line) for line in exact) <= 1000 * details.tolerance * (1 + 1e-6)


def test_corners_stay_and_closed_lines_close():
    square = np.array([[5, 0, 0], [9, 0, 0], [9, 9, 3], [0, 9, 3], [0, 0, 0], [5, 0, 0]], float)
    curves = curves_along(square, 0.1)
    assert [curve.is_straight for curve in curves] == [True] * 4
    (whole,) = joined_segments(curves)
    assert whole.tolist() == [[9, 0, 0], [9, 9, 3], [0, 9, 3], [0, 0, 0], [9, 0, 0]]
    assert len(curves_along(np.roll(square[:-1], 1, axis=0)[[0, 1, 2, 3, 4, 0]], 0.1)) == 4
    t = np.linspace(0, 2 * np.pi, 91)
    ring = 1000 * np.c_[np.cos(t), np.sin(t), 0 * t]
    ring[-1] = ring[0]
    (one,) = curves_along(ring, 0.5)
    assert np.allclose(one.poles[0], one.poles[-1])
    drop = np.concatenate([[[3000.0, 0, 0]], ring[8:-8], [[3000.0, 0, 0]]])  # one corner, where it begins and ends
    assert len(curves_along(drop, 0.5)) == 3
    turned = np.concatenate([drop[40:-1], drop[:41]])
    assert {len(c.poles) for c in curves_along(turned, 0.5)} == {len(c.poles) for c in curves_along(drop, 0.5)}


def test_a_rough_curve_keeps_its_own_points():
    rng = np.random.default_rng(0)
    rough = np.c_[np.arange(50.0), 0.2 * rng.random(50), np.zeros(50)]
    (run,) = joined_segments(curves_along(rough, 1e-7))
    assert run == pytest.approx(rough)


def test_a_line_that_lies_elsewhere_or_has_another_name_is_noticed():
    line = StructureLine("centre", "major", 1, 1, np.array([[0.0, 0, 0], [1, 0, 0]]), 1.0)
    part = part_of(FLAT[0], "a", 1)
    object.__setattr__(part, "details", Details((line,)).scaled_by(1000))
    points = part.details.lines[0].points
    check_curves(part, {line.id: [points]})
    for found in ({line.id: [points + 3 * CLOSEST]}, {"other": [points]}, {}):
        with pytest.raises(ExportError):
            check_curves(part, found)


def test_curve_formats_get_exact_lines_and_tables_get_simplified_lines():
    design = run(load_preset(DOME_MODES, {"surface.edge": 0.9}))
    assert {suffix for suffix, form in FORMATS.items() if getattr(form, "curves", False)} == {
        ".dxf",
        ".3dm",
        ".lines.step",
    }
    exact, fewer = (deliverable(design, suffix)[1]["details"] for suffix in (".dxf", ".csv"))
    assert exact.tolerance == fewer.tolerance > 0
    assert [line.id for line in exact.lines] == [line.id for line in fewer.lines]
    for full, line in zip(exact.lines, fewer.lines, strict=True):
        assert polyline_length(full.points) == pytest.approx(full.length, rel=1e-9)
        assert off(full.points, line.points) <= exact.tolerance
    assert sum(len(line.points) for line in fewer.lines) < 0.7 * sum(len(line.points) for line in exact.lines)


def test_the_next_format_of_a_design_takes_the_curves_of_the_one_before(monkeypatch):
    """They took half of the time of each."""
    turn = np.linspace(0.0, 2.0, 30)
    line = 1e3 * np.stack([np.cos(turn), np.sin(turn), 0.2 * turn], axis=1)
    first, made, refined = curves_along(line, 1.0), [], curves.splines_by_halving
    monkeypatch.setattr(curves, "splines_by_halving", lambda *given: made.append(given) or refined(*given))
    again = curves_along(line.copy(), 1.0)
    assert not made
    assert [one is other for one, other in zip(first, again, strict=True)] == [True]
    assert again is not first  # whoever takes them may change the list
    curves_along(line, 0.5)
    curves_along(line[::-1], 1.0)
    assert len(made) >= 2


def test_lines_fitted_together_equal_lines_fitted_alone(monkeypatch):
    """One by one, 2,310 curves of a ball took a third of the time of their 3DM."""
    alone, solved, of = [], [], LeastSquares.from_hats
    turn = np.linspace(0.0, 2.0, 40)
    lines = [1e3 * np.stack([np.cos(turn), np.sin(k * turn), 0.1 * turn], axis=1) for k in np.linspace(1, 2, 24)]
    turn = np.linspace(0.0, 2 * np.pi, 200)
    ring = 2e3 * np.stack([np.cos(turn), np.sin(turn), np.sin(3 * turn) / 9], axis=1)
    ring[-1] = ring[0]
    lines.insert(5, ring)
    for line in lines:
        alone.append(curves_along(line, 3.0))
    monkeypatch.setattr(refining, "AT_ONCE", 100_000)
    monkeypatch.setattr(LeastSquares, "from_hats", lambda *given: solved.append(given) or of(*given))
    together = all_curves_along([line.copy() for line in lines], 3.0000001)
    assert 0 < len(solved) < 0.6 * len(lines)
    for one, other in zip(alone, together, strict=True):
        for a, b in zip(one, other, strict=True):
            assert (a.knots.tolist(), a.poles.tolist()) == (b.knots.tolist(), b.poles.tolist())
    # as far off as scipy finds it, where it is asked densely
    for line, (curve,) in zip(lines, together, strict=True):
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        share = np.union1d(np.linspace(0, 1, 4001), length / length[-1])
        there = np.stack([np.interp(share * length[-1], length, column) for column in line.T], axis=1)
        off = np.linalg.norm(BSpline(curve.knots, curve.poles, 3)(share * curve.knots[-1]) - there, axis=1).max()
        assert off == pytest.approx(curve.deviation, rel=1e-3)
        assert off < 3.01


def test_the_memory_of_lines_keeps_its_limit(monkeypatch):
    monkeypatch.setattr(along, "REMEMBERED", 3)
    lines = [np.array([[0.0, 0, 0], [k, 1, 0]]) for k in range(5)]
    found = all_curves_along(lines, 0.1)
    assert [chain[0].poles[1, 0] for chain in found] == [0, 1, 2, 3, 4]
    assert [curves_along(lines[k], 0.1)[0] is found[k][0] for k in (2, 3, 4, 1)] == [True, True, True, False]
