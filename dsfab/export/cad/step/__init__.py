"""STEP files (ISO 10303-21) of solids."""
