"""Pictures of a sweep's runs: the sheet as it is cut, all from one side and at one scale."""

import io
import threading
from dataclasses import dataclass, replace

import numpy as np

from dsfab.pipeline.design import Design
from dsfab.render import light
from dsfab.render.drawing import rendered
from dsfab.render.opengl import require_rendering
from dsfab.render.palette import PAPER
from dsfab.render.scene import Body, Scene
from dsfab.render.stage import Annotations, Stage, on_page, set_stage
from dsfab.render.view import named_side, up_axis

MEMBERS = np.array(PAPER.members, dtype=np.uint8)

_stages = threading.local()
"""Of each thread: the last surface, how it was drawn, and its empty stage."""


def require_view(name: str) -> None:
    """Raise DsfabError for a view that is not known, before anything is made."""
    if name != "iso":  # for which the surface is asked
        named_side(np.eye(3), np.array([0.0, 0.0, 1.0]), name)


@dataclass(frozen=True)
class SheetDrawer:
    """Draws the cut sheet of a design as PNG; `size` in pixels, `view` as in `dsfab preview`. It travels to workers.

    The camera stands where the uncut surface fills the page: designs of one surface can be laid over each other.
    Raises DsfabError where nothing can be drawn, and for views that are not known.
    """

    size: tuple[int, int]
    view: str

    def __call__(self, made: Design) -> bytes:
        from PIL import Image

        sheet = made.sheet.surface
        stage = self._stage(made)
        body = Body(sheet.V, sheet.F, MEMBERS, casts=True)
        stage = replace(stage, bodies=[body])
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            picture: Image.Image = rendered(scene, stage, PAPER, self.size, light.QUICK)
        file = io.BytesIO()
        picture.save(file, format="PNG", optimize=False)
        return file.getvalue()

    def _stage(self, made: Design) -> Stage:
        """Where the camera stands and where the ground lies, found once for each surface."""
        if getattr(_stages, "of", None) != (id(made.surface), self):
            require_rendering()
            surface, load = made.surface, made.load
            up = up_axis(surface.V, surface, load)
            side = named_side(surface.V, up, self.view)
            whole = Body(surface.V, surface.F, MEMBERS, casts=True)
            half = made.preset.statics.thickness / 2
            stage = set_stage(whole, side, up, half, Annotations(surface, load, layers=()), PAPER, self.size)
            stage = replace(stage, view=on_page([whole], side, self.size, words=False))
            if side.towards @ up < 0:  # from below one looks through the ground
                stage = replace(stage, level=None)
            # the surface is kept, so that no other gets its id
            _stages.of, _stages.surface, _stages.stage = (id(made.surface), self), surface, stage
        stage_there: Stage = _stages.stage
        return stage_there
