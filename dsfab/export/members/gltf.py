"""GLB: a node for each member with its name, below a node for each layer; metres, y upwards (see `..gltf`)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.export.gltf import FLOAT, INDICES, UINT, VERTICES, chunked, millimetres, upright
from dsfab.export.members.shapes import check_shapes, layer_colour, member_entries, member_facts
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack
from dsfab.export.text import one_line
from dsfab.units import MM_PER_M


def encode(part: Part) -> Iterator[bytes]:
    """Vertices and faces of all members in one buffer, two views of it for each."""
    arrays = list[np.ndarray[Any, Any]]()
    for shape in part.details.shapes:
        arrays += [upright(shape.V / MM_PER_M).astype("<f4"), shape.F.astype("<u4")]
    yield from chunked(_scene(part, arrays), b"".join(array.tobytes() for array in arrays))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with trimesh, as a scene."""
    import trimesh

    scene, found = trimesh.load_scene(path, process=False), {}
    for shape in part.details.shapes:
        if shape.id in scene.graph.nodes:
            _, name = scene.graph[shape.id]
            mesh = scene.geometry[name]
            found[shape.id] = millimetres(np.asarray(mesh.vertices, dtype=np.float64)), np.asarray(mesh.faces)
    return check_shapes(part, found)


def _scene(part: Part, arrays: list[np.ndarray[Any, Any]]) -> dict[str, Any]:
    """The JSON. Without normals, viewers must shade flat."""
    shapes, entries = part.details.shapes, member_entries(part)
    layers = list(dict.fromkeys(shape.layer for shape in shapes))
    count = len(shapes)
    nodes: list[dict[str, Any]] = [
        {"mesh": k, "name": shape.id, "extras": member_facts(entries[shape.id])} for k, shape in enumerate(shapes)
    ]
    for layer in layers:
        nodes.append({"name": layer, "children": [k for k, shape in enumerate(shapes) if shape.layer == layer]})
    nodes.append({"name": one_line(part.name), "children": list(range(count, count + len(layers)))})
    size = [array.nbytes for array in arrays]
    start = np.concatenate([[0], np.cumsum(size)]).tolist()
    return {
        "asset": {"version": "2.0", "generator": f"dsfab {__version__}", "extras": {"unit": "metre"}},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": [_mesh(shape.id, k, layers.index(shape.layer)) for k, shape in enumerate(shapes)],
        "materials": [_material(layer) for layer in layers],
        "accessors": [_accessor(k, array) for k, array in enumerate(arrays)],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start[k], "byteLength": size[k], "target": (VERTICES, INDICES)[k % 2]}
            for k in range(len(arrays))
        ],
        "buffers": [{"byteLength": start[-1]}],
    }


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
