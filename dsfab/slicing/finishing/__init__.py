"""Passes from sheet to sheet after the cut: openings, least widths, fillets, smooth walls, better triangles."""
