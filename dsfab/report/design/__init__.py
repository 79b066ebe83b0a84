"""A design told: numbers for `design.json`, lines for people, and the folder of its files."""
