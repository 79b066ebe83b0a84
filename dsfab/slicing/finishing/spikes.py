r"""`without_spikes`: cut off teeth of a member that stick out into an opening.

opening          The outline has a sharp tip between two re-entrant corners a and b.
   .
__/ \____        The part beyond the chord a-b becomes void.
 a  b  member"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.slicing.cutting.cut import recut_polygons, with_polygons
from dsfab.slicing.cutting.sheet import VOID, LineKind, Sheet
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.cutting.walls import SHARPEST, Walls
from dsfab.slicing.finishing.openings import disjoint_groups

SHARP = float(np.radians(60))
"""Minimum turn of the outline at the tip of a tooth (spike), radians. Bends and crossings of members turn less."""
LONG, THIN, FAR = 1.5, 0.5, 4.0
"""Largest outline length of a tooth (spike), in member widths: `LONG`, or `FAR` if its base is under `THIN` widths."""


class Spike(NamedTuple):
    """A tooth (spike): material that sticks out of a member. The chord is the base of the tooth.
    outline : (k,) vertices.    cells : (c,) cells at least partly beyond the chord.    origin : (3,) first corner.
    outward : (3,) unit normal of the chord, out of the member.    snap : metres; smaller heights count as 0."""

    outline: Ints
    cells: Ints
    origin: Floats
    outward: Floats
    snap: float

    def heights(self, X: Floats) -> Floats:
        """Return the heights (k,) of points X (k, 3) above the base of the tooth, metres."""
        height = (X - self.origin) @ self.outward
        return np.asarray(np.where(np.abs(height) < self.snap, 0.0, height))


def without_spikes(cells: Sheet) -> tuple[Sheet, int]:
    """Cut teeth (spikes) off the material of a sheet; return also the number of teeth."""
    count = 0
    for _ in range(4):  # repeat, because a round cuts only spikes that do not touch each other
        all_spikes = _spikes(cells) if cells.has_openings else []
        spikes = [all_spikes[k] for k in disjoint_groups(cells, [spike.cells for spike in all_spikes])]
        if not spikes:
            break
        cells, count = _cut_off(cells, spikes), count + len(spikes)
    return cells, count


def _spikes(cells: Sheet) -> list[Spike]:
    walls, turn, width = cells.walls, cells.walls.turns, _member_width(cells)
    spikes = []
    for tip in np.flatnonzero(np.isfinite(turn) & (turn < -SHARP)).tolist():
        before, behind = (_corners_beside(walls, tip, step, FAR * width) for step in (-1, 1))
        pairs = sorted(
            ((length_before + length_behind, i, j) for i, length_before in before for j, length_behind in behind),
            reverse=True,
        )
        longest = min(FAR * width, float(walls.total[walls.chain[tip]]))
        ranges = (np.arange(-i, j) for length, i, j in pairs if length < longest)
        teeth = (_tooth(cells, walls.walls_ahead(np.full(len(k), tip), k)[0], width) for k in ranges)
        spikes.append(next((tooth for tooth in teeth if tooth is not None), None))
    return [spike for spike in spikes if spike is not None]


def _member_width(cells: Sheet) -> float:
    surface, material = cells.surface, cells.material
    edge = np.zeros(len(surface.edges.ends), dtype=bool)
    edge[surface.edges.of[material]] = True
    around = cells.walls.length.sum() + surface.edge_lengths[edge & surface.edges.boundary].sum()
    return float(2 * surface.areas[material].sum() / around)


def _corners_beside(walls: Walls, tip: int, step: int, longest: float) -> list[tuple[int, float]]:
    corners, length, size = list[tuple[int, float]](), 0.0, int(np.diff(walls.begin)[walls.chain[tip]])
    for k in range(1, size):
        (previous_wall, wall), exists = walls.walls_ahead(np.array([tip, tip]), step * np.array([k - 1, k]))
        length += float(walls.length[wall if step < 0 else previous_wall])
        if not exists[1] or length > longest:  # the chain of walls ends, or the wall is too far away
            break
        if walls.turns[wall] > SHARPEST:
            corners.append((k, length))
    return corners


def _tooth(cells: Sheet, stretch: Ints, width: float) -> Spike | None:
    """Return the tooth (spike of material) with the walls `stretch` (k,) as its outline, or None."""
    V, walls = cells.surface.V, cells.walls
    outline, member_cells = np.append(walls.start[stretch], walls.end[stretch[-1]]), walls.material_cells[stretch]
    X, step = V[outline], walls.length[stretch]
    chord, up = (X[-1] - X[0], step @ cells.surface.normals[member_cells])  # up: mean normal along the outline
    length, outward = float(np.linalg.norm(chord)), np.cross(up, chord)
    if not outward.any() or step.sum() > (FAR if length < THIN * width else LONG) * width:
        return None
    spike = Spike(outline, member_cells, X[0], outward / np.linalg.norm(outward), 2e-3 * length)
    height = spike.heights(X)
    lowest = max(0.04 * width, 0.25 * length)  # minimum height of a tooth; bends and tiny shapes are lower
    if height.min() < 0 or height.max() < lowest:
        return None
    reached = _cells_beyond_chord(cells, spike)
    return None if reached is None else spike._replace(cells=reached)


def _cells_beyond_chord(cells: Sheet, spike: Spike) -> Ints | None:
    surface, material, twins = cells.surface, cells.material, cells.surface.edges.twins
    outline_vertices, seen, waiting = set(spike.outline.tolist()), set[int](), set(spike.cells.tolist())
    while waiting:
        cell = waiting.pop()
        seen.add(cell)
        corner = surface.F[cell]
        height = spike.heights(surface.V[corner])
        for c in range(3):
            if max(height[c], height[c - 2]) <= 0:
                continue
            beyond = int(twins[3 * cell + c]) // 3
            if beyond < 0 or not material[beyond]:
                if not outline_vertices.issuperset((int(corner[c]), int(corner[c - 2]))):
                    return None
            elif beyond not in seen:
                waiting.add(beyond)
    return np.array(sorted(seen))


def _cut_off(cells: Sheet, spikes: list[Spike]) -> Sheet:
    mesh, source = recut_polygons(cells, np.concatenate([spike.cells for spike in spikes]))
    x, active = np.zeros(len(mesh.X)), np.zeros(len(source), dtype=bool)
    for spike in spikes:
        rows = np.searchsorted(source, spike.cells)
        active[rows] = True
        vertex = np.unique(mesh.cells.corner[mesh.cells.slots(rows)])
        x[vertex] = spike.heights(mesh.X[vertex])
    split = clean_split(mesh.cells, mesh.X, x, np.zeros(1), active, Snapping(0.0, cells.surface.size))
    chord = np.full((1, 1), mesh.lines.count)
    mesh = replace(mesh.after_split(split, chord), lines=mesh.lines.with_more(LineKind.CHORD, 1))
    beyond = active[split.source] & (split.strip == 1)
    return with_polygons(cells, replace(mesh, family=np.where(beyond, VOID, mesh.family)), source[split.source])
