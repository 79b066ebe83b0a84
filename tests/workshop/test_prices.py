"""Stock with prices: what is counted by hand, a law for any parts, and a vault whose long sheets are dear."""

import csv
import io

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.core.errors import PresetError
from dsfab.design import Design
from dsfab.preset.file import load_preset, with_overrides
from dsfab.report.assembly.flat_parts import sheet_figures
from dsfab.workshop import FlatPart, stock_cost, stock_words, workshop_plan
from dsfab.workshop.files import cut_list, cut_list_workbook
from dsfab.workshop.nesting import nest_parts
from tests.designs import sliced
from tests.workshop.drawn_parts import least_gap

GAP = 0.008
LARGE, SMALL = (2.5, 1.25), (1.25, 0.6)


def strips(count, long=1.0, wide=0.1):
    box = np.array([[0.0, 0.0], [long, 0.0], [long, wide], [0.0, wide]])
    return [FlatPart(f"{long}:{k}", "A", (0.0, long), box) for k in range(count)]


@pytest.mark.parametrize(
    ("large", "small", "words"),
    [
        (40, 8, "5 of 1.25 x 0.6 m at 8"),  # five lie on a small sheet, 22 on a large one
        (40, 10.5, "1 of 1.25 x 0.6 m at 10.50, 1 of 2.5 x 1.25 m at 40"),
        (40, 41, "2 of 2.5 x 1.25 m at 40"),
    ],
)
def test_sheets_are_those_that_cost_least_together(large, small, words):
    """Along the grain: (.6 - .008) / .108 = 5.5 rows, and (1.25 - .008) / .108 = 11.5 rows of two."""
    assert stock_words(nest_parts(strips(25), (LARGE, SMALL), GAP, True, (large, small))) == words


def test_a_part_too_large_for_a_small_sheet_opens_a_large_sheet_that_is_filled():
    """A row of 2.2 m leaves room for ten more rows of two: the small sheet holds what is left."""
    parts = strips(1, 2.2) + strips(25)
    sheets = nest_parts(parts, (SMALL, LARGE), GAP, True, (12, 40))
    assert stock_words(sheets) == "1 of 1.25 x 0.6 m at 12, 1 of 2.5 x 1.25 m at 40"
    assert stock_cost(sheets) == 52
    assert stock_words(nest_parts(parts, (SMALL, LARGE), GAP, True)) == "1 of 1.25 x 0.6 m, 1 of 2.5 x 1.25 m"


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.2, 1.2), st.floats(0.04, 0.5)), min_size=1, max_size=15),
    st.tuples(st.floats(1, 50), st.floats(1, 50)),
)
def test_two_sheet_sizes_never_cost_more_than_one_size(sizes, prices):
    parts = [strips(k + 1, *size)[-1] for k, size in enumerate(sizes)]
    both = nest_parts(parts, (LARGE, SMALL), GAP, prices=prices)
    assert sorted(one.part.id for sheet in both for one in sheet.parts) == sorted(part.id for part in parts)
    assert least_gap(both) >= GAP - 1e-9
    for size, price in zip((LARGE, SMALL), prices, strict=True):
        assert stock_cost(both) <= stock_cost(nest_parts(parts, [size], GAP, prices=[price])) + 1e-6


@pytest.mark.slow
def test_parts_are_spliced_for_shorter_sheets_if_long_sheets_are_expensive():
    """Strips that are spliced for sheets of 6 m have room on no others."""
    vault = sliced(load_preset("barrel_vault", {"surface.edge": 0.5, "workshop.route": "strips"}))
    stock, plans = [[6, 1.25], [2.5, 1.25]], {}
    for prices in ([60, 45], [500, 45]):
        asked = with_overrides(vault.preset, {"workshop.stock": stock, "workshop.prices": prices})
        plans[prices[0]] = workshop_plan(Design.from_preset(asked, vault))
    fair, dear = plans[60], plans[500]
    assert max(part.size[0] for part in fair.parts) > 2.5
    assert {sheet.size for sheet in dear.sheets} == {(2.5, 1.25)}
    cost = 45 * len(dear.sheets)
    assert f"sheets cost {cost} together: {len(dear.sheets)} of 2.5 x 1.25 m at 45" in dear.notes
    assert any(note.startswith("a stock with sheets up to 6 x 1.25 m would cost") for note in dear.notes)
    assert ("Price of the sheets", str(cost)) in sheet_figures(dear)
    rows = list(csv.DictReader(io.StringIO(cut_list(dear))))
    assert sum(float(row["cost"]) for row in rows) == pytest.approx(cost, abs=0.005 * len(rows))
    (bought,) = list(openpyxl.load_workbook(io.BytesIO(cut_list_workbook(dear)))["stock"].values)[1:]
    assert bought[3:] == (len(dear.sheets), pytest.approx(dear.used_share, abs=5e-4), 45, cost)


@pytest.mark.parametrize(
    ("prices", "said"),
    [
        ([45, 60], "prices has 2 entries, but stock has 1 size; give a price for each size of sheet"),
        ([0], r"workshop\.prices\.0 = 0: should be greater than 0"),
        ("cheap", r"workshop\.prices = 'cheap': should be a list"),
    ],
)
def test_prices_that_do_not_belong_to_the_stock_are_refused_in_a_sentence(prices, said):
    with pytest.raises(PresetError, match=said):
        load_preset("dome", {"workshop.prices": prices})
    assert load_preset("dome", {"workshop.prices": 45}).workshop.prices == (45,)
