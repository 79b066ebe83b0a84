"""The command `dsfab reproduce`: makes the paper's figures, on one page that opens offline."""

import json
import math
import os
import platform
from contextlib import suppress
from functools import partial as partial_of
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import OutputName, Quiet, Switch
from dsfab.app.terminal import Reporter, print_result
from dsfab.core.errors import DsfabError, NotMadeError, did_you_mean
from dsfab.core.messages import byte_size
from dsfab.export import atomic_folder
from dsfab.report.design.facts import versions

if TYPE_CHECKING:
    from dsfab.reproduction.figures import FigurePictures
    from dsfab.reproduction.published import PaperFigure

FOLDER = Path("outputs/paper")  # Default folder of the page about the figures.
COARSEST = 8.0  # Limit of --coarser: a coarser mesh has too few vertices for the modes.


def reproduce(
    *names: str,
    coarser: Annotated[
        float, Parameter(help="Make edges this many times as long as in the presets, to make rough figures quickly.")
    ] = 1.0,
    volumes: Annotated[
        bool,
        Switch(
            help="Also compare designs of the sphere at three volumes (takes a quarter of an hour and 9 GB of memory)."
        ),
    ] = False,
    small: Annotated[
        bool, Switch(help="Also write small.html: the page in one file, with pictures of half the size.")
    ] = False,
    output: Annotated[Path, OutputName(help="Folder of the page.")] = FOLDER,
    workers: Annotated[
        int | None, Parameter(help="Number of processes that make figures [all cores, if memory suffices].")
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Make the paper's figures, and a page with pictures, parameters and computing times.

    The exit code is 4 if a figure could not be made; the page then shows the reason.

    Parameters
    ----------
    names
        Figures by their presets, such as bob or camel_nose; all 17 when left out (several minutes)."""
    from dsfab.render.opengl import require_rendering
    from dsfab.study import fitting_processes

    chosen = figures_by_name(names)
    if not 1 <= coarser <= COARSEST:
        raise DsfabError(
            f"--coarser {coarser:g} is not a number from 1 to {COARSEST:g}; write for instance --coarser 2"
        )
    if workers is not None and workers < 1:
        raise DsfabError(f"--workers {workers} is less than 1; give 1 or more")
    require_rendering()
    count = fitting_processes(len(chosen)) if workers is None else min(workers, len(chosen))
    with Reporter(quiet) as reporter:
        figures = _write(chosen, output, coarser, count, reporter, volumes, small)
    failed = [f"{result.figure.preset} ({result.error})" for result in figures if result.error]
    if not quiet:
        _summary(figures, output, small)
    if failed:
        raise NotMadeError(f"{len(failed)} of {len(figures)} figures could not be made: {'; '.join(failed)}")
    return 0


def figures_by_name(names: tuple[str, ...]) -> "list[PaperFigure]":
    """Return the figures of these presets, by default all figures. Raises DsfabError for an unknown name."""
    from dsfab.reproduction.published import FIGURES

    presets = [figure.preset for figure in FIGURES]
    for name in names:
        if name not in presets:
            raise DsfabError(
                f"the paper has no figure {name!r}{did_you_mean(name, presets)}; its figures are {', '.join(presets)}"
            )
    return [figure for figure in FIGURES if not names or figure.preset in names]


def _write(
    figures_wanted: "list[PaperFigure]",
    folder: Path,
    coarser: float,
    workers: int,
    reporter: Reporter,
    volumes: bool,
    small: bool,
) -> "list[FigurePictures]":
    from dsfab.reproduction.figures import make_figure
    from dsfab.reproduction.page import PAGE_NAME, SMALL_NAME, PageFacts, page, pictures_of, small_page
    from dsfab.study import map_in_processes

    figures: list[FigurePictures] = []
    loads = [_system_load()]
    with atomic_folder(folder, lambda old, new: pictures_of(old) - pictures_of(new)) as partial:
        job = partial_of(make_figure, folder=partial, coarser=coarser)
        results = map_in_processes(job, figures_wanted, workers, work=lambda figure: figure.timings.triangles)
        for number, figure in enumerate(figures_wanted, start=1):
            reporter("reproduce", f"{number} of {len(figures_wanted)}: {figure.preset}")
            figures.append(next(results))
            loads.append(_system_load())
        if volumes:
            from dsfab.reproduction.volumes import sphere_volumes

            sphere_volumes(partial, reporter, coarser)
        volumes_folder = partial if volumes else folder
        text = page(figures, PageFacts(coarser, _machine_words(), _load_words(loads)), _volume_rows(volumes_folder))
        (partial / PAGE_NAME).write_text(text, encoding="utf-8")
        if small:
            (partial / SMALL_NAME).write_text(small_page(text, (partial, volumes_folder)), encoding="utf-8")
    return figures


def _volume_rows(folder: Path) -> list[dict[str, Any]]:
    try:
        content = json.loads((folder / "sphere_volumes.json").read_text(encoding="utf-8"))
        return list(content["competitors"]) if (folder / "sphere_volumes.svg").exists() else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _machine_words() -> str:
    library_versions = versions()
    cores = os.cpu_count() or 1
    dsfab, python, solver = (library_versions[name] for name in ("dsfab", "python", "solver"))
    machine = f"{platform.system()}, {cores} {'core' if cores == 1 else 'cores'} of {_processor_name()}"
    return f"dsfab {dsfab}, Python {python}, solver {solver}, {machine}"


def _processor_name() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _system_load() -> float:
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan


def _load_words(loads: list[float]) -> str:
    least, greatest = min(loads), max(loads)
    return (
        ""
        if math.isnan(least)
        else f"during the run, {least:.1f} to {greatest:.1f} programs competed for the processor"
    )


def _summary(figures: "list[FigurePictures]", folder: Path, small: bool) -> None:
    from dsfab.reproduction.figures import RENDITION_TITLES
    from dsfab.reproduction.page import COLUMNS, SMALL_NAME, rendition_facts

    for result in figures:
        print_result(f"{result.figure.preset}: {result.carried or 'not made'}")
        for method in result.ways:
            facts = zip(COLUMNS, rendition_facts(method.rendition), strict=True)
            facts_words = ", ".join(f"{column} {fact}" for (column, _), fact in facts if fact)
            print_result(f"  {RENDITION_TITLES[method.rendition.name]}: {method.rendition.refused or facts_words}")
            if method.found:
                print_result(f"    {method.found}")
    size = sum(path.stat().st_size for path in folder.iterdir() if path.suffix == ".webp" or path.name == "index.html")
    print_result(f"  {folder / 'index.html'}  {byte_size(size)} with its pictures")
    if small:
        print_result(f"  {folder / SMALL_NAME}  {byte_size((folder / SMALL_NAME).stat().st_size)}, in one file")
