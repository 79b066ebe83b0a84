"""A bar for the checks of the Eurocodes."""

import numpy as np

from dsfab.members.eurocode import MemberBays


def bar(width, thickness, length, curvature=0.0, **forces) -> MemberBays:
    """One bay with forces that are alike along it, or of five values; metres, newtons."""
    rows = np.zeros((1, 5, 6))
    for name, value in forces.items():
        rows[0, :, ("N", "Vy", "Vz", "Mt", "My", "Mz").index(name)] = value
    five = np.ones((1, 5))
    s = np.linspace(0, length, 5)[None]
    return MemberBays(
        ("A1",), ("N1 N2",), s, width * five, thickness, np.array([length]), curvature * five, {"load": rows}
    )
