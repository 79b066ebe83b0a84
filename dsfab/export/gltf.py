"""GLB, the binary form of glTF 2.0 (Khronos 2021), for viewers: single precision, in metres.

The standard fixes the unit, metre, and the upward axis, +y: this is the one format that is not in millimetres, and
its axes are turned: (x, y, z) is written as (x, z, -y). `asset.extras` in the file repeats the unit.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats
from dsfab.export.part import Part, in_single_precision
from dsfab.export.readback import ReadBack, check_mesh, read_with_trimesh
from dsfab.export.text import one_line
from dsfab.units import MM_PER_M

FLOAT, UINT, VERTICES, INDICES = 5126, 5125, 34962, 34963
"""Numbers that the standard gives to kinds of arrays."""


def prepare(part: Part) -> Part:
    """The part in single precision."""
    return in_single_precision(part)


def encode(part: Part) -> Iterator[bytes]:
    """Header of 12 bytes, a chunk of JSON that describes the buffer, then the buffer: vertices and faces."""
    points = upright(part.V / MM_PER_M).astype("<f4")
    yield from chunked(_scene(part, points), points.tobytes() + part.F.astype("<u4").tobytes())


def chunked(scene: dict[str, Any], buffer: bytes) -> Iterator[bytes]:
    """The file of a scene and of its buffer, whose length is a multiple of four."""
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    yield b"glTF" + np.array([2, 28 + len(text) + len(buffer)], dtype="<u4").tobytes()
    yield len(text).to_bytes(4, "little") + b"JSON" + text
    yield len(buffer).to_bytes(4, "little") + b"BIN\0" + buffer


def check(part: Part, path: Path) -> ReadBack:
    """Read back with trimesh, and back to millimetres."""
    V, F = read_with_trimesh(path)
    return check_mesh(part, millimetres(V), F)


def millimetres(V: Floats) -> Floats:
    """(n, 3) of a file's vertices (n, 3): z upwards again."""
    return V[:, [0, 2, 1]] * [1, -1, 1] * MM_PER_M


def upright(V: Floats) -> Floats:
    """From z upwards to y upwards: a quarter turn about x."""
    return V[:, [0, 2, 1]] * [1, 1, -1]


def _scene(part: Part, points: np.ndarray[Any, np.dtype[np.float32]]) -> dict[str, Any]:
    """The JSON: one node, one mesh, two views of one buffer. Without normals, viewers must shade flat."""
    count, size, name = 3 * len(part.F), points.nbytes, one_line(part.name)
    low, high = (f(points, axis=0).astype(float).tolist() for f in (np.min, np.max))
    return {
        "asset": {"version": "2.0", "generator": f"dsfab {__version__}", "extras": {"unit": "metre"}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [
            {"name": name, "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": 4}]}
        ],
        "materials": [
            {"doubleSided": not part.is_solid, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.8}}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": FLOAT, "count": len(points), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": UINT, "count": count, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": size, "target": VERTICES},
            {"buffer": 0, "byteOffset": size, "byteLength": 4 * count, "target": INDICES},
        ],
        "buffers": [{"byteLength": size + 4 * count}],
    }
