"""`Design`: its stages are made when they are asked for, shared by revisions, and written the same by every way out."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dsfab
from dsfab.app.cli import main
from dsfab.core.errors import PatternError, PresetError
from dsfab.design import Design, draft
from dsfab.design.output.archive import read_archive, write_archive
from dsfab.export import last_line
from dsfab.preset.file import load_preset, with_overrides
from dsfab.report.design import save
from dsfab.report.design.save import merged_notes
from tests.presets import DOME_MODES

SMALL = {"surface.edge": 1.2, "pattern.keep": 0.6, "export.formats": ["stl", "3mf"]}


@pytest.fixture(scope="module")
def whole() -> Design:
    return dsfab.run(load_preset(DOME_MODES, SMALL))


STAGES = ("surface", "statics", "diffusion", "pattern", "slicing", "thickening")


def made(design: Design) -> list[str]:
    return [stage for stage in STAGES if design.has(stage)]


def test_stages_run_only_on_demand() -> None:
    design = Design.from_preset(load_preset(DOME_MODES, SMALL))
    assert made(design) == []
    surface = design.surface
    assert made(design) == ["surface"]
    assert design.surface is surface
    assert design.statics.equilibrium.compliance > 0
    assert made(design) == ["surface", "statics"]
    assert set(design.seconds) >= {"surface", "statics"}
    assert "diffusion" not in design.seconds


def test_a_draft_is_a_design_whose_cut_is_still_to_be_made(whole: Design) -> None:
    drafted = draft(whole.preset)
    assert made(drafted) == ["surface", "statics", "diffusion", "pattern"]
    assert drafted.sheet.surface.area == whole.sheet.surface.area
    assert (drafted.solid.V == whole.solid.V).all()


@pytest.mark.parametrize(
    ("changes", "shared"),
    [
        ({"export.step_faces": 9}, 6),
        ({"thickening.side": "out"}, 5),
        ({"slicing.snap": 0.1}, 4),
        ({"pattern.major.phase": 0.3}, 3),
        ({"diffusion.r": 7.0}, 2),
        ({"statics.thickness": 0.07}, 1),
        ({"surface.edge": 1.3}, 0),
    ],
)
def test_a_revision_shares_the_stages_before_the_first_change(whole: Design, changes: dict, shared: int) -> None:
    names = ("surface", "statics", "diffusion", "pattern", "slicing", "solid")
    new = Design.from_preset(with_overrides(whole.preset, changes), whole)
    assert made(new) == list(STAGES[:shared])
    assert all(getattr(new, name) is getattr(whole, name) for name in names[:shared])
    assert set(new.seconds) <= set(whole.seconds)
    assert len(new.seconds) == len(whole.seconds) or shared < 6


def test_a_cached_result_is_dropped_with_its_stage(whole: Design) -> None:
    calls: list[str] = []
    for _ in range(2):
        assert whole.cached_result("slicing", "answer", lambda: calls.append("made") or 42) == 42
    assert calls == ["made"]
    later, earlier = ({"export.step_faces": 9}, {"pattern.major.phase": 0.3})
    assert (
        Design.from_preset(with_overrides(whole.preset, later), whole).cached_result("slicing", "answer", lambda: 1)
        == 42
    )
    assert (
        Design.from_preset(with_overrides(whole.preset, earlier), whole).cached_result("slicing", "answer", lambda: 1)
        == 1
    )


def test_a_refused_stage_keeps_the_results_of_earlier_stages() -> None:
    empty = {
        "pattern.width": {"rule": "plain"},
        "pattern.keep": 0.0,
        "pattern.major.threshold": 1.0,
        "pattern.minor.threshold": 1.0,
    }
    design = Design.from_preset(load_preset(DOME_MODES, SMALL | empty))
    for _ in range(2):
        with pytest.raises(PatternError, match="leaves no material"):
            design.until("thickening")
    assert made(design) == ["surface", "statics", "diffusion", "pattern"]


def test_a_pickled_design_loses_its_progress_callback(whole: Design) -> None:
    told: list[str] = []
    design = Design.from_preset(whole.preset, None, lambda stage, doing: told.append(stage)).until("pattern")
    assert told
    there = pickle.loads(pickle.dumps(design))
    assert made(there) == made(design)
    count = len(told)
    assert there.sheet.surface.area == whole.sheet.surface.area
    assert len(told) == count


def test_a_folder_reads_back_as_a_design(whole: Design, tmp_path: Path) -> None:
    write_archive(whole, tmp_path)
    back = read_archive(tmp_path, whole.resolved_preset)
    assert isinstance(back, Design)
    assert back.mass == pytest.approx(whole.mass)
    assert (back.sheet.surface.V == whole.sheet.surface.V).all()
    assert not back.has("statics")
    assert back.statics.equilibrium.compliance == pytest.approx(whole.statics.equilibrium.compliance)  # made again


@pytest.mark.parametrize(
    ("preset", "changes"),
    [(DOME_MODES, {**SMALL, "pattern.tidy": True, "pattern.fillet": 0.02}), ("barrel_vault", {"surface.edge": 0.9})],
    ids=["stripes on modes", "even stripes"],
)
def test_a_design_from_a_folder_is_cut_as_before_and_loose_ends_are_removed(
    preset: str | Path, changes: dict[str, Any], tmp_path: Path
) -> None:
    design = Design.from_preset(load_preset(preset, changes)).until("thickening")
    write_archive(design, tmp_path)
    back = read_archive(tmp_path, design.resolved_preset)
    assert back is not None
    there, here = back.slicing.cells, design.slicing.cells
    assert np.array_equal(there.surface.V, here.surface.V)
    assert np.array_equal(there.surface.F, here.surface.F)
    assert np.array_equal(there.family, here.family)


def test_every_way_out_gives_the_same_bytes(whole: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    preset = tmp_path / "dome.toml"
    whole.save(tmp_path / "saved", picture=False)
    preset.write_bytes((tmp_path / "saved" / "preset.toml").read_bytes())
    assert main(["build", str(preset), "-o", str(tmp_path / "built"), "--no-picture", "--quiet"]) == 0
    name = whole.preset.name
    for suffix in ("stl", "3mf"):
        there = (tmp_path / "built" / f"{name}.{suffix}").read_bytes()
        assert (tmp_path / "saved" / f"{name}.{suffix}").read_bytes() == there
        assert whole.write(tmp_path / f"{name}.{suffix}").read_bytes() == there
        assert dsfab.write(whole, tmp_path / f"again.{suffix}").read_bytes() == there
    both = [{p.name for p in (tmp_path / folder).iterdir()} for folder in ("built", "saved")]
    assert both[0] == both[1]


@pytest.mark.slow
def test_python_and_the_command_line_write_the_same_smooth_step_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], unjudged: None
) -> None:
    few = {"pattern.major.spacing": 2.6, "pattern.minor.spacing": 2.6, "export.formats": ["stl"]}
    whole = dsfab.run(load_preset("barrel_vault", few))
    whole.save(tmp_path / "saved", picture=False)
    assert main(["export", str(tmp_path / "saved"), "--to", "step", "-o", str(tmp_path / "cli.step"), "--quiet"]) == 0
    ours = whole.write(tmp_path / "python.step").read_bytes()
    assert ours == (tmp_path / "cli.step").read_bytes()
    assert b"UNIFORM_SURFACE" in ours or b"B_SPLINE_SURFACE" in ours


def test_the_verdict_and_quick_files_come_before_a_step_file(
    whole: Design, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge, one, told = tmp_path / "judge.py", save.write, list[str]()
    judge.write_text("print('valid')")

    def judged(thing: Any, path: Path, **how: Any) -> Path:
        if path.suffix == ".step":
            path.write_text(last_line(str(judge), seconds=60.0))
            return path
        return one(thing, path, **how)

    monkeypatch.setattr(save, "write", judged)
    design = dsfab.revise(whole, with_overrides(whole.preset, {"export.formats": ["stl", "step", "3mf"]}))
    saved = save.save(design, tmp_path / "out", lambda stage, text: told.append(text) or False, picture=False)
    name = whole.preset.name
    assert told[-5:] == [
        "judging the cut structure",
        *(f"writing and reading back {name}.{suffix}" for suffix in ("stl", "3mf")),
        "measuring members, gaps and walls",
        f"writing and reading back {name}.step",
    ]
    assert saved.facts["files"] == [f"{name}.{suffix}" for suffix in ("stl", "3mf", "step")]
    assert {*saved.facts["files"], "sheet.ply", "design.npz"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_the_repr_of_a_design_has_five_lines(whole: Design) -> None:
    lines = repr(whole).splitlines()
    assert len(lines) == 5
    assert lines[0].startswith(f"Design {whole.preset.name}")
    assert f"{whole.solid.volume:.4g} m3" in lines[4]
    assert "when you first read them" in repr(Design.from_preset(whole.preset))
    assert max(map(len, lines)) < 160


def test_an_unknown_stage_and_a_wrong_key_are_refused(whole: Design) -> None:
    with pytest.raises(PresetError):
        with_overrides(whole.preset, {"pattern.nothing": 1})
    with pytest.raises(ValueError, match="not in"):
        whole.until("cooking")


def test_equal_notes_of_several_files_are_merged() -> None:
    notes = {"saf.xlsx": ["beams are soft"], "stl": [], "tcl": ["beams are soft", "more"], "step": ["by members"]}
    assert merged_notes(notes) == ["saf.xlsx, tcl: beams are soft", "more", "by members"]
