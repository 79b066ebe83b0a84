"""The numbers of `dsfab compare`: results.csv, results.json, and the chart over several masses."""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsfab.report.design.facts import versions

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.study import Comparison


def write_results(
    preset: "Preset", found: "Sequence[tuple[float | None, Comparison]]", command: str, folder: Path
) -> str:
    """results.csv and results.json, whose text is returned; `verdict` is the full check of the design."""
    from dsfab.preset_file import preset_toml

    rows = [{"volume": share, **row} for share, one in found for row in one.record()["competitors"]]
    about = {"name": preset.name, "command": command, "versions": versions(), "preset": preset_toml(preset)}
    own = next((one for share, one in found if share is None), None)
    beside = {"alternatives": [one.record() for one in own.alternatives]} if own else {}
    document = json.dumps({**about, **_verdict(found), **beside, "competitors": rows}, indent=2)
    (folder / "results.json").write_text(document + "\n", encoding="utf-8")
    (folder / "results.csv").write_text(_csv(rows), encoding="utf-8", newline="")
    shared = [row for row in rows if row["volume"] is not None]
    if len({row["volume"] for row in shared}) > 1:
        from dsfab.report.comparison_chart import write_chart

        write_chart(shared, f"{preset.name}: compliance over mass", folder / "chart")
    return document


def _verdict(found: "Sequence[tuple[float | None, Comparison]]") -> dict[str, Any]:
    """`verdict` on the design as its preset draws it: the full check, or why it fails; nothing after one solve."""
    for share, one in found:
        if share is None:
            if one.design.judgement is None:
                return {"verdict": {"status": "fail", "reason": one.design.error}}
            return {"verdict": check.record()} if (check := one.design.judgement.check) else {}
    return {}


def _csv(rows: list[dict[str, Any]]) -> str:
    """A line each; points as 'x y z', reactions as JSON."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="")
    writer.writeheader()
    writer.writerows({key: _cell(value) for key, value in row.items()} for row in rows)
    return text.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return " ".join(f"{x:.9g}" for x in value)
    return json.dumps(value) if isinstance(value, dict) else value
