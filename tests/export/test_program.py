"""Programs of ours in processes of their own, started before they are asked."""

import subprocess

import pytest

from dsfab.export import subprocesses as programs
from dsfab.export.subprocesses import PreparedProgram, ProgramError, last_line, work_while_waiting

ECHO = "import json, sys\nprint('loaded')\nprint(*reversed(json.loads(sys.stdin.readline())))\n"


def program(tmp_path, text):
    path = tmp_path / "program.py"
    path.write_text(text)
    return PreparedProgram(str(path))


def test_a_program_answers_with_its_last_line(tmp_path):
    with program(tmp_path, ECHO) as ahead:
        assert ahead.last_line("a.step", "größer", seconds=30) == "größer a.step"
    assert ahead.process.returncode == 0


def test_an_unused_program_is_ended(tmp_path):
    with pytest.raises(KeyError), program(tmp_path, ECHO) as ahead:
        raise KeyError
    assert ahead.process.returncode is not None
    assert ahead.process.stdout.closed


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("raise ValueError('no such file')", "ValueError: no such file"),
        ("", "the program printed nothing"),
        ("exit(3)", "code 3"),
    ],
)
def test_a_bad_end_and_silence_are_refused(tmp_path, text, said):
    with program(tmp_path, text) as ahead, pytest.raises(ProgramError, match=said):
        ahead.last_line("a.step", seconds=30)


def test_one_that_does_not_end_is_ended(tmp_path):
    with program(tmp_path, "import time; time.sleep(60)") as ahead, pytest.raises(subprocess.TimeoutExpired):
        ahead.last_line("a.step", seconds=0.02)
    assert ahead.process.returncode is not None


WAITS = "import json, pathlib, sys, time\n" + (
    "path = pathlib.Path(json.loads(sys.stdin.readline())[0])\n"
    "while not path.exists(): time.sleep(0.01)\n"
    "print('seen')\n"
)


def test_background_work_is_done_during_the_wait_for_a_program(tmp_path):
    """The program ends only once that is done, and says so; it is done once."""
    path, done = tmp_path / "done", []
    with work_while_waiting(lambda: done.append(path.touch())), program(tmp_path, WAITS) as ahead:
        assert not done
        assert ahead.last_line(str(path), seconds=30) == "seen"
        (tmp_path / "b.py").write_text("print('b')")
        assert last_line(str(tmp_path / "b.py"), seconds=30) == "b"
    assert len(done) == 1


def test_a_finished_program_answers_even_after_its_time_limit(tmp_path):
    with program(tmp_path, ECHO) as ahead, work_while_waiting(ahead.process.wait):
        assert ahead.last_line("a", seconds=0.001) == "a"


def test_background_work_is_done_at_the_end_without_a_wait():
    done = []
    with work_while_waiting(lambda: done.append(1)):
        assert not done
    assert done == [1]


def test_the_program_answers_before_an_error_of_background_work_is_raised(tmp_path):
    def fail():
        raise ValueError("no picture")

    with pytest.raises(ValueError, match="no picture"), work_while_waiting(fail), program(tmp_path, ECHO) as ahead:
        assert ahead.last_line("a", seconds=30) == "a"
    with pytest.raises(KeyError), work_while_waiting(fail):
        raise KeyError


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(programs.resource, "prlimit"), reason="this system does not count a process's seconds")
def test_a_program_may_take_seconds_of_the_processor_and_not_of_the_clock(tmp_path):
    """One that waits longer than it may answers, and one that works longer is ended."""
    (tmp_path / "waits.py").write_text("import time; time.sleep(2); print('done')")
    (tmp_path / "works.py").write_text("while True: pass")
    assert last_line(str(tmp_path / "waits.py"), seconds=1) == "done"
    with pytest.raises(subprocess.TimeoutExpired) as ended:
        last_line(str(tmp_path / "works.py"), seconds=1)
    assert ended.value.timeout == 1  # the clock's is longer


DRAWS = "import json, pathlib, sys, time\n" + (
    "first, second = map(pathlib.Path, json.loads(sys.stdin.readline()))\n"
    "first.touch()\n"
    "for _ in range(3000):\n"
    "    if second.exists(): print('seen'); break\n"
    "    time.sleep(0.01)\n"
)


def test_work_on_the_output_of_a_program_begins_while_the_program_runs(tmp_path):
    """It ends only once that is done; what else waits is done before."""
    first, second, order = tmp_path / "first", tmp_path / "second", []
    with work_while_waiting(lambda: order.append("waiting")), program(tmp_path, DRAWS) as ahead:
        ahead.send(str(first), str(second))
        assert ahead.answer_with_work(first.exists, lambda: order.append(second.touch() or "work"), 30) == "seen"
    assert order == ["waiting", "work"]


def test_work_is_skipped_if_the_program_ends_without_its_input(tmp_path):
    with program(tmp_path, "exit(3)") as ahead, pytest.raises(ProgramError, match="code 3"):
        ahead.answer_with_work(lambda: False, lambda: 1 / 0, 30)


def test_a_mistake_in_the_work_ends_the_program(tmp_path):
    first = tmp_path / "first"
    with program(tmp_path, DRAWS) as ahead:
        ahead.send(str(first), str(tmp_path / "never"))
        with pytest.raises(ZeroDivisionError):
            ahead.answer_with_work(first.exists, lambda: 1 / 0, 30)
    assert ahead.process.returncode
