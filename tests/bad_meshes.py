"""Mesh files that are bad on purpose, of one good surface in every format; and what each honestly says."""

import io
import json
import struct
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.surface.shapes import plate

GOOD = plate(length=3.0, width=2.0, edge=1.0)
V, F = GOOD.V, GOOD.F
HEADER = (
    "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
)
HEADER += "property list uchar int vertex_indices\nend_header\n"


def obj(V=V, faces=F):
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(V).tolist()]
    rows += ["f " + " ".join(str(i + 1) for i in face) for face in np.asarray(faces).tolist()]
    return ("\n".join(rows) + "\n").encode()


def off():
    rows = ["OFF", f"{len(V)} {len(F)} 0", *(f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in V)]
    return ("\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in F)]) + "\n").encode()


def ply_text():
    rows = [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in V] + [f"3 {a} {b} {c}" for a, b, c in F]
    return HEADER.format("ascii", len(V), len(F)).encode() + ("\n".join(rows) + "\n").encode()


def ply_binary():
    body = V.astype("<f4").tobytes() + b"".join(struct.pack("<B3i", 3, *face) for face in F.tolist())
    return HEADER.format("binary_little_endian", len(V), len(F)).encode() + body


def stl_binary():
    records = b"".join(struct.pack("<12fH", 0, 0, 1, *V[face].ravel(), 0) for face in F)
    return b"of dsfab's tests".ljust(80, b"\0") + struct.pack("<I", len(F)) + records


def stl_text():
    facets = []
    for face in F:
        corners = "".join(f"    vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in V[face])
        facets.append(f"  facet normal 0 0 1\n  outer loop\n{corners}  endloop\n  endfacet\n")
    return ("solid plate\n" + "".join(facets) + "endsolid plate\n").encode()


def gltf_tree(size):
    """The JSON of one mesh whose places come first and whose corners follow; y is up."""
    places = 12 * len(V)
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(V), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * len(F), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": places},
            {"buffer": 0, "byteOffset": places, "byteLength": size - places},
        ],
        "buffers": [{"byteLength": size}],
    }


def gltf_numbers():
    y_up = np.stack([V[:, 0], V[:, 2], -V[:, 1]], axis=1)
    return y_up.astype("<f4").tobytes() + F.astype("<u4").tobytes()


def glb(tree=None):
    numbers = gltf_numbers()
    text = json.dumps(tree or gltf_tree(len(numbers))).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(numbers), 0x004E4942) + numbers
    return b"glTF" + struct.pack("<II", 2, 12 + len(parts)) + parts


def gltf(uri):
    tree = gltf_tree(len(gltf_numbers()))
    tree["buffers"][0]["uri"] = uri
    return json.dumps(tree).encode()


def threemf(model=None):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr(
            "[Content_Types].xml",
            '<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
            '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>',
        )
        packed.writestr(
            "_rels/.rels",
            '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
            '<Relationship Id="r" Target="/3D/3dmodel.model" '
            'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>',
        )
        packed.writestr("3D/3dmodel.model", model or threemf_model())
    return file.getvalue()


def threemf_model(objects="", items='<item objectid="1"/>'):
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in V)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in F)
    return (
        '<?xml version="1.0" encoding="UTF-8"?><model unit="meter" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model">'
        f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object>{objects}</resources>"
        f"<build>{items}</build></model>"
    )


FORMATS: dict[str, Callable[[], bytes]] = {
    "plain.obj": obj,
    "plain.off": off,
    "text.ply": ply_text,
    "binary.ply": ply_binary,
    "binary.stl": stl_binary,
    "text.stl": stl_text,
    "plain.glb": glb,
    "embedded.gltf": lambda: gltf("data:application/octet-stream;base64," + _base64(gltf_numbers())),
    "plain.3mf": threemf,
}
"""A name for each kind of file, and the good surface in it."""


def _base64(data):
    import base64

    return base64.b64encode(data).decode()


@dataclass(frozen=True)
class BadFile:
    """A file, and what an honest reading of it may be.

    faces : triangles of what it says, None where it is to be refused.  says : what must be told, '' for nothing.
    """

    name: str
    data: bytes
    faces: int | None
    says: str = ""


def marked() -> Iterator[BadFile]:
    """With byte order marks, in UTF-16 with and without a mark, with other line ends."""
    for name in ("plain.obj", "plain.off", "text.ply", "text.stl"):
        good = FORMATS[name]()
        text = good.decode()
        yield BadFile(f"bom-{name}", b"\xef\xbb\xbf" + good, len(F), "byte order mark")
        yield BadFile(f"utf16-{name}", text.encode("utf-16"), len(F), "UTF-16")
        yield BadFile(f"utf16be-{name}", text.encode("utf-16-be"), len(F), "UTF-16")
        yield BadFile(f"utf32-{name}", text.encode("utf-32"), len(F), "UTF-32")
        yield BadFile(f"crlf-{name}", text.replace("\n", "\r\n").encode(), len(F))
        yield BadFile(f"cr-{name}", text.replace("\n", "\r").encode(), len(F))
        yield BadFile(f"comma-{name}", text.replace("0.", "0,").replace("1", "1,0").encode(), None)
        yield BadFile(f"underscore-{name}", text.replace("1", "1_0", 9).encode(), None)


def trailing() -> Iterator[BadFile]:
    """With more behind the end than there should be."""
    for name in ("plain.off", "text.ply", "binary.ply", "binary.stl", "plain.glb"):
        yield BadFile(f"more-{name}", FORMATS[name]() + b"7 7 7\n", len(F), "after")
    yield BadFile("more-plain.obj", obj() + b"7 7 7\n", len(F), "of unknown kind")
    yield BadFile("more-text.stl", stl_text() + b"7 7 7\n", None)
    yield BadFile("words-text.ply", ply_text() + b"the end\n", len(F), "not numbers")
    yield BadFile("no-end-text.stl", stl_text().partition(b"endsolid")[0], len(F), "endsolid, is missing")


def odd_faces() -> Iterator[BadFile]:
    """With faces, vertices and lines that are none."""
    yield BadFile("two-corners.obj", obj() + b"f 1 2\n", len(F), "fewer than three corners")
    yield BadFile("no-face.obj", obj() + b"v 9 9 9\n", len(F), "1 vertex without a face")
    yield BadFile("nan-alone.obj", obj() + b"v nan 0 0\n", len(F), "1 vertex without a face")
    yield BadFile("nan.obj", obj().replace(b"v 0 0 0", b"v nan 0 0", 1), None)
    yield BadFile("infinite.obj", obj().replace(b"v 0 0 0", b"v 1e999 0 0", 1), None)
    yield BadFile("far.obj", obj(3e38 * V), None)
    yield BadFile("five-numbers.obj", obj().replace(b"\nv", b" 1 1\nv", 1), None)
    yield BadFile("two-on-a-line.obj", obj().replace(b"\nv", b" v", 1), None)
    yield BadFile("lines.obj", obj() + b"l 1 2 3\np 1\n", len(F), "1 line")
    yield BadFile(
        "flipped.obj", obj(V, np.concatenate([F[: len(F) // 2], F[len(F) // 2 :, ::-1]])), len(F), "turned over"
    )
    soup = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    yield BadFile("soup.obj", obj(*soup), len(F), "merged")
    yield BadFile("zero.obj", obj() + b"f 0 1 2\n", None)
    yield BadFile("outside.obj", obj() + b"f 1 2 99\n", None)
    yield BadFile("float-corner.obj", obj() + b"f 1 2 3.5\n", None)


def bombs() -> Iterator[BadFile]:
    """Small files that announce or unpack to very much."""
    huge = 10**12
    for count in (huge, 2**31, 2**63, -5):
        yield BadFile(
            f"foo{count}.ply", HEADER.format("ascii", 3, 1).replace("end", f"element foo {count}\nend").encode(), None
        )
        many = HEADER.format("binary_little_endian", count, 1).encode() + bytes(99)
        yield BadFile(f"vertices{count}.ply", many, None)
        yield BadFile(f"faces{count}.ply", HEADER.format("ascii", 3, count).encode() + b"0 0 0 1 0 0 0 1 0\n", None)
        yield BadFile(f"off{count}.off", f"OFF\n{count} 1 0\n0 0 0\n".encode(), None)
    listed = HEADER.format("binary_little_endian", 1, 1).replace("list uchar", "list uint").encode()
    yield BadFile("list.ply", listed + bytes(12) + b"\xff\xff\xff\xff" + bytes(16), None)
    yield BadFile("count.stl", bytes(80) + b"\xff\xff\xff\xff" + bytes(50), None)
    for key, value in (("count", huge), ("byteOffset", huge), ("componentType", 9), ("count", -1), ("count", True)):
        tree = gltf_tree(len(gltf_numbers()))
        tree["accessors"][0][key] = value
        yield BadFile(f"{key}{value}.glb", glb(tree), None)
    tree = gltf_tree(len(gltf_numbers()))
    del tree["accessors"][0]["bufferView"]  # all zero, says glTF
    tree["accessors"][0]["count"] = huge
    yield BadFile("zeros.glb", glb(tree), None)
    tree = gltf_tree(len(gltf_numbers()))
    tree["nodes"][0]["children"] = [0]
    yield BadFile("circle.glb", glb(tree), None)
    yield BadFile(
        "draco.glb", glb(gltf_tree(len(gltf_numbers())) | {"extensionsRequired": ["KHR_draco_mesh_compression"]}), None
    )
    yield BadFile("deep.gltf", b"[" * 200_000, None)
    yield BadFile("elsewhere.gltf", gltf("https://nowhere.invalid/a.bin"), None)
    yield BadFile("above.gltf", gltf("../../etc/passwd"), None)
    yield BadFile("missing.gltf", gltf("not_there.bin"), None)
    yield BadFile(
        "zip.3mf",
        threemf(threemf_model().replace("<vertices>", "<vertices>" + '<vertex x="0" y="0" z="0"/>' * 700_000)),
        None,
    )
    levels = "".join(
        f'<object id="{k}" type="model"><components>{f"""<component objectid="{k - 1}"/>""" * 20}</components></object>'
        for k in range(2, 12)
    )
    yield BadFile("levels.3mf", threemf(threemf_model(levels, '<item objectid="11"/>')), None)
    circle = '<object id="2" type="model"><components><component objectid="2"/></components></object>'
    yield BadFile("circle.3mf", threemf(threemf_model(circle, '<item objectid="2"/>')), None)
    entity = threemf_model().replace("?><model", '?><!DOCTYPE m [<!ENTITY a "aaaa">]><model')
    yield BadFile("entity.3mf", threemf(entity), None)


def polygons(sizes, starry=True) -> Iterator[tuple[BadFile, float]]:
    """n-gons of so many corners, and their areas: round, dented, starry, straight-sided; tilted in space."""
    rng = np.random.default_rng(7)
    tilt = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for k in sizes:
        a = 2 * np.pi * np.arange(k) / k
        ring = np.stack([np.cos(a), np.sin(a)], axis=1)
        t = np.arange(k) / k * 4
        square = np.stack(
            [np.clip(np.abs(t - 2.5) - 0.5, 0, 1), np.clip(np.abs((t + 1) % 4 - 2.5) - 0.5, 0, 1)], axis=1
        )
        shapes = {"round": ring, "dented": ring * (1 - 0.5 * np.exp(-(((a - 3) * 3) ** 2)))[:, None], "square": square}
        shapes["wavy"] = ring * (1 + 0.3 * np.sin(5 * a))[:, None]
        if starry:
            shapes["starry"] = ring * rng.uniform(0.5, 1, k)[:, None]
        for name, P in shapes.items():
            x, y = P.T
            area = abs(0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
            data = obj(np.c_[P, np.zeros(k)] @ tilt.T, [range(k)])
            yield BadFile(f"{name}{k}.obj", data, k - 2), area


def written(file: BadFile, folder: Path) -> Path:
    path = folder / file.name
    path.write_bytes(file.data)
    return path
