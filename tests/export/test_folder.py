"""Folders that swap whole: killed at every step there is the old one or the new one, and what is the user's stays."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from dsfab.core.errors import ExportError
from dsfab.export import atomic_file
from dsfab.export import writing as folders
from dsfab.export.writing import DESIGN, JOURNAL, atomic_folder, complete_folder, is_abandoned, manifest, partial_name
from tests.export.delivered_folders import NEW, OLD, OWN, delivered, held


@pytest.fixture(params=["beside", "inside"])
def place(request, tmp_path):
    """A folder with a design and files of the user's own; `inside`: a folder of theirs keeps it where it is."""
    if request.param == "beside" and sys.platform != "linux":
        pytest.skip("the step in which two folders change places")
    made = tmp_path / "out"
    delivered(made, OLD)
    for name, text in OWN.items():
        (made / name).write_text(text)
    if request.param == "inside":
        (made / "theirs").mkdir()
        (made / "theirs" / "photo.png").write_text("mine")
    return made


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the step in which two folders change places")


def test_a_new_design_takes_the_place_of_the_old_one_and_of_nothing_else(place):
    """b.step is of the old design and goes; what the user put there stays."""
    delivered(place, NEW)
    assert held(place) == {**NEW, **OWN}
    assert [path.name for path in place.parent.iterdir()] == ["out"]
    assert not list(place.glob(".partial-*"))
    if (place / "theirs").exists():
        assert (place / "theirs" / "photo.png").read_text() == "mine"


def test_an_old_file_that_the_user_changed_is_kept(place):
    (place / "b.step").write_text("drawn over")
    delivered(place, NEW)
    assert held(place) == {**NEW, **OWN, "b.step": "drawn over"}


def test_a_failed_delivery_leaves_the_folder_unchanged(place):
    before = held(place)

    def half():
        with atomic_folder(place) as partial:
            (partial / "a.stl").write_text("half")
            raise ExportError(f"no room in {partial}")

    with pytest.raises(ExportError, match=r"no room in .*out$"):
        half()
    assert held(place) == before
    assert [path.name for path in place.parent.iterdir()] == ["out"]
    assert not list(place.glob(".partial-*"))


def test_files_without_a_manifest_push_nothing_out(place):
    """One more format of the same design: all that was there stays."""
    with atomic_folder(place) as partial:
        (partial / "d.glb").write_text("d")
    assert held(place) == {**OLD, **OWN, "d.glb": "d"}


def test_the_manifest_names_sizes_and_hashes(place):
    told = json.loads((place / DESIGN).read_text())["manifest"]
    assert set(told) == set(OLD)
    assert {name: (one["bytes"], one["sha256"]) for name, one in told.items()} == {
        name: (len(text), hashlib.sha256(text.encode()).hexdigest()) for name, text in OLD.items()
    }


def test_a_manifest_with_foreign_paths_removes_nothing_outside(place):
    secret = place.parent / "secret.txt"
    secret.write_text("s")
    known = manifest(place.parent)["secret.txt"]
    (place / DESIGN).write_text(json.dumps({"manifest": {"../secret.txt": known, str(secret): known, "b.step": None}}))
    delivered(place, NEW)
    assert secret.read_text() == "s"
    assert held(place)["c.dxf"] == "new c"


def test_a_link_to_a_folder_stays_a_link(tmp_path):
    real = tmp_path / "disk" / "out"
    delivered(real, OLD)
    (tmp_path / "out").symlink_to(real)
    delivered(tmp_path / "out", NEW)
    assert (tmp_path / "out").is_symlink()
    assert held(real) == NEW


def test_a_folder_that_is_a_working_directory_is_not_replaced(tmp_path, monkeypatch):
    place = tmp_path / "out"
    delivered(place, OLD)
    monkeypatch.chdir(place)
    before = place.stat().st_ino
    delivered(Path(), NEW)
    assert held(place) == NEW
    assert place.stat().st_ino == before


def test_a_replaced_folder_keeps_its_permissions_and_a_new_folder_has_the_default(tmp_path):
    (tmp_path / "usual").mkdir()
    delivered(tmp_path / "out", OLD)
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "usual").stat().st_mode
    (tmp_path / "out").chmod(0o751)
    delivered(tmp_path / "out", NEW)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o751


@LINUX
def test_a_file_that_is_saved_during_the_exchange_is_not_lost(tmp_path, monkeypatch):
    place, exchange = tmp_path / "out", folders.exchange_folders
    delivered(place, OLD)
    (place / "notes.txt").write_text("first")

    def meanwhile(one, other):
        (place / "late.txt").write_text("late")
        (place / "saved").write_text("second")
        os.replace(place / "saved", place / "notes.txt")
        return exchange(one, other)

    monkeypatch.setattr(folders, "exchange_folders", meanwhile)
    delivered(place, NEW)
    assert held(place) == {**NEW, "late.txt": "late", "notes.txt": "second"}


@pytest.mark.parametrize("able", ["link_files", "exchange_folders"])
def test_a_journal_replaces_links_and_exchange_where_the_system_lacks_them(place, monkeypatch, able):
    monkeypatch.setattr(folders, able, lambda *_: False)
    delivered(place, NEW)
    assert held(place) == {**NEW, **OWN}
    assert [path.name for path in place.parent.iterdir()] == ["out"]
    assert not list(place.glob(".partial-*"))


KILLED = """
import json, os, shutil, sys
from pathlib import Path
from tests.export.delivered_folders import NEW, OLD, OWN, delivered, held
from dsfab.export.writing import complete_folder

home, inside = Path(sys.argv[1]), sys.argv[2] == "inside"
old, new = {**OLD, **OWN}, {**NEW, **OWN}
step, ends = 0, []
while True:
    place = home / f"{step}" / "out"
    delivered(place, OLD)
    for name, text in OWN.items():
        (place / name).write_text(text)
    if inside:
        (place / "theirs").mkdir()
    if not (child := os.fork()):
        count = [0]
        def hook(event, _):
            if event.startswith(("os.", "open", "shutil.")):
                count[0] += 1
                if count[0] > step:
                    os._exit(9)
        sys.addaudithook(hook)
        delivered(place, NEW)
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    seen = held(place)
    complete_folder(place)
    then = held(place)
    left = sum(name.startswith(".partial") for _, _, names in os.walk(place.parent) for name in names)
    left += sum(name.startswith(".partial") for _, names, _ in os.walk(place.parent) for name in names)
    word = {json.dumps(old, sort_keys=True): "old", json.dumps(new, sort_keys=True): "new"}
    name = lambda files: word.get(json.dumps(files, sort_keys=True), f"mix {sorted(files.items())}")
    ends.append((name(seen), name(then), left))
    step += 1
    if code == 0:
        break
print(json.dumps(ends))
"""


@pytest.mark.slow
@LINUX
@pytest.mark.parametrize("where", ["beside", "inside"])
def test_a_killed_delivery_leaves_the_old_or_the_new_folder(tmp_path, where):
    """A process that delivers is ended before each of its calls of the system, one after the other."""
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path), where], capture_output=True, text=True, check=True, cwd=ROOT
    )
    ends = json.loads(done.stdout)
    seen, then = [end[0] for end in ends], [end[1] for end in ends]
    assert len(ends) > 20
    assert set(then) == {"old", "new"}, "after the next run's first look"
    assert then == sorted(then, reverse=True), "first the old one, then the new one"
    assert [end[2] for end in ends] == [0] * len(ends), "and nothing is left behind"
    if where == "beside":
        assert set(seen) == {"old", "new"}, "and before anybody looked"


ROOT = Path(__file__).parents[2]


def ended_process() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_whose_a_partial_name_is(monkeypatch):
    mine = partial_name(".stl")
    _, host, pid, began, rest = mine[1:].split("-")
    assert (pid, rest.endswith(".stl")) == (str(os.getpid()), True)
    assert not is_abandoned(mine)
    assert is_abandoned(f".partial-{host}-{ended_process()}-{began}-00ff")
    assert not is_abandoned(f".partial-00000000-{ended_process()}-{began}-00ff"), "another machine's"
    for strange in ("notes.txt", ".partial-abc", f".partial-{host}-x-1-ff", ".partial-from-an-earlier-one"):
        assert not is_abandoned(strange)


@LINUX
def test_a_number_that_was_given_again_is_not_the_process_that_died():
    _, host, pid, began, rest = partial_name()[1:].split("-")
    assert is_abandoned(f".partial-{host}-{pid}-{int(began) - 1}-{rest}")


def test_the_next_run_removes_only_the_leftovers_of_dead_processes(tmp_path):
    host = partial_name().split("-")[1]
    dead = f".partial-{host}-{ended_process()}-1-aa"
    place = tmp_path / "out"
    for left in (place / dead, tmp_path / dead, tmp_path / partial_name(), tmp_path / ".partial-00000000-1-1-aa"):
        left.mkdir(parents=True)
        (left / "half.stl").write_text("half")
    delivered(place, NEW)
    assert held(place) == NEW
    assert not (place / dead).exists()
    assert not (tmp_path / dead).exists()
    assert len(list(tmp_path.iterdir())) == 3, "one of a living process and one of another machine stay"


def test_files_that_dead_processes_left_half_written_are_removed(tmp_path):
    dead = tmp_path / f".partial-{partial_name().split('-')[1]}-{ended_process()}-1-aa.csv"
    dead.write_text("half")
    with atomic_file(tmp_path / "results.csv") as temporary:
        assert not is_abandoned(temporary.name)
        temporary.write_text("whole")
    assert [path.name for path in tmp_path.iterdir()] == ["results.csv"]


def test_a_journal_of_a_dead_process_is_completed_by_who_opens_the_folder(tmp_path):
    delivered(tmp_path / "out", OLD)
    left = tmp_path / "out" / f".partial-{partial_name().split('-')[1]}-{ended_process()}-1-aa"
    left.mkdir()
    (left / "a.stl").write_text("new a")
    (left / JOURNAL).write_text(json.dumps({"move": ["a.stl", "moved before"], "remove": ["b.step", "gone before"]}))
    complete_folder(tmp_path / "out")
    assert held(tmp_path / "out") == {"a.stl": "new a", "preset.toml": "old"}
    assert not left.exists()
