"""Snow on what is nearly closed, and the wind: lines of a preset for loads that are no roof's."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.proposal.sizes import MODEL
from dsfab.proposal.vertical import is_nearly_closed
from dsfab.surface import Surface, one_sided_pieces

SLIDES = 60
"""Degrees of slope from which snow slides off [EN 1991-1-3, table 5.2]."""
ENCLOSES = 16.0
"""A surface whose boundary, squared, is longer than this many times its area encloses nothing: it has no outside."""
TOP = 0.15
"""Share of a surface on which snow would lie, at least, to be worth a load."""
WIND = 500.0
"""Pa of velocity pressure: a placeholder for the local code."""


def snow_on_top(surface: Surface) -> str | None:
    """The picker of the faces that snow lies on of what is built, open and no roof: the top of a ball to go into, its
    normals outwards or inwards. None of models and of what has no top, as a wall or a tower, or no outside.
    """
    edge = float(surface.edge_lengths[surface.edges.boundary].sum())
    if surface.size < MODEL or edge**2 > ENCLOSES * surface.area or is_nearly_closed(surface) or _one_sided(surface):
        return None
    outwards = np.einsum("mi,mi,m->", surface.normals, surface.centroids - surface.V.mean(axis=0), surface.areas)
    up = 1.0 if outwards > 0 else -1.0
    lies = up * surface.normals[:, 2] > np.cos(np.radians(SLIDES))
    if float(surface.areas[lies].sum()) < TOP * surface.area:
        return None
    return f'pick = "facing", direction = [0.0, 0.0, {up}], angle = {SLIDES}'


def wind_lines(surface: Surface) -> list[str]:
    """Lines of a preset for wind on the broadest side of what is built and is no roof; none of a model."""
    if surface.size < MODEL or _one_sided(surface):
        return []
    seen: Floats = surface.areas @ np.abs(surface.normals)
    direction = [0.0, 1.0, 0.0] if seen[1] > seen[0] else [1.0, 0.0, 0.0]
    told = "# Wind, which decides for much that stands upright; take these lines with your local code's numbers:"
    load = ('kind = "wind"', f"pressure = {WIND}", f"direction = {direction}")
    return [told, "# [[surface.load]]", *(f"# {line}" for line in load)]


def _one_sided(surface: Surface) -> bool:
    """Whether some of it has no outside, as a Moebius strip: wind and a picker of faces that look up refuse it."""
    return bool(one_sided_pieces(surface.F, surface.edges).any())
