"""Holds the name: in a wheel the presets of the top level's `presets/` lie here, in place of this file.

setuptools looks for packages by their folders, and finds this one; `package-dir` in pyproject.toml says whose files it
takes.
"""
