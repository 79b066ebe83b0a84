"""The name of a package without code: a wheel has the presets of the top level's `presets/` beside this file.

setuptools finds packages by their folders, and this folder by this file; `package-dir` in pyproject.toml gives it the
files of the top level.
"""
