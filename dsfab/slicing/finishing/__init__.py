"""Passes over a cut sheet: openings, least widths, round corners, smooth walls, better triangles."""
