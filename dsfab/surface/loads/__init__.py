"""Supports, loads, combinations and pattern regions, and the pickers that place them."""
