"""`Making`: a design whose last stages are made when somebody asks for them."""

from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

from dsfab.design import Design, Draft, SlicingResult, StaticsResult
from dsfab.pipeline import draft
from dsfab.pipeline.geometry import slicing_step, thickening_step
from dsfab.pipeline.handover import sheet_loads
from dsfab.pipeline.log import Log
from dsfab.preset import STAGES, Preset
from dsfab.slicing import Sheet
from dsfab.statics import Bending, Equilibrium, Membrane, solve_cases
from dsfab.study.verdict import Setting, Sheeting, Verdict, check
from dsfab.surface import LoadCase, Surface
from dsfab.thickening import Solid


@dataclass(frozen=True, eq=False)
class Making:
    """What a `Design` is, by the same names; slicing, solid and the cut sheet's equilibrium are made when asked for.

    A sweep that asks for areas never thickens a sheet. Each attribute raises the DsfabError of its stage.
    """

    draft: Draft

    @classmethod
    def of(cls, preset: Preset, old: "Making | None" = None) -> "Making":
        """The design of a preset, with every stage of `old` before the first section that differs."""
        made = cls(draft(preset, old=None if old is None else old.draft))
        if old is not None:
            start = preset.first_difference(old.preset) or "export"
            for stage, name in (("slicing", "slicing"), ("slicing", "carried"), ("thickening", "solid")):
                if name in vars(old) and STAGES.index(stage) < STAGES.index(start):
                    vars(made)[name] = vars(old)[name]
        return made

    @property
    def preset(self) -> Preset:
        return self.draft.preset

    @property
    def surface(self) -> Surface:
        return self.draft.surface

    @property
    def statics(self) -> StaticsResult:
        return self.draft.statics

    @property
    def load(self) -> LoadCase:
        return self.draft.load

    @cached_property
    def _log(self) -> Log:
        return Log(None, dict(self.draft.seconds), list(self.draft.notes))

    @cached_property
    def slicing(self) -> SlicingResult:
        made = self.draft
        return slicing_step(made.preset, made.surface, made.statics, made.pattern, self._log)

    @property
    def sheet(self) -> Sheet:
        return self.slicing.sheet

    @cached_property
    def solid(self) -> Solid:
        return thickening_step(self.preset, self.surface, self.slicing, self._log)

    @property
    def mass(self) -> float:
        """Mass of the solid, kg."""
        return self.solid.volume * self.preset.statics.density

    @cached_property
    def carried(self) -> dict[str, Equilibrium]:
        """How the cut sheet carries the loads, by the elements that compare well; made once for all who ask."""
        return carried(self)

    @cached_property
    def verdict(self) -> Verdict:
        """The full verdict on the cut sheet; made once for all who ask."""
        return verdict(self)

    @property
    def design(self) -> Design:
        """The whole design, solid and all."""
        made, solid = self.draft, self.solid
        seconds, notes = MappingProxyType(self._log.seconds), tuple(self._log.notes)
        return Design(
            made.preset,
            made.surface,
            made.statics,
            made.diffusion,
            made.pattern,
            self.slicing,
            solid,
            seconds,
            notes,
        )


def loads_on(made: Design | Making) -> dict[str, LoadCase]:
    """By name, the loads that the pattern follows, on the cut sheet; raises StaticsError where nothing carries them."""
    loads = {name: made.statics.cases[name].load for name in made.preset.followed}
    return sheet_loads(made.surface, made.slicing.cells.kept(), made.sheet, loads)


def carried(
    made: Design | Making, membrane: Membrane = "quadratic", bending: Bending = "midedge"
) -> dict[str, Equilibrium]:
    """By name, equilibria of a design's cut sheet under the loads that its pattern follows.

    Raises StaticsError when it does not carry them.
    """
    statics, sheet = made.preset.statics, made.sheet.surface
    return solve_cases(sheet, statics.material, loads_on(made), statics.thickness, statics.law, membrane, bending)


def verdict(made: Design | Making) -> Verdict:
    """The full verdict on a design's cut sheet under the loads that its pattern follows."""
    statics = made.preset.statics
    loads = {name: made.statics.cases[name].load for name in made.preset.followed}
    setting = Setting(made.surface, Sheeting(statics.material, statics.thickness, statics.law), loads)
    return check(setting, made.slicing.cells.kept())
