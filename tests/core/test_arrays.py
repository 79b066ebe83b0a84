"""Arrays: where values are split into small and large ones."""

import numpy as np

from dsfab.core.arrays import split_value


def test_values_that_differ_from_a_limit_by_a_few_hundredths_are_on_one_side_of_it():
    assert 0.85 < split_value(np.array([0.85, 0.98, 1.0, 1.02, 1.15]), 1.0) < 0.98
    assert split_value(np.array([0.94, 1.06]), 1.0) == 1.0
