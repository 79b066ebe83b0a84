"""Several presets compared one after the other, unattended, with a page of one line for each at the end."""

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsfab.app.compare_one import Task, compare_one
from dsfab.app.terminal import Reporter, out
from dsfab.errors import DsfabError
from dsfab.export import whole_or_nothing
from dsfab.report.design.facts import versions

if TYPE_CHECKING:
    from dsfab.preset import Preset

FILES = ("summary.html", "summary.csv")

Row = dict[str, Any]
"""`name`, `folder` and `error`; without an error `verdict`, `reason`, `mass_kg`, `area_fraction`, `compliance_J`,
`bound`, `ratio_to_full` and `seconds` of the design, and `NAME_ratio` of each competitor: its compliance over the
design's. None for what is not known."""


@dataclass(frozen=True)
class Batch:
    """What is asked of each, and where a folder for each stands and the summary; None for outputs/NAME/compliance and
    outputs/compare."""

    task: Task
    output: Path | None

    def run(self, presets: Sequence[str], resume: bool, quiet: bool, as_json: bool) -> int:
        """Compare all and write the summary. 1 where one was refused or does not carry its loads, else 0.

        What is refused is told in a sentence, and the others go on.
        """
        reporter = Reporter(quiet or as_json)
        rows: list[Row] = []
        for count, preset in enumerate(presets, start=1):
            reporter.say(f"{count} of {len(presets)}: {preset}")
            row = self._row(preset, [row["folder"] for row in rows], resume, reporter)
            rows.append(row)
            reporter.say(f"{row['name']}: {row['error'] or row['verdict']}\n")
        folder = self.output or Path("outputs") / "compare"
        with whole_or_nothing(folder) as partial_folder:
            _write(rows, self.task.questions.names, folder, partial_folder)
        if as_json:
            out(json.dumps([row | {"folder": str(row["folder"] or "")} for row in rows], indent=2))
        elif not quiet:
            out("\n".join(f"  {folder / name}" for name in FILES))
        return int(any(row["error"] or row["verdict"] == "fail" for row in rows))

    def _row(self, preset: str, taken: Sequence[Path | None], resume: bool, reporter: Reporter) -> Row:
        name, command = Path(preset).stem, self.task.command(preset)
        try:
            given = self.task.source.read(preset)
            folder = self.output / given.name if self.output else Path("outputs") / given.name / "compliance"
            if folder in taken:
                raise DsfabError(f"a preset before it is called {given.name} too; change `name` in one of the files")
            name = given.name
            if not (resume and _made(folder, given, command, self.task.report)):
                compare_one(given, self.task, folder, command, quiet=True, as_json=False)
            else:
                reporter.say("compared already")
            return {"name": name, "folder": folder, "error": "", **_found(folder)}
        except DsfabError as error:
            return {"name": name, "folder": None, "error": str(error), "verdict": ""}


def _made(folder: Path, given: "Preset", command: str, report: bool) -> bool:
    """Whether the folder has what this command makes of this preset, with these versions."""
    from dsfab.preset_file import preset_toml

    try:
        told = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    wanted = {"command": command, "preset": preset_toml(given), "versions": versions()}
    whole = not report or (folder / "report.html").exists()
    return whole and all(told.get(key) == value for key, value in wanted.items())


def _found(folder: Path) -> Row:
    """From results.json."""
    told = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    rows = [row for row in told["competitors"] if row["volume"] is None] or told["competitors"]
    of = {row["name"]: row for row in rows}
    own = of.pop("design")
    keys = ("verdict", "reason", "mass_kg", "area_fraction", "compliance_J", "bound", "ratio_to_full")
    beside = {f"{name}_ratio": row["ratio_to_design"] for name, row in of.items() if name != "full"}
    return {key: own.get(key) for key in keys} | beside | {"seconds": sum(row["seconds"] for row in rows)}


def _write(rows: Sequence[Row], against: Sequence[str], folder: Path, partial_folder: Path) -> None:
    from dsfab.report.comparison_summary import summary_page
    from dsfab.report.compliance.html import page

    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(partial_folder / "summary.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    (partial_folder / "summary.html").write_text(page(summary_page(rows, against, folder)), encoding="utf-8")
