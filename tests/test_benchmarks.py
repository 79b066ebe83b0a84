"""The measuring scripts themselves, where nothing else runs them."""

import sys

import numpy as np
import pytest

from tests.benchmarks.stripes import measured


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux forgets the most memory it had")
def test_a_measurement_returns_the_result_the_time_and_the_memory():
    made, seconds, memory = measured(lambda: np.ones(8 << 20), 2)
    assert len(made) == 8 << 20
    assert seconds >= 0
    assert memory > 60  # MiB: 64 of them and what lies around
