"""Solids with the lines of their stripes."""

import numpy as np

from dsfab.export import Details
from dsfab.pattern import Stripes
from dsfab.slicing import cut
from dsfab.slicing.measures.lines import centre_lines, edge_lines
from dsfab.surface import Surface
from tests.shapes import grid, lifted


def striped(surface: Surface, along=(1.0, 0.0, 0.0), frequency: float = 2.0) -> tuple[Surface, Details]:
    """A sheet of stripes with its lines."""
    x = surface.V @ np.array(along)
    stripes = Stripes(frequency, phase=0.5)
    sheet = cut(surface, [x], [stripes.levels(x)]).subset()
    z, d = stripes.phases(x), np.full(surface.n, stripes.half_width)
    lines = edge_lines(sheet, surface, ["major"], [z]) + centre_lines(sheet, "major", z, d)
    return sheet.surface, Details(tuple(lines), 1e-4, facts=("10 mm thick", "S235 <steel> & more"))


FLAT, ARCHED = striped(grid(16, 8, 2.0, 1.0)), striped(lifted(lambda x, y: 0.5 * x * (1 - x)), frequency=4.0)
