"""The search for modes, phases and widths: trial designs that are cut, solved and compared."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design.finishing import merging
from dsfab.design.kept_material import kept_regions, tidy_of
from dsfab.design.log import Log
from dsfab.design.sheet_loads import held_vertices, loads_on, lost_load
from dsfab.design.stripe_pattern import SHARE_SNAP, WidthSearch, pattern_of, solved_layers, striped_families
from dsfab.pattern import Drawable, Layer, counted_share, evened
from dsfab.preset.model import AUTO, FAMILIES, Preset
from dsfab.results import Candidate, Choice, EvenStripes, PatternResult, StressedSurface
from dsfab.slicing import Sheet, Tidy, cut, filled_slits, resolve_pinches
from dsfab.statics import Aid, FaceStiffness, Quantity, solve_for
from dsfab.surface import LoadCase, Surface, pieces

SHARE_TOLERANCE = 2e-3
"""Accuracy of pattern.width.solid_fraction in trials, as a share of the surface."""


class CarryingSheet(NamedTuple):
    """Cells of a cut, the supported sheet, `kept`, `whole` and `pieces` as in a `Candidate`, and the removed ends."""

    cells: Sheet
    sheet: Sheet
    kept: float
    whole: float
    pieces: int
    tidy: Tidy | None


class Tried(NamedTuple):
    """A sheet that carries its loads: its worth, the pattern that cut it, and all cells."""

    candidate: Candidate
    pattern: PatternResult
    sheet: Sheet
    cells: Sheet


class Trial:
    """Trials of modes and phases on one surface, which share all data that does not depend on them."""

    def __init__(self, preset: Preset, given: StressedSurface, even: EvenStripes | None = None) -> None:
        self.preset, self.given, self.surface, self.even = preset, given, given.surface, even
        self.loads = given.statics.loads(preset.followed)
        self.kept = kept_regions(preset, given.surface, given.load, even)
        self.factors: dict[tuple[int, int], float] = {}
        self._share = counted_share(given.surface, self.kept)

    @cached_property
    def uncut(self) -> float:
        """Compliance of the uncut surface, joules."""
        return self.compliance(self.surface, self.loads)

    def candidate(self, mode: tuple[int, int], phase: tuple[float, float]) -> Candidate:
        """Return the worth of modes and phases of the major and the minor stripes, or the reason of a refusal."""
        try:
            return self.drawn(self.preset.settled(mode, phase)).candidate
        except DsfabError as error:
            return Candidate(mode, phase, refused=str(error))

    def drawn(self, preset: Preset, grading: Floats | None = None) -> Tried:
        """Cut and solve the modes or stripes of a preset. Raises DsfabError if they do not carry the loads.

        grading : (n, f) as in `drawable_families`.
        """
        ask = preset.pattern
        families, layers = self._layers(preset, grading)
        found = self.carrying(layers)
        compliance = self.compliance(found.sheet.surface, self.loads_on(found.sheet))
        numbers = (ask.major.number, ask.minor.number), (ask.major.shift, ask.minor.shift)
        over = compliance / self.uncut
        candidate = Candidate(*numbers, compliance, over, found.kept, found.whole, found.pieces)
        pattern = replace(pattern_of(preset, families, layers), even=self.even, tidy=found.tidy)
        return Tried(candidate, pattern, found.sheet, found.cells)

    def carrying(self, layers: Sequence[Layer]) -> "CarryingSheet":
        """Cut layers and return the sheet. Raises DsfabError if it does not carry the loads."""
        surface = self.surface
        tidy = tidy_of(self.preset, self.given, layers)
        cells = cut(surface, [layer.field for layer in layers], [layer.levels for layer in layers], SHARE_SNAP, tidy)
        cells = resolve_pinches(cells, self.preset.statics.thickness / 2).sheet
        cells = filled_slits(cells, merging(self.preset))[0] if tidy else cells
        material = cells.kept()
        F = material.surface.F
        count, label = pieces(F, material.surface.edges)
        area = np.bincount(label, material.surface.areas, count)
        held = np.bincount(label, held_vertices(surface, material, self.given.load)[F].any(axis=1), count) > 0
        if not held.any():
            raise PatternError("no piece of material reaches a support")
        sheet = material if held.all() else material.kept(held[label])
        if lost := lost_load(surface, material, sheet, self.loads.values()):
            raise PatternError(lost)
        shares = float(area.sum() / surface.area), float(area[held].max() / area.sum())
        return CarryingSheet(cells, sheet, *shares, count, tidy)

    def loads_on(self, sheet: Sheet) -> dict[str, LoadCase]:
        """Return the loads that the pattern follows, by name, on a sheet."""
        return loads_on(self.surface, sheet, self.loads)

    def stiffness(self, surface: Surface, loads: dict[str, LoadCase]) -> FaceStiffness:
        """Return the stiffness of a sheet by faces."""
        return FaceStiffness.of(self.preset.statics.sheet().on(surface), list(loads.values()))

    def _layers(self, preset: Preset, grading: Floats | None) -> tuple[Sequence[Drawable], list[Layer]]:
        radius = preset.pattern.width.widths(np.sqrt(self.surface.area)).radius
        families = striped_families(preset, self.given, radius, grading, self.even)
        modes = preset.pattern.major.number, preset.pattern.minor.number
        search = WidthSearch(self._share, SHARE_TOLERANCE, self.factors.get(modes, 0.0))
        layers, factor = solved_layers(preset, self.surface, self.kept, families, search)
        self.factors[modes] = factor
        return families, layers

    def compliance(self, surface: Surface, loads: dict[str, LoadCase], use: Quantity | Aid = "ranking") -> float:
        """Return joules, the weighted sum over the loads that the pattern follows."""
        answers = solve_for(self.preset.statics.sheet().on(surface), loads, use)
        return sum(weight * answers[name].compliance for name, weight in self.preset.followed.items())


LEAST, MOST = 0.01, 0.55
"""Bounds of half-widths in the search, in periods: a vanished stripe may come back, and a closed opening may open."""


class Step(NamedTuple):
    """Widths of a step: their worth, joules times share of the surface, and the widths of the next step."""

    worth: float
    grading: Floats
    after: Floats


def stressed_step(preset: Preset, given: StressedSurface, log: Log, even: EvenStripes | None = None) -> Floats | None:
    """Return the best relative half-widths (n, 2) of both families from pattern.width.steps trials.

    Best is the least compliance per share of material, by constant strain and mid-edge bending on the cut mesh. None if
    the first sheet does not carry the loads: then the widths are those of the rule `graded`.
    """
    tried = _steps(Stressed(preset, given, even), log)
    if not tried:
        return None
    best = min(tried, key=lambda step: step.worth)
    log.note(
        "pattern",
        f"widths that even out the stress: after {len(tried)} steps {1 - best.worth / tried[0].worth:.0%} less "
        "compliance than graded ones, each on its own cut mesh",
    )
    return best.grading


def stressed_choice(preset: Preset, given: StressedSurface, log: Log, choice: Choice) -> Choice:
    """Return the choice, beginning with the modes and phases that are stiffest after their widths even out the stress.

    The best three pairs of modes are evened, and the lowest. Their order may change: on the cantilever at 30 % of the
    material, modes 2 and 2 improve from 4.12 to 3.86 times the compliance of the uncut plate, and modes 1 and 1 from
    4.40
    to 3.01 times.
    """
    leading: dict[tuple[int, int], Candidate] = {}
    for candidate in choice.candidates:
        leading.setdefault(candidate.mode, candidate)
    carry = {mode: candidate for mode, candidate in leading.items() if not candidate.refused}
    finalists = list(carry.values())[:3]
    finalists = list(dict.fromkeys([*finalists, carry[min(carry)]]))  # the lowest pair has most to gain
    if len(finalists) < 2:
        return choice

    def worth(candidate: Candidate) -> float:
        settled = preset.settled(candidate.mode, candidate.phase)
        steps = _steps(Stressed(settled, given), replace(log, notes=[]))
        return min((step.worth for step in steps), default=float("inf"))

    best = min(finalists, key=worth)
    log.note(
        "pattern",
        f"modes {best.mode[0]} and {best.mode[1]} with phases {best.phase[0]:g} and {best.phase[1]:g} are the stiffest "
        f"of the {len(finalists)} whose widths were evened",
    )
    return Choice((best, *(candidate for candidate in choice.candidates if candidate is not best)))


def _steps(trial: "Stressed", log: Log) -> list[Step]:
    """Return the steps of widths, as many as pattern.width.steps, or until one does not carry the loads."""
    tried: list[Step] = []
    with log.row("widths"):
        grading = trial.start
        for number in range(trial.preset.pattern.width.steps):
            if log.progress:
                log.progress("pattern", f"evening the stress, step {number + 1}: cutting and solving")
            try:
                tried.append(trial.step(grading))
            except DsfabError as error:
                log.note("pattern", f"step {number + 1} of the width rule stressed was given up: {error}")
                break
            grading = tried[-1].after
    return tried


class Stressed(Trial):
    """Trials of widths for fixed modes and phases."""

    def __init__(self, preset: Preset, given: StressedSurface, even: EvenStripes | None = None) -> None:
        super().__init__(preset, given, even)
        surface = given.surface
        self.families = striped_families(preset, given, even=even)
        slopes = np.stack([family.density for family in self.families])
        self.spacing = float(slopes.shape[0] * surface.area / (slopes @ surface.vertex_areas).sum())
        self.start = np.stack([family.stress for family in self.families], axis=1)
        self.factor = self.added = 0.0

    def step(self, grading: Floats) -> Step:
        """Cut and solve with half-widths `grading` (n, f). Raises DsfabError if the sheet does not carry the loads."""
        families = [family.stressed(g) for family, g in zip(self.families, grading.T, strict=True)]
        search = WidthSearch(self._share, SHARE_TOLERANCE, self.factor, added=self.added)
        layers, self.factor = solved_layers(self.preset, self.surface, self.kept, families, search)
        found = self.carrying(layers)
        ask = self.preset.pattern
        wanted = ask.width.solid_fraction
        if ask.forces == "optimal":  # the count of points includes removed ends, which vary most here
            self.added = float(np.clip(self.added + found.kept - wanted, -0.1, 0.1))
        names = np.array([layer.name for layer in layers])
        K = self.stiffness(found.sheet.surface, self.loads_on(found.sheet))
        energy = K.energies(K.factor(np.ones(found.sheet.surface.m))(K.force)) @ list(self.preset.followed.values())
        work, material = (self._by_family(found.sheet, names, x) for x in (energy, found.sheet.surface.areas))
        after = evened(self.surface, grading, work, material, self.spacing)
        if self.even is not None and self.even.symmetry is not None:
            after = self.even.symmetry.mean(after)
        return Step(float(energy.sum()) * found.kept, grading, self._within(families, after))

    def _by_family(self, sheet: Sheet, names: NDArray[np.str_], x: Floats) -> Floats:
        """Return sums (m, 2) of values x (m',) of cells over the part of each face that belongs to each family."""
        sums = []
        for family in self.families:
            cells = np.flatnonzero(names[sheet.family] == family.name)
            sums.append(np.bincount(sheet.parent[cells], x[cells], self.surface.m))
        return np.stack(sums, axis=1).astype(np.float64)

    def _within(self, families: Sequence[Drawable], grading: Floats) -> Floats:
        """Return the grading, clipped so that half-widths stay between LEAST and MOST."""
        full = np.array([self.factor * family.stripes.half_width for family in families])
        full = np.where(full > 0, full, 1.0)
        return np.asarray(np.clip(grading * full, LEAST, MOST) / full)


START = (0.25, 0.0, 0.5, 0.75)
"""Phases of the first round if both modes are chosen too, the same in both families: all of them with a mode 1, else
the first. A higher mode rises and falls more often, so that a shift moves some of its stripes one way and some the
other: on the cantilever these phases differ by a factor of 50 with modes 1 and 1, 1.1 with 2 and 2, 1.02 with 4 and 4.
"""

GRID = ((0.0, 0.25, 0.5, 0.75), (0.25, 0.75))
"""Phases of the first round, in all combinations: without a mode to choose, and with one."""

TOGETHER = ((1, 1), (-1, -1))
"""Moves of both phases along the line of the first round."""

AROUND = ((1, 0), (-1, 0), (0, 1), (0, -1), *TOGETHER)
"""Moves of one phase or both."""

ROUNDS = ((4, 0.125, TOGETHER), (1, 0.125, AROUND), (1, 0.0625, AROUND))
"""Later rounds: number of pairs of modes that continue, best first; step of phases, in periods; moves."""

WHOLE = 0.98
"""A design whose largest supported piece has a smaller share of its material ranks after connected ones."""

Numbers = tuple[tuple[int, int], tuple[float, float]]
"""Modes and phases of both families."""


def choice_step(preset: Preset, given: StressedSurface, log: Log) -> Choice:
    """Return the candidates for modes and phases that are `auto`, best first.

    Best is the smallest compliance per share of material, if every concentrated load stands on a supported piece. The
    search tries at most 57, the steps of a topology optimisation. By the width rule `stressed`, candidates are tried
    with widths as by `graded`, and the one of the best few that evening makes the stiffest is first.

    Raises PatternError if no candidate carries the loads.
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
    """Return the sort key. Values are equal to three digits for mirror images; then lower numbers come first, not
    rounding.
    """
    soft = float(f"{candidate.compliance * candidate.kept:.3g}")
    return bool(candidate.refused), candidate.whole < WHOLE, soft, (candidate.mode, candidate.phase)


def _rounds(preset: Preset, computed: int, found: dict[Numbers, Candidate]) -> Iterator[Iterable[Numbers]]:
    both = (preset.pattern.major, preset.pattern.minor)
    shown = [name in preset.pattern.family_names for name in FAMILIES]
    every = range(1, min(4, computed) + 1)  # the first four modes suffice, as in the paper
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
        if count > 1:  # the lowest pair varies most with its phases
            finalists = list(dict.fromkeys([*finalists[:-1], leading[min(leading)]]))
        yield [
            (best.mode, _moved(best.phase, (a * free[0], b * free[1]), step)) for best in finalists for a, b in moves
        ]


def _first_phases(
    mode: tuple[int, int], free: list[bool], given: tuple[float, float], unknown: int
) -> list[tuple[float, float]]:
    """Return the first phases of a pair of modes, if `open_modes` modes are to be chosen."""
    if unknown == 2:
        grid = [(p, p) for p in (START if 1 in mode else START[:1])]
    else:
        grid = [(p, q) for p in GRID[unknown] for q in GRID[unknown]]
    return list(dict.fromkeys((p if free[0] else given[0], q if free[1] else given[1]) for p, q in grid))


def _moved(phase: tuple[float, float], move: tuple[int, int], step: float) -> tuple[float, float]:
    """Return phases after a move; a phase that does not move keeps its last bit."""
    p, q = ((x + way * step) % 1 if way else x for x, way in zip(phase, move, strict=True))
    return p, q
