"""GLB files (binary glTF 2.0) in metres, with the y axis upwards."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.units import MM_PER_M
from dsfab.export.members import facts_of_members
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_mesh, check_shapes, layer_colour, read_with_trimesh
from dsfab.export.writing import one_line

FLOAT, UINT, VERTICES, INDICES = 5126, 5125, 34962, 34963  # numbers of the glTF standard for kinds of arrays


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a GLB file with one mesh."""
    name, matte = one_line(part.name), {"metallicFactor": 0.0, "roughnessFactor": 0.8}
    materials = [{"doubleSided": not part.is_solid, "pbrMetallicRoughness": matte}]
    yield from _chunks([{"mesh": 0, "name": name}], [_mesh(name, 0, 0)], materials, _arrays(part.V, part.F))


def _arrays(V: Floats, F: Ints) -> list[np.ndarray[Any, Any]]:
    points = (V / MM_PER_M)[:, [0, 2, 1]] * [1, 1, -1]  # y is up
    return [points.astype("<f4"), F.astype("<u4")]


def _chunks(
    nodes: Sequence[Any], meshes: Sequence[Any], materials: Sequence[Any], arrays: list[np.ndarray[Any, Any]]
) -> Iterator[bytes]:
    size = [array.nbytes for array in arrays]
    start = np.concatenate([[0], np.cumsum(size)]).tolist()
    scene = {
        "asset": {"version": "2.0", "generator": f"dsfab {__version__}", "extras": {"unit": "metre"}},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": [_accessor(k, array) for k, array in enumerate(arrays)],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start[k], "byteLength": size[k], "target": (VERTICES, INDICES)[k % 2]}
            for k in range(len(arrays))
        ],
        "buffers": [{"byteLength": start[-1]}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    yield b"glTF" + np.array([2, 28 + len(text) + start[-1]], dtype="<u4").tobytes()
    yield len(text).to_bytes(4, "little") + b"JSON" + text
    yield start[-1].to_bytes(4, "little") + b"BIN\0" + b"".join(array.tobytes() for array in arrays)


def check(part: Part, path: Path) -> ReadBack:
    """Read the file back with trimesh and compare the mesh with the part."""
    V, F = read_with_trimesh(path)
    return check_mesh(part, millimetres(V), F)


def millimetres(V: Floats) -> Floats:
    """Convert vertices (n, 3) from metres with y upwards, as in glTF files, to millimetres with z upwards."""
    return V[:, [0, 2, 1]] * [1, -1, 1] * MM_PER_M


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield the bytes of a GLB file with a mesh for each member, and a node for each layer."""
    shapes, facts = part.details.shapes, facts_of_members(part)
    layers = list(dict.fromkeys(shape.layer for shape in shapes))
    count = len(shapes)
    nodes: list[dict[str, Any]] = [
        {"mesh": k, "name": shape.id, "extras": facts[shape.id].words} for k, shape in enumerate(shapes)
    ]
    for layer in layers:
        nodes.append({"name": layer, "children": [k for k, shape in enumerate(shapes) if shape.layer == layer]})
    nodes.append({"name": one_line(part.name), "children": list(range(count, count + len(layers)))})
    meshes = [_mesh(shape.id, k, layers.index(shape.layer)) for k, shape in enumerate(shapes)]
    arrays = [array for shape in shapes for array in _arrays(shape.V, shape.F)]
    yield from _chunks(nodes, meshes, [_material(layer) for layer in layers], arrays)


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back with trimesh and compare the members with the part."""
    import trimesh

    scene, meshes = trimesh.load_scene(path, process=False), {}
    for shape in part.details.shapes:
        if shape.id in scene.graph.nodes:
            _, name = scene.graph[shape.id]
            mesh = scene.geometry[name]
            meshes[shape.id] = millimetres(np.asarray(mesh.vertices, dtype=np.float64)), np.asarray(mesh.faces)
    return check_shapes(part, meshes)


def _mesh(name: str, k: int, material: int) -> dict[str, Any]:
    primitive = {"attributes": {"POSITION": 2 * k}, "indices": 2 * k + 1, "material": material, "mode": 4}
    return {"name": name, "primitives": [primitive]}


def _material(layer: str) -> dict[str, Any]:
    linear = [round((x / 255) ** 2.2, 4) for x in layer_colour(layer)]
    return {
        "name": layer,
        "pbrMetallicRoughness": {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8},
    }


def _accessor(k: int, array: np.ndarray[Any, Any]) -> dict[str, Any]:
    if k % 2:
        return {"bufferView": k, "componentType": UINT, "count": array.size, "type": "SCALAR"}
    low, high = (f(array, axis=0).astype(float).tolist() for f in (np.min, np.max))
    return {"bufferView": k, "componentType": FLOAT, "count": len(array), "type": "VEC3", "min": low, "max": high}
