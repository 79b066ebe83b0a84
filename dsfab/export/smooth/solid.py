"""Pieces of a sheet as closed shells: skins and walls on shared edges."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.plate import enclosed
from dsfab.export.smooth.charts import SkinChart
from dsfab.export.smooth.edges import Allowed, Asked, Edge, wall_edges
from dsfab.export.smooth.nodes import Nodes, nodes_of
from dsfab.export.smooth.outline import WALL, OutlineRun, Region, SheetOutline
from dsfab.export.smooth.seams import Key, run_key, seam_edges


@dataclass(frozen=True)
class SmoothSkin:
    """A region's two faces: its chart, and loops of edges with whether each is run through forwards; outer first."""

    chart: int
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@dataclass(eq=False)
class SmoothPiece:
    """A piece: edges with the keys of their runs, skins, and its widest gap, millimetres.

    traced : whether its edges are written with their curves on skins and walls, too.
    refused : why it cannot be one closed shell, or ''.
    """

    edges: list[Edge] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)
    skins: list[SmoothSkin] = field(default_factory=list)
    gap: float = 0.0
    traced: bool = False
    refused: str = ""

    @property
    def faces(self) -> int:
        """A wall for each edge that is no seam, and two skins for each region."""
        return sum(edge.wall for edge in self.edges) + 2 * len(self.skins)

    @property
    def ends(self) -> Floats:
        """(k, 3) the upper ends of its edges."""
        return np.array([edge.upper.poles[0] for edge in self.edges])


@dataclass(frozen=True, eq=False)
class SmoothModel:
    """All pieces on their charts, the points of their nodes (2, 3), and the thickness; millimetres."""

    charts: dict[int, SkinChart]
    nodes: Nodes
    pieces: list[SmoothPiece]
    thickness: float


class Builder:
    """Builds pieces, again where asked, on one sheet and its charts."""

    def __init__(self, sheet: SheetOutline, charts: dict[int, SkinChart], allowed: Allowed) -> None:
        self.sheet, self.allowed = sheet, allowed
        self.nodes = nodes_of(sheet, charts)
        self._made: dict[tuple[Key, int], list[Edge]] = {}
        self._make(sheet.regions, {})

    def piece(self, number: int, level: dict[Key, int], traced: bool = False) -> SmoothPiece:
        """One piece; level : how often each of its runs was refused; traced : as in `SmoothPiece`."""
        made, seams = SmoothPiece(traced=traced), dict[Key, int]()
        regions = [region for region in self.sheet.regions if region.piece == number]
        self._make(regions, level)
        for region in regions:
            loops = [
                tuple(step for run in loop for step in self._edges(made, seams, run, level)) for loop in region.loops
            ]
            area = [enclosed(_polygon(made, loop, region.chart)) for loop in loops]
            order = sorted(range(len(loops)), key=lambda i: -area[i])
            if not loops or sum(a > 0 for a in area) != 1:
                made.refused = "a chart does not see a part of it as one outline"
            made.skins.append(SmoothSkin(region.chart, tuple(loops[i] for i in order)))
        if not any(edge.wall for edge in made.edges):
            made.refused = "it has no outline"
        made.gap = max((edge.gap for edge in made.edges), default=0.0)
        return made

    def _make(self, regions: Iterable[Region], level: dict[Key, int]) -> None:
        """Make the edges of regions that are not made yet, all at once."""
        walls, seams = dict[tuple[Key, int], Asked](), dict[tuple[Key, int], Asked]()
        for chart, run in ((region.chart, run) for region in regions for loop in region.loops for run in loop):
            key, ahead = run_key(run)
            made = key, level.get(key, 0)
            if made not in self._made and made not in seams:
                way = run if run.beyond == WALL or ahead else OutlineRun(run.vertices[::-1], run.beyond, run.width)
                (walls if run.beyond == WALL else seams)[made] = Asked(way, chart, made[1])
        if walls:
            found = wall_edges(list(walls.values()), self.nodes, self.allowed)
            self._made |= dict(zip(walls, found, strict=True))
        if seams:
            both = seam_edges(list(seams.values()), self.nodes, self.sheet, self.allowed)
            self._made |= {made: [edge] for made, edge in zip(seams, both, strict=True)}

    def _edges(
        self, made: SmoothPiece, seams: dict[Key, int], run: OutlineRun, level: dict[Key, int]
    ) -> list[tuple[int, bool]]:
        """The numbers of a run's edges, and whether the run goes along them."""
        key, ahead = run_key(run)
        first = len(made.edges)
        if run.beyond != WALL and key in seams:
            return [(seams[key], ahead)]
        edges = self._made[key, level.get(key, 0)]
        made.edges += edges
        made.keys += [key] * len(edges)
        if run.beyond == WALL:
            return [(first + i, True) for i in range(len(edges))]
        seams[key] = first
        return [(first, ahead)]


def _polygon(made: SmoothPiece, loop: tuple[tuple[int, bool], ...], chart: int) -> Floats:
    """A loop over the plane, as the poles of its curves."""
    ways = [made.edges[i].flat[chart].poles[:: 1 if ahead else -1] for i, ahead in loop]
    return np.concatenate([way[:-1] for way in ways])
