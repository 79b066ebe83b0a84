"""Teeth of a member: on a strip .8 wide or so, of which one triangle sticks out, and areas are known."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from dsfab.slicing import Sheet, without_spikes
from dsfab.slicing.sheet import VOID
from dsfab.surface import Surface

MEMBER = [(0, 9, 5), (0, 5, 6), (9, 10, 5), (9, 4, 10), (9, 3, 4), (9, 1, 2), (9, 2, 3)]
OPENING = [(6, 5, 8), (5, 10, 8), (10, 4, 8), (4, 7, 8), (4, 3, 7), (3, 2, 7)]
TIP = 0.05


def strip(half: float, high: float, top: float) -> Sheet:
    """A member of 4 x 1 below an opening, with a tooth twice `half` wide, and `top` times that at its tip.

    8 ------------ 7
    |   10 _ 4     |      No edge runs along its chord, from 5 to 3.
    6 ---5/ \\3---- 2
    0 ----- 9 ---- 1
    """
    tooth = [(2 + half, 1), (2 + top * half, 1 + high), (2 - half, 1)]
    plan = [(0, 0), (4, 0), (4, 1), *tooth, (0, 1), (4, 3), (0, 3), (2, 0), (2 - top * half, 1 + high)]
    V = np.column_stack([np.array(plan, dtype=float), np.zeros(len(plan))])
    F = np.array(MEMBER + OPENING)
    family = np.where(np.arange(len(F)) < len(MEMBER), 0, VOID)
    return Sheet(Surface(V, F), np.arange(len(F)), family, csr_array(eye_array(len(V))))


@pytest.mark.parametrize(
    ("half", "high", "top", "off"),
    [
        (0.2, 0.5, TIP, True),
        (0.05, 0.2, TIP, True),
        (0.2, 1.0, TIP, False),
        (0.2, 0.11, TIP, False),
        (0.4, 0.1, 1.0, False),
        (0.005, 0.02, TIP, False),
    ],
    ids=["tooth", "small tooth", "member", "blunt", "ledge", "hair"],
)
@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_a_short_sharp_tooth_is_cut_off_along_its_chord(half, high, top, off, size):
    sheet = strip(half, high, top)
    sheet = Sheet(Surface(size * sheet.surface.V, sheet.surface.F), sheet.parent, sheet.family, sheet.weights)
    done, count = without_spikes(sheet)
    areas = done.surface.areas
    assert count == off
    assert areas.sum() == pytest.approx(12 * size**2)
    assert areas[done.material].sum() == pytest.approx((4 + (0 if off else (1 + top) * half * high)) * size**2)
    assert done is sheet or off
