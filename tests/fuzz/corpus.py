"""Good small files of each target, from which the fuzzer begins, and words that it may put together."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from dsfab.core.toml_files import shipped_presets
from dsfab.preset.model import Preset
from tests.bad_meshes import FORMATS, bombs, marked, odd_faces, trailing

SEEDS = Path(__file__).with_name("seeds")

WORDS = {
    "obj": ("v ", "f ", "vn ", "vt ", "g ", "l ", "//", "/", "-1", "1e400", "nan", "\\\n", "#"),
    "off": ("OFF", "COFF", "NOFF", "BINARY", "4OFF", "nan", "#", "-1", "1e400"),
    "ply": ("element ", "property ", "list ", "uchar ", "int ", "double ", "float ", "face ", "vertex ", "comment ",
            "format ascii 1.0\n", "format binary_big_endian 1.0\n", "end_header\n", "vertex_index", "tristrips"),
    "stl": ("solid", "facet normal", "outer loop", "vertex ", "endloop", "endfacet", "endsolid", "nan"),
    "gltf": ('"count":', '"byteStride":', '"sparse":', '"matrix":', '"scale":', '"mode":', '"normalized":',
             '"children":', '"rotation":', '"extensionsRequired":', "null", "true", "1e999", "-1", "[", "{"),
    "3mf": ("<item ", "<component ", "transform=", "unit=", "objectid=", "<vertex ", "<triangle "),
    "dxf": ("LWPOLYLINE", "POLYLINE", "VERTEX", "SEQEND", "SPLINE", "ELLIPSE", "ARC", "CIRCLE", "INSERT", "BLOCK",
            "HATCH", "ENDBLK", "LINE", "ENTITIES", "ENDSEC", "SECTION", "EOF", "$INSUNITS", "TEXT",
            "\n 10\n", "\n 42\n", "nan"),
    "toml": ("[surface]", "[[surface.load]]", "[pattern.major]", "= true", "= nan", "= inf", "= [", '"""',
             "'''", "1e999"),
}  # fmt: skip
WORDS["glb"], WORDS["values"], WORDS["3dm"] = WORDS["gltf"], ("\xff",), ("\xff",)
WORDS["set"] = WORDS["toml"]

CURVES = """0
SECTION
2
HEADER
9
$ACADVER
1
AC1015
9
$INSUNITS
70
6
0
ENDSEC
0
SECTION
2
BLOCKS
0
BLOCK
2
B
70
0
10
0
20
0
0
LWPOLYLINE
100
AcDbEntity
8
door
100
AcDbPolyline
90
3
70
1
10
0
20
0
42
0.5
10
2
20
0
10
1
20
1
0
ENDBLK
0
ENDSEC
0
SECTION
2
ENTITIES
{}
0
ENDSEC
0
EOF
"""
"""A small DXF file with a block, around entities."""
ENTITIES = {
    "circle": "0 CIRCLE 8 a 10 1 20 2 30 0 40 3",
    "insert": "0 INSERT 8 a 2 B 10 5 20 5 41 2 50 30",
    "lines": "0 LINE 8 a 10 0 20 0 11 1 21 0 0 LINE 8 a 10 1 20 0 11 1 21 1 "
    "0 ARC 8 a 10 0.5 20 0.5 40 0.70710678 50 45 51 225",
    "polyline": "0 POLYLINE 8 a 66 1 70 1 0 VERTEX 10 0 20 0 0 VERTEX 10 1 20 0 0 VERTEX 10 0 20 1 0 SEQEND",
    "ellipse": "0 ELLIPSE 100 AcDbEntity 8 a 100 AcDbEllipse 10 0 20 0 11 2 21 0 40 0.5 41 0 42 6.283185307179586",
    "spline": "0 SPLINE 100 AcDbEntity 8 a 100 AcDbSpline 70 1 71 2 72 6 73 3 "
    "40 0 40 0 40 0 40 1 40 1 40 1 10 0 20 0 10 1 20 1 10 0 20 0",
    "several": "0 CIRCLE 8 a 10 1 20 2 30 0 40 3 0 TEXT 8 b 10 0 20 0 40 1 1 hello 0 CIRCLE 8 b 10 0 20 0 30 4 40 1",
}


def dxf(entities: str) -> bytes:
    """A DXF file of entities, given on one line."""
    return CURVES.format("\n".join(entities.split())).encode()


def rhino() -> Iterator[bytes]:
    """A circle and a polyline, once each, as 3DM files; nothing where rhino3dm is not installed."""
    try:
        import rhino3dm
    except ImportError:
        return
    for kind in range(2):
        model = rhino3dm.File3dm()
        model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Centimeters
        if kind:
            model.Objects.AddCircle(rhino3dm.Circle(rhino3dm.Point3d(50, 50, 0), 20))
        else:
            corners = [rhino3dm.Point3d(*p) for p in ((0, 0, 0), (90, 0, 0), (90, 0, 210), (0, 0, 0))]
            model.Objects.AddPolyline(rhino3dm.Polyline(corners))
        with tempfile.TemporaryDirectory() as folder:
            model.Write(f"{folder}/m.3dm", 7)
            yield Path(folder, "m.3dm").read_bytes()


def beginnings(target: str) -> Iterator[bytes]:
    """Files from which a target is fuzzed: good ones, those that are bad on purpose, and those that once broke it."""
    yield from (path.read_bytes() for path in sorted((SEEDS / target).glob("*")))
    yield from (make() for name, make in FORMATS.items() if name.endswith(f".{target}"))
    bad = (file for files in (marked, trailing, odd_faces, bombs) for file in files())
    yield from (file.data for file in bad if file.name.endswith(f".{target}") and len(file.data) < 20_000)
    if target == "dxf":
        yield from map(dxf, ENTITIES.values())
    if target == "3dm":
        yield from rhino()
    if target == "toml":
        yield from (path.read_bytes() for path in shipped_presets().values())
    if target == "set":
        yield b"pattern.major.frequency=12\nsurface.load.0.direction=[0,0,-1]\nstatics.thickness=0.1"
        yield b"statics.thickness=0.1\npattern.keep=0.4\nsurface.edge=1e-3\nslicing={}"
    if target == "values":
        yield from (bytes((37 * i * j + j) % 256 for j in range(24)) for i in range(60))


def words(target: str) -> tuple[str, ...]:
    """What the fuzzer may insert at once; for presets also the names of their sections and keys."""
    keys: list[str] = []
    if target in ("toml", "set"):
        for name, field in Preset.model_fields.items():
            inner = getattr(field.annotation, "model_fields", {})
            keys += [name, *(f"{name}.{key}" for key in inner), *inner]
    return (*WORDS[target], *dict.fromkeys(keys))
