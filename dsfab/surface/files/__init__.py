"""Readers of mesh and drawing files."""

from dsfab.surface.files.reading import DEFAULT_TRIANGLES, NOTHING_READ, Budget, FileRecord, PolygonFile, TriangleFile

__all__ = ["DEFAULT_TRIANGLES", "NOTHING_READ", "Budget", "FileRecord", "PolygonFile", "TriangleFile"]
