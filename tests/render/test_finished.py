"""The picture of a finished design, drawn by another process: the same picture, whatever becomes of that process."""

from pathlib import Path

import pytest

from dsfab.core.errors import DsfabError
from dsfab.design import run
from dsfab.preset.file import load_preset, with_overrides
from dsfab.render import design_picture, opengl
from dsfab.render.picture import Look

SMALL = Look((160, 120))


@pytest.fixture(scope="module")
def vault():
    return run(with_overrides(load_preset("barrel_vault"), {"surface.edge": 0.9}))


@pytest.fixture(scope="module")
def expected(vault, tmp_path_factory):
    path = tmp_path_factory.mktemp("here") / "preview.png"
    design_picture.write_picture(vault, path, SMALL)
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
    monkeypatch.setattr(design_picture, "write_picture", None)  # nobody draws here
    started, one, path = list[str](), design_picture.PreparedProgram, tmp_path / "preview.png"
    monkeypatch.setattr(design_picture, "PreparedProgram", lambda program: started.append(program) or one(program))
    with design_picture.start_picture_program():
        assert len(started) == 1  # before there is anything to draw
        for count in (1, 2):
            with design_picture.picture_in_background(vault, path, SMALL) as finish:
                finish()
            assert path.read_bytes() == expected
            assert len(started) == count
            assert list(tmp_path.iterdir()) == [path]
            path.unlink()
    with design_picture.picture_in_background(vault, path, SMALL):
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
    with design_picture.picture_in_background(vault, tmp_path / "preview.png", SMALL) as finish:
        finish()
    assert (tmp_path / "preview.png").read_bytes() == expected


def test_with_one_core_the_picture_is_drawn_last_in_this_process(vault, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(design_picture.os, "cpu_count", lambda: 1)
    monkeypatch.setattr(design_picture, "PreparedProgram", None)
    with design_picture.picture_in_background(vault, tmp_path / "preview.png", SMALL) as finish:
        assert not list(tmp_path.iterdir())
        finish()
    assert (tmp_path / "preview.png").read_bytes() == expected


def test_a_mistake_inside_ends_the_other_process(vault, tmp_path, monkeypatch, two_cores):
    started = list[design_picture.PreparedProgram]()

    class Seen(design_picture.PreparedProgram):
        def __init__(self, program: str) -> None:
            super().__init__(program)
            started.append(self)

    monkeypatch.setattr(design_picture, "PreparedProgram", Seen)
    with pytest.raises(KeyError), design_picture.picture_in_background(vault, tmp_path / "preview.png", SMALL):
        raise KeyError
    assert started[0]._run.returncode is not None
    assert not Path(tmp_path / "preview.png").exists()


def test_a_machine_that_cannot_draw_refuses_before_a_process_starts(vault, tmp_path, monkeypatch, two_cores):
    monkeypatch.setattr(design_picture, "PreparedProgram", None)
    monkeypatch.setattr(opengl, "_draws", lambda name: False)
    monkeypatch.setattr(opengl, "_KNOWN", set())
    with (
        pytest.raises(DsfabError, match="cannot be drawn"),
        design_picture.picture_in_background(vault, tmp_path / "a.png"),
    ):
        pass
