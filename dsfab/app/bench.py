"""The command `dsfab bench`: seconds and peak memory of presets."""

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

from dsfab.app.options import UNCHANGED, Source, Switch
from dsfab.app.terminal import Reporter, print_result
from dsfab.core.errors import DsfabError
from dsfab.core.messages import table
from dsfab.core.sparse import peak_memory

TIMING_COLUMNS = (
    *("membrane", "bending", "statics", "stress", "diffusion", "modes"),
    *("stripes", "slicing", "thickening", "export", "total"),
)
"""Columns of the table, in seconds: first the stages in the paper's Table 2, then further stages of dsfab.
`stripes` is the time for the directions, densities and phases of evenly spaced stripes."""

SCALING = (10_000, 40_000, 100_000)  # Vertex counts of the meshes for `--scaling`.
SCALING_STATICS = (*SCALING, 250_000, 500_000)  # Vertex counts for `--scaling` with `--stages statics`.

STATICS_COLUMNS = ("assembly", "factor", "solve", "stress", "total", "cpu")
"""Columns of the table for `--stages statics`, in seconds. `solve` excludes the factorisation.
`cpu` is the processor time of all parts together; it allows comparisons on a busy machine."""


@Parameter(name="*")
@dataclass(frozen=True)
class Workload:
    """Options of a benchmark."""

    scaling: Annotated[
        bool,
        Switch(
            help="Run each preset on meshes of 10, 40 and 100 thousand vertices, made by changing surface.edge. With "
            "--stages statics, also run 250 and 500 thousand vertices."
        ),
    ] = False
    vertices: Annotated[str | None, Parameter(help="Vertex counts for --scaling, such as 10000,40000.")] = None
    stages: Annotated[
        Literal["all", "statics"],
        Parameter(help="Measure the time of every stage, or only of the parts of the statics."),
    ] = "all"

    def sizes(self) -> tuple[int, ...]:
        """Return the vertex counts of the meshes to time. An empty result means the preset's own mesh.
        Raises DsfabError if `vertices` is not a list of integers from 100 up."""
        if self.vertices is None:
            return (SCALING_STATICS if self.stages == "statics" else SCALING) if self.scaling else ()
        try:
            counts = tuple(int(number) for number in self.vertices.split(","))
        except ValueError:
            counts = ()
        if not counts or min(counts) < 100:
            raise DsfabError(
                f"--vertices {self.vertices!r} is not a list of numbers from 100 up; write for example 10000,40000"
            )
        return counts


def bench(
    *presets: str,
    source: Source = UNCHANGED,
    repeat: Annotated[
        int, Parameter(name=["--repeat", "-n"], help="Runs per preset; the table shows the median time of these runs.")
    ] = 3,
    work: Workload = Workload(),
    preview: Annotated[
        bool,
        Switch(
            help="Measure the previewer in place of presets: pictures per second, without stripes and with stripes."
        ),
    ] = False,
    step: Annotated[bool, Switch(help="Include the time to write STEP in the column of the export.")] = False,
    json_: Annotated[bool, Switch(name="--json", help="Print a JSON list instead of a table.")] = False,
) -> int:
    """Measure time and peak memory of each stage of presets, as in Table 2 of Diffusion Structures (2020)."""
    if preview:
        return _bench_preview(presets, json_)
    sizes = work.sizes()
    results = []
    jobs = [(name, overrides) for name in presets or ("sphere",) for overrides in _edge_overrides(name, source, sizes)]
    with Reporter(quiet=json_) as reporter:
        for name, overrides in jobs:
            reporter("bench", f"{' '.join((name, *overrides))}, {repeat} {'run' if repeat == 1 else 'runs'}")
            runs = [
                _in_own_process(name, source.with_overrides(*overrides), step, work.stages)
                for _ in range(max(1, repeat))
            ]
            results.append(_median(runs))
    print_result(json.dumps(results, indent=2) if json_ else _table(results))
    return 0


def _bench_preview(presets: Sequence[str], as_json: bool) -> int:
    from dsfab.app.bench_preview import PIXELS, SIZES, frame_rates, rates_table

    if presets:
        raise DsfabError(f"bench --preview draws a built-in test surface and takes no preset; leave out {presets[0]!r}")
    reporter = Reporter(quiet=as_json)
    reporter("bench", f"drawing {', '.join(f'{n:,}' for n in SIZES)} triangles at {PIXELS[0]} x {PIXELS[1]}")
    with reporter:
        rows = frame_rates()
    print_result(json.dumps(rows, indent=2) if as_json else rates_table(rows))
    return 0


def _edge_overrides(name: str, source: Source, vertex_counts: tuple[int, ...]) -> list[tuple[str, ...]]:
    surface = source.read_preset(name).surface  # a mistake in any preset raises an error before the first run
    if not vertex_counts:
        return [()]
    edge = getattr(surface, "edge", None)
    if not edge:
        raise DsfabError(
            f"preset {name} has no surface.edge for --scaling; use a preset with a shape, or add --set surface.edge=0.3"
        )
    current_count = surface.build().n  # the number of vertices grows with 1 / edge^2
    return [(f"surface.edge={edge * (current_count / n) ** 0.5:.6g}",) for n in vertex_counts]


def measure(name: str, source: Source, step: bool) -> dict[str, Any]:
    """Build a preset; return seconds of each stage, peak memory (MiB) and mesh size, by name."""
    from dsfab.design import run
    from dsfab.design.output.files import deliverable
    from dsfab.export import write

    start = time.perf_counter()
    design = run(source.read_preset(name))
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        for suffix in design.preset.export.formats:
            if step or suffix != "step":
                content, options = deliverable(design, f".{suffix}")
                write(content, Path(folder) / f"bench.{suffix}", **options)
        export = time.perf_counter() - begin
    seconds = {
        **dict.fromkeys(TIMING_COLUMNS),
        **design.seconds,
        "export": export,
        "total": time.perf_counter() - start,
    }
    return {
        "preset": design.preset.name,
        "vertices": design.surface.n,
        "triangles": design.surface.m,
        **{row: seconds[row] for row in TIMING_COLUMNS},
        "peak_mb": peak_memory() / 2**20,
        "compliance": design.statics.equilibrium.compliance,
    }


def measure_statics(name: str, source: Source) -> dict[str, Any]:
    """Solve the statics of a preset; return seconds of each part, peak memory (MiB) and mesh size, by name."""
    from dsfab.design import Log, statics_step, surface_step

    preset, log = source.read_preset(name), Log(None)
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
    completed = subprocess.run(
        [sys.executable, "-m", "dsfab.app.bench", request], capture_output=True, text=True, check=False
    )
    if completed.returncode:
        raise DsfabError(
            (completed.stderr.strip() or f"the process that ran preset {name} was killed").splitlines()[-1]
        )
    result: dict[str, Any] = json.loads(completed.stdout)
    return result


def _median(runs: list[dict[str, Any]]) -> dict[str, Any]:
    middle = dict(runs[0])
    for key in (*TIMING_COLUMNS, *STATICS_COLUMNS, "peak_mb"):
        if runs[0].get(key) is not None:
            middle[key] = round(statistics.median(run[key] for run in runs), 4)
    return middle


def _table(results: list[dict[str, Any]]) -> str:
    shown = STATICS_COLUMNS if "assembly" in results[0] else TIMING_COLUMNS
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
