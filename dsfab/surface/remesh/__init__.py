"""Remeshing: even triangles of a wanted size on an unchanged surface, with its boundaries, creases and corners.

The method divides, collapses and flips edges, and moves vertices [Botsch and Kobbelt 2004]. Each step changes many
edges without common vertices at once. Equal surfaces give equal meshes."""

from dsfab.surface.remesh.remeshing import remeshed_surface
from dsfab.surface.remesh.sizes import SizeField, change_sizes

__all__ = ["SizeField", "change_sizes", "remeshed_surface"]
