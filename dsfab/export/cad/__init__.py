"""CAD formats: 3DM for Rhino, STEP and BREP; and IFC for building models."""
