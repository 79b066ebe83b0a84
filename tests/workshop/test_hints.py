"""Hints that save sheets: straight strips of which one counts how many lie on a sheet."""

import numpy as np
import pytest

from dsfab.workshop import FlatPart
from dsfab.workshop.nesting import nest_parts, stack_parts
from dsfab.workshop.parts import Hole
from dsfab.workshop.stock import narrow_strip, sheet_hints
from tests.workshop.drawn_parts import least_gap

GAP = 0.008


def strips(count, long, wide, bolt=0.012):
    """Straight ones about the x axis."""
    x = np.linspace(-long / 2, long / 2, 5)
    outline = np.concatenate([np.c_[x, np.full(5, -wide / 2)], np.c_[x[::-1], np.full(5, wide / 2)]])
    hole = Hole(np.zeros(2), bolt, "N1")
    axis = np.c_[x, np.zeros(5)]
    return [FlatPart(f"A{k}", f"A{k}", (0.0, long), outline, (hole,), axis=axis) for k in range(count)]


def hints(parts, stock, gap=GAP):
    return sheet_hints(parts, nest_parts(parts, stock, gap), stock, gap)


def test_strips_that_are_a_little_too_wide_for_one_more_row():
    """(1.25 - .008) / (.2 + .008) = 5.97, / (.19 + .008) = 6.27: of 11 strips, five or six lie on a sheet."""
    said, *_ = hints(strips(11, 2.4, 0.2), [(2.5, 1.25)])
    assert said.startswith("if strips were 190 mm wide instead of 200 mm, the parts would need 2 sheets instead of 3")


def test_the_hint_gives_the_least_narrowing_that_saves_a_sheet():
    """/ (.21 + .008) = 5.7, / (.2 + .008) = 5.97: only a tenth less is a row more; 10 strips need no more rows."""
    said, *_ = hints(strips(11, 2.4, 0.21), [(2.5, 1.25)])
    assert "190 mm wide instead of 210 mm, the parts would need 2 sheets instead of 3" in said
    assert hints(strips(10, 2.4, 0.2), [(2.5, 1.25)]) == []
    assert hints(strips(2, 2.4, 0.2), [(2.5, 1.25)]) == []


def test_stock_that_is_a_little_longer_holds_two_in_a_row():
    """2 x 1.3 m fit into 2.75 m and not into 2.5 m: 10 strips on one sheet of a tenth more, in place of two."""
    (said,) = hints(strips(10, 1.3, 0.2), [(2.5, 1.25)])
    assert said == "a stock of 2.75 x 1.25 m sheets would need 1 sheet instead of 2, with 45% less area of material"
    assert hints(strips(10, 1.3, 0.2), [(2.5, 1.25), (2.6, 1.25)]) == []


def test_strips_are_not_made_narrower_than_their_bolts_allow():
    thin = strips(60, 2.4, 0.035), strips(60, 2.4, 0.035, bolt=0.006)
    said = [[one for one in hints(parts, [(2.5, 1.25)]) if "wide instead" in one] for parts in thin]
    assert [len(some) for some in said] == [0, 1]


def test_the_hint_for_strips_of_several_widths_is_a_share():
    said, *_ = hints(strips(11, 2.4, 0.2) + strips(1, 2.4, 0.1), [(2.5, 1.25)])
    assert said.startswith("if strips were 5% narrower, the parts would need 2 sheets instead of 3")


def test_a_narrower_strip_keeps_its_axis_and_a_plate_stays():
    (part,) = strips(1, 2.4, 0.2)
    slim = narrow_strip(part, 0.9)
    assert slim.size == pytest.approx([2.4, 0.18])
    assert slim.area == pytest.approx(0.9 * part.area)
    assert np.array_equal(slim.axis, part.axis)
    plate = FlatPart("disc 1", "disc 1", (0.0, 0.0), part.outline)
    assert narrow_strip(plate, 0.9) is plate


def test_nests_of_narrower_strips_keep_the_gap():
    parts = [narrow_strip(part, 0.95) for part in strips(11, 2.4, 0.2)]
    sheets = nest_parts(parts, [(2.5, 1.25)], GAP)
    assert len(sheets) == 2
    assert least_gap(sheets) >= GAP - 1e-9


def bent(count):
    """Strips of several lengths and bends, every other one with its outline the other way round."""
    found = []
    for k in range(count):
        u = np.linspace(-0.5, 0.5, 9)
        middle = np.stack([(0.4 + 0.1 * (k % 17)) * u, 0.05 * (k % 5) * (1 - 4 * u**2)], axis=1)
        outline = np.concatenate([middle - [0, 0.04], (middle + [0, 0.04])[::-1]])
        found.append(FlatPart(f"A{k}", f"A{k}", (0.0, 1.0), outline[:: 1 - 2 * (k % 2)]))
    return found


def test_nesting_stops_only_with_too_many_sheets():
    parts, stock = bent(40)[::2], [(2.2, 0.6)]
    count = len(stack_parts(parts, stock, GAP, 40))
    assert len(stack_parts(parts, stock, GAP, count)) == count > 1
    assert stack_parts(parts, stock, GAP, count - 1) is None


def test_parts_keep_the_gap_whichever_way_their_outlines_run():
    assert least_gap(nest_parts(bent(20), [(2.2, 0.6)], GAP)) >= GAP - 1e-9
