"""Stage 5, slicing: from stripes to a sheet that is cut along their edges."""

from dsfab.slicing.cutting.cut import cut, cut_polygons, divided_at_vertices, material_area, sheet_of
from dsfab.slicing.cutting.halving import Halved, halved
from dsfab.slicing.cutting.loose_ends import Tidy
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import Sheet, three_each
from dsfab.slicing.finishing.fairing import divided_walls, faired_walls
from dsfab.slicing.finishing.least_widths import (
    LeastWidths,
    bridged_gaps,
    bridged_necks,
    widened_members,
    with_least_widths,
)
from dsfab.slicing.finishing.mesh_quality import improved
from dsfab.slicing.finishing.openings import Merging, Openings, filled_crumbs, filled_openings, filled_slits
from dsfab.slicing.finishing.point_contacts import Pinched, resolve_pinches
from dsfab.slicing.finishing.spikes import without_spikes
from dsfab.slicing.measures.chart import Chart, chart_of
from dsfab.slicing.measures.overlay import DrawnBand, Overlay, overlaid

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
