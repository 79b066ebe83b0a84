"""What becomes of STEP files in CAD: `python -m tests.benchmarks.step_table [NAME...] [--step WAY] [-s SECONDS]`.

A name is a preset, a mesh file (in DSFAB_MESHES or anywhere; its preset is proposed), or a sheet of `OWN`. Each design
has a process of its own, which may take so many seconds of the processor (200 unless told), and as many for what OCCT
does with the file. A row has the way taken, faces, megabytes, seconds (of the file; of what OCCT did), half-space cuts
valid of 8, what their halves miss at most each by itself, a box cut out, section closed, written again, fillets, error
of the plain rule for volumes, of the box, largest distance from the design (of what is allowed there), what `dsfab
check` says, and how the file was made.
"""

import argparse
import ctypes
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import dsfab
from dsfab.core.errors import DsfabError
from dsfab.export.cad.step.worker import program
from dsfab.preset.file import with_overrides
from dsfab.study.file_check import check_file
from tests.benchmarks.step_sheets import OWN

DESIGNS = (
    *("dome", "saddle", "snow_vault", "tower", "pavilion", "globe", "sphere", "boys_surface", "hypar.obj", "torus.obj"),
    *("bob.obj", "spot.obj", "blub.obj", "Botanic.obj", "roof_with_opening.obj", "folded", "helicoid", "moebius"),
    *("cylinder", "catenoid", "schwarz", "enneper", "genus_two", "terrain"),
)
COLUMNS = "way faces MB file_s use_s cuts alone box section again fillets plain bounds off check"


def design(name: str, step: str, folder: Path) -> "dsfab.Design":
    """The design of a name: one of `OWN`, a mesh, or a preset."""
    path = next((p for p in (Path(name), Path(os.environ.get("DSFAB_MESHES", ".")) / name) if p.is_file()), None)
    if name in OWN:
        V, F = OWN[name]()
        path = folder / f"{name}.obj"
        lines = [*("v {:.9g} {:.9g} {:.9g}".format(*v) for v in V), *("f {} {} {}".format(*(f + 1)) for f in F)]
        path.write_text("\n".join(lines) + "\n")
    is_mesh = path is not None and path.suffix != ".toml"
    preset = dsfab.preset_for(path) if is_mesh else dsfab.load_preset(name)
    return dsfab.run(with_overrides(preset, {"export.step": step}))


def row(name: str, step: str, seconds: float) -> str:
    """A line of the table."""
    with tempfile.TemporaryDirectory() as folder:
        made, path, said = design(name, step, Path(folder)), Path(folder) / "a.step", list[str]()
        begin = os.times()
        try:
            made.write(path, note=said.append)
        except DsfabError as error:
            return f"none: {str(error)[:600]}"
        took = sum(os.times()[:4]) - sum(begin[:4])
        found = used(path, seconds)
        checked = check_file(path, made, solid=False)
        apart, size = checked.distance, path.stat().st_size / 1e6
        assert apart is not None
        failed = ",".join(f.name for f in checked.findings if f.verdict == "fail") or "pass"
        off = f"{1e3 * (apart.beyond + apart.allowed):.2g}/{1e3 * apart.allowed:.2g}"
        way, faces = said[0].split()[2].rstrip(",:"), path.read_bytes().count(b"=ADVANCED_FACE(")
        return f"{way} {faces} {size:.2f} {took:.0f} {words(found, made)} {off} {failed} | {said[0][:200]}"


def used(path: Path, seconds: float) -> dict[str, object]:
    """What OCCT says of the use of a file; nothing where it takes longer than it may."""
    command = [sys.executable, "-P", program.__file__, "use", str(path), "8", "all"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=limit(seconds))
    return dict(json.loads(done.stdout)) if done.stdout else {}


def words(said: dict[str, object], made: "dsfab.Design") -> str:
    """From the seconds of OCCT to the error of the box."""
    if not said:
        return "- - - - - - - - -"
    box = np.array(said["box"]).reshape(2, 3) / 1e3
    bounds = np.abs(box - made.solid.box).max() / np.linalg.norm(np.ptp(made.solid.box, axis=0))
    plain = said["plain"] / said["volume"] - 1  # type: ignore[operator]
    yes = " ".join("yes" if said[k] else "no" for k in ("boxed", "closed", "again"))
    cuts = f"{said['seconds']:.0f} {said['sound']} {said['alone']:.0e}"
    return f"{cuts} {yes} {said['fillets']}/{said['sharp']} {plain:+.0e} {bounds:.0e}"


def limit(seconds: float) -> Callable[[], None]:
    """What gives a process so many seconds of the processor, and on Linux ends it with the one that started it."""

    def begin() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
        if sys.platform == "linux":
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG

    return begin


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("names", nargs="*", default=DESIGNS)
    asked.add_argument("--step", default="auto")
    asked.add_argument("-s", "--seconds", type=float, default=200)
    asked.add_argument("--alone", action="store_true", help="this process makes the row")
    given = asked.parse_args()
    if given.alone:
        print(row(given.names[0], given.step, given.seconds))
        sys.exit()
    print("design", COLUMNS, "| how")
    for one in given.names:
        begin = time.monotonic()
        command = [
            sys.executable,
            "-m",
            "tests.benchmarks.step_table",
            one,
            "--step",
            given.step,
            "-s",
            str(given.seconds),
            "--alone",
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=limit(given.seconds))
        text = done.stdout.strip() or f"ended: {(done.stderr.strip().splitlines() or [str(done.returncode)])[-1]}"
        print(one, text, f"({time.monotonic() - begin:.0f} s on the clock)", flush=True)
