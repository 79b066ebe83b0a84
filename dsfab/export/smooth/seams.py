"""Seams as curves: where two charts of a sheet meet, each with a curve of its own on both skins, and one in space."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.edges import TIGHTER, Allowed, Edge, ended, parameters, spread
from dsfab.export.smooth.nodes import Nodes
from dsfab.export.smooth.outline import Run, Sheet
from dsfab.export.smooth.splines import Spline, spline_through, straight

ON_SEAM = 1 / 1000
"""Tolerance of a seam over each of its charts, as a share of the thickness: what is left counts twice in the gap
between them."""

OF_EDGE = 0.05
"""Tolerance of a seam in space, as a share of the mesh's edges: nobody sees where it runs."""

Key = tuple[int, int, int, int]
"""The first two and the last two vertices of a run."""


def seam_edge(run: Run, k: int, nodes: Nodes, sheet: Sheet, level: int, allowed: Allowed) -> Edge:
    """The curves between chart k and the chart beyond: one for both, half way between what the two say."""
    pair, tight = (k, run.beyond), TIGHTER[level] * ON_SEAM * allowed.thickness
    middle = _in_space(sheet.V[run.vertices], TIGHTER[level] * OF_EDGE)
    x = parameters(middle)
    flat: dict[int, Spline] = {}
    for c in pair:
        ends, chart = nodes.uv[c][run.vertices[[0, -1]]], nodes.charts[c]
        uv = chart.middle.nearest(middle(x), chart.over(middle(x)))
        uv[0], uv[-1] = ends
        flat[c], _ = spline_through(x, uv, tight)
    x = np.unique(np.concatenate([parameters(flat[c]) for c in pair]))
    sides = [nodes.charts[c].both(flat[c](x)) for c in pair]
    space, off = spline_through(x, (sides[0] + sides[1]) / 2, tight, parts=2)
    apart = (sides[0] - sides[1]).reshape(len(x), 2, 3)
    return ended(run, space, flat, off + float(np.linalg.norm(apart, axis=2).max()), nodes, wall=False)


def _in_space(points: Floats, share: float) -> Spline:
    """A curve along the polyline where two charts meet."""
    if len(points) == 2:
        return straight(points[0], points[1])
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return spline_through(*spread(points), share * float(length.max()))[0]


def run_key(run: Run) -> tuple[Key, bool]:
    """What both charts call a seam's run, and whether this one runs the way the key does."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back
