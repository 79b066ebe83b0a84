"""Stage 4, pattern: stripes of material, how wide they are, and what is kept besides them."""

from dsfab.pattern.boundary import boundary_lines
from dsfab.pattern.combing import crossed_over
from dsfab.pattern.corners import CornerPhase, corner_phase
from dsfab.pattern.cross_field import StressDirections, cross_field
from dsfab.pattern.density import Halving, density, halving, log_density
from dsfab.pattern.even_family import WIDTH_RULES, EvenFamily
from dsfab.pattern.evening import evened
from dsfab.pattern.frames import Frames
from dsfab.pattern.guide_lines import GuideLine, aimed
from dsfab.pattern.guides import Guidance, Guide
from dsfab.pattern.images import Images
from dsfab.pattern.keep import distance_to_boundary, distance_to_vertices, kept_layers
from dsfab.pattern.layers import Drawable, Layer, ModeFamily, mean_duty_factor, stripe_layers
from dsfab.pattern.phase import Flow, through_peaks
from dsfab.pattern.seams import signs_with_short_seams
from dsfab.pattern.shares import counted_share, face_points, material_points
from dsfab.pattern.stripes import Stripes, frequency_for
from dsfab.pattern.wave import wave
from dsfab.pattern.width import (
    JUMP,
    Rule,
    ShareJumpError,
    Widths,
    relative_stresses,
    slopes,
    solved_factor,
    vertex_means,
)

__all__ = [
    "JUMP",
    "WIDTH_RULES",
    "CornerPhase",
    "Drawable",
    "EvenFamily",
    "Flow",
    "Frames",
    "Guidance",
    "Guide",
    "GuideLine",
    "Halving",
    "Images",
    "Layer",
    "ModeFamily",
    "Rule",
    "ShareJumpError",
    "StressDirections",
    "Stripes",
    "Widths",
    "aimed",
    "boundary_lines",
    "corner_phase",
    "counted_share",
    "cross_field",
    "crossed_over",
    "density",
    "distance_to_boundary",
    "distance_to_vertices",
    "evened",
    "face_points",
    "frequency_for",
    "halving",
    "kept_layers",
    "log_density",
    "material_points",
    "mean_duty_factor",
    "relative_stresses",
    "signs_with_short_seams",
    "slopes",
    "solved_factor",
    "stripe_layers",
    "through_peaks",
    "vertex_means",
    "wave",
]
