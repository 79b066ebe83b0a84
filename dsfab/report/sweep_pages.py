"""Pages of a sweep: index.html, the contact sheet, and the pictures of runs."""

import json
import shlex
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from importlib.resources import files
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.core.messages import sentence
from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.export import atomic_file, write_chunks
from dsfab.preset.file import with_overrides
from dsfab.render import light
from dsfab.render.drawing import Annotations, Stage, page_view, render_stage, set_stage
from dsfab.render.lettering import PAPER
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import png_bytes
from dsfab.render.scene import Body, Scene
from dsfab.render.view import named_side, up_axis
from dsfab.report.contact_sheet import SHEET_NAME, ContactTile, column_count, contact_sheet
from dsfab.report.html_pages import page_style
from dsfab.study import ALTERNATIVE_WORDS, design_alternatives, losing_line
from dsfab.study.sweeps.folder import SweepFolder, best, feasible, pareto, picture_of
from dsfab.study.sweeps.metrics import ABOUT
from dsfab.study.sweeps.plan import Plan
from dsfab.study.sweeps.runs import RunRow
from dsfab.study.variations import short_names, spelled_value

if TYPE_CHECKING:
    from PIL.Image import Image

MEMBERS = np.array(PAPER.members, dtype=np.uint8)
_stages = threading.local()  # Each thread keeps its last surface, `SheetDrawer`, and stage.


def require_view(name: str) -> None:
    """Raise DsfabError if no view has this name."""
    if name != "iso":  # the view iso depends on the surface
        named_side(np.eye(3), np.array([0.0, 0.0, 1.0]), name)


@dataclass(frozen=True)
class SheetDrawer:
    """Drawer of a design's cut sheet as PNG; can be pickled. size : pixels.    view : name, as in `dsfab preview`.
    Raises DsfabError for an unknown view, or if this machine cannot draw."""

    size: tuple[int, int]
    view: str

    def __call__(self, design: Design) -> bytes:
        sheet = design.sheet.surface
        stage = self._empty_stage(design)
        stage = replace(stage, bodies=[Body(sheet.V, sheet.F, MEMBERS, casts=True)])
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            return png_bytes(np.asarray(render_stage(scene, stage, PAPER, self.size, light.QUICK)))

    def _empty_stage(self, design: Design) -> Stage:
        if getattr(_stages, "of", None) != (id(design.surface), self):
            require_rendering()
            surface, load = design.surface, design.load
            up = up_axis(surface.V, surface, load)
            side = named_side(surface.V, up, self.view)
            uncut_body = Body(surface.V, surface.F, MEMBERS, casts=True)
            half = design.preset.statics.thickness / 2
            stage = set_stage(uncut_body, side, up, half, Annotations(surface, load, layers=()), PAPER, self.size)
            stage = replace(stage, view=page_view([uncut_body], side, self.size, words=False))
            if side.towards @ up < 0:  # the ground is transparent from below
                stage = replace(stage, level=None)
            # `id` is unique only while the surface is stored
            _stages.of, _stages.surface, _stages.stage = (id(design.surface), self), surface, stage
        cached: Stage = _stages.stage
        return cached


USUAL = (("compliance", "compliance_quick", "displacement"), ("mass", "sheet_mass", "kept_share", "area"))
"""Usual metrics of a sweep's chart: first metrics of stiffness, then of weight. Earlier names are preferred."""

PAGE = "index.html"


def first_metric(plan: Plan) -> str:
    """Return the name of the metric that ranks the runs."""
    if plan.search is not None:
        return plan.search.metric
    return next((name for name in USUAL[0] if name in plan.measured_metrics), plan.measured_metrics[0])


def second_metric(plan: Plan) -> str:
    """Return the name of the metric on the second axis of a sweep's chart."""
    metric, measured = first_metric(plan), plan.measured_metrics
    candidates = [name for name in measured if name != metric]
    return next((name for name in USUAL[1] if name in candidates), candidates[0] if candidates else metric)


class SweepPages:
    """Writer of index.html while a sweep runs, and of all pages at its end."""

    def __init__(self, folder: SweepFolder) -> None:
        self._folder, self._written = folder, time.monotonic()

    def write_if_old(self) -> None:
        """Write index.html if 30 seconds have passed since it was last written."""
        if time.monotonic() - self._written > 30:
            self._write_page(self._folder.rows())
            self._written = time.monotonic()

    def write(self) -> None:
        """Write index.html and the contact sheet."""
        rows = self._folder.rows()
        self._write_page(rows)
        if any(picture_of(row) for row in rows):
            with atomic_file(self._folder.path / SHEET_NAME) as temporary:
                _contact_sheet(self._folder, rows).save(temporary, format="PNG")

    def _write_page(self, rows: list[RunRow]) -> None:
        plan = self._folder.plan
        text = sweep_page(self._folder, rows, first_metric(plan), second_metric(plan))
        with atomic_file(self._folder.path / PAGE) as temporary:
            write_chunks(temporary, [text.encode()])


def _contact_sheet(folder: SweepFolder, rows: list[RunRow]) -> "Image":
    plan, limit = folder.plan, 240
    shown = [row for row in rows if row.state in ("done", "failed", "killed")]
    subject = f"{len(shown)} runs"
    if len(shown) > limit:
        chosen = {row.number for row in best(rows, first_metric(plan), plan.limits)[:limit]}
        shown = [row for row in shown if row.number in chosen]
        subject = f"the best {len(shown)} of {len(rows)} runs, in the order of {first_metric(plan)}"
    tiles = [_tile(folder.path, row, first_metric(plan)) for row in shown]
    is_grid = plan.sampling == "grid" and plan.search is None
    column_number = column_count(len(tiles), [len(axis.grid_changes()) for axis in plan.axes] if is_grid else [])
    wide, high = (int(word) for word in plan.size.split("x"))
    subtitle = "   ·   ".join(key for axis in plan.axes for key in axis.keys)
    return contact_sheet(tiles, f"{folder.preset.name}, {subject}", subtitle, column_number, 260, wide / high, PAPER)


def _tile(folder: Path, row: RunRow, metric: str) -> ContactTile:
    from PIL import Image

    picture, name = None, picture_of(row)
    if name:
        try:
            picture = (folder / name).read_bytes()
            with Image.open(BytesIO(picture)) as image:
                image.load()
        except OSError:  # the user removed or damaged the picture
            picture = None
    short = short_names(list(row.changes))
    texts = {key: f"{x:.4g}" if isinstance(x, float) else spelled_value(x) for key, x in row.changes.items()}
    parameters = [(short[key], text) for key, text in texts.items()]
    if metric in row.metrics:
        parameters.insert(0, (f"{row.metrics[metric]:.3g} {ABOUT[metric].unit}".strip(), ""))
    return ContactTile(row.number, tuple(parameters), "", picture, row.error or "no picture")


def sweep_summary(folder: SweepFolder) -> str:
    """Return lines about a sweep: states of the runs, best run, Pareto front, and files."""
    rows, plan = folder.rows(), folder.plan
    metric, other_metric = first_metric(plan), second_metric(plan)
    states = [row.state for row in rows]
    done_count, failed_count, killed_count = (states.count(state) for state in ("done", "failed", "killed"))
    left_count = len(rows) - done_count - failed_count - killed_count
    rest_words = f", {killed_count} killed" * (killed_count > 0) + f", {left_count} left" * (left_count > 0)
    lines = [f"{len(rows)} runs: {done_count} done, {failed_count} failed{rest_words}"]
    if plan.constraints:
        feasible_count = sum(feasible(row, plan.limits) for row in rows)
        lines.append(f"{feasible_count} of them meet {', '.join(plan.constraints)}")
    if ranked := best(rows, metric, plan.limits):
        lines.append(f"best {metric}: {ranked[0].metrics[metric]:.4g} (run {ranked[0].number})")
        front = pareto(rows, metric, other_metric, plan.limits)
        lines.append(f"{len(front)} runs are on the Pareto front of {metric} and {other_metric}")
    files = [PAGE, "results.csv", "results.parquet", SHEET_NAME]
    return "\n".join([*lines, *(f"  {folder.path / name}" for name in files if (folder.path / name).is_file())])


def loss_sentence(folder: SweepFolder) -> str:
    """Return a sentence if a simple alternative is stiffer than the best run; else ''."""
    ranked = best(folder.rows(), first_metric(folder.plan), folder.plan.limits)
    if not ranked:
        return ""
    row, names = ranked[0], [f"over_{name}" for name in ALTERNATIVE_WORDS]
    if all(name in row.metrics for name in names) and max(row.metrics[name] for name in names) <= 1:
        return ""
    try:
        alternatives = design_alternatives(draft(with_overrides(folder.preset, row.changes)))
    except DsfabError:
        return ""  # the record of the best run shows the reason
    losing_words = losing_line(alternatives)
    return sentence(f"the best run is run {row.number}, and {losing_words}") if losing_words else ""


def missing_runs_line(folder: SweepFolder) -> str:
    """Return a line of text with the number of runs without a result; '' if all runs have results."""
    rows = folder.rows()
    killed = [row.number for row in rows if row.state == "killed"]
    missing = len(killed) + sum(row.state in ("waiting", "running") for row in rows)
    if not missing:
        return ""
    few = ", ".join(map(str, killed[:10])) + ", ..." * (len(killed) > 10)
    why = f" (killed: {few})" if killed else ""
    return f"{missing} of {len(rows)} runs {'is' if missing == 1 else 'are'} missing{why}"


def sweep_page(folder: SweepFolder, rows: Sequence[RunRow], y_metric: str, x_metric: str) -> str:
    """Return the text of index.html. y_metric, x_metric : metrics on the chart's axes when the page opens."""
    facts = _page_facts(folder, rows, y_metric, x_metric)
    text = json.dumps(facts, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    template = files("dsfab.report").joinpath("sweep_page.html").read_text(encoding="utf-8")
    title = escape(f"{folder.preset.name}, {len(rows)} runs")
    return template.replace("{{title}}", title).replace("{{style}}", page_style()).replace("{{facts}}", text)


def _page_facts(folder: SweepFolder, rows: Sequence[RunRow], y_metric: str, x_metric: str) -> dict[str, Any]:
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
            for name in plan.measured_metrics
        ],
        "x": x_metric,
        "y": y_metric,
        "constraints": list(plan.constraints),
        "size": [wide, high],
        "runs": [_run_facts(row, keys, plan.measured_metrics, feasible(row, plan.limits)) for row in rows],
    }


def _run_facts(row: RunRow, keys: Sequence[str], metrics: Sequence[str], meets: bool) -> list[Any]:
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
