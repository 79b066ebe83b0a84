"""Fairing: walls (the edges between material and void) become smooth."""

import itertools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array, vstack
from scipy.sparse.linalg import spsolve

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.slicing.cutting.sheet import Sheet, weight_entries
from dsfab.slicing.cutting.walls import Walls
from dsfab.slicing.finishing.mesh_quality import independent, least_angles
from dsfab.surface import Surface
from dsfab.surface.topology import next_half_edge

CORNER = float(np.radians(25))  # Smallest turn of a wall at a corner, radians.
REACH = 2.0  # Length a in `faired_walls`, in wall segments: waves shorter than 2 pi a disappear.
BEND = 0.4  # Length b in `faired_walls`, in wall segments; a larger length makes bends less sharp.


class Freedom(NamedTuple):
    """Directions in which wall vertices `vertex` (k,) may move.
    along : (k, 2, 3) up to two unit vectors; 0 for a missing direction.
    share : (k, 2, 3) change of barycentric weights on uncut vertices `column` (k, 3), per metre in each direction.
    most  : (k,) largest move, metres."""

    vertex: Ints
    along: Floats
    share: Floats
    column: Ints
    most: Floats


def faired_walls(sheet: Sheet) -> Sheet:
    """Make the walls between material and void smooth; the sheet must have no point contacts.
    The walls minimise the integral of d^2 + a^6 k'^2 + b^4 k^2, with move d and curvature k
    [smoothing spline: Reinsch 1967; Wahba 1990]."""
    walls = sheet.walls
    vertex = np.unique(np.concatenate([walls.start, walls.end]))
    free = freedom(sheet, vertex, sheet.weights[vertex])
    if not len(free.vertex):
        return sheet
    step = _fair_steps(sheet, free)
    move = np.einsum("kj,kji->ki", step, free.along)
    length = np.linalg.norm(move, axis=1)
    step = step * np.minimum(1.0, free.most / np.maximum(length, 1e-300))[:, None]
    return _move_vertices(sheet, free, step)


def freedom(sheet: Sheet, vertex: Ints, weights: csr_array) -> Freedom:
    """Return the directions in which vertices (k,) can move inside their uncut face or edge.
    weights : (k, n) barycentric weights of the vertices on the uncut vertices."""
    column, weight = weight_entries(weights)
    has_weight = weight > 0
    count = has_weight.sum(axis=1)
    order = np.argsort(~has_weight, axis=1, kind="stable")
    column = np.take_along_axis(column, order, axis=1)
    sheet_vertex = sheet.same_vertex()[column]
    movable = (count > 1) & ((sheet_vertex >= 0) | (np.arange(3) >= count[:, None])).all(axis=1)
    a, b, c = (sheet.surface.V[sheet_vertex[movable][:, i]] for i in range(3))
    length = np.linalg.norm(b - a, axis=1)
    along, share = np.zeros((2, len(length), 2, 3))
    along[:, 0] = (b - a) / length[:, None]
    share[:, 0, :2] = np.stack([-1 / length, 1 / length], axis=1)
    face = count[movable] == 3
    v, x = (c - a)[face], along[face, 0]
    lean = np.einsum("ki,ki->k", v, x)
    y = v - lean[:, None] * x
    height = np.linalg.norm(y, axis=1)
    along[face, 1] = y / height[:, None]
    lean = lean / length[face]
    share[face, 1] = np.stack([(lean - 1) / height, -lean / height, 1 / height], axis=1)
    return Freedom(vertex[movable], along, share, column[movable], 0.1 * length)


def _fair_steps(sheet: Sheet, free: Freedom) -> Floats:
    n, walls = sheet.surface.n, sheet.walls
    place = np.full(n, -1)
    place[free.vertex] = np.arange(len(free.vertex))
    corner = np.zeros(n, dtype=bool)
    corner[walls.start[np.abs(walls.turns) > CORNER]] = True
    segment = (walls.total / np.diff(walls.begin))[walls.chain]
    all_walls = np.arange(len(walls.start))
    (before, has_previous), (after, has_next) = (walls.walls_ahead(all_walls, 0 * all_walls + k) for k in (-1, 1))
    wall_vertices = np.stack([walls.start[before], walls.start, walls.end, walls.end[after]], axis=1)
    bends = has_previous & ~corner[walls.start]
    changes = bends & has_next & ~corner[walls.end] & (wall_vertices[:, 0] != wall_vertices[:, 3])
    side = _lateral(sheet, wall_vertices)
    rows, right_side = list[csr_array](), list[Floats]()
    for used, points, order, size in (
        (changes, wall_vertices, 3, REACH * segment),
        (bends, wall_vertices[:, :3], 2, BEND * segment),
    ):
        q, least = points[used], 0.02 * segment[used]  # `least` replaces smaller distances
        c, scale = _differences(sheet.surface.V[q], least, order)
        c = c * (size[used] ** order * np.sqrt(scale))[:, None]
        row, value = _rows(q, c[:, :, None] * side[used][:, None], place, free)
        rows.append(row)
        right_side.append(-np.einsum("kji,kji->k", value, sheet.surface.V[q]))
    for end in (walls.start, walls.end):
        row, _ = _rows(end[:, None], (np.sqrt(walls.length / 2)[:, None] * side)[:, None], place, free)
        rows.append(row)
        right_side.append(np.zeros(len(end)))
    A = csr_array(vstack(rows, format="csr"))
    hold = 0.1 * segment.mean() + np.zeros(2 * len(free.vertex))  # stiffness against moves along a wall
    x = spsolve((A.T @ A + diags_array(hold)).tocsc(), A.T @ np.concatenate(right_side))
    return np.asarray(x.reshape(-1, 2) * free.along.any(axis=2))


def _lateral(sheet: Sheet, p: Ints) -> Floats:
    normals, V = sheet.surface.normals, sheet.surface.V
    up = normals[sheet.walls.void_cells] + normals[sheet.walls.material_cells]
    across = np.cross(up, V[p[:, 3]] - V[p[:, 0]])
    flat = np.cross(up, V[p[:, 2]] - V[p[:, 1]])
    size, flat_size = (np.linalg.norm(vectors, axis=1)[:, None] for vectors in (across, flat))
    return np.asarray(np.where(size > 0, across / np.maximum(size, 1e-300), flat / np.maximum(flat_size, 1e-300)))


def _differences(P: Floats, least: Floats, order: int) -> tuple[Floats, Floats]:
    length = np.maximum(np.linalg.norm(np.diff(P, axis=1), axis=2), least[:, None])
    u = np.concatenate([np.zeros((len(P), 1)), np.cumsum(length, axis=1)], axis=1)
    gap = u[:, :, None] - u[:, None, :] + np.eye(order + 1)
    factor = float(np.prod(np.arange(1, order + 1)))
    return factor / gap.prod(axis=2), length[:, 1] if order == 3 else length.mean(axis=1)


def _rows(q: Ints, value: Floats, place: Ints, free: Freedom) -> tuple[csr_array, Floats]:
    k, j = np.nonzero(place[q] >= 0)
    free_vertex = place[q[k, j]]
    data = np.einsum("pi,pci->pc", value[k, j], free.along[free_vertex])
    row, column = np.repeat(k, 2), (2 * free_vertex[:, None] + np.arange(2)).ravel()
    return csr_array((data.ravel(), (row, column)), shape=(len(q), 2 * len(free.vertex))), value


def _move_vertices(sheet: Sheet, free: Freedom, step: Floats) -> Sheet:
    surface = sheet.surface
    share = np.ones(surface.n)
    move = np.zeros((surface.n, 3))
    move[free.vertex] = np.einsum("kj,kji->ki", step, free.along)
    touched = np.flatnonzero((move != 0).any(axis=1)[surface.F].any(axis=1))
    F, normals = surface.F[touched], surface.normals[touched]
    before = least_angles(surface.V[F], normals)
    slimmest, halvings = 0.5, 7  # smallest angle of a cell, degrees; largest number of halvings
    for attempt in itertools.count():  # repeat, because a shorter move may make a neighbouring cell slim
        V = surface.V + share[:, None] * move
        bad = least_angles(V[F], normals) < np.minimum(before, slimmest)
        if not bad.any():
            break
        share[F[bad]] *= 0.5 if attempt < halvings else 0.0
    added = np.einsum("kj,kjc->kc", step, free.share) * share[free.vertex][:, None]
    row = np.repeat(free.vertex, 3)
    change = csr_array((added.ravel(), (row, free.column.ravel())), shape=sheet.weights.shape)
    return replace(sheet, surface=Surface(V, surface.F), weights=csr_array(sheet.weights + change))


@dataclass(frozen=True, eq=False)
class Division:
    """Walls (k,) to divide, each by a new vertex. V : (k, 3) new vertices, m. weights : (k, n) barycentric weights."""

    wall: Ints
    V: Floats
    weights: csr_array

    def subset(self, chosen: Bools) -> "Division":
        """Return this division with only the walls `chosen` (k,)."""
        rows = np.flatnonzero(chosen)
        return Division(self.wall[rows], self.V[rows], self.weights[rows])


def divided_walls(sheet: Sheet) -> Sheet:
    """Divide walls of a sheet where the outline bends. New vertices follow the bend, so the outline gets smoother."""
    for _ in range(3):  # each division about halves the angles between consecutive walls
        division = _division(sheet)
        if not len(division.wall):
            break
        sheet = _divide_walls(sheet, division)
    return sheet


def _bows(walls: Walls) -> Floats:
    if not len(walls.start):
        return np.empty(0)
    turn, all_walls = walls.turns, np.arange(len(walls.start))
    (before, has_previous), (after, has_next) = (walls.walls_ahead(all_walls, 0 * all_walls + k) for k in (-1, 1))
    has_turn = has_previous & (np.abs(turn) < CORNER)
    curvature = np.zeros(len(turn))
    curvature[has_turn] = (turn / ((walls.length[before] + walls.length) / 2))[has_turn]
    ends = has_turn.astype(np.int64) + (has_turn[after] & has_next)
    mean = (curvature + np.where(has_next, curvature[after], 0.0)) / np.maximum(ends, 1)
    bent = np.abs(mean) * walls.length > np.radians(3)
    return np.asarray(np.where(bent, mean * walls.length**2 / 8, 0.0))


def _division(sheet: Sheet) -> Division:
    walls = sheet.walls
    bow = _bows(walls)
    wall = np.flatnonzero((bow != 0) & (sheet.parent[walls.void_cells] == sheet.parent[walls.material_cells]))
    wall = wall[np.argsort(-np.abs(bow[wall]), kind="stable")]
    middle = csr_array(0.5 * (sheet.weights[walls.start[wall]] + sheet.weights[walls.end[wall]]))
    free = freedom(sheet, np.arange(len(wall)), middle)
    face = free.along[:, 1].any(axis=1)
    wall, middle, along, share = wall[free.vertex], middle[free.vertex], free.along, free.share
    V = sheet.surface.V
    a, b = V[walls.start[wall]], V[walls.end[wall]]
    left_normal = np.cross(sheet.surface.normals[walls.void_cells[wall]], b - a) / walls.length[wall][:, None]
    step = -bow[wall][:, None] * np.einsum("kji,ki->kj", along, left_normal)
    row = np.repeat(np.arange(len(wall)), 3)
    change = (np.einsum("kj,kjc->kc", step, share).ravel(), (row, free.column.ravel()))
    weights = csr_array(middle + csr_array(change, shape=middle.shape))
    division = Division(wall, (a + b) / 2 + np.einsum("kj,kji->ki", step, along), weights)
    least_weight = np.full(len(wall), np.inf)
    np.minimum.at(least_weight, np.repeat(np.arange(len(wall)), np.diff(weights.indptr)), weights.data)
    division = division.subset(face & (least_weight > 1e-3))
    division = division.subset(_keeps_angles(sheet, division))
    rank = np.arange(len(division.wall))
    cells = np.concatenate([walls.void_cells[division.wall], walls.material_cells[division.wall]])
    return division.subset(independent(np.concatenate([rank, rank]), cells, rank, sheet.surface.m))


def _halves(sheet: Sheet, half_edge: Ints, new_vertex: Ints) -> tuple[Ints, Ints]:
    cell, side = np.divmod(half_edge, 3)
    a, b, c = (sheet.surface.F[cell, (side + j) % 3] for j in range(3))
    return np.stack([a, new_vertex, c], axis=1), np.stack([new_vertex, b, c], axis=1)


def _keeps_angles(sheet: Sheet, division: Division) -> Bools:
    surface = sheet.surface
    V, number = np.concatenate([surface.V, division.V]), surface.n + np.arange(len(division.wall))
    accepted = np.ones(len(division.wall), dtype=bool)
    for h in (sheet.walls.inside[division.wall], sheet.walls.outside[division.wall]):
        normals = surface.normals[h // 3]
        least = 0.5 * np.minimum(4.0, least_angles(surface.V[surface.F[h // 3]], normals))
        for F in _halves(sheet, h, number):
            accepted &= least_angles(V[F], normals) >= least
    return accepted


def _divide_walls(sheet: Sheet, division: Division) -> Sheet:
    surface = sheet.surface
    number = surface.n + np.arange(len(division.wall))
    F, rows, source_cells = surface.F.copy(), list[Ints](), list[Ints]()
    sides_on, back_sides_on = sheet.sides_on.copy(), list[Ints]()
    for h in (sheet.walls.inside[division.wall], sheet.walls.outside[division.wall]):
        front, back = _halves(sheet, h, number)
        F[h // 3] = front
        rows.append(back)
        source_cells.append(h // 3)
        wall, ahead, behind = (sheet.sides_on.ravel()[next_half_edge(h, steps)] for steps in range(3))
        sides_on[h // 3] = np.stack([wall, 0 * wall, behind], axis=1)
        back_sides_on.append(np.stack([wall, ahead, 0 * wall], axis=1))
    source = np.concatenate([np.arange(surface.m), *source_cells])
    order = np.argsort(source, kind="stable")
    source = source[order]
    divided = Surface(np.concatenate([surface.V, division.V]), np.concatenate([F, *rows])[order])
    weights = csr_array(vstack([sheet.weights, division.weights], format="csr"))
    sides_on = np.concatenate([sides_on, *back_sides_on])[order]
    columns = (sheet.parent[source], sheet.family[source], weights, sheet.stubs, sides_on, sheet.lines)
    return Sheet(divided, *columns)
