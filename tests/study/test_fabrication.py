"""The fabrication report of whole designs: limits and verdicts, pieces and what they touch, `--fix`, `inspect`."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dsfab
from dsfab.app.cli import main
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.design import Design, slicing_and_thickening
from dsfab.design.slicing_and_thickening import least_widths, usual_gap
from dsfab.design.stripe_pattern import member_widths
from dsfab.preset.file import load_preset, preset_from, preset_toml, with_overrides
from dsfab.report.design.inspection import fabrication_facts, fabrication_lines
from dsfab.slicing import cut, with_least_widths
from dsfab.slicing.finishing.mesh_quality import quality
from dsfab.slicing.finishing.openings import filled_openings
from dsfab.slicing.measures.widths import features, kept_cells
from dsfab.study.fabrication import fabrication, fixed_design, raised_value, refusals, require_fit
from tests.designs import paper_design
from tests.meshes import mesh_file
from tests.presets import GLOBE_MODES
from tests.shapes import grid, jittered

SMALL = {"surface.edge": 0.05, "statics.thickness": 0.01}


@pytest.fixture(scope="module")
def cantilever():
    return dsfab.run(dsfab.load_preset("cantilever", SMALL))


def with_limits(design, **limits):
    return dsfab.revise(design, with_overrides(design.preset, {f"fabrication.{key}": x for key, x in limits.items()}))


def verdicts(design) -> dict[str, str]:
    return {check.name: check.verdict for check in fabrication(design).checks}


def test_limits_change_nothing_but_the_report(cantilever):
    limited = with_limits(cantilever, min_member=0.01)
    assert limited.solid is cantilever.solid
    assert fabrication(cantilever).checks == ()
    assert verdicts(limited).keys() == {"min_member"}


def test_workshop_limits_are_checked_if_the_pattern_keeps_them(cantilever):
    """A quarter and half of 10 mm; 3 mm is more than the first."""
    cantilever = dsfab.revise(cantilever, with_overrides(cantilever.preset, {"pattern.workshop": True}))
    usual = {check.name: (check.limit[0], check.verdict, check.asked) for check in fabrication(cantilever).checks}
    assert usual == {"min_member": (0.005, "pass", False), "min_gap": (0.003, "pass", False)}
    none = dsfab.revise(
        cantilever, with_overrides(cantilever.preset, {"slicing.min_gap": 0.0, "slicing.min_member": 0.0})
    )
    assert fabrication(none).checks == ()
    for changes, least in (
        ({"statics.thickness": 0.02}, (0.005, 0.01)),
        ({"statics.thickness": 0.1}, (0.025, 0.95 * 0.012)),  # the preset asks for members of 12 mm
        ({"slicing.min_gap": 0.004, "slicing.min_member": 0.004}, (0.004, 0.004)),
        ({"slicing.min_member": 0.5}, (0.003, 0.005)),  # kept between round corners alone
    ):
        assert least_widths(with_overrides(cantilever.preset, changes), cantilever.surface) == pytest.approx(least)
    assert usual_gap(0.0008, 0.1) == pytest.approx(0.0002)
    assert usual_gap(0.0001, 0.5) == pytest.approx(0.001)


def test_each_limit_passes_below_and_fails_above_the_measured_value(cantilever):
    made = fabrication(cantilever)
    sizes = {"min_member": made.features.member.size, "min_gap": made.features.gap.size}
    sizes["min_wall"] = made.wall.thickness
    assert made.wall.thickness == pytest.approx(0.01, rel=1e-9)
    assert set(verdicts(with_limits(cantilever, **{k: 1.001 * x for k, x in sizes.items()})).values()) == {"fail"}
    assert made.features.member.size < made.features.member.mesh  # what is finer than the mesh is built as it is, too
    assert set(verdicts(with_limits(cantilever, **{k: 0.999 * x for k, x in sizes.items()})).values()) == {"pass"}


@pytest.mark.slow
def test_slits_are_closed_without_needles_on_the_same_material():
    """On a mesh as coarse as that strips of 3 mm end within a micrometre of other edges."""
    coarse = {"surface.edge": 0.1, "pattern.workshop": True}
    design = Design.from_preset(dsfab.load_preset("cantilever", coarse)).until("slicing")
    (told,) = [note.text for note in design.notes if "(slicing.min_gap, min_member)" in note.text]
    assert "openings narrower than 3 mm were closed at " in told
    sheet = design.sheet.surface
    assert sheet.areas.min() > 1e-8  # 4e-10 as strips leave them
    raw = with_overrides(design.preset, {"slicing.min_gap": 0.0, "slicing.min_member": 0.0})
    cells = Design.from_preset(raw, design).until("slicing").slicing.cells
    least = least_widths(design.preset, design.surface)
    assert sheet.area == pytest.approx(with_least_widths(cells, *least).cells.subset().surface.area, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("tidy", [True, False])
def test_the_share_of_material_includes_closed_openings(tidy):
    """Openings under 40 mm are closed: of tidied stripes that is 3.5 % of the plate."""
    thick = {"surface.edge": 0.1, "statics.thickness": 0.16, "pattern.tidy": tidy, "pattern.workshop": True}
    design = Design.from_preset(dsfab.load_preset("cantilever", thick)).until("slicing")
    assert any("openings narrower than 40 mm were closed at " in note.text for note in design.notes)
    assert design.sheet.surface.area / design.surface.area == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize(
    ("changes", "kept"),
    [
        ({"pattern.method": "stripes"}, True),
        ({"pattern.method": "stripes", "pattern.workshop": False}, False),
        ({"pattern.method": "stripes", "pattern.width.rule": "stressed"}, False),
        ({"pattern.method": "modes"}, False),
        ({"pattern.method": "modes", "pattern.workshop": True}, True),
    ],
)
def test_evenly_spaced_stripes_keep_workshop_limits_by_default(cantilever, changes, kept):
    preset = with_overrides(cantilever.preset, changes)
    assert preset.pattern.for_workshop == kept
    assert any(least_widths(preset, cantilever.surface)) == kept


def test_stressed_members_are_drawn_as_wide_as_a_workshop_makes():
    """Half of the thickness and a little, or half of what equally wide ones would be, if nobody says otherwise. Else
    slicing laid strips beside them at 2603 places of a wall, which took ten times as long."""
    plate, width = grid(24, 24, 1.2, 1.2), {"rule": "stressed", "solid_fraction": 0.5}
    stressed = {"pattern.method": "stripes", "pattern.width": width, "pattern.workshop": True}
    given = load_preset("cantilever", stressed)
    for changes, least in (
        ({}, 0.005 / 0.95),
        ({"statics.thickness": 0.2}, 0.25 * 0.1 / 2),  # half of the material in two families, 10 cm apart
        ({"pattern.workshop": False}, 0.0),
        ({"pattern.width.min_width": 0.0}, 0.0),
        ({"pattern.width.min_width": 0.02}, 0.02),
    ):
        preset = with_overrides(given, changes)
        assert member_widths(preset, plate).min_width == pytest.approx(least)
    unlimited = with_overrides(given, {"pattern.width.min_width": 0.0})
    assert least_widths(unlimited, plate).member == 0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "words"), [("climbing_hold", "were closed"), ("bob", "were widened")])
def test_figures_of_the_paper_meet_workshop_limits_on_request(name, words):
    """Slits of .16 mm and tips in a sheet of 2 mm; members of 5.5 mm in one of 12."""
    plain = paper_design(name)
    assert fabrication(plain).checks == ()
    design = dsfab.revise(plain, with_overrides(plain.preset, {"pattern.workshop": True}))
    made = fabrication(design)
    assert [(check.name, check.verdict) for check in made.checks] == [("min_member", "pass"), ("min_gap", "pass")]
    (told,) = [note.text for note in design.notes if "(slicing.min_gap, min_member)" in note.text]
    assert words in told
    assert design.solid.repairs.pairs == 0


def test_a_solid_may_lie_on_any_side_of_the_bed(cantilever):
    assert verdicts(with_limits(cantilever, bed=[0.02, 2.0, 1.0])) == {"bed": "pass"}
    assert verdicts(with_limits(cantilever, bed=[0.02, 1.9, 1.1])) == {"bed": "fail"}


def test_a_film_or_a_gap_that_no_machine_makes_is_refused(cantilever):
    require_fit(cantilever)
    film = replace(cantilever.solid.repairs, thinnest=0.01, thinnest_at=(0.0, 0.0, 0.0))
    known = {name: getattr(cantilever, name) for name in ("surface", "statics", "diffusion", "pattern", "slicing")}
    filmy = Design.from_results(cantilever.preset, None, **known, solid=replace(cantilever.solid, repairs=film))
    assert refusals(filmy) == ("the thickened sheet has become a film of only 0.1 mm at (0, 0, 0) m",)
    with pytest.raises(PatternError, match=r"a film of only.*--accept"):
        require_fit(filmy)
    made = fabrication(with_limits(cantilever, min_gap=1.0))
    assert refusals(cantilever, made) == ()  # a limit that is missed is told
    kept = Design.from_results(
        with_overrides(cantilever.preset, {"pattern.workshop": True}), None, **known, solid=cantilever.solid
    )
    coarse, fine = (replace(made.failed_checks[0], value=(x,), place=(0.1, 0.2, 0.0)) for x in (0.0011, 0.0009))
    assert refusals(kept, replace(made, checks=(coarse,))) == ()
    assert refusals(kept, replace(made, checks=(fine,))) == (
        "a gap of 0.9 mm at (0.1, 0.2, 0) m is too small for fabrication",
    )


def test_a_load_that_nothing_carries_is_not_built(capsys, tmp_path):
    """Thin stripes that pass the disc around the load: a note and exit code 0, before."""
    thin = {"threshold": 0.8, "frequency": 4.0}
    pattern = {"keep": 0.05, "major": thin, "minor": thin}
    lost = dsfab.load_preset("cantilever", {"surface.edge": 0.08, "pattern": pattern})
    (tmp_path / "lost.toml").write_text(preset_toml(lost))
    build = ["build", str(tmp_path / "lost.toml"), "-f", "stl", "--no-picture", "-o", str(tmp_path / "out")]
    assert main(build) == 1
    assert "acts on a piece of material that is not connected to a support" in capsys.readouterr().err
    assert not (tmp_path / "out" / "design.json").exists()
    assert main([*build, "--accept"]) == 0
    assert load_preset(tmp_path / "out" / "preset.toml").fabrication.accept


def test_each_piece_lists_its_supports_and_loads(cantilever):
    made = fabrication(cantilever)
    assert [(piece.supports, piece.loads) for piece in made.pieces] == [((1,), (1,))]
    assert made.pieces[0].area == pytest.approx(cantilever.sheet.surface.area)
    kept = dsfab.revise(cantilever, with_overrides(cantilever.preset, {"slicing.loose": "keep"}))
    found = fabrication(kept)
    assert len(found.pieces) == len(kept.slicing.pieces) > 1
    assert [bool(p.supports) for p in found.pieces] == [p.held for p in kept.slicing.pieces]
    assert [bool(p.loads) for p in found.pieces] == [p.loaded for p in kept.slicing.pieces]
    lines = list(fabrication_lines(fabrication_facts(found)))
    assert sum("no support and no load" in line for line in lines) == sum(
        not (p.supports or p.loads) for p in found.pieces
    )
    with pytest.raises(PatternError, match=r"pieces reach no support, the largest \(.* m2\) near"):
        dsfab.revise(cantilever, with_overrides(cantilever.preset, {"slicing.loose": "refuse"}))


def test_supports_and_loads_are_assigned_to_their_pieces(tmp_path):
    one = grid(10, 10, 1.0, 1.0)
    V, F = np.r_[one.V, one.V + [0, 3, 0]], np.r_[one.F, one.F + one.n]
    (tmp_path / "two.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in V) + "".join(f"f {a} {b} {c}\n" for a, b, c in F + 1)
    )

    def edge(x, y):
        return {"pick": "box", "min": [x - 0.01, y, -1], "max": [x + 0.11, y + 1, 1]}

    supports = [{"at": edge(0, 3)}, {"at": edge(0, 0)}, {"at": edge(1, 0)}]
    loads = [{"kind": "self_weight"}, {"kind": "force", "at": edge(1, 3), "force": [0, 0, -1]}]
    values = {"name": "two", "surface": {"file": str(tmp_path / "two.obj"), "unit": "m", "support": supports}}
    values["surface"]["load"] = loads
    values |= {"statics": {"thickness": 0.02}, "pattern": {"major": {"threshold": -1.0}}}
    values["surface"]["support"][1]["name"] = "gate"
    made = fabrication(dsfab.run(preset_from(values)))
    assert {(piece.supports, piece.loads) for piece in made.pieces} == {((1,), (2,)), ((2, 3), ())}
    told = "\n".join(fabrication_lines(fabrication_facts(made)))
    assert "touches support 1, force\n" in f"{told}\n"
    assert "touches gate, support 3\n" in f"{told}\n"


def test_the_option_refuse_accepts_a_design_in_one_piece(cantilever):
    whole = {"pattern.major.threshold": -1.0, "pattern.width": {}}
    same = dsfab.revise(cantilever, with_overrides(cantilever.preset, {**whole, "slicing.loose": "refuse"}))
    assert len(same.slicing.pieces) == 1


def test_small_openings_are_filled_and_larger_ones_are_not():
    surface = jittered(grid(40, 20, 2.0, 1.0))
    fields = [surface.V[:, 0], surface.V[:, 1]]
    levels = [[0.2, 0.5, 0.53, 0.7, 1.0, 1.5], [0.2, 0.4, 0.6, 0.8]]  # openings 0.03 x 0.2 and 0.3 x 0.2 between
    sheet = cut(surface, fields, levels, 0)
    filled, count = filled_openings(sheet, 0.04)
    assert count == 1  # those beside it reach the border of the plate
    assert filled.surface.areas[filled.material].sum() - sheet.surface.areas[sheet.material].sum() == pytest.approx(
        0.03 * 0.2, rel=1e-9
    )
    assert filled_openings(sheet, 0.02)[1] == 0


def test_openings_that_are_alike_are_filled_all_or_none():
    """Of 29, 29.5, 30, 30.5 and 60 mm: 30.1 mm parts the first three from the fourth, which is like them."""
    surface = jittered(grid(40, 20, 2.0, 1.0))
    wide = np.array([0.0, 0.029, 0.0295, 0.03, 0.0305, 0.06])
    begin = 0.1 + np.cumsum(wide + 0.2) - 0.2
    sheet = cut(surface, list(surface.V[:, :2].T), [np.ravel([begin, begin + 0.2], "F"), [0.2, 0.4, 0.6, 0.8]], 0)
    assert filled_openings(sheet, 0.0301)[1] == 3
    assert filled_openings(sheet, 0.0301, alike=True)[1] == 4
    assert filled_openings(sheet, 0.028, alike=True)[1] == 0


def test_the_narrowest_opening_between_tidied_stripes_is_as_wide_as_the_sheet_is_thick():
    surface = dsfab.load_preset("dome").surface.build()
    for changes, wanted in (
        ({}, 0.06),
        ({"statics.thickness": 0.6}, 0.15 * 1.4),  # or thick sheets would close altogether
        ({"pattern.tidy": False}, 0.15 * 1.4),
        ({"slicing.min_opening": 0.01}, 0.01),
        ({"pattern.method": "modes"}, 0.0),
    ):
        preset = dsfab.load_preset("dome", {"pattern.major.spacing": 1.4, "pattern.minor.spacing": 1.4, **changes})
        assert slicing_and_thickening.smallest_widths(preset, surface)[0] == pytest.approx(wanted), changes


@pytest.mark.slow
def test_a_roof_with_graded_members_has_no_slit():
    """Recorded: 33 mm is the narrowest place of an opening, where the sheet is 37 mm thick; 13 mm without the cure."""
    roof = {
        "pattern.width": {"rule": "graded", "solid_fraction": 0.4, "min_width": 0.0},
        "pattern.keep": 0.0,
        "surface.refine": 0.06,
    }
    preset = dsfab.load_preset("roof", {**roof, "statics.thickness": 0.0366}, mesh_file("roof_with_opening.obj"))
    design = Design.from_preset(preset)
    bare = Design.from_preset(with_overrides(preset, {"slicing.min_opening": 0.0}), design.until("pattern"))
    gaps = []
    for each in (design, bare):
        cells = each.slicing.cells
        gaps.append(features(cells, kept_cells(cells, each.sheet), each.pattern.names).gap.size)
    assert gaps[0] > 0.03
    assert gaps[1] < 0.02


def test_features_narrower_than_the_thickness_are_reported_with_their_place(cantilever):
    thick = dsfab.revise(cantilever, with_overrides(cantilever.preset, {"statics.thickness": 0.05}))
    facts = fabrication_facts(fabrication(thick))
    (line,) = [x for x in fabrication_lines(facts) if "narrower than the sheet's thickness (50 mm)" in x]
    for key in ("smallest_gap", "smallest_member"):
        assert facts[key]["m"] < 0.05
        at = ", ".join(f"{x + 0.0:.3g}" for x in facts[key]["at_m"])
        assert f"{facts[key]['what']} of {length(facts[key]['m'])} at ({at}) m" in line
    assert "set fabrication.min_gap and fabrication.min_member and build with --fix" in line
    told = fabrication_facts(fabrication(with_limits(thick, min_gap=0.001)))  # who asks for a limit has one
    (line,) = [line for line in fabrication_lines(told) if line.startswith("features narrower")]
    assert "min_gap" not in line
    wide = fabrication_facts(
        fabrication(dsfab.revise(cantilever, with_overrides(cantilever.preset, {"statics.thickness": 0.0001})))
    )
    assert not [line for line in fabrication_lines(wide) if line.startswith("features narrower")]


def test_specks_between_evenly_spaced_stripes_are_filled_by_default(monkeypatch):
    even = {
        "pattern.method": "stripes",
        "surface.edge": 0.12,
        "pattern.major.spacing": 0.3,
        "pattern.minor.spacing": 0.3,
        "pattern.tidy": False,  # or what is narrower than the members is filled
    }
    design = dsfab.run(dsfab.load_preset(GLOBE_MODES, even))
    assert not any("dsfab filled" in note.text for note in design.notes)
    small = design.sheet.surface.area
    monkeypatch.setattr(slicing_and_thickening, "SPECK", 0.7)
    filled = dsfab.revise(design, with_overrides(design.preset, {"slicing.min_opening": None, "slicing.snap": 0.06}))
    assert any("smaller than 210 mm, or far smaller than most openings" in note.text for note in filled.notes)
    assert filled.sheet.surface.area > 1.005 * small
    none = dsfab.revise(design, with_overrides(design.preset, {"slicing.min_opening": 0.0, "slicing.snap": 0.06}))
    assert not any("dsfab filled" in note.text for note in none.notes)
    modes = dsfab.revise(design, with_overrides(design.preset, {"pattern.method": "modes"}))
    assert not any("dsfab filled" in note.text for note in modes.notes)


@pytest.mark.slow
def test_fix_meets_the_limits_and_lists_its_changes(cantilever):
    before = with_limits(cantilever, min_member=0.03, min_gap=0.02)
    assert fabrication(before).failed_checks
    done = fixed_design(before)
    assert not done.made.failed_checks
    assert done.made.features.member.size >= 0.03
    assert done.made.features.gap is None or done.made.features.gap.size >= 0.02
    assert done.changes
    again = dsfab.run(with_overrides(before.preset, {key: new for key, (_, new) in done.changes.items()}))
    assert np.array_equal(again.solid.V, done.design.solid.V)
    assert all(old != new for old, new in done.changes.values())
    assert fixed_design(done.design).changes == {}


@pytest.mark.parametrize(
    ("limits", "words"),
    [({"min_wall": 0.02}, "raise statics.thickness"), ({"bed": [0.5, 0.5, 0.5]}, "split the solid")],
)
def test_fix_names_limits_that_no_pattern_can_meet(cantilever, limits, words):
    with pytest.raises(PatternError, match=words):
        fixed_design(with_limits(cantilever, **limits))


@pytest.mark.parametrize(
    ("asked", "measured", "least", "most"), [(0.05, 0.05, 0.1, 0.105), (0.11, 0.0999, 0.111, 0.1155)]
)
def test_fix_asks_for_a_little_more_than_a_limit_of_width(asked, measured, least, most):
    """Also where as much is asked already, of which the cut leaves too little."""
    assert least < raised_value(asked, SimpleNamespace(limit=(0.1,), value=(measured,))) < most


@pytest.mark.slow
def test_fix_ends_with_a_sentence():
    coarse = dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.1, "fabrication.min_gap": 3.0}))
    try:
        done = fixed_design(coarse)
    except PatternError as error:
        assert "does not meet the limits" in str(error) or "cannot keep" in str(error)  # noqa: PT017
    else:
        assert done.made.features.gap is None


def test_the_shape_of_triangles_in_closed_form():
    right = grid(4, 4, 1.0, 1.0)
    found = quality(right)
    assert found.worst_angle == pytest.approx(45, rel=1e-9)
    assert found.median == pytest.approx(np.sqrt(3) / 2, rel=1e-12)  # 4 sqrt(3) (1/2) / (1 + 1 + 2)
    assert found.needles == 0
    flat = quality(grid(4, 4, 1.0, 0.01))
    assert flat.worst_angle == pytest.approx(np.degrees(np.arctan(0.01)), rel=1e-9)
    assert flat.needles == 1


def test_inspect_reads_the_fabrication_report_of_a_build(capsys, tmp_path):
    folder = tmp_path / "out"
    words = ["build", "cantilever", "--set", "surface.edge=0.08", "-f", "stl", "--no-picture", "-o", str(folder), "-v"]
    assert main([*words, "--set", "fabrication.min_member=0.5", "--set", "fabrication.bed=[3,3,3]"]) == 0
    said = capsys.readouterr().out
    facts = json.loads((folder / "design.json").read_text())["fabrication"]
    assert {check["limit"]: check["verdict"] for check in facts["checks"]} == {"min_member": "fail", "bed": "pass"}
    assert facts["smallest_member"]["m"] == pytest.approx(facts["checks"][0]["measured_m"][0])
    assert len(facts["smallest_member"]["at_m"]) == 3
    assert sum(facts["member_widths"]["histogram_shares"]) == pytest.approx(1)
    assert facts["triangles"]["worst_angle_deg"] > 0
    assert main(["inspect", str(folder)]) == 0
    again = capsys.readouterr().out
    assert "min_member" in again
    assert set(again.splitlines()) <= set(said.splitlines())
    (tmp_path / "no").mkdir()
    assert main(["inspect", str(tmp_path / "no")]) == 1
    assert "build the design again" in capsys.readouterr().err


@pytest.mark.slow
def test_build_fix_tells_its_changes(capsys, tmp_path):
    words = ["build", "cantilever", "--fix", "--set", "surface.edge=0.08", "-f", "stl", "--no-picture"]
    assert main([*words, "-o", str(tmp_path / "out"), "--set", "fabrication.min_member=0.03"]) == 0
    captured = capsys.readouterr()
    assert "fix         pattern." in captured.err
    assert "fail" not in captured.out
    assert main(["inspect", str(tmp_path / "out" / "preset.toml")]) == 0
    assert "min_member" in capsys.readouterr().out
