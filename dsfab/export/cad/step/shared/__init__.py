"""Smooth skins of a sheet, which the smooth solids and the solids by members share."""
