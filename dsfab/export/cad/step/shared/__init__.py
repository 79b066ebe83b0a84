"""Preparation of curved solids: the outlines of a sheet, and its two skins with tolerances."""
