"""Basic modules for all parts of dsfab: errors, units, arrays, messages, limits, materials and solvers."""
