"""Drawings: DXF for CAD, SVG sheets, and flat drawings for cutters."""
