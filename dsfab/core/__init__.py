"""Basic modules that every room uses: errors, units, arrays, messages, limits, materials and solvers."""
