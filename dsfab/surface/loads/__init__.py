"""Supports, loads, load combinations, pattern regions, and the pickers (selections of vertices) that place them."""
