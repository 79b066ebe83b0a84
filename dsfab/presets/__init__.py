"""Folder of the shipped presets in an installed dsfab; in the repository, `presets/` at the top level contains them.

setuptools needs this file to find the package. `package-dir` in pyproject.toml points to the folder of presets."""
