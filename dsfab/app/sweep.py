"""The command `dsfab sweep`: many designs of one preset in one folder."""

import shlex
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, OutputName, Quiet, Source, Switch, picture_size
from dsfab.app.terminal import ExitCode, print_result
from dsfab.core.errors import DsfabError
from dsfab.core.toml_files import TomlError, shipped_presets, toml_table

if TYPE_CHECKING:
    from dsfab.study.sweeps.folder import SweepFolder
    from dsfab.study.sweeps.plan import Plan
    from dsfab.study.sweeps.runs import State
    from dsfab.study.sweeps.scheduler import Progress
    from dsfab.study.sweeps.workers import Drawer, Workers


@Parameter(name="*")
@dataclass(frozen=True)
class PlanOptions:
    """Options of a sweep."""

    sample: Annotated[
        str | None, Parameter(help="How to choose the points: grid, sobol:N, lhs:N or csv:FILE [grid].")
    ] = None
    seed: Annotated[int | None, Parameter(help="Seed of the sampling [0].")] = None
    metric: Annotated[tuple[str, ...], Parameter(negative=(), help="Metrics to measure (comma list, repeatable).")] = ()
    constraint: Annotated[
        tuple[str, ...],
        Parameter(
            name=["--constraint", "--subject-to"],
            negative=(),
            help="Condition that good runs meet, such as 'pieces == 1'.",
        ),
    ] = ()
    optimise: Annotated[
        str | None, Parameter(help="Search for the best value of this metric, instead of sampling.")
    ] = None
    evaluations: Annotated[int | None, Parameter(help="Runs of a search [200].")] = None
    keep: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="Files of each run to keep: picture, preset, sheet, solid or nothing [picture]."),
    ] = ()
    export: Annotated[
        str | None, Parameter(help="Keep the solids of all runs, in some of these formats: stl,3mf,step,obj,ply,glb.")
    ] = None
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT of the pictures [480x360].")] = None
    view: Annotated[
        str | None, Parameter(help="Direction of view: iso, top, front, side, or azimuth,elevation in degrees.")
    ] = None

    def tables(self, file_tables: Mapping[str, Any]) -> dict[str, Any]:
        """Return these options as keys of a sweep file. An unset option has the value None or an empty list.
        file_tables : contents of the user's sweep file."""
        from dsfab.app.sweep_options import listed_words

        keep_words = listed_words(self.keep)
        tables: dict[str, Any] = {
            "sampling": self.sample,
            "seed": self.seed,
            "metrics": listed_words(self.metric),
            "constraints": listed_words(self.constraint),
            "keep": [] if keep_words == ["nothing"] else keep_words,
            "size": self.size,
            "view": self.view,
        }
        search_options = {"metric": self.optimise, "evaluations": self.evaluations}
        if search := {key: value for key, value in search_options.items() if value is not None}:
            tables["search"] = {**file_tables.get("search", {}), **search}
        if self.export is not None:
            tables["formats"] = listed_words([self.export.lower()])
            tables["keep"] = list(dict.fromkeys([*(keep_words or file_tables.get("keep", ["picture"])), "solid"]))
        return tables


@Parameter(name="*")
@dataclass(frozen=True)
class Work:
    """Options of a sweep: folder, processes, and runs to repeat."""

    output: Annotated[Path | None, OutputName(help="Folder of the sweep [outputs/NAME-sweep].")] = None
    workers: Annotated[
        int | None, Parameter(help="Number of processes that make designs [all cores, if memory suffices].")
    ] = None
    scheduler: Annotated[str | None, Parameter(help="Address of a Dask scheduler, tcp://HOST:8786.")] = None
    extend: Annotated[bool, Switch(help="Add new runs to an existing sweep.")] = False
    retry: Annotated[
        Literal["killed", "failed", "all"],
        Parameter(help="Runs of an existing sweep to repeat: runs whose worker was killed, failed runs, or both."),
    ] = "killed"

    @property
    def retried_states(self) -> "tuple[State, ...]":
        """States, such as "failed", of the earlier runs to repeat."""
        return ("killed", "failed") if self.retry == "all" else (self.retry,)

    def folder(self, what: str, varied: bool) -> Path | None:
        """Return the folder of the sweep; None for the default folder.
        Raises DsfabError if `what` is the folder of a sweep and differs from --output."""
        if _is_sweep_folder(what, varied):
            if self.output is not None and self.output.resolve() != Path(what).resolve():
                raise DsfabError(f"{what} is a sweep's folder, and the sweep continues in it; leave out -o")
            return Path(what)
        return self.output


@Parameter(name="*")
@dataclass(frozen=True)
class RunChoice:
    """Runs of a sweep to list or to build."""

    best: Annotated[int | None, Parameter(help="List the best N runs of a sweep's folder.")] = None
    by: Annotated[str | None, Parameter(help="Metric of --best [compliance].")] = None
    build: Annotated[int | None, Parameter(help="Build run N of a sweep's folder in full.")] = None


def sweep(
    what: str,
    /,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            help="Values of a key: KEY=LOW:HIGH:COUNT[:log], KEY=ONE,TWO,... or, with --sample, KEY=LOW:HIGH[:log].",
        ),
    ] = (),
    source: Source = UNCHANGED,
    plan: PlanOptions = PlanOptions(),
    work: Work = Work(),
    choice: RunChoice = RunChoice(),
    quiet: Quiet = False,
) -> int:
    """Make many designs of a preset: numbers, pictures and a page to choose from, in one folder.

    You may stop a sweep at any time; the same command, or `dsfab sweep FOLDER`, continues it. The exit code is 3 if
    runs are missing.

    Parameters
    ----------
    what
        A sweep file, a preset (with --vary), or the folder of a sweep to continue."""
    from dsfab.app.sweep_options import listed_words, with_options

    if choice.best is not None or choice.build is not None:
        from dsfab.app.sweep_status import list_or_build_run

        return list_or_build_run(Path(what), choice.best, choice.by, choice.build, quiet)
    varied = bool(vary or (plan.sample or "").startswith("csv:"))
    file_tables, title = _plan_tables(what, varied)
    values = with_options(file_tables, source, vary, plan.tables(file_tables))
    if listed_words(plan.keep) == ["nothing"]:
        values["keep"] = []
    return _run_sweep(values, title, work.folder(what, varied), work, quiet)


def _is_sweep_folder(what: str, varied: bool) -> bool:
    return Path(what).is_dir() and not (varied and what in shipped_presets())


def _plan_tables(what: str, varied: bool) -> tuple[dict[str, Any], str]:
    from dsfab.study.sweeps.folder import SWEEP
    from dsfab.study.sweeps.plan import read_plan

    path = Path(what)
    if _is_sweep_folder(what, varied):
        if not (path / SWEEP).is_file():
            raise DsfabError(f"{path} holds no sweep ({SWEEP} is missing); give a sweep's folder or a sweep file")
        return read_plan(path / SWEEP), f"sweep {path / SWEEP}"
    if path.is_file() and _is_sweep(path):
        return read_plan(path), f"sweep {path.name}"
    if not varied:
        raise DsfabError(
            f"{what} is neither a sweep file nor the folder of a sweep; to sweep a preset, add the keys to vary: "
            f"dsfab sweep {what} --vary pattern.major.frequency=6:12:4"
        )
    return {"preset": what}, f"sweep of {what}"


def _is_sweep(path: Path) -> bool:
    try:
        values = toml_table(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, TomlError):
        return path.suffix == ".toml"  # for a faulty .toml file, `read_plan` reports the fault
    return not {"preset", "vary", "linked"}.isdisjoint(values)


def _run_sweep(values: dict[str, Any], title: str, folder: Path | None, work: Work, quiet: bool) -> int:
    from dsfab.app.sweep_status import SweepProgress
    from dsfab.report.sweep_pages import first_metric, loss_sentence, missing_runs_line, sweep_summary
    from dsfab.study.sweeps.folder import checked_plan, only_coordinator, prepare, sweep_folder
    from dsfab.study.sweeps.plan import plan_from

    if work.workers is not None and work.workers < 1:
        raise DsfabError(f"--workers {work.workers} is less than 1; give 1 or more")
    plan = plan_from(values, title)
    draw = _drawer(plan)
    checked = checked_plan(plan)
    folder = folder if folder is not None else Path("outputs") / f"{checked[0].name}-sweep"
    line = SweepProgress(quiet, first_metric(plan), plan.limits)
    with only_coordinator(sweep_folder(folder)):
        sweep = prepare(plan, folder, work.extend, checked)
        for row in sweep.rows():
            if row.state == "done":
                line.add_run(row.number, row.metrics)
        stopped = _run_all(sweep, _workers(sweep, draw, work.workers, work.scheduler), line, work.retried_states)
        if not quiet:
            if plan.search is not None and not stopped and (losing_words := loss_sentence(sweep)):
                print_result(losing_words)
            print_result(sweep_summary(sweep))
        missing, quoted = missing_runs_line(sweep), shlex.quote(str(folder))
    if stopped:
        line.print_line(f"dsfab: stopped; finished runs are kept. To go on: `dsfab sweep {quoted}`. {missing}".rstrip())
        return ExitCode.INTERRUPTED
    if missing:
        line.print_line(f"dsfab: {missing}; `dsfab sweep {quoted}` tries these runs again")
    return ExitCode.UNFINISHED if missing else ExitCode.DONE


def _run_all(sweep: "SweepFolder", workers: "Workers", line: Any, retry: "Collection[State]") -> bool:
    from dsfab.report.sweep_pages import SweepPages

    pages, stopped = SweepPages(sweep), False

    def report_progress(progress: "Progress") -> None:
        line(progress)
        pages.write_if_old()

    try:
        try:
            sweep.run(workers, report_progress, retry)
        except KeyboardInterrupt:
            stopped = True
        finally:
            line.stop()
            workers.close()
    finally:
        pages.write()
    return stopped


def _drawer(plan: "Plan") -> "Drawer | None":
    from dsfab.render.opengl import require_rendering
    from dsfab.report.sweep_pages import SheetDrawer, require_view

    if "picture" not in plan.keep:
        return None
    require_view(plan.view)
    size = picture_size(plan.size)
    require_rendering()
    return SheetDrawer(size, plan.view)


def _workers(sweep: "SweepFolder", draw: "Drawer | None", workers: int | None, scheduler: str | None) -> "Workers":
    from dsfab.study.sweeps.workers import DaskWorkers, LocalWorkers

    if scheduler is not None:
        return DaskWorkers(sweep.job(draw, ship_mesh=True), scheduler)
    return LocalWorkers(sweep.job(draw), workers)
