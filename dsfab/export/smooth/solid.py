"""Pieces of a sheet as closed shells: skins and walls on shared edges."""

from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.plate import enclosed
from dsfab.export.smooth.charts import Chart
from dsfab.export.smooth.edges import Edge, Nodes, is_wall, nodes_of, seam_edge, seam_key, wall_edge
from dsfab.export.smooth.outline import Run, Sheet

Key = tuple[int, int, int, int]
"""The first two and the last two vertices of a run."""


@dataclass(frozen=True)
class Skin:
    """A region's two faces: its chart, and loops of edges with whether each is run through forwards; outer first."""

    chart: int
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@dataclass(eq=False)
class Piece:
    """A piece: edges, skins, and its widest gap, millimetres.

    traced : whether its edges are written with their curves on skins and walls, too.
    refused : why it cannot be one closed shell, or ''.
    """

    edges: list[Edge] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)
    skins: list[Skin] = field(default_factory=list)
    gap: float = 0.0
    traced: bool = False
    refused: str = ""

    @property
    def faces(self) -> int:
        """A wall for each edge that is no seam, and two skins for each region."""
        return sum(edge.wall for edge in self.edges) + 2 * len(self.skins)


@dataclass(frozen=True, eq=False)
class Model:
    """All pieces on their charts, the points of their nodes (2, 3), and the thickness; millimetres."""

    charts: list[Chart]
    nodes: Nodes
    pieces: list[Piece]
    thickness: float


class Builder:
    """Builds pieces, again where asked, on one sheet and its charts."""

    def __init__(self, sheet: Sheet, charts: list[Chart], thickness: float) -> None:
        self.sheet, self.charts, self.t = sheet, charts, thickness
        self.nodes = nodes_of(sheet, charts)
        self._made: dict[tuple[Key, int], Edge] = {}

    def piece(self, number: int, level: dict[Key, int]) -> Piece:
        """One piece; level : how often each of its runs was refused."""
        made, seams = Piece(traced=bool(level)), dict[Key, int]()
        for region in self.sheet.regions:
            if region.piece != number:
                continue
            loops = [tuple(self._edge(made, seams, run, region.chart, level) for run in loop) for loop in region.loops]
            area = [enclosed(self._polygon(made, loop, region.chart)) for loop in loops]
            order = sorted(range(len(loops)), key=lambda i: -area[i])
            if not loops or sum(a > 0 for a in area) != 1:
                made.refused = "a chart does not see a part of it as one outline"
            made.skins.append(Skin(region.chart, tuple(loops[i] for i in order)))
        if not any(edge.wall for edge in made.edges):
            made.refused = "it has no outline"
        made.gap = max((edge.gap for edge in made.edges), default=0.0)
        return made

    def _edge(
        self, made: Piece, seams: dict[Key, int], run: Run, chart: int, level: dict[Key, int]
    ) -> tuple[int, bool]:
        """The number of a run's edge, and whether the run goes along it."""
        key, ahead = seam_key(run)
        tight = level.get(key, 0)
        if not is_wall(run) and key in seams:
            return seams[key], ahead
        if (key, tight) not in self._made:
            way = run if ahead or is_wall(run) else Run(run.vertices[::-1], run.beyond, run.around)
            self._made[key, tight] = (
                wall_edge(way, chart, self.charts[chart], self.nodes, self.sheet, tight, self.t)
                if is_wall(run)
                else seam_edge(way, chart, self.charts, self.nodes, self.sheet, tight, self.t)
            )
        if not is_wall(run):
            seams[key] = len(made.edges)
        made.edges.append(self._made[key, tight])
        made.keys.append(key)
        return len(made.edges) - 1, ahead or is_wall(run)

    def _polygon(self, made: Piece, loop: tuple[tuple[int, bool], ...], chart: int) -> Floats:
        """A loop over the plane, as the poles of its curves."""
        ways = [made.edges[i].flat[chart].poles[:: 1 if ahead else -1] for i, ahead in loop]
        return np.concatenate([way[:-1] for way in ways])
