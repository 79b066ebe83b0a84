"""`SheetModel`: the sheet that is solved; and `SheetMaterial`: what it is made of."""

from dataclasses import dataclass, replace

from dsfab.arrays import Bools
from dsfab.statics.material import Law, Material
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface


@dataclass(frozen=True, eq=False)
class SheetModel:
    """A thin elastic sheet.

    surface   : its middle surface.            thickness : metres.            law : see `Material.membrane`.
    clamped   : (e,) edges that may not turn about themselves, besides those of a load's supports; None without any.
    """

    surface: Surface
    material: Material
    thickness: float
    law: Law = "plane_stress"
    clamped: Bools | None = None

    def held(self, load: LoadCase) -> LoadCase:
        """The load on this sheet, with all edges that may not turn."""
        if self.clamped is None:
            return load
        return replace(load, clamped=self.clamped | load.clamped if len(load.clamped) else self.clamped)


@dataclass(frozen=True)
class SheetMaterial:
    """What a sheet is made of: material, thickness in metres, and law."""

    material: Material
    thickness: float
    law: Law = "plane_stress"

    def on(self, surface: Surface) -> SheetModel:
        """A sheet of it."""
        return SheetModel(surface, self.material, self.thickness, self.law)
