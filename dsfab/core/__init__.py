"""Foundations without knowledge of structures: errors, units, arrays, messages, limits, materials, solvers."""
