"""What a worker does: one run, from its changes to numbers and files, all of which travel back as data."""

import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dsfab.delivery.files import step_options
from dsfab.errors import DsfabError
from dsfab.pipeline import Design, draft
from dsfab.preset import Preset
from dsfab.preset_file import overridden, preset_from, preset_toml
from dsfab.preset_surface import FileSurface
from dsfab.sparse import peak_memory
from dsfab.study.sweeps.metrics import metric_value

Drawer = Callable[[Design], bytes]
"""Draws a design as the bytes of a PNG file; it is handed from `dsfab.app`, which alone can draw."""


@dataclass(frozen=True)
class Job:
    """What all runs of a sweep have in common, as plain data: it travels to every worker.

    token   : tells jobs apart. preset : the base preset as nested tables. metrics, keep, formats : see `Plan`.
    draw    : draws a picture, or None. mesh : content of the preset's mesh file where workers cannot read it.
    """

    token: str
    preset: Mapping[str, Any]
    metrics: tuple[str, ...]
    keep: tuple[str, ...] = ()
    formats: tuple[str, ...] = ()
    draw: Drawer | None = None
    mesh: bytes | None = None


@dataclass(frozen=True)
class Outcome:
    """How a run ended: what was measured, why it failed ('' if it did not) and the log of that, files by name.

    seconds : of the worker. peak : largest memory of its process so far, bytes (0 where the system does not say).
    killed  : whether its worker was, each time: then the error says nothing of the design.
    """

    number: int
    metrics: Mapping[str, float] = field(default_factory=dict)
    error: str = ""
    log: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0
    peak: int = 0
    killed: bool = False


_alone = threading.Lock()
"""One run at a time in a process: neither the sparse solver nor the graphics may be used by two threads at once."""

_memory = threading.local()
"""Of each thread that works: the job, its base preset, and the last design that was made."""


def execute(job: Job, number: int, changes: Mapping[str, Any]) -> Outcome:
    """Make one run. Never raises: a refusal, or a mistake of ours, is its outcome; what was measured before is kept."""
    with _alone:
        return _executed(job, number, changes)


def _executed(job: Job, number: int, changes: Mapping[str, Any]) -> Outcome:
    start, metrics, files = time.perf_counter(), dict[str, float](), dict[str, bytes]()
    doing, wrong, log = "the design", list[str](), ""
    try:
        made = _made(job, changes)
        for name in job.metrics:
            doing = name
            try:
                metrics[name] = metric_value(name, made)
            except DsfabError as refusal:  # a sheet that carries nothing still has an area and a picture
                wrong.append(str(refusal))
        doing = "its files"
        _keep(job, made, files)
    except DsfabError as refusal:
        wrong.append(str(refusal))
    except Exception as mistake:  # one run must not end a thousand
        wrong.append(f"{doing}: {type(mistake).__name__}: {mistake}")
        log = traceback.format_exc()
    error = "; ".join(dict.fromkeys(wrong))
    return Outcome(number, metrics, error, log, files, time.perf_counter() - start, peak_memory())


def _made(job: Job, changes: Mapping[str, Any]) -> Design:
    """The design, with the stages of the last one of this worker where they are the same."""
    if getattr(_memory, "token", None) != job.token:
        _memory.token, _memory.base, _memory.last = job.token, _base(job), None
    preset = overridden(_memory.base, changes)
    _memory.last = draft(preset, old=_memory.last)
    return _memory.last  # type: ignore[no-any-return]


def _base(job: Job) -> Preset:
    """The base preset; its mesh file is written down here where it came along."""
    values = dict(job.preset)
    if job.mesh is not None:
        from dsfab.export import temporary_folder

        _memory.folder = temporary_folder("dsfab-sweep")
        mesh = Path(_memory.folder.name) / Path(values["surface"]["file"]).name
        mesh.write_bytes(job.mesh)
        values["surface"] = {**values["surface"], "file": str(mesh)}
    return preset_from(values)


def _at_home(job: Job, preset: Preset) -> Preset:
    """The preset with the mesh file's place on the machine that asked, not on this one."""
    return preset if job.mesh is None else overridden(preset, {"surface.file": job.preset["surface"]["file"]})


def mesh_of(preset: Preset) -> bytes | None:
    """The content of a preset's mesh file."""
    return preset.surface.file.read_bytes() if isinstance(preset.surface, FileSurface) else None


def _keep(job: Job, made: Design, files: dict[str, bytes]) -> None:
    """Fill `files` with what is kept of a run."""
    from dsfab.export import write

    if "preset" in job.keep:
        files["preset.toml"] = preset_toml(_at_home(job, made.preset)).encode()
    if "picture" in job.keep and job.draw is not None:
        files["picture.png"] = job.draw(made)
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        if "sheet" in job.keep:
            files["sheet.ply"] = write(made.sheet.surface, Path(folder) / "sheet.ply").read_bytes()
        if "solid" in job.keep:
            name = made.preset.name
            for suffix in job.formats:
                path = Path(folder) / f"{name}.{suffix}"
                write(made.solid, path, step=step_options(made.preset.export))
                files[f"{name}.{suffix}"] = path.read_bytes()
