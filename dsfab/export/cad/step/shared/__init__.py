"""Preparation of curved solids: outlines, and both skins with tolerances."""
