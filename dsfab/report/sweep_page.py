"""index.html of a sweep: one file that opens offline, with every run in it. See sweep_page.html for how it works."""

import json
import shlex
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from math import isfinite
from typing import Any

from dsfab.study.sweeps.folder import SweepFolder
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.results import feasible, picture_of
from dsfab.study.sweeps.store import Row
from dsfab.study.variations import short_names

PAGE = "index.html"


def page(folder: SweepFolder, rows: Sequence[Row], stiff: str, heavy: str) -> str:
    """The page; `stiff` and `heavy` are the metrics that it draws against each other at first.

    Pictures are files beside it, named relative to it; everything else is inside. Runs that failed, or have no value
    of a metric, are shown as such.
    """
    facts = json.dumps(_facts(folder, rows, stiff, heavy), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    template = files("dsfab.report").joinpath("sweep_page.html").read_text(encoding="utf-8")
    title = escape(f"{folder.preset.name}, {len(rows)} runs")
    return template.replace("{{title}}", title).replace("{{facts}}", facts.replace("</", "<\\/"))


def _facts(folder: SweepFolder, rows: Sequence[Row], stiff: str, heavy: str) -> dict[str, Any]:
    """What the page knows."""
    plan = folder.plan
    keys = list(dict.fromkeys(key for row in rows for key in row.changes))
    short = short_names(keys)
    wide, high = (int(word) for word in plan.size.split("x"))
    return {
        "name": folder.preset.name,
        "command": shlex.join(["dsfab", "sweep", str(folder.path)]) + " --build ",
        "inputs": [{"key": key, "short": short[key]} for key in keys],
        "metrics": [
            {"name": name, "unit": ABOUT[name].unit, "better": ABOUT[name].better, "says": ABOUT[name].says}
            for name in plan.measured
        ],
        "x": heavy,
        "y": stiff,
        "constraints": list(plan.constraints),
        "size": [wide, high],
        "runs": [_run(row, keys, plan.measured, feasible(row, plan.limits)) for row in rows],
    }


def _run(row: Row, keys: Sequence[str], metrics: Sequence[str], meets: bool) -> list[Any]:
    values = [row.metrics.get(name) for name in metrics]
    return [
        row.number,
        row.state,
        [row.changes.get(key) for key in keys],
        [value if value is not None and isfinite(value) else None for value in values],
        int(meets),
        row.seconds and round(row.seconds, 3),
        picture_of(row),
        row.error,
    ]
