"""The second step: how what is given carries the load."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from dsfab.arrays import Floats
from dsfab.errors import SurfaceError
from dsfab.limits import PRECISE, USUAL_SIZE
from dsfab.pipeline.answers import answers_step
from dsfab.pipeline.buildable import objections, off_surface
from dsfab.pipeline.layers import BENDS, FollowedStress, bending_share, followed_layers
from dsfab.pipeline.loadings import Loading
from dsfab.pipeline.log import Log
from dsfab.pipeline.solved import SolvedSheet, solved_sheet
from dsfab.preset import Preset
from dsfab.preset_surface import MeshSurface
from dsfab.results import CaseResult, StaticsResult
from dsfab.statics import Answers, needles_told
from dsfab.surface import Surface
from dsfab.wording import length


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
    """`solved_sheet`, after a look at whether it is one. Raises SurfaceError for what no sheet is."""
    check_scale(preset, surface, log)
    for text in off_surface(preset, surface):
        log.note("statics", text)
    return solved_sheet(preset, surface, log, acting)


def statics_step(
    preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = (), solved: SolvedSheet | None = None
) -> StaticsResult:
    """All load cases, and what is asked about them.

    acting : the loads, where they are not those of the preset.
    solved : of `checked_sheet`, where somebody had it made.
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
    """The same without better elements, for a sketch; None where there are none to wait for, or where what the pattern
    follows may depend on them."""
    sheet = preset.statics
    if sheet.ask.elements(sheet.elements) == sheet.elements or surface.is_flat or sheet.stress == "layers":
        return None
    answers = answers_step(preset, surface, solved, Log(None), rough=True)
    if sheet.stress == "auto" and bending_share(preset, surface, solved.acting, answers) >= BENDS / 2:
        return None  # a rough figure: see there
    return _result(preset, surface, solved, answers, FollowedStress(solved.sigma), Log(None))


def _result(
    preset: Preset, surface: Surface, solved: SolvedSheet, answers: Sequence[Answers], follow: FollowedStress, log: Log
) -> StaticsResult:
    """Everything in its place, with notes."""
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
