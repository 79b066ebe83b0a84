"""Stage 4, pattern: stripes of material, and what is kept besides them."""

from dsfab.pattern.keep import distance_to_boundary, distance_to_vertices
from dsfab.pattern.stripes import Stripes
from dsfab.pattern.wave import wave

__all__ = ["Stripes", "distance_to_boundary", "distance_to_vertices", "wave"]
