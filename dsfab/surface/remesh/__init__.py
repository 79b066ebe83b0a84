"""Remeshing: nearly equilateral triangles of a wanted size on an unchanged surface [Botsch and Kobbelt 2004]."""

from dsfab.surface.remesh.remeshing import remeshed_surface
from dsfab.surface.remesh.sizes import SizeField, change_sizes

__all__ = ["SizeField", "change_sizes", "remeshed_surface"]
