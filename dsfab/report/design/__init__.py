"""Reports of a design: numbers for `design.json`, lines for people, and the folder of its files."""
