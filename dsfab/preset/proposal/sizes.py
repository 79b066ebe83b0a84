"""What is sensible for a surface of that size: spacing of members, edges of its mesh, thickness, widths."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, face_angles
from dsfab.surface import Surface

MEMBERS = 16
"""Members across the shorter side of the plan."""
MEMBERS_AROUND = 18
"""Members along the side of a square of the area of a closed surface."""
CELLS = 550
"""Openings between members at most, about: more are no pattern any more, and take long."""
COARSEST, FINEST = 2.5, 3.5
"""Edges of the mesh from one member to the next: fewer draw no clean stripes, more only take longer."""
TRIANGLES = 6500
"""Of the mesh, about, between these: its solid then has some 30 000 faces, which CAD programs still open."""
SLENDER = {"steel": 200, "timber": 100}
"""Span over thickness, by what a sheet is made of."""
STEEL = ("S235", "S275", "S355", "S460", "aluminium 6082")
LONG = 1.8
"""Spans of more than this many times the shorter side of the plan decide how thick a sheet is, in place of that side: a
square on its corners spans its diagonal, 1.41 sides."""
WALL = 0.25
"""A plan narrower than this share of the shorter side of what stands on it is a wall's: its width is nothing's span."""
THICKEST = 1 / 5
"""Of the spacing, that a long span makes a sheet thick at most: members are hardly wider than that."""
FEWEST = 4.5
"""Members across the shorter side of its plan, at least, where a long span asks for a thicker sheet and wider ones."""
HELD = 1.1
"""Times that thickness for a long span: such a sheet bends most at its ends, which are held."""
FIGURE = 4.0
"""A surface whose boundary, squared, is shorter than this many times its area is a figure and spans nothing."""
MODEL = 3.0
"""Metres; what is smaller is taken for a printed model."""
SHOWN_FACETS = 0.7
"""Edges shorter than this share of a mesh's own would show its facets: they follow the smooth surface through it."""
ROUND = 0.55
"""Radius over thickness: a little over a half, for an arc is drawn by chords."""
SHARPEST = 15.0
"""Degrees; a mesh with smaller angles is made anew."""


@dataclass(frozen=True)
class Sizes:
    """Lengths in metres. edge is 0 where the mesh is good as it is.

    own     : the mean edge of the mesh as it is given.
    span    : the shorter side of the plan, see `shorter_side`, or what a roof spans if that is far less.
    bridged : how far it spans between what it stands on, where that is far longer.
    """

    span: float
    spacing: float
    edge: float
    thickness: float
    material: str
    own: float
    bridged: float = 0.0

    @property
    def coarse(self) -> bool:
        """Whether the mesh's own edges are much longer than those that it gets."""
        return self.edge < SHOWN_FACETS * self.own

    @property
    def ratio(self) -> int:
        """Span over thickness."""
        return round(self.bridged / self.thickness) if self.bridged else slenderness(self.material)

    def on(self, surface: Surface, feet: Sequence[Floats], roof: bool = False) -> "Sizes":
        """The same for a surface on feet (k, 3): thicker where it spans far more than the shorter side of its plan, and
        of a roof that spans far less, as around a courtyard, those of its span.

        Its span is twice the way in plan from its furthest vertex to the feet, as far as a cantilever of that length,
        and it is a tenth thicker than the geometric mean of span and side asks for. Measured on uncut sheets of steel,
        how many times their load makes them buckle: a footbridge of 3 m x 30 m, 1.6 if it is as thick as its side asks
        for (15 mm), 8.5 at 40 mm, 11.6 at 80 mm, for it weighs more; a roof of 12 m x 24 m, 13 at 60 mm, 56 at 130 mm.
        Members are as far apart then as such a thickness asks for: an arched deck of timber, 3.7 m x 60 m, bore 144 %
        of its strength at 100 mm, a fifth of the spacing for its side, 106 % at 145 mm and 96 % at 160 mm.
        """
        if is_figure(surface) or not feet:
            return self
        way, _ = cKDTree(np.concatenate(feet)[:, :2]).query(surface.V[:, :2])
        span = 2 * float(np.max(way))
        if roof and LONG * span < self.span:
            return sizes(surface, self.material, span)
        if span <= LONG * self.span:
            return self
        thick = HELD * float(np.sqrt(self.span * span)) / slenderness(self.material)
        apart = max(self.spacing, two_digits(min(thick / THICKEST, self.span / FEWEST)))
        thick = max(self.thickness, _stock(min(thick, THICKEST * apart)))
        return replace(self, spacing=apart, edge=_edge(surface, apart), thickness=thick, bridged=span)

    @property
    def rim(self) -> float:
        """Width of the band along free edges."""
        return two_digits(0.22 * self.spacing)

    @property
    def keep(self) -> float:
        """How far sheet stays around supports."""
        return two_digits(0.35 * self.spacing)

    @property
    def fillet(self) -> float:
        """Radius of the corners of openings: their tips are then wider than the sheet is thick."""
        return two_digits(max(0.06 * self.spacing, ROUND * self.thickness))


def sizes(surface: Surface, material: str | None = None, span: float = 0.0) -> Sizes:
    """The sizes for a surface with z up; the material is GL24h, or PLA for a model, where none is named.

    span : metres; that of the shorter side of its plan where it is 0.
    """
    figure = is_figure(surface)
    span = span or shorter_side(surface)
    square = float(np.sqrt(surface.area))
    spacing = two_digits(max(square / MEMBERS_AROUND if figure else span / MEMBERS, square / np.sqrt(CELLS)))
    material = material or ("PLA" if surface.size < MODEL else "GL24h")
    thick = spacing / 8 if figure else span / slenderness(material)
    return Sizes(span, spacing, _edge(surface, spacing), _stock(thick), material, surface.mean_edge)


def shorter_side(surface: Surface) -> float:
    """The shorter side of its plan, metres; of a wall, which has hardly one, that of its face."""
    across, face = float(np.ptp(surface.V, axis=0)[:2].min()), float(np.sort(np.ptp(surface.V, axis=0))[1])
    return face if across < WALL * face else across


def slenderness(material: str) -> int:
    """Span over thickness, by what a sheet is made of."""
    return SLENDER["steel" if material in STEEL else "timber"]


def is_figure(surface: Surface) -> bool:
    """Whether it is closed, or nearly so: a head on its neck."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() ** 2 < FIGURE * surface.area)


def two_digits(x: float) -> float:
    """The number rounded to two digits."""
    return float(f"{x:.2g}")


def _stock(thickness: float) -> float:
    """A thickness to whole millimetres, thicker ones to five."""
    step = 5e-3 if thickness > 0.02 else 1e-3 if thickness > 2e-3 else 1e-4
    return round(max(round(thickness / step), 1) * step, 6)


def _edge(surface: Surface, spacing: float) -> float:
    """Edges for members so far apart, metres; 0 where the mesh has them."""
    even = np.sqrt(surface.area / (np.sqrt(3) / 4 * TRIANGLES))
    edge = two_digits(np.clip(even, spacing / FINEST, spacing / COARSEST))
    return 0.0 if _is_good(surface, edge) else edge


def _is_good(surface: Surface, edge: float) -> bool:
    """Whether the triangles are of that size, and none is a needle."""
    lengths = surface.edge_lengths
    fits = 0.5 * edge <= lengths.mean() <= 1.2 * edge and lengths.max() <= 2 * edge
    return bool(fits and np.degrees(face_angles(surface.V, surface.F).min()) >= SHARPEST)
