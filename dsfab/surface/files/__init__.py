"""Mesh and drawing files: one reader per format, its limits, and the checked surface of a file."""

from dsfab.surface.files.reading import DEFAULT_TRIANGLES, NOTHING_READ, Budget, FileRecord, PolygonFile, TriangleFile

__all__ = ["DEFAULT_TRIANGLES", "NOTHING_READ", "Budget", "FileRecord", "PolygonFile", "TriangleFile"]
