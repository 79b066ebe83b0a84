"""`Layering`: at which height over the surface each family lies, and how far parts must reach past their bolts."""

from dataclasses import dataclass

from dsfab.members import Node
from dsfab.workshop.parts import LABEL, SMALL

OWN = ("rim", "keep")
"""Families that cross both families of stripes have layers of their own, below all others."""
END = 3.0
"""Bolt diameters from the middle of a bolt to the end of a part."""
PITCH = 4.0
"""Bolt diameters from bolt to bolt of a splice."""
SIDE = 3.0
"""Bolt diameters to a side of a part, where two rows of bolts are to fit."""


@dataclass(frozen=True)
class Layering:
    """Layers of one thickness, metres, from the top (where normals point to) down; bolts of a diameter, metres.

    major  ═══════════════     0      of two layers; of four the families take turns
    minor  ─┤ ├─── ┤ ├────     1
    rim    ═══════════════     2      edges; what is kept: below them
                               4      plates: below all

    own : those of `OWN` that there are layers for; a model leaves out those that it does not have.
    letters : heights of names of parts and of nodes, metres, at most.
    """

    thickness: float
    count: int
    bolt: float
    own: tuple[str, ...] = OWN
    letters: tuple[float, float] = (LABEL, SMALL)

    def numbers(self, family: str) -> tuple[int, ...]:
        """The layers that a family is in, counted from the top."""
        if family in self.own:
            return (self.count + self.own.index(family),)
        return tuple(range(0 if family == "major" else 1, self.count, 2))

    @property
    def sparing(self) -> bool:
        """Whether names of nodes stand only where there is room for them: letters of a model are large for it."""
        return self.letters[0] < LABEL

    @property
    def plates(self) -> int:
        """The layer of plates: below all others, where nothing else lies."""
        return self.count + len(self.own)

    def height(self, number: int) -> float:
        """Metres from the surface to the middle of a layer: 0 is in the middle of those of the stripes."""
        return ((self.count - 1) / 2 - number) * self.thickness

    def cover(self, family: str, number: int) -> float:
        """Height of the cover plate of a splice: on the side where no crossing member lies between nodes."""
        return self.height(number - 1 if family == "major" else number + 1)

    def packing(self, node: Node, families: dict[str, str]) -> int:
        """How many layers of packing a node needs between its two members, by the families of all members."""
        one, two = (self.numbers(families[name]) for name in node.members)
        upper, lower = (one, two) if one[0] < two[0] else (two, one)
        return max(lower[0] - upper[-1] - 1, 0)

    @property
    def half_cover(self) -> float:
        """Metres from a splice to the end of its cover plate: two bolts to each side."""
        return (END + PITCH + END) * self.bolt

    def splice_bolts(self, width: float) -> tuple[tuple[float, float], ...]:
        """Places of the bolts of a splice, metres along from it and to the left, in one row or two."""
        rows = (-width / 4, width / 4) if width / 4 >= SIDE * self.bolt else (0.0,)
        along = (END * self.bolt, (END + PITCH) * self.bolt)
        return tuple((side * x, y) for side in (-1, 1) for x in along for y in rows)
