"""JSON: the graph of a design's members, `NAME.members.json`, for scripts. Millimetres; curvatures per metre."""

import json
from collections.abc import Iterator
from pathlib import Path

from dsfab import __version__
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs


def prepare(part: Part) -> Part:
    """The part as it is; raises ExportError if it comes without members."""
    if not part.details.records.get("members"):
        raise ExportError(f"{part.name!r} has no members to write; only a design knows them: use design.write(...)")
    return part


def encode(part: Part) -> Iterator[bytes]:
    """One object; a line of text for each member and for each node."""
    records = part.details.records
    head = {"name": part.name, "program": f"dsfab {__version__}", "unit": "millimetre", "curvature": "1/m"}
    yield (json.dumps(head | {"notes": records["notes"]}, ensure_ascii=False)[:-1]).encode()
    for key in ("members", "nodes"):
        yield f', "{key}": [\n'.encode()
        for i, entry in enumerate(records[key]):
            yield ((",\n" if i else "") + json.dumps(entry)).encode()
        yield b"\n]"
    yield b"}\n"


def check(part: Part, path: Path) -> ReadBack:
    """Read back as a whole."""
    found = json.loads(path.read_text(encoding="utf-8"))
    for key in ("members", "nodes"):
        check_records(part, key, [entry["id"] for entry in found[key]])
    return length_error(part, sum(entry["length"] for entry in found["members"]))


def check_records(part: Part, key: str, names: list[str]) -> None:
    """Raise ExportError unless these are the names of the part's members, or nodes."""
    wanted = [entry["id"] for entry in part.details.records[key]]
    if names != wanted:
        raise differs(part, key, len(wanted), len(names))


def length_error(part: Part, found: float) -> ReadBack:
    """What was found of the members, whose lengths add up to `found` millimetres."""
    members = part.details.records["members"]
    wanted = sum(entry["length"] for entry in members)
    return ReadBack(len(members), "members", found / wanted - 1 if wanted else float("nan"), "length")
