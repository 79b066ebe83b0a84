"""Repair of a mesh's borders: ragged borders and holes."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, face_angles, lengths
from dsfab.surface.topology import EdgeTable, boundary_loops, edge_table

RAGGED_TURN = float(np.radians(35))
"""Smallest turn (in the surface, radians) at vertices of a ragged border; smooth borders of fine meshes turn less."""
LEAST_TURNS = 12
"""Smallest number of alternate left and right turns of a ragged border; fewer may be the corners of an opening."""
LARGEST_GAP = 3  # Largest number of edges between two successive changes of direction on a ragged border.
FLAT = float(np.radians(150))
"""Largest angle of a face at a smoothed border vertex, in radians. Faces with larger angles are removed."""


@dataclass(frozen=True, eq=False)
class EvenEdges:
    """Mesh V (n, 3), F (m, 3) with smooth borders. moved : number of moved vertices. most : longest move, unit of V."""

    V: Floats
    F: Ints
    moved: int
    most: float


def even_edges(V: Floats, F: Ints) -> EvenEdges:
    """Smooth the ragged parts of the borders of a mesh V (n, 3), F (m, 3)."""
    edges = edge_table(F)
    if not edges.boundary.any() or (edges.count > 2).any():
        return EvenEdges(V, F, 0, 0.0)
    turn = _turns(V, F, edges)
    largest = float(np.ptp(V, axis=0).max())
    moved, largest_move = 0, 0.0
    for loop in boundary_loops(F, edges):
        for run, closed in _ragged_runs(turn[loop]):
            line = loop[run]
            better = _smoothed_line(V[line], closed)
            moves = lengths(better - V[line])
            step = lengths(np.diff(V[line], axis=0)).mean()
            # larger moves would destroy intended shapes, such as zigzag borders
            if moves.max() > min(step, 0.04 * largest):
                continue
            changed = _with_line(V, F, line, better)
            if changed is not None:
                V, F = changed
                moved, largest_move = moved + int((moves > 0).sum()), max(largest_move, float(moves.max()))
    return EvenEdges(V, F, moved, largest_move)


def _turns(V: Floats, F: Ints, edges: EdgeTable) -> Floats:
    inside = np.bincount(F.ravel(), face_angles(V, F).ravel(), minlength=len(V))
    at_edge = np.zeros(len(V), dtype=bool)
    at_edge[edges.ends[edges.boundary].ravel()] = True
    return np.asarray(np.where(at_edge, np.pi - inside, 0.0))


def _ragged_runs(turn: Floats) -> list[tuple[Ints, bool]]:
    large = np.flatnonzero(np.abs(turn) > RAGGED_TURN)
    if len(large) < LEAST_TURNS:
        return []
    breaks = np.flatnonzero(np.diff(large, append=large[0] + len(turn)) > LARGEST_GAP)
    if not len(breaks):
        return [(np.arange(len(turn)), True)] if _alternates(turn[large]) else []
    runs = []
    for start, end in zip(breaks, np.roll(breaks, -1), strict=True):
        chosen = large[(start + 1 + np.arange((end - start - 1) % len(large) + 1)) % len(large)]
        if _alternates(turn[chosen]):
            runs.append((np.arange(chosen[0], chosen[-1] + (len(turn) if chosen[-1] < chosen[0] else 0) + 1), False))
    return [(run % len(turn), closed) for run, closed in runs]


def _alternates(turn: Floats) -> bool:
    changes = int((turn[1:] * turn[:-1] < 0).sum())
    return changes >= LEAST_TURNS - 1 and bool(np.abs(turn).sum() >= 3 * abs(turn.sum()))


def _smoothed_line(P: Floats, closed: bool) -> Floats:
    """Smooth a polyline through points P (k, 3) without shrinking it [Taubin 1995]."""
    for k in range(20):
        step = (-0.53 if k % 2 else 0.5) * ((np.roll(P, 1, axis=0) + np.roll(P, -1, axis=0)) / 2 - P)
        if not closed:
            step[[0, -1]] = 0.0
        P = P + step
    return P


def _with_line(V: Floats, F: Ints, line: Ints, better: Floats) -> tuple[Floats, Ints] | None:
    moved = V.copy()
    moved[line] = better
    touched: Ints = np.flatnonzero(np.isin(F, line).any(axis=1))
    flat = _flat_ears(moved, F, touched, line)
    remaining = touched[~flat]
    before, after = area_vectors(V, F[remaining]), area_vectors(moved, F[remaining])
    if (np.einsum("ki,ki->k", before, after) <= 0).any():
        return None
    return moved, np.delete(F, touched[flat], axis=0)


def _flat_ears(V: Floats, F: Ints, touched: Ints, line: Ints) -> Bools:
    once = np.bincount(F.ravel(), minlength=len(V)) == 1
    on_line = np.zeros(len(V), dtype=bool)
    on_line[line] = True
    tip = once[F[touched]] & on_line[F[touched]]
    return np.asarray((tip & (face_angles(V, F[touched]) > FLAT)).any(axis=1))


def hole_triangles(P: Floats, joined: Bools) -> Ints | None:
    """Return the triangles (k - 2, 3) of least area that fill a hole with the outline P (k, 3); None if impossible.
    The triangles are oriented as the outline. joined : (k, k) mask of point pairs that have an edge in the mesh."""
    k = len(P)
    if k == 3:
        return np.array([[0, 1, 2]])
    cost, apex = np.full((k, k), np.inf), np.full((k, k), -1)
    cost[np.arange(k - 1), np.arange(1, k)] = 0.0
    barred = joined.copy()
    barred[0, k - 1] = False
    for span in range(2, k):
        for i in range(k - span):
            j, between = i + span, np.arange(i + 1, i + span)
            if barred[i, j]:
                continue
            total = cost[i, between] + cost[between, j] + _triangle_costs(P[i], P[between], P[j])
            cheapest = int(total.argmin())
            cost[i, j], apex[i, j] = total[cheapest], between[cheapest]
    return _triangles(apex, k) if np.isfinite(cost[0, k - 1]) else None


def _triangle_costs(a: Floats, X: Floats, b: Floats) -> Floats:
    area = lengths(np.cross(X - a, b - a)) / 2
    return np.asarray(area + 1e-3 * (((X - a) ** 2).sum(axis=1) + ((X - b) ** 2).sum(axis=1)))


def _triangles(apex: Ints, k: int) -> Ints:
    triangles, waiting = [], [(0, k - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i > 1:
            m = int(apex[i, j])
            triangles.append((i, m, j))
            waiting += [(i, m), (m, j)]
    return np.array(triangles)
