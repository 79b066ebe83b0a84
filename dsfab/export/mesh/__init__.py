"""Mesh formats: STL, 3MF, OBJ, PLY, OFF and GLB, and the soundness of a mesh."""
