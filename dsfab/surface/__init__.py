"""Stage 1, what is given: the mesh, its supports and its loads."""

from dsfab.surface.bridges import as_circle, as_polyline, require_compas
from dsfab.surface.cases import Combination, LimitState, load_cases, together
from dsfab.surface.climate import Snow, Wind
from dsfab.surface.corner_field import CornerField
from dsfab.surface.cover import one_sided_pieces
from dsfab.surface.creases import CREASE
from dsfab.surface.divided import DividedField
from dsfab.surface.doubled import twin_remarks
from dsfab.surface.drawing_files import Marks, marks_on_layers
from dsfab.surface.en1990 import (
    OF_LOADS,
    ActionKind,
    CombinationRule,
    DesignFactors,
    action_mistakes,
    en1990_combinations,
)
from dsfab.surface.enclosed import box, signed_volume, signed_volumes, total_area
from dsfab.surface.files import MESH_SUFFIXES, RawMesh, raw_mesh
from dsfab.surface.formats import DEFAULT_TRIANGLES, FileRecord
from dsfab.surface.formats.ply import ply_chunks
from dsfab.surface.geodesic import Distances, Origins, geodesic_distances
from dsfab.surface.hats import hat_gradients
from dsfab.surface.lines import StructureLine, chains, polyline_length, simplified_line
from dsfab.surface.load_parts import LoadParts
from dsfab.surface.loads import Cladding, Force, Line, Load, LoadCase, Pressure, SelfWeight, load_parts
from dsfab.surface.mend import MendedMesh, mended
from dsfab.surface.mesh import Surface
from dsfab.surface.mirrors import (
    FAR,
    LARGEST_GROUP,
    SNAP,
    centroid,
    far_directions,
    generated_group,
    mirror,
    planes_through,
    round_axis,
)
from dsfab.surface.names import load_names, support_names
from dsfab.surface.nearest import NearestPlaces, nearest, weights_at
from dsfab.surface.neighbours import corners_of, faces_at, spanned_edges
from dsfab.surface.orientation import Up, upright
from dsfab.surface.outlines import Brush, ClosedCurves, PlanPolygon, self_contained
from dsfab.surface.picker import Picker, edges_of
from dsfab.surface.pickers import All, Ball, Boundary, Box, CaseName, Facing, Nearest, Side, Vertices, VerticesLeft
from dsfab.surface.places import coincident
from dsfab.surface.reader import (
    MeshFacts,
    SurfaceInFile,
    describe,
    finite_faces,
    mended_raw,
    mesh_facts,
    normalized,
    read_surface,
    surface_in_file,
    surface_of_file,
    unit_guess,
)
from dsfab.surface.refine import halved, refined
from dsfab.surface.regions import PatternRegion, RegionedSurface, region_key, with_regions
from dsfab.surface.remesh import SizeField, change_sizes, remeshed
from dsfab.surface.repair import is_scan, repaired_scan
from dsfab.surface.shapes import FIGURES, SHAPES
from dsfab.surface.supports import Support
from dsfab.surface.topology import EdgeTable, connected, corner_fans, edge_table, half_edges, next_half_edge, pieces

__all__ = [
    "CREASE",
    "DEFAULT_TRIANGLES",
    "FAR",
    "FIGURES",
    "LARGEST_GROUP",
    "MESH_SUFFIXES",
    "OF_LOADS",
    "SHAPES",
    "SNAP",
    "ActionKind",
    "All",
    "Ball",
    "Boundary",
    "Box",
    "Brush",
    "CaseName",
    "Cladding",
    "ClosedCurves",
    "Combination",
    "CombinationRule",
    "CornerField",
    "DesignFactors",
    "Distances",
    "DividedField",
    "EdgeTable",
    "Facing",
    "FileRecord",
    "Force",
    "LimitState",
    "Line",
    "Load",
    "LoadCase",
    "LoadParts",
    "Marks",
    "MendedMesh",
    "MeshFacts",
    "Nearest",
    "NearestPlaces",
    "Origins",
    "PatternRegion",
    "Picker",
    "PlanPolygon",
    "Pressure",
    "RawMesh",
    "RegionedSurface",
    "SelfWeight",
    "Side",
    "SizeField",
    "Snow",
    "StructureLine",
    "Support",
    "Surface",
    "SurfaceInFile",
    "Up",
    "Vertices",
    "VerticesLeft",
    "Wind",
    "action_mistakes",
    "as_circle",
    "as_polyline",
    "box",
    "centroid",
    "chains",
    "change_sizes",
    "coincident",
    "connected",
    "corner_fans",
    "corners_of",
    "describe",
    "edge_table",
    "edges_of",
    "en1990_combinations",
    "faces_at",
    "far_directions",
    "finite_faces",
    "generated_group",
    "geodesic_distances",
    "half_edges",
    "halved",
    "hat_gradients",
    "is_scan",
    "load_cases",
    "load_names",
    "load_parts",
    "marks_on_layers",
    "mended",
    "mended_raw",
    "mesh_facts",
    "mirror",
    "nearest",
    "next_half_edge",
    "normalized",
    "one_sided_pieces",
    "pieces",
    "planes_through",
    "ply_chunks",
    "polyline_length",
    "raw_mesh",
    "read_surface",
    "refined",
    "region_key",
    "remeshed",
    "repaired_scan",
    "require_compas",
    "round_axis",
    "self_contained",
    "signed_volume",
    "signed_volumes",
    "simplified_line",
    "spanned_edges",
    "support_names",
    "surface_in_file",
    "surface_of_file",
    "together",
    "total_area",
    "twin_remarks",
    "unit_guess",
    "upright",
    "weights_at",
    "with_regions",
]
