"""Quantities in messages."""

import pytest

from dsfab.core.messages import count_phrase, load_factor


@pytest.mark.parametrize(("factor", "text"), [(3.14159, "3.14"), (990.0, "990"), (1010.0, "over 1000")])
def test_a_load_factor_of_over_a_thousand_is_only_an_order_of_magnitude(factor, text):
    assert load_factor(factor) == text


def test_a_verb_follows_its_count():
    counted = [count_phrase(number, "edge", verb) for verb in ("have", "repeat", "") for number in (1, 2)]
    assert counted == ["1 edge has", "2 edges have", "1 edge repeats", "2 edges repeat", "1 edge", "2 edges"]
