"""Stage 4, pattern: stripes of material, how wide they are, and what is kept besides them."""

from dsfab.pattern.evening import evened
from dsfab.pattern.keep import distance_to_boundary, distance_to_vertices
from dsfab.pattern.layers import Family, Layer, mean_duty_factor
from dsfab.pattern.shares import counted_share, face_points, material_points
from dsfab.pattern.stripes import Stripes, frequency_for
from dsfab.pattern.wave import wave
from dsfab.pattern.width import Rule, Widths, relative_stresses, slopes, solved_factor, vertex_means

__all__ = [
    "Family",
    "Layer",
    "Rule",
    "Stripes",
    "Widths",
    "counted_share",
    "distance_to_boundary",
    "distance_to_vertices",
    "evened",
    "face_points",
    "frequency_for",
    "material_points",
    "mean_duty_factor",
    "relative_stresses",
    "slopes",
    "solved_factor",
    "vertex_means",
    "wave",
]
