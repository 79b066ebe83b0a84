"""The first two stages: the surface, read or remeshed, and the statics of the uncut sheet."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import FACETS, PRECISE, USUAL_SIZE
from dsfab.core.messages import coordinates, length
from dsfab.design.buildability import objections, off_surface
from dsfab.design.log import Log
from dsfab.design.regions_and_loads import Loading, loadings, surface_with_regions
from dsfab.diffusion import layer_stress, only_bends
from dsfab.preset.model import Preset, Statics
from dsfab.preset.surface_section import FileSurface, MeshSurface, OwnSurface
from dsfab.results import CaseResult, StaticsResult
from dsfab.statics import (
    Answers,
    Ask,
    Elements,
    Equilibrium,
    Factor,
    FactorOf,
    KeptFactor,
    SheetModel,
    SheetStress,
    SolvedCase,
    equilibria,
    facet_number,
    flat_axis,
    needles_told,
    sheet_answers,
    sheet_stiffness,
    sheet_stress,
    solve_for,
    stress,
)
from dsfab.surface import SizeField, Surface, change_sizes, coincident, pieces, twin_remarks


@dataclass(frozen=True, eq=False)
class SolvedSheet:
    """The loadings of a preset, solved by one factorisation, then their combinations as sums.

    plane     : whether the sheet was solved in its plane, without bending.
    made      : (N, N) stiffness, N/m, by the elements that solved it.
    factor_of : makes the factor, and caches it if it is needed again.
    answers   : equilibrium under each loading.    sigma : (m, 3, 3) Pa, of the middle surface, under each.
    """

    acting: Sequence[Loading]
    plane: bool
    made: Mapping[Elements, csr_array]
    factor_of: FactorOf
    answers: Sequence[Equilibrium]
    sigma: Sequence[Floats]


def solved_sheet(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> SolvedSheet:
    """Solve the sheet of [statics] under its loads, or under `acting`. Raises StaticsError for mechanisms."""
    sheet = preset.statics
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
    return SolvedSheet(acting, plane, {elements: K}, factor_of, found, sigma)


def _timed(factor_of: FactorOf, log: Log) -> FactorOf:
    """Add the seconds of a factorisation to the row `factor`: they are part of the row of the caller."""

    def timed(surface: Surface, K: csr_array, held: Bools) -> Factor:
        with log.row("factor"):
            return factor_of(surface, K, held)

    return timed


ANSWERED = 200_000
"""Most vertices for which better elements replace hinges. Their factor takes 17 GB at 250,000 (hinges: 3.6 GB) and four
times the time of the other stages: a design with a million vertices, which needs 16 GB, would never end.
"""


def answers_step(preset: Preset, surface: Surface, solved: SolvedSheet, log: Log, rough: bool = False) -> list[Answers]:
    """Stress, energy, frequencies and buckling of a solved sheet, under each loading.

    rough : stress and energy alone, by the elements that solved it.
    """
    sheet = preset.statics
    model, made = sheet.sheet().on(surface), dict(solved.made)

    def stiffness(elements: Elements) -> csr_array:
        if elements not in made:
            made[elements] = sheet_stiffness(model, elements)
        return made[elements]

    again, (ask, refusals) = KeptFactor(2), (Ask(), ()) if rough else _affordable(sheet, surface, log)
    if ask and log.progress:
        log.progress("statics", f"answering by {ask.elements(sheet.elements)} elements")
    found: list[Answers] = []
    with log.row("answers"):
        for loading, answer in zip(solved.acting, solved.answers, strict=True):
            # loads do not change how the sheet swings
            asked = replace(ask, frequencies=0) if found else ask
            case = SolvedCase(loading.load, loading.spread, answer, sheet.elements, solved.factor_of, solved.plane)
            one = sheet_answers(model, case, stiffness, asked, again)
            one = replace(one, refusals=(*one.refusals, *refusals))
            found.append(replace(one, vibration=found[0].vibration) if found else one)
    told = [(loading.name, answers) for loading, answers in zip(solved.acting, found, strict=True)]
    strong = preset.judged_in("ULS", [name for name, _ in told if name])
    _note([(name, answers) for name, answers in told if name in strong], ask, sheet, surface, log)
    return found


def _affordable(sheet: Statics, surface: Surface, log: Log) -> tuple[Ask, tuple[str, ...]]:
    """Return the results that a mesh of that size allows, and why modes are refused; note that stress is by hinges."""
    ask = sheet.ask
    if surface.n <= ANSWERED or ask.elements(sheet.elements) == sheet.elements:
        return ask, ()
    why = f"{surface.n:,} vertices are too many for the elements that they need, {ANSWERED:,} are allowed"
    log.note(
        "statics",
        f"the stress of the uncut sheet is that of {sheet.elements} elements, a rough one: {why}; build a coarser mesh "
        "(surface.edge) to have it",
    )
    return Ask(), (f"no natural frequencies, no buckling factors: {why}",) if ask.modes else ()


def _note(told: Sequence[tuple[str, Answers]], ask: Ask, sheet: Statics, surface: Surface, log: Log) -> None:
    elements = told[0][1].elements
    if ask and ask.elements(sheet.elements) != sheet.elements:
        why = "hinge bending is fit for directions only"
        if sheet.bending != "hinge":
            why = f"{sheet.elements} is not accurate enough to be reported from"
        log.note(
            "statics",
            f"stress, energy, frequencies and buckling are those of {elements} elements on the same mesh: {why}",
        )
    facets = facet_number(surface, sheet.thickness)
    if ask and elements.bending == "hhj" and facets > FACETS:
        log.note(
            "statics",
            f"flat faces bend by themselves under pressure and weight (edge x fold / thickness = {facets:.2g}, better "
            f"under {FACETS}): the largest stress is too high by up to that share; make the mesh finer (surface.edge, "
            "or surface.refine with smooth)",
        )
    for name, answers in told:
        _note_case(f" under {name}" if len(told) > 1 else "", answers, sheet, log)


def _note_case(under: str, answers: Answers, sheet: Statics, log: Log) -> None:
    if answers.assumed:
        log.note("statics", f"frequencies and buckling{under} are those of a sheet out of its plane: {answers.assumed}")
    for refusal in answers.refusals:
        aside = "" if answers.elements.bending else " (it was solved in its plane, but vibrates and buckles out of it)"
        log.note("statics", refusal + under + aside)
    if answers.buckling is not None and not len(answers.buckling.factor):
        log.note("statics", f"the load compresses no part of the uncut sheet{under}: it does not buckle")
    elif answers.buckling is not None and answers.buckling.factor[0] < 1:
        log.note(
            "statics", f"the uncut sheet buckles{under} before it carries the load; make it thicker or the load smaller"
        )
    reliable = answers.elements.bending != "hinge"
    if sheet.strength and reliable and (share := answers.stress.peak.stress / sheet.strength) > 1:
        log.note(
            "statics",
            f"the largest stress in the uncut sheet{under} exceeds the strength, being {share:.0%} of it: a thicker "
            "sheet (statics.thickness) is stressed less, unless its own weight is most of the load",
        )


BENDS = 0.5
"""`auto` follows all layers if bending stores at least this share of the strain energy."""


class FollowedStress(NamedTuple):
    """Stress (m, 3, 3), Pa, that the pattern follows under each loading, and a note for the user, or ''.

    sigma   : of the middle surface, or of the lower side of a slab.
    layered : of all layers, if the pattern follows them instead; else None.
    """

    sigma: Sequence[Floats]
    layered: Sequence[Floats] | None = None
    told: str = ""


def followed_layers(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers], sigma: Sequence[Floats]
) -> FollowedStress:
    """Return the stress that [statics] stress selects, for a sheet that was solved with bending.

    sigma : (m, 3, 3) Pa each, of its middle surface.

    Raises StaticsError if elements that are fit for moments cannot solve the sheet.
    """
    ask = preset.statics.stress
    if is_slab(surface, answers):
        lower = [stress.tensor("bottom") for stress in _moments(preset, surface, acting, answers)]
        return FollowedStress(
            lower, None, "the sheet is flat and bends: the pattern follows the stress at its lower side"
        )
    share = bending_share(preset, surface, acting, answers)
    if ask == "layers" or (ask == "auto" and share >= BENDS):
        stresses = _moments(preset, surface, acting, answers)
        told = f"the pattern follows the stress of all layers of the sheet: bending stores {share:.0%} of its energy"
        return FollowedStress(
            sigma, [layer_stress(surface, one.tensor("middle"), _bent(one)) for one in stresses], told
        )
    if ask == "membrane" and share >= BENDS:
        told = (
            f"bending stores {share:.0%} of the sheet's energy, and the pattern follows its middle surface, which that "
            'does not stress; judge it beside statics.stress = "layers": either may be the stiffer'
        )
        return FollowedStress(sigma, None, told)
    return FollowedStress(sigma)


def bending_share(preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]) -> float:
    """Return the share of strain energy that bending stores, 0 to 1, under the followed loads; 0 without any.

    `hinge` elements give a rough figure only (see `hinge_energy`).
    """
    weights = [preset.followed.get(loading.name, 0.0) for loading in acting]
    bent = sum(w * float(a.stress.bending_energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    whole = sum(w * float(a.stress.energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    return bent / whole if whole > 0 else 0.0


def is_slab(surface: Surface, answers: Sequence[Answers]) -> bool:
    """Return whether the surface is flat and its middle almost free of stress under all loadings."""
    stresses = [each.stress for each in answers]
    return surface.is_flat and only_bends(
        np.stack([one.membrane for one in stresses]), np.stack([one.bending for one in stresses])
    )


def _moments(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]
) -> list[SheetStress]:
    """Return the stress under each loading. The sheet is solved again if hinges solved it: they scatter too much."""
    if answers[0].elements.bending != "hinge":
        return [each.stress for each in answers]
    model = preset.statics.sheet().on(surface)
    solved = solve_for(model, {str(k): loading.load for k, loading in enumerate(acting)}, "stress")
    return [sheet_stress(model, one.elements, one) for one in solved.values()]


def _bent(stress: SheetStress) -> Floats:
    return stress.tensor("bottom") - stress.tensor("middle")


def note_statics(surface: Surface, cases: Mapping[str, CaseResult], log: Log) -> None:
    """Note the worst residual of all cases, and needles in the mesh."""
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
"""Limits of a surface's size over its thickness; beyond them units are wrong, and the preset is refused."""

USUAL = (10.0, 5e3)
"""Usual range of the same ratio; a note reports values outside."""


def check_scale(preset: Preset, surface: Surface, log: Log) -> None:
    """Refuse a ratio of size and thickness that no sheet has, and note an unusual one: units may be swapped."""
    thickness = preset.statics.thickness
    slenderness = surface.size / thickness
    told = f"the surface is {length(surface.size)} large and the sheet {length(thickness)} thick"
    if not PLAUSIBLE[0] < slenderness < PLAUSIBLE[1]:
        held = isinstance(preset.surface, MeshSurface)  # it has no surface.unit
        unit = 'the unit, dsfab.Surface.of(mesh, "mm") for millimetres,' if held else "surface.unit (mm, m, in ...)"
        raise SurfaceError(f"{told}: that is no sheet; check {unit} and statics.thickness (metres)")
    if not USUAL_SIZE[0] < surface.size < USUAL_SIZE[1]:
        log.note("statics", f"the surface is {length(surface.size)} large: check its unit")
    if not USUAL[0] < slenderness < USUAL[1]:
        log.note(
            "statics", f"{told}: thin-sheet statics hold for ratios of about 20 to 2000; check units and thickness"
        )


def checked_sheet(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> SolvedSheet:
    """Return `solved_sheet` after checks of scale and points. Raises SurfaceError for impossible proportions."""
    check_scale(preset, surface, log)
    for text in off_surface(preset, surface):
        log.note("statics", text)
    return solved_sheet(preset, surface, log, acting)


def statics_step(
    preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = (), solved: SolvedSheet | None = None
) -> StaticsResult:
    """Solve all load cases, and compute the results that [statics] requests.

    acting : loads that replace those of the preset.
    solved : result of `checked_sheet`, if it exists.
    """
    solved = solved or checked_sheet(preset, surface, log, acting)
    answers = answers_step(preset, surface, solved, log)
    with log.row("stress"):
        follow = (
            FollowedStress(solved.sigma)
            if solved.plane
            else followed_layers(preset, surface, solved.acting, answers, solved.sigma)
        )
    if follow.told:
        log.note("statics", follow.told)
    return _result(preset, surface, solved, answers, follow, log)


def rough_statics(preset: Preset, surface: Surface, solved: SolvedSheet) -> StaticsResult | None:
    """Return the statics without better elements, for a sketch.

    None if there are no better elements to wait for, or if the stress to follow may depend on them.
    """
    sheet = preset.statics
    if sheet.ask.elements(sheet.elements) == sheet.elements or surface.is_flat or sheet.stress == "layers":
        return None
    answers = answers_step(preset, surface, solved, Log(None), rough=True)
    if sheet.stress == "auto" and bending_share(preset, surface, solved.acting, answers) >= BENDS / 2:
        return None  # hinges give a rough share only
    return _result(preset, surface, solved, answers, FollowedStress(solved.sigma), Log(None))


def _result(
    preset: Preset, surface: Surface, solved: SolvedSheet, answers: Sequence[Answers], follow: FollowedStress, log: Log
) -> StaticsResult:
    layered: Sequence[Floats | None] = follow.layered or [None] * len(solved.acting)
    results = {
        ld.name: CaseResult(ld.load, e, s, a, ld.factors, every)
        for ld, e, s, a, every in zip(solved.acting, solved.answers, follow.sigma, answers, layered, strict=True)
    }
    whole = results.pop("", next(iter(results.values())))
    note_statics(surface, results, log)
    objected = list(objections(preset, surface, results))
    for objection in objected:
        log.note("statics", objection.text)
    reasons = tuple(objection.text for objection in objected if objection.refuses)
    return StaticsResult(whole.load, whole.equilibrium, whole.sigma, whole.answers, MappingProxyType(results), reasons)


def surface_step(preset: Preset, log: Log) -> Surface:
    """Stage 1: return the surface, metres, cut along the outlines of regions."""
    with log.stage("surface", "reading the mesh" if hasattr(preset.surface, "file") else "making the shape"):
        surface = base_surface(preset, log)
        if preset.pattern.region:
            surface = surface_with_regions(preset, surface, log)
        count = pieces(surface.F, surface.edges)[0]
    if count > 1:
        doubled = coincident(surface.V)
        merge = f", unless its {doubled} vertices that lie where another one does are merged" if doubled else ""
        log.note("surface", f"the surface has {count} separate pieces; each needs its own supports{merge}")
    for remark in twin_remarks(surface.V, surface.F):
        log.note("surface", remark)
    return surface


def base_surface(preset: Preset, log: Log | None = None) -> Surface:
    """Return the surface before it is cut along regions.

    Edges are shorter where the stress changes, by statics on even triangles, if [surface] requests that.
    """
    given = preset.surface
    if not isinstance(given, OwnSurface):
        return given.build()
    there = _surface_read(given, log)
    if not given.by_stress:
        return given.build(given=there)
    plain = preset.model_copy(update={"statics": preset.statics.model_copy(update={"frequencies": 0, "buckling": 0})})
    even = given.build(given=there)
    cut = surface_with_regions(plain, even, Log(None)) if preset.pattern.region else even
    surface = given.build(list(_stress_sizes(given, cut, statics_step(plain, cut, Log(None)))), there)
    if log:
        log.note("surface", f"{even.m:,} even triangles became {surface.m:,}: smaller ones where the stress changes")
    return surface


def _surface_read(given: OwnSurface, log: Log | None) -> Surface:
    """Return the surface before remeshing, and note what a file's reader repaired or dropped."""
    if not isinstance(given, FileSurface):
        return given.given()
    found = given.read()
    if log:
        log.file = found.record
        for remark in found.record.remarks:
            log.note("surface", f"{given.file.name}, {remark}")
        if any(given.origin):
            at = coordinates(given.origin)
            log.note("surface", f"files are about {at} m of the mesh: move what goes back by that; IFC files say it")
    return found.surface


def _stress_sizes(given: OwnSurface, surface: Surface, statics: StaticsResult) -> Iterator[SizeField]:
    for case in statics.cases.values():
        for side in ("top", "bottom"):
            stress = case.answers.stress.tensor(side)
            yield SizeField(surface, change_sizes(surface, stress, given.edge, given.finest))
