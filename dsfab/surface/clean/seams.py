"""Repair of a mesh's seams: merging of vertices with equal positions, and joining of patches along open seams."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.core.arrays import (
    Bools,
    Floats,
    Ints,
    area_vectors,
    distances_from_segments,
    distinct,
    lengths,
    positions_on_segments,
)
from dsfab.surface.topology import EdgeTable, corner_fans, edge_table, link_components, next_half_edge, pinches

WELD = 5e-5  # Vertices closer than this fraction of the mesh's largest dimension become one vertex.
ASTRAY_RATIO = 1000.0  # A vertex is astray if its distance from the median is above this x the 99 % quantile.


def in_reach(V: Floats) -> Bools:
    """Return a mask (n,) of the vertices V (n, 3) that are finite and not extremely far from most vertices."""
    is_near: Bools = np.asarray(np.isfinite(V).all(axis=1))
    if not is_near.any():
        return is_near
    from_middle = np.abs(V[is_near] - np.median(V[is_near], axis=0)).max(axis=1)
    typical = float(np.quantile(from_middle, 0.99, method="lower"))
    if typical > 0:
        is_near[is_near] = from_middle <= ASTRAY_RATIO * typical
    return is_near


def merged_vertices(
    V: Floats, within: float = 1e-9, apart: Callable[[Ints], Bools] | None = None
) -> tuple[Floats, Ints]:
    """Merge near vertices of V (n, 3). Return the remaining vertices, and the new number (n,) of each vertex.
    within : largest distance between merged vertices, divided by the mesh's largest dimension.
    apart  : function that takes pairs of vertices (p, 2), and returns a mask (p,) of pairs that must not be merged."""
    alone = V, np.arange(len(V))
    if not len(V) or not np.isfinite(V).all():  # a later check reports nan and inf
        return alone
    reach = within * float(np.ptp(V, axis=0).max())
    pairs = cKDTree(V).query_pairs(reach, output_type="ndarray")
    pairs = pairs[~apart(pairs)] if apart and len(pairs) else pairs
    if not len(pairs):
        return alone
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(V), len(V)))
    label = connected_components(links, directed=False)[1]
    _, first_vertices, became = np.unique(label, return_index=True, return_inverse=True)
    targets = _without_chains(V, pairs, first_vertices[became.ravel()], reach)
    remaining, became = np.unique(targets, return_inverse=True)
    return V[remaining], became.ravel()


def _without_chains(V: Floats, pairs: Ints, targets: Ints, reach: float) -> Ints:
    """Return the number (n,) of the vertex that replaces each vertex, with all distances at most `reach`.
    targets : (n,) first proposal, which may have longer distances because of chains of near vertices."""
    long = np.unique(targets[lengths(V - V[targets]) > reach])
    if not len(long):
        return targets
    neighbours: dict[int, list[int]] = {}
    for a, b in np.sort(pairs[np.isin(targets[pairs[:, 0]], long)], axis=1).tolist():
        neighbours.setdefault(b, []).append(a)
    targets = targets.copy()
    for vertex in np.flatnonzero(np.isin(targets, long)).tolist():
        targets[vertex] = min((k for k in neighbours.get(vertex, ()) if targets[k] == k), default=vertex)
    return targets


def equal_merged(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Merge vertices V (n, 3) with equal coordinates. Return the sorted vertices, and faces F (m, 3) on them."""
    fewer, became = np.unique(V + 0.0, axis=0, return_inverse=True)
    return fewer, became.ravel()[F]


def coincident(V: Floats) -> int:
    """Return the number of vertices V (n, 3) that have the position of an earlier vertex."""
    return len(V) - len(merged_vertices(V)[0])


SAG = 1 / 15
"""Largest width of an open seam, divided by the length of an edge there: height / chord of an arc of 30 degrees."""


def stitched_faces(V: Floats, F: Ints, within: float) -> tuple[Ints, int]:
    """Close open seams: divide boundary edges of faces F (m, 3) at near boundary vertices of other faces.
    Return the faces and the number of these vertices. within : largest distance of a vertex from an edge, unit of V."""
    faces, joined = F, 0
    for _ in range(4):  # each round stitches at most one edge of a face
        half, vertex = _open_seams(V, faces, edge_table(faces), within)
        if not len(half):
            break
        faces = _with_fans(V, faces, half, vertex)
        joined += len(half)
    return (F, 0) if (edge_table(faces).count > 2).sum() > (edge_table(F).count > 2).sum() else (faces, joined)


def _open_seams(V: Floats, F: Ints, edges: EdgeTable, within: float) -> tuple[Ints, Ints]:
    """Return k boundary half-edges (k,), and for each the number (k,) of a vertex of another face that lies on it.
    within : largest distance between the vertex and the half-edge, in the unit of V."""
    alone = np.flatnonzero(edges.boundary)
    half, ends = edges.order[edges.start[alone]], edges.ends[alone]
    edge, vertex = near_vertices(V, ends, within)
    if not len(edge):
        return half[:0], vertex
    distance = distances_from_segments(V[vertex], V[ends[edge, 0]], V[ends[edge, 1]])
    long = lengths(V[ends[edge, 1]] - V[ends[edge, 0]])
    is_on = (distance <= within) | ((distance <= SAG * long) & _on_one_seam(ends, edge, vertex))
    is_on &= (F[half[edge] // 3] != vertex[:, None]).all(axis=1)
    edge, vertex, distance = edge[is_on], vertex[is_on], distance[is_on]
    nearest = np.lexsort((distance, vertex))
    nearest = nearest[np.diff(vertex[nearest], prepend=-1) > 0]
    edge, vertex = edge[nearest], vertex[nearest]
    face = half[edge] // 3
    first_edge = np.full(len(F), len(alone))
    np.minimum.at(first_edge, face, edge)
    now = first_edge[face] == edge
    return half[edge[now]], vertex[now]


def near_vertices(V: Floats, ends: Ints, within: float) -> tuple[Ints, Ints]:
    """Return k pairs of a boundary edge (row of `ends`) and a boundary vertex near this edge, as (k,) and (k,).
    ends   : (b, 2) vertices of each boundary edge.    within : search distance; it is larger at long edges."""
    a, b = V[ends].transpose(1, 0, 2)
    border, loops = np.unique(ends), (np.bincount(ends.ravel())[ends] == 2).all()
    long = lengths(b - a)
    reach = np.maximum((0.0 if loops else SAG) * long, within)
    tree, edge, start, size = cKDTree(V[border]), np.arange(len(ends)), np.zeros(len(ends)), 1.0
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    while len(edge):
        # divide long edges with many vertices nearby into four parts
        middle = a[edge] + (start + size / 2)[:, None] * (b - a)[edge]
        radius = size / 2 * long[edge] + reach[edge]
        crowded, k, border_index = _few_within(tree, middle, radius)
        pairs.append(np.stack([edge[k], border[border_index]], axis=1))
        long_ones = crowded & (size * long[edge] > reach[edge])
        k, border_index = _all_within(tree, middle, radius, np.flatnonzero(crowded & ~long_ones))
        pairs.append(np.stack([edge[k], border[border_index]], axis=1))
        size /= 4
        edge, start = np.repeat(edge[long_ones], 4), (start[long_ones, None] + size * np.arange(4)).ravel()
    edge, vertex = _distinct_pairs(np.concatenate(pairs), len(V))
    along = positions_on_segments(V[vertex], a[edge], b[edge])
    is_beside = (along > 0) & (along < 1) & (ends[edge] != vertex[:, None]).all(axis=1)
    return edge[is_beside], vertex[is_beside]


def _few_within(tree: cKDTree, places: Floats, radius: Floats, crowd: int = 8) -> tuple[Bools, Ints, Ints]:
    """Return a mask of the balls that contain more than `crowd` points of `tree`.
    For all other balls, return the pairs of a ball and a point in it. places, radius : centres and radii."""
    # the search omits points exactly at the upper bound
    distance, point = tree.query(places, crowd + 1, distance_upper_bound=np.nextafter(radius.max(), np.inf))
    inside = distance <= radius[:, None]
    crowded: Bools = inside[:, crowd]
    k, column = np.nonzero(inside & ~crowded[:, None])
    return crowded, k, np.asarray(point, dtype=np.int64)[k, column]


def _all_within(tree: cKDTree, places: Floats, radius: Floats, selected: Ints) -> tuple[Ints, Ints]:
    lists: list[list[int]] = list(tree.query_ball_point(places[selected], radius[selected])) if len(selected) else []
    points = np.concatenate([np.zeros(0, dtype=np.int64), *lists]).astype(np.int64)
    return np.repeat(selected, [len(members) for members in lists]), points


def _distinct_pairs(pairs: Ints, n: int) -> tuple[Ints, Ints]:
    first_column, second_column = np.divmod(distinct(pairs[:, 0] * n + pairs[:, 1]), n)
    return first_column, second_column


def _on_one_seam(ends: Ints, edge: Ints, vertex: Ints) -> Bools:
    degree = np.bincount(ends.ravel())
    order = np.argsort(ends.ravel(), kind="stable")
    pairs = order[np.flatnonzero(degree[ends.ravel()[order]] == 2)].reshape(-1, 2) // 2
    count, strand = link_components(len(ends), *pairs.T)
    of_vertex = np.full(len(degree), -1)
    of_vertex[ends] = strand[:, None]
    node = degree[ends] != 2
    stops = np.stack([np.full(count, -1), np.full(count, -1)], axis=1)
    np.maximum.at(stops[:, 1], np.repeat(strand, 2)[node.ravel()], ends[node])
    stops[:, 0] = len(degree)
    np.minimum.at(stops[:, 0], np.repeat(strand, 2)[node.ravel()], ends[node])
    edge_strand, vertex_strand = strand[edge], of_vertex[vertex]
    met = (stops[edge_strand] == stops[vertex_strand]).all(axis=1) & (stops[edge_strand, 1] >= 0)
    return np.asarray(met & (edge_strand != vertex_strand) & (degree[vertex] == 2))


def _with_fans(V: Floats, F: Ints, half: Ints, vertex: Ints) -> Ints:
    start, end, across = (F.ravel()[next_half_edge(half, k)] for k in range(3))
    order = np.lexsort((positions_on_segments(V[vertex], V[start], V[end]), half))
    half, vertex, end, across = half[order], vertex[order], end[order], across[order]
    is_last = np.append(half[1:] != half[:-1], True)
    onward = np.where(is_last, end, np.roll(vertex, -1))
    faces = F.copy()
    is_first = np.append(True, is_last[:-1])
    faces.ravel()[next_half_edge(half[is_first])] = vertex[is_first]
    return np.concatenate([faces, np.stack([vertex, onward, across], axis=1)])


def faces_with_area(V: Floats, F: Ints) -> Ints:
    """Return the indices (k,) of the faces of a mesh V (n, 3), F (m, 3) that have more than a tiny area."""
    P = V[F]
    longest = lengths(P - np.roll(P, 1, axis=1)).max(axis=1, initial=0)
    return np.flatnonzero(lengths(area_vectors(V, F)) > 1e-9 * longest**2)


def joined_at_points(V: Floats, F: Ints) -> tuple[Ints, int]:
    """Add a face wherever two parts of a mesh V (n, 3), F (m, 3) touch only in a vertex. The face joins the parts.
    Return the faces and the number of new faces."""
    edges = edge_table(F)
    points = pinches(F, edges, len(V))
    if not len(points):
        return F, 0
    fans, alone = corner_fans(F, edges), edges.outline
    onward = next_half_edge(alone)
    corner_vertex = np.concatenate([F.ravel()[alone], F.ravel()[onward]])
    away = np.concatenate([F.ravel()[onward], F.ravel()[alone]])
    fan = np.concatenate([fans.ravel()[alone], fans.ravel()[onward]])
    candidates = [_gusset(V, int(v), away[corner_vertex == v], fan[corner_vertex == v]) for v in points]
    gussets = np.array([face for face in candidates if face is not None], dtype=np.int64).reshape(-1, 3)
    gussets = gussets[faces_with_area(V, gussets)]  # a gap without area needs no face
    _, first_faces = np.unique(np.sort(gussets, axis=1), axis=0, return_index=True)
    faces = np.concatenate([F, gussets[np.sort(first_faces)]])
    crowded = (edge_table(faces).count > 2).sum() > (edges.count > 2).sum()
    return (F, 0) if crowded else (faces, len(first_faces))


def _gusset(V: Floats, v: int, away: Ints, fan: Ints) -> list[int] | None:
    along = V[away] - V[v]
    along /= lengths(along)[:, None]
    if not len(away):  # closed parts have no boundary edges
        return None
    cosine = np.where((fan[:, None] == fan) | (away[:, None] == away), -np.inf, along @ along.T)
    i, j = np.unravel_index(int(cosine.argmax()), cosine.shape)
    return [v, int(away[i]), int(away[j])] if cosine[i, j] > np.cos(np.radians(150.0)) else None
