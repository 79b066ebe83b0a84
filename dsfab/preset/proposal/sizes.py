"""Proposed sizes for a surface: spacing of members, edge length of the mesh, thickness, widths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, face_angles
from dsfab.preset.proposal.shape import is_figure
from dsfab.surface import Surface

MEMBERS = 16  # Number of members across the shorter side of the plan.
COARSEST, FINEST = 2.5, 3.5  # Fewest and most mesh edges per spacing; too few edges give uneven stripes.
TRIANGLES = 6500  # Usual number of triangles, so that CAD programs can open the solid.
SLENDER = {"steel": 200, "timber": 100}  # Ratio of span to thickness, by material.
STEEL = ("S235", "S275", "S355", "S460", "aluminium 6082")
LONG = 1.8
"""Smallest ratio of the span to the shorter side of the plan for which the span governs the thickness. A square roof on
its corners has a ratio of 1.41."""
THICKEST = 1 / 5  # Largest thickness of a surface with a long span, divided by the spacing of its members.
MODEL = 3.0  # Surfaces smaller than this (m) count as printed models.


@dataclass(frozen=True)
class Sizes:
    """Proposed lengths in metres. edge : edge length of the mesh; 0 if the user's mesh does not change.
    own     : mean edge length of the user's mesh.
    bridged : span between the supports if it is far longer than the shorter side of the plan, else 0."""

    span: float
    spacing: float
    edge: float
    thickness: float
    material: str
    own: float
    bridged: float = 0.0

    @property
    def coarse(self) -> bool:
        """True if the edges of the user's mesh are too long for a smooth surface."""
        return self.edge < 0.7 * self.own

    @property
    def ratio(self) -> int:
        """Ratio of span to thickness."""
        return round(self.bridged / self.thickness) if self.bridged else slenderness(self.material)

    def with_feet(self, surface: Surface, feet: Sequence[Floats], roof: bool = False) -> "Sizes":
        """Return the sizes for a surface on supports. feet : points (k, 3) of each support."""
        if is_figure(surface) or not feet:
            return self
        distance, _ = cKDTree(np.concatenate(feet)[:, :2]).query(surface.V[:, :2])
        span = 2 * float(np.max(distance))
        if roof and LONG * span < self.span:
            return sizes(surface, self.material, span)
        if span <= LONG * self.span:
            return self
        thick = 1.1 * float(np.sqrt(self.span * span)) / slenderness(self.material)
        apart = max(self.spacing, two_digits(min(thick / THICKEST, self.span / 4.5)))
        thick = max(self.thickness, _stock(min(thick, THICKEST * apart)))
        return replace(self, spacing=apart, edge=_edge(surface, apart), thickness=thick, bridged=span)

    @property
    def rim(self) -> float:
        """Width of the band of material along free edges."""
        return two_digits(0.22 * self.spacing)

    @property
    def keep(self) -> float:
        """Distance from supports up to which the whole surface stays material."""
        return two_digits(0.35 * self.spacing)

    @property
    def fillet(self) -> float:
        """Radius of the corners of openings."""
        return two_digits(0.06 * self.spacing)


def sizes(surface: Surface, material: str | None = None, span: float = 0.0) -> Sizes:
    """Return the proposed sizes for a surface with z up.
    material : default: GL24h, or PLA for a printed model.    span : metres; 0 for the plan's shorter side."""
    figure = is_figure(surface)
    span = span or shorter_side(surface)
    square = float(np.sqrt(surface.area))
    cells = 550  # with more openings, a viewer sees no pattern
    spacing = two_digits(max(square / 18 if figure else span / MEMBERS, square / np.sqrt(cells)))
    material = material or ("PLA" if surface.size < MODEL else "GL24h")
    thick = spacing / 8 if figure else span / slenderness(material)
    return Sizes(span, spacing, _edge(surface, spacing), _stock(thick), material, surface.mean_edge)


def shorter_side(surface: Surface) -> float:
    """Return the length (m) of the shorter side of a surface in plan, or of a wall in elevation."""
    across, face = float(np.ptp(surface.V, axis=0)[:2].min()), float(np.sort(np.ptp(surface.V, axis=0))[1])
    return face if across < face / 4 else across


def slenderness(material: str) -> int:
    return SLENDER["steel" if material in STEEL else "timber"]


def two_digits(x: float) -> float:
    return float(f"{x:.2g}")


def _stock(thickness: float) -> float:
    step = 5e-3 if thickness > 0.02 else 1e-3 if thickness > 2e-3 else 1e-4
    return round(max(round(thickness / step), 1) * step, 6)


def _edge(surface: Surface, spacing: float) -> float:
    even = np.sqrt(surface.area / (np.sqrt(3) / 4 * TRIANGLES))
    edge = two_digits(np.clip(even, spacing / FINEST, spacing / COARSEST))
    return 0.0 if _is_good(surface, edge) else edge


def _is_good(surface: Surface, edge: float) -> bool:
    lengths = surface.edge_lengths
    fits = 0.5 * edge <= lengths.mean() <= 1.2 * edge and lengths.max() <= 2 * edge
    return bool(fits and np.degrees(face_angles(surface.V, surface.F).min()) >= 15.0)
