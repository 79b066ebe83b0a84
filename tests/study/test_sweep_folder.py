"""A sweep's folder: every run exactly once, whatever is killed; nothing forgotten, nothing mixed up."""

import contextlib
import csv
import os
import random
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from pathlib import Path

import pytest

from dsfab.core.errors import DsfabError, PresetError
from dsfab.study.sweeps import workers as local
from dsfab.study.sweeps.folder import (
    SweepFolder,
    best,
    only_coordinator,
    pareto,
    prepare,
    records,
    sweep_folder,
    write_tables,
)
from dsfab.study.sweeps.plan import load_plan
from dsfab.study.sweeps.runs import RunRow, Store
from dsfab.study.sweeps.scheduler import TRIES
from dsfab.study.sweeps.workers import LocalWorkers, Outcome, cores, free_memory
from tests.study.sweep_folders import PHASES, Hands, deadly, measured, plan, row, swept


def test_a_sweep_and_all_of_its_files(tmp_path):
    assert swept(tmp_path / "s", plan()) == list(range(1, 9))
    rows = SweepFolder.from_folder(tmp_path / "s").rows()
    assert [row.state for row in rows] == ["done"] * 8
    assert [row.changes for row in rows][:2] == [
        {"diffusion.r": 10.0, "pattern.major.phase": 0.0},
        {"diffusion.r": 10.0, "pattern.major.phase": 0.2},
    ]
    with (tmp_path / "s" / "results.csv").open() as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == [
        "run",
        "state",
        "in:diffusion.r",
        "in:pattern.major.phase",
        "out:kept_share",
        "out:pieces",
        "out:seconds",
        "feasible",
        "error",
        "img",
    ]
    assert [float(line["out:kept_share"]) for line in table] == [row.metrics["kept_share"] for row in rows]
    assert [row.files for row in rows] == [(f"designs/{n:05}/preset.toml",) for n in range(1, 9)]
    assert all((tmp_path / "s" / name).is_file() for row in rows for name in row.files)


def test_a_run_is_the_design_that_is_built_alone(tmp_path):
    import dsfab

    swept(tmp_path, plan())
    row = SweepFolder.from_folder(tmp_path).rows()[5]
    alone = dsfab.run(dsfab.load_preset(tmp_path / row.files[0]))
    assert row.metrics["kept_share"] == alone.sheet.surface.area / alone.surface.area


def test_the_same_command_again_makes_nothing_again(tmp_path):
    swept(tmp_path, plan())
    before = measured(tmp_path)
    assert swept(tmp_path, plan()) == []
    assert swept(tmp_path, load_plan(tmp_path / "sweep.toml")) == []
    assert measured(tmp_path) == before


def test_a_sample_stays_the_same_sample(tmp_path):
    """Ranges and lists in any order: the points depend on it, and the folder keeps it."""
    mixed = {
        "pattern.major.phase": {"from": 0.0, "to": 1.0},
        "diffusion.r": [10.0, 30.0],
        "pattern.rim": {"from": 0, "to": 1},
    }
    sampled = plan(vary=mixed, sampling="sobol:6")
    swept(tmp_path, sampled)
    assert swept(tmp_path, load_plan(tmp_path / "sweep.toml")) == []
    assert len(SweepFolder.from_folder(tmp_path).rows()) == 6
    turned = plan(vary=dict(reversed(mixed.items())), sampling="sobol:6")
    with pytest.raises(DsfabError, match="different settings: vary"):
        swept(tmp_path, turned)


def test_an_interrupted_sweep_resumes(tmp_path):
    swept(tmp_path / "whole", plan())
    count = iter(range(100))

    def ctrl_c(progress):
        if progress.last is not None and next(count) == 2:
            raise KeyboardInterrupt

    folder = sweep_folder(tmp_path / "broken")
    found = prepare(plan(), folder)
    crew = Hands(found.job())
    with pytest.raises(KeyboardInterrupt):
        found.run(crew, ctrl_c)
    crew.close()
    with Store.open(folder) as store:
        assert store.counts() == {"done": 3, "waiting": 5}
    with (folder / "results.csv").open() as file:
        assert [line["state"] for line in csv.DictReader(file)].count("done") == 3
    assert len(swept(folder, plan())) == 5
    assert measured(folder) == measured(tmp_path / "whole")


def test_runs_in_progress_when_the_coordinator_died_are_made_again(tmp_path):
    swept(tmp_path, plan())
    with Store.open(tmp_path) as store:
        store.start(3, "somebody")
        assert store.counts() == {"done": 7, "running": 1}
    assert swept(tmp_path, plan()) == [3]
    assert [row.tries for row in SweepFolder.from_folder(tmp_path).rows()] == [1, 1, 3, 1, 1, 1, 1, 1]


def test_a_worker_that_dies_once_costs_nothing_but_time(tmp_path):
    deaths = [3]

    def fate(number):
        if number in deaths:
            deaths.remove(number)
            raise OSError("killed")

    assert swept(tmp_path / "a", plan(), fate) == [1, 2, 3, 3, 4, 5, 6, 7, 8]
    swept(tmp_path / "b", plan())
    assert measured(tmp_path / "a") == measured(tmp_path / "b")


def states(folder: Path) -> list[str]:
    return [row.state for row in SweepFolder.from_folder(folder).rows()]


def test_a_run_whose_worker_is_killed_twice_is_killed_not_failed_and_made_at_the_next_start(tmp_path):
    begun = swept(tmp_path / "a", plan(), deadly(3))
    assert begun.count(3) == TRIES == 2
    row = SweepFolder.from_folder(tmp_path / "a").rows()[2]
    assert states(tmp_path / "a") == ["done"] * 2 + ["killed"] + ["done"] * 5
    assert row.error == "the worker was killed 2 times while it made this run"
    log = (tmp_path / "a" / "logs" / "00003.txt").read_text()
    assert "OSError: killed" in log
    assert "run 3 of dome_modes was killed" in log
    assert swept(tmp_path / "a", plan()) == [3]
    swept(tmp_path / "b", plan())
    assert measured(tmp_path / "a") == measured(tmp_path / "b")


def test_losses_count_anew_in_each_session(tmp_path):
    """One death in each of three sessions is none too many."""
    few = {"pattern.major.phase": PHASES}
    for _ in range(3):
        deaths = [3]

        def fate(number, deaths=deaths):
            if number in deaths:
                deaths.remove(number)
                raise OSError("killed")

        swept(tmp_path, plan(vary=few), fate)
        assert states(tmp_path) == ["done"] * 4
        with Store.open(tmp_path) as store:
            store.reset_to_waiting(("done",))
    assert SweepFolder.from_folder(tmp_path).rows()[2].lost == 3


def test_runs_that_were_killed_twice_are_made_last_and_alone(tmp_path):
    swept(tmp_path, plan(), deadly(2, 3, 4))
    with Store.open(tmp_path) as store:
        store.reset_to_waiting(("done",))
    at_once, most = [0], dict[int, int]()
    lock = threading.Lock()

    def fate(number):
        with lock:
            at_once[0] += 1
            most[number] = at_once[0]
        time.sleep(0.05)
        with lock:
            at_once[0] -= 1

    swept(tmp_path, plan(), fate)
    assert states(tmp_path) == ["done"] * 8
    assert set(list(most)[-3:]) == {2, 3, 4}
    assert [most[number] for number in (2, 3, 4)] == [1, 1, 1]
    assert max(most.values()) == 2, "the others are made together"


def test_which_runs_are_tried_again(tmp_path):
    varied = {"vary": {"pattern.major.mode": [1, 40, 2]}}
    swept(tmp_path, plan(**varied), deadly(3))
    assert states(tmp_path) == ["done", "failed", "killed"]
    assert swept(tmp_path, plan(**varied), deadly(3), retry=("failed",)) == [2]
    assert swept(tmp_path, plan(**varied), deadly(3)) == [3, 3]
    assert swept(tmp_path, plan(**varied), retry=("failed", "killed")) == [2, 3]
    assert states(tmp_path) == ["done", "failed", "done"]


def test_runs_that_an_earlier_dsfab_took_for_failed_are_made_again(tmp_path):
    swept(tmp_path, plan())
    with Store.open(tmp_path) as store:
        store.finish(3, {}, "the worker was killed 2 times while it made this run (out of memory?)")
        store.finish(4, {}, "pattern.major.mode = 40 is out of reach")
    assert swept(tmp_path, plan()) == [3]
    assert states(tmp_path)[2:4] == ["done", "failed"]


def test_a_worker_that_cannot_even_begin_is_a_death_like_any(tmp_path):
    """A pool whose process was killed as it began refuses work at once."""

    class Stillborn(Hands):
        born = 0

        def submit(self, worker, number, changes):
            self.born += 1
            if self.born == 1:
                raise BrokenExecutor("killed as it began")
            return super().submit(worker, number, changes)

    with only_coordinator(sweep_folder(tmp_path)):
        found = prepare(plan(), tmp_path)
        crew = Stillborn(found.job())
        found.run(crew)
        crew.close()
    assert states(tmp_path) == ["done"] * 8


def test_lack_of_memory_is_reported_only_if_the_kernel_counts_it(tmp_path, monkeypatch):
    """No guess: the kernel counts the processes that it ends for want of memory."""
    kills = [7]
    monkeypatch.setattr(local, "memory_kills", lambda: kills[0])
    crew = LocalWorkers(prepare(plan(), sweep_folder(tmp_path)).job(), 1)
    said = []
    for more in (0, 1):
        crew._pools["worker 1"] = ThreadPoolExecutor(1)
        kills[0] += more
        said.append(crew.lost("worker 1"))
    assert said == ["", "the system ended a process because memory was low"]
    assert crew.lost("nobody") == ""


def test_a_design_that_cannot_be_made_is_recorded_with_its_reason(tmp_path):
    swept(tmp_path, plan(vary={"pattern.major.mode": [1, 40, 2]}))
    rows = SweepFolder.from_folder(tmp_path).rows()
    assert [row.state for row in rows] == ["done", "failed", "done"]
    assert "pattern.major.mode = 40" in rows[1].error
    log = (tmp_path / "logs" / "00002.txt").read_text()
    assert rows[1].error in log
    assert "pattern.major.mode = 40" in log
    assert sorted(path.name for path in (tmp_path / "logs").iterdir()) == ["00002.txt"]


def test_a_failed_run_keeps_the_metrics_measured_before(tmp_path):
    """Rings alone: there is an area, but nothing that carries the load to the ground."""
    rings = {"pattern.minor.threshold": [1.0], "pattern.major.frequency": [9.0], "slicing.loose": ["keep"]}
    swept(tmp_path, plan(vary=rings, metrics=["kept_share", "compliance_quick", "pieces"]))
    (row,) = SweepFolder.from_folder(tmp_path).rows()
    assert row.state == "failed"
    assert set(row.metrics) == {"kept_share", "pieces"}
    assert row.files  # its preset is kept all the same


def test_a_mistake_of_ours_ends_one_run_only(tmp_path, monkeypatch):
    from dsfab.study.sweeps import workers as worker

    def broken(name, made):
        if made.preset.pattern.major.phase == 0.4:
            raise ZeroDivisionError("ours")
        return 1.0

    monkeypatch.setattr(worker, "metric_value", broken)
    swept(tmp_path, plan())
    failed = [row for row in SweepFolder.from_folder(tmp_path).rows() if row.state == "failed"]
    assert [row.error for row in failed] == ["kept_share: ZeroDivisionError: ours"] * 2
    assert "Traceback" in (tmp_path / "logs" / f"{failed[0].number:05}.txt").read_text()


def test_another_sweep_in_a_folder_is_refused_unless_extended(tmp_path):
    swept(tmp_path, plan())
    before = measured(tmp_path)
    wider = plan(vary={"diffusion.r": [10.0, 30.0, 50.0], "pattern.major.phase": PHASES})
    with pytest.raises(DsfabError, match=r"holds another sweep \(different settings: vary\); use --extend"):
        swept(tmp_path, wider)
    with pytest.raises(DsfabError, match="a sweep of another preset"):
        swept(tmp_path, plan(set={"surface.edge": 1.3}), extend=True)
    assert measured(tmp_path) == before
    assert swept(tmp_path, wider, extend=True) == [9, 10, 11, 12]
    after = measured(tmp_path)
    assert {n: after[n] for n in before} == before
    assert [state for state, *_ in after.values()] == ["done"] * 12
    assert swept(tmp_path, wider) == []


def test_another_metric_is_measured_of_all_runs(tmp_path):
    swept(tmp_path, plan())
    assert swept(tmp_path, plan(metrics=["kept_share", "area"]), extend=True) == list(range(1, 9))
    assert all(set(row.metrics) == {"kept_share", "area"} for row in SweepFolder.from_folder(tmp_path).rows())


def test_other_constraints_need_nothing_to_be_made(tmp_path):
    swept(tmp_path, plan(constraints=["pieces == 1"]))
    limit = sorted(row.metrics["kept_share"] for row in SweepFolder.from_folder(tmp_path).rows())[3]
    assert swept(tmp_path, plan(constraints=[f"kept_share <= {limit}", "pieces == 1"])) == []
    found = SweepFolder.from_folder(tmp_path)
    assert len(best(found.rows(), "kept_share", found.plan.limits)) == 4


def test_a_table_of_points_is_kept_in_the_folder(tmp_path):
    points = tmp_path / "points.csv"
    points.write_text("pattern.major.phase,diffusion.r\n0.1,10\n0.7,20\n")
    asked = plan(vary={}, sampling=f"csv:{points}")
    swept(tmp_path / "s", asked)
    points.unlink()
    assert swept(tmp_path / "s", load_plan(tmp_path / "s" / "sweep.toml")) == []
    assert [row.changes for row in SweepFolder.from_folder(tmp_path / "s").rows()] == [
        {"pattern.major.phase": 0.1, "diffusion.r": 10},
        {"pattern.major.phase": 0.7, "diffusion.r": 20},
    ]


def test_wrong_values_leave_nothing_behind(tmp_path):
    with pytest.raises(PresetError, match="did you mean phase"):
        prepare(plan(vary={"pattern.major.phse": [1.0]}), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_two_coordinators_are_refused(tmp_path):
    with only_coordinator(tmp_path):
        code = (
            "import sys; from pathlib import Path; from dsfab.study.sweeps.folder import only_coordinator\n"
            "with only_coordinator(Path(sys.argv[1])): pass"
        )
        other = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
        assert f"process {os.getpid()} on" in other.stderr
        assert "is running the sweep in" in other.stderr
    with only_coordinator(tmp_path):
        pass


def test_the_lock_of_a_coordinator_that_was_killed_is_open(tmp_path):
    code = (
        "import sys, time; from pathlib import Path; from dsfab.study.sweeps.folder import only_coordinator\n"
        "with only_coordinator(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(DsfabError, match="is running the sweep"), only_coordinator(tmp_path):
            pass
        holder.kill()
    with only_coordinator(tmp_path):
        pass


def test_a_full_disk_gives_one_sentence_and_loses_no_row(tmp_path):
    found = prepare(plan(vary={"pattern.major.phase": [i / 200 for i in range(200)]}, keep=[]), sweep_folder(tmp_path))
    with Store.open(tmp_path) as store:
        pages = store._db.execute("PRAGMA page_count").fetchone()[0]
        store._db.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(DsfabError, match=r"full.*free disk space and give the command again"):
            store.finish(1, {}, error="x" * 100_000)
        assert store.counts() == {"waiting": 200}
        store._db.execute("PRAGMA max_page_count = 100000")
        store.finish(1, {}, error="x" * 100_000)
        assert store.counts() == {"failed": 1, "waiting": 199}
    assert found.rows()[0].error == "x" * 100_000


def test_files_that_are_no_sweep_are_refused(tmp_path):
    with pytest.raises(DsfabError, match=r"holds no sweep \(sweep.toml is missing\)"):
        SweepFolder.from_folder(tmp_path)
    with pytest.raises(DsfabError, match=r"holds no sweep \(runs.db is missing\)"):
        Store.open(tmp_path)
    (tmp_path / "runs.db").write_text("this is no database, but long enough to be one" * 99)
    with pytest.raises(DsfabError, match="cannot be used"):
        Store.open(tmp_path)


def test_a_store_of_another_version_is_refused(tmp_path):
    with Store.create(tmp_path) as store:
        store.describe({"format": "99"})
    with pytest.raises(DsfabError, match="another version of dsfab"):
        Store.open(tmp_path)


def test_the_best_and_the_front():
    """Of points on a hyperbola all are on the front; those above it are not; failures and misses never are."""
    curve = [row(i, compliance=10.0 / i, sheet_mass=float(i), pieces=1.0) for i in range(1, 9)]
    above = [row(10 + i, compliance=10.0 / i + 1e-6, sheet_mass=float(i), pieces=1.0) for i in range(1, 9)]
    failed = [row(20, "failed", compliance=1e-9, sheet_mass=1e-9, pieces=1.0)]
    loose = [row(21, compliance=1e-9, sheet_mass=1e-9, pieces=2.0), row(22, sheet_mass=0.0, pieces=1.0)]
    rows = [*above, *curve, *failed, *loose]
    limits = plan(constraints=["pieces == 1"]).limits
    assert [r.number for r in best(rows, "compliance", limits)[:3]] == [8, 18, 7]
    assert [r.number for r in pareto(rows, "compliance", "sheet_mass", limits)] == [8, 7, 6, 5, 4, 3, 2, 1]
    assert [r.number for r in pareto(rows, "compliance", "sheet_mass")] == [21]
    wide = [row(1, min_width=0.1), row(2, min_width=0.3)]
    assert [r.number for r in best(wide, "min_width")] == [2, 1]


def test_points_that_are_equal_in_one_are_judged_by_the_other():
    rows = [row(1, area=1.0, pieces=3.0), row(2, area=1.0, pieces=2.0), row(3, area=1.0, pieces=2.0)]
    assert [r.number for r in pareto(rows, "area", "pieces")] == [2]


def test_the_parquet_file_equals_the_csv_file(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow (dsfab[tables]) is not installed")
    rows = [row(1, area=2.5), row(2, "failed"), RunRow(3, {"pattern.width.rule": "graded"}, "done", {"area": 3.0})]
    table = records(rows, ["area"], [])
    write_tables(tmp_path, table)
    assert parquet.read_table(tmp_path / "results.parquet").to_pylist() == table


def test_as_many_workers_as_memory_allows(monkeypatch):
    monkeypatch.setattr(local, "cores", lambda: 16)
    monkeypatch.setattr(local, "free_memory", lambda: 10_000)
    crew = LocalWorkers(None)
    assert len(crew.workers()) == 1  # until one run has shown what it needs
    crew.learn(Outcome(1, peak=1000))
    assert len(crew.workers()) == 8
    crew.learn(Outcome(2, peak=4000))
    assert len(crew.workers()) == 2
    crew.learn(Outcome(3, peak=90_000))
    assert len(crew.workers()) == 1
    assert len(LocalWorkers(None, workers=5).workers()) == 5
    monkeypatch.undo()
    assert cores() >= 1
    assert free_memory() > 0 or not sys.platform.startswith("linux")


@pytest.mark.slow
def test_processes_give_the_results_of_threads_and_survive_a_kill(tmp_path):
    swept(tmp_path / "threads", plan())
    with only_coordinator(sweep_folder(tmp_path / "processes")):
        found = prepare(plan(), tmp_path / "processes")
        crew = LocalWorkers(found.job(), 2)
        killed = []

        def kill_one(progress):
            if progress.last is not None and not killed:
                killed.append(next(iter(crew.pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        try:
            found.run(crew, kill_one)
        finally:
            crew.close()
    assert killed
    assert measured(tmp_path / "processes") == measured(tmp_path / "threads")


COMMAND = [sys.executable, "-m", "dsfab.app.cli", "sweep"]


def begun(folder: Path) -> subprocess.Popen:
    return subprocess.Popen(
        [*COMMAND, str(folder), "--workers", "2"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def ended(folder: Path) -> int:
    """How many runs have ended, asked while somebody else writes."""
    with contextlib.closing(sqlite3.connect(f"file:{folder / 'runs.db'}?mode=ro", uri=True)) as db:
        return db.execute("SELECT count(*) FROM runs WHERE state IN ('done', 'failed')").fetchone()[0]


def until(folder: Path, count: int, process: subprocess.Popen) -> None:
    while ended(folder) < count and process.poll() is None:
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for workers in /proc")
def test_16_runs_survive_kills_of_the_coordinator_and_of_a_worker(tmp_path):
    """Every run exactly once, with the numbers of a sweep that nobody disturbed; DSFAB_KILLED_RUNS=500 for more."""
    count = int(os.environ.get("DSFAB_KILLED_RUNS", "16"))
    many = plan(vary={"diffusion.r": [10.0, 30.0], "pattern.major.phase": [i / count for i in range(count // 2)]})
    swept(tmp_path / "calm", many)
    rough, draw = sweep_folder(tmp_path / "rough"), random.Random(17)
    prepare(many, rough)
    target = 0
    for _ in range(2):
        process = begun(rough)
        target = max(target, ended(rough)) + draw.randint(count // 20, count // 6)
        until(rough, target, process)
        workers = children(process.pid)
        process.kill()
        process.wait()
        process.stdout.close()
        gone_by = time.monotonic() + 60  # workers end by themselves when their coordinator is gone
        while any(Path(f"/proc/{pid}").exists() for pid in workers) and time.monotonic() < gone_by:
            time.sleep(0.05)
        assert not any(Path(f"/proc/{pid}").exists() for pid in workers)
        assert 0 < ended(rough) < count
    last = begun(rough)
    until(rough, ended(rough) + 4, last)
    os.kill(draw.choice(children(last.pid)), signal.SIGKILL)
    told = last.communicate(timeout=240)[0]
    assert last.returncode == 0, told
    assert f"{count} runs: {count} done, 0 failed" in told
    assert measured(rough) == measured(tmp_path / "calm")
    with (rough / "results.csv").open() as file:
        assert [int(line["run"]) for line in csv.DictReader(file)] == list(range(1, count + 1))


def children(parent: int) -> list[int]:
    """Worker processes of a coordinator (not Python's own resource tracker)."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if (
                f"PPid:\t{parent}\n" in (path / "status").read_text()
                and b"spawn_main" in (path / "cmdline").read_bytes()
            ):
                found.append(int(path.name))
    return found


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT to send")
def test_ctrl_c_is_one_sentence_and_the_sweep_goes_on(tmp_path):
    many = plan(vary={"diffusion.r": [10.0, 30.0], "pattern.major.phase": [i / 20 for i in range(20)]})
    prepare(many, sweep_folder(tmp_path))
    process = begun(tmp_path)
    until(tmp_path, 3, process)
    process.send_signal(signal.SIGINT)
    told = process.communicate(timeout=60)[0]
    assert process.returncode == 130
    assert f"dsfab: stopped; finished runs are kept. To go on: `dsfab sweep {tmp_path}`" in told
    assert "Traceback" not in told
    with Store.open(tmp_path) as store:
        assert "running" not in store.counts()
        assert 3 <= store.counts()["done"] < 40
    assert (tmp_path / "index.html").is_file()
