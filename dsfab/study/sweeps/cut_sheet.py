"""What a sweep asks of the cut sheet of a design: how it carries, and the verdict on it; each worked out once."""

from dsfab.pipeline.design import Design
from dsfab.statics import Aid, Equilibrium, Quantity, elements_of, solve_for
from dsfab.study.verdict import LoadedSurface, Verdict, check


def cut_equilibria(design: Design, use: Quantity | Aid) -> dict[str, Equilibrium]:
    """By name, equilibria of a design's cut sheet under the loads that its pattern follows; worked out once for
    all uses of the same elements.

    Raises StaticsError when it does not carry them.
    """

    def solved() -> dict[str, Equilibrium]:
        return solve_for(design.preset.statics.sheet().on(design.sheet.surface), design.cut_loads, use)

    return design.once("slicing", f"carried by {elements_of(use)}", solved)


def verdict(design: Design) -> Verdict:
    """The full verdict on a design's cut sheet under the loads that its pattern follows; worked out once."""

    def checked() -> Verdict:
        loads = design.statics.loads(design.preset.followed)
        setting = LoadedSurface(design.surface, design.preset.statics.sheet(), loads)
        return check(setting, design.slicing.cells.kept())

    return design.once("slicing", "verdict", checked)
