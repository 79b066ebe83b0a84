"""The command `dsfab bench`: seconds and peak memory of presets, each run in a process of its own."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Source
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import DsfabError
from dsfab.core.messages import table
from dsfab.core.sparse import peak_memory

ROWS = (
    *("membrane", "bending", "statics", "stress", "diffusion", "modes"),
    *("stripes", "slicing", "thickening", "export", "total"),
)
"""Columns of the table, seconds: those of the paper's Table 2, then further stages.

`stripes` are evenly spaced: directions, densities and phases, which replace the modes.
"""

SCALING = (10_000, 40_000, 100_000)
"""Vertices of the surfaces of `--scaling`."""

SCALING_STATICS = (*SCALING, 250_000, 500_000)
"""Vertices of `--scaling` with `--stages statics`."""

STATICS_ROWS = ("assembly", "factor", "solve", "stress", "total", "cpu")
"""Columns of `--stages statics`, seconds.

`solve` is the solution without the factorisation. `cpu` is processor time for `total`, to compare on a busy machine.
"""


@Parameter(name="*")
@dataclass(frozen=True)
class Workload:
    """Stages to time, and numbers of vertices."""

    scaling: Annotated[
        bool,
        Parameter(
            negative=(),
            help="Run each preset with 10, 40 and 100 thousand vertices, by changing surface.edge; "
            "with --stages statics also 250 and 500 thousand.",
        ),
    ] = False
    vertices: Annotated[str | None, Parameter(help="Other numbers for --scaling, such as 10000,40000.")] = None
    stages: Annotated[
        Literal["all", "statics"], Parameter(help="Time every stage, or the parts of the statics alone.")
    ] = "all"

    def sizes(self) -> tuple[int, ...]:
        """Return the numbers of vertices; empty for the preset's own. Raises DsfabError for a text that is no list."""
        if self.vertices is None:
            return (SCALING_STATICS if self.stages == "statics" else SCALING) if self.scaling else ()
        try:
            wanted = tuple(int(number) for number in self.vertices.split(","))
        except ValueError:
            wanted = ()
        if not wanted or min(wanted) < 100:
            raise DsfabError(
                f"--vertices {self.vertices!r} is no list of numbers from 100 up; write for example 10000,40000"
            )
        return wanted


def bench(
    *presets: str,
    source: Source = UNCHANGED,
    repeat: Annotated[int, Parameter(name=["--repeat", "-n"], help="Runs per preset; the table shows medians.")] = 3,
    work: Workload = Workload(),
    preview: Annotated[
        bool, Parameter(negative=(), help="Time the previewer instead: pictures a second, plain and with stripes.")
    ] = False,
    step: Annotated[bool, Parameter(negative=(), help="Include STEP in the export column.")] = False,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print a JSON list instead of a table.")] = False,
) -> int:
    """Time presets stage by stage, as the paper's Table 2 does, with peak memory.

    Export writes and reads back the preset's formats, without STEP unless --step is set.
    """
    if preview:
        return _previewed(presets, json_)
    sizes = work.sizes()
    results = []
    jobs = [(name, more) for name in presets or ("sphere",) for more in _edges(name, source, sizes)]
    with Reporter(quiet=json_) as reporter:
        for name, more in jobs:
            reporter("bench", f"{' '.join((name, *more))}, {repeat} {'run' if repeat == 1 else 'runs'}")
            runs = [_in_own_process(name, source.also(*more), step, work.stages) for _ in range(max(1, repeat))]
            results.append(_median(runs))
    out(json.dumps(results, indent=2) if json_ else _table(results))
    return 0


def _previewed(presets: Sequence[str], as_json: bool) -> int:
    from dsfab.app.bench_preview import PIXELS, SIZES, frame_rates, rates_table

    if presets:
        raise DsfabError(f"bench --preview draws a surface of its own, leave {presets[0]!r} away")
    reporter = Reporter(quiet=as_json)
    reporter("bench", f"drawing {', '.join(f'{n:,}' for n in SIZES)} triangles at {PIXELS[0]} x {PIXELS[1]}")
    with reporter:
        rows = frame_rates()
    out(json.dumps(rows, indent=2) if as_json else rates_table(rows))
    return 0


def _edges(name: str, source: Source, wanted: tuple[int, ...]) -> list[tuple[str, ...]]:
    """Overrides for shapes with about these numbers of vertices, which grow with 1 / edge^2.

    The preset is read in any case, so that a mistake in a later preset is found before the first run.
    """
    surface = source.read(name).surface
    if not wanted:
        return [()]
    edge = getattr(surface, "edge", None)
    if not edge:
        raise DsfabError(
            f"--scaling changes surface.edge, which {name} does not have; choose a preset with a shape, or give a mesh "
            "one (--set surface.edge=0.3)"
        )
    now = surface.build().n
    return [(f"surface.edge={edge * (now / n) ** 0.5:.6g}",) for n in wanted]


def measure(name: str, source: Source, step: bool) -> dict[str, Any]:
    """Return seconds per row, peak memory in MiB, and sizes of one run in this process."""
    from dsfab.design import run
    from dsfab.design.output.files import deliverable
    from dsfab.export import write

    start = time.perf_counter()
    design = run(source.read(name))
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        for suffix in design.preset.export.formats:
            if step or suffix != "step":
                thing, how = deliverable(design, f".{suffix}")
                write(thing, Path(folder) / f"bench.{suffix}", **how)
        export = time.perf_counter() - begin
    seconds = {**dict.fromkeys(ROWS), **design.seconds, "export": export, "total": time.perf_counter() - start}
    return {
        "preset": design.preset.name,
        "vertices": design.surface.n,
        "triangles": design.surface.m,
        **{row: seconds[row] for row in ROWS},
        "peak_mb": peak_memory() / 2**20,
        "compliance": design.statics.equilibrium.compliance,
    }


def measure_statics(name: str, source: Source) -> dict[str, Any]:
    """Return seconds per part, peak memory in MiB, and sizes of the statics alone, in this process."""
    from dsfab.design import Log, statics_step, surface_step

    preset, log = source.read(name), Log(None)
    surface = surface_step(preset, log)
    begin = time.process_time()
    result = statics_step(preset, surface, log)
    cpu = time.process_time() - begin
    took = log.seconds
    assembly = took["membrane"] + took.get("bending", 0.0)
    return {
        "preset": preset.name,
        "vertices": surface.n,
        "triangles": surface.m,
        "assembly": assembly,
        "factor": took["factor"],
        "solve": took["statics"] - took["factor"],
        "stress": took["stress"],
        "total": assembly + took["statics"] + took["stress"],
        "cpu": cpu,
        "peak_mb": peak_memory() / 2**20,
        "compliance": result.equilibrium.compliance,
    }


def _in_own_process(name: str, source: Source, step: bool, stages: str) -> dict[str, Any]:
    mesh = str(source.mesh) if source.mesh else None
    request = json.dumps([name, source.set_, mesh, source.unit, step, stages])
    done = subprocess.run(
        [sys.executable, "-m", "dsfab.app.bench", request], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise DsfabError(
            done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"the run of {name} was killed"
        )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def _median(runs: list[dict[str, Any]]) -> dict[str, Any]:
    middle = dict(runs[0])
    for key in (*ROWS, *STATICS_ROWS, "peak_mb"):
        if runs[0].get(key) is not None:
            middle[key] = round(statistics.median(run[key] for run in runs), 4)
    return middle


def _table(results: list[dict[str, Any]]) -> str:
    shown = STATICS_ROWS if "assembly" in results[0] else ROWS
    head = ("preset", "|V|", "|T|", *(row.capitalize() for row in shown), "Peak MiB", "Compliance J")
    rows = [
        (
            r["preset"],
            f"{r['vertices']:,}",
            f"{r['triangles']:,}",
            *("n/a" if r[row] is None else f"{r[row]:.3f}" for row in shown),
            f"{r['peak_mb']:.0f}",
            f"{r['compliance']:.4g}",
        )
        for r in results
    ]
    return table(head, rows)


if __name__ == "__main__":
    _name, _changes, _mesh, _unit, _step, _stages = json.loads(sys.argv[1])
    _given = (_name, Source(tuple(_changes), Path(_mesh) if _mesh else None, _unit))
    try:
        _result = measure(*_given, _step) if _stages == "all" else measure_statics(*_given)
        sys.stdout.write(json.dumps(_result))
    except DsfabError as _error:
        sys.exit(str(_error))
