"""`densities`: the material of a sheet where it works most, by SIMP and optimality criteria."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats, lock
from dsfab.errors import StaticsError
from dsfab.statics import FaceStiffness, SheetModel, optimality_step
from dsfab.study.simp.filtering import face_filter, filtered_sensitivity
from dsfab.surface import LoadCase, Surface

GREY = 0.1
"""Densities nearer than this to 0 or 1 count as void or material."""


@dataclass(frozen=True)
class Simp:
    """How it is done.

    radius       : of the filter, metres: members get about this wide; 0: see `filter_radius`.
    iterations   : at most with each penalisation; it goes on earlier when no density changes by more than `change`.
    penalisation : p of the stiffness void + x^p (1 - void) of a face of density x [Bendsoe, Sigmund 1999], in the end.
    steps        : in which p rises from 1, where the problem has one answer wherever it starts, to that: which of many
                   answers is found then depends little on mesh and start [Petersson and Sigmund 1998]. 0: p stays.
    void         : stiffness of an empty face over that of a full one.     move : largest change of a density in a step.

    Raises StaticsError for values that make no sense.
    """

    radius: float = 0.0
    iterations: int = 30
    penalisation: float = 3.0
    steps: int = 4
    void: float = 1e-9
    move: float = 0.2
    change: float = 0.01

    def __post_init__(self) -> None:
        good = self.radius >= 0 and self.iterations >= 1 and self.penalisation >= 1 and self.change >= 0
        good = good and self.steps >= 0
        if not (good and 0 < self.void < 1 and 0 < self.move <= 1):
            raise StaticsError(
                f"{self}: SIMP needs a radius and steps of 0 or more, at least one iteration, a penalisation of 1 or "
                "more, and void and move between 0 and 1"
            )

    def filter_radius(self, surface: Surface) -> float:
        """Metres: as asked, or 3 % of the root of the area, but no less than 1.1 edges, which the filter needs."""
        return self.radius or max(0.03 * float(np.sqrt(surface.area)), 1.1 * surface.mean_edge)

    @property
    def penalisations(self) -> Floats:
        """(steps + 1,) in their order."""
        return np.linspace(1.0 if self.steps else self.penalisation, self.penalisation, self.steps + 1)

    def stiffness(self, density: Floats) -> Floats:
        """(m,) of faces, over that of full ones."""
        return np.asarray(self.void + (1 - self.void) * density**self.penalisation)

    def slope(self, density: Floats) -> Floats:
        """(m,) its derivative by the density."""
        return np.asarray((1 - self.void) * self.penalisation * density ** (self.penalisation - 1))


@dataclass(frozen=True, eq=False)
class Densities:
    """What was found.

    density : (m,) 0 (void) to 1 (material).    history : (iterations,) compliance before each step, joules, of sheets
              with densities in between: not that of a structure that can be built.
    seconds, cpu : of the clock and of the processor.
    """

    density: Floats
    history: Floats
    seconds: float
    cpu: float

    def __post_init__(self) -> None:
        lock(self, "density", np.float64, (None,))
        lock(self, "history", np.float64, (None,))

    @property
    def compliance(self) -> float:
        """Joules, of the last densities but one, as the method itself counts it."""
        return float(self.history[-1])

    def grey(self, surface: Surface) -> float:
        """The share of the area whose density is in between, from 0.1 to 0.9: neither void nor material.

        Large where both principal stresses are as large and of opposite sign, as on a sphere pressed at its pole: there
        an even grey is stable whatever the start, for what a rib gains along itself it loses across.
        """
        between = (self.density > GREY) & (self.density < 1 - GREY)
        return float(surface.areas @ between) / surface.area


def densities(
    sheet: SheetModel,
    loads: Mapping[str, LoadCase],
    area: float,
    solid: Bools | None = None,
    weights: Mapping[str, float] | None = None,
    ask: Simp | None = None,
) -> Densities:
    """Densities of the faces with the least compliance for sum (density x face area) = `area`, square metres.

    Constant strain and mid-edge bending; a flat sheet loaded in its plane does not bend. A density scales the stiffness
    of its face, in its plane and out of it alike. Sensitivities are filtered, densities follow optimality criteria as
    in top88 [Andreassen et al. 2011], whose analysis of the matrix is done once here.

    solid   : (m,) faces that stay material.     weights : of the loads' compliances in the sum; 1 each when left out.

    Raises StaticsError when the sheet is not held, or when `area` is less than the solid faces have.
    """
    ask, surface = ask or Simp(), sheet.surface
    solid = np.zeros(surface.m, dtype=bool) if solid is None else solid
    share = _start(surface, area, solid)
    clock, cpu = time.perf_counter(), time.process_time()
    K = FaceStiffness.of(sheet, list(loads.values()))
    H = face_filter(surface, ask.filter_radius(surface))
    many = np.array([1.0 if weights is None else weights[name] for name in loads])
    x, factor, history = np.where(solid, 1.0, share), None, []
    for p in ask.penalisations:
        now = replace(ask, penalisation=float(p))
        for _ in range(ask.iterations):
            factor = K.factor(now.stiffness(x), factor)
            energy = K.energies(factor(K.force)) @ many
            history.append(float(now.stiffness(x) @ energy))
            gain = filtered_sensitivity(H, x, now.slope(x) * energy / surface.areas)
            new = optimality_step(x, gain, surface.areas, area, solid, ask.move)
            step, x = np.abs(new - x).max(), new
            if step < ask.change:
                break
    return Densities(x, np.array(history), time.perf_counter() - clock, time.process_time() - cpu)


def _start(surface: Surface, area: float, solid: Bools) -> float:
    """The density of all other faces to begin with."""
    given = float(surface.areas[solid].sum())
    if not given < area < surface.area:
        raise StaticsError(
            f"SIMP is to use {area:.4g} m2 of a surface of {surface.area:.4g} m2, of which {given:.4g} m2 are kept "
            "anyway; ask for an area between these, or set a smaller pattern.keep or pattern.rim"
        )
    return (area - given) / (surface.area - given)
