"""Borders of a mesh: ragged edges evened, and triangles across small holes."""

from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, area_vectors, face_angles, lengths
from dsfab.surface.topology import EdgeTable, boundary_loops, edge_table

TURN = float(np.radians(35))
"""In the surface; edges that are divided finely enough turn by less at each vertex, but for corners that are meant."""
STEPS = 12
"""Fewer turns to and fro in a row may be meant: a door in a wall has four corners, and an opening of fifteen edges, as
of a roof of 5 m, may be drawn so. (Made even, that one had no STEP by members.)"""
APART = 3
"""Edges from one turn to the next, at most: teeth of more are not those of the mesh."""
TO_AND_FRO = 3.0
"""How many times more such an edge turns than it turns in all, at least."""
DEEPEST = 1.0
"""Of the edges there; what would have to move farther is deeper than the steps of a mesh, and somebody's design."""
SMALL = 1 / 25
"""Of the largest side; a coarse star has points that are larger."""
SHRINK, SWELL = 0.5, -0.53
"""Shares of the way to the middle of the neighbours, by turns: teeth go, and arcs keep their radius [Taubin 1995]."""
PASSES = 10
FLAT = float(np.radians(150))
"""A face whose corner at an edge is wider has been evened away, and goes."""


@dataclass(frozen=True, eq=False)
class EvenEdges:
    """A mesh V (n, 3), F (m, 3), the number of vertices that were moved, and how far at most, in its unit."""

    V: Floats
    F: Ints
    moved: int
    most: float


def even_edges(V: Floats, F: Ints) -> EvenEdges:
    """The mesh V (n, 3), F (m, 3) with its ragged edges made even; as it is where an edge has more than two faces.

    Steps of an edge are ragged where the sheet turns by `TURN` and more, to and fro, `STEPS` times in a row with no
    more than `APART` edges between. Their vertices move by no more than an edge, or stay where they are.
    """
    edges = edge_table(F)
    if not edges.boundary.any() or (edges.count > 2).any():
        return EvenEdges(V, F, 0, 0.0)
    turn = _turns(V, F, edges)
    largest = float(np.ptp(V, axis=0).max())
    moved, most = 0, 0.0
    for loop in boundary_loops(F, edges):
        for run, closed in _ragged_runs(turn[loop]):
            line = loop[run]
            better = _evened(V[line], closed)
            far = lengths(better - V[line])
            step = lengths(np.diff(V[line], axis=0)).mean()
            if far.max() > min(DEEPEST * step, SMALL * largest):
                continue
            found = _with_line(V, F, line, better)
            if found is not None:
                V, F = found
                moved, most = moved + int((far > 0).sum()), max(most, float(far.max()))
    return EvenEdges(V, F, moved, most)


def _turns(V: Floats, F: Ints, edges: EdgeTable) -> Floats:
    """(n,) by how much the edge turns in the surface at its vertices, radians, towards the sheet; 0 elsewhere."""
    inside = np.bincount(F.ravel(), face_angles(V, F).ravel(), minlength=len(V))
    at_edge = np.zeros(len(V), dtype=bool)
    at_edge[edges.ends[edges.boundary].ravel()] = True
    return np.asarray(np.where(at_edge, np.pi - inside, 0.0))


def _ragged_runs(turn: Floats) -> list[tuple[Ints, bool]]:
    """Places (k,) of each ragged stretch of a closed line with turns (j,), in order, and whether it is all of it."""
    large = np.flatnonzero(np.abs(turn) > TURN)
    if len(large) < STEPS:
        return []
    gap = np.diff(large, append=large[0] + len(turn))
    breaks = np.flatnonzero(gap > APART)
    if not len(breaks):
        return [(np.arange(len(turn)), True)] if _to_and_fro(turn[large]) else []
    runs = []
    for one, other in zip(breaks, np.roll(breaks, -1), strict=True):
        count = (other - one - 1) % len(large) + 1
        chosen = large[(one + 1 + np.arange(count)) % len(large)]
        if _to_and_fro(turn[chosen]):
            runs.append((np.arange(chosen[0], chosen[-1] + (len(turn) if chosen[-1] < chosen[0] else 0) + 1), False))
    return [(run % len(turn), closed) for run, closed in runs]


def _to_and_fro(turn: Floats) -> bool:
    """Whether turns (k,) in a row cancel, and change their sign often enough."""
    changes = int((turn[1:] * turn[:-1] < 0).sum())
    return changes >= STEPS - 1 and bool(np.abs(turn).sum() >= TO_AND_FRO * abs(turn.sum()))


def _evened(P: Floats, closed: bool) -> Floats:
    """(k, 3) points of a line without its teeth; the ends of one that is not closed stay."""
    for k in range(2 * PASSES):
        step = (SWELL if k % 2 else SHRINK) * ((np.roll(P, 1, axis=0) + np.roll(P, -1, axis=0)) / 2 - P)
        if not closed:
            step[[0, -1]] = 0.0
        P = P + step
    return P


def _with_line(V: Floats, F: Ints, line: Ints, better: Floats) -> tuple[Floats, Ints] | None:
    """The mesh with vertices `line` (k,) at `better` (k, 3), without faces that are flat there; None if any turns."""
    new = V.copy()
    new[line] = better
    touched: Ints = np.flatnonzero(np.isin(F, line).any(axis=1))
    flat = _flat_ears(new, F, touched, line)
    kept = touched[~flat]
    before, after = area_vectors(V, F[kept]), area_vectors(new, F[kept])
    if (np.einsum("ki,ki->k", before, after) <= 0).any():
        return None
    return new, np.delete(F, touched[flat], axis=0)


def _flat_ears(V: Floats, F: Ints, touched: Ints, line: Ints) -> Bools:
    """(k,) which of the faces touched have two open edges at a vertex of the line, and are flat or turned there."""
    once = np.bincount(F.ravel(), minlength=len(V)) == 1
    on_line = np.zeros(len(V), dtype=bool)
    on_line[line] = True
    tip = once[F[touched]] & on_line[F[touched]]
    return np.asarray((tip & (face_angles(V, F[touched]) > FLAT)).any(axis=1))


LONG = 1e-3
"""Of two ways to fill a hole with as much area the one with shorter edges is better: their squares count by so much."""


def hole_triangles(P: Floats, joined: Bools) -> Ints | None:
    """(k - 2, 3) corners of triangles that fill the outline P (k, 3), with the least area; None where there are none.

    joined : (k, k) pairs of points that the mesh joins already, of which no edge may be made again.

    The triangles run around as the outline does.
    """
    k = len(P)
    if k == 3:
        return np.array([[0, 1, 2]])
    cost, apex = np.full((k, k), np.inf), np.full((k, k), -1)
    cost[np.arange(k - 1), np.arange(1, k)] = 0.0
    barred = joined.copy()
    barred[0, k - 1] = False  # an edge of the outline
    for span in range(2, k):
        for i in range(k - span):
            j, between = i + span, np.arange(i + 1, i + span)
            if barred[i, j]:
                continue
            total = cost[i, between] + cost[between, j] + _weights(P[i], P[between], P[j])
            best = int(total.argmin())
            cost[i, j], apex[i, j] = total[best], between[best]
    return _triangles(apex, k) if np.isfinite(cost[0, k - 1]) else None


def _weights(a: Floats, X: Floats, b: Floats) -> Floats:
    """(k,) area of the triangles a, X, b, and a little of the squares of their edges."""
    area = lengths(np.cross(X - a, b - a)) / 2
    squares = ((X - a) ** 2).sum(axis=1) + ((X - b) ** 2).sum(axis=1)
    return np.asarray(area + LONG * squares)


def _triangles(apex: Ints, k: int) -> Ints:
    """The triangles that the best apex of each pair of points leads to."""
    found, waiting = [], [(0, k - 1)]
    while waiting:
        i, j = waiting.pop()
        if j - i > 1:
            m = int(apex[i, j])
            found.append((i, m, j))
            waiting += [(i, m), (m, j)]
    return np.array(found)
