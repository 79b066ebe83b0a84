"""What smooth STEP takes: a solid's mesh does not know which of its edges are the pattern's, the cut sheet does."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Bools, Floats, Ints, lock

NO_PAIRS = np.zeros((0, 2), dtype=np.int64)
NO_PAIRS.setflags(write=False)


class DividedSheet(NamedTuple):
    """A sheet divided into charts.

    V, F      : (n', 3) and (m', 3), metres; pieces keep to themselves, no vertex is a pinch.
    D         : (n', 3) half-thickness vectors, metres.
    chart     : (m',) the chart of each face.
    half_edge : (k,) the boundary's half-edges, 3 face + corner.
    family    : (k,) what each of them is an edge of; -1 for the boundary of the uncut surface.
    """

    V: Floats
    F: Ints
    D: Floats
    chart: Ints
    half_edge: Ints
    family: Ints


class StripedSheet(NamedTuple):
    """A sheet divided along all edges of its stripes, those below other stripes too.

    F       : (m, 3) cells, oriented as the uncut surface.
    weights : (n', n) barycentric weights of its vertices on those of the uncut surface.
    label   : (m,) equal for cells that lie in the same stripes.    loose : (m,) cells that lie in none.
    seam    : (k, 2) half-edges at one place, in one direction, where a surface with one side only was cut open.
    """

    F: Ints
    weights: csr_array
    label: Ints
    loose: Bools
    seam: Ints = NO_PAIRS


@dataclass(frozen=True, eq=False)
class Curved:
    """A sheet cut from a surface.

    V, F  : (n, 3) and (m, 3) of the uncut, oriented surface, metres.
    D     : (n, 3) half-thickness vectors on it, metres.
    shift : by how many D the middle of the sheet lies off the surface: 0, 1 or -1.
    divided : the sheet, divided along the upper envelope of fields (n, c) on the uncut surface: chart k is where
              field k is largest.
    striped : the sheet by its stripes; None where these are not known.
    twins : (k, 2) vertices at one place, with opposite D, where a surface with one side only was cut open.
    """

    V: Floats
    F: Ints
    D: Floats
    shift: int
    divided: Callable[[Floats], DividedSheet]
    striped: Callable[[], StripedSheet] | None = None
    twins: Ints = field(default_factory=lambda: NO_PAIRS)

    def __post_init__(self) -> None:
        lock(self, "V", np.float64, (None, 3))
        lock(self, "F", np.int64, (None, 3))
        lock(self, "D", np.float64, (None, 3))
        lock(self, "twins", np.int64, (None, 2))
