"""What a sheet that hangs from its upper rim might stand on instead."""

from collections.abc import Sequence

import numpy as np

from dsfab.proposal.feet import RIM, Foot, soles
from dsfab.surface import Surface

STEM = 1 / 20
"""Share of the span that a stem under the lowest part of a hanging sheet reaches to each side."""


def stems(surface: Surface, stands: Sequence[Foot], span: float) -> tuple[Foot, ...]:
    """What a sheet that hangs from an upper rim, as a funnel or a bowl, might stand on instead: its lowest parts."""
    if not stands or not all(foot.name.startswith(RIM) for foot in stands):
        return ()
    x, y = surface.V[:, 0], surface.V[:, 1]
    found = []
    for sole in soles(surface, float(np.ptp(surface.V[:, 2]))):
        (left, front), (right, back) = sole.points[:, :2].min(axis=0), sole.points[:, :2].max(axis=0)
        reach = max(STEM * span, 2 * surface.mean_edge)
        near = (x >= left - reach) & (x <= right + reach) & (y >= front - reach) & (y <= back + reach)
        found.append(Foot("stem", surface.V[near], 0.0))
    return tuple(found)
