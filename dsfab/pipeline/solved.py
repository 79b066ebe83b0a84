"""`SolvedSheet`: the sheet as its own elements solve it, before it is asked for more than where the stress runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats
from dsfab.pipeline.loadings import Loading, loadings
from dsfab.pipeline.log import Log
from dsfab.preset import Preset
from dsfab.statics import (
    Elements,
    Equilibrium,
    Factor,
    FactorOf,
    SheetModel,
    equilibria,
    flat_axis,
    sheet_stiffness,
    stress,
)
from dsfab.surface import Surface


@dataclass(frozen=True, eq=False)
class SolvedSheet:
    """All loadings of a preset from one factorisation, then their combinations, which are sums.

    plane     : whether it was solved in its plane, without bending.
    made      : (N, N) the stiffness, N/m, by the elements that solved it.
    factor_of : what made the factor, and keeps it where it is needed again.
    answers   : under each loading.    sigma : (m, 3, 3) Pa, of the middle surface, under each.
    """

    acting: Sequence[Loading]
    plane: bool
    made: Mapping[Elements, csr_array]
    factor_of: FactorOf
    answers: Sequence[Equilibrium]
    sigma: Sequence[Floats]


def solved_sheet(preset: Preset, surface: Surface, log: Log, acting: Sequence[Loading] = ()) -> SolvedSheet:
    """The sheet of [statics] under its loads, or under those that are given. Raises StaticsError for mechanisms."""
    sheet = preset.statics
    if log.progress:
        log.progress("statics", f"solving {surface.n:,} vertices, {surface.m:,} triangles")
    acting = acting or loadings(preset, surface)
    solved = [loading for loading in acting if loading.factors is None]
    loads, spreads = [loading.load for loading in solved], [loading.spread for loading in solved]
    plane = flat_axis(surface, *loads) is not None
    elements = sheet.elements.in_plane if plane else sheet.elements
    K = sheet_stiffness(SheetModel(surface, sheet.elastic, sheet.thickness, sheet.law), elements, log.row)
    factor_of = _timed(sheet.ask.factor_of(sheet.elements), log)
    with log.row("statics"):
        sums = [[ld.factors.get(case.name, 0.0) for case in solved] for ld in acting if ld.factors is not None]
        found = equilibria(surface, K, loads, elements, spreads=spreads, sums=sums, factor_of=factor_of)
    with log.row("stress"):
        sigma = [stress(surface, sheet.elastic, a.u, sheet.law, a.bubbles) for a in found]
    return SolvedSheet(acting, plane, {elements: K}, factor_of, found, sigma)


def _timed(factor_of: FactorOf, log: Log) -> FactorOf:
    """The same, its seconds in the row `factor`: they are part of the row of whoever asks."""

    def timed(surface: Surface, K: csr_array, held: Bools) -> Factor:
        with log.row("factor"):
            return factor_of(surface, K, held)

    return timed
