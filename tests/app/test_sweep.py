"""`dsfab sweep`: from the words on the command line to a folder that can be looked at, asked and continued."""

import csv
import json
from pathlib import Path

import pytest
from PIL import Image

from dsfab.app.cli import main
from dsfab.app.options import Source
from dsfab.app.sweep_options import vary_tables, with_options
from dsfab.app.sweep_status import SweepProgress
from dsfab.core.errors import DsfabError
from dsfab.core.messages import duration
from dsfab.design.design import Design
from dsfab.preset.file import load_preset
from dsfab.report.sweep_pages import SheetDrawer, first_metric, second_metric
from dsfab.study.sweeps.folder import SweepFolder
from dsfab.study.sweeps.plan import plan_from
from dsfab.study.sweeps.scheduler import Progress
from dsfab.study.sweeps.workers import Outcome
from tests.presets import DOME_MODES
from tests.study.sweep_folders import Hands, deadly

COARSE = ("--set", "surface.edge=1.2", "--set", "pattern.keep=0", "--set", "pattern.width={}")
PHASES = ("--vary", "pattern.major.phase=0.0:0.6:4")
CHEAP = ("--metric", "kept_share,pieces", "--keep", "nothing")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder of one's own; runs are made in this process, which is quicker than to begin others."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("dsfab.study.sweeps.workers.LocalWorkers", lambda job, workers: Hands(job, count=1))
    return tmp_path


def run(capsys, *words: str) -> tuple[int, str, str]:
    code = main(["sweep", *words])
    told = capsys.readouterr()
    return code, told.out, told.err


def refused(capsys, *words: str) -> str:
    code, _, err = run(capsys, *words)
    assert code == 1, err
    assert "Traceback" not in err
    last = err.strip().splitlines()[-1]
    assert last.startswith("dsfab: ")
    return last


def test_a_sweep_from_the_command_line(here, capsys):
    code, out, err = run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "--constraint", "pieces == 1")
    assert code == 0
    folder = here / "outputs" / "dome_modes-sweep"
    assert {path.name for path in folder.iterdir()} >= {
        "sweep.toml",
        "preset.toml",
        "runs.db",
        "results.csv",
        "index.html",
    }
    assert "4 runs: 4 done, 0 failed" in out
    assert "0 done, 0 failed, 4 left" in err
    assert "4 done, 0 failed, 0 left" in err
    with (folder / "results.csv").open() as file:
        assert [line["in:pattern.major.phase"] for line in csv.DictReader(file)] == ["0.0", "0.2", "0.4", "0.6"]


def test_a_sweep_file_and_the_command_line_say_the_same(here, capsys):
    Path("mine.toml").write_text(
        f"preset = '{DOME_MODES}'\n"
        'metrics = ["kept_share", "pieces"]\nkeep = []\n'
        "[set]\nsurface.edge = 1.2\npattern.keep = 0\n"
        '"pattern.width" = {}\n[vary]\npattern.major.phase = { from = 0.0, to = 0.6, count = 4 }\n'
    )
    assert run(capsys, "mine.toml", "-o", "one", "-q")[0] == 0
    assert run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "-o", "two", "-q")[0] == 0
    assert Path("one/sweep.toml").read_text() == Path("two/sweep.toml").read_text()
    assert Path("one/preset.toml").read_text() == Path("two/preset.toml").read_text()
    results = [[row.metrics for row in SweepFolder.from_folder(Path(name)).rows()] for name in ("one", "two")]
    assert results[0] == results[1]


def test_a_quiet_sweep_prints_nothing(here, capsys):
    assert run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "-q") == (0, "", "")


def test_the_folder_goes_on_and_can_be_extended(here, capsys):
    run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "-o", "s")
    code, out, err = run(capsys, "s")
    assert (code, "4 runs: 4 done" in out) == (0, True)
    assert "4 done, 0 failed, 0 left" in err
    assert "different settings: vary" in refused(capsys, "s", "--vary", "pattern.major.phase=0.0:0.6:7")
    assert "7 runs: 7 done" in run(capsys, "s", "--vary", "pattern.major.phase=0.0:0.6:7", "--extend")[1]
    assert "leave out -o" in refused(capsys, "s", "-o", "t")


def test_missing_runs_are_listed_and_give_exit_code_3(here, capsys, monkeypatch):
    def crew(fate):
        return lambda job, workers: Hands(job, count=1, fate=fate)

    monkeypatch.setattr("dsfab.study.sweeps.workers.LocalWorkers", crew(deadly(2, 4)))
    code, out, err = run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "-o", "s")
    assert code == 3
    assert "4 runs: 2 done, 0 failed, 2 killed" in out
    assert "run 2 was killed: the worker was killed 2 times" in err
    last = "dsfab: 2 of 4 runs are missing (killed: 2, 4); `dsfab sweep s` tries these runs again"
    assert err.splitlines()[-1] == last
    assert run(capsys, "s", "--retry", "failed")[0] == 3, "the killed ones are still missing"
    monkeypatch.setattr("dsfab.study.sweeps.workers.LocalWorkers", crew(deadly()))
    code, out, err = run(capsys, "s")
    assert (code, "4 runs: 4 done, 0 failed\n" in out, "missing" in err) == (0, True, False)


def test_a_design_that_cannot_be_made_is_not_missing(here, capsys):
    words = (DOME_MODES, *COARSE, *CHEAP, "--vary", "pattern.major.mode=1,40", "-o", "s")
    assert run(capsys, *words)[0] == 0
    code, out, err = run(capsys, "s", "--retry", "all")
    assert (code, "2 runs: 1 done, 1 failed" in out) == (0, True)
    assert "run 2 failed" in err
    assert "unknown" not in refused_usage(capsys, "s", "--retry", "some")


def refused_usage(capsys, *words: str) -> str:
    code, _, err = run(capsys, *words)
    assert code == 2
    return err


def test_pictures_contact_sheet_and_page(here, capsys):
    words = ("--metric", "compliance_quick,sheet_mass,pieces", "--size", "160x120", "--vary", "pattern.major.mode=1,40")
    assert run(capsys, DOME_MODES, *COARSE, *words, "-o", "s")[0] == 0
    with Image.open("s/pictures/00001.png") as picture:
        assert picture.size == (160, 120)
        assert len(set(picture.convert("L").resize((16, 12)).tobytes())) > 5
    assert not Path("s/pictures/00002.png").exists()
    with Image.open("s/sheet.png") as sheet:
        assert sheet.size[0] > 500
    text = Path("s/index.html").read_text()
    assert "pictures/00001.png" in text
    assert "pattern.major.mode = 40" in text
    with open("s/results.csv") as file:
        assert [line["img"] for line in csv.DictReader(file)] == ["pictures/00001.png", ""]


def test_pictures_of_designs_on_one_surface_share_the_camera():
    """A fuller design covers what a leaner one covers: the camera stands still."""
    import io

    import numpy as np

    drawer, masks = SheetDrawer((160, 120), "top"), []
    for share in (0.3, 0.6):
        changes = {"surface.edge": 1.2, "pattern.keep": 0, "pattern.width": {"solid_fraction": share}}
        image = Image.open(io.BytesIO(drawer(Design.from_preset(load_preset(DOME_MODES, changes)))))
        masks.append(np.asarray(image.convert("L")) < 200)
    edges = [[(mask.any(axis=a).argmax(), mask.any(axis=a)[::-1].argmax()) for a in (0, 1)] for mask in masks]
    assert np.abs(np.array(edges[0]) - edges[1]).max() <= 2


@pytest.mark.slow
def test_the_best_runs_and_the_build_of_one(here, capsys):
    only_stl = ("--set", "export.formats=['stl']")
    run(capsys, DOME_MODES, *COARSE, *only_stl, *PHASES, *CHEAP, "-o", "s", "--constraint", "kept_share <= 0.999")
    code, out, _ = run(capsys, "s", "--best", "2", "--by", "kept_share")
    assert code == 0
    lines = out.splitlines()
    assert lines[0].split() == ["run", "kept_share", "pieces", "phase"]
    shares = [float(line.split()[1]) for line in lines[1:]]
    assert len(shares) == 2
    rows = SweepFolder.from_folder(Path("s")).rows()
    assert shares[0] == pytest.approx(min(row.metrics["kept_share"] for row in rows), rel=1e-3)
    number = int(lines[1].split()[0])
    assert main(["sweep", "s", "--build", str(number), "-q"]) == 0
    built = Path("s/built") / f"{number:05}"
    facts = json.loads((built / "design.json").read_text())
    assert facts["sheet"]["kept_share"] == rows[number - 1].metrics["kept_share"]
    assert (built / "dome_modes.stl").is_file()


def test_kept_solids_and_sheets(here, capsys):
    words = ("--metric", "area", "--keep", "sheet", "--export", "stl,glb", "--vary", "pattern.major.phase=0.1")
    assert run(capsys, DOME_MODES, *COARSE, *words, "-o", "s")[0] == 0
    assert sorted(path.name for path in Path("s/designs/00001").iterdir()) == [
        "dome_modes.glb",
        "dome_modes.stl",
        "sheet.ply",
    ]


REFUSALS = {
    "nothing to vary": (["dome"], "add the keys to vary: dsfab sweep dome --vary"),
    "no such preset": (["cathedral", *PHASES], "'cathedral' not found"),
    "a misspelt key": (["dome", "--vary", "pattern.major.phse=1,2"], "did you mean phase"),
    "a misspelt metric": (["dome", *PHASES, "--metric", "complience"], "did you mean compliance?"),
    "a bad sample": (["dome", *PHASES, "--sample", "sobol"], "use grid, sobol:200"),
    "a bad range": (["dome", "--vary", "pattern.major.phase=0:1:x"], "is not a range"),
    "an endless grid": (["dome", "--vary", "pattern.major.phase=0.0:1.0"], "needs count"),
    "a bad constraint": (["dome", *PHASES, "--constraint", "pieces is 1"], "is not METRIC SIGN NUMBER"),
    "no workers": (["dome", *PHASES, "--workers", "0"], "--workers 0 is less than 1; give 1 or more"),
    "a folder without a sweep": (["."], "holds no sweep (sweep.toml is missing)"),
    "the best of nothing": ([".", "--best", "3"], "holds no sweep"),
    "pictures too small": (["dome", *PHASES, "--size", "20x20"], "sides of 64 to 8000"),
    "an unknown side": (["dome", *PHASES, "--view", "below"], "view 'below' is not known"),
    "what is kept": (["dome", *PHASES, "--keep", "everything"], "keep.0 = 'everything'"),
    "an unknown format": (["dome", *PHASES, "--export", "skp"], "formats.0 = 'skp'"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_refusals(what, here, capsys):
    words, says = REFUSALS[what]
    assert says in refused(capsys, *words)
    assert list(here.iterdir()) == []


def test_questions_that_a_sweep_cannot_answer(here, capsys):
    run(capsys, DOME_MODES, *COARSE, *PHASES, *CHEAP, "-o", "s", "--constraint", "pieces == 99")
    assert "s has no run 9; give a number from 1 to 4" in refused(capsys, "s", "--build", "9")
    assert "has no values of the metric 'mass'" in refused(capsys, "s", "--best", "1", "--by", "mass")
    assert "s has no finished run with a value of kept_share that meets pieces == 99" in refused(
        capsys, "s", "--best", "1", "--by", "kept_share"
    )


@pytest.mark.parametrize(
    ("text", "vary", "linked"),
    [
        ("a.b=1,2", {"a.b": [1, 2]}, []),
        ("a.b=4:24:6", {"a.b": {"from": 4, "to": 24, "count": 6}}, []),
        ("a.b=0.1:10:log", {"a.b": {"from": 0.1, "to": 10, "log": True}}, []),
        ("a.b=1:100:3:log", {"a.b": {"from": 1, "to": 100, "count": 3, "log": True}}, []),
        ("a.b=plain,graded", {"a.b": ["plain", "graded"]}, []),
        ("a.b,c.d=1,2;5,3", {}, [{"a.b": [1, 2], "c.d": [5, 3]}]),
    ],
)
def test_vary_reads_ranges_lists_and_linked_keys(text, vary, linked):
    assert vary_tables([text]) == (vary, linked)


@pytest.mark.parametrize("text", ["a.b", "a.b=", "=1", "a.b=1:2:3:4", "a.b=x:y", "a,b=1,2", "a,b=1;2;3"])
def test_vary_refuses_malformed_texts(text):
    with pytest.raises(DsfabError, match="--vary"):
        vary_tables([text])


def test_the_command_line_wins_over_the_file():
    given = {
        "preset": "dome",
        "set": {"surface": {"edge": 1.0}},
        "vary": {"diffusion": {"r": [1]}},
        "metrics": ["area"],
    }
    values = with_options(given, Source(("surface.edge=2.0",), unit="mm"), ["diffusion.r=5,6"], {"seed": None})
    plan = plan_from(values)
    assert plan.set == {"surface.edge": 2.0, "surface.unit": "mm"}
    assert plan.vary == {"diffusion.r": (5, 6)}
    assert plan.metrics == ("area",)


def test_the_metric_that_is_looked_at_first():
    def first(*metrics, **more):
        plan = plan_from({"preset": "dome", "vary": {"a": [1]}, "metrics": metrics, **more})
        return first_metric(plan), second_metric(plan)

    assert first("area", "mass", "compliance") == ("compliance", "mass")
    assert first("pieces") == ("pieces", "pieces")
    assert first("compliance_quick", "sheet_mass") == ("compliance_quick", "sheet_mass")
    assert first("compliance", "mass", search={"metric": "mass"}) == ("mass", "compliance")


def test_progress_tells_the_rate_and_the_best_so_far(capsys):
    teller = SweepProgress(
        False, "compliance", plan_from({"preset": "dome", "vary": {"a": [1]}, "constraints": ["pieces == 1"]}).limits
    )
    progress = Progress(4, 0, 0)
    teller(progress)
    progress.begun -= 60
    for number, compliance, pieces in ((1, 5.0, 1.0), (2, 3.0, 1.0), (3, 1.0, 2.0)):
        progress.last = Outcome(number, {"compliance": compliance, "pieces": pieces})
        progress.done, progress.ended_now = number, number
        teller(progress)
    progress.last, progress.failed, progress.ended_now = Outcome(4, error="it broke " * 50), 1, 4
    teller(progress)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0 done, 0 failed, 4 left"
    assert lines[1].startswith("run 4 failed: it broke")
    assert len(lines[1]) < 140
    assert lines[2].startswith("3 done, 1 failed, 0 left; 4 runs/min")
    assert lines[2].endswith("best compliance 3 J (run 2)")
    assert [duration(s) for s in (2.68, 40, 790, 12600)] == ["2.7 s", "40 s", "13 min", "3.5 h"]
