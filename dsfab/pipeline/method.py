"""`[pattern] method = "auto"`: modes or evenly spaced stripes, halved or not, by one width rule or the other.

Which is the stiffest depends on the surface: evenly spaced stripes on most shells, modes on some plates. So each is cut
and solved, as for modes that are `auto`, and the best is taken.
"""

from typing import NamedTuple

from dsfab.design import DiffusionResult, EvenStripes, StaticsResult
from dsfab.errors import DsfabError, PatternError
from dsfab.pipeline.choice import choice_step
from dsfab.pipeline.even import even_stripes
from dsfab.pipeline.log import Log
from dsfab.pipeline.trial import Trial
from dsfab.preset import Preset
from dsfab.surface import Surface

RULES = ("constant", "graded")
"""Width rules of which the better one is taken, where one of them is asked for with a share of the surface to keep."""


class Attempt(NamedTuple):
    """A way to draw the stripes, and what it is worth.

    worth : compliance times share of the surface, joules; infinite where it does not carry the loads.
    over  : its compliance over that of the uncut sheet.    refused : why it cannot be taken, or ''.
    even  : where evenly spaced stripes run; None for modes.
    """

    name: str
    preset: Preset
    even: EvenStripes | None = None
    worth: float = float("inf")
    over: float = float("inf")
    refused: str = ""


def method_step(
    preset: Preset, surface: Surface, statics: StaticsResult, diffusion: DiffusionResult, log: Log
) -> tuple[Preset, EvenStripes | None]:
    """The preset with the method, halving and width rule that are the stiffest per share of material; and its evenly
    spaced stripes, or None for modes.

    Raises PatternError when none carries the loads.
    """
    found: list[Attempt] = []
    for method, halve in _methods(preset):
        with log.row("method"):
            found += _attempts(preset, surface, statics, diffusion, log, method, halve)
    best = min(found, key=lambda attempt: attempt.worth)
    if best.refused:
        raise PatternError(f"no method draws stripes that carry the loads; the first: {best.refused}")
    told = "; ".join(f"{one.name} {one.over:.3g} x" if not one.refused else f"{one.name} refused" for one in found)
    log.note("pattern", f"method auto took {best.name}: of compliances over that of the uncut sheet, {told}")
    return best.preset, best.even


def _methods(preset: Preset) -> list[tuple[str, bool]]:
    halved = [("stripes", True)] if preset.pattern.halved else []
    modes = [] if preset.pattern.steered else [("modes", preset.pattern.halve)]  # they follow nothing but the stress
    return [*halved, ("stripes", False), *modes]


def _attempts(
    preset: Preset,
    surface: Surface,
    statics: StaticsResult,
    diffusion: DiffusionResult,
    log: Log,
    method: str,
    halve: bool,
) -> list[Attempt]:
    """One method by each width rule."""
    words = {"modes": "modes", "stripes": "halved stripes" if halve else "stripes"}
    asked = preset.with_pattern(method=method, halve=halve)
    if log.progress:
        log.progress("pattern", f"trying {words[method]}: cutting and solving")
    try:
        even = even_stripes(asked, surface, statics) if method == "stripes" else None
        if asked.pattern.auto:
            chosen = choice_step(asked, surface, statics, diffusion, log)
            asked = asked.settled(chosen.mode, chosen.phase)
    except DsfabError as error:
        return [Attempt(words[method], asked, refused=str(error))]
    found = []
    width = preset.pattern.width
    for rule in RULES if width.rule in RULES and width.solid_fraction else (width.rule,):
        variant = asked.with_pattern(width=width.model_copy(update={"rule": rule}))
        name = f"{words[method]}, {rule}"
        try:
            candidate = Trial(variant, surface, statics, diffusion, even).drawn()
        except DsfabError as error:
            found.append(Attempt(name, variant, even, refused=str(error)))
            continue
        found.append(Attempt(name, variant, even, candidate.compliance * candidate.kept, candidate.over_uncut))
    return found
