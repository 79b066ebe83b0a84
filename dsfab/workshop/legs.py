"""Legs: at supports, plates of nodes go on to the ground, where they are folded level and anchored.

  strip, bar                  u   down the surface, in the plane of the plate
____ n                        e   from the node to the fold
    `·-._  plate
      e  `·.._______ leg      the fold: as steep as the surface is there
               o  o  anchors
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, lock
from dsfab.members import MemberGraph
from dsfab.surface import LoadCase, Surface
from dsfab.wording import some_names
from dsfab.workshop.layering import END, Layering
from dsfab.workshop.letters import text_length
from dsfab.workshop.parts import SMALL, FlatPart, Fold, Hole, label

NEAR = 0.75
"""Widths of the members at a node, and an edge of the mesh: a support that is nearer is the node's own."""
FLAT = np.sin(np.radians(5.0))
"""A surface that is less steep than this at a support has no way down: plates have no legs there."""
SIDE, ARM = 1.5, 0.45
"""Half of the width of a plate below strips: anchor diameters at least, or a share of the narrowest member."""
ANCHORS = (3.0, 4.0, 3.0)
"""Anchor diameters from a fold to the first anchor, to the second, and to the end of the leg."""


@dataclass(frozen=True, eq=False)
class Leg:
    """The leg of a plate: its direction in the plane of the plate, a unit vector (3,); the angle of its fold, radians,
    towards the normal; and the diameter of its anchors, metres."""

    way: Floats
    fold: float
    anchor: float

    def __post_init__(self) -> None:
        lock(self, "way", np.float64, (3,))

    @property
    def holes(self) -> tuple[float, ...]:
        """Metres from the fold."""
        return tuple((self.anchor * np.cumsum(ANCHORS[:2])).tolist())

    @property
    def long(self) -> float:
        """Metres from the fold to the end."""
        return self.anchor * sum(ANCHORS)


@dataclass(frozen=True, eq=False)
class Footing:
    """Where a structure is held: places (q, 3) of supports, metres; the unit vector `up`; how far a support may be from
    a node besides its members' widths; and the diameter of anchors, metres."""

    supports: Floats
    up: Floats
    reach: float
    anchor: float

    def __post_init__(self) -> None:
        lock(self, "supports", np.float64, (None, 3))
        lock(self, "up", np.float64, (3,))

    @classmethod
    def of(cls, surface: Surface, load: LoadCase, up: Floats, anchor: float) -> "Footing | None":
        """None where nothing is held, or no anchors are asked for."""
        held = surface.V[load.fixed.any(axis=1) | load.spring.any(axis=1)]
        return cls(held, up, float(surface.mean_edge), anchor) if len(held) and anchor else None

    def legs(self, points: Floats, normals: Floats, widths: Sequence[float]) -> dict[int, Leg | None]:
        """By number, the legs of those of some nodes (q, 3), with normals (q, 3), that are at a support; None where the
        surface is too flat for one."""
        away = np.asarray(cKDTree(self.supports).query(points)[0])
        found: dict[int, Leg | None] = {}
        for k in np.flatnonzero(away < self.reach + NEAR * np.asarray(widths)).tolist():
            n = normals[k]
            down = (n @ self.up) * n - self.up
            steep = float(np.linalg.norm(down))
            outward = n @ self.up > 0  # of a surface whose normals point down, plates are folded the other way
            angle = float(np.arctan2(steep, abs(float(n @ self.up)))) * (1 if outward else -1)
            found[k] = Leg(down / steep, angle, self.anchor) if steep > FLAT else None
        return found


def leg_plates(
    graph: MemberGraph, layering: Layering, footing: Footing, thickness: float
) -> tuple[list[FlatPart], list[str]]:
    """Plates of a thickness, metres, below strips at nodes on supports: a hole for the bolt of the node, and a leg; and
    the names of nodes where the surface is too flat for one."""
    nodes = [node for node in graph.nodes if node.kind != "grazing"]
    members = [[graph.by_id[name] for name in node.members] for node in nodes]
    widths = [max(one.mean_width for one in some) for some in members]
    points, normals = (np.array([getattr(node, name) for node in nodes]) for name in ("point", "normal"))
    parts, flat = list[FlatPart](), list[str]()
    for k, leg in footing.legs(points.reshape(-1, 3), normals.reshape(-1, 3), widths).items():
        if leg is None:
            flat.append(nodes[k].id)
            continue
        lowest = max(number for one in members[k] for number in layering.numbers(one.family))
        height = layering.height(lowest) - (layering.thickness + thickness) / 2
        half = max(SIDE * leg.anchor, ARM * min(one.mean_width for one in members[k]))
        parts.append(
            _leg_plate(nodes[k].id, leg, (widths[k] / 2 + layering.bolt, half), layering.bolt, height, thickness)
        )
    return parts, flat


def _leg_plate(
    node: str, leg: Leg, size: tuple[float, float], bolt: float, height: float, thickness: float
) -> FlatPart:
    """A plate with its node at the origin; size : metres to the fold, and half of its width."""
    root, half = size
    begin, end = -END * bolt, root + leg.long
    outline = np.array([[begin, -half], [end, -half], [end, half], [begin, half]])
    holes = [Hole(np.zeros(2), bolt, node)]
    holes += [Hole(np.array([root + r, 0.0]), leg.anchor, "anchor") for r in leg.holes]
    fold = Fold(np.array([[root, -half], [root, half]]), -leg.fold)
    name = f"{node} foot"
    high = min(SMALL, 0.9 * (root - bolt) / text_length(name, 1.0))
    marks = label(name, np.array([(root + 0.6 * bolt) / 2, 0.0]), 0.0, high)
    return FlatPart(
        *(name, "", (0.0, 0.0), outline, tuple(holes)),
        marks=marks,
        layer=height,
        folds=(fold,),
        thickness=thickness,
    ).centred()


def leg_lines(folds: Sequence[float], flat: Sequence[str]) -> list[str]:
    """Sentences on plates with legs, by their folds, radians, and on nodes without."""
    angles = [abs(float(np.degrees(fold))) for fold in folds]
    found = []
    if angles:
        found.append(
            f"{len(angles)} plates at supports have a leg with anchors, folded by {min(angles):.0f} to "
            f"{max(angles):.0f} degrees to be level"
        )
    if flat:
        found.append(
            f"no leg at {some_names(flat)}: the surface is less steep than 5 degrees there, or a bar is in its way"
        )
    return found
