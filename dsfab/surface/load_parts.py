"""`LoadParts`: what a load case is made of, by what it acts on: points, the sheet's own weight, ribs, or a covering."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.arrays import Floats, lock
from dsfab.surface.climate import to_corners
from dsfab.surface.mesh import Surface

AREAS = ("weight", "bare", "covered")
"""The parts that are spread over faces."""


@dataclass(frozen=True, eq=False)
class LoadParts:
    """Forces at the vertices of a surface, and tractions on its faces; on the uncut surface all of a face is loaded.

    point   : (n, 3) newtons: forces and lines.
    weight  : (m, 3) Pa, of the sheet itself: where there is no material, there is none.
    bare    : (m, 3) Pa that act on material alone: snow and wind on an open lattice.
    covered : (m, 3) Pa that act on openings too, which something covers: glass, a membrane, boards.
    """

    point: Floats
    weight: Floats
    bare: Floats
    covered: Floats

    def __post_init__(self) -> None:
        lock(self, "point", np.float64, (None, 3))
        lock(self, "weight", np.float64, (None, 3))
        for name in AREAS[1:]:
            lock(self, name, np.float64, (len(self.weight), 3))

    @classmethod
    def total(cls, parts: Mapping[str, Self], factors: Mapping[str, float]) -> Self:
        """The sum of the named parts, each multiplied with its factor."""
        weight = {name: factors.get(name, 0.0) for name in parts}
        sums = (np.sum([f * getattr(parts[k], on) for k, f in weight.items()], axis=0) for on in ("point", *AREAS))
        return cls(*sums)

    @property
    def traction(self) -> Floats:
        """(m, 3) Pa of all that is spread."""
        return np.asarray(self.weight + self.bare + self.covered)

    def forces(self, surface: Surface) -> Floats:
        """(n, 3) newtons: a third of each face's force at each of its corners."""
        traction = self.traction
        return self.point + to_corners(surface, traction * surface.areas[:, None]) if traction.any() else self.point

    def on_share(self, weight: float | Floats = 1.0, bare: float | Floats = 1.0) -> Self:
        """With what acts on material multiplied by shares of it, one for all or (m,)."""
        shares = (np.asarray(share, dtype=np.float64).reshape(-1, 1) for share in (weight, bare))
        return replace(self, **{on: getattr(self, on) * share for on, share in zip(AREAS, shares, strict=False)})
