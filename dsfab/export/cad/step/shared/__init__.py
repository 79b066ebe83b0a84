"""Plan of a curved solid, its outlines, and both skins with limits, for smooth files and step = 'members'."""
