"""Reader of STL and 3MF files."""

import io
import re
import struct
import zipfile
import zlib
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.core.messages import count_phrase
from dsfab.surface.clean.seams import equal_merged
from dsfab.surface.files.reading import (
    Budget,
    Content,
    MalformedFileError,
    TriangleFile,
    contents,
    declared_unit,
    float_of,
    is_mirrored,
    mesh_at,
    selected_parts,
    text_file,
    whole_number,
)

HEAD, EACH = 84, 50  # Bytes of the header, and of each triangle, in a binary file.
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = r"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rf"\s*facet(?:\s+normal\s+\S+\s+\S+\s+\S+)?\s+outer\s+loop\s+{3 * _VERTEX}endloop\s+endfacet(?=\s|$)", re.IGNORECASE
)
_BETWEEN = re.compile(r"\s*(?:end\s*solid|solid)\b[^\n]*?(?=\n|\sfacet\s+(?:normal|outer)\b|\Z)", re.IGNORECASE)
_SOLID = re.compile(r"^\s*solid\b", re.IGNORECASE | re.MULTILINE)
CHUNK = 1 << 14  # Number of triangles or XML elements between two checks of the time.


def read_stl(data: bytes, budget: Budget) -> TriangleFile:
    """Return the triangles of an STL file, text or binary; vertices at the same place are merged.
    Raises MalformedFileError for a damaged file, SurfaceError for a file above the limits of `budget`."""
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEAD else -1
    announced = HEAD + EACH * count
    looks_like_text = b"facet" in data[:2000].replace(b"\0", b"").lower() or len(data) < HEAD
    if count < 0 or (len(data) != announced and looks_like_text):
        return _read_text(data, budget)
    budget.require_triangles(count)
    if len(data) < announced:
        raise MalformedFileError(f"the file announces {count:,} triangles, but has only {(len(data) - HEAD) // EACH:,}")
    soup = np.frombuffer(data, _RECORD, count, HEAD)["corners"].astype(np.float64)
    extra_bytes = len(data) - announced
    dropped = (f"{count_phrase(extra_bytes, 'byte')} after the last triangle",) if extra_bytes else ()
    V, F = equal_merged(soup.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    return TriangleFile(V, F, dropped=dropped, content=(Content("face", count=count),))


def _read_text(data: bytes, budget: Budget) -> TriangleFile:
    file = text_file(data)
    text, position, numbers, ended = file.text.rstrip(), 0, array("d"), False
    head = _BETWEEN.match(text)
    if head is None or not text.lstrip()[:5].lower() == "solid":
        raise MalformedFileError(
            "the file does not begin with 'solid' (text STL), and its length does not fit its binary header"
        )
    position = head.end()
    while position < len(text):
        if match := _FACET.match(text, position):
            ended = False
            try:
                numbers.extend(map(float_of, match.groups()))
            except ValueError:
                line = _line_number(text, position)
                raise MalformedFileError(f"line {line} or a later line has a word where a number is needed") from None
            if len(numbers) % (9 * CHUNK) == 0:
                budget.require_time()
                budget.require_triangles(len(numbers) // 9)
        elif match := _BETWEEN.match(text, position):
            ended = match.group().strip().lower().startswith("end")
        else:
            raise MalformedFileError(f"line {_line_number(text, position)} does not begin a triangle")
        position = match.end()
    budget.require_triangles(len(numbers) // 9)
    doubts = file.doubts if ended else (*file.doubts, "the last line, endsolid, is missing: the file may be cut off")
    V, F = equal_merged(np.array(numbers).reshape(-1, 3), np.arange(len(numbers) // 3).reshape(-1, 3))
    parts = len(_SOLID.findall(text))  # each part begins with the word solid, even if the part is not closed
    counts = Counter({Content("face"): len(numbers) // 9, Content("part"): parts if parts > 1 else 0})
    return TriangleFile(V, F, doubts=doubts, content=contents(counts))


def _line_number(text: str, position: int) -> int:
    return text.count("\n", 0, len(text) - len(text[position:].lstrip())) + 1


_NAMESPACES = "core material production beamlattice slice trianglesets".split()  # noqa: SIM905
"""Words in the names of the 3MF extensions that dsfab accepts. dsfab ignores extensions that do not change shapes."""
_TAKEN = ("model", "surface")  # Types of objects that belong to the model; other types help only the printing.
_CURA_AIDS = ("support_mesh", "anti_overhang_mesh", "infill_mesh", "cutting_mesh")  # printing aids [Cura 5]
_ROOT = re.compile(r"""<[^<>]*/3dmodel["'][^<>]*>""")  # entry with the name of the root model's file
_TARGET = re.compile(r"""Target\s*=\s*["']/*([^"']+)["']""", re.IGNORECASE)
Key = tuple[str, str]  # Name of a part of the file, and number of an object in this part.


def read_3mf(data: bytes, budget: Budget, only: Sequence[str] = ()) -> TriangleFile:
    """Return the triangles of all objects on the build plate of a 3MF file, without printing aids such as supports.
    only : names or part numbers of the objects to read.    Source: 3MF Consortium, core specification 1.4.
    Raises MalformedFileError for a damaged file, SurfaceError for a file above the limits of `budget`."""
    plate = _Plate(budget, _archive_texts(data, budget))
    for key in (*plate.unprinted, *(key for key, _, _ in plate.items)):
        plate.require_ends(key, 0)
    budget.require_triangles(sum(plate.triangles[key] for key, _, _ in plate.items))
    objects = (part for key, place, name in plate.items for part in plate.leaves(key, place, (name,)))
    V, F = concatenated_mesh([plate.mesh(key, place) for key, place in selected_parts(objects, only, plate.counts)])
    unused = plate.objects.keys() - plate.triangles
    plate.counts[Content("object", "dropped", "without a place on the build plate")] = len(unused)
    return TriangleFile(V, F, plate.unit, content=contents(plate.counts))


@dataclass
class _Object:
    kind: str
    names: tuple[str, ...] = ()
    V: "array[float]" = field(default_factory=lambda: array("d"))
    F: "array[int]" = field(default_factory=lambda: array("q"))
    parts: list[tuple[Key, Floats]] = field(default_factory=list)


class _Plate:
    """Content of a 3MF file. items : object, transformation (4, 4) and part number of each item to print."""

    def __init__(self, budget: Budget, texts: dict[str, bytes]) -> None:
        self.budget, self.count, self.open = budget, 0, _Object("")  # `open` is the object that is being read
        self.unit: str | None = None
        self.objects, self.triangles = dict[Key, _Object](), dict[Key, int]()
        self.items = list[tuple[Key, Floats, str]]()
        self.counts, self.prefixes, self.unprinted = Counter[Content](), dict[str, str](), list[Key]()
        self.aids = print_aids(texts)
        link = _ROOT.search(texts.get("_rels/.rels", b"").decode("utf-8", "replace"))
        target = _TARGET.search(link[0]) if link else None
        models = [name for name in texts if name.lower().endswith(".model") or (target and name == target[1])]
        self.root = target[1] if target and target[1] in models else "".join(models[:1])
        if not models:
            raise MalformedFileError("the 3MF archive has no file with a 3D model")
        for self.part in models:
            self._read(texts[self.part])

    def _read(self, text: bytes) -> None:
        self.parser = parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler, parser.StartDoctypeDeclHandler = self._element, _refuse_doctype
        parser.StartNamespaceDeclHandler = lambda prefix, name: self.prefixes.update({prefix or "": name})
        try:
            parser.Parse(text, True)
        except expat.ExpatError as error:
            raise MalformedFileError(f"the file's XML is broken or cut off in line {error.lineno}") from None
        except (KeyError, ValueError, OverflowError) as error:
            if isinstance(error, MalformedFileError):
                raise
            where = f"line {parser.CurrentLineNumber} of {self.part}"
            raise MalformedFileError(f"a number or an object is missing or invalid in {where}") from None

    def _element(self, tag: str, values: dict[str, str]) -> None:
        space, _, kind = tag.rpartition(" ")
        self.count, self.parser.CharacterDataHandler = self.count + 1, None
        if not self.count % CHUNK:
            self.budget.require_time()
            self.budget.require_vertices(self.count // 2)
        if kind == "vertex" and "/slice/" not in space:
            self.open.V.extend((float_of(values["x"]), float_of(values["y"]), float_of(values["z"])))
        elif kind == "triangle" and "trianglesets" not in space:
            self.open.F.extend((whole_number(values["v1"]), whole_number(values["v2"]), whole_number(values["v3"])))
        elif kind in ("beam", "ball"):
            self.counts[Content(kind, "dropped", "of a lattice")] += 1
        elif kind == "object":
            names = values.get("name", ""), values.get("partnumber", "")
            self.open = self.objects[self.part, values["id"]] = _Object(values.get("type", "model"), names)
        elif kind == "component":
            self.open.parts.append((self._key(values), _place(values)))
        elif kind in ("metadata", "setting"):
            self.setting = values.get("name", values.get("key", "")).removeprefix("cura:")
            if self.setting in _CURA_AIDS:
                self.parser.CharacterDataHandler = self._value
        elif kind == "build":
            self.open = _Object("")
        elif kind == "item" and self.part == self.root:
            self.open = self.objects.get(self._key(values), _Object(""))  # an item's settings apply to its object
            if values.get("printable", "1") == "0":
                self.counts[Content("item", "dropped", "marked as not printable")] += 1
                self.unprinted.append(self._key(values))
            else:
                self.items.append((self._key(values), _place(values), values.get("partnumber", "")))
        elif kind == "model":
            self._model(values)

    def _value(self, text: str) -> None:
        if text.strip().lower() in ("true", "1"):
            self.open.kind = self.setting

    def _model(self, values: dict[str, str]) -> None:
        names = [self.prefixes.get(prefix, prefix) for prefix in values.get("requiredextensions", "").split()]
        unknown = [name for name in names if not any(f"/{word}/" in name for word in _NAMESPACES)]
        if unknown:
            raise MalformedFileError(
                f"the file needs the extension {unknown[0]}, which dsfab does not read; export the file without this "
                f"extension"
            )
        if self.part == self.root:
            self.unit = declared_unit(values.get("unit", "millimeter"))

    def _key(self, values: dict[str, str]) -> Key:
        path = next((value for name, value in values.items() if name.endswith(" path")), self.part)
        return path.lstrip("/"), values["objectid"]

    def require_ends(self, key: Key, depth: int) -> int:
        """Count triangles, also in components. Raises MalformedFileError if an object is missing or contains itself."""
        if depth > 100:
            raise MalformedFileError("an object contains itself, or objects in over 100 nested levels")
        if key not in self.objects:
            raise MalformedFileError(f"the file places the object {key[1]!r}, but does not contain this object")
        if key not in self.triangles:
            inside = sum(self.require_ends(part, depth + 1) for part, _ in self.objects[key].parts)
            self.triangles[key] = inside + len(self.objects[key].F) // 3
        return self.triangles[key]

    def leaves(
        self, key: Key, place: Floats, outer_names: tuple[str, ...]
    ) -> Iterator[tuple[tuple[str, ...], tuple[Key, Floats]]]:
        """Yield (names, (key, transformation (4, 4))) for object `key` and its components, if they have a mesh.
        place : transformation (4, 4) of object `key`."""
        thing = self.objects[key]
        names = (*thing.names, *outer_names)
        if thing.kind not in _TAKEN:
            self.counts[Content("object", "dropped", f"of the type {thing.kind!r}")] += 1
            return
        if thing.V:
            yield names, (key, place)
        for part, inner in thing.parts:
            if (key[1], part[1]) in self.aids:
                self.counts[_AID] += 1
            elif self.triangles[part]:
                yield from self.leaves(part, place @ inner, names)

    def mesh(self, key: Key, place: Floats) -> tuple[Floats, Ints]:
        """Return vertices (n, 3) and faces (m, 3) of an object without components. place : transformation (4, 4)."""
        thing = self.objects[key]
        V, F = np.array(thing.V).reshape(-1, 3), np.array(thing.F, dtype=np.int64).reshape(-1, 3)
        is_model = np.ones(len(F), dtype=bool)
        for start, end in self.aids.get((key[1], ""), ()):
            is_model[start : end + 1] = False
            self.counts[_AID] += 1
        if len(F):
            self.counts[Content("mirrored mesh" if is_mirrored(place) else "mesh")] += 1
        return mesh_at(V, F[is_model], place)


_AID = Content("printing aid", "dropped", "that only the slicer uses")


def print_aids(texts: dict[str, bytes]) -> dict[tuple[str, str], list[tuple[int, int]]]:
    """Return the printing aids, such as supports, that are listed in the settings of a slicer program.
    An aid that is a whole component has the key (object, component) and an empty list.
    Aids inside an object's mesh have the key (object, ""), and a list of their first and last triangles.
    Sources: Slic3r_PE_model.config [PrusaSlicer], model_settings.config [Bambu Studio, OrcaSlicer]."""
    aids: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for name in ("Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config"):
        try:
            tree = ElementTree.fromstring(b"" if b"<!" in (text := texts.get(name, b"")) else text)
            for thing in tree.iter("object"):
                for part in thing.iter("part"):
                    if part.get("subtype", "normal_part") != "normal_part":
                        aids[thing.attrib["id"], part.attrib["id"]] = []
                for part in thing.iter("volume"):
                    keys = {entry.get("key"): entry.get("value") for entry in part.iter("metadata")}
                    if keys.get("volume_type", "ModelPart") != "ModelPart" or keys.get("modifier") == "1":
                        ends = int(part.attrib["firstid"]), int(part.attrib["lastid"])
                        aids.setdefault((thing.attrib["id"], ""), []).append(ends)
        except (ElementTree.ParseError, KeyError, ValueError):
            continue  # if the list of printing aids cannot be read, all objects count as parts of the model
    return aids


def _refuse_doctype(*_: object) -> None:
    raise MalformedFileError("the file declares an XML document type, which 3MF forbids")


def _place(values: dict[str, str]) -> Floats:
    """Return the transformation (4, 4) of an item or component, for column vectors."""
    place = np.eye(4)
    if "transform" in values:
        place[:3] = np.array([float_of(word) for word in values["transform"].split()]).reshape(4, 3).T
    return place


def _archive_texts(data: bytes, budget: Budget) -> dict[str, bytes]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(entry.file_size for entry in packed.infolist())
            # compression shrinks numbers to a tenth, and repeated triangles to a hundredth
            if size > max(1 << 24, 60 * len(data)):
                raise MalformedFileError(f"the file unpacks to {size / len(data):,.0f} times its size, unlike any mesh")
            budget.require_bytes(size, "bytes after unpacking")
            texts = {}
            for entry in packed.infolist():
                budget.require_time()
                texts[entry.filename.lstrip("/")] = packed.read(entry)
            return texts
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, ValueError, NotImplementedError, RuntimeError) as error:
        if isinstance(error, MalformedFileError):
            raise
        raise MalformedFileError("the file is not a ZIP archive, or it is damaged") from None
    except (OSError, zlib.error):
        raise MalformedFileError("dsfab cannot unpack a part of the file") from None
