"""Drawings: other programs find every line where it is, in millimetres, on its layer; hidden ones are left out."""

import csv
import json
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from dataclasses import replace

import ezdxf
import numpy as np
import pytest
import trimesh

from dsfab.core.errors import ExportError
from dsfab.export import FORMATS, Details, write
from dsfab.export.drawing.svg import TITLE, scale_name
from dsfab.export.drawing.views import PAPER, PAPER_MARGIN, views, views_on_paper
from dsfab.export.part import part_of
from dsfab.surface.fields import StructureLine
from tests.export.striped_solids import ARCHED, FLAT, striped
from tests.shapes import grid, sphere

LINES = [suffix for suffix, form in FORMATS.items() if getattr(form, "content", "") == "lines"]


pytestmark = pytest.mark.usefixtures("inspected")


both = pytest.mark.parametrize("made", [FLAT, ARCHED], ids=["flat", "arched"])


def lengths(details: Details) -> list[float]:
    return [1000 * float(np.linalg.norm(np.diff(line.points, axis=0), axis=1).sum()) for line in details.lines]


@both
def test_dxf_passes_the_audit_with_all_lines_in_place_on_their_layers(made, tmp_path):
    sheet, details = made
    document = ezdxf.readfile(write(sheet, tmp_path / "a.dxf", details=details))
    assert (document.audit().errors, document.audit().fixes) == ([], [])
    assert (document.units, document.header["$INSUNITS"], document.dxfversion) == (4, 4, "AC1024")
    found = defaultdict(list)
    for entity in document.modelspace():
        if entity.has_xdata("DSFAB"):
            found[entity.get_xdata("DSFAB")[0].value].append(entity)
    assert sorted(found) == sorted(line.id for line in details.lines)
    for line in details.lines:
        for entity in found[line.id]:
            assert entity.dxf.layer == line.layer.upper()
            assert entity.get_xdata("DSFAB")[1].value == pytest.approx(1000 * line.length)
            assert entity.dxftype() in ("SPLINE", "LWPOLYLINE" if sheet.is_flat else "POLYLINE")
    kinds = Counter(entity.dxftype() for entities in found.values() for entity in entities)
    assert ("SPLINE" in kinds) == (not sheet.is_flat)
    layer = document.layers.get("CENTRE-MAJOR")
    assert (layer.dxf.linetype, layer.dxf.lineweight, layer.color) == ("CENTER", 13, 5)


def test_trimesh_reads_the_cutting_lines_of_a_flat_sheet_in_their_true_length(tmp_path):
    """A reader that is not ezdxf."""
    sheet, details = FLAT
    with open(write(sheet, tmp_path / "a.dxf", details=details), "rb") as file:
        path = trimesh.load_path(file, file_type="dxf")
    assert path.length == pytest.approx(sum(lengths(details)))
    assert path.bounds == pytest.approx(np.array([[125, 0], [1875, 1000]]), abs=1e-6)
    assert Counter(path.layers)["CENTRE-MAJOR"] == 4


def test_dxf_draws_plan_and_elevations_beside_a_curved_sheet(tmp_path):
    sheet, details = ARCHED
    document = ezdxf.readfile(write(sheet, tmp_path / "a.dxf", details=details, name="arch"))
    views_of = Counter(e.dxf.layer.split("-")[0] for e in document.modelspace() if not e.has_xdata("DSFAB"))
    assert set(views_of) == {"PLAN", "FRONT", "RIGHT"}
    plan = [e for e in document.modelspace() if e.dxf.layer == "PLAN-CENTRE-MAJOR"]
    x = np.array([point for entity in plan for point in entity.get_points("xy")])
    true = np.concatenate([1000 * line.points[:, :2] for line in details.lines if line.kind == "centre"])
    assert np.ptp(x, axis=0) == pytest.approx(np.ptp(true, axis=0), rel=1e-3)
    assert x.min(axis=0)[0] > 1000 * sheet.V[:, 0].max()
    sides = {
        k: [p for e in document.modelspace() if e.dxf.layer.startswith(f"{k}-C") for p in e.get_points("xy")]
        for k in ("PLAN", "FRONT", "RIGHT")
    }
    low, high = ({k: f([x for x, _ in points]) for k, points in sides.items()} for f in (min, max))
    assert high["PLAN"] < low["FRONT"]
    assert high["FRONT"] < low["RIGHT"]
    said = [e.dxf.text for e in document.modelspace() if e.dxftype() == "TEXT"]
    assert said == ["arch: plan", "arch: front elevation", "arch: right elevation"]


def drawn(root: ElementTree.Element) -> dict[str, list[np.ndarray]]:
    """The points of all lines by id, millimetres of paper."""
    found: dict[str, list[np.ndarray]] = {}
    for element in root.iter():
        if name := element.get("data-id"):
            numbers = [pair.split(",") for pair in element.get("d", "").lstrip("M").split(" ")]
            found.setdefault(name, []).append(np.array(numbers, dtype=float))
    return found


def test_svg_draws_a_flat_sheet_to_scale_on_a3(tmp_path):
    sheet, details = FLAT
    root = ElementTree.parse(write(sheet, tmp_path / "a.svg", details=details, name="plate <1>")).getroot()
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("420mm", "297mm", "0 0 420 297")
    found = drawn(root)
    assert set(found) == {line.id for line in details.lines}
    for line in details.lines:
        (points,) = found[line.id]
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(200 * line.length, rel=1e-3)
    text = ["".join(element.itertext()) for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"plate <1>", "Scale 1:5", "10 mm thick", "S235 <steel> & more", "1 000", "1 750"} <= set(text)
    assert "Plan1:5" in text


def test_every_view_lies_inside_the_frame_and_off_the_title_block():
    for surface, along in (
        (sphere(3), (0, 0, 1.0)),
        (grid(8, 80, 0.1, 3.0), (0, 1.0, 0)),
        (grid(80, 8, 9, 0.1), (1, 0, 0)),
        (grid(20, 14, 1.8, 1.18), (1, 0, 0)),
    ):
        sheet, _ = striped(surface, along)
        scale, placed = views_on_paper(part_of(sheet, "a", 1), TITLE)
        assert float(f"{scale:.0e}"[0]) in (1, 2, 5)
        for one in placed:
            corners = np.array([one.corner, one.corner + one.size])
            assert (corners[0] > PAPER_MARGIN).all()
            assert (corners[1] < np.array(PAPER) - PAPER_MARGIN).all()
            block = np.array(PAPER) - PAPER_MARGIN - TITLE
            assert (corners[1] <= block).any()
        boxes = [(one.corner, one.corner + one.size) for one in placed]
        for i, (low, high) in enumerate(boxes):
            for other_low, other_high in boxes[i + 1 :]:
                assert (np.array(high) < other_low).any() or (np.array(other_high) < low).any()


def test_the_far_side_of_a_sphere_is_hidden_and_the_near_side_is_not():
    """A ring about the middle, and a spot on each side: of the ring, the front sees half."""
    angle = np.linspace(0, 2 * np.pi, 721)
    ring = StructureLine("edge", "major", 1, 1, np.c_[np.cos(angle), np.sin(angle), 0 * angle], 2 * np.pi)
    near, far = (
        StructureLine("edge", "keep", 0, k, np.array([[-0.1, 0.99 * y, 0.1], [0.1, 0.99 * y, 0.1]]), 0.2)
        for k, y in ((1, -1), (2, 1))
    )
    part = part_of(sphere(4), "ball", 1)
    object.__setattr__(part, "details", Details((ring, near, far)).scaled_by(1000))
    plan, front, _ = views(part)
    seen = Counter(line.id for line, _ in front.runs)
    assert seen["edges-keep-0.1"] == 1
    assert seen["edges-keep-0.2"] == 0
    width = sum(np.abs(np.diff(run[:, 0])).sum() for line, run in front.runs if line is part.details.lines[0])
    assert width == pytest.approx(2000, rel=0.15)  # once across; the rest is the tangent margin
    whole = sum(np.linalg.norm(np.diff(run, axis=0), axis=1).sum() for line, run in plan.runs if line.family == "major")
    assert whole == pytest.approx(2000 * np.pi, rel=1e-3)


def test_the_filled_layer_covers_the_material_only():
    sheet, _ = FLAT
    part = part_of(sheet, "a", 1)
    (plan,) = views(part)
    assert len(plan.loops) == 4
    filled = sum(0.5 * abs(np.sum(x[:, 0] * np.roll(x[:, 1], -1) - x[:, 1] * np.roll(x[:, 0], -1))) for x in plan.loops)
    assert filled == pytest.approx(1e6 * sheet.area)
    assert all(view.loops == () for view in views(part_of(sphere(2), "a", 1)))


@both
def test_csv_and_json_list_each_line_with_its_kind(made, tmp_path):
    sheet, details = made
    with open(write(sheet, tmp_path / "a.csv", details=details), encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    whole = json.loads(write(sheet, tmp_path / "a.json", details=details, name="é").read_text(encoding="utf-8"))
    assert (whole["unit"], whole["tolerance"], whole["name"]) == ("millimetre", 0.1, "é")
    assert [line["id"] for line in whole["lines"]] == [line.id for line in details.lines]
    for line, entry in zip(details.lines, whole["lines"], strict=True):
        mine = [row for row in rows if row["id"] == line.id]
        points = np.array([[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in mine])
        assert points == pytest.approx(1000 * line.points, abs=1e-5)
        assert np.array(entry["points"]) == pytest.approx(points, abs=2e-6)
        for given in (mine[0], entry):
            assert (given["kind"], given["family"], int(given["number"])) == (line.kind, line.family, line.number)
        assert (float(mine[0]["length_mm"]), entry["length"]) == pytest.approx((1000 * line.length,) * 2, abs=1e-5)
        assert [int(row["point"]) for row in mine] == [*range(1, len(mine) + 1)]


@pytest.mark.parametrize("suffix", LINES)
def test_the_same_lines_give_the_same_bytes_on_another_day(suffix, tmp_path, monkeypatch):
    first = write(*ARCHED[:1], tmp_path / f"a{suffix}", details=ARCHED[1]).read_bytes()
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 86_400)
    (tmp_path / "b").mkdir()
    assert write(ARCHED[0], tmp_path / "b" / f"a{suffix}", details=ARCHED[1]).read_bytes() == first


@pytest.mark.parametrize("suffix", LINES)
def test_a_drawing_without_lines_is_refused_and_a_drawing_with_lost_lines_is_removed(suffix, tmp_path, monkeypatch):
    with pytest.raises(ExportError, match=f"a {suffix} file needs lines, but 'a' has none"):
        write(FLAT[0], tmp_path / f"a{suffix}")
    form = FORMATS[suffix]

    def fewer(part):
        lost = Details(part.details.lines[1:], part.details.tolerance)
        return form.encode(replace(part, details=lost))

    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=fewer))
    with pytest.raises(ExportError, match=r"reads back with .* lines instead of"):
        write(FLAT[0], tmp_path / f"a{suffix}", details=FLAT[1])
    assert not any(tmp_path.iterdir())


def test_scales_are_named_as_on_drawings():
    assert [scale_name(scale) for scale in (100.0, 2.5, 1.0, 0.2)] == ["1:100", "1:2.5", "1:1", "5:1"]
