"""Pictures of a whole design with captions, for the folder of a build and for notebooks."""

import os
import pickle
import subprocess
import warnings
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.core.messages import length, load_factor, mass
from dsfab.design.design import Design
from dsfab.export import PreparedProgram, ProgramError, temporary_folder
from dsfab.render import picture_program
from dsfab.render.build_pictures import ANALYSIS_LOOK, CLIENT_LOOK, AnalysisPicture, ClientPicture
from dsfab.render.colouring import Colouring, force_label, scaled_colouring, stress_label, utilisation_colouring
from dsfab.render.drawing import Annotations, GroundKind, check_ground
from dsfab.render.fabrication import Callout
from dsfab.render.lettering import PAPER, Palette
from dsfab.render.light import QUICK
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import Look, StructurePicture, png_bytes, write_png
from dsfab.render.previewer import DEFAULT_SIZE, Previewer, layer_names
from dsfab.render.view import named_side, up_axis

if TYPE_CHECKING:
    from dsfab.study.carrying import Carrying


def caption(design: Design) -> str:
    """Return the caption of a design's picture: name, fraction of the surface kept, thickness, mass, number of pieces.
    A warning is added if a verdict exists and the design does not carry its loads."""
    pieces, judged = design.solid.pieces, design.existing_result("carrying")
    warning = " - DOES NOT CARRY ITS LOADS" if judged and judged.faults else ""
    share = design.sheet.surface.area / design.surface.area
    return (
        f"{design.preset.name} - {share:.0%} of the surface kept, {length(design.preset.statics.thickness)} thick, "
        f"{mass(design.mass)}, {pieces} {'piece' if pieces == 1 else 'pieces'}{warning}"
    )


def client_picture(design: Design, look: Look = CLIENT_LOOK) -> ClientPicture:
    """Return the data of preview.png. Raises DsfabError for an impossible design."""
    solid, half = design.solid, design.preset.statics.thickness / 2
    return ClientPicture(solid.V, solid.F, half, design.surface, design.load, caption(design), look)


def analysis_picture(design: Design, judged: "Carrying", look: Look = ANALYSIS_LOOK) -> AnalysisPicture:
    """Return the data of analysis.png: loads and supports on the left, utilisation on the right.
    judged : verdict on whether the design carries its loads.    look : style of each half."""
    surface, palette, strength = design.sheet.surface, look.palette, design.preset.statics.strength
    total = float(np.linalg.norm(design.load.force.sum(axis=0)))
    loaded = structure_drawing(design, marks=("loads", "supports", "person"), size=look.size)
    loaded = replace(loaded, caption=f"{design.preset.name} - loads of {force_label(total)}, and supports", look=look)
    buckles = f", buckles at {load_factor(judged.buckling)} times the load" if judged.buckling else ""
    before = (judged.outcome if judged.faults else "cut sheet") + buckles
    if judged.stress is None:
        uncoloured = np.broadcast_to(np.array(palette.members, dtype=np.uint8), (surface.m, 3))
        faces = Colouring(uncoloured, words="; ".join(judged.faults))
    elif strength:
        faces = utilisation_colouring(
            judged.stress / strength, f"{before} - stress / strength of {stress_label(strength)}"
        )
    else:
        faces = scaled_colouring(
            judged.stress, stress_label, f"{before} - stress; the preset gives no strength for a comparison"
        )
    return AnalysisPicture(loaded, surface.V, surface.F, faces, _carrying_callouts(judged, palette))


def _carrying_callouts(judged: "Carrying", palette: Palette) -> list[Callout]:
    notes, use, moved = list[Callout](), judged.use, judged.movement
    if use:
        lines = (f"most used: {use.member}, {use.value:.0%}", use.check)
        notes.append(Callout(np.array(use.place), lines, palette.tension if use.value > 1 else palette.load))
    if moved:
        share = f"span / {float(f'{1 / moved.share:.2g}'):,.0f}" if moved.share > 0 else ""
        notes.append(Callout(np.array(moved.place), (f"moves most: {length(moved.value)}", share), palette.load))
    return notes


def structure_drawing(
    design: Design,
    *,
    view: str = "iso",
    marks: bool | Collection[str] = True,
    ground: GroundKind = "paper",
    size: tuple[int, int] = DEFAULT_SIZE,
) -> StructurePicture:
    """Return the data of a picture of the finished structure in the style of `Previewer`.
    view, marks, ground, size : as for `Previewer`. Raises DsfabError if the design or its picture is impossible."""
    check_ground(ground)
    solid, surface, load = design.solid, design.surface, design.load
    up = up_axis(surface.V, surface, load)
    palette = replace(PAPER, paper=(255, 255, 255)) if ground == "white" else PAPER
    annotations = Annotations(surface, load, design.statics.equilibrium.reaction, None, layer_names(marks, view))
    return StructurePicture(
        *(solid.V, solid.F, design.preset.statics.thickness / 2, named_side(solid.V, up, view), up, annotations),
        *(caption(design), Look(size, palette=palette), ground == "transparent"),
    )


SECONDS = 600.0  # longest time that `Pictures.finish` waits for the process that draws
_STARTED_PROGRAM: ContextVar[PreparedProgram | None] = ContextVar("_AHEAD", default=None)


@contextmanager
def start_picture_program() -> Iterator[None]:
    """Keep a process ready to draw pictures during a `with` block. Raises DsfabError if this machine cannot draw."""
    if (os.cpu_count() or 1) == 1:
        yield
        return
    require_rendering()
    with PreparedProgram(picture_program.__file__) as program:
        token = _STARTED_PROGRAM.set(program)
        try:
            yield
        finally:
            _STARTED_PROGRAM.reset(token)


@dataclass
class Pictures:
    """Pictures that a second process draws. Without this process, or after its failure, `finish` draws the pictures."""

    program: PreparedProgram | None = None
    folder: str = ""
    pending: list[tuple[ClientPicture | AnalysisPicture, Path]] = field(default_factory=list)

    def add(self, data: ClientPicture | AnalysisPicture, path: Path) -> None:
        """Start to draw a picture into a PNG file."""
        self.pending.append((data, path))
        if self.program:
            file = Path(self.folder) / f"{len(self.pending)}.pickle"
            file.write_bytes(pickle.dumps(data, protocol=5))
            self.program.send(str(file), str(path))

    def add_verdict(self, design: Design, judged: "Carrying", folder: Path) -> None:
        """Start to draw analysis.png, and preview.png again if its caption must warn that the loads are not carried."""
        self.add(analysis_picture(design, judged), folder / "analysis.png")
        if judged.faults:
            self.add(client_picture(design), folder / "preview.png")

    def finish(self) -> None:
        """Wait until all pictures are written."""
        with suppress(ProgramError, subprocess.TimeoutExpired):
            if self.program:
                self.program.answer(SECONDS)
                return
        for data, path in self.pending:
            write_png(data.render(), path)


@contextmanager
def pictures_in_background() -> Iterator[Pictures]:
    """Yield `Pictures`; a second process draws them if this machine has more than one core.
    Raises DsfabError if this machine cannot draw."""
    require_rendering()  # sets an environment variable for VTK, which the second process uses, too
    if (os.cpu_count() or 1) == 1:
        yield Pictures()
        return
    with (
        temporary_folder("dsfab-picture") as folder,
        _STARTED_PROGRAM.get() or PreparedProgram(picture_program.__file__) as program,
    ):
        _STARTED_PROGRAM.set(None)  # each call needs its own process
        yield Pictures(program, folder)


NOTEBOOK_SIZE = (800, 600)  # size of a picture in a notebook (pixels)


def inline_picture(design: Design) -> bytes | None:
    """Return PNG bytes of a design's solid, or of its preview. If this machine cannot draw, warn and return None."""
    try:
        if design.has("thickening"):
            require_rendering()
            return png_bytes(structure_drawing(design, size=NOTEBOOK_SIZE).render())
        with Previewer(design) as previewer:
            return png_bytes(previewer.picture(NOTEBOOK_SIZE, quality=QUICK))
    except DsfabError as error:
        warnings.warn(str(error), stacklevel=2)
        return None
