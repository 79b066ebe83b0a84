"""A comparison that was cut off goes on with the checks that it had finished."""

import json

import pytest

from dsfab.app.cli import main
from dsfab.study import comparison

COMMAND = [
    *("compare", "cantilever", "--set", "surface.edge=0.15", "--against", "thinner", "--level", "full"),
    *("--no-report", "-o"),
]


@pytest.fixture
def counted(monkeypatch):
    """Counts full checks, and stops the run before the check of a given number."""
    full, calls = comparison.full, {"made": 0, "stop": 0}

    def counting(*args, **kwargs):
        calls["made"] += 1
        if calls["made"] == calls["stop"]:
            raise KeyboardInterrupt
        return full(*args, **kwargs)

    monkeypatch.setattr(comparison, "full", counting)
    return calls


def rows(folder):
    competitors = json.loads((folder / "results.json").read_text())["competitors"]
    return [{key: value for key, value in row.items() if "seconds" not in key} for row in competitors]


def test_an_interrupted_comparison_repeats_no_finished_check(counted, tmp_path):
    whole, folder = tmp_path / "whole", tmp_path / "compliance"
    assert main([*COMMAND, str(whole)]) == 0
    every = counted["made"]
    counted |= {"made": 0, "stop": every}
    assert main([*COMMAND, str(folder)]) != 0
    checks = tmp_path / "compliance.checks"
    assert len(list(checks.iterdir())) == every - 1
    assert not folder.exists()
    counted |= {"made": 0, "stop": 0}
    assert main([*COMMAND, str(folder)]) == 0
    assert counted["made"] == 1
    assert rows(folder) == rows(whole)
    assert not checks.exists()


def test_another_level_load_or_broken_file_is_checked_again(counted, tmp_path):
    counted["stop"] = 2
    assert main([*COMMAND, str(tmp_path / "compliance")]) != 0
    (file,) = (tmp_path / "compliance.checks").iterdir()
    for more in (["--set", "statics.thickness=0.02"], ["--frequency"]):
        counted |= {"made": 0, "stop": 2}
        assert main([*COMMAND, str(tmp_path / "compliance"), *more]) != 0
        assert counted["made"] == 2
    assert len(list(file.parent.iterdir())) == 3
    file.write_text(file.read_text()[:-20])
    counted |= {"made": 0, "stop": 2}
    assert main([*COMMAND, str(tmp_path / "compliance")]) != 0
    assert counted["made"] == 2


def test_without_space_a_comparison_goes_on(tmp_path):
    (tmp_path / "compliance.checks").write_text("a file in the way of the folder")
    assert main([*COMMAND, str(tmp_path / "compliance")]) == 0
    assert (tmp_path / "compliance" / "results.csv").is_file()
