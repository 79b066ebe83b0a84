"""A design as a picture in a notebook."""

import warnings

from dsfab.errors import DsfabError
from dsfab.pipeline.design import Design
from dsfab.render.caption import caption
from dsfab.render.light import QUICK
from dsfab.render.picture import Look, picture
from dsfab.render.png import png
from dsfab.render.previewer import Previewer

SIZE = (800, 600)
"""Pixels."""


def inline_picture(made: Design) -> bytes | None:
    """PNG of a design's solid, or of a draft before it is cut; None, with a warning, where nothing can be drawn."""
    try:
        if made.has("thickening"):
            solid = made.solid
            words = caption(made)
            return png(picture(solid.V, solid.F, surface=made.surface, load=made.load, caption=words, look=Look(SIZE)))
        with Previewer(made) as previewer:
            return png(previewer.picture(SIZE, quality=QUICK))
    except DsfabError as error:
        warnings.warn(str(error), stacklevel=2)
        return None
