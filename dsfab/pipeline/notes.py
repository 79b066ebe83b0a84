"""What a run should tell an engineer of the statics: large movements, poor solutions, needles in the mesh."""

from collections.abc import Mapping

from dsfab.limits import PRECISE
from dsfab.pipeline.log import Log
from dsfab.results import CaseResult
from dsfab.statics import needles_told
from dsfab.surface import Surface

FAR = 0.1
"""The user is told when the sheet would move by more than this share of its size."""


def note_statics(surface: Surface, cases: Mapping[str, CaseResult], log: Log) -> None:
    """Notes on the answers of all cases (the worst of them is named), and on the mesh that they are for."""
    answers = {name: case.equilibrium for name, case in cases.items()}
    under = {name: f" under {name}" if len(cases) > 1 else "" for name in cases}
    moved = max(answers, key=lambda name: answers[name].largest_displacement)
    if (far := answers[moved].largest_displacement) > FAR * surface.size:
        log.note(
            "statics",
            f"the sheet would move by {far:.3g} m{under[moved]}, over a tenth of its size: directions stay "
            "right (statics are linear), but the load is too large or the sheet too thin to be built",
        )
    rough = max(answers, key=lambda name: answers[name].residual)
    if (residual := answers[rough].residual) > PRECISE:
        log.note(
            "statics",
            f"the equations are solved to {residual:.1e}{under[rough]} (wanted: {PRECISE:g}): the sheet is very "
            "thin or nearly a mechanism, or the mesh has needles",
        )
    if told := needles_told(surface):
        log.note("statics", f"{told}: stresses there are poor; remesh the surface")
