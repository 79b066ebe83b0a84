"""The command `dsfab reproduce`: the paper's figures on one page that opens offline."""

import json
import math
import os
import platform
from contextlib import suppress
from functools import partial as partial_of
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.options import Quiet
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import DsfabError, did_you_mean
from dsfab.core.messages import size
from dsfab.export import whole_or_nothing
from dsfab.report.design.facts import versions

if TYPE_CHECKING:
    from dsfab.reproduction.figures import FigurePictures
    from dsfab.reproduction.published import PaperFigure

FOLDER = Path("outputs/paper")
"""Default folder of the page."""

COARSEST = 8.0
"""Limit of --coarser, because coarser meshes have too few vertices for modes."""


def reproduce(
    *names: str,
    coarser: Annotated[
        float, Parameter(help="Edges this many times as long as the presets' own: a quick look, in rough.")
    ] = 1.0,
    volumes: Annotated[
        bool,
        Parameter(
            negative=(), help="Also compare the sphere with others at three volumes (a quarter of an hour, 9 GB)."
        ),
    ] = False,
    small: Annotated[
        bool,
        Parameter(negative=(), help="Also write small.html: the page in one file, with pictures of half the size."),
    ] = False,
    output: Annotated[Path, Parameter(name=["-o", "--output"], help="Folder of the page.")] = FOLDER,
    workers: Annotated[
        int | None, Parameter(help="Figures made at the same time, in processes [cores, as memory allows].")
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Make the paper's figures and a page about them: each step in pictures, its parameters, its seconds.

    Exit code 1 when a figure could not be made; the page says why in its place.

    Parameters
    ----------
    names
        Figures by their presets, such as bob or camel_nose; all 17 when left out (several minutes).
    """
    from dsfab.render.opengl import require_rendering
    from dsfab.study import fitting_processes

    chosen = choose(names)
    if not 1 <= coarser <= COARSEST:
        raise DsfabError(f"--coarser {coarser:g} is not between 1 and {COARSEST:g}; write for instance --coarser 2")
    if workers is not None and workers < 1:
        raise DsfabError(f"--workers {workers} must be 1 or more")
    require_rendering()
    count = fitting_processes(len(chosen)) if workers is None else min(workers, len(chosen))
    with Reporter(quiet) as reporter:
        figures = _write(chosen, output, coarser, count, reporter, volumes, small)
    failed = [f"{made.figure.preset} ({made.error})" for made in figures if made.error]
    if not quiet:
        _summary(figures, output, small)
    if failed:
        raise DsfabError(f"{len(failed)} of {len(figures)} figures could not be made: {'; '.join(failed)}")
    return 0


def choose(names: tuple[str, ...]) -> "list[PaperFigure]":
    """Return the figures of these names, in the paper's order; all without names. Raises DsfabError for an unknown
    name.
    """
    from dsfab.reproduction.published import FIGURES

    known = [figure.preset for figure in FIGURES]
    for name in names:
        if name not in known:
            raise DsfabError(
                f"the paper has no figure {name!r}{did_you_mean(name, known)}; its figures are {', '.join(known)}"
            )
    return [figure for figure in FIGURES if not names or figure.preset in names]


def _write(
    chosen: "list[PaperFigure]",
    folder: Path,
    coarser: float,
    workers: int,
    reporter: Reporter,
    volumes: bool,
    small: bool,
) -> "list[FigurePictures]":
    """Make the figures, then the page; remove pictures of an earlier page that are not in the new one."""
    from dsfab.reproduction.figures import make_figure
    from dsfab.reproduction.page import PAGE_NAME, SMALL_NAME, PageFacts, page, pictures_of, small_page
    from dsfab.study import made_in_processes

    figures: list[FigurePictures] = []
    loads = [_load()]
    with whole_or_nothing(folder, lambda old, new: pictures_of(old) - pictures_of(new)) as partial:
        job = partial_of(make_figure, folder=partial, coarser=coarser)
        each = made_in_processes(job, chosen, workers, work=lambda figure: figure.timings.triangles)
        for number, figure in enumerate(chosen, start=1):
            reporter("reproduce", f"{number} of {len(chosen)}: {figure.preset}")
            figures.append(next(each))
            loads.append(_load())
        if volumes:
            from dsfab.reproduction.volumes import sphere_volumes

            sphere_volumes(partial, reporter, coarser)
        lie = partial if volumes else folder
        text = page(figures, PageFacts(coarser, _machine(), _busy(loads)), _volumes(lie))
        (partial / PAGE_NAME).write_text(text, encoding="utf-8")
        if small:
            (partial / SMALL_NAME).write_text(small_page(text, (partial, lie)), encoding="utf-8")
    return figures


def _volumes(folder: Path) -> list[dict[str, Any]]:
    try:
        told = json.loads((folder / "sphere_volumes.json").read_text(encoding="utf-8"))
        return list(told["competitors"]) if (folder / "sphere_volumes.svg").exists() else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _machine() -> str:
    known = versions()
    cores = os.cpu_count() or 1
    return (
        f"dsfab {known['dsfab']}, Python {known['python']}, solver {known['solver']}, {platform.system()}, "
        f"{cores} {'core' if cores == 1 else 'cores'} of {_processor()}"
    )


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _load() -> float:
    """Programs that want a core, mean of the last minute; nan if the system does not report it."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan


def _busy(loads: list[float]) -> str:
    least, most = min(loads), max(loads)
    return "" if math.isnan(least) else f"{least:.1f} to {most:.1f} programs wanted a core meanwhile"


def _summary(figures: "list[FigurePictures]", folder: Path, small: bool) -> None:
    from dsfab.reproduction.figures import WAYS
    from dsfab.reproduction.page import COLUMNS, SMALL_NAME, rendition_facts

    for made in figures:
        out(f"{made.figure.preset}: {made.carried or 'not made'}")
        for way in made.ways:
            facts = zip(COLUMNS, rendition_facts(way.rendition), strict=True)
            told = ", ".join(f"{column} {fact}" for (column, _), fact in facts if fact)
            out(f"  {WAYS[way.rendition.name]}: {way.rendition.refused or told}")
            if way.found:
                out(f"    {way.found}")
    written = sum(
        path.stat().st_size for path in folder.iterdir() if path.suffix == ".webp" or path.name == "index.html"
    )
    out(f"  {folder / 'index.html'}  {size(written)} with its pictures")
    if small:
        out(f"  {folder / SMALL_NAME}  {size((folder / SMALL_NAME).stat().st_size)}, in one file")
