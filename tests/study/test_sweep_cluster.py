"""The same sweep on a Dask cluster: a scheduler and two workers, one of which is killed half-way."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.folder import SweepFolder, only_coordinator, prepare, sweep_folder
from dsfab.study.sweeps.workers import DaskWorkers, execute
from tests.presets import ROOF_MODES
from tests.shapes import ZOO
from tests.study.sweep_folders import measured, plan, swept

distributed = pytest.importorskip("distributed", reason="Dask (dsfab[cluster]) is not installed")


def started(log, *words: str) -> subprocess.Popen:
    with log.open("w") as file:
        return subprocess.Popen([sys.executable, "-m", *words], stdout=file, stderr=file, start_new_session=True)


def address_in(log) -> str:
    """Where the scheduler listens, by its own words."""
    give_up = time.monotonic() + 60
    while time.monotonic() < give_up:
        if found := re.search(r"Scheduler at:\s+(tcp://\S+)", log.read_text()):
            return found[1]
        time.sleep(0.1)
    raise AssertionError(log.read_text())


@contextlib.contextmanager
def cluster(folder):
    """The address of a scheduler, and two workers that know nothing of the sweep's folder."""
    log = folder / "scheduler.log"
    scheduler = started(log, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    workers = []
    try:
        address = address_in(log)
        for name in ("a", "b"):
            (folder / name).mkdir()
            words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(folder / name))
            workers.append(started(folder / f"{name}.log", "distributed.cli.dask_worker", address, *words))
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            with contextlib.suppress(OSError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def test_a_missing_scheduler_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr("dsfab.study.sweeps.workers.SECONDS", 0.3)
    with pytest.raises(DsfabError, match="no Dask scheduler answers at tcp://127"):
        DaskWorkers(None, "tcp://127.0.0.1:9")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="kills a group of processes")
def test_a_cluster_gives_the_local_results_even_if_a_worker_dies(tmp_path):
    many = plan(vary={"diffusion.r": [10.0, 30.0], "pattern.major.phase": [i / 10 for i in range(10)]})
    swept(tmp_path / "here", many)
    folder = sweep_folder(tmp_path / "there")
    with cluster(tmp_path) as (address, workers), only_coordinator(folder):
        found = prepare(many, folder)
        fleet = DaskWorkers(found.job(ship_mesh=True), address)
        begun = set()

        def kill_one(progress):
            begun.update(fleet.workers())
            if progress.done == 8 and workers[0].poll() is None:
                workers[0].kill()

        try:
            found.run(fleet, kill_one)
        finally:
            fleet.close()
        assert len(begun) == 2
    assert measured(folder) == measured(tmp_path / "here")
    assert [row.state for row in SweepFolder.from_folder(folder).rows()] == ["done"] * 20


def test_a_mesh_is_sent_to_workers_without_the_file(tmp_path):
    import trimesh

    dome = ZOO["dome"]()
    path = tmp_path / "roof.obj"
    trimesh.Trimesh(dome.V * 8000, dome.F, process=False).export(path)
    asked = plan(
        preset=ROOF_MODES,
        mesh=str(path),
        set={"surface.unit": "mm", "pattern.keep": 0.3},
        vary={"pattern.major.phase": [0.0, 0.5]},
    )
    found = prepare(asked, sweep_folder(tmp_path / "s"))
    job = found.job(ship_mesh=True)
    content = path.read_bytes()
    path.unlink()
    assert job.mesh == content
    outcome = execute(job, 1, {"pattern.major.phase": 0.5})
    assert outcome.error == ""
    assert 0 < outcome.metrics["kept_share"] < 1
    assert str(path) in outcome.files["preset.toml"].decode()
    without = replace(job, token="another", mesh=None)
    assert "roof.obj" in execute(without, 1, {"pattern.major.phase": 0.5}).error
