"""The command line, run in this process."""

from dsfab.app.cli import main


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def refused(capsys, *arguments: str, code: int = 1) -> str:
    """The one line of a refusal, after checking that it is one."""
    got, out, err = run(capsys, *arguments)
    assert got == code, err
    last = err.strip().splitlines()[-1]
    assert last.startswith("dsfab: ")
    assert "Traceback" not in err + out
    return last
