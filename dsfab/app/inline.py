"""A design as a picture in a notebook."""

import warnings

from dsfab.app.build import caption
from dsfab.app.files import png
from dsfab.app.light import QUICK
from dsfab.app.preview import picture
from dsfab.app.previewer import Previewer
from dsfab.design import Design, Draft
from dsfab.errors import DsfabError

SIZE = (800, 600)
"""Pixels."""


def inline_picture(made: Design | Draft) -> bytes | None:
    """PNG of a design's solid, or of a draft before it is cut; None, with a warning, where nothing can be drawn."""
    try:
        if isinstance(made, Design):
            solid = made.solid
            words = caption(made)
            return png(picture(solid.V, solid.F, surface=made.surface, load=made.load, caption=words, size=SIZE))
        with Previewer(made) as previewer:
            return png(previewer.picture(SIZE, quality=QUICK))
    except DsfabError as error:
        warnings.warn(str(error), stacklevel=2)
        return None
