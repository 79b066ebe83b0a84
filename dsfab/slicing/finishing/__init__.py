"""Passes over a cut sheet: openings, minimum widths, round corners, smooth walls, better triangles."""
