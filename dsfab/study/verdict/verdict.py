"""The verdict on a cut sheet: its compliance on finer and finer meshes, with an error bound."""

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
from dsfab.design import held_vertices, permanent_loads, sheet_loads
from dsfab.design.design import Design
from dsfab.results import Progress
from dsfab.slicing import Sheet, improve_cells
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.statics import Elements, SheetMaterial, flat_axis, needle_message
from dsfab.statics.boundary_conditions import all_clamped, require_held
from dsfab.study.verdict import estimates
from dsfab.study.verdict.estimates import rib_width
from dsfab.study.verdict.levels import (
    MAIN_ELEMENTS,
    QUICK_ELEMENTS,
    SPREAD_ELEMENTS,
    Level,
    Shares,
    level,
    memory_needed,
    on_mesh,
    shares,
    theory_share,
)
from dsfab.surface import LoadCase, Surface, pieces


@dataclass(frozen=True, eq=False)
class LoadedSurface:
    """The uncut surface and its loads.
    made      : material and thickness of the sheet.    loads : supports and loads by load case.
    permanent : permanent loads without the sheet's weight; their mass vibrates with the sheet."""

    surface: Surface
    made: SheetMaterial
    loads: Mapping[str, LoadCase]
    permanent: Mapping[str, LoadCase] = field(default_factory=dict)

    @classmethod
    def from_design(cls, design: Design, share: float = 1.0) -> "LoadedSurface":
        """Return the surface and loads of a design. share : factor on the design's thickness."""
        statics = design.preset.statics
        material, surface = statics.sheet(share * statics.thickness), design.surface
        loads = {name: case.load.of_thickness(surface, share) for name, case in design.statics.cases.items()}
        return cls(surface, material, loads, permanent_loads(design.preset, surface, next(iter(loads.values()))))


class Dropped(NamedTuple):
    """A piece of material without a connection to a support: its area (m2), and a point in it (m)."""

    area: float
    place: tuple[float, float, float]


def whole_sheet(surface: Surface) -> Sheet:
    """Return the uncut surface as a sheet without openings."""
    n, m = surface.n, surface.m
    return Sheet(surface, np.arange(m), np.zeros(m, dtype=np.int64), csr_array(eye_array(n)))


def attached_material(
    setting: LoadedSurface, material: Sheet
) -> tuple[Sheet, tuple[Dropped, ...], dict[str, LoadCase]]:
    """Return the pieces of material that are connected to a support, and all other pieces, largest first.
    Return also the loads by load case. Raises StaticsError if the supports do not hold the material."""
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
    sheet = material.subset(reach[label]) if loose else material
    loads = sheet_loads(setting.surface, material, sheet, setting.loads)
    load, axis = next(iter(loads.values())), flat_axis(sheet.surface, *loads.values())
    fixed = load.fixed.copy()
    if axis is not None:
        fixed[:, axis] = True
    require_held(sheet.surface, load, fixed, all_clamped(load))
    return sheet, tuple(dropped), loads


Depth = Literal["quick", "full"]


@dataclass(frozen=True)
class CaseVerdict:
    """The verdict on one load case or load combination.
    value  : compliance, J; nan if nothing was solved.    bound : largest error / compliance; inf if unknown.
    status : fail if the sheet does not carry the loads; pass if the bound is at most `CONVERGED`; else unknown.
    spread : compliance by midedge elements / compliance by hhj elements - 1, on the first mesh.
    zz_membrane, zz_bending : energies of the estimated stress errors, divided by the compliance.
    theory : fraction by which a solid's compliance may exceed that of this thin sheet."""

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
    """Verdict on the compliance of a cut sheet.
    depth      : quick (one mesh) or full (two or three meshes).    status : status of the governing load case.
    cases      : verdicts on the load cases; the first case governs.    levels : results on each mesh, coarse to fine.
    dropped    : pieces of material without a connection to a support, largest first.
    per_member : mean width of members / mean edge length; inf for a sheet without a border.
    facets     : median of L^2 / (R h): edge length L, radius of curvature R, thickness h."""

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
        """Compliance in the governing load case, J."""
        return self.cases[0].value

    @property
    def bound(self) -> float:
        """Relative error bound of the compliance in the governing load case."""
        return self.cases[0].bound

    @property
    def theory(self) -> float:
        """Fraction by which a solid's compliance may exceed that of the thin sheet, in the governing load case."""
        return self.cases[0].theory

    @property
    def memory(self) -> int:
        """Peak memory of the process, bytes; 0 if nothing was solved."""
        return max((level.memory for level in self.levels), default=0)

    def case(self, name: str) -> CaseVerdict:
        """Return the verdict on the load case `name`. Raises KeyError for an unknown name."""
        return {case.name: case for case in self.cases}[name]

    def record(self) -> dict[str, Any]:
        """Return the verdict as a dict for a JSON file, with None for nan and infinity."""
        values = asdict(self) | {"value": self.value, "bound": self.bound, "theory": self.theory, "memory": self.memory}
        values["dropped"] = [piece._asdict() for piece in self.dropped]
        return dict(_plain(values))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


MOST_MESHES = 3  # the cut mesh and two refinements
COUNT = {2: "two levels", 3: "three levels"}


@dataclass
class Refinement:
    """Solves of a sheet on finer and finer meshes.
    smooth   : curved surface on which finer meshes lie.    budget : memory limit of each solve, bytes.
    stopped  : status and reason of an early end, or None.    unsolved : True if the last mesh could not be solved."""

    setting: LoadedSurface
    smooth: SmoothSurface
    depth: Depth
    budget: float
    progress: Progress | None
    levels: list[Level] = field(default_factory=list)
    stopped: tuple[Status, str] | None = None
    unsolved: bool = False

    def refine(self, sheet: Sheet, loads: Mapping[str, LoadCase]) -> None:
        """Solve finer and finer meshes of the cut sheet, until the error bound of all load cases is small."""
        forces = shares(sheet, loads)
        bent = islice(meshes(sheet, self.smooth), MOST_MESHES)
        for mesh in [sheet] if self.depth == "quick" else bent:
            if reason := self._too_large(mesh.surface):
                self.stopped = "unknown", reason
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
        """Return the verdict on each load case or combination."""
        return [self._case(name) for name in self.setting.loads]

    @property
    def is_plane(self) -> bool:
        return flat_axis(self.setting.surface, *self.setting.loads.values()) is not None

    @property
    def _pair(self) -> Elements:
        pair = QUICK_ELEMENTS if self.depth == "quick" else MAIN_ELEMENTS
        return pair.in_plane if self.is_plane else pair

    def _too_large(self, mesh: Surface) -> str:
        needed = memory_needed(self._pair.unknowns(mesh), self._pair.bending, solver_name())
        if needed <= self.budget:
            return ""
        return (
            f"the next finer mesh, of {mesh.m:,} triangles, needs about {needed / 1e9:.1f} GB of memory, but the "
            f"limit is {self.budget / 1e9:.1f} GB; raise the limit or make the surface's mesh coarser"
        )

    def _solve(self, mesh: Sheet, forces: Mapping[str, Shares]) -> None:
        if self.progress:
            self.progress("verdict", f"solving {mesh.surface.m:,} triangles")
        loads, spreads = on_mesh(self.setting.surface, mesh, self.setting.loads, forces)
        pairs: tuple[Elements, ...] = (QUICK_ELEMENTS,)
        if self.depth == "full":  # solve the first mesh with two pairs of elements, finer meshes with one pair
            pairs = (MAIN_ELEMENTS,) if self.levels else (MAIN_ELEMENTS, SPREAD_ELEMENTS)
        ribs = self.depth == "full" and not self.levels
        self.levels.append(level(mesh.surface, self.setting.made, loads, spreads, pairs, ribs))

    def _case(self, name: str) -> CaseVerdict:
        finest, values = self.levels[-1], [mesh_level.compliance[name] for mesh_level in self.levels]
        softer = self.levels[0].softer
        errors = finest.zz_membrane[name], finest.zz_bending[name], theory_share(softer[name]) if softer else 0.0
        if self.depth == "quick":
            typical, largest_error = estimates.QUICK_ERRORS
            reason = (
                f"one solve on the cut mesh: the typical error is {percent(typical)}, and the error is below "
                f"{percent(largest_error)} for 90 % of designs"
            )
            return CaseVerdict(name, values[0], largest_error, "unknown", reason, 0.0, *errors)
        coarsest = self.levels[0]
        spread = coarsest.midedge[name] / coarsest.compliance[name] - 1 if coarsest.midedge else 0.0
        estimate = estimates.estimate(values, spread, sum(errors[:2]))
        is_known = len(values) > 1 and estimate.bound <= CONVERGED
        if len(values) == 1:
            reason = f"the error bound of one mesh is {percent(estimate.bound)}; only finer meshes can show convergence"
        elif is_known:
            reason = f"converged within {percent(estimate.bound)}"
        else:
            reason = f"not converged: {percent(estimate.bound)} after {COUNT[len(values)]}"
        if len(values) > 1 and errors[2] >= 0.001:
            reason += f"; thin-shell theory: a solid is up to {percent(errors[2])} softer"
        status: Status = "pass" if is_known else "unknown"
        return CaseVerdict(name, estimate.value, estimate.bound, status, reason, spread, *errors)


def percent(share: float) -> str:
    return f"{100 * share:.2g} %"


BUDGET = 4e9  # default memory limit of the solves for a verdict, bytes


def check(
    subject: Design | LoadedSurface,
    sheet: Sheet | None = None,
    depth: Depth = "full",
    budget: float = BUDGET,
    progress: Progress | None = None,
    cells: Sheet | None = None,
) -> Verdict:
    """Return the verdict on a loaded cut sheet: its compliance with an error bound, or the reason of its failure.
    sheet   : cut sheet; default: the design's sheet.    depth : "quick": one solve. "full": two or three meshes.
    budget  : memory limit of each solve, bytes.    cells : mesh of sheet and openings, to repair very thin triangles.
    Raises ValueError for a `LoadedSurface` without a sheet."""
    start = time.perf_counter()
    setting = LoadedSurface.from_design(subject) if isinstance(subject, Design) else subject
    if sheet is None:
        if not isinstance(subject, Design):
            raise ValueError("a LoadedSurface contains no sheet: pass the argument `sheet`")
        cells = subject.slicing.cells
        sheet = cells.subset()
    smooth = SmoothSurface.from_surface(setting.surface)
    refinement = Refinement(setting, smooth, depth, budget, progress)
    attached, dropped = _solve(refinement, sheet)
    if cells is not None and refinement.unsolved and needle_message(attached.surface):
        better = improve_cells(cells, setting.surface).sheet
        again = Refinement(setting, smooth, depth, budget, progress)
        solved, loose = _solve(again, better.subset())
        if len(again.levels) > len(refinement.levels):
            refinement, attached, dropped = again, solved, loose
    return _verdict(refinement, attached, dropped, time.perf_counter() - start)


def _solve(refinement: Refinement, sheet: Sheet) -> tuple[Sheet, tuple[Dropped, ...]]:
    dropped: tuple[Dropped, ...] = ()
    try:
        sheet, dropped, loads = attached_material(refinement.setting, sheet)
        refinement.refine(sheet, loads)
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
    governing = cases[0]
    reason = governing.reason if len(cases) == 1 else f"{governing.name}: {governing.reason}"
    across, facets = rib_width(sheet.surface) / surface.mean_edge, facet_ratio(refinement.smooth, thickness)
    measures = across, facets, tuple(_warnings(across, facets)), seconds
    depth, levels = refinement.depth, tuple(refinement.levels)
    return Verdict(depth, governing.status, reason, tuple(cases), levels, dropped, *measures)


def facet_ratio(smooth: SmoothSurface, thickness: float) -> float:
    """Return the median of L^2 / (R h) over all edges: length L, radius of curvature R, thickness h."""
    return 8 * float(np.median(np.linalg.norm(smooth.bulge, axis=1))) / thickness


def _warnings(across: float, facets: float) -> list[str]:
    warnings = []
    if across < estimates.LEAST_EDGES_PER_MEMBER:
        warnings.append(
            f"the mean width of members is only {across:.2g} edges of the uncut mesh "
            f"({estimates.LEAST_EDGES_PER_MEMBER:g} or more are better), so the outline of members is coarse; make the "
            "mesh finer (surface.edge), or use fewer stripes"
        )
    if facets > FACETS:
        warnings.append(
            f"flat faces are too far from the smooth surface: L^2 / (R h) is {facets:.2g} and should be below "
            f"{FACETS:g}, for edge length L, radius R and thickness h; make the mesh finer (surface.edge)"
        )
    return warnings
