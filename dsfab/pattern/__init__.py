"""Stage 4, pattern: stripes of material, their widths, and regions that always stay material."""

from dsfab.pattern.direction_field import (
    FamilyRole,
    StressDirections,
    boundary_lines,
    cross_field,
    family_crossings,
    family_roles,
    signs_with_short_seams,
)
from dsfab.pattern.frames import Frames
from dsfab.pattern.guides import Guidance, Guide, GuideLine, guide_phases
from dsfab.pattern.kept_regions import distance_to_boundary, distance_to_vertices, kept_layers
from dsfab.pattern.layers import (
    WIDTH_RULES,
    DrawableFamily,
    EvenFamily,
    Layer,
    ModeFamily,
    counted_share,
    face_points,
    material_points,
    mean_duty_factor,
    stripe_layers,
)
from dsfab.pattern.phases import CornerPhase, Flow, corner_phase, through_peaks
from dsfab.pattern.stripe_density import Halving, density, halving, log_density
from dsfab.pattern.stripes import Stripes, frequency_for
from dsfab.pattern.supported_loops import LoopSurroundings, small_loops
from dsfab.pattern.symmetry import Images
from dsfab.pattern.widths import (
    JUMP,
    Rule,
    ShareJumpError,
    Widths,
    evened_grading,
    relative_stresses,
    slopes,
    solved_factor,
    vertex_means,
)

__all__ = [
    "JUMP", "WIDTH_RULES", "CornerPhase", "DrawableFamily", "EvenFamily", "FamilyRole", "Flow", "Frames", "Guidance",
    "Guide", "GuideLine", "Halving", "Images", "Layer", "LoopSurroundings", "ModeFamily", "Rule", "ShareJumpError",
    "StressDirections", "Stripes", "Widths", "boundary_lines", "corner_phase", "counted_share", "cross_field",
    "density", "distance_to_boundary", "distance_to_vertices", "evened_grading", "face_points", "family_crossings",
    "family_roles", "frequency_for", "guide_phases", "halving", "kept_layers", "log_density", "material_points",
    "mean_duty_factor", "relative_stresses", "signs_with_short_seams", "slopes", "small_loops", "solved_factor",
    "stripe_layers", "through_peaks", "vertex_means",
]  # fmt: skip
