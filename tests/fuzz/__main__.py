"""Every reader under the fuzzer, one after the other, and a table of what came of it.

    python -m tests.fuzz                       # ten minutes in all
    python -m tests.fuzz dxf values --seconds 300 --folder /tmp/found

What breaks a reader is kept in the folder. Cure it at its source, and put the file (made smaller by hand where that is
easy) into tests/fuzz/seeds/TARGET: the fast tests try these files, and the next run begins with them.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.oracles import TARGETS
from tests.fuzz.target import ENDLESS

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Run:
    """One target fuzzed: files tried, branches that they reached (none by chance), the text where it broke."""

    target: str
    tried: int
    branches: int
    broken: str


SMALL = "import subprocess, sys; sys.exit(subprocess.run(sys.argv[1:]).returncode)"
"""A process between: Linux gives a new program the peak memory of whoever starts it, and libFuzzer would count that."""


def run(targets: Sequence[str], seconds: float, folder: Path, most: int = ENDLESS) -> list[Run]:
    """Targets fuzzed one after the other, each for so long or for `most` files, in a process of their own; what breaks
    one is kept in `folder`/target."""
    folder.mkdir(parents=True, exist_ok=True)
    fuzzer = [sys.executable, "-m", "tests.fuzz.target", ",".join(targets), str(seconds), str(folder), str(most)]
    command = [sys.executable, "-c", SMALL, *fuzzer]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace", check=False)
    sound = {target for target in targets if f"{target} 0" in done.stdout.splitlines()}
    return [_outcome(target, folder / f"{target}.log", target in sound, done.stderr) for target in targets]


def _outcome(target: str, log: Path, sound: bool, stopped: str) -> Run:
    """What a log says; `stopped` is told where the process ended before it."""
    text = log.read_text(errors="replace") if log.exists() else stopped
    tried = [int(number) for number in re.findall(r"number_of_executed_units: (\d+)", text)]
    branches = [int(number) for number in re.findall(r"cov: (\d+)", text)]
    at = max(text.find("Uncaught"), text.find("Traceback"), text.find("ERROR: libFuzzer"))
    fault = "" if sound else (text[at:] if at >= 0 else text)[-4000:]
    return Run(target, max(tried, default=0), max(branches, default=0), fault)


def main() -> int:
    """1 if anything broke."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="fuzz every reader")
    parser.add_argument("targets", nargs="*", default=[*TARGETS], help=f"of {', '.join(TARGETS)}; all where left out")
    parser.add_argument("--seconds", type=float, default=600, help="for all targets together")
    parser.add_argument("--folder", type=Path, help="where files are kept that break a reader")
    asked = parser.parse_args()
    folder = asked.folder or Path(tempfile.mkdtemp(prefix="dsfab-broken-"))
    print(f"{'target':8} {'tried':>8} {'branches':>8}")
    broken = False
    for target in asked.targets:
        (one,) = run([target], asked.seconds / len(asked.targets), folder)
        broken |= bool(one.broken)
        print(f"{target:8} {one.tried:8,} {one.branches:8,}  {'broken' if one.broken else ''}", flush=True)
        print(one.broken, end="")
    if broken:
        print(f"the files that break a reader are in {folder}")
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
