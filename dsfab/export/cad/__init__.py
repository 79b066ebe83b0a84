"""CAD formats: 3DM, STEP, BREP and IFC."""
