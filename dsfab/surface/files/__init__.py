"""Mesh files to raw arrays, one format, one module, each with what it may cost and what is said of the file.

guard.py  what goes wrong, as a sentence
limits.py  how much a reader may take       record.py  what was read, repaired and dropped    text.py  bytes to lines
obj.py  off.py  ply.py  stl.py  gltf.py (also .glb)  threemf.py  dxf.py  rhino.py  occt.py (STEP, BREP)
apart.py  the last two, in a process of their own      curves.py  what drawings share
soup.py  faces that share no vertex, joined
"""

from dsfab.surface.files.reading import DEFAULT_TRIANGLES, NOTHING_READ, Budget, FileRecord, PolygonFile, TriangleFile

__all__ = ["DEFAULT_TRIANGLES", "NOTHING_READ", "Budget", "FileRecord", "PolygonFile", "TriangleFile"]
