"""Where strips are divided: what is found to fit lies on the stock as it is found."""

import numpy as np
import pytest

from dsfab.workshop.development import Development, StripCourse
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.splices import strip_fits

ROOM = [(2.484, 1.234)]


@pytest.mark.parametrize("wide", [0.1, 0.3, 0.6])
def test_the_longest_piece_fits_on_its_sheet_as_placed(wide):
    """A strip whose axis is beside the middle of one end was 0.8 mm too long for its sheet: no plan."""
    s = np.linspace(0, 6, 121)
    P = np.column_stack([s, 0 * s, 0 * s])
    rows = {"T": np.tile([1.0, 0, 0], (121, 1)), "N": np.tile([0, 0, 1.0], (121, 1))}
    none = dict.fromkeys(("kg", "kn", "tg"), np.zeros(121))
    left, right = 0.1 + wide * s / 6, np.full(121, 0.1)
    course = StripCourse(s=s, P=P, **rows, **none, left=left, right=right, begin=0.0, end=6.0, closed=False)
    layer = Development(course, 0.0)
    fits = strip_fits(layer, ROOM)
    for begin in (0.0, 1.0, 3.0):
        end = max(x for x in np.linspace(begin + 2.2, begin + 2.49, 291) if fits(begin, float(x)))
        axis = layer.middle_line_at(layer.stations(begin, end))[0]
        part = FlatPart("A", "A", (begin, end), layer.outline(begin, end), (), (), (), 0.0, 0.0, axis).along_x()
        assert part.size[0] <= ROOM[0][0]
        assert part.size[0] > ROOM[0][0] - 0.002
