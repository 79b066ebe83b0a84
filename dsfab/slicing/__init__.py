"""Stage 5, slicing: from stripes to a sheet that is cut along their edges."""

from dsfab.slicing.chart import Chart, chart_of
from dsfab.slicing.cut import cut, cut_polygons, material_area, sheet_of
from dsfab.slicing.fairing import faired_walls
from dsfab.slicing.halving import Halved, halved
from dsfab.slicing.improve import improved
from dsfab.slicing.least_widths import LeastWidths, with_least_widths
from dsfab.slicing.necks import bridged_gaps, bridged_necks
from dsfab.slicing.on_parts import divided_at_vertices
from dsfab.slicing.openings import Merging, Openings, filled_crumbs, filled_openings, filled_slits
from dsfab.slicing.overlay import DrawnBand, Overlay, overlaid
from dsfab.slicing.pinch import Pinched, resolve_pinches
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.sheet import Sheet, three_each
from dsfab.slicing.spikes import without_spikes
from dsfab.slicing.tidy import Tidy
from dsfab.slicing.wall_division import divided_walls
from dsfab.slicing.widening import widened_members

__all__ = [
    "Chart",
    "DrawnBand",
    "Halved",
    "LeastWidths",
    "Merging",
    "Openings",
    "Overlay",
    "Pinched",
    "PolygonMesh",
    "Sheet",
    "Tidy",
    "bridged_gaps",
    "bridged_necks",
    "chart_of",
    "cut",
    "cut_polygons",
    "divided_at_vertices",
    "divided_walls",
    "faired_walls",
    "filled_crumbs",
    "filled_openings",
    "filled_slits",
    "halved",
    "improved",
    "material_area",
    "overlaid",
    "resolve_pinches",
    "sheet_of",
    "three_each",
    "widened_members",
    "with_least_widths",
    "without_spikes",
]
