"""Comparison: loads handed to the cut sheet with their resultant, competitors of the same mass under the same loads."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import dsfab
from dsfab.app.cli import main
from dsfab.core.errors import DsfabError, StaticsError
from dsfab.core.messages import mass
from dsfab.design import draft
from dsfab.design.regions_and_loads import lost_load, sheet_load
from dsfab.slicing import cut
from dsfab.statics import Elements, ResultRequest, SheetModel, solve_statics
from dsfab.study import compare_at
from dsfab.study.alternatives import Competitor
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.comparison import comparison
from dsfab.study.judges import quick
from dsfab.surface import LoadCase
from tests.presets import DOME_MODES, SPHERE_GRADED_MODES
from tests.shapes import grid

CHANGES = {"surface.edge": 0.05}


@pytest.fixture(scope="module")
def cantilever():
    return dsfab.run(dsfab.load_preset("cantilever", CHANGES))


@pytest.fixture(scope="module")
def compared(cantilever):
    return comparison(cantilever)


def test_a_comparison_is_shown_in_a_line_each(compared):
    lost, head, *lines = repr(compared).splitlines()
    assert lost.startswith("This design loses: a uniformly thinner sheet without openings of the same mass is ")
    assert head.split()[:3] == ["Comparison", "of", "cantilever"]
    assert [line.split()[0] for line in lines] == [one.name for one in compared.competitors]
    own = compared.design
    assert " ".join(lines[1].split()) == f"design {own.compliance:.4g} J 1 x the design's {mass(own.mass)}"
    (rival,) = [line for line in lines if line.startswith("isotropic")]
    assert f"{compared.gain('isotropic'):.3g} x the design's" in rival
    lost = replace(compared, rivals=(Competitor("grid", error="it falls"),))
    assert repr(lost).splitlines()[-1].split() == ["grid", "does", "not", "carry", "the", "loads"]


def test_loads_on_the_cut_sheet_keep_their_resultant(cantilever):
    load = sheet_load(cantilever.surface, cantilever.sheet, cantilever.load)
    assert load.force.sum(axis=0) == pytest.approx(cantilever.load.force.sum(axis=0), rel=1e-12)
    held = cantilever.sheet.surface.V[load.supported]
    assert len(held) > 3
    assert held[:, 0] == pytest.approx(-1.0)
    everywhere = LoadCase(cantilever.load.fixed, np.ones((cantilever.surface.n, 3)), cantilever.load.loaded)
    spread = sheet_load(cantilever.surface, cantilever.sheet, everywhere)
    assert spread.force.sum(axis=0) == pytest.approx([cantilever.surface.n] * 3, rel=1e-12)


def test_a_load_far_from_all_material_is_refused_and_so_is_a_sheet_without_supports():
    plate = grid(10, 10, 1.0, 1.0)
    x = plate.V[:, 0]
    fixed = np.repeat((x < 0.01)[:, None], 3, axis=1)
    force = np.zeros((plate.n, 3))
    force[x > 0.99, 1] = 1.0
    left = cut(plate, [x], [[-1.0, 0.55]]).subset()
    with pytest.raises(StaticsError, match=r"has no material within 0\.45"):
        sheet_load(plate, left, LoadCase(fixed, force, x > 0.99))
    right = cut(plate, [x], [[0.55]]).subset()
    with pytest.raises(StaticsError, match="the cut removed all supported vertices"):
        sheet_load(plate, right, LoadCase(fixed, force, x > 0.99))


def test_build_and_compare_report_a_load_on_an_unsupported_piece():
    """Thin stripes that pass the disc around the load: its own piece is dropped, however near the rest is."""
    thin = {"threshold": 0.8, "frequency": 4.0}
    pattern = {"keep": 0.05, "major": thin, "minor": thin}
    design = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.08, "pattern": pattern}))
    told = [note.text for note in design.notes if note.stage == "slicing"]
    says = r"load at \[.*\] m \(1e\+03 N\) acts on a piece of material that is not connected to a support"
    assert any(re.search(says + "; set pattern.rim", text) for text in told)
    assert not any("removed material" in text for text in told)
    with pytest.raises(StaticsError, match=says):
        comparison(design, against=())


def test_a_lost_piece_loses_concentrated_loads_over_one_percent():
    plate = grid(10, 10, 1.0, 1.0)
    x = plate.V[:, 0]
    drawn = cut(plate, [x], [[-1.0, 0.35, 0.65]]).subset()
    left = drawn.subset(drawn.surface.centroids[:, 0] < 0.5)
    load = LoadCase(np.repeat((x < 0.01)[:, None], 3, axis=1), np.ones((plate.n, 3)), x > 0.99)
    assert lost_load(plate, drawn, left, [replace(load, loaded=x > 2), load]).startswith("the load at [1.0, ")
    assert lost_load(plate, drawn, drawn, [load]) == ""
    assert lost_load(plate, drawn, left, [replace(load, loaded=x > 2)]) == ""
    assert lost_load(plate, left, left, [load]) == ""  # cut away, not dropped: `sheet_load` hands it over
    weak = load.force * np.where(x > 0.99, 1e-4, 1)[:, None]
    assert lost_load(plate, drawn, left, [replace(load, force=weak, loaded=(x > 0.99) | (x < 0.01))]) == ""


def test_a_complete_sheet_cut_into_cells_has_the_stiffness_of_the_uncut_sheet(cantilever):
    """Slivers of the cut cost conditioning, not accuracy."""
    surface, statics = cantilever.surface, cantilever.preset.statics
    cells = cut(surface, cantilever.pattern.fields, cantilever.pattern.levels, 0.05)
    whole = cells.subset(np.ones(cells.surface.m, dtype=bool))
    values = [
        solve_statics(
            SheetModel(s, statics.elastic, statics.thickness), load, Elements("quadratic", "midedge")
        ).compliance
        for s, load in ((surface, cantilever.load), (whole.surface, sheet_load(surface, whole, cantilever.load)))
    ]
    assert values[1] == pytest.approx(values[0], rel=0.01)


def test_competitors_have_the_same_mass_and_full_is_the_stiffest(cantilever, compared):
    assert compared.design.mass == pytest.approx(cantilever.mass, rel=0.01)
    assert [one.name for one in compared.competitors] == ["full", "design", "isotropic", "thinner"]
    for rival in compared.rivals:
        assert rival.mass == pytest.approx(compared.design.mass, rel=1e-3)
        assert rival.compliance > compared.full.compliance
    assert compared.full.mass > compared.design.mass
    assert compared.full.compliance < compared.design.compliance


def test_in_the_plane_a_thinner_sheet_is_softer_by_its_share_of_the_thickness(compared):
    share = compared["thinner"].mass / compared.full.mass
    assert compared["thinner"].compliance * share == pytest.approx(compared.full.compliance, rel=1e-6)


def test_the_cantilever_is_stiffer_than_structures_that_do_not_know_the_stress(compared):
    spread = compared["isotropic"].spread
    assert compared.gain("isotropic") > 1.2
    assert spread.best == compared["isotropic"].compliance
    assert spread.best < spread.mean < spread.worst
    assert spread.best <= spread.median
    assert (spread.tried, spread.carried) == (6, 6)  # pairs of three modes, for both families are striped alike


def test_the_reactions_of_each_competitor_balance_its_loads(cantilever, compared):
    for one in compared.competitors:
        (case,) = one.judgement.cases.values()
        assert np.sum(case.reactions, axis=0) == pytest.approx(-cantilever.load.force.sum(axis=0), abs=1e-3)
        assert case.residual < 1e-8
        assert case.imbalance < 1e-8
        assert case.displacement.quantile <= case.displacement.value
        assert 0 < case.stress.quantile < case.stress.value
        assert max(case.tension.value, case.compression.value) > case.stress.quantile / 2
        assert case.utilisation is None
    # load and plate are the same upside down
    (full,) = compared.full.judgement.cases.values()
    assert full.tension.quantile == pytest.approx(full.compression.quantile, rel=0.02)


def test_the_full_sheet_moves_most_under_its_load_and_a_strength_is_compared(cantilever):
    strong = dsfab.revise(cantilever, dsfab.load_preset("cantilever", {**CHANGES, "statics.strength": 235e6}))
    (case,) = comparison(strong, against=()).full.judgement.cases.values()
    assert case.displacement.place[0] == pytest.approx(1.0, abs=0.1)
    assert case.utilisation == pytest.approx((case.stress.quantile / 235e6, case.stress.settled / 235e6))


@pytest.mark.slow
def test_compare_accepts_another_judge(cantilever):
    seen = []

    def strict(task, structure):
        seen.append(structure)
        return replace(quick(task, structure), bound=0.01, verdict="pass")

    compared = comparison(cantilever, ("thinner", "grid"), strict)
    assert len(seen) == 4  # of the four grids the stiffest alone
    assert {one.judgement.verdict for one in compared.competitors} == {"pass"}
    assert all(row["bound"] == 0.01 for row in compared.record()["competitors"])


def test_the_record_holds_plain_numbers_with_ratios_of_compliances(compared):
    rows = {row["name"]: row for row in json.loads(json.dumps(compared.record(), allow_nan=False))["competitors"]}
    assert rows["full"]["ratio_to_full"] == rows["design"]["ratio_to_design"] == 1
    iso = rows["isotropic"]
    assert iso["ratio_to_full"] == pytest.approx(iso["compliance_J"] / rows["full"]["compliance_J"])
    assert iso["ratio_to_design"] == pytest.approx(compared.gain("isotropic"))
    assert iso["variants_tried"] == 6
    assert rows["design"]["smallest_member_m"] > 0.005
    assert rows["full"]["smallest_member_m"] is None


@pytest.mark.slow
def test_competitors_that_fall_apart_are_listed_and_do_not_count():
    """Stripes of one field on a sphere are rings that do not touch."""
    sphere = draft(dsfab.load_preset(SPHERE_GRADED_MODES, {"surface.edge": 0.2}))
    compared = compare_at(sphere, 0.5, ["von_mises"])
    rings = compared["von_mises"]
    assert rings.error.startswith("none of 4 variants carries the loads; the first: the structure falls apart")
    assert (rings.spread.tried, rings.spread.carried, rings.spread.best) == (4, 0, float("inf"))
    assert compared.gain("von_mises") == float("inf")
    row = compared.record()["competitors"][2]
    assert (row["compliance_J"], row["variants_best"], row["mass_kg"]) == (None, None, None)


def test_a_name_of_no_competitor_is_refused(cantilever):
    with pytest.raises(DsfabError, match="no competitor 'isotropc'; did you mean isotropic"):
        comparison(cantilever, ["isotropc"])


def test_frequency_and_buckling_of_the_full_sheet_equal_its_statics():
    """The most accurate elements answer for both; buckling differs by the membrane stress of the quick ones."""
    made = draft(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "statics.frequencies": 1, "statics.buckling": 1}))
    task = ComparisonTask.from_design(made, made.surface.area / 2)
    whole = Structure.uncut(made.surface, made.preset.statics.thickness)
    (case,) = quick(task, whole, ResultRequest(frequencies=1, buckling=1)).cases.values()
    known = made.statics.answers
    assert case.frequency == pytest.approx(known.vibration.hertz[0], rel=1e-9)
    assert case.buckling == pytest.approx(known.buckling.factor[0], rel=0.2)
    (alone,) = quick(task, whole).cases.values()
    assert (alone.frequency, alone.buckling) == (None, None)


@pytest.mark.slow
def test_python_and_the_command_line_look_as_deep(tmp_path, capsys):
    """The same levels by default: the design is checked on finer meshes, and so is what it is compared with."""
    design = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.15}))
    found = dsfab.compare(design, ("thinner",))
    sets = ["--set", "surface.edge=0.15", "--against", "thinner", "--no-report", "--quiet"]
    assert main(["compare", "cantilever", *sets, "-o", str(tmp_path)]) == 0
    told = json.loads((tmp_path / "results.json").read_text())["competitors"]
    ours = found.record()["competitors"]
    assert [row["compliance_J"] for row in ours] == pytest.approx([row["compliance_J"] for row in told])
    assert [row["verdict"] for row in ours] == [row["verdict"] for row in told]
    one = dsfab.compare(design, ("thinner",), level="quick").design
    assert one.judgement.level == "quick"
    assert one.compliance < found.design.compliance
