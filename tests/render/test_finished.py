"""Pictures of a finished design, drawn by another process: the same pictures, whatever becomes of that process."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dsfab.core.errors import DsfabError
from dsfab.design import run
from dsfab.preset.file import load_preset, with_overrides
from dsfab.render import design_picture, opengl
from dsfab.render.lettering import PAPER
from dsfab.render.picture import Look
from dsfab.study.carrying import MemberUse, carrying

SMALL = Look((160, 160))


@pytest.fixture(scope="module")
def vault():
    return run(with_overrides(load_preset("barrel_vault"), {"surface.edge": 0.9}))


@pytest.fixture(scope="module")
def expected(vault, tmp_path_factory):
    path = tmp_path_factory.mktemp("here") / "preview.png"
    design_picture.write_png(design_picture.client_picture(vault, SMALL).render(), path)
    return path.read_bytes()


@pytest.fixture
def two_cores(monkeypatch):
    """With one core, no other process draws."""
    monkeypatch.setattr(design_picture.os, "cpu_count", lambda: 2)


@pytest.mark.slow
def test_another_process_draws_the_same_picture_and_one_that_was_started_ahead_draws_once(
    vault, expected, tmp_path, monkeypatch, two_cores
):
    """It loads what draws while there is no design yet."""
    monkeypatch.setattr(design_picture, "write_png", None)  # nobody draws here
    started, one, path = list[str](), design_picture.PreparedProgram, tmp_path / "preview.png"
    monkeypatch.setattr(design_picture, "PreparedProgram", lambda program: started.append(program) or one(program))
    with design_picture.start_picture_program():
        assert len(started) == 1  # before there is anything to draw
        for count in (1, 2):
            with design_picture.pictures_in_background() as pictures:
                pictures.add(design_picture.client_picture(vault, SMALL), path)
                pictures.finish()
            assert path.read_bytes() == expected
            assert len(started) == count
            assert list(tmp_path.iterdir()) == [path]
            path.unlink()
    with design_picture.pictures_in_background():
        assert len(started) == 3


@pytest.mark.slow
@pytest.mark.parametrize("program", ["raise MemoryError", "import os; os.abort()", "import time; time.sleep(60)"])
def test_this_process_draws_the_picture_if_the_other_process_fails(
    program, vault, expected, tmp_path, monkeypatch, two_cores
):
    file = tmp_path / "program.py"
    file.write_text(program)
    monkeypatch.setattr(design_picture, "SECONDS", 0.5)
    monkeypatch.setattr(design_picture.picture_program, "__file__", str(file))
    with design_picture.pictures_in_background() as pictures:
        pictures.add(design_picture.client_picture(vault, SMALL), tmp_path / "preview.png")
        pictures.finish()
    assert (tmp_path / "preview.png").read_bytes() == expected


def test_with_one_core_pictures_are_drawn_last_in_this_process(vault, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(design_picture.os, "cpu_count", lambda: 1)
    monkeypatch.setattr(design_picture, "PreparedProgram", None)
    with design_picture.pictures_in_background() as pictures:
        pictures.add(design_picture.client_picture(vault, SMALL), tmp_path / "preview.png")
        assert not list(tmp_path.iterdir())
        pictures.finish()
    assert (tmp_path / "preview.png").read_bytes() == expected


def test_a_mistake_inside_ends_the_other_process(vault, tmp_path, monkeypatch, two_cores):
    started = list[design_picture.PreparedProgram]()

    class Seen(design_picture.PreparedProgram):
        def __init__(self, program: str) -> None:
            super().__init__(program)
            started.append(self)

    monkeypatch.setattr(design_picture, "PreparedProgram", Seen)
    with pytest.raises(AttributeError), design_picture.pictures_in_background() as pictures:
        pictures.add_verdict(vault, None, tmp_path)
    assert started[0].process.returncode is not None
    assert not Path(tmp_path / "preview.png").exists()


def test_a_machine_that_cannot_draw_refuses_before_a_process_starts(monkeypatch, two_cores, untested_windows):
    monkeypatch.setattr(design_picture, "PreparedProgram", None)
    monkeypatch.setattr(opengl, "PROBE", "raise SystemExit(1)")
    with pytest.raises(DsfabError, match="cannot be drawn"), design_picture.pictures_in_background():
        pass


def test_the_analysis_names_the_most_used_member_and_a_fault_draws_the_first_picture_again(vault, tmp_path):
    """The first picture began before the verdict."""
    judged = carrying(vault)
    pictures = design_picture.Pictures()
    pictures.add_verdict(vault, judged, tmp_path)
    pictures.add_verdict(vault, replace(judged, faults=("it buckles",), buckling=0.5), tmp_path)
    assert [path.name for _, path in pictures.pending] == ["analysis.png", "analysis.png", "preview.png"]
    analysis, failed = (data for data, path in pictures.pending if path.name == "analysis.png")
    assert analysis.callouts[0].lines[0].startswith("moves most")
    assert analysis.faces.words == "cut sheet - stress; the preset gives no strength for a comparison"
    assert (
        failed.faces.words == "does not carry, buckles at 0.5 times the load - stress; the preset gives no strength "
        "for a comparison"
    )
    assert len(analysis.faces.face) == vault.sheet.surface.m
    used = replace(judged, use=MemberUse("B7", 1.51, (0.0, 0.0, 1.0), "load", "bending"))
    note = design_picture.analysis_picture(vault, used).callouts[0]
    assert (note.lines, note.colour) == (("most used: B7, 151%", "bending"), PAPER.tension)
    assert design_picture.analysis_picture(vault, judged, SMALL).render().shape == (160, 320, 3)


def test_the_use_of_a_stronger_material_is_smaller_by_its_strength(vault):
    """Colours of a share, not of a stress; a structure that fails has no stress to show."""
    judged = carrying(vault)
    assert judged.stress is not None
    unknown = design_picture.analysis_picture(vault, replace(judged, stress=None, faults=("no part is held",)))
    assert unknown.faces.bar is None
    assert unknown.faces.words == "no part is held"
    assert judged.stress.shape == (vault.sheet.surface.m,)
    assert judged.stress.min() >= 0


def test_facts_of_a_verdict_are_json_without_the_stress_of_each_face(vault):
    facts = json.loads(json.dumps(carrying(vault).facts()))
    assert facts["outcome"] == "not judged"
    assert "stress" not in facts
