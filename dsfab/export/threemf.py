"""3MF (core specification 1.3): a zip of three small XML files, with the unit in it: millimetre.

Written here and judged by lib3mf, the consortium's own library: lib3mf's writer puts the clock into the zip and random
identifiers into the XML, so the same solid would not give the same file. Positions carry nine digits, which is single
precision, as readers hold them. No transform: slicers disagree about scaled ones.
"""

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh
from dsfab.export.text import one_line, rows

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
_TYPES = _HEAD + (
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
_RELATIONS = _HEAD + (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rel0" Target="/3D/3dmodel.model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)
_BEGINNING_OF_ZIP = (1980, 1, 1, 0, 0, 0)


def prepare(part: Part) -> Part:
    """The part in single precision."""
    return in_single_precision(part)


def encode(part: Part) -> Iterator[bytes]:
    """The zip, made in memory: its directory comes last but its entries' sizes first."""
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w") as archive:
        contents = {"[Content_Types].xml": _TYPES, "_rels/.rels": _RELATIONS, "3D/3dmodel.model": "".join(_model(part))}
        for name, text in contents.items():
            entry = zipfile.ZipInfo(name, _BEGINNING_OF_ZIP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 0  # else the zip names the operating system
            archive.writestr(entry, text.encode("utf-8"))
    yield package.getvalue()


def check(part: Part, path: Path) -> ReadBack:
    """Read back with lib3mf, which must have no warnings and find one manifold, oriented mesh in millimetres."""
    import lib3mf

    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    try:
        reader.ReadFromFile(str(path))
    except lib3mf.ELib3MFException as error:
        raise ExportError(f"lib3mf rejects the 3MF file of {part.name!r}: {error}; write another format") from error
    meshes = model.GetMeshObjects()
    faults = [reader.GetWarning(i)[1] for i in range(reader.GetWarningCount())]
    if model.GetUnit() != lib3mf.ModelUnit.MilliMeter:
        faults.append("the unit is not millimetre")
    if faults or meshes.Count() != 1:
        raise ExportError(f"lib3mf finds faults in the 3MF file of {part.name!r}: {'; '.join(faults)}")
    meshes.MoveNext()
    mesh = meshes.GetCurrentMeshObject()
    found = check_mesh(part, *_arrays(mesh))
    if not mesh.IsManifoldAndOriented():
        raise ExportError(
            f"lib3mf says that {part.name!r} is not manifold; look for edges with four triangles, or write STL"
        )
    return found


def _model(part: Part) -> Iterator[str]:
    """The XML of the model: one object, built once."""
    title = one_line(part.name)
    yield _HEAD + (
        '<model unit="millimeter" xml:lang="en-US" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">\n'
        f'<metadata name="Title">{escape(title)}</metadata>\n'
        f'<metadata name="Application">dsfab {__version__}</metadata>\n'
        f'<resources><object id="1" type="model" name={quoteattr(title)}><mesh>\n<vertices>\n'
    )
    yield from rows('<vertex x="%.9g" y="%.9g" z="%.9g"/>\n', *part.V.T)
    yield "</vertices>\n<triangles>\n"
    yield from rows('<triangle v1="%d" v2="%d" v3="%d"/>\n', *part.F.T)
    yield '</triangles>\n</mesh></object></resources>\n<build><item objectid="1"/></build>\n</model>\n'


def _arrays(mesh: object) -> tuple[Floats, Ints]:
    """Vertices and faces of a lib3mf mesh object."""
    points, corners = b"".join(mesh.GetVertices()), b"".join(mesh.GetTriangleIndices())  # type: ignore[attr-defined]
    V, F = np.frombuffer(points, np.float32), np.frombuffer(corners, np.uint32)  # as lib3mf lays them out
    return V.reshape(-1, 3).astype(np.float64), F.reshape(-1, 3).astype(np.int64)
