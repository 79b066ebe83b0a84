"""The verdict on a cut sheet: the loaded surface, its refinement, and the check of its compliance."""

import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.core.errors import DsfabError, StaticsError
from dsfab.core.limits import CONVERGED, FACETS, SEVERITY, Status
from dsfab.core.sparse import NotPositiveDefinite, solver_name
from dsfab.design import held_vertices, sheet_loads
from dsfab.design.design import Design
from dsfab.design.log import Progress
from dsfab.slicing import Sheet, improved
from dsfab.statics import Elements, SheetMaterial, flat_axis, needles_told
from dsfab.statics.boundary_conditions import all_clamped, require_held
from dsfab.study.verdict import estimates
from dsfab.study.verdict.estimates import rib_width
from dsfab.study.verdict.levels import (
    BESIDE,
    MAIN,
    ONCE,
    WORTH,
    Level,
    Shares,
    SmoothSurface,
    level,
    memory_needed,
    meshes,
    on_mesh,
    shares,
    theory_share,
)
from dsfab.surface import LoadCase, Surface, pieces


@dataclass(frozen=True, eq=False)
class LoadedSurface:
    """All that competitors share: the uncut surface, what the sheet is made of, and the loads on the uncut surface by
    case, with the same supports in each."""

    surface: Surface
    made: SheetMaterial
    loads: Mapping[str, LoadCase]

    @classmethod
    def of(cls, design: Design, share: float = 1.0) -> "LoadedSurface":
        """That of a design, its cases and combinations, with `share` of its thickness."""
        statics = design.preset.statics
        made, surface = statics.sheet(share * statics.thickness), design.surface
        loads = {name: case.load.of_thickness(surface, share) for name, case in design.statics.cases.items()}
        return cls(surface, made, loads)


class Dropped(NamedTuple):
    """A piece of material that reaches no support: its area, m2, and a point in it, metres."""

    area: float
    place: tuple[float, float, float]


def whole_sheet(surface: Surface) -> Sheet:
    """The uncut surface as a sheet of itself, for judging what has no openings."""
    n, m = surface.n, surface.m
    return Sheet(surface, np.arange(m), np.zeros(m, dtype=np.int64), csr_array(eye_array(n)))


def attached_material(
    setting: LoadedSurface, material: Sheet
) -> tuple[Sheet, tuple[Dropped, ...], dict[str, LoadCase]]:
    """What of the material reaches a support over edges, what does not (largest first), and the loads on what does.

    Raises StaticsError when nothing is held, when a load stands on a piece that is not or finds no material, and when
    the supports leave a motion free.
    """
    s, load = material.surface, next(iter(setting.loads.values()))
    count, label = pieces(s.F, s.edges)
    area = np.bincount(label, s.areas, count)
    reach = np.bincount(label, held_vertices(setting.surface, material, load)[s.F].any(axis=1), count) > 0
    if not reach.any():
        raise StaticsError("no piece of material reaches a support; set pattern.keep to protect the supports")
    loose = sorted(np.flatnonzero(~reach).tolist(), key=lambda k: -area[k])
    dropped = []
    for k in loose:
        x, y, z = s.centroids[int((label == k).argmax())].tolist()
        dropped.append(Dropped(float(area[k]), (x, y, z)))
    sheet = material.kept(reach[label]) if loose else material
    loads = sheet_loads(setting.surface, material, sheet, setting.loads)
    _require_held(sheet.surface, loads)
    return sheet, tuple(dropped), loads


def _require_held(surface: Surface, loads: Mapping[str, LoadCase]) -> None:
    """Raise StaticsError for a sheet that can move without deforming."""
    load, axis = next(iter(loads.values())), flat_axis(surface, *loads.values())
    fixed = load.fixed.copy()
    if axis is not None:
        fixed[:, axis] = True
    require_held(surface, load, fixed, all_clamped(load))


Depth = Literal["quick", "full"]


@dataclass(frozen=True)
class CaseVerdict:
    """One load case or combination.

    value  : compliance, J; nan where it could not be found.
    bound  : half width of the interval that the true compliance lies in, over the value; inf where nothing is known.
    status : pass: it carries its loads, and the compliance is known to `CONVERGED`. fail: it does not carry them.
             unknown: the compliance is not known well enough.
    spread : compliance of quadratic + midedge over that of quadratic + hhj on the first mesh, less 1.
    zz_membrane, zz_bending : on the finest mesh, see `Level`.
    theory : by what a solid may be softer besides, over the value: the bound is about thin sheets, see `theory_share`.
    """

    name: str
    value: float
    bound: float
    status: Status
    reason: str
    spread: float = 0.0
    zz_membrane: float = 0.0
    zz_bending: float = 0.0
    theory: float = 0.0


@dataclass(frozen=True)
class Verdict:
    """What `check` finds.

    depth      : quick (one mesh) or full (two or three).
    status     : the worst of all cases.       reason : of the case that decides.
    cases      : the governing one first: the worst status, then the largest compliance.
    levels     : the meshes that were solved, coarse to fine.
    dropped    : pieces of material that reach no support, largest first; they are not part of what was solved.
    per_member : edges of the uncut mesh across a member, in the mean: twice the area over the length of all borders;
                 inf for a closed sheet without openings.
    facets     : L^2 / (R h) of the uncut mesh, the median: edge length, radius of curvature, thickness.
    warnings   : of these two numbers beyond their limits, a sentence each.
    """

    depth: Depth
    status: Status
    reason: str
    cases: tuple[CaseVerdict, ...]
    levels: tuple[Level, ...]
    dropped: tuple[Dropped, ...]
    per_member: float
    facets: float
    warnings: tuple[str, ...]
    seconds: float

    @property
    def value(self) -> float:
        """Compliance of the governing case, J."""
        return self.cases[0].value

    @property
    def bound(self) -> float:
        """Half width of its interval, over the value."""
        return self.cases[0].bound

    @property
    def theory(self) -> float:
        """By what a solid may be softer besides, over the value."""
        return self.cases[0].theory

    @property
    def memory(self) -> int:
        """Bytes, the most that the process has held; 0 where nothing was solved."""
        return max((level.memory for level in self.levels), default=0)

    def case(self, name: str) -> CaseVerdict:
        """The verdict on one case. Raises KeyError for a case that there is not."""
        return {case.name: case for case in self.cases}[name]

    def record(self) -> dict[str, Any]:
        """Everything as numbers, text, lists and dicts for JSON; None for what is not finite."""
        values = asdict(self) | {"value": self.value, "bound": self.bound, "theory": self.theory, "memory": self.memory}
        values["dropped"] = [piece._asdict() for piece in self.dropped]
        return dict(_plain(values))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
            typical, most = estimates.QUICK
            told = f"one solve on the cut mesh: typically within {percent(typical)}, nine in ten within {percent(most)}"
            return CaseVerdict(name, values[0], most, "unknown", told, 0.0, *errors)
        first = self.levels[0]
        spread = first.midedge[name] / first.compliance[name] - 1 if first.midedge else 0.0
        found = estimates.estimate(values, spread, sum(errors[:2]))
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


BUDGET = 4e9
"""Bytes that a verdict may take unless told otherwise."""


def check(
    subject: Design | LoadedSurface,
    sheet: Sheet | None = None,
    depth: Depth = "full",
    budget: float = BUDGET,
    progress: Progress | None = None,
    cells: Sheet | None = None,
) -> Verdict:
    """The compliance of a cut sheet under its loads, with a bound; or why it is not known, or that nothing is carried.

    subject : a design, or the `LoadedSurface` that competitors share.
    sheet   : the material, loose pieces included; that of the design when left out. It lies in the subject's surface.
    depth   : quick, one solve on the mesh as it is cut; or full, on the cut mesh and on its refinement with all
              points on the smooth surface, extrapolated, and on one more where the bound is not under 2 % then.
    budget  : bytes that the solver may take; a mesh that would need more is not solved, and the reason says so.
    cells   : all cells that the sheet is the material of; those of a design when left out. Where needles of faces keep
              the sheet from being solved, it is once they are flipped and collapsed
              (`dsfab.slicing.finishing.mesh_quality`), which
              covers the same points: of a leaf of 12 m, 781 in 38 127 triangles, the mesh was taken for a mechanism.

    Nothing is raised for a sheet that does not carry its loads: that is a verdict. Raises ValueError when `sheet` is
    left out of a `LoadedSurface`.
    """
    start = time.perf_counter()
    setting = LoadedSurface.of(subject) if isinstance(subject, Design) else subject
    if sheet is None:
        if not isinstance(subject, Design):
            raise ValueError("a setting has no sheet of its own: give one")
        cells = subject.slicing.cells
        sheet = cells.kept()
    smooth = SmoothSurface.through(setting.surface)
    refinement = Refinement(setting, smooth, depth, budget, progress)
    found, dropped = _solved(refinement, sheet)
    if cells is not None and refinement.unsolved and needles_told(found.surface):
        better = improved(cells, setting.surface).sheet
        again = Refinement(setting, smooth, depth, budget, progress)
        solved, left = _solved(again, better.kept())
        if len(again.levels) > len(refinement.levels):
            refinement, found, dropped = again, solved, left
    return _verdict(refinement, found, dropped, time.perf_counter() - start)


def _solved(refinement: Refinement, sheet: Sheet) -> tuple[Sheet, tuple[Dropped, ...]]:
    """Have what reaches a support solved; that, and what does not."""
    dropped: tuple[Dropped, ...] = ()
    try:
        sheet, dropped, loads = attached_material(refinement.setting, sheet)
        refinement.up(sheet, loads)
    except DsfabError as error:
        refinement.stopped = "fail", str(error)
    return sheet, dropped


def _verdict(refinement: Refinement, sheet: Sheet, dropped: tuple[Dropped, ...], seconds: float) -> Verdict:
    surface, thickness = refinement.setting.surface, refinement.setting.made.thickness
    if refinement.levels:
        cases = refinement.cases()
        if refinement.stopped:
            status, why = refinement.stopped
            cases = [
                case if case.status == "pass" else replace(case, status=status, reason=f"{case.reason}; {why}")
                for case in cases
            ]
    else:
        status, why = refinement.stopped or ("unknown", "nothing was solved")
        cases = [CaseVerdict(name, np.nan, np.inf, status, why) for name in refinement.setting.loads]
    cases.sort(key=lambda case: (-SEVERITY.index(case.status), -case.value if np.isfinite(case.value) else 0.0))
    first = cases[0]
    reason = first.reason if len(cases) == 1 else f"{first.name}: {first.reason}"
    across = members(sheet) / surface.mean_edge
    facets = facets_of(refinement.smooth, thickness)
    warnings = tuple(_warnings(across, facets))
    return Verdict(
        refinement.depth,
        first.status,
        reason,
        tuple(cases),
        tuple(refinement.levels),
        dropped,
        across,
        facets,
        warnings,
        seconds,
    )


def members(sheet: Sheet) -> float:
    """Metres: the mean width of the members, twice the area over the length of all borders; inf without a border."""
    return rib_width(sheet.surface)


def facets_of(smooth: SmoothSurface, thickness: float) -> float:
    """L^2 / (R h) of the flat faces: eight times how far the middle of an edge is off its chord, the median."""
    return 8 * float(np.median(np.linalg.norm(smooth.bulge, axis=1))) / thickness


def _warnings(across: float, facets: float) -> list[str]:
    told = []
    if across < estimates.MEMBER:
        told.append(
            f"members are {across:.2g} edges of the uncut mesh wide in the mean (better {estimates.MEMBER:g} or more): "
            "their outline is coarse; make the mesh finer (surface.edge), or the stripes fewer"
        )
    if facets > FACETS:
        told.append(
            f"flat faces are {facets:.2g} thicknesses off the smooth surface, as L^2 / (R h) (better under "
            f"{FACETS:g}): what lies between the vertices is a guess; make the mesh finer (surface.edge)"
        )
    return told
