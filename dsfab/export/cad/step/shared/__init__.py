"""Plan of a curved solid, its outlines, and both skins with limits, for smooth solids and solids by members."""
