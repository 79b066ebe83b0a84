"""By what designs are compared: one solve, or finer and finer meshes where that takes less than a minute."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

from dsfab.errors import DsfabError
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress, silent
from dsfab.statics import Ask, flat_axis
from dsfab.study.baselines import DEFAULT, ComparisonTask, Structure, chosen
from dsfab.study.comparison import Comparison, comparison
from dsfab.study.full_check import full
from dsfab.study.judging import Judge, Judgement, quick
from dsfab.study.verdict import BUDGET

TRIANGLE = {True: 4e-4, False: 1.7e-3}
"""Seconds of a full check for each triangle of the mesh as it is cut, in the plane and bent: measured on two meshes."""


def seconds_needed(triangles: int, plane: bool) -> float:
    """What a full check takes on one core, about; four times as much where a third mesh is needed."""
    return TRIANGLE[plane] * triangles


PATIENCE = 60.0
"""Seconds that full checks may take in all where no level is asked for."""

Level = Literal["quick", "full"]


@dataclass(frozen=True)
class Checks:
    """How deep each is looked at.

    level  : quick or full; None is full for the design, and for what it is compared with if all take under a minute.
    ask    : answers besides the compliance.        memory : bytes that the solver may take for a full check.
    """

    level: str | None = None
    ask: Ask | None = None
    memory: float = BUDGET
    progress: Progress = silent

    def judge(self, depth: str, every: bool = False) -> Judge:
        """depth : quick, full, or whole: full for whole sheets, on whose meshes one solve is far off, quick for others.
        every : whether all cases are judged.
        """
        if depth == "whole":
            return _full_for_whole_sheets(self.judge("full"), self.judge("quick"))
        if depth == "full":
            return partial(full, ask=self.ask, every=every, budget=self.memory, progress=self.progress)
        return partial(quick, ask=self.ask, every=every) if self.ask or every else quick


class Judges(NamedTuple):
    """Of the design, each case, and of its competitors; and where these are judged by one solve only, why, or ''."""

    own: Judge
    rival: Judge
    told: str = ""


def compare(
    design: Design, against: Iterable[str] = DEFAULT, level: Level | None = None, progress: Progress = silent
) -> Comparison:
    """The design's compliance on its own cut sheet, beside competitors of the same mass, as `dsfab compare` has it.

    against : names of `dsfab.study.baselines.BASELINES`.
    level   : quick, one solve each; full, on finer and finer meshes, for a compliance with a tested bound; None is full
              for the design, and for the competitors too if all take less than a minute.

    Raises StaticsError when the design itself does not carry its loads, DsfabError for names of no baseline.
    """
    names = tuple(against)
    own, rival, _ = judges(design, names, Checks(level, progress=progress))
    return comparison(design, names, own, partial(progress, "compare"), rival).with_alternatives()


def judges(design: Design, against: Iterable[str], checks: Checks) -> Judges:
    """Who looks at the design and its competitors, whose names are `against`."""
    names = tuple(chosen(against))
    if checks.level is None and _cuts(design):
        plane = flat_axis(design.surface, *(case.load for case in design.statics.cases.values())) is not None
        whole = 1 + ("thinner" in names)
        triangles = whole * design.surface.m + (2 + len(names) - whole) * design.sheet.surface.m
        seconds = seconds_needed(triangles, plane)
        if seconds > PATIENCE:
            told = f"full checks of all would take about {seconds:.0f} s: those that are cut are judged by one solve"
            return Judges(checks.judge("full", True), checks.judge("whole"), told)
    depth = checks.level or "full"
    return Judges(checks.judge(depth, True), checks.judge(depth))


def full_at_many_shares(memory: float = BUDGET) -> Judge:
    """`full` for comparisons at many shares of one surface: the whole sheet of a thickness is judged once.

    memory : bytes that the solver may take.
    """
    judge = partial(full, budget=memory)
    return _full_for_whole_sheets(judge, judge)


def _cuts(design: Design) -> bool:
    """Whether its pattern can be cut at all."""
    try:
        return bool(design.sheet)
    except DsfabError:
        return False


def _full_for_whole_sheets(whole: Judge, cut: Judge) -> Judge:
    """`whole` for what is not cut, once for each thickness, and `cut` for the rest."""
    known: dict[float, Judgement] = {}

    def judge(task: ComparisonTask, made: Structure) -> Judgement:
        if made.cells is not made.sheet:
            return cut(task, made)
        if made.thickness not in known:
            known[made.thickness] = whole(task, made)
        return known[made.thickness]

    return judge
