"""Sizing: the thinnest sheet of the stock that meets the targets, from at most five solves of cut sheets."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import dsfab
from dsfab.app.cli import main
from dsfab.app.options import Source
from dsfab.core.errors import PatternError, PresetError, SolidError
from dsfab.core.materials import STOCK
from dsfab.design import Design, refusal
from dsfab.preset import Preset
from dsfab.preset.file import load_preset, preset_toml, with_overrides
from dsfab.statics import factorisation
from dsfab.study import guessed_preset, run_sized, sized_preset, sizing, sizing_result
from dsfab.study.calculix import load_path, lowest_buckling, solid_model
from dsfab.study.carrying import carrying, cut_carrying, cut_statics
from dsfab.study.check_model import cut_model
from dsfab.study.sizing import further_changes, spacing_for_width, stock_thicknesses
from dsfab.surface import SelfWeight, Side, Snow, Support, Surface
from tests.calculix import ccx, needs_ccx
from tests.shapes import grid

AUTO = {
    "surface.edge": 0.9,
    "surface.length": 4.0,
    "pattern.fillet": 0.0,
    "pattern.major.spacing": 3.1,
    "pattern.minor.spacing": 2.0,
    "pattern.width": {"rule": "constant", "member": 0.6},
    "slicing.min_member": None,
    "statics": {"thickness": "auto", "material": "CLT"},
    "sizing.first": 0.1,
    "sizing.buckling": 8.0,
}
"""A coarse vault of CLT whose thickness is open."""


def vault(**changes: object):
    return load_preset("barrel_vault", AUTO | {key.replace("__", "."): value for key, value in changes.items()})


@pytest.fixture(scope="module")
def counted():
    """The sized vault, and the number of factorisations of its cut sheet."""
    count, factor = [], factorisation.stiffness_factor

    def counting(surface, K, is_held):
        count.append(surface.n)
        return factor(surface, K, is_held)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(factorisation, "stiffness_factor", counting)
        design = dsfab.sized_design(vault())
    return design, sum(n != design.surface.n for n in count)


def test_the_thinnest_sheet_of_the_stock_that_meets_the_targets_is_chosen(counted):
    design, solves = counted
    result = sizing_result(design)
    chosen, rows = result.trials[-1], [trial for trial in result.trials if not trial.is_final]
    assert solves <= 5
    assert result.fits
    assert [row.thickness for row in rows] == [t for t in STOCK["CLT"].metres if 0.05 <= t <= 0.2]
    assert design.preset.statics.thickness == chosen.thickness
    assert all(trial.worst > 1 for trial in result.trials if trial.thickness < chosen.thickness)
    assert design.preset.slicing.min_member == chosen.thickness
    judged = carrying(design)
    assert (judged.use.value, judged.movement.share, judged.buckling) == (
        chosen.utilisation,
        chosen.movement,
        chosen.buckling,
    )


def test_a_build_shows_the_chosen_thickness_once_and_the_next_thinner_one(counted):
    result = sizing_result(counted[0])
    rows = next(result.lines()).splitlines()[1:]
    assert [row.split()[0] for row in rows] == ["100", "120"]
    assert "cut with it" in rows[-1]
    assert len(next(result.lines(every=True)).splitlines()) == 1 + len(result.trials)


def test_the_figures_of_an_unsolved_thickness_are_those_of_a_full_solve(counted):
    design, _ = counted
    draft = Design.from_preset(guessed_preset(vault()), design).sketch(answers=True)
    rows = {trial.thickness: trial for trial in sizing_result(design).trials if not trial.is_final}
    near = max(t for t, row in rows.items() if row.utilisation)
    for thickness in (0.06, near, 0.2):
        judged, row = cut_carrying(cut_statics(draft, thickness)), rows[thickness]
        figures = judged.movement.share, judged.buckling, judged.mass
        np.testing.assert_allclose([row.movement, row.buckling, row.mass], figures, rtol=0.006)
        if row.utilisation:
            # the torsional stiffness of ribs is that of the solved thickness
            np.testing.assert_allclose(row.utilisation, judged.use.value, rtol=0.02)


def test_a_first_guess_that_is_far_too_thin_makes_no_difference(counted):
    """With 30 mm a nearly flat vault would move by metres, and a build would refuse it."""
    far = sizing_result(dsfab.sized_design(vault(sizing__first=0.03)))
    assert far.fits
    assert far.trials[-1].thickness == sizing_result(counted[0]).trials[-1].thickness
    flat = vault(sizing__first=0.03, surface__rise=0.01, sizing__buckling=0, sizing__movement=30)
    design = Design.from_preset(guessed_preset(flat))
    assert "would move by" in refusal(design.preset, design.statics)
    assert sizing_result(dsfab.sized_design(flat)).fits


@pytest.mark.parametrize(("thicknesses", "first", "chosen"), [((0.02, 0.06, 0.3), 0.05, 0.3), ((0.12, 0.5), 0.5, 0.12)])
def test_thicknesses_that_are_far_apart_are_all_within_reach(thicknesses, first, chosen):
    """A draft gives results for half and twice its thickness, so here each thickness needs its own draft."""
    result = sizing_result(dsfab.sized_design(vault(sizing__thicknesses=thicknesses, sizing__first=first)))
    assert (result.fits, result.trials[-1].thickness, result.changes) == (True, chosen, {})


def test_a_design_that_its_draft_overrates_is_cut_once_and_named_with_its_pattern():
    """With closer members the draft is used by 9.6 %, the cut sheet with round corners by 9.7 %."""
    changes = {"pattern__method": "modes", "pattern__fillet": 0.1}
    preset = vault(sizing__thicknesses=[0.1], sizing__buckling=0, sizing__utilisation=0.0965, **changes)
    result = sizing_result(dsfab.sized_design(preset))
    assert [trial.is_final for trial in result.trials] == [False, False, False, True]
    assert [trial.worst <= 1 for trial in result.trials] == [False, False, True, False]
    assert set(result.changes) == {f"pattern.{key}" for key in ("width.member", "major.spacing", "minor.spacing")}
    assert "changed: pattern.width.member = 0.78" in "\n".join(result.lines())


@pytest.mark.parametrize(("fails", "chosen"), [("pattern", 0.101), ("thinner sheet", 0.102)])
def test_a_design_that_only_its_draft_can_be_is_not_chosen(fails, chosen, monkeypatch):
    """Either the preset's pattern cannot be cut, or, after a sheet of 102 mm suffices, that of 101 mm."""

    def failing(design):
        refused = {
            "pattern": design.preset.pattern.width.member == 0.6,
            "thinner sheet": design.preset.statics.thickness < 0.102,
        }
        if refused[fails]:
            raise PatternError("the pattern falls apart")
        return carrying(design)

    monkeypatch.setattr(sizing, "carrying", failing)
    result = sizing_result(dsfab.sized_design(vault(sizing__thicknesses=[0.101, 0.102], pattern__fillet=0.15)))
    assert (result.fits, result.trials[-1].thickness, bool(result.changes)) == (True, chosen, fails == "pattern")


def test_if_no_thickness_suffices_the_nearest_that_can_be_cut_is_taken(monkeypatch):
    """A helical ramp was refused after a minute: its thickest draft came nearest, but could not be cut."""

    def failing(design):
        if design.preset.statics.thickness > 0.11:
            raise PatternError("the pattern cannot keep 32.0% of the surface")
        return carrying(design)

    monkeypatch.setattr(sizing, "carrying", failing)
    preset = vault(sizing__thicknesses=[0.1, 0.12, 0.14], sizing__buckling=1e6)
    result = sizing_result(dsfab.sized_design(preset))
    assert (result.fits, result.trials[-1].thickness, result.trials[-1].is_final) == (False, 0.1, True)
    with pytest.raises(PatternError, match="cannot keep"):
        dsfab.sized_design(vault(sizing__thicknesses=[0.12, 0.14], sizing__buckling=1e6))


def test_targets_that_no_thickness_meets_bring_more_material_and_closer_members(tmp_path, capsys):
    given, written = tmp_path / "given.toml", tmp_path / "sized.toml"
    given.write_text(preset_toml(vault(sizing__thicknesses=[0.02], sizing__buckling=1e6)), encoding="utf-8")
    assert main(["size", str(given), "-o", str(written)]) == 5
    said = capsys.readouterr().out
    assert len(re.findall(r"20 mm +\d+% .* misses .*buckling", said)) == 4
    assert (
        "no thickness meets the targets; a thickness of 20 mm is nearest: add supports, give the surface more rise"
        in said
    )
    assert load_preset(written).statics.thickness == 0.02
    assert main(["size", str(given), "-o", str(written)]) == 1
    assert f"{written} exists already" in capsys.readouterr().err


def test_a_preset_with_an_open_thickness_is_sized_where_it_is_run_and_not_again_after_a_build(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    preset = vault(sizing__thicknesses=[0.3], sizing__buckling=0, export__formats=["stl"])
    Path("given.toml").write_text(preset_toml(preset), encoding="utf-8")
    design = run_sized(preset)
    assert design.preset.statics.thickness == 0.3
    design.save("outputs/barrel_vault", picture=False)
    assert json.loads(Path("outputs/barrel_vault/design.json").read_text())["sizing"]["trials"][-1]["thickness"] == 0.3
    monkeypatch.setattr("dsfab.study.sized_preset", lambda preset: None)
    assert Source().read_preset("given.toml") == design.preset
    assert Source(("surface.length=5",)).read_preset("given.toml") is None, "another surface needs sizing again"
    fixed = with_overrides(preset, {"statics.thickness": 0.1})
    assert sized_preset(fixed) is fixed
    assert guessed_preset(fixed) is fixed


def test_closer_members_have_three_quarters_of_the_spacing(counted):
    *_, closer = further_changes(counted[0], 0.1)
    assert (closer["pattern.major.spacing"] / 3.1, closer["pattern.minor.spacing"] / 2.0) == pytest.approx(
        (0.75, 0.75), abs=0.02
    )


def test_members_as_wide_as_a_thick_sheet_get_a_larger_spacing(counted):
    """Members of 600 mm would be 900 mm wide in a sheet of 900 mm: the spacing grows by the same factor. A footbridge
    was refused, because its members of 600 mm stood 610 mm apart."""
    roomy, wider = further_changes(counted[0], 0.9)
    assert (roomy["pattern.major.spacing"], roomy["pattern.minor.spacing"]) == pytest.approx((4.65, 3.0))
    assert wider == roomy | {"pattern.width.member": 0.78}
    shared = Design.from_preset(vault(pattern__width={"rule": "constant", "solid_fraction": 0.36}).with_thickness(0.1))
    assert spacing_for_width(shared, 0.4) == pytest.approx(0.4 / 0.2 / 2.0)  # 1 - (1 - 0.2)^2 = 0.36
    single = Design.from_preset(shared.preset.with_pattern(families="minor"))
    assert spacing_for_width(single, 0.4) == pytest.approx(0.4 / 0.36 / 2.0)


def rippled(thicknesses) -> Preset:
    """A sheet with waves of 2 m: at their crests 52 % of a thickness of 2 m would remain, and 90 % are asked."""
    flat = grid(40, 20, 6.0, 3.0)
    return Preset(
        surface=Surface(np.c_[flat.V[:, :2], 0.15 * np.cos(np.pi * flat.V[:, 0])], flat.F),
        supports=[Support(Side("y", end), "xyz") for end in ("min", "max")],
        loads=[SelfWeight(), Snow(1000.0)],
        statics={"thickness": "auto", "material": "CLT"},
        sizing={"thicknesses": thicknesses, "first": thicknesses[0]},
        pattern={
            "method": "stripes",
            "fillet": 0.0,
            "major": {"spacing": 1.5},
            "minor": {"spacing": 1.5},
            "width": {"rule": "constant", "member": 0.5},
        },
        thickening={"thinnest": 0.9},
    )


def test_a_thickness_for_which_the_surface_bends_too_sharply_is_not_tried():
    result = sizing_result(dsfab.sized_design(rippled([0.1, 2.0])))
    assert result.stock.endswith(
        "of the preset; the thicknesses 2 m are left out, because the surface bends too sharply for them"
    )
    assert {trial.thickness for trial in result.trials} == {0.1}
    with pytest.raises(SolidError, match=r"bends so sharply at .* only 52% of the thickness would remain"):
        dsfab.sized_design(rippled([2.0]))


def test_thicknesses_without_a_stock_grow_by_about_a_seventh():
    bare = vault().model_copy(update={"statics": vault().statics.model_copy(update={"material": None})})
    steps = np.array(stock_thicknesses(bare, 0.1)[0])
    assert 0.1 in steps
    assert (steps[-1] / steps[0]) ** (1 / (len(steps) - 1)) == pytest.approx(1.15, abs=0.01)


def test_a_material_without_a_strength_is_refused():
    preset = vault(statics={"thickness": "auto", "young": 1e10})
    with pytest.raises(PresetError, match=re.escape("the preset gives neither a material nor a strength")):
        dsfab.sized_design(preset)


@pytest.mark.slow
@needs_ccx
def test_the_figures_of_a_sized_structure_are_those_of_calculix(counted, tmp_path):
    """Movement by six-node shells in the model that dsfab exports, buckling by a solid of quadratic wedges."""
    design, _ = counted
    chosen, sheet, statics = sizing_result(design).trials[-1], design.sheet.surface, design.preset.statics
    (theirs,) = ccx(cut_model(design).model, tmp_path)
    moved = np.linalg.norm(theirs.u[: sheet.n], axis=1).max()
    assert chosen.movement * carrying(design).movement.span == pytest.approx(moved, rel=0.1)
    normal = np.zeros_like(sheet.V)
    for corner in sheet.F.T:
        np.add.at(normal, corner, sheet.normals * sheet.areas[:, None])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    (load,) = design.cut_loads.values()
    solid = solid_model(sheet, normal, statics.thickness, statics.elastic, load)
    assert chosen.buckling == pytest.approx(lowest_buckling(solid, 120.0)[0], rel=0.1)


TOWER = {
    "surface.edge": 0.6,
    "surface.width": 4.0,
    "surface.height": 8.0,
    "surface.twist": 45.0,
    "surface.load.0.force": (0, 0, -2e5),
    "pattern.fillet": 0.0,
    "pattern.weight_rounds": 0,
    "pattern.keep": 0.4,
    "pattern.width.member": 0.5,
    "pattern.major.spacing": 2.0,
    "pattern.minor.spacing": 2.0,
    "slicing.min_member": None,
    "statics": {"thickness": "auto", "material": "CLT"},
    "sizing.first": 0.1,
}
"""A coarse tower in the wind, of CLT whose thickness is open."""


@pytest.mark.slow
@needs_ccx
def test_a_sized_tower_moves_and_buckles_as_a_solid_by_calculix_and_a_thinner_one_misses_a_target():
    design = dsfab.sized_design(load_preset("tower", TOWER))
    *rows, chosen = sizing_result(design).trials
    assert max((row for row in rows if row.thickness < chosen.thickness), key=lambda row: row.thickness).worst > 1
    sheet, statics = design.sheet, design.preset.statics
    normal = sheet.weights @ design.surface.vertex_normals
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    (load,) = design.cut_loads.values()
    solid = solid_model(sheet.surface, normal, statics.thickness, statics.elastic, load)
    small = 0.01  # of the load: the path is still straight
    path = load_path(solid, solid.solid.nodes, (small,), solid.solid.columns[:, 2], 120.0, steps=1)
    moved = np.linalg.norm(path.u[-1], axis=1).max() / small
    assert carrying(design).movement.value == pytest.approx(moved, rel=0.1)
    assert chosen.buckling == pytest.approx(lowest_buckling(solid, 120.0)[0], rel=0.1)
