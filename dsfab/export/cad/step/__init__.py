"""STEP (ISO 10303-21): solids of planar, folded, smooth or four-sided faces, or of triangles."""
