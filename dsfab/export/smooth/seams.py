"""Seams as curves: where two charts of a sheet meet, each with a curve of its own on both skins, and one in space."""

from typing import TypeVar

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.edges import TIGHTER, Allowed, Asked, Edge, by_chart, parameters, spread, with_ends_on_nodes
from dsfab.export.smooth.fits import splines_through
from dsfab.export.smooth.nodes import Nodes
from dsfab.export.smooth.outline import OutlineRun, SheetOutline
from dsfab.export.splines import Spline, straight

ON_SEAM = 1 / 1000
"""Tolerance of a seam over each of its charts, as a share of the thickness: what is left counts twice in the gap
between them."""

OF_EDGE = 0.05
"""Tolerance of a seam in space, as a share of the mesh's edges: nobody sees where it runs."""

T = TypeVar("T")

Key = tuple[int, int, int, int]
"""The first two and the last two vertices of a run."""


def seam_edges(asked: list[Asked], nodes: Nodes, sheet: SheetOutline, allowed: Allowed) -> list[Edge]:
    """The curves between the charts asked about and those beyond: one for both, half way between what the two say."""
    runs, charts = [one.run for one in asked], [k for one in asked for k in (one.chart, one.run.beyond)]
    tight = [TIGHTER[one.level] * ON_SEAM * allowed.thickness for one in asked]
    middle = _in_space([sheet.V[run.vertices] for run in runs], [TIGHTER[one.level] * OF_EDGE for one in asked])
    x = [parameters(curve) for curve in middle]
    points = _twice([curve(at) for curve, at in zip(middle, x, strict=True)])
    uv = by_chart(charts, points, lambda k, P: nodes.charts[k].middle.nearest(P, nodes.charts[k].over(P)))
    for at, k, run in zip(uv, charts, _twice(runs), strict=True):
        at[[0, -1]] = nodes.uv[k][run.vertices[[0, -1]]]
    fits = splines_through(list(zip(_twice(x), uv, strict=True)), _twice(tight))
    flat = _pairs([curve for curve, _ in fits])
    x = [np.unique(np.concatenate([parameters(curve) for curve in pair])) for pair in flat]
    on = [curve(at) for pair, at in zip(flat, x, strict=True) for curve in pair]
    sides = _pairs(by_chart(charts, on, lambda k, uv: nodes.charts[k].both(uv)))
    fits = splines_through([(at, (one + two) / 2) for at, (one, two) in zip(x, sides, strict=True)], tight, parts=2)
    gaps = [off + _apart(one, two) for (_, off), (one, two) in zip(fits, sides, strict=True)]
    ways = [dict(zip(both, pair, strict=True)) for both, pair in zip(_pairs(charts), flat, strict=True)]
    return [
        with_ends_on_nodes(run, space, way, gap, nodes, wall=False)
        for run, (space, _), way, gap in zip(runs, fits, ways, gaps, strict=True)
    ]


def _twice(values: list[T]) -> list[T]:
    """Each value for both charts of a seam."""
    return [value for value in values for _ in range(2)]


def _pairs(values: list[T]) -> list[tuple[T, T]]:
    """What there is of both charts of each seam."""
    return list(zip(values[::2], values[1::2], strict=True))


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


def run_key(run: OutlineRun) -> tuple[Key, bool]:
    """What both charts call a seam's run, and whether this one runs the way the key does."""
    v: Ints = run.vertices
    ahead = (int(v[0]), int(v[1]), int(v[-1]), int(v[-2]))
    back = (ahead[2], ahead[3], ahead[0], ahead[1])
    return min(ahead, back), ahead <= back
