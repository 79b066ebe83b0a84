"""A sweep of 60 designs under 40 random kills of its workers and of the scheduler, against an undisturbed one.

    python -m tests.benchmarks.killed_sweeps                # three rounds, with seeds 1, 2 and 3
    python -m tests.benchmarks.killed_sweeps 1 7 --kills 10 # one round, seed 7, ten kills

Each kill is a SIGKILL, of a worker (about three of five) or of `dsfab sweep` itself, at a random moment after workers
have begun; a sweep whose scheduler was killed is started again with the same command. After the last kill the command
is repeated until its exit code is 0. Then every run must be done, and its numbers and all of its files must be those of
the undisturbed sweep, byte for byte; nothing half written may lie around. Ends with 1 if anything differs. Linux only.
"""

import argparse
import hashlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from dsfab.core.errors import DsfabError
from dsfab.study.sweeps.folder import SweepFolder
from tests.presets import DOME_MODES

PHASES = ", ".join(f"{k / 20:.2f}" for k in range(20))
PLAN = f"""
preset = '{DOME_MODES}'
metrics = ["kept_share", "pieces"]
keep = ["preset", "sheet"]
[set]
surface.edge = 0.7
pattern.keep = 0.5
[vary]
diffusion.r = [10.0, 30.0, 100.0]
pattern.major.phase = [{PHASES}]
"""
COMMAND = [sys.executable, "-m", "dsfab.app.cli", "sweep"]
OF_WORKERS = 0.6
"""Share of the kills that hit a worker."""
BETWEEN = (0, 0, 1, 1, 1, 2)
"""How many runs end from one kill to the next: so the kills spread over a sweep on a fast and on a busy machine."""
HURRY = 4
"""By so much sooner a kill comes where the sweep is ahead of its kills."""
RUNS = 60
MISSING = 3
"""Exit code of a sweep with runs that are missing."""


def start(*words: str) -> "subprocess.Popen[bytes]":
    """`dsfab sweep` with these words, silent, with two workers."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"}
    return subprocess.Popen([*COMMAND, *words, "--workers", "2", "--quiet"], env=environment)


def workers(scheduler: int) -> list[int]:
    """The processes that make the runs of a scheduler."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError, IndexError):
            words = (place / "stat").read_text().rpartition(")")[2].split()
            if int(words[1]) == scheduler and words[0] != "Z" and b"spawn_main" in (place / "cmdline").read_bytes():
                found.append(int(place.name))
    return found


def done(folder: Path) -> int:
    """How many runs are done so far."""
    try:
        return sum(row.state == "done" for row in SweepFolder.from_folder(folder).rows())
    except DsfabError:  # it has not begun
        return 0


def disturbed(words: tuple[str, ...], kills: int, longest: float, dice: random.Random) -> tuple[int, int, int]:
    """Run a sweep to its end under kills; how many hit workers, how many the scheduler, and how often it began."""
    hit, ended, starts, folder = 0, 0, 1, Path(words[-1])
    scheduler = start(*words)
    while hit + ended < kills:
        late = done(folder) * kills > RUNS * (hit + ended)  # or the sweep would end before its kills
        wanted = done(folder) + (0 if late else dice.choice(BETWEEN))
        while scheduler.poll() is None and not (workers(scheduler.pid) and done(folder) >= wanted):
            time.sleep(0.05)
        time.sleep(dice.uniform(0, longest / HURRY if late else longest))
        code = scheduler.poll()
        if code == 0:
            raise SystemExit(f"the sweep had ended after {hit + ended} kills; take more designs, or larger ones")
        if code is None and dice.random() < OF_WORKERS:
            if there := workers(scheduler.pid):
                with suppress(ProcessLookupError):
                    os.kill(dice.choice(there), signal.SIGKILL)
                hit += 1
            continue
        if code is None:
            scheduler.kill()
            ended += 1
        elif code != MISSING:
            raise SystemExit(f"dsfab sweep ended with {code}")
        scheduler.wait()
        scheduler, starts = start(*words), starts + 1
    while (code := scheduler.wait()) != 0:
        if code != MISSING:
            raise SystemExit(f"dsfab sweep ended with {code}")
        scheduler, starts = start(*words), starts + 1
    return hit, ended, starts


def content(folder: Path) -> dict[str, object]:
    """What a sweep has found, run by run, and the hashes of the files that were kept of it; not the seconds."""
    rows = SweepFolder.from_folder(folder).rows()
    found: dict[str, object] = {
        f"run {row.number}": (row.state, dict(row.changes), dict(row.metrics), row.error, row.files) for row in rows
    }
    kept = [folder / name for row in rows for name in row.files]
    found |= {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in kept}
    found["half written"] = sorted(path.name for path in folder.rglob(".partial-*"))
    return found


def main() -> int:
    """Compare; the number of rounds and the first seed are arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rounds", nargs="?", type=int, default=3)
    parser.add_argument("seed", nargs="?", type=int, default=1)
    parser.add_argument("--kills", type=int, default=40)
    asked = parser.parse_args()
    different = 0
    with tempfile.TemporaryDirectory(prefix="dsfab-") as home:
        plan = Path(home) / "plan.toml"
        plan.write_text(PLAN)
        if start(str(plan), "-o", f"{home}/calm").wait():
            raise SystemExit("the undisturbed sweep failed")
        calm = content(Path(home) / "calm")
        longest = sum(row.seconds or 0.0 for row in SweepFolder.from_folder(Path(home) / "calm").rows()) / RUNS
        for seed in range(asked.seed, asked.seed + asked.rounds):
            folder = Path(home) / f"seed-{seed}"
            begun = time.monotonic()
            hit, ended, starts = disturbed((str(plan), "-o", str(folder)), asked.kills, longest, random.Random(seed))
            found = content(folder)
            off = [key for key in calm.keys() | found.keys() if calm.get(key) != found.get(key)]
            different += bool(off)
            again = sum(row.tries - 1 for row in SweepFolder.from_folder(folder).rows())
            print(
                f"seed {seed}: {hit} workers and {ended} schedulers killed, started {starts} times, {again} runs made "
                f"again, {time.monotonic() - begun:.0f} s; {'equal' if not off else f'DIFFERENT: {sorted(off)}'}",
                flush=True,
            )
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main())
