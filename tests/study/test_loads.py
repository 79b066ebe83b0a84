"""Loads on a cut sheet: its own weight, coverings by tributary area with resultant and moment, open lattices."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dsfab
from dsfab.core.errors import StaticsError, SurfaceError
from dsfab.core.messages import force
from dsfab.core.units import GRAVITY
from dsfab.design import Design, loads_on, sheet_load
from dsfab.design.regions_and_loads import CoveringLoads, nearest_faces
from dsfab.report.compliance.findings import Findings
from dsfab.report.compliance.tables import acting_table, loads_table
from dsfab.report.design.facts import cut_load_facts
from dsfab.report.design.inspection import load_facts, load_lines
from dsfab.report.html_pages import CaptionNumbers
from dsfab.slicing import cut
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.study.check_model import cut_model
from dsfab.study.comparison import comparison
from dsfab.study.verdict import LoadedSurface, whole_sheet
from dsfab.study.verdict.levels import on_mesh, shares
from dsfab.surface import (
    All,
    Ball,
    Boundary,
    Cladding,
    Force,
    LoadCase,
    Nearest,
    Pressure,
    SelfWeight,
    Snow,
    Support,
    Surface,
    Wind,
    combined_case,
    load_cases,
)
from tests.designs import sliced
from tests.meshes import mesh_file
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, lifted, moebius, sphere, two_pieces

WEIGHT = 400.0
"""N/m2 of the sheet."""

DOWN = np.array([0.0, 0.0, -1.0])


def case(surface, *loads):
    """The load case of a surface that is held somewhere; where makes no difference here."""
    return LoadCase.build(surface, [Support(All(), "x")], loads, WEIGHT)


def striped(surface, count=3.0, offset=0.37, keep=0.45):
    """What stripes across a direction that nothing else has leave of a surface."""
    ways = (surface.V @ [0.9, 0.35, 0.2], surface.V @ [-0.3, 0.8, 0.5])
    fields = [count * (x - x.min()) / np.ptp(x) + offset for x in ways]
    every = np.arange(0, count + 2)
    return cut(surface, fields, [np.sort(np.r_[every, every + keep])] * 2).subset()


def sums(surface, force):
    """Resultant (3,), newtons, and moment about the origin (3,), Nm, of forces at the vertices."""
    return np.r_[force.sum(axis=0), np.cross(surface.V, force).sum(axis=0)]


def area_of(surface, mask):
    return surface.areas[mask].sum()


def frame(surface, x, y):
    """Only the faces whose middles are outside of a window."""
    middle = surface.centroids
    window = (middle[:, 0] > x[0]) & (middle[:, 0] < x[1]) & (middle[:, 1] > y[0]) & (middle[:, 1] < y[1])
    return whole_sheet(surface).subset(~window)


@pytest.mark.parametrize("name", [name for name in ZOO if name not in ("closed", "tiny", "huge")])
def test_coverings_keep_resultant_and_moment_and_open_lattices_carry_their_own(name):
    """Closed forms: the weight is that of the material, snow on it that of its plan; a covering's is all of it."""
    surface = ZOO[name]()
    sheet = striped(surface)
    cells = sheet.surface
    share = cells.area / surface.area
    assert 0.3 < share < 0.9
    plan = np.abs(cells.normals @ DOWN) @ cells.areas
    found = {
        "weight": (SelfWeight(), WEIGHT * cells.area * DOWN),
        "glass": (Cladding(250.0), 250.0 * surface.area * DOWN),
        "snow": (Snow(800.0), 800.0 * (np.abs(surface.normals @ DOWN) @ surface.areas) * DOWN),
        "snow on ribs": (Snow(800.0, covered=False), 800.0 * plan * DOWN),
    }
    for load, known in found.values():
        given = case(surface, load)
        on = sheet_load(surface, sheet, given)
        assert sums(cells, on.force)[:3] == pytest.approx(known, rel=1e-9, abs=1e-9 * np.abs(known).max())
        if isinstance(load, Cladding) or (isinstance(load, Snow) and load.covered):
            whole = sums(surface, given.force)
            assert sums(cells, on.force) == pytest.approx(whole, rel=1e-9, abs=1e-9 * np.abs(whole).max())


@given(
    count=st.floats(1.5, 4.0),
    offset=st.floats(0.0, 1.0),
    keep=st.floats(0.15, 0.7),
    way=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda w: np.linalg.norm(w) > 0.1),
)
@settings(max_examples=25, deadline=None)
def test_whatever_is_cut_no_load_of_a_covering_is_lost(count, offset, keep, way):
    """Any stripes on a dome, a load that acts anywhere and anyhow: balance to a billionth, no refusal."""
    surface = lifted(lambda x, y: 3 * x * (1 - x) * y * (1 - y), 12)
    sheet = striped(surface, count, offset, keep)
    given = case(surface, Cladding(300.0, way), Pressure(500.0, Ball((0.5, 0.5, 0.2), 0.4)))
    on = sheet_load(surface, sheet, given)
    whole = sums(surface, given.force)
    assert sums(sheet.surface, on.force) == pytest.approx(whole, rel=1e-9, abs=1e-9 * np.abs(whole).max())


def test_wind_and_pressure_on_closed_and_one_sided_surfaces():
    ball, sheet = sphere(3), striped(sphere(3))
    for load in (Pressure(1e3), Wind(500.0, (1.0, 0.2, 0.0))):
        given = case(ball, load)
        on = sheet_load(ball, sheet, given)
        scale = np.abs(given.force).sum()
        assert sums(sheet.surface, on.force) == pytest.approx(sums(ball, given.force), abs=1e-9 * scale)
        bare = sheet_load(ball, sheet, case(ball, replace(load, covered=False)))
        traction = load.traction(ball)[sheet.parent] * sheet.surface.areas[:, None]
        assert bare.force.sum(axis=0) == pytest.approx(traction.sum(axis=0), abs=1e-9 * scale)
    strip = moebius(40, 4)
    on = sheet_load(strip, striped(strip), case(strip, Snow(1e3)))
    assert on.force.sum(axis=0) == pytest.approx(case(strip, Snow(1e3)).force.sum(axis=0))


def test_the_load_of_a_window_goes_half_to_each_rib():
    """Two ribs 1 m wide with 2 m of glass between them: each carries its own strip and half of the window."""
    surface = grid(16, 12, 4.0, 3.0)
    sheet = frame(surface, (1.0, 3.0), (-1, 9))
    on = sheet_load(surface, sheet, case(surface, Cladding(100.0)))
    left = on.force[sheet.surface.V[:, 0] < 2].sum(axis=0)
    assert left == pytest.approx(100.0 * 2.0 * 3.0 * DOWN, rel=1e-9)
    beside = np.abs(np.abs(sheet.surface.centroids[:, 0] - 2.0) - 1.0) < 0.25
    arrived = (on.parts.covered[beside] * sheet.surface.areas[beside, None]).sum(axis=0)
    assert arrived == pytest.approx(100.0 * (2 * 0.25 + 2.0) * 3.0 * DOWN, rel=1e-9)


def test_a_pane_that_is_loaded_on_one_side_rests_on_its_two_ribs():
    """2.5 m of window: the two reactions of a simply supported pane, not the nearest halves; what is further stays."""
    surface = grid(64, 8, 8.0, 1.0)
    sheet = frame(surface, (1.0, 3.5), (-1, 9))
    given = case(surface, Cladding(100.0, at=Ball((1.5, 0.5, 0.0), 0.55)))  # on the left part of the window alone
    on = sheet_load(surface, sheet, given)
    assert sums(sheet.surface, on.force) == pytest.approx(sums(surface, given.force), rel=1e-9, abs=1e-9)
    x, total = sheet.surface.V[:, 0], given.force[:, 2].sum()
    middle = sums(surface, given.force)[4] / -total
    assert on.force[(x > 3) & (x < 4), 2].sum() / total == pytest.approx((middle - 1.0) / 2.5, abs=0.04)
    assert np.abs(on.force[x > 4]).max() < 1e-12


def test_a_pane_on_one_rib_does_not_twist_it():
    surface = grid(24, 8, 3.0, 1.0)
    sheet = frame(surface, (2.0, 9.0), (-1, 9))  # the last metre has no rib beyond it
    given = case(surface, Cladding(100.0))
    on = sheet_load(surface, sheet, given)
    assert sums(sheet.surface, on.force) == pytest.approx(sums(surface, given.force), rel=1e-9, abs=1e-9)
    rim = np.isclose(sheet.surface.V[:, 0], 2.0)
    assert (on.force[rim, 2] <= 0).all()


def test_loads_go_along_the_surface_and_not_across_a_gap():
    """A folded strip: two plates 1 cm apart that hang together at one end; what is on the lower one stays there."""
    flat = grid(40, 4, 4.0, 0.4)
    s = flat.V[:, 0]
    bent = np.c_[np.where(s < 2, s, 4 - s), flat.V[:, 1], np.where(s < 2, 0.0, 0.01)]
    surface = Surface(bent, flat.F)
    below = flat.centroids[:, 0] < 1.9
    gone = below & (flat.centroids[:, 0] > 0.6) & (flat.centroids[:, 0] < 1.0)
    to = nearest_faces(surface, ~gone)
    assert (flat.centroids[to[gone], 0] < 1.5).all()
    assert (to[~gone] == np.flatnonzero(~gone)).all()


def test_slivers_are_no_bearing_and_a_piece_without_material_is_refused():
    surface = grid(10, 10, 1.0, 1.0)
    x = surface.V[:, 0]
    sheet = cut(surface, [x], [[-1.0, 0.301]], 0.0).subset()  # a hundredth of a face in the column beyond
    tributary = CoveringLoads.for_sheet(surface, sheet)
    sliver = (tributary.area > 0) & (tributary.area < 0.02 * surface.areas)
    assert sliver.sum() >= 10
    assert not np.isin(np.flatnonzero(sliver), tributary.to).any()
    both = two_pieces()
    one = whole_sheet(both).subset(both.centroids[:, 2] < 0.5)
    assert sheet_load(both, one, case(both, SelfWeight())).force[:, 2].sum() == pytest.approx(-WEIGHT)
    with pytest.raises(StaticsError, match="that piece of the surface has no material"):
        sheet_load(both, one, case(both, Snow(800.0)))
    with pytest.raises(SurfaceError, match="positive pressure"):
        case(surface, Cladding(0.0))
    with pytest.raises(SurfaceError, match="on no face"):
        case(surface, Cladding(250.0, at=Nearest(((0.0, 0.0, 0.0),))))


def test_point_loads_are_unchanged_and_load_cases_add_up():
    surface = grid(12, 8, 1.5, 1.0)
    sheet = striped(surface)
    loads = [Force(Ball((1.2, 0.5, 0.0), 0.2), (0.0, 0.0, -1e3), case="a"), Snow(800.0, case="b"), SelfWeight(case="b")]
    cases = load_cases(surface, [Support(Boundary())], loads, WEIGHT)
    assert (cases["a"].parts.point == cases["a"].force).all()
    assert not cases["a"].parts.traction.any()
    both = combined_case(cases, {"a": 1.5, "b": 2.0})
    on = loads_on(surface, sheet, {**cases, "both": both})
    assert on["both"].force == pytest.approx(1.5 * on["a"].force + 2.0 * on["b"].force, abs=1e-9)
    assert on["a"].force.sum(axis=0) == pytest.approx([0, 0, -1e3])
    plain = cases["a"].with_forces(cases["a"].force)  # without parts: all of it on the vertices
    assert (sheet_load(surface, sheet, plain).force == on["a"].force).all()


@pytest.mark.slow
def test_a_thinner_sheet_weighs_less_and_its_covering_does_not():
    surface = grid(6, 4, 1.5, 1.0)
    given = case(surface, SelfWeight(), Cladding(250.0))
    thin = given.of_thickness(surface, 0.4)
    assert thin.force[:, 2].sum() == pytest.approx(-(0.4 * WEIGHT + 250.0) * 1.5)
    assert given.of_thickness(surface, 1.0) is given
    design = dsfab.run(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.0}))
    compared = dsfab.compare(design, ("thinner",), level="quick")
    for one in ("full", "design", "thinner"):  # each its own weight, on supports that carry the point load besides
        (carried,) = compared[one].judgement.cases.values()
        assert carried.reactions[0][2] == pytest.approx(50e3 + compared[one].mass * GRAVITY, rel=1e-6)
    assert compared["thinner"].mass == pytest.approx(compared["design"].mass, rel=1e-3)


@pytest.mark.slow
def test_each_mesh_of_a_verdict_carries_the_weight_of_the_cut_sheet():
    design = sliced(dsfab.load_preset("snow_vault", {"surface.edge": 0.9}))
    surface, sheet = design.surface, design.slicing.cells.subset()
    setting = LoadedSurface.from_design(design)
    loads = loads_on(surface, sheet, setting.loads)
    known = {name: load.force.sum(axis=0) for name, load in loads.items()}
    weight = design.preset.statics.area_weight * sheet.surface.area
    assert known["dead"] == pytest.approx([0, 0, -weight])
    assert known["all_over"] == pytest.approx([0, 0, -1.35 * weight - 1.5 * 1200 * 108], rel=1e-9)
    forces = shares(sheet, loads)
    for _, mesh in zip(range(3), meshes(sheet, SmoothSurface.from_surface(surface)), strict=False):
        cases, spreads = on_mesh(surface, mesh, setting.loads, forces)
        for name, total in known.items():
            assert cases[name].force.sum(axis=0) == pytest.approx(total, rel=1e-12, abs=1e-6)
            spread = (spreads[name].face * mesh.surface.areas[:, None]).sum(axis=0)
            assert spread == pytest.approx(total, rel=1e-12, abs=1e-6)


@pytest.mark.parametrize("name", ["hypar.obj", "BubbleShell.obj", "Botanic.obj"])
def test_no_window_is_too_wide_for_weight_and_snow(name):
    """'the load at ... finds no material within 3.15 m' refused these, partly for material that is not there."""
    surface = dsfab.read_surface(mesh_file(name), "m")
    load = LoadCase.build(surface, [Support(Boundary())], [SelfWeight(), Snow(800.0), Cladding(250.0)], WEIGHT)
    x = surface.V[:, 0]
    wide = cut(surface, [x], [[x.min() - 1, x.min() + 0.12 * np.ptp(x), x.max() - 0.12 * np.ptp(x)]]).subset()
    assert wide.surface.area < 0.5 * surface.area
    on = sheet_load(surface, wide, load)
    assert on.parts.covered.any()
    total = (surface.areas[:, None] * load.parts.covered).sum(axis=0)
    arrived = (on.parts.covered * wide.surface.areas[:, None]).sum(axis=0)
    assert arrived == pytest.approx(total, abs=1e-9 * abs(total[2]))


def test_each_reported_weight_names_its_sheet():
    """The table of loads, design.json, the note after the cut and the CalculiX model: both weights, closed forms."""
    given = dsfab.load_preset(DOME_MODES, {"surface.edge": 1.0})
    glass = [{"kind": "cladding", "pressure": 250.0}, {"kind": "wind", "pressure": 500.0, "direction": [1, 0, 0],
             "covered": False}]  # fmt: skip
    loads = [*(one for one in json.loads(given.model_dump_json())["surface"]["load"]), *glass]
    design = Design.from_preset(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.0, "surface.load": loads}))
    before = list(load_lines(load_facts(design)))
    assert before[2].split() == ["load", "uncut", "sheet", "towards", "on"]
    design.until("slicing")
    facts = json.loads(json.dumps(load_facts(design)))
    lines = list(load_lines(facts))
    assert lines[2].split() == ["load", "uncut", "sheet", "cut", "sheet", "towards", "on"]
    of = {entry["name"]: entry for entry in facts["loads"]}
    weight = design.preset.statics.area_weight
    for key, surface in (("force_N", design.surface), ("cut_force_N", design.sheet.surface)):
        assert of["self weight"][key] == pytest.approx([0, 0, -weight * surface.area])
        assert of["force"][key] == pytest.approx([0, 0, -50e3])
        assert of["cladding"][key] == pytest.approx([0, 0, -250 * design.surface.area])
    assert of["wind"]["cut_force_N"][0] < 0.6 * of["wind"]["force_N"][0]
    told = cut_load_facts(design)["load_N"]["load"]
    assert told == pytest.approx(np.sum([entry["cut_force_N"] for entry in of.values()], axis=0), rel=1e-9, abs=1e-6)
    texts = [note.text for note in design.notes if note.stage == "slicing"]
    both = force(weight * design.sheet.surface.area), force(weight * design.surface.area)
    assert any(text.startswith(f"the cut sheet weighs {both[0]}") and both[1] in text for text in texts)
    assert any("act only on members" in text for text in texts)
    model = cut_model(design).model
    assert model.steps["load"].sum(axis=0) == pytest.approx(told, rel=1e-9, abs=1e-6)
    assert any("Loads are those of the cut sheet" in note for note in model.notes)
    found = Findings(comparison(design, ()), [], "")
    table = loads_table(found, CaptionNumbers())
    assert "on the cut sheet" in table.caption
    assert float(table.rows[0][3]) == pytest.approx(told[2] / 1e3, rel=1e-3)
    assert force(np.linalg.norm(design.load.force.sum(axis=0))) in table.note
    words = [row[3] for row in acting_table(found, CaptionNumbers()).rows]
    assert [text for text in words if "on the members alone" in text] == [words[3]]
    assert not any("overed" in text for text in words)


def test_a_preset_without_weight_gives_no_note_of_weight():
    design = sliced(dsfab.load_preset("cantilever", {"surface.edge": 0.2}))
    assert not any("weigh" in note.text for note in design.notes)
    assert (design.load.parts.point == design.load.force).all()
