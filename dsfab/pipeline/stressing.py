"""The width rule `stressed`: cut, solve, widen the stripes where they work most, and do it again.

The judge is the cut mesh, as for modes that are `auto`: on the uncut one, where a face that is half empty is half as
stiff, gaps of one element carry loads, and the widths follow forces that are not there.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Floats
from dsfab.errors import DsfabError
from dsfab.pattern import Drawable, evened
from dsfab.pipeline.log import Log
from dsfab.pipeline.patterns import WidthSearch, solved_layers, striped_families
from dsfab.pipeline.trial import SHARE_TOLERANCE, Trial
from dsfab.preset import Preset
from dsfab.results import Candidate, Choice, EvenStripes, StressedSurface
from dsfab.slicing import Sheet

LEAST, MOST = 0.01, 0.55
"""Half-widths, in periods, that stripes shrink and grow to: what has vanished may come back, what is full may open."""

MISSED = 0.1
"""Of the share that a step misses, so much at most is made up for in the next."""

FINALISTS = 3
"""Pairs of modes of which the best phases are evened, besides the lowest pair, where modes or phases are `auto`."""


class Step(NamedTuple):
    """Widths that were tried: what they were worth, joules times share of the surface, and what to try next."""

    worth: float
    grading: Floats
    after: Floats


def stressed_step(preset: Preset, given: StressedSurface, log: Log, even: EvenStripes | None = None) -> Floats | None:
    """(n, 2) relative half-widths of both families: of pattern.width.steps tries, the best.

    Best is the least compliance per share of material, by constant strain and mid-edge bending on the cut mesh. None
    where not even the first sheet carries the loads: then the widths are those of the rule `graded`.
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
    """The choice with those modes and phases first that are the stiffest when their widths even out the stress.

    Evened are the best of a few pairs of modes. How stiff they are before says little: on the cantilever at 30 % of the
    material modes 2 and 2 begin with 4.12 times the uncut plate's compliance and end with 3.86, modes 1 and 1 begin
    with 4.40 and end with 3.01.
    """
    leading: dict[tuple[int, int], Candidate] = {}
    for candidate in choice.candidates:
        leading.setdefault(candidate.mode, candidate)
    carry = {mode: candidate for mode, candidate in leading.items() if not candidate.refused}
    finalists = list(carry.values())[:FINALISTS]
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
    """Widths that were tried in turn, as many as pattern.width.steps or as carry the loads."""
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
    """Tries widths with given modes and phases."""

    def __init__(self, preset: Preset, given: StressedSurface, even: EvenStripes | None = None) -> None:
        super().__init__(preset, given, even)
        surface = given.surface
        self.families = striped_families(preset, given, even=even)
        slopes = np.stack([family.density for family in self.families])
        self.spacing = float(slopes.shape[0] * surface.area / (slopes @ surface.vertex_areas).sum())
        self.start = np.stack([family.stress for family in self.families], axis=1)
        self.factor = self.added = 0.0

    def step(self, grading: Floats) -> Step:
        """Cut and solve with half-widths `grading` (n, f); raises DsfabError for a sheet that does not carry the
        loads."""
        families = [family.stressed(g) for family, g in zip(self.families, grading.T, strict=True)]
        search = WidthSearch(self._share, SHARE_TOLERANCE, self.factor, added=self.added)
        layers, self.factor = solved_layers(self.preset, self.surface, self.kept, families, search)
        found = self.carrying(layers)
        ask = self.preset.pattern
        wanted = ask.width.solid_fraction
        if ask.forces == "optimal":  # points were counted with the ends that are taken off, which vary most here
            self.added = float(np.clip(self.added + found.kept - wanted, -MISSED, MISSED))
        names = np.array([layer.name for layer in layers])
        K = self.stiffness(found.sheet.surface, self.loads_on(found.sheet))
        energy = K.energies(K.factor(np.ones(found.sheet.surface.m))(K.force)) @ list(self.preset.followed.values())
        work, material = (self._by_family(found.sheet, names, x) for x in (energy, found.sheet.surface.areas))
        after = evened(self.surface, grading, work, material, self.spacing)
        if self.even is not None and self.even.symmetry is not None:
            after = self.even.symmetry.mean(after)
        return Step(float(energy.sum()) * found.kept, grading, self._within(families, after))

    def _by_family(self, sheet: Sheet, names: NDArray[np.str_], x: Floats) -> Floats:
        """(m, 2) sums of values x (m',) of cells over what each family, by the names of layers, has of each face."""
        sums = []
        for family in self.families:
            cells = np.flatnonzero(names[sheet.family] == family.name)
            sums.append(np.bincount(sheet.parent[cells], x[cells], self.surface.m))
        return np.stack(sums, axis=1).astype(np.float64)

    def _within(self, families: Sequence[Drawable], grading: Floats) -> Floats:
        """What widths are multiplied with stays such that they reach from LEAST to MOST."""
        full = np.array([self.factor * family.stripes.half_width for family in families])
        full = np.where(full > 0, full, 1.0)
        return np.asarray(np.clip(grading * full, LEAST, MOST) / full)
