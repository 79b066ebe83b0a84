"""Models in card: parts of a scaled graph bent back by ezdxf alone, feet in their slots, and what card cannot do."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import LineString, MultiPoint, Point, Polygon
from shapely.geometry import box as rectangle
from shapely.ops import unary_union

from dsfab.app.cli import main
from dsfab.preset.file import load_preset
from dsfab.report.assembly.book import book_pages
from dsfab.report.assembly.paper import PAPER_HEIGHT, PAPER_WIDTH
from dsfab.workshop import Layering, workshop_plan
from dsfab.workshop.card_models import MODEL_LETTERS, model_notes, scaled_graph, scaled_surface
from dsfab.workshop.development import member_course
from dsfab.workshop.ground import BasePlane, StripFoot, base_parts, clipped_polygon
from dsfab.workshop.layers import END_DISTANCE
from dsfab.workshop.strips import strip_limits, strip_parts
from tests.analytic import SURFACES
from tests.designs import sliced
from tests.report.recorder import Recorder
from tests.workshop.drawn_parts import drawn, least_gap
from tests.workshop.unrolled_strips import Bent, ReadPart, graph_of

CARD = Layering(0.001, 2, 0.0006, ("keep",), MODEL_LETTERS)
A3 = [(0.418, 0.295)]
MODEL = {"model": 50, "stock": [0.42, 0.297], "thickness": 0.001, "bolt": 0.0006, "gap": 0.001}
UP = np.array([0.0, 0.0, 1.0])


@cache
def vault():
    """A model of the barrel vault at 1:50, its design and its plan."""
    changes = {"surface.edge": 0.3, **{f"workshop.{key}": value for key, value in MODEL.items()}}
    design = sliced(load_preset("barrel_vault", changes))
    return design, workshop_plan(design)


def read_in_space(part, graph, layering, folder):
    """A part as ezdxf reads it, and its holes and its outline bent onto the member in space, metres."""
    read = ReadPart(part, folder)
    course = member_course(
        graph, graph.by_id[part.member], END_DISTANCE * layering.bolt, 2 * layering.half_cover_length
    )
    reach = part.span[0] - 2 * layering.thickness, part.span[1] + 2 * layering.thickness
    curve = Bent(course, part.layer, part.span)
    wide = Bent(course, part.layer, reach)
    start = np.interp(part.span[0], wide.s, wide.long)
    assert np.linalg.norm(np.diff(read.axis, axis=0), axis=1).sum() == pytest.approx(curve.long[-1], abs=5e-5)

    def placed(points):
        along, left = read.beside_axis(points)
        return wide.points(along + start, left)[0]

    return read, placed(read.holes), placed(read.outline)


# --- as large as the model


def test_a_scaled_graph_has_shorter_bays_and_more_curvature_and_the_same_angles():
    graph = graph_of("sphere", 0.4)[1]
    small = scaled_graph(graph, 50)
    for member in graph.members:
        if member.axis is not None:
            assert small.bays(member.id) * 50 == pytest.approx(graph.bays(member.id))
            one = small.by_id[member.id]
            assert one.axis.kn == pytest.approx(50 * member.axis.kn)
            assert np.linalg.norm(one.axis.P, axis=1) == pytest.approx(np.linalg.norm(member.axis.P, axis=1) / 50)
            assert one.mean_width == pytest.approx(member.mean_width / 50)
    assert small.sheet.surface.area == pytest.approx(graph.sheet.surface.area / 2500)
    assert [node.angle for node in small.nodes] == [node.angle for node in graph.nodes]
    assert small.nodes[3].point == pytest.approx(graph.nodes[3].point / 50)


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_parts_of_a_model_bent_back_meet_at_their_nodes_within_a_tenth_of_a_millimetre(name, tmp_path):
    """Of every part of both families; the two holes of a node are a layer apart along its normal."""
    graph = scaled_graph(graph_of(name, 0.2)[1], 50)
    nodes, placed = {node.id: node for node in graph.nodes}, {}
    for part in strip_parts(graph, CARD, A3, splice="cover").pieces:
        read, holes, _ = read_in_space(part, graph, CARD, tmp_path)
        assert read.diameters <= {0.6}
        for hole, point in zip(part.holes, holes, strict=True):
            if hole.bolt in nodes:
                off = point - nodes[hole.bolt].point
                n = nodes[hole.bolt].normal
                assert np.linalg.norm(off - (off @ n) * n) < 1e-4
                placed.setdefault(hole.bolt, []).append(point)
    pairs = [pair for pair in placed.values() if len(pair) == 2]
    assert len(pairs) > 20
    assert max(abs(np.linalg.norm(a - b) - 0.001) for a, b in pairs) < 1e-4


def renamed(graph, before):
    """The same graph with longer names of members."""
    members = tuple(replace(member, id=before + member.id) for member in graph.members)
    nodes = (replace(node, members=tuple(before + name for name in node.members)) for node in graph.nodes)
    return replace(graph, members=members, nodes=tuple(nodes))


@pytest.mark.parametrize("before", ["", "meridian "])
def test_names_on_short_bays_are_small_or_left_out_rather_than_engraved_on_each_other_or_drilled_through(before):
    """What hangs together of what is engraved is a letter, 3 mm high at most: no name runs into another."""
    graph = renamed(scaled_graph(graph_of("sphere", 0.4)[1], 50), before)
    for part in strip_parts(graph, CARD, A3, splice="cover").pieces[::4]:
        outline = Polygon(part.outline).buffer(2e-4)
        holes = MultiPoint([hole.at for hole in part.holes]).buffer(0.0003)
        engraved = unary_union([LineString(mark) for mark in part.marks])
        assert outline.covers(engraved)
        assert not engraved.intersects(holes)
        for letter in engraved.buffer(1e-6).geoms:
            x0, y0, x1, y1 = letter.bounds
            assert np.hypot(x1 - x0, y1 - y0) < 0.0045


# --- feet and the plate


@pytest.mark.slow
def test_feet_of_a_vault_stand_on_the_plate_and_go_through_their_slots(tmp_path):
    design, plan = vault()
    (base,) = (part for part in plan.parts if part.id == "base")
    slots = [Polygon(slot) for slot in ReadSlots(base, tmp_path).slots]
    lowest = design.surface.V[:, 2].min() / 50
    taken = []
    for part in plan.parts:
        if part.member and len(part.axis):
            _, _, corners = read_in_space(part, plan.graph, plan.layering, tmp_path)
            heights = corners[:, 2] - lowest
            if plan.graph.by_id[part.member].family == "keep":  # lies along the plate, and not in it
                assert abs(heights.min()) < 5e-5
            tips = corners[np.abs(heights + 0.001) < 5e-5]
            assert heights.min() > -0.00105
            assert len(tips) in (0, 4)  # two corners of a tab at each end
            for pair in tips[: len(tips) // 2 * 2].reshape(-1, 2, 3):
                through = [k for k, slot in enumerate(slots) if all(slot.covers(Point(*tip[:2])) for tip in pair)]
                assert len(through) == 1
                taken += through
            standing = np.abs(heights) < 5e-5
            assert standing.sum() >= len(tips)  # the shoulders, and where tabs begin
    assert sorted(taken) == list(range(len(slots)))
    assert len(slots) == 28


class ReadSlots:
    """The slots (4, 2) of a plate as ezdxf reads them, metres."""

    def __init__(self, part, folder):
        import ezdxf

        from dsfab.export import flat_dxf
        from dsfab.workshop.files import part_drawing

        (folder / "base.dxf").write_bytes(flat_dxf(part_drawing(part)))
        space = ezdxf.readfile(folder / "base.dxf").modelspace()
        lines = space.query('LWPOLYLINE[layer=="SLOTS"]')
        self.slots = [np.array([p[:2] for p in line.get_points()]) / 1000 for line in lines]


COORDINATE = st.floats(-2, 2).map(lambda x: round(x, 3))


@given(st.tuples(COORDINATE, COORDINATE), st.floats(0, np.pi), st.floats(0.1, 3), st.floats(0.1, 3))
def test_a_clipped_rectangle_agrees_with_shapely(middle, turn, long, wide):
    way = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-way[1], way[0]])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [long / 2, wide / 2]
    P = np.array(middle) + corners @ np.stack([way, across])
    found = clipped_polygon(P, np.array([[-1.0, -1.0], [1.0, 1.0]]))
    area = Polygon(found).area if len(found) > 2 else 0.0
    assert area == pytest.approx(Polygon(P).intersection(rectangle(-1, -1, 1, 1)).area, abs=1e-9)


def test_a_plate_larger_than_the_stock_is_in_pieces_that_have_all_of_its_slots():
    made, _ = graph_of("cylinder", 0.4)
    surface = scaled_surface(made.surface, 50)
    held = surface.V[np.abs(surface.V[:, 2] - surface.V[:, 2].min()) < 1e-9]
    ground = BasePlane(held[0], UP, held, 0.01, 0.001, 1e-4)
    low = ground.plan_view(held).min(axis=0)
    square = np.array([[0.0, 0.0], [0.004, 0.0], [0.004, 0.002], [0.0, 0.002]])
    none = np.zeros(4)
    feet = [(f"B{k}", StripFoot(none, none, np.zeros(2), square + low + [0.011 * k, 0.0], True)) for k in range(9)]
    whole = base_parts(ground, surface, feet, [(1.0, 1.0)])
    pieces = base_parts(ground, surface, feet, [(0.08, 0.05)])
    assert len(whole) == 1
    assert len(pieces) > 1
    assert max(float(part.size.max()) for part in pieces) <= 0.08
    areas = [sum(Polygon(slot).area for part in some for slot in part.slots) for some in (whole, pieces)]
    assert areas == pytest.approx([9 * 8e-6, 9 * 8e-6])
    assert sum(Polygon(part.outline).area for part in pieces) == pytest.approx(Polygon(whole[0].outline).area)


# --- what card cannot do


def test_card_on_a_sphere_has_the_bending_strain_of_its_thickness_over_the_radius():
    made, graph = graph_of("sphere", 0.4)
    limit = 0.01
    notes = {}
    for scale in (50, 400):
        small = scaled_graph(graph, scale)
        limits = strip_limits(small, scaled_surface(made.surface, scale), 0.001, limit, 0.0006)
        assert limits.bending == pytest.approx(0.0005 * scale / 6.5, rel=0.1)
        notes[scale] = model_notes(limits, small, scale, 0.0006)
    assert not any(note.startswith(("NOT", "TOO", "HOLES")) for note in notes[50])
    assert notes[400][0].startswith("NOT SMOOTH: card of 1 mm")
    (narrow,) = (note for note in notes[400] if note.startswith("TOO NARROW"))
    width = min(member.mean_width for member in graph.members if member.axis is not None)
    said = float(narrow.partition("at 1:")[2].split()[0])
    assert width / said >= 0.002 > width / (2 * said)


def test_packing_fills_the_layers_between_members():
    _, plan = vault()
    families = {member.id: member.family for member in plan.graph.members}
    wanted = sum(plan.layering.packing_layers(node, families) for node in plan.graph.nodes if node.kind != "grazing")
    squares = [part for part in plan.parts if ".p" in part.id]
    assert len(squares) == wanted > 0
    assert all(len(part.holes) == 1 for part in squares)


def test_a_model_keeps_the_nesting_gap_and_the_names_of_parts():
    _, plan = vault()
    assert least_gap(plan.sheets) > 0.001 - 1e-8
    assert {sheet.size for sheet in plan.sheets} == {(0.42, 0.297)}
    for part in plan.parts:
        around = Polygon(part.outline).buffer(2e-4)
        assert all(around.covers(Point(*place)) for mark in part.marks for place in mark), part.id


def test_the_page_for_model_makers_names_the_plate_and_stays_on_the_paper():
    design, plan = vault()
    pages = dict(book_pages(plan, design))
    paper = Recorder()
    pages["Building the model at 1:50"](paper)
    words = " ".join(text for text, *_ in paper.words)
    assert "base, 1:1" in words
    assert "Layers from the inside: rings and bands around supports and loads, then rim, then B, then A" in words
    assert all(x >= 0 and x + wide <= PAPER_WIDTH and 0 <= y <= PAPER_HEIGHT for _, x, y, wide, _ in paper.words)
    for (_, _, y, *_), (_, _, below, *_) in pairwise(paper.words[:-1]):
        assert below <= y + 1e-9


# --- the command


@pytest.mark.slow
def test_the_command_writes_a_sheet_each_for_the_laser_and_removes_those_of_an_earlier_model(tmp_path, capsys):
    words = ["workshop", "barrel_vault", "--set", "surface.edge=0.3", "-o", str(tmp_path / "m"), "-q"]
    assert main([*words, "--model", "1:25", "--stock", "A3", "--thickness", "1mm"]) == 0
    many = {path.name for path in (tmp_path / "m").glob("sheet_*")}
    assert main([*words, "--model", "1:50"]) == 0
    few = {path.name for path in (tmp_path / "m").glob("sheet_*")}
    assert few == {"sheet_1.dxf", "sheet_1.svg"} < many
    layers, parts = drawn(tmp_path / "m" / "sheet_1.dxf")
    assert layers == {"STOCK", "CUT", "HOLES", "SLOTS", "ENGRAVE"}
    assert parts == len(vault()[1].parts)
    text = (tmp_path / "m" / "sheet_1.svg").read_text()
    assert "stroke-width: 0.100" in text
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--model", "0"], "--model '0' is not a scale; write for instance --model 1:50"),
        (["--model", "1:x"], "is not a scale"),
        (["--stock", "B9"], "--stock 'B9' is not a size of a sheet; write A4, A3"),
        (["--stock", "3xm"], "--stock 'm' is not a length"),
        (["--thickness", "2miles"], "--thickness '2miles' is not a length; write for instance 1mm"),
    ],
)
def test_invalid_scales_sheets_and_lengths_are_refused_in_one_sentence(words, said, capsys):
    assert main(["workshop", "dome", *words]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "size"), [("A3", (0.42, 0.297)), ("2.5x1.25", (2.5, 1.25)), ("420x297mm", (0.42, 0.297))]
)
def test_sheets_of_the_stock_are_named_or_measured(text, size):
    from dsfab.app.options import UNCHANGED
    from dsfab.app.workshop import options_source

    found = options_source(UNCHANGED, "1:50", text, "1.5mm").set_values()
    assert found["workshop.stock"] == pytest.approx(list(size))
    assert found["workshop.thickness"] == 0.0015
    assert found["workshop.model"] == 50
    assert found["workshop.gap"] == 0.001
