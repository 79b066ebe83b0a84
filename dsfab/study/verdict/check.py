"""`check`: the verdict on a cut sheet under the loads of its uncut surface."""

import time
from dataclasses import replace

import numpy as np

from dsfab.errors import DsfabError
from dsfab.limits import FACETS, SEVERITY
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress
from dsfab.slicing import Sheet, improved
from dsfab.statics import needles_told
from dsfab.study.verdict import rules
from dsfab.study.verdict.loaded_surface import Dropped, LoadedSurface, attached_material
from dsfab.study.verdict.refinement import Refinement
from dsfab.study.verdict.smooth import SmoothSurface
from dsfab.study.verdict.stresses import rib_width
from dsfab.study.verdict.verdict import CaseVerdict, Depth, Verdict

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
              the sheet from being solved, it is once they are flipped and collapsed (`dsfab.slicing.improve`), which
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
    if across < rules.MEMBER:
        told.append(
            f"members are {across:.2g} edges of the uncut mesh wide in the mean (better {rules.MEMBER:g} or more): "
            "their outline is coarse; make the mesh finer (surface.edge), or the stripes fewer"
        )
    if facets > FACETS:
        told.append(
            f"flat faces are {facets:.2g} thicknesses off the smooth surface, as L^2 / (R h) (better under "
            f"{FACETS:g}): what lies between the vertices is a guess; make the mesh finer (surface.edge)"
        )
    return told
