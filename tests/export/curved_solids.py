"""A solid between two curved skins."""

from dsfab.thickening import offsets, thicken
from tests.shapes import lifted


def saddle_solid():
    """A curved sheet, thick against the bend of its faces: 1,344 triangles, no two in one plane but on the rim."""
    surface = lifted(lambda x, y: 0.8 * (x - 0.5) * (y - 0.5), cells=16)
    return thicken(surface, offsets(surface, 0.1).D)
