"""CSV: the members of a design, `NAME.members.csv`, and its nodes, `NAME.nodes.csv`, for spreadsheets. Millimetres."""

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dsfab.export.members_json import check_records, length_error
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack


def encode_members(part: Part) -> Iterator[bytes]:
    """A row per member: lengths in millimetres, curvatures in 1/m; empty where there is no axis."""
    yield from _table([_member_row(entry) for entry in part.details.records["members"]])


def encode_nodes(part: Part) -> Iterator[bytes]:
    """A row per node: lengths in millimetres, angles in degrees."""
    yield from _table([_node_row(entry) for entry in part.details.records["nodes"]], list(_node_row(_NO_NODE)))


def check_members(part: Part, path: Path) -> ReadBack:
    """Read back row by row."""
    rows = _rows(path)
    check_records(part, "members", [row["id"] for row in rows])
    return length_error(part, sum(float(row["length_mm"]) for row in rows))


def check_nodes(part: Part, path: Path) -> ReadBack:
    """Read back row by row."""
    rows = _rows(path)
    check_records(part, "nodes", [row["id"] for row in rows])
    return ReadBack(len(rows), "nodes")


_NO_NODE = {"id": "", "kind": "", "members": ["", ""], "at": [0, 0], "angle": 0, "area": 0, "point": [0, 0, 0]}
_NO_NODE |= {"normal": [0, 0, 0]}


def _member_row(entry: Mapping[str, Any]) -> dict[str, Any]:
    axis, nowhere = entry["axis"], (None, None, None)
    ends = entry["ends"] or ["", ""]
    first, last = (axis["points"][0], axis["points"][-1]) if axis else (nowhere, nowhere)
    largest = {f"largest_{name}_1_per_m": max(map(abs, axis[name])) if axis else None for name in ("kg", "kn", "tg")}
    return {
        **{key: entry[key] for key in ("id", "kind", "family", "stripe", "part")},
        "closed": int(entry["closed"]),
        "length_mm": entry["length"],
        **{f"{key}_width_mm": entry["width"][key] for key in ("median", "least", "greatest")},
        "area_mm2": entry["area"],
        "own_area_mm2": entry["own_area"],
        "nodes": len(entry["nodes"]),
        **{f"{end}": what for end, what in zip(("start", "end"), ends, strict=True)},
        **{f"start_{axis_name}_mm": x for axis_name, x in zip("xyz", first, strict=True)},
        **{f"end_{axis_name}_mm": x for axis_name, x in zip("xyz", last, strict=True)},
        **largest,
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
