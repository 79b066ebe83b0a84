"""What must hold for any bytes that are given as a file: an error of ours in one line, or what the file says.

What was read is written and read again: the same. A mesh of which nothing is told is, moreover, what trimesh reads.
"""

import logging
import tomllib
import warnings
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import tomli_w
import trimesh

from dsfab.core.errors import DsfabError, SurfaceError
from dsfab.core.toml_files import shipped_presets
from dsfab.preset.file import load_preset, parse_override, preset_toml
from dsfab.preset.model import Preset
from dsfab.surface import ClosedCurves, surface_in_file

PYTHON = ("list index", "Error", "NoneType", "literal", "to unpack", "' object", "Traceback", "argument", "codec")
"""Words that no person should read."""
COARSE = 1e-4
"""Digits to which trimesh and we agree, as a share of the size: formats hold single precision."""

logging.getLogger("trimesh").setLevel(logging.CRITICAL)
logging.getLogger("ezdxf").setLevel(logging.CRITICAL)


def answer(read: Callable[[], Any], path: Path) -> Any:
    """What a reader gives; its sentence where it refuses: one line, with the file's name, without Python's words."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read()
        except SurfaceError as error:
            text = str(error)
            assert path.name in text
            assert "\n" not in text
            assert not [word for word in PYTHON if word in text], text
            return text


def in_space(V: Any, T: Any) -> Any:
    """(m, 3, 3) triangles in space, in an order and a rotation that do not depend on the numbering; and their size."""
    P = np.asarray(V, float)[np.asarray(T)]
    size = float(np.linalg.norm(np.ptp(P.reshape(-1, 3), axis=0))) or 1.0
    Q = np.round(P / size / COARSE)
    return size, sorted(sorted(map(tuple, (one + 0.0).tolist())) for one in Q)


def as_trimesh_reads(path: Path) -> Any:
    """Vertices and triangles of a file as trimesh reads it; None where it does not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = trimesh.load(path, force="mesh", process=False)
        V, T = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception:
        return None
    return (np.stack([V[:, 0], -V[:, 2], V[:, 1]], axis=1) if path.suffix in (".glb", ".gltf") else V), T


def judge_mesh(path: Path) -> None:
    """A mesh file: what was read is written as OBJ and read again the same; and it is what trimesh reads, or told."""
    found = answer(lambda: surface_in_file(path, max_triangles=50_000), path)
    if isinstance(found, str):
        return
    V, F = found.surface.V, found.surface.F
    again = path.with_name("again.obj")
    rows = ["v {!r} {!r} {!r}".format(*one) for one in V.tolist()]
    again.write_text("\n".join([*rows, *(f"f {a} {b} {c}" for a, b, c in (F + 1).tolist())]) + "\n")
    second = surface_in_file(again, "m").surface
    assert np.array_equal(second.V, V)
    assert np.array_equal(second.F, F)
    if found.record.remarks or (other := as_trimesh_reads(path)) is None or path.suffix == ".3mf":
        return  # trimesh leaves 3MF's unit out
    assert in_space(V, F) == in_space(*other), "trimesh reads another surface"


def judge_drawing(path: Path) -> None:
    """A drawing: its closed curves are written as DXF and read again the same."""
    loops = answer(lambda: ClosedCurves(path, unit="m").loops(), path)
    if isinstance(loops, str):
        return
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 6
    for loop in loops:
        document.modelspace().add_polyline3d(loop, close=True)
    again = path.with_name("again.dxf")
    document.saveas(again)
    second = ClosedCurves(again).loops()
    assert [len(a) for a in second] == [len(a) for a in loops]
    for a, b in zip(second, loops, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=0)


def judge_preset(path: Path) -> None:
    """A preset as a TOML file: refused in one line, or written and read again the same."""
    try:
        preset = load_preset(path)
    except DsfabError as error:
        require_one_line(error)
        return
    require_same_again(preset, path)


def require_one_line(error: DsfabError) -> None:
    """A sentence for a person stands on one line."""
    assert "\n" not in str(error)


def require_same_again(preset: Preset, path: Path) -> None:
    """A preset says the same once it was written."""
    again = path.with_name("again.toml")
    again.write_text(preset_toml(preset), encoding="utf-8")
    assert repr(load_preset(again).model_dump()) == repr(preset.model_dump())


def judge_override(path: Path) -> None:
    """Lines as `--set` takes them, on the preset dome."""
    lines = path.read_bytes().decode("utf-8", "replace").split("\n")
    try:
        preset = load_preset("dome", dict(parse_override(line) for line in lines[:8] if line))
    except DsfabError as error:
        require_one_line(error)
        return
    require_same_again(preset, path)


ODD: tuple[Any, ...] = (
    *(0, 1, -1, 2, 10**6, 2**31, 2**63 - 1, 0.0, -0.0, 0.5, 1e-300, 1e308, -1e308, float("nan"), float("inf")),
    *("", "auto", "x", "z", "all", "boundary", "nan", "0", "\x00", "é" * 300, True, False, [], {}, [[]], [{}]),
    *([0, 0, 0], [0.0, 1.0], [float("nan")] * 3, [1, 2, 3, 4], [[0, 0], [1, 0], [1, 1]], ["a"], {"a": 1}),
    *({"pick": "plan", "polygon": [[0, 0], [1, 0], [0, 1]]}, {"pick": "sphere"}, {"kind": "wind"}, {"shape": "dome"}),
)
"""Values that no key expects."""


def judge_values(path: Path) -> None:
    """A shipped preset of which the bytes of a file change, drop, swap and repeat some values."""
    bytes_left = iter(path.read_bytes())

    def pick(count: int) -> int:
        return next(bytes_left, 0) % count

    values = deepcopy(preset_tables()[pick(len(preset_tables()))])
    for _ in range(1 + pick(4)):
        places = [*_places(values)]
        where, key = places[(pick(256) * 256 + pick(256)) % len(places)]
        other, source = places[(pick(256) * 256 + pick(256)) % len(places)]
        way = pick(8)
        if way == 0:
            del where[key]
        elif way == 1:
            where[key] = deepcopy(other[source])
        elif way == 2 and isinstance(where, dict):
            where[f"{key}_"] = ODD[pick(len(ODD))]
        elif way == 3 and isinstance(where[key], list):
            where[key] = where[key] * 3
        else:
            where[key] = deepcopy(ODD[pick(len(ODD))])
        if not values:
            return
    changed = path.with_name("changed.toml")
    changed.write_text(tomli_w.dumps(values), encoding="utf-8")
    judge_preset(changed)


def _places(values: Any) -> Any:
    """Each container of nested tables with each of its keys."""
    for key in values if isinstance(values, dict) else range(len(values)):
        yield values, key
        if isinstance(values[key], (dict, list)):
            yield from _places(values[key])


@cache
def preset_tables() -> list[dict[str, Any]]:
    """The tables of the shipped presets."""
    return [tomllib.loads(path.read_text(encoding="utf-8")) for path in shipped_presets().values()]


MESHES = ("obj", "off", "ply", "stl", "glb", "gltf", "3mf")
TARGETS: dict[str, tuple[str, Callable[[Path], None]]] = {
    **{name: (f".{name}", judge_mesh) for name in MESHES},
    "dxf": (".dxf", judge_drawing),
    "3dm": (".3dm", judge_drawing),
    "toml": (".toml", judge_preset),
    "values": (".bin", judge_values),
    "set": (".txt", judge_override),
}
"""What is fuzzed: the suffix of its files, and what must hold for them."""


def judge(target: str, data: bytes, folder: Path) -> None:
    """Raise for bytes that break what must hold for files of a target."""
    suffix, oracle = TARGETS[target]
    path = folder / f"fuzz{suffix}"
    path.write_bytes(data)
    oracle(path)
