"""The second step: how what is given carries the load."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats
from dsfab.errors import SurfaceError
from dsfab.limits import PRECISE, USUAL_SIZE
from dsfab.pipeline.answers import answers_step
from dsfab.pipeline.buildable import objections, off_surface
from dsfab.pipeline.layers import FollowedStress, followed_layers
from dsfab.pipeline.loadings import Loading, loadings
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.preset_surface import MeshSurface
from dsfab.results import CaseResult, StaticsResult
from dsfab.statics import (
    Factor,
    FactorOf,
    SheetModel,
    equilibria,
    flat_axis,
    needles_told,
    sheet_stiffness,
    stress,
)
from dsfab.surface import Surface


def note_statics(surface: Surface, cases: Mapping[str, CaseResult], log: Log) -> None:
    """Notes on the answers of all cases (the worst of them is named), and on the mesh that they are for."""
    answers = {name: case.equilibrium for name, case in cases.items()}
    under = {name: f" under {name}" if len(cases) > 1 else "" for name in cases}
    rough = max(answers, key=lambda name: answers[name].residual)
    if (residual := answers[rough].residual) > PRECISE:
        log.note(
            "statics",
            f"the equations are solved to {residual:.1e}{under[rough]} (wanted: {PRECISE:g}): the sheet is very "
            "thin or nearly a mechanism, or the mesh has needles",
        )
    if told := needles_told(surface):
        log.note("statics", f"{told}: stresses there are poor; remesh the surface")


PLAUSIBLE = (3.0, 1e5)
"""A surface's size over its thickness must lie between these."""

USUAL = (10.0, 5e3)
"""Outside of these the user is told."""


def check_scale(preset: Preset, surface: Surface, log: Log) -> None:
    """Swapped units show in the ratio of size and thickness: refuse what no sheet has, and mention what few have."""
    thickness = preset.statics.thickness
    slenderness = surface.size / thickness
    told = f"the surface is {surface.size:.3g} m large and the sheet {thickness:.3g} m thick"
    if not PLAUSIBLE[0] < slenderness < PLAUSIBLE[1]:
        held = isinstance(preset.surface, MeshSurface)  # it has no surface.unit
        unit = 'the unit, dsfab.Surface.of(mesh, "mm") for millimetres,' if held else "surface.unit (mm, m, in ...)"
        raise SurfaceError(f"{told}: that is no sheet; check {unit} and statics.thickness (metres)")
    if not USUAL_SIZE[0] < surface.size < USUAL_SIZE[1]:
        log.note("statics", f"the surface is {surface.size:.3g} m large: check its unit")
    if not USUAL[0] < slenderness < USUAL[1]:
        log.note(
            "statics", f"{told}: thin-sheet statics hold for ratios of about 20 to 2000; check units and thickness"
        )


def statics_step(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> StaticsResult:
    """All load cases from one factorisation, then their combinations, which are sums.

    acting : the loads, where they are not those of the preset.
    """
    sheet = preset.statics
    check_scale(preset, surface, log)
    for text in off_surface(preset, surface):
        log.note("statics", text)
    if log.progress:
        log.progress("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    acting = acting or loadings(preset, surface)
    solved = [loading for loading in acting if loading.factors is None]
    loads, spreads = [loading.load for loading in solved], [loading.spread for loading in solved]
    plane = flat_axis(surface, *loads) is not None
    elements = sheet.elements.in_plane if plane else sheet.elements
    K = sheet_stiffness(SheetModel(surface, sheet.elastic, sheet.thickness, sheet.law), elements, log.row)
    factor_of = _timed(sheet.ask.factor_of(sheet.elements), log)
    with log.row("statics"):
        sums = [[ld.factors.get(case.name, 0.0) for case in solved] for ld in acting if ld.factors is not None]
        found = equilibria(surface, K, loads, elements, spreads=spreads, sums=sums, factor_of=factor_of)
    with log.row("stress"):
        sigma = [stress(surface, sheet.elastic, a.u, sheet.law, a.bubbles) for a in found]
    answers = answers_step(preset, surface, list(zip(acting, found, strict=True)), plane, {elements: K}, factor_of, log)
    with log.row("stress"):
        follow = FollowedStress(sigma) if plane else followed_layers(preset, surface, acting, answers, sigma)
    if follow.told:
        log.note("statics", follow.told)
    layered: Sequence[Floats | None] = follow.layered or [None] * len(acting)
    results = {
        ld.name: CaseResult(ld.load, e, s, a, ld.factors, every)
        for ld, e, s, a, every in zip(acting, found, follow.sigma, answers, layered, strict=True)
    }
    whole = results.pop("", next(iter(results.values())))
    note_statics(surface, results, log)
    objected = list(objections(preset, surface, results))
    for objection in objected:
        log.note("statics", objection.text)
    reasons = tuple(objection.text for objection in objected if objection.refuses)
    return StaticsResult(whole.load, whole.equilibrium, whole.sigma, whole.answers, MappingProxyType(results), reasons)


def _timed(factor_of: FactorOf, log: Log) -> FactorOf:
    """The same, its seconds in the row `factor`: they are part of the row of whoever asks."""

    def timed(surface: Surface, K: csr_array, held: Bools) -> Factor:
        with log.row("factor"):
            return factor_of(surface, K, held)

    return timed
