"""Quantities in messages."""

import pytest

from dsfab.core.messages import load_factor


@pytest.mark.parametrize(("factor", "text"), [(3.14159, "3.14"), (990.0, "990"), (1010.0, "over 1000")])
def test_a_load_factor_of_over_a_thousand_is_only_an_order_of_magnitude(factor, text):
    assert load_factor(factor) == text
