"""Stages 1 and 2: the surface, and the statics of the uncut sheet."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import FACETS, REPORTED_RESIDUAL, USUAL_SIZE
from dsfab.core.messages import coordinates, length
from dsfab.design.buildability import objections, off_surface
from dsfab.design.regions_and_loads import Loading, acting_on, loadings, permanent_loads, surface_with_regions
from dsfab.diffusion import layer_stress, only_bends
from dsfab.preset.model import Preset, Statics
from dsfab.preset.surface_section import FileSurface, MeshSurface, OwnSurface
from dsfab.results import CaseResult, Log, StaticsResult
from dsfab.statics import (
    Answers,
    Elements,
    Equilibrium,
    Factor,
    FactorCache,
    FactorFunction,
    ResultRequest,
    SheetModel,
    SheetStress,
    SolvedCase,
    equilibria,
    facet_number,
    flat_axis,
    mass_of_loads,
    needle_message,
    sheet_answers,
    sheet_stiffness,
    sheet_stress,
    solve_for,
    stress,
)
from dsfab.surface import (
    SizeField,
    Surface,
    Wind,
    change_sizes,
    coincident,
    faces_without_upper_side,
    parallel_remarks,
    pieces,
)
from dsfab.surface.loads.load_case import picked_faces


@dataclass(frozen=True, eq=False)
class SolvedSheet:
    """Solution of a sheet under all loads. plane : True for a flat sheet that is loaded in its plane.
    acting  : load cases and combinations.    made : stiffness matrix (N, N), N/m, by kind of finite elements.
    answers : equilibrium under each load.    sigma : (m, 3, 3) stress of the middle surface under each load, Pa."""

    acting: Sequence[Loading]
    plane: bool
    made: Mapping[Elements, csr_array]
    factor_of: FactorFunction
    answers: Sequence[Equilibrium]
    sigma: Sequence[Floats]


def solved_sheet(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> SolvedSheet:
    """Solve the uncut sheet under the preset's loads, or under `acting`. Raises StaticsError for a mechanism."""
    sheet = preset.statics
    log.report("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    acting = acting or loadings(preset, surface)
    solved = [loading for loading in acting if loading.factors is None]
    loads, spreads = [loading.load for loading in solved], [loading.spread for loading in solved]
    plane = flat_axis(surface, *loads) is not None
    elements = sheet.elements.in_plane if plane else sheet.elements
    K = sheet_stiffness(SheetModel(surface, sheet.elastic, sheet.thickness, sheet.law), elements, log.row)
    factor_of = _timed_factor(sheet.analyses.factor_for(sheet.elements), log)
    with log.row("statics"):
        sums = [[ld.factors.get(case.name, 0.0) for case in solved] for ld in acting if ld.factors is not None]
        answers = equilibria(surface, K, loads, elements, spreads=spreads, sums=sums, factor_of=factor_of)
    with log.row("stress"):
        sigma = [stress(surface, sheet.elastic, a.u, sheet.law, a.bubbles) for a in answers]
    return SolvedSheet(acting, plane, {elements: K}, factor_of, answers, sigma)


def _timed_factor(factor_of: FactorFunction, log: Log) -> FactorFunction:
    def factor(surface: Surface, K: csr_array, is_held: Bools) -> Factor:
        with log.row("factor"):
            return factor_of(surface, K, is_held)

    return factor


MOST_VERTICES = 200_000
"""Largest number of vertices for results by accurate finite elements, which need more memory than `hinge` elements."""


def answers_step(preset: Preset, surface: Surface, solved: SolvedSheet, log: Log, rough: bool = False) -> list[Answers]:
    """Return stress, energy, frequencies and buckling by case and combination; `rough` gives only stress and energy."""
    sheet = preset.statics
    model, matrices = sheet.sheet().model_for(surface), dict(solved.made)

    def stiffness(elements: Elements) -> csr_array:
        if elements not in matrices:
            matrices[elements] = sheet_stiffness(model, elements)
        return matrices[elements]

    other_factors = FactorCache(2)
    requested, refusals = (ResultRequest(), ()) if rough else _affordable_results(sheet, surface, log)
    if requested:
        log.report("statics", f"answering by {requested.elements_for(sheet.elements)} elements")
    if requested.frequencies:
        permanent = permanent_loads(preset, surface, solved.acting[0].load)
        model = replace(model, carried=mass_of_loads(permanent.values()))
    results: list[Answers] = []
    with log.row("answers"):
        for loading, answer in zip(solved.acting, solved.answers, strict=True):
            # frequencies do not depend on the load
            case_request = replace(requested, frequencies=0) if results else requested
            case = SolvedCase(loading.load, loading.spread, answer, sheet.elements, solved.factor_of, solved.plane)
            result = sheet_answers(model, case, stiffness, case_request, other_factors)
            result = replace(result, refusals=(*result.refusals, *refusals))
            results.append(replace(result, vibration=results[0].vibration) if results else result)
    named_answers = [(loading.name, answers) for loading, answers in zip(solved.acting, results, strict=True)]
    strong = preset.judged_in("ULS", [name for name, _ in named_answers if name])
    checked = [(name, answers) for name, answers in named_answers if name in strong]
    _note_answers(checked, requested, sheet, surface, log)
    return results


def _affordable_results(sheet: Statics, surface: Surface, log: Log) -> tuple[ResultRequest, tuple[str, ...]]:
    requested = sheet.analyses
    if surface.n <= MOST_VERTICES or requested.elements_for(sheet.elements) == sheet.elements:
        return requested, ()
    why = f"{surface.n:,} vertices are too many for the accurate elements (limit: {MOST_VERTICES:,} vertices)"
    log.note(
        "statics",
        f"the stress of the uncut sheet is only approximate, because {sheet.elements} elements are used: {why}; make "
        f"a coarser mesh (surface.edge) for accurate stress",
    )
    return ResultRequest(), (f"no natural frequencies, no buckling factors: {why}",) if requested.modes else ()


def _note_answers(
    named_answers: Sequence[tuple[str, Answers]], requested: ResultRequest, sheet: Statics, surface: Surface, log: Log
) -> None:
    elements = named_answers[0][1].elements
    if requested and sheet.bending != "hinge" and requested.elements_for(sheet.elements) != sheet.elements:
        why = f"{sheet.elements} elements are not accurate enough for reports"
        log.note(
            "statics", f"stress, energy, frequencies and buckling are computed with {elements} elements, because {why}"
        )
    facets = facet_number(surface, sheet.thickness)
    if requested and elements.bending == "hhj" and facets > FACETS:
        log.note(
            "statics",
            "each flat face bends under pressure and weight, so the largest stress is too high by a fraction of up to "
            f"{facets:.2g} (edge length x fold angle / thickness); make the mesh finer, until this fraction is below "
            f"{FACETS} (surface.edge, or surface.refine with smooth)",
        )
    for name, answers in named_answers:
        _note_case_answers(f" under {name}" if len(named_answers) > 1 else "", answers, sheet, log)


def _note_case_answers(under: str, answers: Answers, sheet: Statics, log: Log) -> None:
    if answers.assumed:
        log.note(
            "statics",
            f"frequencies and buckling{under} are for movements out of the plane of the sheet: {answers.assumed}",
        )
    for refusal in answers.refusals:
        aside = "" if answers.elements.bending else " (the sheet was solved without movements out of its plane)"
        log.note("statics", refusal + under + aside)
    if answers.buckling is not None and not len(answers.buckling.factor):
        log.note("statics", f"the load compresses no part of the uncut sheet{under}, so the sheet does not buckle")
    elif answers.buckling is not None and answers.buckling.factor[0] < 1:
        log.note("statics", f"the uncut sheet buckles{under} under less than the load; increase statics.thickness")
    reliable = answers.elements.bending != "hinge"
    if sheet.strength and reliable and (share := answers.stress.peak.stress / sheet.strength) > 1:
        log.note(
            "statics",
            f"the largest stress in the uncut sheet{under} is {share:.0%} of the strength; increase statics.thickness, "
            "unless the sheet's own weight is most of the load",
        )


BENDING_SHARE = 0.5  # Smallest share of bending in the energy for which stress "auto" means "layers".


class FollowedStress(NamedTuple):
    """Stress that the pattern follows, (m, 3, 3) in Pa for each load case and combination.
    sigma : stress of a single layer.    layered : stress that represents all layers of the thickness, or None.
    told  : note for the user, or ''."""

    sigma: Sequence[Floats]
    layered: Sequence[Floats] | None = None
    told: str = ""


def followed_layers(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers], sigma: Sequence[Floats]
) -> FollowedStress:
    """Return the stress that the pattern follows, for a sheet that can bend. Raises StaticsError.
    sigma : (m, 3, 3) stress in the middle of the thickness, Pa, for each load case and combination."""
    option = preset.statics.stress
    if is_slab(surface, answers):
        lower = [stress.tensor("bottom") for stress in _moment_stresses(preset, surface, acting, answers)]
        note = "the sheet is flat and bends: the pattern follows the stress at its lower side"
        return FollowedStress(lower, None, note)
    share = bending_share(preset, surface, acting, answers)
    if option == "layers" or (option == "auto" and share >= BENDING_SHARE):
        stresses = _moment_stresses(preset, surface, acting, answers)
        message = f"the pattern follows the stress in all layers of the sheet; bending stores {share:.0%} of its energy"
        layered = [layer_stress(surface, s.tensor("middle"), _bending_stress(s)) for s in stresses]
        return FollowedStress(sigma, layered, message)
    if option == "membrane" and share >= BENDING_SHARE:
        message = (
            f"bending stores {share:.0%} of the sheet's energy, but the pattern follows the stress of the middle "
            'surface, without bending; statics.stress = "layers" may give a stiffer sheet: compare the two designs'
        )
        return FollowedStress(sigma, None, message)
    return FollowedStress(sigma)


def bending_share(preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]) -> float:
    """Return the fraction of the strain energy that is due to bending, 0 to 1."""
    weights = [preset.followed_weights.get(loading.name, 0.0) for loading in acting]
    bent = sum(w * float(a.stress.bending_energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    total = sum(w * float(a.stress.energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    return bent / total if total > 0 else 0.0


def is_slab(surface: Surface, answers: Sequence[Answers]) -> bool:
    """Return True if the surface is flat, and if the stress in the middle of the thickness is nearly zero."""
    stresses = [answer.stress for answer in answers]
    membrane, bending = [s.membrane for s in stresses], [s.bending for s in stresses]
    return surface.is_flat and only_bends(np.stack(membrane), np.stack(bending))


def _moment_stresses(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]
) -> list[SheetStress]:
    if answers[0].elements.bending != "hinge":
        return [answer.stress for answer in answers]
    model = preset.statics.sheet().model_for(surface)
    solved = solve_for(model, {str(k): loading.load for k, loading in enumerate(acting)}, "stress")
    return [sheet_stress(model, solution.elements, solution) for solution in solved.values()]


def _bending_stress(stress: SheetStress) -> Floats:
    return stress.tensor("bottom") - stress.tensor("middle")


def note_statics(surface: Surface, cases: Mapping[str, CaseResult], log: Log) -> None:
    """Add notes on large residuals and very thin triangles to the log."""
    answers = {name: case.equilibrium for name, case in cases.items()}
    under = {name: f" under {name}" if len(cases) > 1 else "" for name in cases}
    rough = max(answers, key=lambda name: answers[name].residual)
    if (residual := answers[rough].residual) > REPORTED_RESIDUAL:
        log.note(
            "statics",
            f"the equations have a relative error of {residual:.1e}{under[rough]} (limit: {REPORTED_RESIDUAL:g}): the "
            "sheet is very thin or nearly a mechanism, or the mesh has very thin triangles",
        )
    if message := needle_message(surface):
        log.note("statics", f"{message}: the stress in these triangles is inaccurate; remesh the surface")


POSSIBLE_SLENDERNESS = (3.0, 1e5)
"""Allowed range of surface size / thickness. Values outside of this range raise an error, because a unit is wrong."""
USUAL_SLENDERNESS = (10.0, 5e3)  # Usual range of the surface's size / thickness. Other values give a note to the user.


def check_scale(preset: Preset, surface: Surface, log: Log) -> None:
    """Raise SurfaceError if the ratio of surface size and thickness is impossible; note an unusual ratio."""
    thickness = preset.statics.thickness
    slenderness = surface.size / thickness
    message = f"the surface is {length(surface.size)} large and the sheet {length(thickness)} thick"
    if not POSSIBLE_SLENDERNESS[0] < slenderness < POSSIBLE_SLENDERNESS[1]:
        is_python_mesh = isinstance(preset.surface, MeshSurface)  # a mesh from Python has no key surface.unit
        python_unit, file_unit = 'the unit (dsfab.Surface.of(mesh, "mm") for millimetres)', "surface.unit (mm, m, ...)"
        unit = python_unit if is_python_mesh else file_unit
        raise SurfaceError(f"{message}, which is impossible; check {unit} and statics.thickness (metres)")
    if not USUAL_SIZE[0] < surface.size < USUAL_SIZE[1]:
        log.note("statics", f"the surface is {length(surface.size)} large: check its unit")
    if not USUAL_SLENDERNESS[0] < slenderness < USUAL_SLENDERNESS[1]:
        log.note(
            "statics",
            f"{message}: the statics need a ratio of size to thickness of about 20 to 2000; check units and thickness",
        )


def checked_sheet(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> SolvedSheet:
    """Check thickness, supports and loads, and solve the uncut sheet. Raises SurfaceError if a check fails."""
    check_scale(preset, surface, log)
    for text in off_surface(preset, surface):
        log.note("statics", text)
    return solved_sheet(preset, surface, log, acting)


def statics_step(
    preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = (), solved: SolvedSheet | None = None
) -> StaticsResult:
    """Solve all load cases, and compute the results that [statics] requests.
    acting : loads that replace those of the preset.    solved : result of `checked_sheet`, if known."""
    solved = solved or checked_sheet(preset, surface, log, acting)
    answers = answers_step(preset, surface, solved, log)
    with log.row("stress"):
        follow = FollowedStress(solved.sigma)
        if not solved.plane:
            follow = followed_layers(preset, surface, solved.acting, answers, solved.sigma)
    if follow.told:
        log.note("statics", follow.told)
    return _statics_result(preset, surface, solved, answers, follow, log)


def rough_statics(preset: Preset, surface: Surface, solved: SolvedSheet) -> StaticsResult | None:
    """Return approximate statics for a quick sketch; None if the sketch needs accurate statics."""
    sheet = preset.statics
    if sheet.analyses.elements_for(sheet.elements) == sheet.elements or surface.is_flat or sheet.stress == "layers":
        return None
    answers = answers_step(preset, surface, solved, Log(None), rough=True)
    if sheet.stress == "auto" and bending_share(preset, surface, solved.acting, answers) >= BENDING_SHARE / 2:
        return None  # half of the limit, because `bending_share` is only approximate here
    return _statics_result(preset, surface, solved, answers, FollowedStress(solved.sigma), Log(None))


def same_followed_stress(rough: StaticsResult, statics: StaticsResult) -> bool:
    """Return True if the stress that the pattern follows is equal in `rough` and in `statics`."""
    pairs = ((case.followed_stress, rough.cases[name].followed_stress) for name, case in statics.cases.items())
    return all(np.array_equal(*pair) for pair in pairs)


def _statics_result(
    preset: Preset, surface: Surface, solved: SolvedSheet, answers: Sequence[Answers], follow: FollowedStress, log: Log
) -> StaticsResult:
    layered: Sequence[Floats | None] = follow.layered or [None] * len(solved.acting)
    results = {
        ld.name: CaseResult(ld.load, e, s, a, ld.factors, layer_stress_of_case)
        for ld, e, s, a, layer_stress_of_case in zip(
            solved.acting, solved.answers, follow.sigma, answers, layered, strict=True
        )
    }
    together = results.pop("", next(iter(results.values())))
    note_statics(surface, results, log)
    winds = [load for load in acting_on(preset, surface).load if isinstance(load, Wind)]
    # the outside of faces matters only if the two coefficients differ and no roof `shape` is set
    winds = [load for load in winds if load.windward != load.leeward and not load.shape]
    on_wall = any((picked_faces(surface, load.at, "wind") & faces_without_upper_side(surface)).any() for load in winds)
    if on_wall and min(float(np.dot(a.direction, b.direction)) for a in winds for b in winds) >= 0:
        log.note(
            "statics",
            "the wind acts on a wall; dsfab takes the side of the faces' normals as the outside; add a case with the "
            "opposite wind",
        )
    objected = list(objections(preset, surface, results))
    for objection in objected:
        log.note("statics", objection.text)
    reasons = tuple(objection.text for objection in objected if objection.refuses)
    return StaticsResult(
        together.load, together.equilibrium, together.sigma, together.answers, MappingProxyType(results), reasons
    )


def surface_step(preset: Preset, log: Log) -> Surface:
    """Return the surface in metres, cut along regions: the result of stage 1."""
    with log.stage("surface", "reading the mesh" if hasattr(preset.surface, "file") else "making the shape"):
        surface = base_surface(preset, log)
        if preset.pattern.region:
            surface = surface_with_regions(preset, surface, log)
        count = pieces(surface.F, surface.edges)[0]
    if count > 1:
        doubled = coincident(surface.V)
        merge = (
            f", unless the pieces join when you merge the {doubled} vertices that have equal coordinates"
            if doubled
            else ""
        )
        log.note("surface", f"the surface has {count} separate pieces; each needs its own supports{merge}")
    for remark in parallel_remarks(surface.V, surface.F):
        log.note("surface", remark)
    return surface


def base_surface(preset: Preset, log: Log | None = None) -> Surface:
    """Return the surface before the cut along regions."""
    section = preset.surface
    if not isinstance(section, OwnSurface):
        return section.build()
    source = _source_surface(section, log)
    if not section.by_stress:
        return section.build(base=source)
    static_preset = preset.model_copy(
        update={"statics": preset.statics.model_copy(update={"frequencies": 0, "buckling": 0})}
    )
    even = section.build(base=source)
    cut = surface_with_regions(static_preset, even, Log(None)) if preset.pattern.region else even
    surface = section.build(list(_stress_sizes(section, cut, statics_step(static_preset, cut, Log(None)))), source)
    if log:
        log.note(
            "surface",
            f"the surface has {surface.m:,} triangles, not {even.m:,}, with small triangles where the stress changes",
        )
    return surface


def _source_surface(section: OwnSurface, log: Log | None) -> Surface:
    if not isinstance(section, FileSurface):
        return section.base_surface()
    file = section.read()
    if log:
        log.file = file.record
        for remark in file.record.remarks:
            log.note("surface", f"{section.file.name}, {remark}")
        if any(section.origin):
            offset = coordinates(section.origin)
            log.note("surface", f"the origin of output files is the mesh point {offset} m; IFC files state this point")
    return file.surface


def _stress_sizes(section: OwnSurface, surface: Surface, statics: StaticsResult) -> Iterator[SizeField]:
    for case in statics.cases.values():
        for side in ("top", "bottom"):
            stress = case.answers.stress.tensor(side)
            yield SizeField(surface, change_sizes(surface, stress, section.edge, section.finest))
