"""Ends of runs, and all other vertices of outlines, on their charts."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export.smooth.charts import SkinChart
from dsfab.export.smooth.outline import SheetOutline


@dataclass(eq=False)
class Nodes:
    """Where the vertices of outlines lie over the charts around them, and where runs end on both skins.

    uv    : by chart, (n, 2), nan where a vertex is not in it.
    steep : by chart, (n,) by what share lengths in the plane grow on the surface there, at most; 1 or more.
    around : by vertex, its charts.
    at    : by vertex, (2, 3): upper and lower point; gap : largest distance of the skins of its charts from these. Both
            are known of the ends of runs, and of others once `add` was asked for them.
    """

    charts: dict[int, SkinChart]
    uv: dict[int, Floats]
    steep: dict[int, Floats]
    around: list[Ints]
    at: dict[int, Floats]
    gap: dict[int, float]

    def add(self, vertices: Ints) -> None:
        """Ends of runs, vertices (k,): half way between what their charts say."""
        new = [v for v in vertices.tolist() if v not in self.at]
        here, said = dict[int, list[int]](), dict[int, list[Floats]]({v: [] for v in new})
        for v in new:
            for k in self.around[v].tolist():
                here.setdefault(k, []).append(v)
        for k, some in here.items():
            for v, both in zip(some, self.charts[k].both(self.uv[k][some]), strict=True):
                said[v].append(both)
        for v, points in said.items():
            seen = np.array(points).reshape(-1, 2, 3)
            self.at[v] = seen.mean(axis=0)
            self.gap[v] = float(np.linalg.norm(seen - self.at[v], axis=2).max())


def nodes_of(sheet: SheetOutline, charts: dict[int, SkinChart]) -> Nodes:
    """Outline vertices on the middle surfaces of their charts, each at the nearest point."""
    uv, steep = {}, {}
    for k in {region.chart for region in sheet.regions}:
        runs = [run.vertices for region in sheet.regions if region.chart == k for loop in region.loops for run in loop]
        used = np.unique(np.concatenate(runs))
        flat, grows = np.full((len(sheet.V), 2), np.nan), np.ones(len(sheet.V))
        flat[used] = charts[k].middle.nearest(sheet.V[used], charts[k].over(sheet.V[used]))
        _, a, b = charts[k].middle.slopes(flat[used])
        grows[used] = np.maximum(np.linalg.norm(np.cross(a, b), axis=1), 1.0)
        uv[k], steep[k] = flat, grows
    start = np.searchsorted(sheet.charts[:, 0], np.arange(1, len(sheet.V)))
    nodes = Nodes(charts, uv, steep, np.split(sheet.charts[:, 1], start), {}, {})
    ends = [run.vertices[[0, -1]] for region in sheet.regions for loop in region.loops for run in loop]
    nodes.add(np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *ends])))
    return nodes
