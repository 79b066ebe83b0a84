"""Seams as curves: where two charts of a sheet meet, each with a curve of its own on both skins, and one in space."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.edges import TIGHTER, Allowed, Asked, Edge, by_chart, ended, parameters, spread
from dsfab.export.smooth.fits import splines_through
from dsfab.export.smooth.nodes import Nodes
from dsfab.export.smooth.outline import Run, Sheet
from dsfab.export.smooth.splines import Spline, straight

ON_SEAM = 1 / 1000
"""Tolerance of a seam over each of its charts, as a share of the thickness: what is left counts twice in the gap
between them."""

OF_EDGE = 0.05
"""Tolerance of a seam in space, as a share of the mesh's edges: nobody sees where it runs."""

Key = tuple[int, int, int, int]
"""The first two and the last two vertices of a run."""


def seam_edges(asked: list[Asked], nodes: Nodes, sheet: Sheet, allowed: Allowed) -> list[Edge]:
    """The curves between the charts asked about and those beyond: one for both, half way between what the two say."""
    runs, ways = [one.run for one in asked], range(2)
    charts = [k for one in asked for k in (one.chart, one.run.beyond)]  # two for each run
    tight = [TIGHTER[one.level] * ON_SEAM * allowed.thickness for one in asked]
    lines = [sheet.V[run.vertices] for run in runs]
    middle = _in_space(lines, [TIGHTER[one.level] * OF_EDGE for one in asked])
    x = [parameters(curve) for curve in middle for _ in ways]
    points = [curve(at) for curve, at in zip(middle, x[::2], strict=True) for _ in ways]
    uv = by_chart(charts, points, lambda k, P: nodes.charts[k].middle.nearest(P, nodes.charts[k].over(P)))
    for at, k, run in zip(uv, charts, [run for run in runs for _ in ways], strict=True):
        at[[0, -1]] = nodes.uv[k][run.vertices[[0, -1]]]
    fits = splines_through(list(zip(x, uv, strict=True)), [t for t in tight for _ in ways])
    flat = [curve for curve, _ in fits]
    pairs = list(zip(flat[::2], flat[1::2], strict=True))
    x = [np.unique(np.concatenate([parameters(one), parameters(two)])) for one, two in pairs]
    on = [curve(at) for pair, at in zip(pairs, x, strict=True) for curve in pair]
    sides = by_chart(charts, on, lambda k, uv: nodes.charts[k].both(uv))
    means = [(one + two) / 2 for one, two in zip(sides[::2], sides[1::2], strict=True)]
    apart = [_apart(one, two) for one, two in zip(sides[::2], sides[1::2], strict=True)]
    fits = splines_through(list(zip(x, means, strict=True)), tight, parts=2)
    return [
        ended(
            run, space, dict(zip(charts[2 * i : 2 * i + 2], pairs[i], strict=True)), off + apart[i], nodes, wall=False
        )
        for i, (run, (space, off)) in enumerate(zip(runs, fits, strict=True))
    ]


def _apart(one: Floats, two: Floats) -> float:
    """The largest distance of the upper or the lower points of two charts (k, 6)."""
    return float(np.linalg.norm((one - two).reshape(-1, 2, 3), axis=2).max())


def _in_space(lines: list[Floats], shares: list[float]) -> list[Spline]:
    """Curves along the polylines where two charts meet."""
    longest = [float(np.linalg.norm(np.diff(line, axis=0), axis=1).max()) for line in lines]
    bent = [i for i, line in enumerate(lines) if len(line) > 2]
    fits = splines_through([spread(lines[i]) for i in bent], [shares[i] * longest[i] for i in bent])
    curved = {i: curve for i, (curve, _) in zip(bent, fits, strict=True)}
    return [curved[i] if i in curved else straight(*line) for i, line in enumerate(lines)]


def run_key(run: Run) -> tuple[Key, bool]:
    """What both charts call a seam's run, and whether this one runs the way the key does."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back
