"""Preparation of curved solids for step = 'smooth' and step = 'members': outlines, and both skins with tolerances."""
