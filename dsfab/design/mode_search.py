"""Search for modes, phases and widths."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError, PatternError
from dsfab.design.regions_and_loads import held_vertices, loads_on, lost_load
from dsfab.design.slicing_and_thickening import merging_rule
from dsfab.design.stripe_pattern import (
    SHARE_SNAP,
    WidthSearch,
    drawable_families,
    kept_regions,
    pattern_result,
    solved_layers,
    tidy_of,
)
from dsfab.pattern import DrawableFamily, Layer, counted_share, evened_grading
from dsfab.preset.model import AUTO, FAMILIES, Preset
from dsfab.results import Candidate, Choice, EvenStripes, Log, PatternResult, StressedSurface
from dsfab.slicing import Sheet, Tidy, filled_slits, resolve_pinches, tidied_sheet
from dsfab.statics import Aid, FaceStiffness, Quantity, solve_for
from dsfab.surface import LoadCase, Surface, pieces

SHARE_TOLERANCE = 2e-3  # Largest error of the solid fraction when the search cuts a pattern.


class CarryingSheet(NamedTuple):
    """A cut sheet that carries its loads. cells : material and openings.    sheet : pieces that reach a support.
    kept : material / area of the surface.    whole : part of the material in the largest supported piece."""

    cells: Sheet
    sheet: Sheet
    kept: float
    whole: float
    pieces: int
    tidy: Tidy | None


class TrialResult(NamedTuple):
    """Result of a trial. sheet : material that carries the loads.    cells : all cells: material and openings."""

    candidate: Candidate
    pattern: PatternResult
    sheet: Sheet
    cells: Sheet


class Trial:
    """Cuts and solves trial patterns on a surface. even : evenly spaced stripes; None for stripes from modes."""

    def __init__(self, preset: Preset, analysis: StressedSurface, even: EvenStripes | None = None) -> None:
        self.preset, self.given, self.surface, self.even = preset, analysis, analysis.surface, even
        self.loads = analysis.statics.loads(preset.followed_weights)
        self.kept = kept_regions(preset, analysis.surface, analysis.load, even)
        self.factors: dict[tuple[int, int], float] = {}
        self._share = counted_share(analysis.surface, self.kept)

    @cached_property
    def uncut(self) -> float:
        """Compliance of the uncut surface, joules."""
        return self.compliance(self.surface, self.loads)

    def candidate(self, mode: tuple[int, int], phase: tuple[float, float]) -> Candidate:
        """Try the modes and phases of major and minor stripes. `refused` in the result states why a trial failed."""
        try:
            return self.result(self.preset.with_modes(mode, phase)).candidate
        except DsfabError as error:
            return Candidate(mode, phase, refused=str(error))

    def result(self, preset: Preset, grading: Floats | None = None) -> TrialResult:
        """Try the pattern of a preset. Raises DsfabError if the sheet does not carry the loads.
        grading : (n, f) relative half-widths of f families of stripes at n vertices."""
        options = preset.pattern
        families, layers = self._layers(preset, grading)
        carrying = self.carrying(layers)
        compliance = self.compliance(carrying.sheet.surface, self.loads_on(carrying.sheet))
        numbers = (options.major.number, options.minor.number), (options.major.shift, options.minor.shift)
        over = compliance / self.uncut
        candidate = Candidate(*numbers, compliance, over, carrying.kept, carrying.whole, carrying.pieces)
        pattern = replace(pattern_result(preset, families, layers), even=self.even, tidy=carrying.tidy)
        return TrialResult(candidate, pattern, carrying.sheet, carrying.cells)

    def carrying(self, layers: Sequence[Layer]) -> "CarryingSheet":
        """Cut the surface along `layers`; return the sheet. Raises DsfabError if the sheet does not carry the loads."""
        surface = self.surface
        tidy = tidy_of(self.preset, self.given, layers)
        fields, levels = [layer.field for layer in layers], [layer.levels for layer in layers]
        cells = tidied_sheet(surface, fields, levels, SHARE_SNAP, tidy)
        cells = resolve_pinches(cells, self.preset.statics.thickness / 2).sheet
        cells = filled_slits(cells, merging_rule(self.preset))[0] if tidy else cells
        material = cells.subset()
        F = material.surface.F
        count, label = pieces(F, material.surface.edges)
        area = np.bincount(label, material.surface.areas, count)
        is_held = held_vertices(surface, material, self.given.load)[F].any(axis=1)
        reaches_support = np.bincount(label, is_held, count) > 0
        if not reaches_support.any():
            raise PatternError("no piece of material reaches a support")
        sheet = material if reaches_support.all() else material.subset(reaches_support[label])
        if lost := lost_load(surface, material, sheet, self.loads.values()):
            raise PatternError(lost)
        shares = float(area.sum() / surface.area), float(area[reaches_support].max() / area.sum())
        return CarryingSheet(cells, sheet, *shares, count, tidy)

    def loads_on(self, sheet: Sheet) -> dict[str, LoadCase]:
        """Return the loads on a cut sheet, by name."""
        return loads_on(self.surface, sheet, self.loads)

    def stiffness(self, surface: Surface, loads: dict[str, LoadCase]) -> FaceStiffness:
        return FaceStiffness.from_sheet(self.preset.statics.sheet().model_for(surface), list(loads.values()))

    def _layers(self, preset: Preset, grading: Floats | None) -> tuple[Sequence[DrawableFamily], list[Layer]]:
        radius = preset.pattern.width.widths(np.sqrt(self.surface.area)).radius
        families = drawable_families(preset, self.given, radius, grading, self.even)
        modes = preset.pattern.major.number, preset.pattern.minor.number
        search = WidthSearch(self._share, SHARE_TOLERANCE, self.factors.get(modes, 0.0))
        layers, factor = solved_layers(preset, self.surface, self.kept, families, search)
        self.factors[modes] = factor
        return families, layers

    def compliance(self, surface: Surface, loads: dict[str, LoadCase], use: Quantity | Aid = "ranking") -> float:
        """Return the weighted sum of the compliances under `loads`, joules. use : required accuracy."""
        answers = solve_for(self.preset.statics.sheet().model_for(surface), loads, use)
        return sum(weight * answers[name].compliance for name, weight in self.preset.followed_weights.items())


LEAST_HALF_WIDTH, MOST_HALF_WIDTH = 0.01, 0.55  # Limits of the half-widths of stripes in the search, periods.


class WidthStep(NamedTuple):
    """Trial of the width rule `stressed`. worth : compliance (J) times fraction of material; small is good.
    grading, after : relative half-widths of stripes in this trial, and for the next trial."""

    worth: float
    grading: Floats
    after: Floats


def stressed_step(
    preset: Preset, analysis: StressedSurface, log: Log, even: EvenStripes | None = None
) -> Floats | None:
    """Return the best relative half-widths (n, f) of f families of stripes; None if the first trial fails."""
    steps = _steps(StressedTrial(preset, analysis, even), log)
    if not steps:
        return None
    stiffest = min(steps, key=lambda step: step.worth)
    log.note(
        "pattern",
        f"after {len(steps)} steps of the width rule 'stressed', the compliance of the sheet is "
        f"{1 - stiffest.worth / steps[0].worth:.0%} smaller than with graded widths",
    )
    return stiffest.grading


def stressed_choice(preset: Preset, analysis: StressedSurface, log: Log, choice: Choice) -> Choice:
    """Return the candidates of `choice`, in new order: first the stiffest with the width rule `stressed`."""
    leading: dict[tuple[int, int], Candidate] = {}
    for candidate in choice.candidates:
        leading.setdefault(candidate.mode, candidate)
    carry = {mode: candidate for mode, candidate in leading.items() if not candidate.refused}
    finalists = list(carry.values())[:3]
    finalists = list(dict.fromkeys([*finalists, carry[min(carry)]]))  # the lowest mode may gain most from `stressed`
    if len(finalists) < 2:
        return choice

    def worth(candidate: Candidate) -> float:
        settled = preset.with_modes(candidate.mode, candidate.phase)
        steps = _steps(StressedTrial(settled, analysis), replace(log, notes=[]))
        return min((step.worth for step in steps), default=float("inf"))

    stiffest = min(finalists, key=worth)
    log.note(
        "pattern",
        f"modes {stiffest.mode[0]} and {stiffest.mode[1]} with phases {stiffest.phase[0]:g} and {stiffest.phase[1]:g} "
        f"give the stiffest design of {len(finalists)} pairs with the width rule 'stressed'",
    )
    return Choice((stiffest, *(candidate for candidate in choice.candidates if candidate is not stiffest)))


def _steps(trial: "StressedTrial", log: Log) -> list[WidthStep]:
    steps: list[WidthStep] = []
    with log.row("widths"):
        grading = trial.start
        for number in range(trial.preset.pattern.width.steps):
            log.report("pattern", f"step {number + 1} of the width rule 'stressed': cutting and solving")
            try:
                steps.append(trial.step(grading))
            except DsfabError as error:
                log.note("pattern", f"the width rule 'stressed' ended before step {number + 1}: {error}")
                break
            grading = steps[-1].after
    return steps


class StressedTrial(Trial):
    """Trials of the width rule `stressed`, which adapts the widths of members in steps."""

    def __init__(self, preset: Preset, analysis: StressedSurface, even: EvenStripes | None = None) -> None:
        super().__init__(preset, analysis, even)
        surface = analysis.surface
        self.families = drawable_families(preset, analysis, even=even)
        slopes = np.stack([family.density for family in self.families])
        self.spacing = float(slopes.shape[0] * surface.area / (slopes @ surface.vertex_areas).sum())
        self.start = np.stack([family.stress for family in self.families], axis=1)
        self.factor = self.added = 0.0

    def step(self, grading: Floats) -> WidthStep:
        """Try relative half-widths `grading` (n, f) of f families of stripes; compute the next half-widths.
        Raises DsfabError if the sheet does not carry the loads."""
        families = [family.with_stress(g) for family, g in zip(self.families, grading.T, strict=True)]
        search = WidthSearch(self._share, SHARE_TOLERANCE, self.factor, added=self.added)
        layers, self.factor = solved_layers(self.preset, self.surface, self.kept, families, search)
        carrying = self.carrying(layers)
        options = self.preset.pattern
        requested = options.width.solid_fraction
        if options.forces == "optimal":  # `added` corrects `_share` for stripe ends that are removed later
            self.added = float(np.clip(self.added + carrying.kept - requested, -0.1, 0.1))
        names = np.array([layer.name for layer in layers])
        K = self.stiffness(carrying.sheet.surface, self.loads_on(carrying.sheet))
        weights = list(self.preset.followed_weights.values())
        energy = K.energies(K.factor(np.ones(carrying.sheet.surface.m))(K.force)) @ weights
        work, material = (self._by_family(carrying.sheet, names, x) for x in (energy, carrying.sheet.surface.areas))
        next_grading = evened_grading(self.surface, grading, work, material, self.spacing)
        if self.even is not None and self.even.symmetry is not None:
            next_grading = self.even.symmetry.mean(next_grading)
        return WidthStep(float(energy.sum()) * carrying.kept, grading, self._clipped_grading(families, next_grading))

    def _by_family(self, sheet: Sheet, names: NDArray[np.str_], x: Floats) -> Floats:
        sums = []
        for family in self.families:
            cells = np.flatnonzero(names[sheet.family] == family.name)
            sums.append(np.bincount(sheet.parent[cells], x[cells], self.surface.m))
        return np.stack(sums, axis=1).astype(np.float64)

    def _clipped_grading(self, families: Sequence[DrawableFamily], grading: Floats) -> Floats:
        full = np.array([self.factor * family.stripes.half_width for family in families])
        full = np.where(full > 0, full, 1.0)
        return np.asarray(np.clip(grading * full, LEAST_HALF_WIDTH, MOST_HALF_WIDTH) / full)


START = (0.25, 0.0, 0.5, 0.75)
"""First phases to try, in periods, if the search chooses the modes of both families. Both families get equal phases.
The search tries all four phases for pairs of modes with mode 1, and only the first phase for further pairs."""
GRID = ((0.0, 0.25, 0.5, 0.75), (0.25, 0.75))
"""First phases to try, in periods. If the search chooses the mode of k families, it combines all phases in GRID[k]."""
TOGETHER = ((1, 1), (-1, -1))  # Equal changes of both phases, in steps of `ROUNDS`.
AROUND = ((1, 0), (-1, 0), (0, 1), (0, -1), *TOGETHER)  # Changes of major and minor phase, in steps of `ROUNDS`.
ROUNDS = ((4, 0.125, TOGETHER), (1, 0.125, AROUND), (1, 0.0625, AROUND))
"""For each later round: number of mode pairs, step of the phases (periods), and phase changes in units of this step."""
CONNECTED_SHARE = 0.98  # Designs whose largest supported piece has a smaller share of the material rank last.
ModesAndPhases = tuple[tuple[int, int], tuple[float, float]]  # Modes and phases of both families.


def choice_step(preset: Preset, analysis: StressedSurface, log: Log) -> Choice:
    """Search modes and phases for preset values that are `auto`; return all tried candidates, best first.
    Raises PatternError if no candidate carries the loads."""
    candidates: dict[ModesAndPhases, Candidate] = {}
    with log.row("choice"):
        trial = Trial(preset, analysis)
        for number, numbers_of_round in enumerate(
            _search_rounds(preset, len(analysis.diffusion.major.lam), candidates)
        ):
            untried = [numbers for numbers in dict.fromkeys(numbers_of_round) if numbers not in candidates]
            if untried:
                message = f"choosing modes and phases, round {number + 1}: patterns to cut and solve: {len(untried)}"
                log.report("pattern", message)
            candidates.update({numbers: trial.candidate(*numbers) for numbers in untried})
    ranked = tuple(sorted(candidates.values(), key=_rank))
    refused = sum(bool(candidate.refused) for candidate in ranked)
    stiffest = ranked[0]
    if stiffest.refused:
        raise PatternError(
            f"none of {refused} combinations of modes and phases carries the loads; reason for the first combination: "
            f"{stiffest.refused}; set pattern.rim, increase pattern.keep or pattern.width.solid_fraction, or choose "
            "other frequencies"
        )
    log.note(
        "pattern",
        f"modes {stiffest.mode[0]} and {stiffest.mode[1]} with phases {stiffest.phase[0]:g} and {stiffest.phase[1]:g} "
        f"give the stiffest of {len(ranked)} tried designs, with about {stiffest.over_uncut:.3g} times the compliance "
        f"of the uncut sheet",
    )
    choice = Choice(ranked)
    if preset.pattern.width.rule == "stressed":
        return stressed_choice(preset, analysis, log, choice)
    return choice


def _rank(candidate: Candidate) -> tuple[bool, bool, float, ModesAndPhases]:
    soft = float(f"{candidate.compliance * candidate.kept:.3g}")
    return bool(candidate.refused), candidate.whole < CONNECTED_SHARE, soft, (candidate.mode, candidate.phase)


def _search_rounds(
    preset: Preset, computed: int, candidates: dict[ModesAndPhases, Candidate]
) -> Iterator[Iterable[ModesAndPhases]]:
    families = (preset.pattern.major, preset.pattern.minor)
    is_drawn = [name in preset.pattern.family_names for name in FAMILIES]
    every = range(1, min(4, computed) + 1)  # up to four modes, as in the paper
    open_mode = [is_drawn[k] and families[k].mode == AUTO for k in (0, 1)]
    major, minor = (every if open_mode[k] else (families[k].number,) for k in (0, 1))
    open_phase = [is_drawn[k] and families[k].phase == AUTO for k in (0, 1)]
    fixed_phases = (families[0].shift, families[1].shift)
    open_modes = sum(open_mode)
    first_phases = partial(_first_phases, open_phase=open_phase, fixed_phases=fixed_phases, open_modes=open_modes)
    yield [(mode, phase) for mode in product(major, minor) for phase in first_phases(mode)]
    if not any(open_phase):
        return
    for count, step, moves in ROUNDS:
        leading: dict[tuple[int, int], Candidate] = {}
        for candidate in sorted(candidates.values(), key=_rank):
            leading.setdefault(candidate.mode, candidate)
        finalists = list(leading.values())[:count]
        if count > 1:  # the phases matter most for the modes with the lowest numbers
            finalists = list(dict.fromkeys([*finalists[:-1], leading[min(leading)]]))
        yield [
            (finalist.mode, _moved_phase(finalist.phase, (a * open_phase[0], b * open_phase[1]), step))
            for finalist in finalists
            for a, b in moves
        ]


def _first_phases(
    mode: tuple[int, int], open_phase: list[bool], fixed_phases: tuple[float, float], open_modes: int
) -> list[tuple[float, float]]:
    if open_modes == 2:
        grid = [(p, p) for p in (START if 1 in mode else START[:1])]
    else:
        grid = [(p, q) for p in GRID[open_modes] for q in GRID[open_modes]]
    phases = ((p if open_phase[0] else fixed_phases[0], q if open_phase[1] else fixed_phases[1]) for p, q in grid)
    return list(dict.fromkeys(phases))


def _moved_phase(phase: tuple[float, float], move: tuple[int, int], step: float) -> tuple[float, float]:
    p, q = ((x + direction * step) % 1 if direction else x for x, direction in zip(phase, move, strict=True))
    return p, q
