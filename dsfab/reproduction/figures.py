"""Figures of the paper by Madan, Jacobson and Levin, computed by dsfab."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from dsfab.core.errors import DsfabError, SurfaceError
from dsfab.design import Design, Log, draft
from dsfab.preset.file import load_preset, with_overrides
from dsfab.preset.model import Preset
from dsfab.reproduction.captions import finding
from dsfab.reproduction.comparisons import comparisons
from dsfab.reproduction.drawing import PaperComparison, PaperPicture, paper_picture
from dsfab.reproduction.published import PaperFigure
from dsfab.reproduction.renditions import Rendition, renditions
from dsfab.results import Piece

STEPS = ("loads", "directions", "vonmises", "major_mode", "major", "minor_mode", "minor")
"""Names of pictures of a figure, in the order of the computation, without the picture of the final structure."""

RUNS = 3  # Number of runs; the page reports their median seconds.
RENDITION_TITLES = {"letter": "Exactly as in the paper", "preset": "The preset", "stripes": "dsfab's stripes"}
"""Titles of the three versions (renditions) of a figure."""


@dataclass(frozen=True, eq=False)
class RenditionPicture:
    """A version of a figure, and its picture. found : clause on the paper's claim, or ''.
    edge : edge length of the mesh, m; 0 without a design."""

    rendition: Rendition
    picture: PaperPicture
    found: str = ""
    edge: float = 0.0


@dataclass(frozen=True, eq=False)
class FigurePictures:
    """A figure of the paper, computed by dsfab. error : reason for a failure, or ''.
    seconds : processor seconds by step.    carried : text on how the loads reach the supports.
    coarser : edge length of the mesh / edge length in the preset.    ways : three versions of the figure."""

    figure: PaperFigure
    vertices: int = 0
    triangles: int = 0
    seconds: Mapping[str, float] | None = None
    carried: str = ""
    notes: tuple[str, ...] = ()
    shown: tuple[PaperPicture, ...] = ()
    comparisons: tuple[PaperComparison, ...] = ()
    ways: tuple[RenditionPicture, ...] = ()
    coarser: float = 1.0
    error: str = ""

    @property
    def structure(self) -> PaperPicture | None:
        """Picture of the structure, or None after a failure."""
        return self.shown[0] if self.shown else None


def make_figure(figure: PaperFigure, folder: Path, coarser: float = 1.0) -> FigurePictures:
    """Compute a figure, and write its pictures into `folder`. The result contains the text of a DsfabError.
    coarser : wanted edge length / preset's edge length."""
    try:
        design, coarser = coarsened_draft(load_preset(figure.preset), coarser)
        results = renditions(design)
        carried, notes = _load_transfer(results[1])
        shown = tuple(paper_picture(design, folder, show, figure.preset) for show in ("structure", *STEPS))
        compared = tuple(comparisons(design, folder, {entry.file: entry for entry in shown}))
        ways = tuple(_rendition_picture(figure, entry, folder, shown[0]) for entry in results)
    except DsfabError as error:
        return FigurePictures(figure, error=str(error))
    surface, seconds = design.surface, processor_seconds(design)
    return FigurePictures(figure, surface.n, surface.m, seconds, carried, notes, shown, compared, ways, coarser)


def processor_seconds(design: Design) -> dict[str, float]:
    """Return the median processor seconds of each step up to diffusion, by name of the step."""
    runs = []
    for _ in range(RUNS):
        log = Log(None, clock=time.process_time)
        Design.from_results(design.preset, log, surface=design.surface).until("diffusion")
        runs.append(log.seconds)
    return {row: median(run[row] for run in runs) for row in runs[0]}


def coarsened_draft(preset: Preset, coarser: float) -> tuple[Design, float]:
    """Return a design up to its pattern, on a mesh with edges up to `coarser` times as long, and the factor used.
    Raises SurfaceError if the mesh also fails with factor 1."""
    edge = preset.surface.model_dump()["edge"]
    while True:
        try:
            return draft(with_overrides(preset, {"surface.edge": coarser * edge}) if coarser != 1 else preset), coarser
        except SurfaceError:
            if coarser <= 1:
                raise
            coarser = max(0.8 * coarser, 1.0)


def _rendition_picture(
    figure: PaperFigure, rendition: Rendition, folder: Path, shipped: PaperPicture
) -> RenditionPicture:
    title, design = RENDITION_TITLES[rendition.name], rendition.design
    if rendition.name == "preset":
        picture = replace(shipped, title=title)
    elif design is None:
        picture = PaperPicture("", title, rendition.refused)
    else:
        picture = paper_picture(design, folder, "structure", f"{figure.preset}-{rendition.name}", title)
    edge = float(design.preset.surface.model_dump()["edge"]) if design else 0.0
    claim_text = "" if rendition.name == "stripes" else finding(figure.claim, rendition)
    return RenditionPicture(replace(rendition, design=None), picture, claim_text, edge)


def _load_transfer(rendition: Rendition) -> tuple[str, tuple[str, ...]]:
    if rendition.design is None:
        return f"it cannot be built: {rendition.refused}", ()
    slicing, notes = rendition.design.slicing, rendition.design.notes
    share = slicing.sheet.surface.area / rendition.design.surface.area
    text = f"{share:.0%} of the surface is material, in {_count(len(slicing.pieces))}; {supports_text(slicing.pieces)}"
    return text, tuple(f"{note.stage}: {note.text}" for note in notes)


def _count(pieces: int) -> str:
    return "one piece" if pieces == 1 else f"{pieces} pieces"


def supports_text(pieces: Sequence[Piece]) -> str:
    """Return a text on the number of pieces through which the loads reach the supports."""
    loaded = [piece for piece in pieces if piece.loaded]
    if not loaded:
        lost = sum(not piece.held for piece in pieces)
        lost_words = (
            f"the load is spread, and {lost} of {len(pieces)} pieces {'reaches' if lost == 1 else 'reach'} no support"
        )
        return lost_words if lost else "the load is spread, and all of it is supported"
    lost = sum(not piece.held for piece in loaded)
    if lost:
        return f"{lost} of {len(loaded)} pieces that carry a load {'reaches' if lost == 1 else 'reach'} no support"
    return f"all loads reach the supports through {_count(len(loaded))}"
