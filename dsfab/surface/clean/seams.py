"""Seams of a mesh: vertices at the same place merged, and patches with different divisions stitched together."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, along_segments, distinct, from_segments, lengths
from dsfab.surface.topology import EdgeTable, connected, corner_fans, edge_table, next_half_edge, pinches

SAME_PLACE = 1e-9
"""Vertices closer than this share of the mesh's largest side are at one place: `trimesh.slice_plane` works out the end
of a cut once for each face there, and some of these differ in the last digit."""


FAR = 1000.0
"""A vertex is astray that many times as far from the middle of all as 99 of 100 are: a number of its file is broken."""


def in_reach(V: Floats) -> Bools:
    """(n,) whether a vertex of V (n, 3) has finite numbers and is not astray: see `FAR`."""
    near: Bools = np.asarray(np.isfinite(V).all(axis=1))
    if not near.any():
        return near
    from_middle = np.abs(V[near] - np.median(V[near], axis=0)).max(axis=1)
    most = float(np.quantile(from_middle, 0.99, method="lower"))
    if most > 0:
        near[near] = from_middle <= FAR * most
    return near


def merged(V: Floats, within: float = SAME_PLACE, apart: Callable[[Ints], Bools] | None = None) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at the same place made one, the first of them, in the order given; and which (n,) each became.

    within : share of the mesh's largest side that counts as one place; none moves further.
    apart  : which (p,) of the pairs (p, 2) of them stay two; none where left out.

    Mesh files are merged by equality alone (`dsfab.surface.files.mesh_files`): their numbers were written with the
    same digits.
    """
    alone = V, np.arange(len(V))
    if not len(V) or not np.isfinite(V).all():  # told where the surface is made
        return alone
    reach = within * float(np.ptp(V, axis=0).max())
    pairs = cKDTree(V).query_pairs(reach, output_type="ndarray")
    pairs = pairs[~apart(pairs)] if apart and len(pairs) else pairs
    if not len(pairs):
        return alone
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(V), len(V)))
    label = connected_components(links, directed=False)[1]
    _, first, became = np.unique(label, return_index=True, return_inverse=True)
    at = _without_chains(V, pairs, first[became.ravel()], reach)
    kept, became = np.unique(at, return_inverse=True)
    return V[kept], became.ravel()


def _without_chains(V: Floats, pairs: Ints, at: Ints, reach: float) -> Ints:
    """(n,) the vertex that each becomes: the first `at` of those it is linked to, unless that is further than `reach`.

    Links go on from vertex to vertex, so that a finely divided outline would shrink to a point: along such a chain a
    vertex becomes the first within reach of it that stays.
    """
    long = np.unique(at[lengths(V - V[at]) > reach])
    if not len(long):
        return at
    near: dict[int, list[int]] = {}
    for a, b in np.sort(pairs[np.isin(at[pairs[:, 0]], long)], axis=1).tolist():
        near.setdefault(b, []).append(a)
    at = at.copy()
    for vertex in np.flatnonzero(np.isin(at, long)).tolist():
        at[vertex] = min((k for k in near.get(vertex, ()) if at[k] == k), default=vertex)
    return at


def equal_merged(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Vertices V (n, 3) at exactly the same place made one, ordered by place, and faces F (m, 3) of them.

    + 0.0 turns -0.0 into 0.0.
    """
    fewer, became = np.unique(V + 0.0, axis=0, return_inverse=True)
    return fewer, became.ravel()[F]


def coincident(V: Floats) -> int:
    """How many of the vertices V (n, 3) lie where an earlier one does."""
    return len(V) - len(merged(V)[0])


SAG = 1 / 15
"""Of an edge: how far the chord of an arc of 30 degrees lies off that arc. Where two patches share both ends of a seam,
it is as open as that in between; seams that are less open than `within` need not share any vertex."""

ROUNDS = 4
"""A face takes the vertices of one of its edges at a time, and has up to three of them at a seam."""

CROWD = 8
"""Vertices around an edge above which it is looked at in `PIECES`."""

PIECES = 4
"""That a long edge in a crowd is divided into: with 2 a comb of 10,000 spikes takes 1.2 times as long."""

WIDEST = 150.0
"""Degrees between two edges that a face can join."""


def stitched(V: Floats, F: Ints, within: float) -> tuple[Ints, int]:
    """The faces F (m, 3) of the mesh V (n, 3), those along open seams as fans, and how many vertices that joined.

    within : how close to an edge a vertex lies on it, in the unit of V. Edges of more than two faces are not made:
             the faces stay as they are where that would be the end of it.
    """
    faces, joined = F, 0
    for _ in range(ROUNDS):
        edges = edge_table(faces)
        half, vertex = _open_seams(V, faces, edges, within)
        if not len(half):
            break
        faces = _with_fans(V, faces, half, vertex)
        joined += len(half)
    crowded = (edge_table(faces).count > 2).sum() > (edge_table(F).count > 2).sum()
    return (F, 0) if crowded else (faces, joined)


def _open_seams(V: Floats, F: Ints, edges: EdgeTable, within: float) -> tuple[Ints, Ints]:
    """Half-edges (k,) on the boundary, one of a face at most, and the vertices (k,) of other faces that lie on them."""
    alone = np.flatnonzero(edges.boundary)
    half, ends = edges.order[edges.start[alone]], edges.ends[alone]
    edge, vertex = _near(V, ends, within)
    if not len(edge):
        return half[:0], vertex
    far = from_segments(V[vertex], V[ends[edge, 0]], V[ends[edge, 1]])
    long = lengths(V[ends[edge, 1]] - V[ends[edge, 0]])
    on = (far <= within) | ((far <= SAG * long) & _of_one_seam(ends, edge, vertex))
    on &= (F[half[edge] // 3] != vertex[:, None]).all(axis=1)
    edge, vertex, far = edge[on], vertex[on], far[on]
    nearest = np.lexsort((far, vertex))
    nearest = nearest[np.diff(vertex[nearest], prepend=-1) > 0]
    edge, vertex = edge[nearest], vertex[nearest]
    face = half[edge] // 3
    first = np.full(len(F), len(alone))
    np.minimum.at(first, face, edge)
    now = first[face] == edge
    return half[edge[now]], vertex[now]


def _near(V: Floats, ends: Ints, within: float) -> tuple[Ints, Ints]:
    """Edges (k,) of those with ends (b, 2), and vertices (k,) of others that lie beside their inside: all within
    `SAG` of an edge where boundaries meet, all `within` where they are closed loops, of which none is a seam."""
    a, b = V[ends].transpose(1, 0, 2)
    border, loops = np.unique(ends), (np.bincount(ends.ravel())[ends] == 2).all()
    long = lengths(b - a)
    reach = np.maximum((0.0 if loops else SAG) * long, within)
    tree, edge, start, size = cKDTree(V[border]), np.arange(len(ends)), np.zeros(len(ends)), 1.0
    found = [np.zeros((0, 2), dtype=np.int64)]
    while len(edge):
        # a long edge in a crowd, as a comb of spikes has, is looked along: around its middle are all of them
        middle = a[edge] + (start + size / 2)[:, None] * (b - a)[edge]
        radius = size / 2 * long[edge] + reach[edge]
        crowded, k, near = _few_within(tree, middle, radius)
        found.append(np.stack([edge[k], border[near]], axis=1))
        long_ones = crowded & (size * long[edge] > reach[edge])
        k, near = _all_within(tree, middle, radius, np.flatnonzero(crowded & ~long_ones))
        found.append(np.stack([edge[k], border[near]], axis=1))
        size /= PIECES
        edge, start = np.repeat(edge[long_ones], PIECES), (start[long_ones, None] + size * np.arange(PIECES)).ravel()
    edge, vertex = _different(np.concatenate(found), len(V))
    along = along_segments(V[vertex], a[edge], b[edge])
    beside = (along > 0) & (along < 1) & (ends[edge] != vertex[:, None]).all(axis=1)
    return edge[beside], vertex[beside]


def _few_within(tree: cKDTree, places: Floats, radius: Floats) -> tuple[Bools, Ints, Ints]:
    """(b,) which balls around places (b, 3) have more than `CROWD` points of a tree in them; and of the others, the
    balls (k,) and the points (k,). A count of the points would go through all of them where the ball is large."""
    # its bound is of all: a last bit more, for it is not itself within
    far, point = tree.query(places, CROWD + 1, distance_upper_bound=np.nextafter(radius.max(), np.inf))
    inside = far <= radius[:, None]
    crowded: Bools = inside[:, CROWD]
    k, column = np.nonzero(inside & ~crowded[:, None])
    return crowded, k, np.asarray(point, dtype=np.int64)[k, column]


def _all_within(tree: cKDTree, places: Floats, radius: Floats, some: Ints) -> tuple[Ints, Ints]:
    """Of some balls (b,) around places the numbers (k,), and the points (k,) of a tree in each."""
    lists: list[list[int]] = list(tree.query_ball_point(places[some], radius[some])) if len(some) else []
    points = np.concatenate([np.zeros(0, dtype=np.int64), *lists]).astype(np.int64)
    return np.repeat(some, [len(each) for each in lists]), points


def _different(pairs: Ints, n: int) -> tuple[Ints, Ints]:
    """Both columns of the different ones of pairs (k, 2), in order; the second is less than n."""
    first, second = np.divmod(distinct(pairs[:, 0] * n + pairs[:, 1]), n)
    return first, second


def _of_one_seam(ends: Ints, edge: Ints, vertex: Ints) -> Bools:
    """(k,) whether a boundary edge and a boundary vertex lie on two strands between the same vertices, in which parts
    touch. A strand is a part of the boundary, edges (b, 2), between vertices of other than two of its edges."""
    degree = np.bincount(ends.ravel())
    order = np.argsort(ends.ravel(), kind="stable")
    pairs = order[np.flatnonzero(degree[ends.ravel()[order]] == 2)].reshape(-1, 2) // 2
    count, strand = connected(len(ends), *pairs.T)
    of_vertex = np.full(len(degree), -1)
    of_vertex[ends] = strand[:, None]
    node = degree[ends] != 2
    stops = np.stack([np.full(count, -1), np.full(count, -1)], axis=1)
    np.maximum.at(stops[:, 1], np.repeat(strand, 2)[node.ravel()], ends[node])
    stops[:, 0] = len(degree)
    np.minimum.at(stops[:, 0], np.repeat(strand, 2)[node.ravel()], ends[node])
    mine, other = strand[edge], of_vertex[vertex]
    met = (stops[mine] == stops[other]).all(axis=1) & (stops[mine, 1] >= 0)
    return np.asarray(met & (mine != other) & (degree[vertex] == 2))


def _with_fans(V: Floats, F: Ints, half: Ints, vertex: Ints) -> Ints:
    """(m', 3) the faces with vertices (k,) on half-edges (k,), one of a face: fans around the corner across, in place
    of it and at the end."""
    start, end, across = (F.ravel()[next_half_edge(half, k)] for k in range(3))
    order = np.lexsort((along_segments(V[vertex], V[start], V[end]), half))
    half, vertex, end, across = half[order], vertex[order], end[order], across[order]
    last = np.append(half[1:] != half[:-1], True)
    onward = np.where(last, end, np.roll(vertex, -1))
    faces = F.copy()
    first = np.append(True, last[:-1])
    faces.ravel()[next_half_edge(half[first])] = vertex[first]
    return np.concatenate([faces, np.stack([vertex, onward, across], axis=1)])


def joined_at_points(V: Floats, F: Ints) -> tuple[Ints, int]:
    """The faces F (m, 3) of the mesh V (n, 3) and one more in the narrowest gap between two parts that touch in a point
    only, as two openings with one common corner leave; and how many these are. No edge gets more than two faces."""
    edges = edge_table(F)
    points = pinches(F, edges, len(V))
    if not len(points):
        return F, 0
    fans, alone = corner_fans(F, edges), edges.order[edges.start[:-1][edges.boundary]]
    onward = next_half_edge(alone)
    at = np.concatenate([F.ravel()[alone], F.ravel()[onward]])
    away = np.concatenate([F.ravel()[onward], F.ravel()[alone]])
    fan = np.concatenate([fans.ravel()[alone], fans.ravel()[onward]])
    new = [_gusset(V, int(v), away[at == v], fan[at == v]) for v in points]
    found = np.array([face for face in new if face is not None], dtype=np.int64).reshape(-1, 3)
    _, first = np.unique(np.sort(found, axis=1), axis=0, return_index=True)
    faces = np.concatenate([F, found[np.sort(first)]])
    crowded = (edge_table(faces).count > 2).sum() > (edges.count > 2).sum()
    return (F, 0) if crowded else (faces, len(first))


def _gusset(V: Floats, v: int, away: Ints, fan: Ints) -> list[int] | None:
    """The face at a vertex between those two of its boundary edges, to vertices (k,) of different fans (k,), that are
    closest to one another in direction."""
    along = V[away] - V[v]
    along /= lengths(along)[:, None]
    cosine = np.where((fan[:, None] == fan) | (away[:, None] == away), -np.inf, along @ along.T)
    i, j = np.unravel_index(int(cosine.argmax()), cosine.shape)
    return [v, int(away[i]), int(away[j])] if cosine[i, j] > np.cos(np.radians(WIDEST)) else None
