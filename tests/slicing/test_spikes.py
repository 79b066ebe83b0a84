"""Teeth of a member: on a strip .8 wide or so, of which one triangle sticks out, and areas are known."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from dsfab.slicing import Sheet
from dsfab.slicing.cutting.sheet import VOID
from dsfab.slicing.finishing.spikes import without_spikes
from dsfab.surface import Surface

MEMBER = [(0, 9, 5), (0, 5, 6), (9, 10, 5), (9, 11, 10), (9, 4, 11), (9, 3, 4), (9, 1, 2), (9, 2, 3)]
OPENING = [(6, 5, 8), (5, 10, 8), (10, 12, 8), (10, 11, 12), (11, 4, 12), (4, 7, 12), (4, 3, 7), (3, 2, 7)]
TIP = 0.05


def toothed_strip(half: float, high: float, top: float, fold: float) -> Sheet:
    """A member of 4 x 1 below an opening, with a tooth twice `half` wide, and `top` times that at its tip.

    8 ----- 12 ---- 7
    |    10 _ 4     |      No edge runs along its chord, from 5 to 3. All is folded along the line from 9 to 12.
    6 --- 5/ \\3 --- 2
    0 ----- 9 ----- 1
    """
    tooth = [(half, 1), (top * half, 1 + high), (-half, 1)]
    plan = [(-2, 0), (2, 0), (2, 1), *tooth, (-2, 1), (2, 3), (-2, 3), (0, 0), (-top * half, 1 + high)]
    x, y = np.array([*plan, (0, 1 + high), (0, 3)]).T
    V = np.stack([x * np.cos(fold), y, -np.abs(x) * np.sin(fold)], axis=1)
    F = np.array(MEMBER + OPENING)
    family = np.where(np.arange(len(F)) < len(MEMBER), 0, VOID)
    return Sheet(Surface(V, F), np.arange(len(F)), family, csr_array(eye_array(len(V))))


@pytest.mark.parametrize(
    ("half", "high", "top", "off"),
    [
        (0.2, 0.5, TIP, True),
        (0.05, 0.2, TIP, True),
        (0.15, 1.2, TIP, True),
        (0.25, 1.0, TIP, False),
        (0.2, 0.11, TIP, False),
        (0.4, 0.1, 1.0, False),
        (0.005, 0.02, TIP, False),
    ],
    ids=["tooth", "small tooth", "spur", "member", "blunt", "ledge", "hair"],
)
@pytest.mark.parametrize(("size", "fold"), [(1e-3, 0.0), (1.0, 0.0), (1.0, 0.5)])
def test_a_short_sharp_tooth_is_cut_off_along_its_chord(half, high, top, off, size, fold):
    sheet = toothed_strip(half, high, top, fold)
    sheet = Sheet(Surface(size * sheet.surface.V, sheet.surface.F), sheet.parent, sheet.family, sheet.weights)
    done, count = without_spikes(sheet)
    areas = done.surface.areas
    assert count == off
    assert areas.sum() == pytest.approx(12 * size**2)
    assert areas[done.material].sum() == pytest.approx((4 + (0 if off else (1 + top) * half * high)) * size**2)
    assert done is sheet or off
