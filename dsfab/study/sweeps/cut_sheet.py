"""What a sweep asks of the cut sheet of a design: how it carries, and the verdict on it; each worked out once."""

from dsfab.pipeline.design import Design
from dsfab.pipeline.handover import sheet_loads
from dsfab.statics import Aid, Equilibrium, Quantity, SheetModel, elements_of, solve_for
from dsfab.study.verdict import LoadedSurface, SheetMaterial, Verdict, check
from dsfab.surface import LoadCase


def loads_on(design: Design) -> dict[str, LoadCase]:
    """By name, the loads that the pattern follows, on the cut sheet; raises StaticsError where nothing carries them."""
    loads = {name: design.statics.cases[name].load for name in design.preset.followed}
    return sheet_loads(design.surface, design.slicing.cells.kept(), design.sheet, loads)


def cut_equilibria(design: Design, use: Quantity | Aid) -> dict[str, Equilibrium]:
    """By name, equilibria of a design's cut sheet under the loads that its pattern follows; worked out once for
    all uses of the same elements.

    Raises StaticsError when it does not carry them.
    """

    pair = elements_of(use)

    def solved() -> dict[str, Equilibrium]:
        made, sheet = design.preset.statics, design.sheet.surface
        return solve_for(SheetModel(sheet, made.elastic, made.thickness, made.law), loads_on(design), use)

    return design.once("slicing", f"carried by {pair}", solved)


def verdict(design: Design) -> Verdict:
    """The full verdict on a design's cut sheet under the loads that its pattern follows; worked out once."""

    def checked() -> Verdict:
        statics = design.preset.statics
        loads = {name: design.statics.cases[name].load for name in design.preset.followed}
        setting = LoadedSurface(design.surface, SheetMaterial(statics.elastic, statics.thickness, statics.law), loads)
        return check(setting, design.slicing.cells.kept())

    return design.once("slicing", "verdict", checked)
