"""Straight and round stripes on a plate."""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.slicing import Chart
from dsfab.slicing.measures.chart import StripeChart


def drawn(surface, z, d, known=None, kept=None):
    """Stripes on a surface that is its own chart."""
    n, m = surface.n, surface.m
    scale = np.ones((n, 2))
    chart = Chart(surface, np.arange(m), csr_array(eye_array(n)), np.stack(z, axis=1), scale)
    widths = np.broadcast_to(np.asarray(d, dtype=float), (n, 2))
    made = StripeChart.from_chart(chart, widths, np.full(n, -1.0) if kept is None else kept)
    return made if known is None else replace(made, known=known)
