"""Writing a design as a folder of files: `dsfab build`, the editor's Build and `design.save`."""

import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

from dsfab.core.errors import ExportError
from dsfab.design.design import Design
from dsfab.design.log import Progress, silent
from dsfab.design.output.archive import with_mesh, write_archive
from dsfab.design.output.files import deliverable
from dsfab.export import meanwhile, whole_or_nothing, write
from dsfab.export.writing import DESIGN, MANIFEST, manifest
from dsfab.preset.file import preset_toml
from dsfab.preset.model import Preset
from dsfab.report.design.facts import alternative_facts, facts
from dsfab.report.design.inspection import fabrication_facts, quality_facts
from dsfab.study import design_alternatives, is_searched, require_fit
from dsfab.study.fabrication import FabricationMeasures, fabrication
from dsfab.thickening import SplitBodies, parts

SIZE = (1600, 1200)
"""Pixels of fabrication.png."""

MAY_BE_REFUSED = ("step", "stpz", "brep")
"""Formats with limits of size. A design that misses a limit is written in the other formats, with a note."""


class Saved(NamedTuple):
    """Content of `design.json`, messages about the files, and the reason why a format was refused, or ''."""

    facts: Mapping[str, Any]
    told: tuple[str, ...]
    refused: str


class _Files(NamedTuple):
    """Names of files, lines about them, notes for `design.json`, and reasons of refused formats."""

    names: list[str]
    reports: list[str]
    notes: list[str]
    refused: list[str]


def save(
    design: Design, folder: str | Path, progress: Progress = silent, picture: bool = True, marked: bool = False
) -> Saved:
    """Write every file of a design into `folder`: all of them, or none.

    picture : also write preview.png.
    marked  : also write fabrication.png, which marks the smallest member, gap and wall.
    Raises ExportError for a folder that cannot be written; `Saved.refused` reports a STEP file that is too large.
    Raises PatternError for a design that nobody should build, unless its preset accepts it: see `require_fit`.
    """
    with whole_or_nothing(Path(folder)) as here:
        with _picture(design, here / "preview.png", progress) if picture else nullcontext():
            require_fit(design, measure=False)  # `numbers` measures while OCCT checks
            measured, spent = dict[str, Any](), 0.0

            def numbers() -> None:
                nonlocal spent
                _write_numbers(design, here, Path(folder), preset)
                begin = time.perf_counter()
                measured.update(_measured(design, progress, here / "fabrication.png" if marked else None))
                spent = time.perf_counter() - begin

            start, preset = time.perf_counter(), with_mesh(design.settled, here, Path(folder))
            files = _written(design, here, progress, numbers)
            seconds = {**design.seconds, "export": time.perf_counter() - start - spent}
        told = facts(design, seconds, files.names, files.refused, files.notes) | measured
        told |= {MANIFEST: manifest(here)}
        (here / DESIGN).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    return Saved(told, (*files.reports, *files.notes), "; ".join(files.refused))


def _measured(design: Design, progress: Progress, marks: Path | None) -> dict[str, Any]:
    """Measure fabrication and pattern, after a search also the alternatives; draw `marks`.

    Raises PatternError as `require_fit`.
    """
    progress("fabrication", "measuring members, gaps and walls")
    made = fabrication(design)
    require_fit(design, made)
    measured = {"fabrication": fabrication_facts(made), "pattern": quality_facts(design.quality())}
    if is_searched(design.preset):
        progress("alternatives", "judging a thinner sheet and isotropic stripes of the same mass")
        measured |= alternative_facts(design_alternatives(design))
    if marks:
        _mark(design, made, marks)
    return measured


def ready_to_draw(picture: bool) -> AbstractContextManager[None]:
    """Load the drawing libraries in another process while the design is made, if the caller wants a picture."""
    from dsfab.render.design_picture import picture_ahead

    return picture_ahead() if picture else nullcontext()


@contextmanager
def _picture(design: Design, path: Path, progress: Progress) -> Iterator[None]:
    """Draw the picture while the body of the `with` runs; wait for it at the end."""
    from dsfab.render.design_picture import picture_meanwhile

    with picture_meanwhile(design, path) as finish:
        yield
        if not path.exists():
            progress("preview", f"drawing {path.name}")
        finish()


def _write_numbers(design: Design, here: Path, folder: Path, preset: Preset) -> None:
    write(design.sheet.surface, here / "sheet.ply")
    _keep_mesh(preset, folder, here)
    write_archive(design, here, preset)
    (here / "preset.toml").write_text(preset_toml(preset), encoding="utf-8")


def _keep_mesh(preset: Preset, folder: Path, here: Path) -> None:
    name = getattr(preset.surface, "file", None)
    if name is not None and not name.is_absolute() and (folder / name).is_file() and not (here / name).exists():
        shutil.copy2(folder / name, here / name)


def _written(design: Design, folder: Path, progress: Progress, numbers: Callable[[], None]) -> _Files:
    """Write all formats of the preset; call `numbers` meanwhile.

    Slow formats, which another program checks for seconds, start first.
    """
    asked = design.preset.export.formats
    found, judged = dict[str, _Files](), list[str]()

    def others() -> None:
        for suffix in asked:
            if suffix not in MAY_BE_REFUSED:
                found[suffix] = _one_written(design, folder, suffix, progress)
        numbers()
        if judged:
            progress("export", f"reading back {judged[-1]}")

    with meanwhile(others):
        for suffix in asked:
            if suffix in MAY_BE_REFUSED:
                judged.append(f"{design.preset.name}.{suffix}")
                found[suffix] = _one_written(design, folder, suffix, progress)
        judged.clear()
    every = _Files(*([each for suffix in asked for each in found[suffix][k]] for k in range(len(_Files._fields))))
    return every._replace(notes=said_once({suffix: found[suffix].notes for suffix in asked}))


def said_once(notes: Mapping[str, Sequence[str]]) -> list[str]:
    """Merge notes by format: a note of several files appears once, with their suffixes in front."""
    by_note: dict[str, list[str]] = {}
    for suffix, lines in notes.items():
        for line in lines:
            by_note.setdefault(line, []).append(suffix)
    return [f"{', '.join(of)}: {line}" if len(of) > 1 else line for line, of in by_note.items()]


def _one_written(design: Design, folder: Path, suffix: str, progress: Progress) -> _Files:
    files, name = _Files([], [], [], []), f"{design.preset.name}.{suffix}"
    progress("export", f"writing and reading back {name}")
    try:
        thing, how = deliverable(design, f".{suffix}")
        how |= {"note": files.notes.append, "report": lambda done: files.reports.append(done.told)}
        files.names.append(write(thing, folder / name, **how).name)
    except ExportError as error:
        if suffix not in MAY_BE_REFUSED:
            raise
        files.refused.append(str(error))
        return files
    if suffix == "stl":
        files.names.extend(_parts(design, folder))
    return files


def _parts(design: Design, folder: Path) -> Iterator[str]:
    """Write an STL file for each part of a solid split for a machine; other formats keep all parts in one file."""
    if design.solid.pieces == 1 or not any(isinstance(extra, SplitBodies) for extra in design.preset.thickening.extra):
        return
    for number, part in enumerate(parts(design.solid), 1):
        yield write(part, folder / f"{design.preset.name}_{number}.stl").name


def _mark(design: Design, made: FabricationMeasures, path: Path) -> None:
    from dsfab.render.fabrication import write_workshop_picture

    write_workshop_picture(path, design, made, SIZE)
