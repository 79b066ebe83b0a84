"""Reports of a design: numbers, lines for people, and the folder of files."""
