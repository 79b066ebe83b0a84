"""Modes and phases that are `auto`: the stiffest of a few dozen, in rounds, each round around the best of the last.

The phases matter most: on a cantilever the same two modes are 1.8 to 100 times as soft as the uncut plate. What a phase
does to one family depends little on the other family, and it is smooth, so that a few steps find a good pair.
"""

from collections.abc import Iterable, Iterator
from itertools import product

from dsfab.errors import PatternError
from dsfab.pipeline.log import Log
from dsfab.pipeline.stressing import stressed_choice
from dsfab.pipeline.trial import Trial
from dsfab.preset import AUTO, FAMILIES, Preset
from dsfab.results import Candidate, Choice, StressedSurface

MODES = 4
"""The first modes of a family, among which one is chosen: the paper finds them enough."""

START = (0.25, 0.0, 0.5, 0.75)
"""Phases of the first round where both modes are chosen too, the same in both families: all of them with a mode 1, else
the first. A higher mode rises and falls more often, so that a shift moves some of its stripes one way and some the
other: on the cantilever these phases differ by a factor of 50 with modes 1 and 1, 1.1 with 2 and 2, 1.02 with 4 and 4.
"""

GRID = ((0.0, 0.25, 0.5, 0.75), (0.25, 0.75))
"""Phases of the first round, all combinations, with no mode to choose and with one."""

TOGETHER = ((1, 1), (-1, -1))
"""Moves of both phases along the line that the first round began on."""

AROUND = ((1, 0), (-1, 0), (0, 1), (0, -1), *TOGETHER)
"""Moves of one phase or both."""

ROUNDS = ((4, 0.125, TOGETHER), (1, 0.125, AROUND), (1, 0.0625, AROUND))
"""After the first: how many pairs of modes go on, the best first; by what step in phase, in periods; the moves."""

WHOLE = 0.98
"""A design of which a smaller share hangs together comes after all that are in one piece."""

Numbers = tuple[tuple[int, int], tuple[float, float]]
"""Modes and phases of both families."""


def choice_step(preset: Preset, given: StressedSurface, log: Log) -> Choice:
    """The candidates for what is `auto`, best first.

    Best is the smallest compliance per share of material, of those in which every concentrated load stands on a piece
    that reaches a support. At most 57 are tried, as many as the steps of a topology optimisation. By the width rule
    `stressed` they are tried as wide as by `graded`, and of the best few the one that evening makes the stiffest is
    first.

    Raises PatternError when none carries the loads.
    """
    found: dict[Numbers, Candidate] = {}
    with log.row("choice"):
        trial = Trial(preset, given)
        for number, wanted in enumerate(_rounds(preset, len(given.diffusion.major.lam), found)):
            new = [numbers for numbers in dict.fromkeys(wanted) if numbers not in found]
            if log.progress and new:
                told = f"choosing modes and phases, round {number + 1}: cutting and solving {len(new)}"
                log.progress("pattern", told)
            found.update({numbers: trial.candidate(*numbers) for numbers in new})
    ranked = tuple(sorted(found.values(), key=_rank))
    refused = sum(bool(candidate.refused) for candidate in ranked)
    best = ranked[0]
    if best.refused:
        raise PatternError(
            f"none of {refused} modes and phases carries the loads; the first: {best.refused}; set pattern.rim, raise "
            "pattern.keep or pattern.width.solid_fraction, or choose other frequencies"
        )
    log.note(
        "pattern",
        f"modes {best.mode[0]} and {best.mode[1]} with phases {best.phase[0]:g} and {best.phase[1]:g} are the stiffest "
        f"of {len(ranked)} tried: about {best.over_uncut:.3g} x the compliance of the uncut sheet",
    )
    choice = Choice(ranked)
    if preset.pattern.width.rule == "stressed":
        return stressed_choice(preset, given, log, choice)
    return choice


def _rank(candidate: Candidate) -> tuple[bool, bool, float, Numbers]:
    """Equal to three digits, as mirror images are, the lower numbers come first: rounding errors decide nothing."""
    soft = float(f"{candidate.compliance * candidate.kept:.3g}")
    return bool(candidate.refused), candidate.whole < WHOLE, soft, (candidate.mode, candidate.phase)


def _rounds(preset: Preset, computed: int, found: dict[Numbers, Candidate]) -> Iterator[Iterable[Numbers]]:
    """What to try next, given what was `found` up to then."""
    both = (preset.pattern.major, preset.pattern.minor)
    shown = [name in preset.pattern.family_names for name in FAMILIES]
    every = range(1, min(MODES, computed) + 1)
    any_mode = [shown[k] and both[k].mode == AUTO for k in (0, 1)]
    major, minor = (every if any_mode[k] else (both[k].number,) for k in (0, 1))
    free = [shown[k] and both[k].phase == AUTO for k in (0, 1)]
    given = (both[0].shift, both[1].shift)
    unknown = sum(any_mode)
    yield [(mode, p) for mode in product(major, minor) for p in _first_phases(mode, free, given, unknown)]
    if not any(free):
        return
    for count, step, moves in ROUNDS:
        leading: dict[tuple[int, int], Candidate] = {}
        for candidate in sorted(found.values(), key=_rank):
            leading.setdefault(candidate.mode, candidate)
        finalists = list(leading.values())[:count]
        if count > 1:  # the lowest pair varies most with its phases, and so has most to gain
            finalists = list(dict.fromkeys([*finalists[:-1], leading[min(leading)]]))
        yield [
            (best.mode, _moved(best.phase, (a * free[0], b * free[1]), step)) for best in finalists for a, b in moves
        ]


def _first_phases(
    mode: tuple[int, int], free: list[bool], given: tuple[float, float], unknown: int
) -> list[tuple[float, float]]:
    """Phases to begin with for a pair of modes, where `unknown` modes are to be chosen."""
    if unknown == 2:
        grid = [(p, p) for p in (START if 1 in mode else START[:1])]
    else:
        grid = [(p, q) for p in GRID[unknown] for q in GRID[unknown]]
    return list(dict.fromkeys((p if free[0] else given[0], q if free[1] else given[1]) for p, q in grid))


def _moved(phase: tuple[float, float], move: tuple[int, int], step: float) -> tuple[float, float]:
    """What does not move stays as it is, to the last bit."""
    p, q = ((x + way * step) % 1 if way else x for x, way in zip(phase, move, strict=True))
    return p, q
