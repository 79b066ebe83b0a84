"""`CornerField`: a field that every face sees in a sign and a shift of its own.

A phase of stripes that turns over, or grows by whole periods, on its way around a point has no value at a vertex that
serves all faces there. Faces then see sign * x + shift. Levels must be carried to levels by that; and where a face sees
the band x[:, 0] > level > x[:, 1] with sign -1, its edges change places: it sees -x[:, 1] above and -x[:, 0] below.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, lock


@dataclass(frozen=True, eq=False)
class CornerField:
    """A field on a surface with n vertices and m faces.

    x      : (n, 1) values at the vertices; (n, 2) for a band, see `dsfab.slicing.cut`: material is where x[:, 0] has
             more levels below it than x[:, 1].
    sign   : (m, 3) 1 or -1, and shift : (m, 3): what the face sees at each corner is sign * x + shift.
    blank  : (m,) faces in which the field means nothing; they are not cut.
    wanted : (m,) share of each face where the field is wanted, or None for everywhere. It is decided for each opening
             that earlier fields leave as a whole, by the mean over its area: what is drawn in one ends at its walls.
    """

    x: Floats
    sign: Floats
    shift: Floats
    blank: Bools
    wanted: Floats | None = None

    def __post_init__(self) -> None:
        lock(self, "x", np.float64, (None, None))
        lock(self, "sign", np.float64, (None, 3))
        lock(self, "shift", np.float64, (len(self.sign), 3))
        lock(self, "blank", np.bool_, (len(self.sign),))
        if self.wanted is not None:
            lock(self, "wanted", np.float64, (len(self.sign),))

    @cached_property
    def turned(self) -> Bools:
        """(m,) faces that see some value at another sign or shift than it has."""
        return np.asarray(((self.sign < 0) | (self.shift != 0)).any(axis=1))

    def corners(self, F: Ints) -> Floats:
        """(m, 3, 1 or 2) what the faces F (m, 3) see at their corners."""
        x, sign = self.x[F], self.sign[:, :, None]
        return np.asarray(np.where(sign > 0, x, -x[..., ::-1]) + self.shift[:, :, None])
