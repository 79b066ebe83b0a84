"""CAD formats: 3DM for Rhino, and STEP and BREP."""
