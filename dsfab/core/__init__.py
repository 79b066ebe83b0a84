"""Basic modules for all parts of dsfab."""
