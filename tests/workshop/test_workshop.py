"""The workshop: nests whose gaps shapely measures, plates, sheets, limits in numbers, the command and its files."""

import csv
import io
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dsfab
from dsfab.app.cli import main
from dsfab.core.errors import PatternError, PresetError
from dsfab.design import Design
from dsfab.members import Node, member_graph
from dsfab.preset.file import load_preset, with_overrides
from dsfab.surface import Surface
from dsfab.workshop import FlatPart, Layering, NestedSheet, refolded_plan, workshop_plan
from dsfab.workshop import plan as workshop_plans
from dsfab.workshop.files import cut_list, cut_list_workbook
from dsfab.workshop.nesting import nest_parts
from dsfab.workshop.nesting.skyline import column_grid, empty_sheet, part_shapes, place_part
from dsfab.workshop.parts import GLYPHS, Hole, alike_parts, strokes
from dsfab.workshop.plan import equal_part_groups
from dsfab.workshop.plates import FlattenedMesh, sheet_parts
from dsfab.workshop.strips import strip_limits
from tests.analytic import SURFACES
from tests.designs import sliced
from tests.workshop.drawn_parts import bowed, drawn, least_gap

STOCK, GAP = ((2.5, 1.25),), 0.008


@pytest.fixture(scope="module")
def vault():
    return sliced(load_preset("barrel_vault", {"surface.edge": 0.3}))


@pytest.fixture(scope="module")
def plan(vault):
    return workshop_plan(vault)


# --- nests


def shelves(parts, size, gap):
    """How many sheets boxes in rows need: the plainest packing there is."""
    sheets, x, y, row = 1, gap, gap, 0.0
    for part in sorted(parts, key=lambda part: -part.size[1]):
        a, b = part.size
        if x + a + gap > size[0]:
            x, y, row = gap, y + row + gap, 0.0
        if y + b + gap > size[1]:
            sheets, x, y, row = sheets + 1, gap, gap, 0.0
        x, row = x + a + gap, max(row, b)
    return sheets


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.2, 2.3), st.floats(0.04, 0.3), st.floats(-0.6, 0.6)), min_size=1, max_size=25),
    st.sampled_from([0.0, 0.003, 0.008, 0.03]),
)
def test_parts_on_sheets_keep_the_gap_whatever_their_bends_and_need_no_more_sheets_than_boxes_in_rows(sizes, gap):
    parts = [bowed(f"P{k}", *size).along_x() for k, size in enumerate(sizes)]
    sheets = nest_parts(parts, STOCK, gap)
    assert sorted(one.part.id for sheet in sheets for one in sheet.parts) == sorted(part.id for part in parts)
    assert least_gap(sheets) >= gap - 1e-9
    assert len(sheets) <= shelves(parts, STOCK[0], gap)


def test_a_part_may_be_longer_than_its_sheet_by_a_rounding_error_only():
    assert len(nest_parts([bowed("A1", 2.5 - 2 * GAP + 1e-10, 0.5, 0.0)], STOCK, GAP)) == 1
    with pytest.raises(PatternError, match="fits on no sheet of the stock"):
        nest_parts([bowed("A1", 2.5 - 2 * GAP + 1e-7, 0.5, 0.0)], STOCK, GAP)


@pytest.mark.parametrize(("off", "corners"), [(1e-5, 4), (4e-5, 5)])
def test_drawings_leave_out_corners_a_fiftieth_of_a_millimetre_off_a_line(off, corners):
    outline = np.array([[0.0, 0.0], [0.5, -off], [1.0, 0.0], [1.0, 0.2], [0.0, 0.2]])
    (drawn_outline,) = FlatPart("A1", "A1", (0.0, 1.0), outline).contours
    assert len(drawn_outline) == corners


def test_strips_of_one_bend_lie_in_each_other_exactly_a_gap_apart():
    parts = [bowed(f"P{k}", 2.4, 0.1, 0.8) for k in range(8)]
    (sheet,) = nest_parts(parts, STOCK, GAP)
    assert sum(part.size[1] for part in parts) > 2 * 1.25  # boxes would need three
    assert least_gap([sheet]) == pytest.approx(GAP, abs=1e-6)


def test_a_short_part_fills_the_gap_below_an_arch():
    ask = column_grid(STOCK, GAP)
    sheet, arch = empty_sheet((2.5, 0.45), ask), bowed("arch", 2.4, 0.1, 0.8)
    assert place_part(sheet, part_shapes(arch, ask, boxes=False)[:1], ask)
    gap = max(sheet.gaps, key=lambda gap: gap.high)
    assert gap.high == pytest.approx(np.ptp(arch.outline[:25, 1]), abs=0.01)  # of its inner edge
    for name, length in (("one", 0.9), ("two", 0.5)):
        assert place_part(sheet, part_shapes(bowed(name, length, 0.08, 0.0), ask, boxes=False), ask)
        assert sheet.parts[-1].placed_part.outline[:, 1].max() < sheet.parts[0].placed_part.outline[:, 1].max() - 0.1
    assert least_gap([NestedSheet(sheet.size, tuple(sheet.parts))]) >= GAP - 1e-9


def test_members_lie_along_the_grain_of_the_stock():
    parts = [bowed(f"P{k}", 1.0, 0.12, 0.0) for k in range(19)]
    free, along = nest_parts(parts, [(2.5, 1.1)], GAP), nest_parts(parts, [(2.5, 1.1)], GAP, grain=True)
    assert len(free) == 1  # all across
    assert {one.turn for one in free[0].parts} >= {np.pi / 2}
    assert len(along) == 2
    assert {one.turn for sheet in along for one in sheet.parts} <= {0.0, np.pi}
    square = FlatPart("base", "", (0.0, 0.0), np.array([[0, 0], [0.9, 0], [0.9, 2.0], [0, 2.0]]))
    assert len(nest_parts([square], [(2.5, 1.1)], GAP, grain=True)) == 1  # it is of no member
    tall = FlatPart("P", "P", (0.0, 0.0), square.outline)
    with pytest.raises(PatternError, match=r"part P is 0\.9 x 2 m and fits on no sheet .*, along its grain"):
        nest_parts([tall], [(2.5, 1.1)], GAP, grain=True)


def test_a_small_part_goes_on_the_small_stock_and_a_large_one_on_the_large():
    small = [bowed("small", 0.5, 0.1, 0.0)]
    assert [sheet.size for sheet in nest_parts(small, ((2.5, 1.25), (1.0, 0.5)), GAP)] == [(1.0, 0.5)]
    assert [sheet.size for sheet in nest_parts([bowed("large", 2, 0.1, 0.0)], ((1.0, 0.5), (2.5, 1.25)), GAP)] == [
        (2.5, 1.25)
    ]
    with pytest.raises(PatternError, match=r"part huge is 3 x 0\.1 m and fits on no sheet .* larger workshop\.stock"):
        nest_parts([bowed("huge", 3, 0.1, 0.0)], STOCK, GAP)


def test_the_parts_of_a_vault_are_all_on_sheets_that_are_well_used(plan):
    assert sorted(one.part.id for sheet in plan.sheets for one in sheet.parts) == sorted(part.id for part in plan.parts)
    assert len({part.id for part in plan.parts}) == len(plan.parts)
    assert least_gap(plan.sheets) >= GAP - 1e-9
    assert plan.used_share > 0.72


@pytest.mark.slow
def test_sheets_of_a_dome_are_well_used():
    dome = sliced(load_preset("dome"))
    plan = workshop_plan(Design.from_preset(with_overrides(dome.preset, {"workshop.route": "strips"}), dome))
    assert len(plan.sheets) <= 30
    assert plan.used_share > 0.72
    assert least_gap(plan.sheets) >= GAP - 1e-9


# --- parts


def test_parts_that_are_one_part_are_counted_once_also_turned_round():
    one, two, other = (
        bowed("a", 1, 0.1, 0.3),
        bowed("b", 1, 0.1, 0.3).moved_by(np.pi, np.zeros(2)),
        bowed("c", 1, 0.1, 0.31),
    )
    assert equal_part_groups([one, other, two]) == ((0, 2), (1,))
    corners = np.array([[0, 0], [3, 0], [2.5, 1.0]])
    upper, lower = (FlatPart("t", "t", (0, 0), side).along_x() for side in (corners, corners[::-1] * [1, -1]))
    assert equal_part_groups([upper, lower]) == ((0,), (1,))  # the other face up is another part


def test_near_equal_parts_become_equal_if_their_holes_fit():
    """Half a turn is one shape, a mirror image is another; each part keeps its name and its bolts."""
    corners, places = (
        np.array([[-0.5, -0.1], [0.5, -0.1], [0.5, 0.1], [-0.5, 0.12]]),
        np.array([[-0.4, 0.0], [0.3, 0.0]]),
    )

    def part(name, outline, holes):
        bolts = tuple(Hole(at, 0.012, f"{name}{k}") for k, at in enumerate(holes))
        return FlatPart(name, name, (0, 0), outline, bolts).at_origin()

    near = part("b", -(corners + [0.0, 0.003]), -(places + [[0.0, 4e-4], [0.0, 2e-4]]))
    loose, wide = part("c", corners, places + [[0.0, 0.0], [2e-3, 0.0]]), part("d", corners * [1, 1.1], places)
    mirrored = part("e", (corners * [1, -1])[::-1], places)
    parts = [part("a", corners, places), near, loose, wide, mirrored]
    alike = alike_parts(parts, 0.005, 5e-4)
    assert equal_part_groups(parts) == ((0,), (1,), (2,), (3,), (4,))
    assert equal_part_groups(alike) == ((0, 1), (2,), (3,), (4,))
    assert [(new.id, [hole.bolt for hole in new.holes]) for new in alike] == [
        (old.id, [hole.bolt for hole in old.holes]) for old in parts
    ]
    assert max(abs(new.size - old.size).max() for new, old in zip(alike, parts, strict=True)) < 0.005
    assert all(new is old for new, old in zip(alike_parts(parts, 0.0, 0.0)[2:], parts[2:], strict=True))


@pytest.mark.slow
def test_splices_of_a_vault_share_few_covers_whose_holes_fit_their_pieces(vault, plan):
    even = Design.from_preset(with_overrides(vault.preset, {"workshop.alike": 0.005}), vault).until("slicing")
    alike = workshop_plan(even)
    assert len(alike.parts) == len(plan.parts)
    covers = [group for group in alike.equal_parts if ".c" in alike.parts[group[0]].id]
    assert 10 * len(covers) < sum(map(len, covers))
    assert len(alike.equal_parts) < len(plan.equal_parts)
    assert any(f"{len(alike.equal_parts)} different shapes" in note for note in alike.notes)
    assert refolded_plan(alike).deviations.max() < 2 * 5e-4
    test_covers_have_the_holes_of_their_pieces(alike)


def test_a_note_says_how_few_shapes_parts_have_if_five_millimetres_do_not_count(plan):
    (note,) = (note for note in plan.notes if "workshop.alike" in note)
    words = r"\d+ parts of (\d+) shapes; workshop.alike = (\S+) would leave at most (\d+) different shapes"
    shapes, distance, fewer = re.fullmatch(words, note).groups()
    assert (int(shapes), float(distance)) == (len(plan.equal_parts), 0.005)
    assert int(fewer) < int(shapes)


def test_covers_have_the_holes_of_their_pieces(plan):
    by_name = {part.id: part for part in plan.parts}
    covers = [part for part in plan.parts if ".c" in part.id]
    assert covers
    for cover in covers:
        holes = [hole.at for part in plan.parts if part.member == cover.member and part is not cover
                 for hole in part.holes if hole.bolt == cover.id]  # fmt: skip
        assert len(holes) == len(cover.holes) > 0
        assert np.ptp([hole.at[0] for hole in cover.holes]) == pytest.approx(14 * 0.012, abs=4e-3)
    assert by_name["A01.1"].member == "A01"


def test_every_crossing_has_a_hole_in_both_members(vault, plan):
    holes = {(hole.bolt, part.member) for part in plan.parts for hole in part.holes}
    crossings = [node for node in vault.members.nodes if node.kind == "crossing"]
    assert crossings
    assert {(node.id, name) for node in crossings for name in node.members} <= holes


def test_layers_and_packing():
    layering = Layering(0.02, 4, 0.012)
    assert [
        layering.layer_height(k) for k in (*layering.family_layers("major"), *layering.family_layers("minor"))
    ] == pytest.approx([0.03, -0.01, 0.01, -0.03])
    node = Node("N1", "crossing", ("A", "R"), (0.0, 0.0), 90.0, np.zeros(3), np.array([0, 0, 1.0]), 0.0)
    assert Layering(0.02, 2, 0.012).packing_layers(node, {"A": "major", "R": "rim"}) == 1
    assert Layering(0.02, 2, 0.012).packing_layers(node, {"A": "minor", "R": "rim"}) == 0


def test_a_cylinder_patch_flattens_without_strain_and_a_sphere_patch_with_the_strain_of_its_curvature():
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 25), np.linspace(-0.3, 0.3, 25))
    plane = Surface(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()], _grid_faces(25))
    rolled = np.c_[np.sin(x.ravel()), y.ravel(), np.cos(x.ravel())]
    flat = FlattenedMesh.from_mesh(rolled, plane.F)
    assert flat.strain < 1e-3
    assert flat.flat_point(rolled[300]) == pytest.approx(flat.U[300])
    assert np.linalg.norm(flat.U[0] - flat.U[-1]) == pytest.approx(np.hypot(0.6, 0.6), rel=1e-3)
    up = np.sqrt(1 - x.ravel() ** 2 - y.ravel() ** 2)
    assert 0.005 < FlattenedMesh.from_mesh(np.c_[x.ravel(), y.ravel(), up], plane.F).strain < 0.05


def _grid_faces(n):
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (x.ravel() for x in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


@pytest.mark.parametrize(("room", "counts"), [([(2.0, 1.0)], (3, 1)), ([(1.4, 1.4)], (3, 2)), ([(1.5, 3.1)], (1, 1))])
def test_a_flat_sheet_is_cut_into_the_fewest_rectangles_that_fit(room, counts):
    plate = Surface(np.array([[0, 0, 1], [3, 0, 1], [3, 1.5, 1], [0, 1.5, 1.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found = sheet_parts(plate, room)
    assert sorted(found.counts) == sorted(counts)
    assert sum(part.area for part in found.pieces) == pytest.approx(4.5)
    longest = max(max(max(size) for size in room), 0.0)
    assert all(part.size.max() <= longest + 1e-9 for part in found.pieces)
    assert all(part.size.min() <= min(room[0]) + 1e-9 for part in found.pieces)


def test_letters_are_single_strokes_inside_of_their_height():
    for letter in GLYPHS:
        for line in strokes(letter, 6.0):
            assert line.shape[1] == 2
            assert line.min() >= 0
            assert (line.max(axis=0) <= [4, 6]).all()
    assert max(line[:, 1].max() for line in strokes("a", 6.0)) == pytest.approx(0.7 * 6)
    assert len(strokes("§", 1.0)) == 1


# --- limits


def test_the_bending_limits_of_a_sphere_follow_its_radius():
    """Bent to t / 2R, stretched by w^2 / 12 R^2; edges e may change a bay L by L (e / R)^2 / 8 = 0.5 mm."""
    made = SURFACES["sphere"](0.2)
    graph = member_graph(made.surface, made.sheet(), made.pattern)
    found = strip_limits(graph, made.surface, 0.018, 1.2e-3, 1.0)
    bay = np.median(np.concatenate([graph.bays(member.id) for member in graph.members]))
    assert found.bending == pytest.approx(0.018 / 13, rel=0.08)
    assert found.thickest == pytest.approx(13 * 1.2e-3, rel=0.08)
    assert found.shape == pytest.approx(0.12**2 / 12 / 6.5**2, rel=0.2)
    assert found.wanted_edge == pytest.approx(6.5 * np.sqrt(8 * 5e-4 / bay), rel=0.05)
    told = f"the thickest layer that can be bent is {1000 * found.thickest:.3g} mm"
    assert any(line.startswith("NOT POSSIBLE") and told in line for line in found.lines)
    (coarse,) = (line for line in found.lines if line.startswith("NOT TO DRILL FROM"))
    assert "holes may be 2.01 mm from their right places; set surface.edge to 0.5 or less" in coarse
    assert any("stretches strips by up to" in line for line in found.lines)
    assert not any("stretches" in line for line in replace(found, shape=1e-6).lines)  # it would be "0.000%"
    thin = strip_limits(graph, made.surface, 0.012, 1.2e-3, 0.2)
    assert not any(line.startswith("NOT") for line in thin.lines)


@pytest.mark.parametrize(("most_faces", "halvings"), [(250_000, 1), (1, 0)])
def test_a_coarse_mesh_is_refined_for_drilling_and_its_nodes_lie_on_the_cylinder(monkeypatch, most_faces, halvings):
    """An arch of span b and rise r has the radius (b^2 / 4 + r^2) / 2 r."""
    monkeypatch.setattr(workshop_plans, "MOST_FACES", most_faces)
    design = sliced(load_preset("barrel_vault", {"surface.edge": 0.4, "pattern.fillet": 0.0}))
    graph, edge = workshop_plans.drilling_members(design)
    assert edge == design.surface.mean_edge / 2**halvings
    assert [member.id for member in graph.members] == [member.id for member in design.members.members]
    section, P = design.preset.surface, np.array([node.point for node in graph.nodes if node.kind == "crossing"])
    radius = (section.span**2 / 4 + section.rise**2) / (2 * section.rise)
    middle = P - [0, 0, section.rise - radius]
    off = np.abs(np.linalg.norm(np.delete(middle, np.ptp(P, axis=0).argmax(), axis=1), axis=1) - radius).max()
    assert (off < 0.5e-3) == bool(halvings)


@pytest.fixture(scope="module")
def gridshell():
    return sliced(load_preset("gridshell", {"surface.edge": 0.3}))


@pytest.mark.slow
def test_laths_of_the_gridshell_are_bent_to_half_their_thickness_over_the_radius_at_the_crown(gridshell):
    """z'' across is 2 (rise - crown) / (width / 2)^2; LVL takes its strength over its stiffness."""
    surface, statics = gridshell.preset.surface, gridshell.preset.statics
    across = 2 * (surface.rise - surface.crown) / (surface.width / 2) ** 2
    limit = statics.strength / statics.young
    found = strip_limits(gridshell.members, gridshell.surface, 0.018, limit, 0.012)
    assert found.bending == pytest.approx(0.009 * across, rel=0.05)
    assert found.bending < limit
    assert found.thickest == pytest.approx(2 * limit / across, rel=0.05)
    assert any("the allowed strain is 0.24%" in line for line in found.lines)


@pytest.mark.slow
def test_the_shipped_gridshell_can_be_bent_and_drilled():
    plan = workshop_plan(sliced(load_preset("gridshell")))
    assert not any(note.startswith("NOT") or "not drilled" in note for note in plan.notes)
    assert any("are bent to a strain of up to 0.16%" in note for note in plan.notes)
    assert len(plan.sheets) <= 7
    assert plan.used_share > 0.62  # laths that are bowed by a third of a metre over six metres leave more of them
    assert least_gap(plan.sheets) >= GAP - 1e-9


# --- the command and its files


@pytest.mark.slow
def test_the_command_tells_first_and_writes_files_that_are_the_same_twice(tmp_path, capsys):
    """Planks would be too shallow, and bars longer than the stock."""
    changes = ["surface.edge=0.3", "statics.material=GL24h", "workshop.depth=0.1"]
    words = ["workshop", "barrel_vault", *(x for change in changes for x in ("--set", change)), "-o"]
    assert main([*words, str(tmp_path / "one")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("route strips")
    assert said[1].startswith("NOT POSSIBLE: layers of 40 mm")
    assert any("sheets, 7" in line and "% used" in line for line in said)
    assert main([*words, str(tmp_path / "two"), "--quiet"]) == 0
    one, two = ({path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("one", "two"))
    assert one == two
    with open(tmp_path / "one" / "cutlist.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["file"] for row in rows} | {"nest.dxf"} == {name for name in one if name.endswith(".dxf")}
    assert any(int(row["count"]) > 1 for row in rows)
    layers, parts = drawn(tmp_path / "one" / "nest.dxf")
    assert set(layers) == {"STOCK", "CUT", "HOLES", "ENGRAVE"}
    assert parts == sum(int(row["count"]) for row in rows)


def test_the_workbook_agrees_with_cut_list_nests_and_graph(plan, vault):
    """Read by openpyxl."""
    book = openpyxl.load_workbook(io.BytesIO(cut_list_workbook(plan)))
    assert book.sheetnames == ["parts", "nests", "stock", "nodes"]
    rows = [list(row) for row in book["parts"].values]
    listed = list(csv.reader(io.StringIO(cut_list(plan))))
    assert [str(cell) for cell in rows[0]] == listed[0]
    assert [row[0] for row in rows] == [row[0] for row in listed]
    length, strain = rows[0].index("length_mm"), rows[0].index("strain")
    assert [(row[length], row[strain]) for row in rows[1:]] == [
        (float(row[length]), float(row[strain])) for row in listed[1:]
    ]
    nests = list(book["nests"].values)[1:]
    assert sorted(row[4] for row in nests) == sorted(part.id for part in plan.parts)
    last = plan.sheets[-1].parts[-1]
    assert nests[-1][4:7] == (last.part.id, *(1000 * last.placed_part.outline.min(axis=0)).round(1))
    ((_, *stock),) = list(book["stock"].values)[1:]
    assert stock == [1250, 40, len(plan.sheets), pytest.approx(plan.used_share, abs=5e-4)]
    nodes = {row[0]: row for row in list(book["nodes"].values)[1:]}
    node = vault.members.nodes[3]
    assert nodes[node.id][2:4] == node.members
    assert nodes[node.id][7:] == pytest.approx(1000 * node.point, abs=0.051)


@pytest.mark.slow
def test_a_drawing_has_the_same_bytes_in_another_process():
    """ezdxf keeps classes in a set, whose order is another one in each process."""
    code = (
        "import sys, hashlib, numpy as np; from dsfab.export import FlatDrawing, FlatLine, flat_dxf; "
        "line = FlatLine('CUT', np.eye(2), True); "
        "print(hashlib.sha256(flat_dxf(FlatDrawing('x', (line,)))).hexdigest())"
    )
    found = set()
    for seed in "34":
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        found.add(done.stdout)
    assert len(found) == 1


@pytest.mark.slow
def test_a_flat_design_is_a_sheet_with_its_openings_and_an_earlier_plan_goes(tmp_path, capsys):
    out = tmp_path / "w"
    small = ["--set", "surface.edge=0.05", "-o", str(out), "-q"]
    assert main(["workshop", "cantilever", "--set", "workshop.stock=[0.6,0.6]", *small]) == 0
    before = {path.name for path in out.iterdir()}
    (out / "mine.txt").write_text("stays")
    assert main(["workshop", "cantilever", "--set", "workshop.stock=[9,9]", *small]) == 0
    after = {path.name for path in out.iterdir()}
    assert before - after
    drawings = {"nest.dxf", "nest.svg", "S1-1.dxf", "S1-1.svg"}
    assert after == {*drawings, "cutlist.csv", "cutlist.xlsx", "assembly.pdf", "mine.txt"}
    layers, parts = drawn(out / "S1-1.dxf")
    assert layers == {"CUT", "SLOTS", "ENGRAVE"}
    assert parts == 1
    design = sliced(load_preset("cantilever", {"surface.edge": 0.05}))
    (part,) = sheet_parts(design.sheet.surface, [(9.0, 9.0)]).pieces
    assert part.area == pytest.approx(design.sheet.surface.area)
    assert main(["workshop", "dome", "--set", "workshop.route=sheet", "--set", "surface.edge=0.6", "-o", str(out)]) == 1
    assert "is for flat designs" in capsys.readouterr().err


def test_a_stock_that_no_piece_of_a_strip_fits_on_is_refused(vault):
    """It cut shorter and shorter pieces without end."""
    small = Design.from_preset(with_overrides(vault.preset, {"workshop.stock": [0.1, 0.1]})).until("slicing")
    with pytest.raises(PatternError, match=r"no piece of A01 .* workshop\.stock"):
        workshop_plan(small)


def test_the_workshop_section_takes_one_or_several_sizes_and_refuses_invalid_ones():
    assert dsfab.load_preset("dome", {"workshop.stock": [1.25, 3.0]}).workshop.stock == ((3.0, 1.25),)
    several = dsfab.load_preset("dome", {"workshop.stock": [[1, 2], [3, 4]]}).workshop.stock
    assert several == ((2.0, 1.0), (4.0, 3.0))
    for key, value in {"stock": [], "route": "stips", "layers": 3, "gap": -1, "bolt": 0}.items():
        with pytest.raises(PresetError, match=f"workshop.{key}"):
            dsfab.load_preset("dome", {f"workshop.{key}": value})
