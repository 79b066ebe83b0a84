"""Files of triangles: STL, 3MF, OBJ, PLY and OFF."""

import io
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh, merged_mesh, read_with_igl, read_with_trimesh
from dsfab.export.writing import one_line, rows
from dsfab.surface import ply_chunks

_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def prepare_stl(part: Part) -> Part:
    """Return the part with coordinates in single precision. Merge vertices at equal positions."""
    part = in_single_precision(part)
    V, F = merged_mesh(part.V, part.F)
    return replace(part, V=V, F=F)


def encode_stl(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a binary STL file."""
    records = np.zeros(len(part.F), dtype=_RECORD)
    corners = part.V[part.F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    records["corners"] = corners
    yield f"binary STL, unit: millimetre, written by dsfab {__version__}".encode("ascii").ljust(79) + b"\0"
    yield np.uint32(len(records)).astype("<u4").tobytes()
    yield records.tobytes()


def check_stl(part: Part, path: Path) -> ReadBack:
    """Read the file back with libigl and compare the mesh with the part."""
    return check_mesh(part, *merged_mesh(*read_with_igl(path)))


def encode_obj(part: Part) -> Iterator[bytes]:
    """Yield the bytes of an OBJ file."""
    yield f"# written by dsfab {__version__}\n# unit: millimetre\no {one_line(part.name)}\n".encode()
    yield from (text.encode("ascii") for text in rows("v %.17g %.17g %.17g\n", *part.V.T))
    yield from (text.encode("ascii") for text in rows("f %d %d %d\n", *(part.F + 1).T))


def check_with_trimesh(part: Part, path: Path) -> ReadBack:
    """Read the file back with trimesh and compare the mesh with the part."""
    return check_mesh(part, *read_with_trimesh(path))


def encode_off(part: Part) -> Iterator[bytes]:
    """Yield the bytes of an OFF file."""
    yield f"OFF\n# {one_line(part.name)}, written by dsfab {__version__}\n# unit: millimetre\n".encode()
    yield f"{len(part.V)} {len(part.F)} 0\n".encode()
    yield from (text.encode("ascii") for text in rows("%.17g %.17g %.17g\n", *part.V.T))
    yield from (text.encode("ascii") for text in rows("3 %d %d %d\n", *part.F.T))


def encode_ply(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a binary PLY file."""
    return ply_chunks(part.V, part.F, "millimetre")


def check_ply(part: Part, path: Path) -> ReadBack:
    """Read the file back with libigl and compare the mesh with the part."""
    read = check_mesh(part, *read_with_igl(path))
    short = sum(map(len, encode_ply(part))) - path.stat().st_size
    if short > 0:
        raise ExportError(
            f"the file of {part.name!r} is {short} bytes too short; free some space or write another format"
        )
    return read


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


def encode_3mf(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a 3MF file."""
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w") as archive:
        contents = {"[Content_Types].xml": _TYPES, "_rels/.rels": _RELATIONS, "3D/3dmodel.model": "".join(_model(part))}
        for name, text in contents.items():
            entry = zipfile.ZipInfo(name, _BEGINNING_OF_ZIP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 0  # gives equal files on all operating systems
            archive.writestr(entry, text.encode("utf-8"))
    yield package.getvalue()


def check_3mf(part: Part, path: Path) -> ReadBack:
    """Read the file back with lib3mf and compare the mesh with the part."""
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
        faults.append("the unit of the file is not the millimetre")
    if faults or meshes.Count() != 1:
        raise ExportError(f"lib3mf finds faults in the 3MF file of {part.name!r}: {'; '.join(faults)}")
    meshes.MoveNext()
    mesh = meshes.GetCurrentMeshObject()
    result = check_mesh(part, *_arrays(mesh))
    if not mesh.IsManifoldAndOriented():
        raise ExportError(
            f"lib3mf finds that {part.name!r} is not manifold; repair edges with four triangles, or write STL"
        )
    return result


def _model(part: Part) -> Iterator[str]:
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
    points, corners = b"".join(mesh.GetVertices()), b"".join(mesh.GetTriangleIndices())  # type: ignore[attr-defined]
    V, F = np.frombuffer(points, np.float32), np.frombuffer(corners, np.uint32)  # lib3mf stores these types
    return V.reshape(-1, 3).astype(np.float64), F.reshape(-1, 3).astype(np.int64)
