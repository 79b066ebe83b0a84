"""Remeshing: even triangles of a wanted size on the same surface, its boundaries, creases and corners kept.

Edges are split, collapsed and flipped, and vertices moved [Botsch and Kobbelt 2004], in whole arrays: many at once that
do not touch, in an order by length or gain and then by index, so that the same surface gives the same mesh.

features.py which edges are kept   curves.py as curves   size.py and size_fields.py how long edges are wanted
net.py the mesh in between   split.py  collapse.py  flip.py  smoothing.py  the four steps
facets.py the smooth surface through a mesh
"""

from dsfab.surface.remesh.remeshing import remeshed
from dsfab.surface.remesh.sizes import SizeField, change_sizes

__all__ = ["SizeField", "change_sizes", "remeshed"]
