"""Questions to a sweep that is there: `--best` lists its best runs, `--build` makes all files of one."""

from pathlib import Path

from dsfab.app.terminal import out
from dsfab.errors import DsfabError
from dsfab.report.sweep_folder import headline
from dsfab.study.sweeps.folder import PRESET, SweepFolder
from dsfab.study.sweeps.results import best as best_of
from dsfab.study.sweeps.store import RunRow
from dsfab.study.variations import short_names, spelled_value
from dsfab.wording import table


def ask(path: Path, best: int | None, by: str | None, number: int | None, quiet: bool) -> int:
    """--best and --build; raises DsfabError for a folder without a sweep, and for runs that it does not have."""
    found = SweepFolder.at(path)
    if number is None:
        out(_best(found, best or 0, by))
        return 0
    from dsfab.app.build import Files, build
    from dsfab.app.options import Source

    changes = next((row.changes for row in found.rows() if row.number == number), None)
    if changes is None:
        raise DsfabError(f"there is no run {number}; {path} has runs 1 to {len(found.rows())}")
    sets = tuple(f"{key}={spelled_value(value)}" for key, value in changes.items())
    folder = path / "built" / f"{number:05}"
    return build(str(path / PRESET), source=Source(sets), files=Files(folder), quiet=quiet)


def _best(found: SweepFolder, count: int, by: str | None) -> str:
    """A table of the best runs."""
    plan = found.plan
    metric = by or headline(plan)
    if metric not in plan.measured:
        raise DsfabError(f"{metric!r} was not measured in {found.path}; use one of {', '.join(plan.measured)}")
    if count < 1:
        raise DsfabError(f"--best {count} lists nothing; give 1 or more")
    rows = found.rows()
    chosen = best_of(rows, metric, plan.limits)[:count]
    if not chosen:
        limits = f" and meets {', '.join(plan.constraints)}" if plan.constraints else ""
        raise DsfabError(f"no run of {found.path} is done{limits} with a {metric}")
    keys = list(dict.fromkeys(key for row in chosen for key in row.changes))
    short = short_names(keys)
    metrics = [metric, *(name for name in plan.measured if name != metric)]

    def line(row: RunRow) -> list[str]:
        numbers = [f"{row.metrics.get(name, float('nan')):.4g}" for name in metrics]
        return [str(row.number), *numbers, *(spelled_value(row.changes.get(key)) for key in keys)]

    return table(["run", *metrics, *(short[key] for key in keys)], [line(row) for row in chosen])
