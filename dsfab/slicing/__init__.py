"""Stage 5, slicing: from stripes to a sheet that is cut along their edges."""

from dsfab.slicing.cutting.cut import cut, cut_polygons, divided_field_values, sheet_of
from dsfab.slicing.cutting.halving import LineHalving, halve_lines
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import Sheet, weight_entries
from dsfab.slicing.finishing.fairing import divided_walls, faired_walls
from dsfab.slicing.finishing.finish import TrialCut, material_area, tidied_polygons, tidied_sheet
from dsfab.slicing.finishing.least_widths import (
    LeastWidths,
    bridged_gaps,
    bridged_necks,
    widened_members,
    with_least_widths,
)
from dsfab.slicing.finishing.loose_ends import Tidy
from dsfab.slicing.finishing.mesh_quality import improve_cells
from dsfab.slicing.finishing.openings import Merging, filled_crumbs, filled_openings, filled_slits, openings_of
from dsfab.slicing.finishing.point_contacts import PinchResult, resolve_pinches
from dsfab.slicing.finishing.spikes import without_spikes
from dsfab.slicing.measures.chart import Chart, chart_of
from dsfab.slicing.measures.overlay import DrawnBand, Overlay, stripe_overlay

__all__ = [
    "Chart",
    "DrawnBand",
    "LeastWidths",
    "LineHalving",
    "Merging",
    "Overlay",
    "PinchResult",
    "PolygonMesh",
    "Sheet",
    "Tidy",
    "TrialCut",
    "bridged_gaps",
    "bridged_necks",
    "chart_of",
    "cut",
    "cut_polygons",
    "divided_field_values",
    "divided_walls",
    "faired_walls",
    "filled_crumbs",
    "filled_openings",
    "filled_slits",
    "halve_lines",
    "improve_cells",
    "material_area",
    "openings_of",
    "resolve_pinches",
    "sheet_of",
    "stripe_overlay",
    "tidied_polygons",
    "tidied_sheet",
    "weight_entries",
    "widened_members",
    "with_least_widths",
    "without_spikes",
]
