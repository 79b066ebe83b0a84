"""An elastic, isotropic material, and the sheet that is solved."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import StaticsError
from dsfab.surface.loads.load_case import LoadCase
from dsfab.surface.mesh import Surface

Law = Literal["plane_stress", "stvk"]


@dataclass(frozen=True)
class Material:
    """Young's modulus (Pa), Poisson's ratio and density (kg/m^3) of a linear elastic, isotropic solid.
    Raises StaticsError unless young > 0, -1 < poisson < 0.5 and density >= 0."""

    young: float
    poisson: float
    density: float = 0.0

    def __post_init__(self) -> None:
        if not (self.young > 0 and np.isfinite(self.young)):
            raise StaticsError(f"young = {self.young} Pa must be positive")
        if not -1 < self.poisson < 0.5:
            raise StaticsError(f"poisson = {self.poisson} must lie between -1 and 0.5 (most solids: 0.2 to 0.4)")
        if not (self.density >= 0 and np.isfinite(self.density)):
            raise StaticsError(f"density = {self.density} kg/m3 must not be negative")

    def membrane(self, law: Law) -> Floats:
        """Return the matrix (3, 3), Pa, that maps in-plane strains (xx, yy, 2 xy) to stresses (xx, yy, xy).
        `plane_stress`: the thickness is free to change.
        `stvk`: linearised St. Venant-Kirchhoff law with constant thickness."""
        mu = self.young / (2 * (1 + self.poisson))
        lam = self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))
        if law == "plane_stress":
            lam = 2 * lam * mu / (lam + 2 * mu)
        return np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, mu]])

    def bending_stiffness(self, thickness: float) -> float:
        """Return the bending stiffness D = E h^3 / (12 (1 - nu^2)), N m."""
        return self.young * thickness**3 / (12 * (1 - self.poisson**2))

    def bending(self, thickness: float) -> Floats:
        """Return the Kirchhoff plate's matrix (3, 3), N m, from curvatures (xx, yy, 2 xy) to moments per length."""
        nu = self.poisson
        return self.bending_stiffness(thickness) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])


@dataclass(frozen=True, eq=False)
class SheetModel:
    """A thin elastic sheet. surface : middle surface.    thickness : metres.
    clamped : (e,) mask of edges that cannot rotate. Supports may clamp further edges.
    carried : (n,) additional masses at the vertices that vibrate with the sheet, kg.
    rigidity : (m, 3, 3) bending stiffness of each face, N m, in its frame; None for `Material.bending` everywhere."""

    surface: Surface
    material: Material
    thickness: float
    law: Law = "plane_stress"
    clamped: Bools | None = None
    carried: Floats | None = None
    rigidity: Floats | None = None

    @property
    def bending(self) -> Floats:
        """Matrix from curvatures (xx, yy, 2 xy) to moments per length, N m: (3, 3), or `rigidity` (m, 3, 3)."""
        return self.material.bending(self.thickness) if self.rigidity is None else self.rigidity

    def with_clamped_edges(self, load: LoadCase) -> LoadCase:
        """Return a copy of the load case in which this sheet's clamped edges are also clamped."""
        if self.clamped is None:
            return load
        return replace(load, clamped=self.clamped | load.clamped if len(load.clamped) else self.clamped)


@dataclass(frozen=True)
class SheetMaterial:
    """Material, thickness (m) and material law (see `Material.membrane`) of a sheet."""

    material: Material
    thickness: float
    law: Law = "plane_stress"

    def model_for(self, surface: Surface) -> SheetModel:
        """Return the model of a sheet with the middle surface `surface`."""
        return SheetModel(surface, self.material, self.thickness, self.law)
