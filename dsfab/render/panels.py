"""Several pictures of one design on one page."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dsfab.errors import DsfabError
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress
from dsfab.render.light import FINE, LightQuality
from dsfab.render.previewer import Previewer
from dsfab.render.scene import Bytes


def across(count: int) -> int:
    """Pictures in a row: 1, 2, 3 stand side by side, 4 are a square, more have rows of three."""
    return {1: 1, 2: 2, 4: 2}.get(count, 3)


class Panels(NamedTuple):
    """One picture of several, and what is not on it: its name and why."""

    pixels: Bytes
    left_out: tuple[str, ...]


def panels(
    made: Design,
    names: Sequence[str],
    pixels: tuple[int, int],
    progress: Progress,
    quality: LightQuality = FINE,
    **options: Any,
) -> Panels:
    """One picture with those of all `names`, each `pixels` large; `options` are those of `Previewer`.

    Where loads are a picture of their own, the others are drawn without their arrows, unless `marks` are given.
    What this design has no answer for is left out and told. Raises DsfabError when nothing is left.
    """
    drawn, refused = [], []
    alone = "marks" not in options and "loads" in names
    for name in names:
        progress("preview", f"drawing {name.replace('_', ' ')}")
        try:
            given = {"marks": ("person",)} | options if alone and name != "loads" else options
            with Previewer(made, show=name, **given) as previewer:
                drawn.append(previewer.picture(pixels, quality=quality))
        except DsfabError as error:
            refused.append(f"{name}: {error}")
    if not drawn:
        raise DsfabError(f"nothing can be shown; {'; '.join(refused)}")
    return Panels(_tiled(drawn), tuple(refused))


def _tiled(pictures: Sequence[Bytes]) -> Bytes:
    wide = across(len(pictures))
    empty = np.broadcast_to(pictures[0][:1, :1], pictures[0].shape)
    filled = [*pictures, *(empty for _ in range(-len(pictures) % wide))]
    return np.concatenate([np.concatenate(filled[i : i + wide], axis=1) for i in range(0, len(filled), wide)])
