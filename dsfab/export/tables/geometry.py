"""CSV and JSON files of the lines, members and nodes of a design, in millimetres."""

import csv
import io
import json
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.export.members import graph_of, member_entries, node_entry, rounded_mm
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, check_lines, require_equal

HEAD = ("id", "kind", "family", "number", "part", "closed", "length_mm", "point", "x_mm", "y_mm", "z_mm")


def encode_csv(part: Part) -> Iterator[bytes]:
    """Yield a CSV file of the part's lines, with a row for each point. A closed line repeats its first point."""
    yield (",".join(HEAD) + "\r\n").encode()
    for line in part.details.lines:
        text = io.StringIO()
        label = (line.id, line.kind, line.family, line.number, line.part, int(line.is_closed), f"{line.length:.6f}")
        csv.writer(text).writerows(
            (*label, i, *(f"{value + 0.0:.6f}" for value in point)) for i, point in enumerate(line.points.tolist(), 1)
        )
        yield text.getvalue().encode()


def check_csv(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare the lines with the lines of the part."""
    with open(path, encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    lines = [
        np.array([[float(row[axis]) for axis in HEAD[-3:]] for row in group])
        for _, group in groupby(table, key=lambda row: row["id"])
    ]
    return check_lines(part, lines)


def encode_json(part: Part) -> Iterator[bytes]:
    """Yield a JSON file of the part's lines, with coordinates rounded to 1e-6 mm."""
    head = {
        "name": part.name,
        "program": f"dsfab {__version__}",
        "unit": "millimetre",
        "tolerance": round(part.details.tolerance, 6),
    }
    yield (json.dumps(head, ensure_ascii=False)[:-1] + ', "lines": [\n').encode()
    last_number = len(part.details.lines) - 1
    for i, line in enumerate(part.details.lines):
        entry = {"id": line.id, "kind": line.kind, "family": line.family, "number": line.number, "part": line.part}
        entry |= {"closed": line.is_closed, "length": round(line.length, 6), "points": line.points.round(6).tolist()}
        yield (json.dumps(entry) + ("\n" if i == last_number else ",\n")).encode()
    yield b"]}\n"


def check_json(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare the lines with the lines of the part."""
    lines = json.loads(path.read_text(encoding="utf-8"))["lines"]
    return check_lines(part, [np.array(line["points"], dtype=np.float64) for line in lines])


def encode_members_json(part: Part) -> Iterator[bytes]:
    """Yield a JSON file of the part's members and nodes."""
    graph = graph_of(part)
    entries = {"members": member_entries(part), "nodes": [node_entry(node) for node in graph.nodes]}
    head = {"name": part.name, "program": f"dsfab {__version__}", "unit": "millimetre", "curvature": "1/m"}
    yield (json.dumps(head | {"notes": list(graph.notes)}, ensure_ascii=False)[:-1]).encode()
    for key, listed in entries.items():
        yield f', "{key}": [\n'.encode()
        for i, entry in enumerate(listed):
            yield ((",\n" if i else "") + json.dumps(entry)).encode()
        yield b"\n]"
    yield b"}\n"


def check_members_json(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare members and nodes with the part."""
    content = json.loads(path.read_text(encoding="utf-8"))
    for key in ("members", "nodes"):
        check_ids(part, key, [entry["id"] for entry in content[key]])
    return length_error(part, sum(entry["length"] for entry in content["members"]))


def check_ids(part: Part, key: str, names: list[str]) -> None:
    """Raise ExportError unless `names` are the names of the part's members or nodes. key : "members" or "nodes"."""
    require_equal(part, key, [item.id for item in getattr(graph_of(part), key)], names)


def length_error(part: Part, length_read: float) -> ReadBack:
    """Compare the members' total length in a file, `length_read` (mm), with the part.
    Return the number of members, and the relative error of the length."""
    members = graph_of(part).members
    length_expected = sum(rounded_mm(member.length) for member in members)
    error = length_read / length_expected - 1 if length_expected else float("nan")
    return ReadBack(len(members), "members", error, "length")


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield a CSV file with a row for each member: lengths in millimetres, curvatures in 1/m."""
    yield from _table([_member_row(entry) for entry in member_entries(part)])


def encode_nodes(part: Part) -> Iterator[bytes]:
    """Yield a CSV file with a row for each node: lengths in millimetres, angles in degrees."""
    yield from _table([_node_row(node_entry(node)) for node in graph_of(part).nodes], list(_node_row(_NO_NODE)))


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare its members with the members of the part."""
    rows = _rows(path)
    check_ids(part, "members", [row["id"] for row in rows])
    return length_error(part, sum(float(row["length_mm"]) for row in rows))


def check_nodes(part: Part, path: Path) -> ReadBack:
    """Read the file back and compare its nodes with the nodes of the part."""
    rows = _rows(path)
    check_ids(part, "nodes", [row["id"] for row in rows])
    return ReadBack(len(rows), "nodes")


_NO_NODE = {"id": "", "kind": "", "members": ["", ""], "at": [0, 0], "angle": 0, "area": 0, "point": [0, 0, 0]}
_NO_NODE |= {"normal": [0, 0, 0]}


def _member_row(entry: Mapping[str, Any]) -> dict[str, Any]:
    axis, nowhere = entry["axis"], (None, None, None)
    ends = entry["ends"] or ["", ""]
    start_point, end_point = (axis["points"][0], axis["points"][-1]) if axis else (nowhere, nowhere)
    return {
        **{key: entry[key] for key in ("id", "kind", "family", "stripe", "part")},
        "closed": int(entry["closed"]),
        "length_mm": entry["length"],
        **{f"{key}_width_mm": entry["width"][key] for key in ("median", "least", "greatest")},
        "area_mm2": entry["area"],
        "own_area_mm2": entry["own_area"],
        "nodes": len(entry["nodes"]),
        **{f"{end}": what for end, what in zip(("start", "end"), ends, strict=True)},
        **{f"start_{axis_name}_mm": x for axis_name, x in zip("xyz", start_point, strict=True)},
        **{f"end_{axis_name}_mm": x for axis_name, x in zip("xyz", end_point, strict=True)},
        **{f"largest_{name}_1_per_m": max(map(abs, axis[name])) if axis else None for name in ("kg", "kn", "tg")},
    }


def _node_row(entry: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "id": entry["id"],
        "kind": entry["kind"],
        **{f"member_{k}": name for k, name in zip("ab", entry["members"], strict=True)},
        **{f"along_{k}_mm": s for k, s in zip("ab", entry["at"], strict=True)},
        "angle_deg": entry["angle"],
        "area_mm2": entry["area"],
        **{f"{axis}_mm": x for axis, x in zip("xyz", entry["point"], strict=True)},
        **{f"normal_{axis}": x for axis, x in zip("xyz", entry["normal"], strict=True)},
    }


def _table(rows: list[dict[str, Any]], head: list[str] | None = None) -> Iterator[bytes]:
    text = io.StringIO()
    writer = csv.DictWriter(text, head or list(rows[0]))
    writer.writeheader()
    writer.writerows(rows)
    yield text.getvalue().encode()


def _rows(path: Path) -> list[dict[str, str]]:
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
