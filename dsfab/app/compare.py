"""`dsfab compare`: a design against others of the same mass under the same loads."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from dsfab.app.compare_one import Questions, Results, Task, compare_one
from dsfab.app.options import UNCHANGED, Quiet, Source
from dsfab.export import require_writable

ORDINARY, FULL_RESULTS = Questions(), Results()
"""What is asked and written when nothing else is said."""


def compare(
    preset: str,
    /,
    *more: str,
    source: Source = UNCHANGED,
    questions: Questions = ORDINARY,
    results: Results = FULL_RESULTS,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print results.json, no table.")] = False,
    quiet: Quiet = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, stripes that ignore the stress, and more.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer. Writes a report
    for an engineer (report.html, report.pdf), results.csv and results.json, and with --volumes a chart of compliance
    over mass. Several presets are compared one after the other, whatever happens to one of them; a page with one line
    for each stands at the end. Exit code 1 where a design does not carry its loads.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    more
        Further ones.
    """
    _ = questions.names, questions.shares  # what is wrong with them is said before anything is read
    task = Task(source, questions, results.report)
    if more or results.resume:
        from dsfab.app.compare_many import Batch

        return Batch(task, results.output).run((preset, *more), results.resume, quiet, json_)
    given = source.read(preset)
    folder = results.output or Path("outputs") / given.name / "compliance"
    require_writable(folder)
    return compare_one(given, task, folder, task.command(preset), quiet, json_)
