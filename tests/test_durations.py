"""The record of how long files of tests take, and the order that follows from it."""

import json
from types import SimpleNamespace

from tests import durations


def item(name, *keywords):
    return SimpleNamespace(path=durations.FILE.parent / name, keywords=keywords)


def test_the_file_that_takes_longest_comes_first_and_an_unknown_one_counts_as_average(tmp_path, monkeypatch):
    monkeypatch.setattr(durations, "FILE", tmp_path / "durations.json")
    durations.FILE.write_text(json.dumps({"quick": {"a.py": 1, "b.py": 9}, "slow": {"a.py": 30, "b.py": 2}}))
    quick = [item("a.py"), item("new.py"), item("b.py"), item("a.py")]
    durations.longest_first(quick)
    assert [one.path.name for one in quick] == ["b.py", "new.py", "a.py", "a.py"]
    slow = [item("b.py", "slow"), item("new.py", "slow"), item("a.py", "slow")]
    durations.longest_first(slow)
    assert [one.path.name for one in slow] == ["a.py", "new.py", "b.py"]


def test_a_run_records_its_files_and_drops_deleted_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(durations, "FILE", tmp_path / "durations.json")
    durations.FILE.write_text(json.dumps({"quick": {"a.py": 1, "gone.py": 9}, "slow": {"a.py": 30}}))
    for name in ("a.py", "b.py"):
        (tmp_path / name).touch()
    recorder = durations.Recorder()
    for name, words, seconds in (("a.py", {}, 2.01), ("a.py", {}, 0.5), ("b.py", {"slow": 1}, 4.0)):
        recorder.pytest_runtest_logreport(
            SimpleNamespace(location=(f"tests/{name}", 1, "test"), keywords=words, duration=seconds)
        )
    recorder.pytest_sessionfinish()
    assert durations.recorded() == {"quick": {"a.py": 2.5}, "slow": {"a.py": 30, "b.py": 4.0}}


def test_without_a_record_the_order_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(durations, "FILE", tmp_path / "durations.json")
    given = [item("b.py"), item("a.py")]
    durations.longest_first(given)
    assert [one.path.name for one in given] == ["b.py", "a.py"]
