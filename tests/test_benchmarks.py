"""The measuring scripts themselves, where nothing else runs them."""

import numpy as np

from tests.benchmarks.stripes import measured


def test_what_is_measured_is_made_and_its_memory_counted():
    made, seconds, memory = measured(lambda: np.ones(8 << 20), 2)
    assert len(made) == 8 << 20
    assert seconds >= 0
    assert memory == 0 or 60 < memory < 200  # MiB, where the system tells: 64 and what lies around it
