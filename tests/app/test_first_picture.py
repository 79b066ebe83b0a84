"""A first picture while a person waits: drawn apart, replaced by the true one, and gone where that is refused."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.app import first_picture, preview
from dsfab.app.cli import main
from dsfab.app.first_picture import FirstPicture
from dsfab.app.terminal import Reporter
from dsfab.core.errors import PatternError
from dsfab.design import Design, draft
from dsfab.design import design as stages
from dsfab.design.surface_and_statics import same_followed_stress
from dsfab.preset.file import load_preset
from dsfab.render import opengl
from dsfab.render.light import ROUGH
from dsfab.render.previewer import Previewer
from dsfab.render.sketch_program import sketch_caption
from tests.presets import DOME_MODES

STRIPES = {"surface.edge": 1.0, "pattern.method": "stripes", "pattern.major.spacing": 2.0, "pattern.minor.spacing": 2.0}
SHARES = {
    "modes": {"surface.edge": 0.9},
    "answers": {"surface.edge": 0.9, "statics.strength": 235e6},
    "stripes": STRIPES,
    "graded": {**STRIPES, "pattern.width.rule": "graded"},
    "no share": {**STRIPES, "pattern.width.solid_fraction": 0.0, "pattern.width.member": 0.3},
}

DRAWS = """
import sys, pickle, pathlib
print("aWindow", flush=True)
n = int.from_bytes(sys.stdin.buffer.read(8), "little")
sys.path.append(sys.argv[1])
path, = pickle.loads(sys.stdin.buffer.read(n))
pathlib.Path(path).write_bytes(b"first")
print("drawn", flush=True)
sys.stdin.buffer.read()
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "ask", [pytest.param(one, marks=[pytest.mark.slow] * (one in ("graded", "stripes"))) for one in SHARES]
)
def test_a_sketch_approximates_the_pattern_and_leaves_the_design_unchanged(ask):
    preset = load_preset(DOME_MODES, SHARES[ask])
    design = Design.from_preset(preset)
    sketch = design.sketch(modes=False)
    assert design.has("statics") == (ask != "answers")  # better elements are still to answer
    assert design.has("diffusion") == (ask == "modes")
    assert not design.has("pattern")
    calm = draft(preset)
    assert design.pattern.factor == calm.pattern.factor
    for one, other in zip(design.pattern.half_widths, calm.pattern.half_widths, strict=True):
        assert np.array_equal(one, other)
    assert sketch.pattern.factor == pytest.approx(calm.pattern.factor, rel=0.25)  # round corners weigh on large faces
    assert len(sketch.pattern.fields) == len(calm.pattern.fields)
    assert design.notes == calm.notes
    assert set(design.seconds) == set(calm.seconds)


def test_a_sketch_solves_the_statics_with_its_own_elements():
    design = Design.from_preset(load_preset(DOME_MODES, SHARES["answers"]))
    sketch = design.sketch()
    assert sketch.statics is not design.statics
    assert design.diffusion is sketch.diffusion
    assert design.sketch(answers=True).statics is design.statics
    cases = {name: replace(case, sigma=-case.sigma) for name, case in sketch.statics.cases.items()}
    assert same_followed_stress(sketch.statics, design.statics)
    assert not same_followed_stress(replace(sketch.statics, cases=cases), design.statics)


def test_widths_that_cannot_be_counted_are_no_sketch_and_refused_by_the_pattern():
    design = Design.from_preset(load_preset(DOME_MODES, {"surface.edge": 0.9, "pattern.width.solid_fraction": 0.02}))
    assert design.sketch() is None
    with pytest.raises(PatternError, match=r"cannot keep 2\.0%"):
        _ = design.pattern


@pytest.mark.slow
def test_a_rough_picture_is_as_large_and_about_as_light():
    made = draft(load_preset(DOME_MODES, {"surface.edge": 0.9, "pattern.width": {}}))
    with Previewer(made) as previewer:
        rough, fine = previewer.picture((160, 120), quality=ROUGH), previewer.picture((160, 120))
    assert rough.shape == fine.shape == (120, 160, 3)
    means = [one.reshape(15, 8, 20, 8, 3).mean(axis=(1, 3)) for one in (rough, fine)]
    assert abs(means[0] - means[1]).mean() < 4
    assert not np.array_equal(rough, fine)


@pytest.fixture
def drawn_apart(monkeypatch, untested_windows):
    """Programs that draw in no time, asked with the path alone."""
    only_the_path = SimpleNamespace(dumps=lambda request, protocol: pickle.dumps([str(request[1])]))
    monkeypatch.setattr(first_picture, "pickle", only_the_path)
    monkeypatch.setenv(opengl.WINDOW, "another")
    return lambda program: monkeypatch.setattr(first_picture, "PROGRAM", program)


def test_the_first_picture_appears_before_the_final_one(drawn_apart, tmp_path):
    drawn_apart(DRAWS)
    told, path = [], tmp_path / "a.png"
    with FirstPicture(lambda: told.append(path.read_bytes())) as first, first.restore_on_error():
        first.draw(None, path, (160, 120), {})
        first.draw(None, tmp_path / "second.png", (160, 120), {})
        window = first.finish()
        assert told == [b"first"]
        path.write_bytes(b"true")
    assert path.read_bytes() == b"true"
    assert [one.name for one in tmp_path.iterdir()] == ["a.png"]
    assert opengl.assume_window(window) == "aWindow"
    opengl.require_rendering()  # by a window that no machine has: nobody is asked
    assert os.environ[opengl.WINDOW] == "aWindow"


def draws(count):
    """A program that draws so many pictures: 0, 1, ..."""
    return f"""
import sys, pickle, pathlib
print("aWindow", flush=True)
for number in range({count}):
    n = int.from_bytes(sys.stdin.buffer.read(8), "little")
    pathlib.Path(pickle.loads(sys.stdin.buffer.read(n))[-1]).write_text(str(number))
    print("drawn", flush=True)
"""


@pytest.mark.parametrize("sketched", [True, False])
def test_the_finished_structure_is_drawn_by_the_same_process(drawn_apart, tmp_path, sketched):
    drawn_apart(draws(2 if sketched else 1))
    path = tmp_path / "a.png"
    with FirstPicture((lambda: None) if sketched else None) as first, first.restore_on_error():
        assert first.draws_sketches == sketched
        if sketched:
            first.draw(None, path, (160, 120), {})
        assert first.finish() == "aWindow"
        assert path.exists() == sketched
        assert first.draw_structure("anything", path)
        assert path.read_text() == str(int(sketched))
        first.process.wait()  # it has ended, and nothing reads what it is asked
        assert not first.draw_structure("anything", tmp_path / "b.png")
        assert first.finish() is None
    assert list(tmp_path.iterdir()) == [path]


APART = """
import sys
from dsfab.app.cli import main
from dsfab.render import opengl
tested, run = [], opengl.subprocess.run
opengl.subprocess.run = lambda command, **how: tested.append(opengl.PROBE in command) or run(command, **how)
code = main(sys.argv[1:])
print(code, "vtkmodules" in sys.modules, sum(tested))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.cpu_count() == 1, reason="one core draws last, in one process")
def test_a_preview_in_a_separate_process_gives_the_same_picture(monkeypatch, tmp_path):
    sets = [word for key, value in STRIPES.items() for word in ("--set", f"{key}={value}")]
    asked = ["preview", DOME_MODES, *sets, "--size", "160x120", "--quiet", "-o"]
    command = [sys.executable, "-c", APART, *asked, str(tmp_path / "apart.png")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "False", "0"]
    monkeypatch.setattr(preview.os, "cpu_count", lambda: 1)
    assert main([*asked, str(tmp_path / "here.png")]) == 0
    assert (tmp_path / "apart.png").read_bytes() == (tmp_path / "here.png").read_bytes()


@pytest.mark.parametrize("before", [b"older", b"", None])
def test_a_refused_preset_leaves_the_picture_file_unchanged(drawn_apart, tmp_path, before):
    drawn_apart(DRAWS)
    path = tmp_path / "a.png"
    if before is not None:
        path.write_bytes(before)

    def refused(first):
        with first.restore_on_error():
            first.draw(None, path, (160, 120), {})
            first.finish()
            assert path.read_bytes() == b"first"
            raise PatternError("no such share")

    with FirstPicture(lambda: None) as first, pytest.raises(PatternError):
        refused(first)
    assert (path.read_bytes() if path.exists() else None) == before


@pytest.mark.parametrize("program", ["exit(3)", "import os; os.abort()", "import time; time.sleep(60)"])
def test_a_process_that_cannot_draw_says_nothing(drawn_apart, monkeypatch, tmp_path, program):
    drawn_apart(program)
    monkeypatch.setattr(first_picture, "SKETCH_SECONDS", 0.1)
    told = []
    with FirstPicture(lambda: told.append(1)) as first, first.restore_on_error():
        first.draw(None, tmp_path / "a.png", (160, 120), {})
        first.finish()
    assert told == []
    monkeypatch.setattr(opengl, "PROBE", "raise SystemExit(1)")
    assert "cannot be drawn" in opengl.why_no_pictures(), "nothing is known of the window"
    assert list(tmp_path.iterdir()) == []


def test_the_preview_module_imports_neither_numpy_nor_pydantic():
    code = "import sys, dsfab.app.preview; print(*{'numpy', 'pydantic', 'dsfab.surface'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.slow
def test_the_final_picture_is_the_same_with_and_without_a_first_picture(monkeypatch, tmp_path, capsys):
    asked = ["preview", DOME_MODES, "--set", "surface.edge=0.8", "--size", "320x240", "-o"]
    assert main([*asked, str(tmp_path / "calm.png")]) == 0
    monkeypatch.setattr(Reporter, "is_watched", True)
    seen, path = [], tmp_path / "watched.png"
    report = Reporter.__call__

    def reported(self, stage, doing):
        if doing == f"drawing {path.name}":
            seen.append(path.read_bytes())
        report(self, stage, doing)

    monkeypatch.setattr(Reporter, "__call__", reported)
    assert main([*asked, str(path)]) == 0
    calm = (tmp_path / "calm.png").read_bytes()
    assert seen[0][:4] == calm[:4]
    assert seen[0] != calm
    assert path.read_bytes() == calm
    assert "a first picture is ready" in capsys.readouterr().err

    def refused(*_):
        raise PatternError("no such share")

    monkeypatch.setattr(stages, "pattern_stage", refused)
    assert main([*asked, str(path)]) == 1
    assert path.read_bytes() == calm


@pytest.mark.parametrize(
    ("show", "width", "said"),
    [
        ("structure", {"solid_fraction": 0.4}, "first picture, the widths of members in this sketch are approximate"),
        ("structure", {}, "first picture"),
        ("major_mode", {"solid_fraction": 0.4}, "first picture, major mode"),
    ],
)
def test_the_caption_of_the_first_picture_names_its_accuracy(show, width, said):
    preset = load_preset(DOME_MODES, {"pattern.width": width})
    assert sketch_caption(SimpleNamespace(preset=preset, words=""), show) == f"dome_modes - {said}"
