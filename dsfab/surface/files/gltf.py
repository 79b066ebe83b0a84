"""Reader of glTF 2.0 files (.gltf and .glb)."""

import base64
import binascii
import json
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.core.messages import count_phrase
from dsfab.surface.clean.seams import equal_merged
from dsfab.surface.files.reading import (
    Budget,
    Content,
    MalformedFileError,
    TriangleFile,
    contents,
    hidden_on,
    is_mirrored,
    mesh_at,
    selected_parts,
    text_file,
)
from dsfab.surface.orientation import upright_vertices

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class Buffers:
    """Data buffers of a glTF file.    tree : the file's JSON.    binary : buffer inside the file, or None.
    beside : function that returns the bytes of another file, given its name, or None."""

    tree: dict[str, Any]
    binary: bytes | None
    beside: Callable[[str], bytes] | None
    budget: Budget
    known: dict[int, bytes] = field(default_factory=dict)

    def view(self, number: int) -> tuple[bytes, int]:
        """Return the bytes of a buffer view and its stride (bytes). Raises MalformedFileError if bytes are missing."""
        view = self.tree["bufferViews"][number]
        start, length = _count(view.get("byteOffset", 0)), _count(view["byteLength"])
        data = self._buffer(_count(view["buffer"]))
        if start + length > len(data):
            raise MalformedFileError(
                f"a buffer needs {start + length:,} bytes but has only {len(data):,}: the file is cut off"
            )
        return data[start : start + length], _count(view.get("byteStride", 0))

    def _buffer(self, number: int) -> bytes:
        if number not in self.known:
            self.known[number] = self._content(self.tree["buffers"][number].get("uri"))
            self.budget.require_bytes(sum(map(len, self.known.values())))
        return self.known[number]

    def _content(self, uri: Any) -> bytes:
        if uri is None:
            if self.binary is None:
                raise MalformedFileError("the file's binary part, which holds the coordinates, is missing")
            return self.binary
        if not isinstance(uri, str):
            raise MalformedFileError("a buffer of the file has no name")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError):
                raise MalformedFileError("the coordinates in the file's JSON are damaged") from None
        if self.beside is None or "://" in uri:
            raise MalformedFileError(f"the coordinates are outside the file ({uri[:60]}): export the mesh as one file")
        return self.beside(unquote(uri))


def accessor(tree: dict[str, Any], buffers: Buffers, number: Any, width: int) -> NDArray[Any]:
    """Return the values (count, width) of the glTF accessor `number`. Raises MalformedFileError if it is invalid."""
    entry = tree["accessors"][_count(number)]
    count, kind = _count(entry["count"]), _TYPES.get(entry["componentType"])
    if kind is None or _WIDTHS.get(entry["type"]) != width:
        raise MalformedFileError("the file has numbers of a type that glTF does not allow")
    buffers.budget.require_vertices(count)
    if "bufferView" in entry:
        values = _elements(buffers, entry, kind, count, width)
    else:
        values = np.zeros((count, width), dtype=kind)
    if "sparse" in entry:
        values = _with_sparse(buffers, entry["sparse"], values)
    if entry.get("normalized"):
        values = np.maximum(values / np.iinfo(values.dtype).max, -1.0)
    return values


def _elements(buffers: Buffers, entry: dict[str, Any], kind: str, count: int, width: int) -> NDArray[Any]:
    data, stride = buffers.view(_count(entry["bufferView"]))
    start, element_size = _count(entry.get("byteOffset", 0)), np.dtype(kind).itemsize * width
    stride = stride or element_size
    if stride < element_size or (count and start + stride * (count - 1) + element_size > len(data)):
        raise MalformedFileError(
            f"the file announces {count:,} elements, but the bytes of these elements are missing: the file is cut off"
        )
    if not count:
        return np.zeros((0, width), dtype=kind)
    return np.ndarray((count, width), kind, data, start, (stride, np.dtype(kind).itemsize)).copy()


def _with_sparse(buffers: Buffers, sparse: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
    count, indices = _count(sparse["count"]), sparse["indices"]
    kind = _TYPES.get(indices["componentType"])
    if kind is None or count > len(values):
        raise MalformedFileError("a sparse table of the file replaces more elements than exist")
    positions = _elements(buffers, indices, kind, count, 1).ravel().astype(np.int64)
    if count and not 0 <= positions.min() <= positions.max() < len(values):
        raise MalformedFileError("a sparse table of the file replaces elements that do not exist")
    values[positions] = _elements(buffers, sparse["values"], values.dtype.str, count, values.shape[1])
    return values


def _count(value: Any) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise MalformedFileError("the file's JSON has a negative or invalid number")
    return value


_JSON, _BIN = 0x4E4F534A, 0x004E4942
_HARMLESS = (
    *("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "KHR_mesh_quantization", "KHR_xmp"),
    *("KHR_technique", "EXT_mesh_gpu_instancing", "KHR_node_visibility"),
)
"""Beginnings of the names of glTF extensions that do not change the shapes of meshes, or that dsfab can read."""
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_glb(data: bytes, budget: Budget, _beside: Callable[[str], bytes], only: Sequence[str] = ()) -> TriangleFile:
    """Return the triangles of the scene in a binary glTF file, in metres with z up.
    only : names of the nodes and meshes to read; by default all.
    Raises MalformedFileError for an invalid file, and SurfaceError for a file above the limits of `budget`."""
    if data[:4] != b"glTF":
        raise MalformedFileError("the file has no glTF header")
    if len(data) < 20:
        raise MalformedFileError("the file is cut off within its header")
    version, announced = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MalformedFileError(f"the file has version {version} of glTF, but dsfab reads version 2")
    if announced > len(data):
        raise MalformedFileError(f"the file announces {announced:,} bytes but has {len(data):,}: the file is cut off")
    chunks: dict[int, bytes] = {}
    position = 12
    while position + 8 <= announced:
        size, kind = struct.unpack_from("<II", data, position)
        if position + 8 + size > announced:
            raise MalformedFileError("the file announces a part that is longer than the file")
        chunks.setdefault(kind, data[position + 8 : position + 8 + size])
        position += 8 + size
    if _JSON not in chunks:
        raise MalformedFileError("the file has no JSON part that describes its content")
    extra_bytes = len(data) - announced
    dropped = (f"{count_phrase(extra_bytes, 'byte')} after its end",) if extra_bytes else ()
    tree = _json_tree(chunks[_JSON])
    return _scene(Buffers(tree, chunks.get(_BIN), None, budget), only, dropped)


def read_gltf(
    data: bytes, budget: Budget, read_neighbour: Callable[[str], bytes], only: Sequence[str] = ()
) -> TriangleFile:
    """Return the triangles of the scene in a glTF file (JSON), in metres with z up.
    read_neighbour : function that returns the bytes of a file in the same folder, given its name.
    only           : names of the nodes and meshes to read; by default all.
    Raises MalformedFileError for an invalid file, and SurfaceError for a file above the limits of `budget`."""
    if data[:4] == b"glTF":
        return read_glb(data, budget, read_neighbour, only)
    file = text_file(data)
    tree = _json_tree(file.text.encode("utf-8"))
    return _scene(Buffers(tree, None, read_neighbour, budget), only, (), file.doubts)


def _json_tree(data: bytes) -> dict[str, Any]:
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        raise MalformedFileError("the file's JSON is broken or cut off") from None
    asset = tree.get("asset") if isinstance(tree, dict) else None
    if isinstance(tree, dict) and isinstance(tree.get("meshes"), dict):
        asset = {"version": "1.0"}  # in version 1 of glTF, `meshes` is a table, and `asset` may be missing
    if not isinstance(tree, dict) or not isinstance(asset, dict):
        raise MalformedFileError("the file's JSON is not glTF")
    if str(asset.get("version", "2")).split(".")[0] != "2":
        raise MalformedFileError(f"the file has version {asset['version']} of glTF, but dsfab reads version 2")
    unknown = [str(name) for name in tree.get("extensionsRequired", []) if not str(name).startswith(_HARMLESS)]
    if unknown:
        remedy = "compression" if all("compression" in name for name in unknown) else "this extension"
        raise MalformedFileError(f"the file needs the extension {', '.join(unknown)}: export the file without {remedy}")
    return tree


def _scene(
    buffers: Buffers, only: Sequence[str], dropped: tuple[str, ...], doubts: tuple[str, ...] = ()
) -> TriangleFile:
    tree = buffers.tree
    scene = _Scene(tree, buffers, buffers.budget)
    try:
        V, F = concatenated_mesh(list(scene.parts(only)))
        scene.count_unused()
    except (KeyError, TypeError, AttributeError, IndexError):
        raise MalformedFileError("an entry of the file's JSON is missing or of the wrong kind") from None
    V = upright_vertices(V, "y")
    V, F = equal_merged(V, F) if len(F) else (V, F)  # equal_merged also sorts the vertices, so rotate first
    doubts = doubts if tree.get("scenes") else (*doubts, "the file names no scene, so dsfab reads all objects")
    return TriangleFile(V, F, "m", doubts, dropped, contents(scene.counts))


@dataclass(frozen=True)
class _Scene:
    tree: dict[str, Any]
    buffers: Buffers
    budget: Budget
    counts: Counter[Content] = field(default_factory=Counter)
    used: set[int] = field(default_factory=set)

    def parts(self, only: Sequence[str]) -> Iterator[tuple[Floats, Ints]]:
        total, nodes = 0, selected_parts(self._shown_nodes(), only, self.counts)
        for mesh, matrix in (placed for node, place in nodes for placed in self._placed_meshes(node, place)):
            for primitive in self.tree["meshes"][mesh]["primitives"]:
                mode = primitive.get("mode", _TRIANGLES)
                if mode not in (_TRIANGLES, _STRIP, _FAN):
                    self.counts[Content("line or point primitive", "dropped")] += 1
                    continue
                V, F = self._primitive(primitive, mode)
                total += len(F)
                self.budget.require_triangles(total)
                self.budget.require_time()
                yield mesh_at(V, F, matrix)

    def count_unused(self) -> None:
        unused = len(self.tree.get("meshes", ())) - len(self.used)
        self.counts[Content("mesh", "dropped", "outside the visible scene")] += unused
        self.counts[Content("camera", "beside")] += len(self.tree.get("cameras", ()))

    def _placed_meshes(self, node: dict[str, Any], matrix: Floats) -> Iterator[tuple[int, Floats]]:
        self.counts[Content("mirrored mesh" if is_mirrored(matrix) else "mesh")] += 1
        instances = self._instances(node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {}))
        yield from ((node["mesh"], matrix @ place) for place in instances)

    def _shown_nodes(self) -> Iterator[tuple[list[str], tuple[dict[str, Any], Floats]]]:
        nodes, scenes = self.tree.get("nodes", []), self.tree.get("scenes", [])
        inner = {child for node in nodes for child in node.get("children", [])}
        roots = [k for k in range(len(nodes)) if k not in inner]
        shown_nodes = scenes[self.tree.get("scene", 0)].get("nodes", []) if scenes else roots
        waiting = [(k, np.eye(4), list[str](), True) for k in reversed(shown_nodes)]
        seen = set[int]()
        while waiting:
            number, above, outer_names, shown = waiting.pop()
            if number in seen or len(outer_names) >= 200:  # most programs nest at most 100 levels of nodes
                raise MalformedFileError("the file's nodes form no tree: a node has two parents, or contains itself")
            seen.add(number)
            node = nodes[number]
            shown = shown and node.get("extensions", {}).get("KHR_node_visibility", {}).get("visible", True)
            names = [str(node.get("name") or ""), *outer_names]
            matrix = above @ _matrix(node)
            if "skin" in node:
                self.counts[Content("skin", "dropped")] += 1
            if "mesh" in node:
                self.used.add(node["mesh"])
                if shown:
                    yield [*names, str(self.tree["meshes"][node["mesh"]].get("name", ""))], (node, matrix)
                else:
                    self.counts[hidden_on("")] += 1
            waiting.extend((child, matrix, names, shown) for child in reversed(node.get("children", [])))

    def _instances(self, attributes: dict[str, int]) -> Iterator[Floats]:
        names = [name for name in ("TRANSLATION", "ROTATION", "SCALE") if name in attributes]
        tables = [accessor(self.tree, self.buffers, attributes[k], 4 if k == "ROTATION" else 3) for k in names]
        if not tables:
            yield np.eye(4)
        for rows in zip(*tables, strict=False):
            self.counts[Content("instance")] += 1
            yield _matrix(dict(zip((name.lower() for name in names), rows, strict=True)))

    def _primitive(self, primitive: dict[str, Any], mode: int) -> tuple[Floats, Ints]:
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            raise MalformedFileError("the file uses KHR_draco_mesh_compression: export the file without compression")
        if "targets" in primitive:
            self.counts[Content("morph target", "dropped")] += len(primitive["targets"])
        V = accessor(self.tree, self.buffers, primitive["attributes"]["POSITION"], 3).astype(np.float64)
        order = np.arange(len(V))
        if "indices" in primitive:
            order = accessor(self.tree, self.buffers, primitive["indices"], 1).ravel().astype(np.int64)
        if len(order) and not 0 <= order.min() <= order.max() < len(V):
            raise MalformedFileError(f"a triangle has a vertex number outside the {len(V):,} vertices of the file")
        return V, self._faces(order, mode)

    def _faces(self, order: Ints, mode: int) -> Ints:
        if mode == _TRIANGLES:
            if len(order) % 3:
                self.counts[Content("surplus corner", "dropped")] += len(order) % 3
            return order[: len(order) // 3 * 3].reshape(-1, 3)
        if len(order) < 3:
            return np.empty((0, 3), dtype=np.int64)
        if mode == _FAN:
            return np.stack([order[1:-1], order[2:], np.full(len(order) - 2, order[0])], axis=1)
        F = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
        F[1::2] = F[1::2, [1, 0, 2]]
        tied = np.equal(F, np.roll(F, 1, axis=1)).any(axis=1)  # triangles with a repeated corner only link strips
        strip: Ints = F[~tied]
        return strip


def _matrix(node: dict[str, Any]) -> Floats:
    if "matrix" in node:
        return _numbers(node["matrix"], 16).reshape(4, 4).T
    x, y, z, w = _numbers(node.get("rotation", [0, 0, 0, 1]), 4)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * _numbers(node.get("scale", [1, 1, 1]), 3)
    matrix[:3, 3] = _numbers(node.get("translation", [0, 0, 0]), 3)
    return matrix


def _numbers(values: Any, count: int) -> Floats:
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError):
        array = np.empty(0)
    if array.shape != (count,):
        raise MalformedFileError("a node of the file's scene has an invalid position")
    return array
