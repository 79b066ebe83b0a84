"""Measures of a cut sheet and of its pattern: widths, lines, and quality of the pattern."""
