"""Writing a design as a folder of files, for `dsfab build`, the editor and `design.save`."""

import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from operator import add
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from dsfab.core.errors import ExportError
from dsfab.design.design import Design
from dsfab.design.output.archive import with_mesh, write_archive
from dsfab.design.output.files import deliverable
from dsfab.export import atomic_folder, work_while_waiting, write
from dsfab.export.writing import DESIGN, MANIFEST, manifest
from dsfab.preset.file import preset_toml
from dsfab.preset.model import Preset
from dsfab.report.design.facts import alternative_facts, design_facts
from dsfab.report.design.inspection import fabrication_facts, quality_facts
from dsfab.results import Progress, silent
from dsfab.study import design_alternatives, is_searched, require_fit
from dsfab.study.carrying import Carrying, carrying
from dsfab.study.fabrication import fabrication
from dsfab.thickening import SplitBodies, parts

if TYPE_CHECKING:
    from dsfab.render.design_picture import Pictures

MARKED_PICTURE = (1600, 1200)  # Width and height of fabrication.png, pixels.
MAY_BE_REFUSED = ("step", "stpz", "brep")
"""Formats with a limit on the file size. If a file would be larger, dsfab reports this and writes other formats."""


class SavedDesign(NamedTuple):
    """Result of `save`. facts : content of `design.json`.    messages : texts on the written files.
    refused : reasons why formats were not written, or ''."""

    facts: Mapping[str, Any]
    messages: tuple[str, ...]
    refused: str


class _WrittenFiles(NamedTuple):
    """Names and reports of written files, notes for `design.json`, and reasons for refused formats."""

    names: list[str]
    reports: list[str]
    notes: list[str]
    refused: list[str]


class Announcements(NamedTuple):
    """Functions that `save` calls. `verdict` receives the verdict; `picture` receives the folder of the pictures."""

    verdict: Callable[[Carrying], None] = lambda _: None
    picture: Callable[[Path], None] = lambda _: None


SILENT = Announcements()


def save(
    design: Design,
    folder: str | Path,
    progress: Progress = silent,
    picture: bool = True,
    marked: bool = False,
    announce: Announcements = SILENT,
) -> SavedDesign:
    """Write the files of a design into `folder`. Either all pictures and quick formats appear, or none of them.
    STEP and BREP files follow up to a minute later. announce : functions that `save` calls.
    picture : True to write preview.png for clients, and analysis.png with the loads and the utilisation.
    marked  : True to write fabrication.png, which marks the smallest member, gap and wall.
    Raises ExportError for a folder that cannot be written. `SavedDesign.refused` reports a STEP file that is too large.
    Raises PatternError for a design with serious faults, unless its preset accepts the faults: see `require_fit`."""
    start, suffixes = time.perf_counter(), design.preset.export.formats
    quick, slow = ([x for x in suffixes if (x in MAY_BE_REFUSED) == late] for late in (False, True))
    folder = Path(folder)
    with atomic_folder(folder) as build_folder:
        with _pictures_meanwhile(design, build_folder, progress) if picture else nullcontext() as pictures:
            require_fit(design, measure=False)
            progress("verdict", "judging the cut structure")
            announce.verdict(judged := carrying(design))
            if pictures:
                pictures.add_verdict(design, judged, build_folder)
            preset = with_mesh(design.resolved_preset, build_folder, folder)
            files = _write_formats(design, build_folder, quick, progress)
            _write_numbers(design, build_folder, folder, preset)
            measured = _measured_facts(design, progress, build_folder / "fabrication.png" if marked else None)
        facts = _write_facts(design, build_folder, files, measured, time.perf_counter() - start)
    announce.picture(folder)
    if not slow and not is_searched(design.preset):
        return SavedDesign(facts, (*files.reports, *files.notes), "")
    with atomic_folder(folder, lambda _target, _partial: set()) as build_folder:
        with work_while_waiting(lambda: measured.update(_alternatives(design, progress))):
            files = _WrittenFiles(*map(add, files, _write_formats(design, build_folder, slow, progress)))
        facts = _write_facts(design, build_folder, files, measured, time.perf_counter() - start, facts[MANIFEST])
    return SavedDesign(facts, (*files.reports, *files.notes), "; ".join(files.refused))


def _write_facts(
    design: Design,
    folder: Path,
    files: _WrittenFiles,
    measured: Mapping[str, Any],
    spent: float,
    earlier: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, Any]:
    """Write `design.json`; return its content. measured : further content.    spent : seconds of the export."""
    seconds = {**design.seconds, "export": spent}
    facts = design_facts(design, seconds, files.names, files.refused, files.notes) | dict(measured)
    facts |= {MANIFEST: {**earlier, **manifest(folder)}}
    (folder / DESIGN).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    return facts


def _measured_facts(design: Design, progress: Progress, marks: Path | None) -> dict[str, Any]:
    progress("fabrication", "measuring members, gaps and walls")
    measures = fabrication(design)
    require_fit(design, measures)
    if marks:
        from dsfab.render.fabrication import write_workshop_picture

        write_workshop_picture(marks, design, measures, MARKED_PICTURE)
    return {"fabrication": fabrication_facts(measures), "pattern": quality_facts(design.quality())}


def _alternatives(design: Design, progress: Progress) -> dict[str, Any]:
    if not is_searched(design.preset):
        return {}
    progress("alternatives", "solving a thinner sheet and isotropic stripes of the same mass")
    return alternative_facts(design_alternatives(design))


def ready_to_draw(picture: bool) -> AbstractContextManager[None]:
    """Return a context in which a second process loads the drawing libraries, if `picture` is true."""
    from dsfab.render.design_picture import start_picture_program

    return start_picture_program() if picture else nullcontext()


@contextmanager
def _pictures_meanwhile(design: Design, folder: Path, progress: Progress) -> "Iterator[Pictures]":
    """Draw preview.png in a second process. The caller can add pictures to the yielded `Pictures`."""
    from dsfab.render.design_picture import client_picture, pictures_in_background

    with pictures_in_background() as pictures:
        pictures.add(client_picture(design), folder / "preview.png")
        yield pictures
        if missing := [path.name for _, path in pictures.pending if not path.exists()]:
            progress("preview", f"drawing {' and '.join(missing)}")
        pictures.finish()


def _write_numbers(design: Design, build_folder: Path, folder: Path, preset: Preset) -> None:
    write(design.sheet.surface, build_folder / "sheet.ply")
    name = getattr(preset.surface, "file", None)
    if name is not None and not name.is_absolute() and (folder / name).is_file() and not (build_folder / name).exists():
        shutil.copy2(folder / name, build_folder / name)
    write_archive(design, build_folder, preset)
    (build_folder / "preset.toml").write_text(preset_toml(preset), encoding="utf-8")


def _write_formats(design: Design, folder: Path, suffixes: Sequence[str], progress: Progress) -> _WrittenFiles:
    by_suffix = {suffix: _write_format(design, folder, suffix, progress) for suffix in suffixes}
    fields = range(len(_WrittenFiles._fields))
    files = _WrittenFiles(*([text for suffix in suffixes for text in by_suffix[suffix][k]] for k in fields))
    return files._replace(notes=merged_notes({suffix: by_suffix[suffix].notes for suffix in suffixes}))


def merged_notes(notes: Mapping[str, Sequence[str]]) -> list[str]:
    """Return a list of the notes on written files. notes : notes by suffix of the file.
    Equal notes on several files become a single note that begins with their suffixes."""
    by_note: dict[str, list[str]] = {}
    for suffix, lines in notes.items():
        for line in lines:
            by_note.setdefault(line, []).append(suffix)
    return [f"{', '.join(suffixes)}: {line}" if len(suffixes) > 1 else line for line, suffixes in by_note.items()]


def _write_format(design: Design, folder: Path, suffix: str, progress: Progress) -> _WrittenFiles:
    files, name = _WrittenFiles([], [], [], []), f"{design.preset.name}.{suffix}"
    progress("export", f"writing and reading back {name}")
    try:
        deliverable_thing, options = deliverable(design, f".{suffix}")
        options |= {"note": files.notes.append, "report": lambda written: files.reports.append(written.summary)}
        files.names.append(write(deliverable_thing, folder / name, **options).name)
    except ExportError as error:
        if suffix not in MAY_BE_REFUSED:
            raise
        files.refused.append(str(error))
        return files
    if suffix == "stl":
        files.names.extend(_write_part_files(design, folder))
    return files


def _write_part_files(design: Design, folder: Path) -> Iterator[str]:
    if design.solid.pieces == 1 or not any(isinstance(extra, SplitBodies) for extra in design.preset.thickening.extra):
        return
    for number, part in enumerate(parts(design.solid), 1):
        yield write(part, folder / f"{design.preset.name}_{number}.stl").name
