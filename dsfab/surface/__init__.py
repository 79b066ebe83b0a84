"""Stage 1 of a design: the surface, its supports and its loads."""

from dsfab.surface.clean.overlaps import parallel_remarks
from dsfab.surface.clean.repair import is_scan, mended_mesh, repaired_scan
from dsfab.surface.clean.seams import coincident
from dsfab.surface.edge_changes import CREASE, halved_edges, refined_surface
from dsfab.surface.fields import (
    CornerField,
    DividedField,
    StructureLine,
    chains,
    hat_gradients,
    polyline_length,
    simplified_line,
)
from dsfab.surface.files import DEFAULT_TRIANGLES, FileRecord
from dsfab.surface.files.drawings import Marks, marks_on_layers
from dsfab.surface.files.mesh_files import MESH_SUFFIXES, RawMesh, raw_mesh
from dsfab.surface.files.other_libraries import as_circle, as_polyline, require_compas
from dsfab.surface.files.ply import ply_chunks
from dsfab.surface.files.reader import (
    MeshFacts,
    SurfaceInFile,
    describe,
    finite_faces,
    mended_raw_mesh,
    mesh_facts,
    normalized_surface,
    read_surface,
    surface_in_file,
    surface_of_file,
    unit_guess,
)
from dsfab.surface.files.reading import MARK_LAYERS
from dsfab.surface.geodesic import Distances, Origins, geodesic_distances
from dsfab.surface.loads.combinations import (
    ACTION_OF_LOAD,
    ActionKind,
    Combination,
    CombinationRule,
    DesignFactors,
    LimitState,
    action_kind,
    action_mistakes,
    case_names,
    combined_case,
    en1990_combinations,
    load_cases,
    loads_by_action,
)
from dsfab.surface.loads.load_case import (
    Cladding,
    Force,
    Line,
    Load,
    LoadCase,
    LoadParts,
    Pressure,
    SelfWeight,
    Snow,
    Wind,
    faces_without_upper_side,
    load_parts,
)
from dsfab.surface.loads.outlines import Brush, ClosedCurves, Picker, PlanPolygon, edges_of, self_contained
from dsfab.surface.loads.pickers import (
    All,
    Ball,
    Boundary,
    Box,
    CaseName,
    Facing,
    Nearest,
    Side,
    Vertices,
    VerticesLeft,
)
from dsfab.surface.loads.regions import PatternRegion, region_key, with_regions
from dsfab.surface.loads.static_equilibrium import LiftingRule
from dsfab.surface.loads.supports import Support, load_names, support_names
from dsfab.surface.mesh import (
    NearestPlaces,
    Surface,
    bounding_box,
    nearest_places,
    signed_volume,
    signed_volumes,
    total_area,
    weights_at,
)
from dsfab.surface.orientation import Up, one_sided_pieces, upright_vertices
from dsfab.surface.remesh import SizeField, change_sizes, remeshed_surface
from dsfab.surface.remesh.mirrors import (
    FAR_TOLERANCE,
    LARGEST_GROUP,
    MATRIX_TOLERANCE,
    centroid,
    far_directions,
    generated_group,
    mirror,
    planes_through,
    round_axis,
)
from dsfab.surface.shapes import FIGURES, SHAPES
from dsfab.surface.topology import (
    EdgeTable,
    corner_fans,
    corners_of,
    edge_table,
    faces_at,
    half_edges,
    link_components,
    next_half_edge,
    pieces,
    spanned_edges,
)

__all__ = [
    "ACTION_OF_LOAD", "CREASE", "DEFAULT_TRIANGLES", "FAR_TOLERANCE", "FIGURES", "LARGEST_GROUP", "MARK_LAYERS",
    "MATRIX_TOLERANCE", "MESH_SUFFIXES", "SHAPES", "ActionKind", "All", "Ball", "Boundary", "Box", "Brush", "CaseName",
    "Cladding", "ClosedCurves", "Combination", "CombinationRule", "CornerField", "DesignFactors", "Distances",
    "DividedField", "EdgeTable", "Facing", "FileRecord", "Force", "LiftingRule", "LimitState", "Line", "Load",
    "LoadCase", "LoadParts", "Marks", "MeshFacts", "Nearest", "NearestPlaces", "Origins", "PatternRegion", "Picker",
    "PlanPolygon", "Pressure", "RawMesh", "SelfWeight", "Side", "SizeField", "Snow", "StructureLine", "Support",
    "Surface", "SurfaceInFile", "Up", "Vertices", "VerticesLeft", "Wind", "action_kind", "action_mistakes", "as_circle",
    "as_polyline", "bounding_box", "case_names", "centroid", "chains", "change_sizes", "coincident", "combined_case",
    "corner_fans", "corners_of", "describe", "edge_table", "edges_of", "en1990_combinations", "faces_at",
    "faces_without_upper_side", "far_directions", "finite_faces", "generated_group", "geodesic_distances", "half_edges",
    "halved_edges", "hat_gradients", "is_scan", "link_components", "load_cases", "load_names", "load_parts",
    "loads_by_action", "marks_on_layers", "mended_mesh", "mended_raw_mesh", "mesh_facts", "mirror", "nearest_places",
    "next_half_edge", "normalized_surface", "one_sided_pieces", "parallel_remarks", "pieces", "planes_through",
    "ply_chunks", "polyline_length", "raw_mesh", "read_surface", "refined_surface", "region_key", "remeshed_surface",
    "repaired_scan", "require_compas", "round_axis", "self_contained", "signed_volume", "signed_volumes",
    "simplified_line", "spanned_edges", "support_names", "surface_in_file", "surface_of_file", "total_area",
    "unit_guess", "upright_vertices", "weights_at", "with_regions",
]  # fmt: skip
