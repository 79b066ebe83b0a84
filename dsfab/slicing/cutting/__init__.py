"""Cutting of a surface along the edges of stripes."""
