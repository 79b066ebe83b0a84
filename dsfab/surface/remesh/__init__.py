"""Remeshing: even triangles of a wanted size on the same surface, with its boundaries, creases and corners.

Edges are divided, collapsed and flipped, and vertices moved [Botsch and Kobbelt 2004]. Each step treats whole arrays of
edges that do not touch, ordered by length or gain and then by index, so that the same surface gives the same mesh.
"""

from dsfab.surface.remesh.remeshing import remeshed_surface
from dsfab.surface.remesh.sizes import SizeField, change_sizes

__all__ = ["SizeField", "change_sizes", "remeshed_surface"]
