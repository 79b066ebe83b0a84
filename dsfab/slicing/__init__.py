"""Stage 5, slicing: from stripes to a cut sheet."""

from dsfab.slicing.cutting.cut import cut, cut_polygons, divided_field_values, sheet_of
from dsfab.slicing.cutting.halving import LineHalving, halve_lines
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import Sheet
from dsfab.slicing.finishing.finish import TrialCut, material_area, tidied_polygons, tidied_sheet
from dsfab.slicing.finishing.least_widths import with_least_widths
from dsfab.slicing.finishing.loose_ends import Tidy
from dsfab.slicing.finishing.mesh_quality import improve_cells
from dsfab.slicing.finishing.openings import Merging, filled_slits, openings_of
from dsfab.slicing.finishing.point_contacts import resolve_pinches
from dsfab.slicing.measures.chart import Chart, chart_of
from dsfab.slicing.measures.overlay import DrawnBand, Overlay, stripe_overlay

__all__ = [
    "Chart", "DrawnBand", "LineHalving", "Merging", "Overlay", "PolygonMesh", "Sheet", "Tidy", "TrialCut", "chart_of",
    "cut", "cut_polygons", "divided_field_values", "filled_slits", "halve_lines", "improve_cells", "material_area",
    "openings_of", "resolve_pinches", "sheet_of", "stripe_overlay", "tidied_polygons", "tidied_sheet",
    "with_least_widths",
]  # fmt: skip
