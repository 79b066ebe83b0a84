"""`assembly.pdf`: the order in which members go up, and pages on which everything is named, inside of the page."""

import json
import re
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.design import Design
from dsfab.export import MemberShape
from dsfab.export.part import open_edges
from dsfab.preset.file import load_preset, with_overrides
from dsfab.render import PAPER
from dsfab.report.assembly import assembly_page, assembly_pdf, assembly_steps
from dsfab.report.assembly.axonometry import Axonometry, MemberFaces, drawn_faces, painted_faces
from dsfab.report.assembly.bar_pages import bar_on_plate, bar_row, bar_steps
from dsfab.report.assembly.book import book_pages
from dsfab.report.assembly.flat_parts import node_ticks
from dsfab.report.assembly.overview import refolded_pages, strip_quads
from dsfab.report.assembly.paper import PAPER_HEIGHT, PAPER_WIDTH, DrawingTransform, PaperBox, usual_scale
from dsfab.surface import Surface, signed_volume
from dsfab.thickening import closed_skin
from dsfab.workshop import FlatPart, Layering, built_shapes, layer_numbers, plate_arms, refolded_plan, workshop_plan
from dsfab.workshop.bars import bar_body
from dsfab.workshop.bodies import strip_body
from tests.browser import browser, opened
from tests.designs import sliced
from tests.report.recorder import Recorder

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def vault():
    return sliced(load_preset("barrel_vault", {"surface.edge": 0.3}))


@pytest.fixture(scope="module")
def plan(vault):
    return workshop_plan(vault)


@pytest.fixture(scope="module")
def pages(plan, vault):
    """The words of each page by its title."""
    found = {}
    for title, draw in book_pages(plan, vault):
        paper = Recorder()
        draw(paper)
        found[title] = paper.words
    return found


@pytest.mark.parametrize("up", [UP, np.array([-0.6, 0.0, 0.8]), np.array([0.0, -1.0, 0.0])])
def test_each_member_is_assembled_once_per_layer_from_below(vault, up):
    graph, layering = vault.members, Layering(0.04, 4, 0.012)
    steps = assembly_steps(graph, layering, up)
    wanted = sorted((n, m.id) for m in graph.members for n in layer_numbers(layering, m))
    assert sorted((step.layer, name) for step in steps for name in step.members) == wanted
    layers = [step.layer for step in steps]
    assert layers == sorted(layers, reverse=True)
    surface = graph.sheet.surface
    for layer in set(layers):
        names = [name for step in steps if step.layer == layer for name in step.members]
        low = [(surface.V[surface.F[graph.by_id[name].cells]] @ up).min() for name in names]
        assert (np.diff(low) > -0.02 * np.ptp(surface.V @ up) - 1e-9).all()
    assert len(steps) <= 12 + 6


def test_each_page_names_the_parts_that_it_shows(pages, plan, vault):
    built = {part.member for part in plan.parts}
    views = [title for title in pages if title.startswith("Members, ")]
    assert len(views) == 3
    for title in views:
        assert {words[0] for words in pages[title]} >= built

    def on(start):
        return {words[0] for title, page in pages.items() if title.startswith(start) for words in page}

    assert on("Family") | on("Edges") | on("Around") >= built
    assert on("Cut list") >= {f"{len(group)} x {plan.parts[group[0]].id}" for group in plan.equal_parts}
    assert on("Sheet") >= {part.id for part in plan.parts}
    assert on("Nodes") >= {node.id for node in vault.members.nodes if node.kind != "grazing"}
    assert on("What was not") >= {"Not checked by dsfab:"}


def test_words_are_inside_of_the_page_and_names_of_members_are_not_on_each_other(pages):
    for title, words in pages.items():
        for text, x, y, wide, high in words:
            assert x > 0, (title, text)
            assert x + wide < PAPER_WIDTH, (title, text)
            assert 0 < y < y + high < PAPER_HEIGHT, (title, text)
    for title in pages:
        if title.startswith("Members, "):
            for (a, x, y, w, h), (b, u, v, p, q) in combinations(pages[title], 2):
                assert x + w <= u or u + p <= x or y + h <= v or v + q <= y, (title, a, b)


def test_rows_of_members_do_not_touch_and_eight_or_more_are_on_a_page(pages):
    """Four lines of words stand beside each member."""
    families = [words for title, words in pages.items() if title.startswith("Family")]
    beside = [sorted(y for text, x, y, *_ in words if re.fullmatch(r"[A-Z]\d+", text) and x < 30) for words in families]
    assert np.concatenate([np.diff(rows) for rows in beside]).min() > 20
    assert max(map(len, beside)) >= 8


def test_the_name_of_a_node_that_would_touch_the_one_before_is_left_out():
    """Nodes 1.5 mm apart on paper, with names 1.8 mm high."""
    nodes = [SimpleNamespace(members=("A1", f"B{k}"), at=(1.5 * k, 0.0)) for k in range(3)]
    plan, paper = SimpleNamespace(graph=SimpleNamespace(nodes_along={"A1": nodes})), Recorder()
    node_ticks(paper, plan, SimpleNamespace(id="A1"), (50.0, 50.0), 1.0)
    assert [text for text, *_ in paper.words if text.startswith("B")] == ["B0", "B2"]


@pytest.fixture(scope="module")
def barred(vault):
    changes = {"workshop.route": "bars", "workshop.stock": [[5.0, 1.25]]}
    return workshop_plan(Design.from_preset(with_overrides(vault.preset, changes), vault).until("slicing"))


def test_pages_of_bars_name_every_bar_and_every_plate_inside_of_the_page(barred, vault):
    found = {}
    for title, draw in book_pages(barred, vault):
        paper = Recorder()
        draw(paper)
        found[title] = {words[0] for words in paper.words}
        for text, x, y, wide, high in paper.words:
            assert 0 < x < x + wide < PAPER_WIDTH, (title, text)
            assert 0 < y < y + high < PAPER_HEIGHT, (title, text)
    bars = {part.id for part in barred.parts if part.member}
    (node,) = (title for title in found if title.startswith("How a node"))
    arms = next(joint for joint in barred.bars.bar_lattice.joints if joint.node.id == node.split()[-1])
    assert found[node] >= {barred.bars.bar_lattice.bars[k].bay.id for k, _ in arms.bars}
    assert set().union(*(found[title] for title in found if title.startswith("Bars "))) >= bars
    cut = set().union(*(found[title] for title in found if title.startswith("Cut list")))
    assert cut >= {f"{len(group)} x {barred.parts[group[0]].id}" for group in barred.equal_parts}
    steps = [name for step in bar_steps(barred, UP) for name in step.members]
    assert sorted(steps) == sorted(bars)
    heights = {bar.bay.id: bar.points.mean(axis=0)[2] for bar in barred.bars.bar_lattice.bars}
    assert (np.diff([heights[name] for name in steps]) > -2e-3).all()


def test_a_twist_of_next_to_nothing_has_no_sign():
    words = bar_row(("A1.1", "N1", "N2", 700.0, 600.0, 60.0, -0.02, 3.0, 180.04, -2.0, -0.0449, 7.0, ""))
    assert words == ["A1.1", "N1", "N2", "600.0", "0.0°", "3.0°", "180.0°", "-2.0°", "0.0°", "7.0"]


def test_bodies_of_bars_are_closed_and_as_large_as_their_drawings(barred):
    parts = {part.id: part for part in barred.parts}
    for bar in barred.bars.bar_lattice.bars[::7]:
        V, F = bar_body(bar, barred.bars.stock)
        assert open_edges(F) == 0
        part = parts[bar.bay.id]
        assert signed_volume(V, F) == pytest.approx(part.size[0] * part.size[1] * barred.thickness, rel=2e-3)


def test_on_the_page_of_a_joint_bars_reach_past_the_plate(barred):
    lattice, parts = barred.bars.bar_lattice, {part.id: part for part in barred.parts}
    joint = lattice.joints[0]
    from_end = {lattice.bars[k].bay.id: side == 1 for k, side in joint.bars}
    for arm in plate_arms(joint, lattice, barred.bars.stock):
        if arm.bar in from_end:
            tip = bar_on_plate(parts[arm.bar], arm, from_end[arm.bar])
            reach = np.linalg.norm(tip - arm.point(0.0, 0.0), axis=1).max()
            assert 1.25 * arm.end < reach < 1.8 * arm.end


def test_the_file_is_a_pdf_with_all_pages_and_the_same_bytes_twice(plan, vault, pages):
    one = assembly_pdf(plan, vault)
    assert one.startswith(b"%PDF")
    assert one.count(b"/Type /Page\n") == len(book_pages(plan, vault))
    assert one == assembly_pdf(plan, vault)


def test_a_plan_looks_down_and_an_axonometry_keeps_verticals():
    plan = Axonometry.from_angles(UP, -90.0, 90.0)
    assert plan.projected(np.eye(3)) == pytest.approx(np.array([[1, 0], [0, 1], [0, 0]]))
    tilted = Axonometry.from_angles(UP)
    assert tilted.projected(UP)[0] == pytest.approx(0)
    assert tilted.projected(UP)[1] > 0
    assert np.stack([tilted.right, tilted.upwards, tilted.eye]) @ np.stack(
        [tilted.right, tilted.upwards, tilted.eye]
    ).T == pytest.approx(np.eye(3))


def test_near_faces_are_painted_last():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    low, high = (MemberFaces(name, (1, 0, 0), (square + [0, 0, z])[None]) for name, z in (("low", 0), ("high", 1)))
    drawn = painted_faces([high, low], Axonometry.from_angles(UP, -90, 90), {"high": (0, 0, 1)})
    assert drawn.colours.tolist() == [[1, 0, 0], [0, 0, 1]]


def test_drawings_have_usual_scales_and_fit_their_boxes():
    assert usual_scale(60.0) == (pytest.approx(50.0), "1:20")
    assert usual_scale(50.0) == (pytest.approx(50.0), "1:20")
    assert usual_scale(3.0) == (pytest.approx(2.0), "1:500")
    fitted = DrawingTransform.fit_to_box(np.array([-1.0, 2.0]), np.array([3.0, 4.0]), PaperBox(10, 20, 80, 100))
    assert fitted.to_paper(np.array([[-1.0, 2.0], [3.0, 4.0]])) == pytest.approx(np.array([[10, 50], [90, 90]]))


# --- the page


@pytest.fixture(scope="module")
def page(plan, vault):
    return assembly_page(plan, vault)


def test_the_page_draws_each_part_at_its_place_on_the_nest(page, plan, vault):
    """Turned and shifted as the page says, the corners of a part are those of its place on the nest."""
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', page, re.DOTALL)[1])
    assert {one["id"] for one in facts["members"]} == {part.member for part in plan.parts}
    assert [one["id"] for one in facts["parts"]] == [part.id for part in plan.parts]
    for sheet, given in zip(plan.sheets, facts["sheets"], strict=True):
        for one, (number, turn, x, y) in zip(sheet.parts, given["parts"], strict=True):
            assert facts["parts"][number]["id"] == one.part.id
            loop = np.array(facts["parts"][number]["loops"][0]).reshape(-1, 2)
            c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
            there = loop @ np.array([[c, s], [-s, c]]) + [x, y]
            placed = 1000 * one.placed_part.outline
            assert there.min(axis=0) == pytest.approx(placed.min(axis=0), abs=0.7)
            assert there.max(axis=0) == pytest.approx(placed.max(axis=0), abs=0.7)
            assert np.linalg.norm(there[0] - placed, axis=1).min() < 0.2
    for one, strip in zip(facts["built"], refolded_plan(plan).strips, strict=True):  # and each bent back into space
        assert (one["id"], one["member"]) == (strip.id, strip.member)
        corners = np.array(one["faces"]).reshape(-1, 4, 3)
        assert corners[0, [0, 3]] == pytest.approx(strip.edges[0], abs=1e-3)
        assert corners[-1, [1, 2]] == pytest.approx(strip.edges[-1], abs=1e-3)
    assert page == assembly_page(plan, vault)


def test_the_page_has_key_figures_and_the_colour_key_of_members(page, plan, vault):
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', page, re.DOTALL)[1])
    shades = {one["name"]: one for one in facts["shades"]}
    assert (shades["length"]["unit"], shades["width"]["unit"]) == ("m", "mm")
    for one, long, wide in zip(facts["members"], shades["length"]["values"], shades["width"]["values"], strict=True):
        member = plan.graph.by_id[one["id"]]
        assert long == pytest.approx(member.length, abs=0.006)
        assert wide == pytest.approx(1000 * member.mean_width, abs=0.6)
    figures = dict(facts["figures"])
    assert figures["mass"] == f"{vault.mass:,.0f} kg"
    assert figures["sheet"].startswith(f"{vault.sheet.surface.area:.4g} m2, ")
    assert "most used" not in figures


NEXT_FRAME = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))"
FACE = """(() => { const all = drawn.filter((face) => facts.members[face.member].id === "NAME"), P = all[SOME].points,
  box = canvas.getBoundingClientRect(); return [box.left + (P[0] + P[4]) / 2, box.top + (P[1] + P[5]) / 2]; })()"""


@pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")
def test_a_click_on_a_member_shows_its_parts_and_sheets_and_nothing_is_fetched(page, plan, tmp_path):
    file = tmp_path / "index.html"
    file.write_text(page, encoding="utf-8")
    with opened(tmp_path / "browser", (1400, 900)) as tab:
        tab.open(file.as_uri(), "typeof drawn !== 'undefined' && drawn.length > 0")
        for name in ("B06", "A02"):
            tab.click(*tab.run(FACE.replace("NAME", name).replace("SOME", "Math.floor(0.75 * all.length)")))
            tab.run(NEXT_FRAME)
            assert tab.run("document.querySelector('#detail h2').textContent") == name
            parts = tab.run("[...document.querySelectorAll('[data-part]')].map((one) => one.dataset.part)")
            mine = [part.id for part in plan.parts if part.member == name]
            assert parts == mine
            sheets = tab.run("[...document.querySelectorAll('[data-sheet]')].map((one) => +one.dataset.sheet)")
            assert sheets == sorted({plan.sheet_numbers[part] for part in mine})
            assert tab.run("document.querySelectorAll('[data-sheet] .mine').length") == len(mine)
        tab.run("document.querySelector('[data-shape=parts]').click()")
        tab.run(NEXT_FRAME)
        shown = set(tab.run("drawn.map((face) => face.name)"))
        assert shown == {part.id for part in plan.parts if len(part.axis)}
        tab.run("document.querySelector('[data-shape=members]').click()")
        tab.run(NEXT_FRAME)
        assert set(tab.run("drawn.map((face) => face.name)")) == {part.member for part in plan.parts}
        all_faces, colour = tab.run("drawn.length"), "colourOf(drawn[0].member).join()"
        plain = tab.run(colour)
        tab.run("(at('by').value = 0, at('by').dispatchEvent(new Event('change')), 1)")
        assert tab.run(colour) != plain
        assert tab.run("at('legend').textContent").endswith(" m")
        tab.run("(at('cut').value = 50, at('cut').dispatchEvent(new Event('input')), 1)")
        tab.run(NEXT_FRAME)
        half = tab.run("Math.max(...drawn.map((face) => -face.points[1]))")
        assert 0 < tab.run("drawn.length") < all_faces
        assert half < tab.run("(level = 1, Math.max(...project().map((face) => -face.points[1])))")
        tab.run("(at('cut').value = 100, at('cut').dispatchEvent(new Event('input')), 1)")
        tab.click(20, 400)  # beside it
        assert tab.run("document.querySelectorAll('[data-part]').length") == 0
        assert tab.run("document.querySelector('#detail').textContent").startswith(plan.notes[0])
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        tab.call("Emulation.setEmulatedMedia", features=dark)
        assert tab.run("getComputedStyle(document.body).backgroundColor") == "rgb(27, 27, 29)"
        assert tab.errors == []
        assert [url for url in tab.requests if not url.startswith(("file:", "data:"))] == []


PAINTED = """(() => { const w = canvas.width, h = canvas.height, d = pen.getImageData(0, 0, w, h).data;
  const found = { count: 0, top: h };
  for (let k = 3; k < d.length; k += 4)
    if (d[k] > 128) { found.count++; found.top = Math.min(found.top, Math.floor((k >> 2) / w)); }
  return found; })()"""
"""How many pixels the structure has, and how far down its highest is."""
SEEN = """(() => { const r = devicePixelRatio || 1; let large = 0, found = null;
  for (const { member, points: P } of drawn) if (member === NUMBER) {
    const x = (P[0] + P[4]) / 2, y = (P[1] + P[5]) / 2;
    const area = Math.abs((P[4] - P[0]) * (P[7] - P[3]) - (P[6] - P[2]) * (P[5] - P[1]));
    if (area <= large || drawn.findLast((face) => inside(face.points, x, y)).member !== member) continue;
    large = area;
    found = [...pen.getImageData(Math.round(r * x), Math.round(r * y), 1, 1).data.slice(0, 3)];
  }
  return found; })()"""
"""The colour of a member in the middle of its largest face that nothing is before."""


def lightness(colour: str) -> float:
    """From 0 to 1, of "rgb(27, 27, 29)"."""
    return sum(map(float, re.findall(r"[\d.]+", colour)[:3])) / 765


@pytest.mark.slow
@pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")
def test_a_clients_page_is_coloured_cut_and_read_in_light_and_in_dark(plan, vault, tmp_path):
    """`structure.html` of `dsfab report`, by the pixels that a browser draws."""
    strong = Design.from_preset(with_overrides(vault.preset, {"statics.strength": 20e6}), vault).until("slicing")
    file = tmp_path / "structure.html"
    file.write_text(assembly_page(plan, strong, judged=True), encoding="utf-8")
    with opened(tmp_path / "browser", (1400, 900)) as tab:

        def chosen(name, value):
            kind = "change" if name != "cut" else "input"
            tab.run(f"(at('{name}').value = {value}, at('{name}').dispatchEvent(new Event('{kind}')), 1)")
            tab.run(NEXT_FRAME)

        tab.open(file.as_uri(), "typeof drawn !== 'undefined' && drawn.length > 0")
        names = tab.run("[...at('by').options].map((one) => one.textContent)")
        assert names == ["family", "length", "width", "utilisation", "normal force N"]
        used = strong.member_utilisation.by_member
        for number, name in enumerate(names[1:]):
            chosen("by", number)
            values = tab.run(f"facts.shades[{number}].values")
            known = [k for k, value in enumerate(values) if value is not None]
            least, most = min(known, key=values.__getitem__), max(known, key=values.__getitem__)
            told = tab.run(
                "[...at('legend').querySelectorAll('span')].map((one) => parseFloat(one.textContent.replace(/,/g, '')))"
            )
            assert told == pytest.approx([values[least], values[most]], rel=1e-3), name
            if name == "utilisation":
                ids = tab.run("facts.members.map((one) => one.id)")
                assert ids[most] == max(used, key=used.__getitem__)
            for member, bluish in ((least, True), (most, False)):
                red, _, blue = tab.run(SEEN.replace("NUMBER", str(member)))
                assert (blue > red) == bluish, (name, member)
        whole = tab.run(PAINTED)
        for axis, level in ((2, 40), (0, 50), (1, 30)):
            chosen("axis", axis)
            chosen("cut", level)
            part = tab.run(PAINTED)
            assert 0.05 * whole["count"] < part["count"] < 0.9 * whole["count"], axis
            if axis == 2:
                assert part["top"] > whole["top"] + 20
        chosen("cut", 100)
        assert tab.run(PAINTED) == whole
        for scheme, light in (("light", True), ("dark", False), ("light", True)):
            tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            for part in ("body", "aside", "#title", "dd", "#by"):
                paper, ink = (
                    lightness(tab.run(f"getComputedStyle(document.querySelector('{where}')).{what}"))
                    for where, what in (("body", "backgroundColor"), (part, "color"))
                )
                assert (paper > 0.5) == light
                assert abs(paper - ink) > 0.5, (scheme, part)  # words stand out
        assert tab.errors == []
        assert [url for url in tab.requests if not url.startswith(("file:", "data:"))] == []


# --- parts bent back into space


def longer(plan, factor):
    """With parts that are so much longer and wider than they should be."""
    parts = tuple(
        replace(
            part,
            outline=factor * part.outline,
            axis=factor * part.axis,
            holes=tuple(replace(hole, at=factor * hole.at) for hole in part.holes),
        )
        for part in plan.parts
    )
    return replace(plan, parts=parts)


def test_holes_are_on_the_lines_of_their_bolts_and_parts_that_are_too_long_are_found_out(plan):
    found = refolded_plan(plan)
    assert [strip.id for strip in found.strips] == [part.id for part in plan.parts if len(part.axis)]
    nodes = {node.id for node in plan.graph.nodes}
    assert len(found.deviations) == sum(hole.bolt in nodes for part in plan.parts for hole in part.holes) > 50
    assert found.deviations.max() < 1e-4
    wrong = refolded_plan(longer(plan, 1.003)).deviations.max()
    assert 2e-3 < wrong < 2e-2


def test_strips_have_the_width_of_their_parts_and_pieces_follow_each_other(plan):
    strips, parts = {strip.id: strip for strip in refolded_plan(plan).strips}, {part.id: part for part in plan.parts}
    for name, strip in strips.items():
        wide = np.linalg.norm(parts[name].outline - parts[name].outline[::-1], axis=1)[: len(strip.edges)]
        assert np.linalg.norm(np.diff(strip.edges, axis=1)[:, 0], axis=1) == pytest.approx(wide, abs=1e-9)
    spliced = [name for name in strips if name.endswith(".1")]
    assert spliced
    for name in spliced:
        after = strips[f"{name[:-1]}2"]
        assert np.abs(strips[name].edges[-1] - after.edges[0]).max() < 5e-5


def test_the_page_tells_how_far_holes_are_off_and_models_have_none(plan):
    faces = drawn_faces(plan, PAPER)
    ((title, draw),) = refolded_pages(plan, faces, UP)
    paper = Recorder()
    draw(paper)
    said = " ".join(words for words, *_ in paper.words)
    assert title == "Flat parts bent into their final shape"
    assert f"{len(refolded_plan(plan).deviations)} holes at nodes are up to 0.0" in said
    assert "plate" not in said
    assert refolded_pages(replace(plan, model=50.0), faces, UP) == []
    strip = refolded_plan(plan).strips[0]
    quads = strip_quads(strip, 0.2)
    assert np.array_equal(quads[0, [0, 3]], strip.edges[0])
    assert np.array_equal(quads[-1, [1, 2]], strip.edges[-1])
    assert np.array_equal(quads[1:, 0], quads[:-1, 1])


def test_the_body_of_a_strip_is_closed_and_as_large_as_its_part_is_thick(plan):
    """Between the chords of its bend a part of thickness t is within (t / 2R)^2 of its area times t."""
    for strip, part in zip(refolded_plan(plan).strips, [one for one in plan.parts if len(one.axis)], strict=True):
        V, F = strip_body(strip, plan.thickness)
        assert open_edges(F) == 0
        assert signed_volume(V, F) == pytest.approx(part.area * plan.thickness, rel=2e-3)


def test_plates_lie_below_all_whatever_side_the_sheet_is_thick_on(plan):
    plate = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    part = FlatPart("disc 1", "disc 1", (0.0, 0.0), plate.V[:, :2])
    low = plan.layering.layer_height(plan.layering.plate_layer)
    for shift in (-1, 0, 1):
        V, F = closed_skin(plate, np.tile([0, 0, 0.1], (3, 1)), shift)
        (shape,) = built_shapes(replace(plan, parts=(part,)), [MemberShape("disc 1", "keep", V, F)], shift)
        assert np.unique(shape.V[:, 2]) == pytest.approx([low - plan.thickness / 2, low + plan.thickness / 2])
        assert built_shapes(replace(plan, parts=(part,)), [MemberShape("fill 1", "fill", V, F)], shift) == ()
