"""Previews of a design and the difference of two pictures."""

import numpy as np

from dsfab.design import Design
from dsfab.render.drawing import page_view
from dsfab.render.previewer import Previewer
from dsfab.render.scene import Body, Scene
from dsfab.slicing import cut
from dsfab.surface import Surface

SIZE = (480, 360)

MOST = 1e-3
"""Share of the silhouette's pixels that may differ."""


def exact(previewer: Previewer, surface: Surface) -> np.ndarray:
    """Where a surface without any shader is seen by the previewer's eye."""
    stage = previewer._stage
    body = Body(surface.V, surface.F, np.zeros(3, dtype=np.uint8), casts=True)
    with Scene([body], stage.centre, stage.radius) as scene:
        return scene.mask(page_view(stage.bodies, previewer._side, SIZE), *SIZE)


def difference(made: Design, previewer: Previewer) -> float:
    """Share of the silhouette's pixels in which the shader and the exact cut of a draft differ."""
    sheet = cut(made.surface, made.pattern.fields, made.pattern.levels, snap=0.0).subset()
    there = exact(previewer, sheet.surface)
    assert 0.02 < there.mean() < 0.9
    return float((previewer.mask(SIZE) != there).sum() / there.sum())
