"""Programs of ours in processes of their own, started before they are asked."""

import subprocess

import pytest

from dsfab.export.program import Ahead, ProgramError

ECHO = "import json, sys\nprint('loaded')\nprint(*reversed(json.loads(sys.stdin.readline())))\n"


def program(tmp_path, text):
    path = tmp_path / "program.py"
    path.write_text(text)
    return Ahead(str(path))


def test_it_answers_with_its_last_line(tmp_path):
    with program(tmp_path, ECHO) as ahead:
        assert ahead.last_line("a.step", "größer", seconds=30) == "größer a.step"
    assert ahead._run.returncode == 0


def test_one_that_is_not_asked_is_gone(tmp_path):
    with pytest.raises(KeyError), program(tmp_path, ECHO) as ahead:
        raise KeyError
    assert ahead._run.returncode is not None
    assert ahead._run.stdout.closed


@pytest.mark.parametrize(
    ("text", "said"),
    [("raise ValueError('no such file')", "ValueError: no such file"), ("", "it said nothing"), ("exit(3)", "code 3")],
)
def test_a_bad_end_and_silence_are_refused(tmp_path, text, said):
    with program(tmp_path, text) as ahead, pytest.raises(ProgramError, match=said):
        ahead.last_line("a.step", seconds=30)


def test_one_that_does_not_end_is_ended(tmp_path):
    with program(tmp_path, "import time; time.sleep(60)") as ahead, pytest.raises(subprocess.TimeoutExpired):
        ahead.last_line("a.step", seconds=0.2)
    assert ahead._run.returncode is not None
