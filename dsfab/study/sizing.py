"""Search for the thinnest available sheet for which the cut structure meets the targets of the section [sizing]."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from dsfab.core.errors import PatternError, SolidError, StaticsError
from dsfab.core.materials import STOCK
from dsfab.core.messages import length, load_factor, mass, table
from dsfab.design import Design, Log, Progress, checked_offsets, refusal, run, silent, surface_step
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.preset.proposal.sizes import sizes, two_digits
from dsfab.statics.thickness_basis import ACCURATE, ThicknessBasis
from dsfab.study.carrying import Carrying, CutStatics, carrying, cut_loads, use_and_movement
from dsfab.study.fabrication import spacing_changes

REACH, REACH_UP = 3.0, 6.0
"""Range of tried thicknesses: from the first guess divided by REACH to the first guess times REACH_UP."""
OWN_CUTS = 3  # Largest number of thicknesses that get a whole design after a quick draft.
SERIES = 1.15  # Ratio of successive thicknesses for a material without a stock.
MORE, MOST = 1.3, 0.75  # Factor that raises the share of the surface with material, and largest share.
MUCH_THINNER = 0.75  # After a failed cut, next thickness / last thickness is below this.
CLOSER = 0.75  # Factor on the spacing of members if a pattern with more material still misses the targets.


@dataclass(frozen=True)
class SizingTrial:
    """A tried thickness (m), and results for the cut sheet.
    share    : material area / surface area.               movement : largest displacement divided by the span.
    buckling : lowest buckling factor; inf if unknown.     utilisation : largest stress / strength, or None.
    excess   : result / limit for each target by name (limit / result for buckling); at most 1 if the target is met.
    is_final : True if the pattern was made for this thickness."""

    thickness: float
    share: float
    utilisation: float | None
    movement: float
    buckling: float
    mass: float
    excess: dict[str, float]
    is_final: bool = False

    @property
    def worst(self) -> float:
        return max(self.excess.values())

    @property
    def row(self) -> tuple[str, ...]:
        """Texts of the table row that describes this trial."""
        missed = ", ".join(name for name, value in self.excess.items() if value > 1)
        moved = f"span / {1 / self.movement:.0f}" if self.movement > 0 else "none"
        moved = moved if self.movement < 1 else "over its span"
        buckling = load_factor(self.buckling) if np.isfinite(self.buckling) else "-"
        remark = f"misses {missed}" if missed else "meets all" if self.utilisation else ""
        final = ", cut with it" if self.is_final else ""
        use = "-" if self.utilisation is None else f"{self.utilisation:.0%}"
        return (length(self.thickness), f"{self.share:.0%}", use, moved, buckling, mass(self.mass), remark + final)


@dataclass(frozen=True)
class SizingResult:
    """Trials of thicknesses for a design. The last trial has the chosen thickness.
    stock : text that says where the tried thicknesses come from.    changes : changed preset values, by key."""

    trials: tuple[SizingTrial, ...]
    stock: str
    changes: dict[str, Any]

    @property
    def fits(self) -> bool:
        """True if the design meets all targets."""
        return self.trials[-1].worst <= 1

    def lines(self, every: bool = False) -> Iterator[str]:
        """Yield a table of the trials, then lines with remarks.
        every : True to list all trials. False to list final designs and the most important draft."""
        thickness, final = self.trials[-1].thickness, {trial.thickness for trial in self.trials if trial.is_final}
        if every or self.changes or not self.fits:
            shown = {trial.thickness for trial in self.trials} if every else {thickness}
        else:
            thinner = {trial.thickness for trial in self.trials if trial.thickness < thickness}
            shown = {max(thinner, default=thickness)} - final
        rows = [trial.row for trial in self.trials if trial.is_final or trial.thickness in shown]
        yield table(("thickness", "material", "utilisation", "movement", "buckling", "mass", ""), rows)
        if every:
            yield f"thicknesses: {self.stock}"
        if self.changes:
            values = ", ".join(f"{key} = {value:g}" for key, value in self.changes.items())
            yield f"no thickness meets the targets with the preset's pattern, so these keys were changed: {values}"
        if not self.fits:
            yield (
                f"no thickness meets the targets; a thickness of {length(thickness)} is nearest: add supports, give "
                "the surface more rise, or lower the targets in [sizing]"
            )

    def facts(self) -> dict[str, Any]:
        """Return the value of `sizing` in `design.json`: the trials in SI units, with None for unknown values."""

        def finite(values: dict[str, Any]) -> dict[str, Any]:
            return {key: None if value == float("inf") else value for key, value in values.items()}

        rows = [finite(asdict(trial)) | {"excess": finite(trial.excess)} for trial in self.trials]
        return {"fits": self.fits, "stock": self.stock, "changes": self.changes, "trials": rows}


def sizing_result(design: Design) -> SizingResult | None:
    """Return the trials from which dsfab chose the thickness of a design; None if the preset sets the thickness."""
    result: SizingResult | None = design.existing_result("sizing")
    return result


def run_sized(preset: Preset, progress: Progress = silent) -> Design:
    """Return the complete design of a preset. If the thickness is auto, `sized_design` chooses the thickness."""
    return run(preset, progress) if preset.statics.is_sized else sized_design(preset, progress).until("thickening")


def sized_preset(preset: Preset, progress: Progress = silent) -> Preset:
    """Return the preset. If its thickness is auto, replace it by the thickness that `sized_design` chooses."""
    return preset if preset.statics.is_sized else sized_design(preset, progress).preset


def guessed_preset(preset: Preset) -> Preset:
    """Return the preset. If its thickness is auto, replace it by a rough guess; this is enough for quick drawings."""
    if preset.statics.is_sized:
        return preset
    guess = preset.sizing.first
    if not guess:
        surface = surface_step(preset.with_thickness(1.0), Log(None))
        guess = sizes(surface, preset.statics.material).thickness
    return preset.with_thickness(min(stock_thicknesses(preset, guess)[0], key=lambda t: abs(np.log(t / guess))))


def sized_design(preset: Preset, progress: Progress = silent) -> Design:
    """Return the design, up to slicing, with the thinnest sheet that meets the targets of [sizing].
    One solve of a rough draft gives approximate results for similar thicknesses. Then the whole design is made with
    the thickness that comes nearest to the targets. It is also made with the next thicknesses if they may be better.
    If no thickness meets the targets, the pattern gets more material, then also a smaller spacing. If this does not
    help, the result is the design that comes nearest to the targets.
    Raises PresetError for a preset without a strength, and the DsfabError of a stage that fails."""
    preset.statics.require_strength()
    guess = guessed_preset(preset)
    design, trials = Design.from_preset(guess, None, progress), list[SizingTrial]()
    stock, source = _possible_thicknesses(design, *stock_thicknesses(preset, guess.statics.thickness))
    design = _standing_design(design, stock[-1], progress)
    thickness = design.preset.statics.thickness
    candidates, ladder = list[tuple[SizingTrial, dict[str, Any]]](), list[dict[str, Any]]([{}])
    for changes in ladder:
        changed = with_overrides(preset, changes)
        design = Design.from_preset(changed.with_thickness(thickness), design, progress)
        try:
            rows = _nearest_trials(design, stock, progress)
            thickness = rows.trials[min(rows.thinnest_sufficient(), len(rows.trials) - 1)].thickness
            cuts, chosen = _own_cuts(design, changed, rows, progress)
        except (PatternError, StaticsError):
            if changes and changes == ladder[-1] and not trials:
                raise
            ladder += [] if changes else further_changes(design, thickness)
            continue
        if chosen:
            return _with_result(chosen, SizingResult((*trials, *rows.trials, *cuts), source, changes))
        ladder += [] if changes else further_changes(design, thickness)
        judged = [rows.full_trial(k) for k in range(len(rows.trials))]
        trials += [*judged, *cuts]
        cut = {trial.thickness for trial in cuts}
        candidates += [(row, changes) for row in (*judged, *cuts) if row.is_final or row.thickness not in cut]
    while True:
        row, changes = min(candidates, key=lambda candidate: candidate[0].worst)
        design = Design.from_preset(with_overrides(preset, changes).with_thickness(row.thickness), design, progress)
        try:
            trial = _trial(design, carrying(design), row)
        except (PatternError, StaticsError):
            # thick sheets widen members and corners, which fills the openings: try much thinner sheets
            candidates = [(draft, keys) for draft, keys in candidates if draft.thickness < MUCH_THINNER * row.thickness]
            if not candidates:
                raise
            continue
        if row.is_final:
            trials.remove(row)  # the table shows this design once, as its last row
        return _with_result(design, SizingResult((*trials, trial), source, changes))


def _possible_thicknesses(design: Design, stock: Sequence[float], source: str) -> tuple[Sequence[float], str]:
    """Return the thicknesses (m) in `stock` for which the surface does not bend too sharply.
    Return also the text `source`, extended by the excluded thicknesses. Raises SolidError if all are excluded."""
    possible = list[float]()
    for thickness in stock:
        with suppress(SolidError):
            checked_offsets(design.preset.with_thickness(thickness), design.surface)
            possible.append(thickness)
    if not possible:
        checked_offsets(design.preset.with_thickness(stock[0]), design.surface)
    if refused := [length(thickness) for thickness in stock if thickness not in possible]:
        source += f"; the thicknesses {', '.join(refused)} are left out, because the surface bends too sharply for them"
    return possible, source


def _standing_design(design: Design, thickest: float, progress: Progress) -> Design:
    """Return the design with a thickness of at most `thickest` (m).
    If the uncut sheet still moves too much, the design gets the thickness `thickest`."""
    preset = design.preset.with_thickness(min(design.preset.statics.thickness, thickest))
    design = Design.from_preset(preset, design, progress)
    is_refused = bool(refusal(preset, design.statics))
    return Design.from_preset(preset.with_thickness(thickest), design, progress) if is_refused else design


def _nearest_trials(design: Design, stock: Sequence[float], progress: Progress) -> "_StockTrials":
    """Make a rough draft of the design, and return its results for all thicknesses in `stock` near its thickness.
    If other thicknesses may be better, make another draft. Raises the first draft's PatternError or StaticsError."""
    thickness, solved, rows = design.preset.statics.thickness, set[float](), None
    while True:
        solved.add(thickness)
        tried = [t for t in stock if 1 / ACCURATE <= t / thickness <= ACCURATE]
        design = Design.from_preset(design.preset.with_thickness(thickness), design, progress)
        try:
            draft = _stock_trials(_draft(design), tried, progress)
        except (PatternError, StaticsError):
            if rows is None:
                raise
            return rows
        thinnest, count = draft.thinnest_sufficient(), len(tried)
        if rows is None or thinnest < count or rows.thinnest_sufficient() == len(rows.trials):
            rows = draft
        thinner, thicker = [t for t in stock if t < tried[0]], [t for t in stock if t > tried[-1]]
        if thinnest == 0 and thinner:
            thickness = tried[0] if tried[0] < thickness else thinner[-1]
        elif thicker and (thinnest == count or thinnest == count - 1 > 0):
            thickness = tried[-1] if tried[-1] > thickness else thicker[0]
        if thickness in solved:
            return rows


def _draft(design: Design) -> Design:
    """Return a rough draft of a design: approximate widths, corners without fillets, half as many triangles."""
    draft = Design.from_preset(design.preset.with_pattern(fillet=0.0), design)
    return draft.sketch(answers=True) or draft


def _own_cuts(
    design: Design, preset: Preset, rows: "_StockTrials", progress: Progress
) -> tuple[list[SizingTrial], Design | None]:
    """Make whole designs. The first has the thickness that comes nearest to the targets in `rows`, a draft's results.
    Return the trials, and the thinnest design that meets the targets (the last trial) or None.
    Raises PatternError or StaticsError if a design cannot be made before any design meets the targets."""
    trials, chosen, count = list[SizingTrial](), None, len(rows.trials)
    k = rows.thinnest_sufficient()
    if 0 < k < count and rows.full_trial(k - 1).worst * rows.full_trial(k).worst < 1:
        k -= 1
    while k < count and len(trials) < OWN_CUTS:
        row = rows.full_trial(k)
        design = Design.from_preset(preset.with_thickness(row.thickness), design, progress)
        try:
            trial = _trial(design, carrying(design), row)
        except (PatternError, StaticsError):
            if not chosen:
                raise
            break
        if trial.worst > 1:
            trials.insert(0, trial)
            k = count if chosen else k + 1
            continue
        thinner_failed = bool(trials) and not chosen
        trials, chosen = [*trials, trial], design
        ratios = {name: trial.excess[name] / value if value else 1.0 for name, value in row.excess.items()}
        k -= 1
        if thinner_failed or k < 0 or max(rows.full_trial(k).excess[name] * r for name, r in ratios.items()) > 1:
            break
    return trials, chosen


def _with_result(design: Design, result: SizingResult) -> Design:
    design.cached_result("slicing", "sizing", lambda: result)
    return design


def stock_thicknesses(preset: Preset, guess: float) -> tuple[Sequence[float], str]:
    """Return the thicknesses (m) to try, ascending, and a text about their source. guess : estimated thickness (m)."""
    if preset.sizing.thicknesses:
        return sorted(preset.sizing.thicknesses), "from the list sizing.thicknesses of the preset"
    stock = STOCK.get(preset.statics.material or "")
    if stock is None:
        down, up = (int(np.log(reach) / np.log(SERIES)) for reach in (REACH, REACH_UP))
        series = [two_digits(guess * SERIES**k) for k in range(-down, up + 1)]
        return series, "in steps of 15 %, because dsfab has no list of thicknesses for statics.material"
    within_reach = [t for t in stock.metres if 1 / REACH <= t / guess <= REACH_UP]
    source = f"{preset.statics.material}, {stock.source}"
    return within_reach or [min(stock.metres, key=lambda t: abs(t - guess))], source


def further_changes(design: Design, thickness: float) -> list[dict[str, Any]]:
    """Return the changes of preset values to try in turn: more material, then also a smaller spacing.
    If members as wide as `thickness` (m) leave too small openings, all changes have a larger spacing instead."""
    width, wider = design.preset.pattern.width, dict[str, Any]()
    if width.solid_fraction:
        wider["pattern.width.solid_fraction"] = two_digits(min(MORE * width.solid_fraction, MOST))
    elif width.member:
        wider["pattern.width.member"] = two_digits(MORE * width.member)
    room = spacing_for_width(design, thickness)
    if room > 1:
        return [roomy := spacing_changes(design, room), *([wider | roomy] if wider else [])]
    return [*([wider] if wider else []), wider | spacing_changes(design, CLOSER)]


def spacing_for_width(design: Design, width: float) -> float:
    """Return the factor on the spacing for which members of a width (m) cover the requested part of the surface.
    One family of members with the spacing s covers the fraction width / s; two cover 1 - (1 - width / s)^2."""
    pattern, surface = design.preset.pattern, design.surface
    if not pattern.width.solid_fraction:
        return width / pattern.width.member if pattern.width.member else 0.0
    covered = pattern.width.solid_fraction
    share = covered if len(pattern.drawn_families) == 1 else 1 - np.sqrt(1 - covered)
    spacing = min(family.distance(surface.area, surface.mean_edge) for family in pattern.drawn_families)
    return float(width / share / spacing)


@dataclass
class _StockTrials:
    """Trials of one cut sheet that is solved with each thickness of a list."""

    design: Design
    basis: ThicknessBasis
    trials: list[SizingTrial] = field(default_factory=list)

    def thinnest_sufficient(self) -> int:
        """Return the index of the thinnest trial that meets the targets; the number of trials if no trial does."""
        count = len(self.trials)
        start = next((k for k, row in enumerate(self.trials) if row.worst <= 1), count)
        return bisect_left(range(count), True, lo=start, key=lambda k: self.full_trial(k).worst <= 1)

    def full_trial(self, k: int) -> SizingTrial:
        """Return trial number k with its utilisation. The utilisation takes longest; the first call computes it."""
        row = self.trials[k]
        if row.utilisation is None:
            outcome = use_and_movement(self.statics(row.thickness))
            self.trials[k] = _trial(self.design, replace(outcome, buckling=row.buckling))
        return self.trials[k]

    def statics(self, t: float) -> CutStatics:
        return CutStatics(self.design, t, self.basis.loads_at(t), self.basis.answers(t))


def _stock_trials(design: Design, stock: Sequence[float], progress: Progress) -> _StockTrials:
    """Return a trial for each thickness in `stock`, without its utilisation. Raises StaticsError if a solve fails."""
    progress("sizing", f"solving a draft of the cut sheet for {len(stock)} thicknesses")
    loads = cut_loads(design, design.preset.statics.thickness)
    model = design.sheet_with_ribs(design.preset.statics.thickness)
    cases = design.preset.judged_in("ULS", loads)
    rows = _StockTrials(design, ThicknessBasis.from_sheet(model, loads, cases))
    for t in stock:
        outcome, factors = use_and_movement(rows.statics(t), use=False), rows.basis.buckling_factors(t)
        rows.trials.append(_trial(design, replace(outcome, buckling=min(factors[name] for name in cases))))
    return rows


def _trial(design: Design, outcome: Carrying, row: SizingTrial | None = None) -> SizingTrial:
    """Return a solved structure's trial. row : earlier trial, for a missing buckling factor; None for a draft."""
    targets = design.preset.sizing
    use = outcome.use.value if outcome.use else float("inf") if row else None  # None: utilisation not yet computed
    movement = outcome.movement.share if outcome.movement else float("inf")
    factor = outcome.buckling or (row.buckling if row else float("inf"))
    excess: dict[str, float] = {} if use is None else {"utilisation": use / targets.utilisation}
    excess |= {"movement": movement * targets.movement, "buckling": targets.buckling / factor}
    share = design.sheet.surface.area / design.surface.area
    return SizingTrial(outcome.thickness, share, use, movement, factor, outcome.mass, excess, row is not None)
