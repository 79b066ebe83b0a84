"""Cutting of a surface along the edges of stripes: polygons, level lines, and the ends of members."""
