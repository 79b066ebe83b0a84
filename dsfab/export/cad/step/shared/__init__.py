"""Data that smooth solids and solids by members share: the plan of a solid, its outlines, and both skins with
limits."""
