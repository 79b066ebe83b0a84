"""Mesh formats: STL, 3MF, OBJ, PLY, OFF and GLB."""
