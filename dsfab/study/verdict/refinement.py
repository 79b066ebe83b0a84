"""`Refinement`: a sheet solved on finer and finer meshes until its compliance is known, or something stops it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice

from dsfab.errors import DsfabError
from dsfab.limits import CONVERGED, Status
from dsfab.pipeline.log import Progress
from dsfab.slicing import Sheet
from dsfab.sparse import NotPositiveDefinite, solver_name
from dsfab.statics import Elements, flat_axis
from dsfab.study.verdict import rules
from dsfab.study.verdict.finer import Shares, meshes, on_mesh, shares
from dsfab.study.verdict.levels import BESIDE, MAIN, ONCE, Level, level, memory_needed
from dsfab.study.verdict.loaded_surface import LoadedSurface
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.study.verdict.theory import WORTH, theory_share
from dsfab.study.verdict.verdict import CaseVerdict, Depth
from dsfab.surface import LoadCase, Surface

LEVELS = 3
"""Meshes at most: the cut mesh and two refinements."""

COUNT = {2: "two levels", 3: "three levels"}


@dataclass
class Refinement:
    """Meshes solved up to now.

    stopped : why no more were, with the status that follows; None where enough is known, or all were solved.
    unsolved : whether the last of them was tried, and its solution did not hold.
    """

    setting: LoadedSurface
    smooth: SmoothSurface
    depth: Depth
    budget: float
    progress: Progress | None
    levels: list[Level] = field(default_factory=list)
    stopped: tuple[Status, str] | None = None
    unsolved: bool = False

    def up(self, sheet: Sheet, loads: Mapping[str, LoadCase]) -> None:
        """Solve what is needed. loads : on the sheet, as they are handed to it."""
        forces = shares(sheet, loads)
        bent = islice(meshes(sheet, self.smooth), LEVELS)
        for mesh in [sheet] if self.depth == "quick" else bent:
            if told := self._too_large(mesh.surface):
                self.stopped = "unknown", told
                return
            try:
                self._solve(mesh, forces)
            except DsfabError as error:
                self.unsolved = True
                broken = not self.levels and isinstance(error.__cause__, NotPositiveDefinite)
                self.stopped = ("fail" if broken else "unknown"), str(error)
                return
            if len(self.levels) > 1 and all(case.status == "pass" for case in self.cases()):
                return

    def cases(self) -> list[CaseVerdict]:
        """What the meshes that were solved say of each case."""
        return [self._case(name) for name in self.setting.loads]

    @property
    def plane(self) -> bool:
        """Whether the sheet is solved in its plane."""
        return flat_axis(self.setting.surface, *self.setting.loads.values()) is not None

    @property
    def _pair(self) -> Elements:
        pair = ONCE if self.depth == "quick" else MAIN
        return pair.in_plane if self.plane else pair

    def _too_large(self, mesh: Surface) -> str:
        """Why this mesh is not solved, or ''."""
        needed = memory_needed(self._pair.unknowns(mesh), self._pair.bending, solver_name())
        if needed <= self.budget:
            return ""
        return (
            f"the next mesh, of {mesh.m:,} triangles, needs about {needed / 1e9:.1f} GB and the budget is "
            f"{self.budget / 1e9:.1f} GB; raise the budget or make the surface's mesh coarser"
        )

    def _solve(self, mesh: Sheet, forces: Mapping[str, Shares]) -> None:
        if self.progress:
            self.progress("verdict", f"solving {mesh.surface.m:,} triangles")
        loads, spreads = on_mesh(self.setting.surface, mesh, self.setting.loads, forces)
        # finer meshes are there for the steps between them: how far the two pairs are apart is told by the first
        pairs = (ONCE,) if self.depth == "quick" else (MAIN,) if self.levels else (MAIN, BESIDE)
        ribs = self.depth == "full" and not self.levels
        self.levels.append(level(mesh.surface, self.setting.made, loads, spreads, pairs, ribs))

    def _case(self, name: str) -> CaseVerdict:
        last, values = self.levels[-1], [one.compliance[name] for one in self.levels]
        softer = self.levels[0].softer
        errors = last.zz_membrane[name], last.zz_bending[name], theory_share(softer[name]) if softer else 0.0
        if self.depth == "quick":
            typical, most = rules.QUICK
            told = f"one solve on the cut mesh: typically within {percent(typical)}, nine in ten within {percent(most)}"
            return CaseVerdict(name, values[0], most, "unknown", told, 0.0, *errors)
        first = self.levels[0]
        spread = first.midedge[name] / first.compliance[name] - 1 if first.midedge else 0.0
        found = rules.estimate(values, spread, sum(errors[:2]))
        known = len(values) > 1 and found.bound <= CONVERGED
        if len(values) == 1:
            told = f"{percent(found.bound)} by the recovery error of one mesh, which alone shows no convergence"
        elif known:
            told = f"converged within {percent(found.bound)}"
        else:
            told = f"not converged: {percent(found.bound)} after {COUNT[len(values)]}"
        told += theory_words(errors[2]) if len(values) > 1 else ""
        return CaseVerdict(name, found.value, found.bound, "pass" if known else "unknown", told, spread, *errors)


def theory_words(share: float) -> str:
    """'; thin-shell theory: a solid is up to 3 % softer'; '' for less than is worth a word."""
    return f"; thin-shell theory: a solid is up to {percent(share)} softer" if share >= WORTH else ""


def percent(share: float) -> str:
    """'1.3 %'."""
    return f"{100 * share:.2g} %"
