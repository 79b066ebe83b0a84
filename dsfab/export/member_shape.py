"""`MemberShape`: a member as a body of its own, with a name and a layer, for programs that keep objects apart."""

from dataclasses import dataclass, field, replace

import numpy as np

from dsfab.arrays import Floats, Ints, lock


@dataclass(frozen=True, eq=False)
class MemberShape:
    """A closed mesh and the lines of a member, or of one of the parts that it is built of, in metres or millimetres.

    id    : the member's name.    layer : its family, or what it is: "major", "minor", "rim", "keep", "fill".
    V, F  : (n, 3), (m, 3) the body; triangles counter-clockwise seen from outside.
    axis  : (k, 3) along its middle; (0, 3) where it has none.
    edges : (k, 3) closed lines around it on the middle surface, each.
    plate : whether it is a plate; else it is long and narrow.
    """

    id: str
    layer: str
    V: Floats
    F: Ints
    axis: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    edges: tuple[Floats, ...] = ()
    plate: bool = False

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "axis", np.float64, (None, 3))

    def scaled(self, factor: float) -> "MemberShape":
        """The same in another unit of length."""
        edges = tuple(factor * line for line in self.edges)
        return replace(self, V=factor * self.V, axis=factor * self.axis, edges=edges)
