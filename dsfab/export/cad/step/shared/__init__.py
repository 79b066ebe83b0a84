"""Plan of a curved solid, its outlines, and both skins with tolerances, for step = 'smooth' and step = 'members'."""
