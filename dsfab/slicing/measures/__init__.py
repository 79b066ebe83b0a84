"""Measures of a cut sheet: widths, lines, and quality of the pattern."""
