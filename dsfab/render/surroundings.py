"""The surroundings of a structure in a picture for clients: its supports as parts of a building, and the ground."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, unit_vectors
from dsfab.render.marks import MarkMesh, Spacing, joined, support_side, thin_points
from dsfab.surface import LoadCase, Surface, half_edges

PartKind = Literal["column", "wall", "hanger", "abutment"]

HEADROOM = 2.2  # height (m) above height 0 from which a structure stands on columns or walls, with its ground at 0
PLINTH = 0.012  # height of the lowest columns and walls, over the structure's size
COLUMN_EXTENT = 0.08  # largest extent in plan, over the structure's size, of a support that becomes a column
LOW_SHARE = 0.25  # supports below this share of the structure's height carry it from below, even those on one side
STEEP = 0.2  # least slope up to a support from which the structure hangs
UPRIGHT = 3.0  # least height over extent in plan of a support along an upright edge
CORNERS = 16  # number of corners of a round column
ABUTMENT_DEPTH, HANGER_LENGTH = 0.04, 0.14  # over the structure's size
TALL = 4.5  # height (m) from which a long edge rests on a beam and columns, because a wall would hide the inside
HANGER_SPACING, COLUMN_SPACING = Spacing(0.05, 12), Spacing(0.12, 40)
WIDTH, FOOTING_WIDTH, ROD_WIDTH = 0.01, 0.02, 0.004
"""Least width of columns and walls, of those as low as a footing, and of hangers, over the structure's size."""


@dataclass(frozen=True, eq=False)
class Support:
    """Connected support: its vertices (k,), its boundary edges (e, 2) as vertex indices, and the part that it becomes.
    along    : (3,) unit vector from the structure into the part.
    outwards : (k, 3) horizontal unit vectors away from the structure; 0 for a part that ends below the structure.
    """

    kind: PartKind
    vertices: Ints
    edges: Ints
    along: Floats
    outwards: Floats


def building_supports(surface: Surface, load: LoadCase, up: Floats) -> list[Support]:
    """Return the connected supports as parts of a building. up : (3,) unit vector. Their kinds follow from geometry:
    inner supports from which the structure falls away are hangers, and supports on one side of it are abutments.
    Other supports reach the ground: small ones are columns, and long edges are walls. A slab on soil has no parts.
    """
    held = _carried(load, up)
    if not held.any() or held.mean() > 0.5:
        return []
    label, inner = _connected(surface, held), _from_free_neighbours(surface, held)
    groups = [np.flatnonzero(held & (label == number)) for number in np.unique(label[held])]
    side = _open_side(surface, load, groups, up)
    outer = np.isin(np.arange(surface.n), surface.loops[0] if surface.loops else [])
    borders = np.stack([ends[surface.edges.outline] for ends in half_edges(surface.F)], axis=1)
    borders = borders[held[borders].all(axis=1)]
    supports = list[Support]()
    for group in groups:
        edges, towards, points = borders[label[borders[:, 0]] == label[group[0]]], inner[group], surface.V[group]
        extent, is_high = _extent(points, up), float((towards @ up).mean()) > STEEP
        if is_high and not outer[group].any():
            kind, along = "hanger", up
        elif side is not None:
            kind, along = "abutment", side
        else:
            kind, along = "column" if extent < COLUMN_EXTENT * surface.size else "wall", -up
        beside = along is not up and side is None and (is_high or np.ptp(points @ up) > UPRIGHT * extent)
        outwards = unit_vectors(towards - np.outer(towards @ up, up)) if beside else np.zeros_like(points)
        supports.append(Support(kind, group, edges, along, outwards))
    return supports


def _open_side(surface: Surface, load: LoadCase, groups: list[Ints], up: Floats) -> Floats | None:
    """Return the horizontal direction (3,) to supports that are all on one side and all high, as of a cantilever."""
    side, heights = support_side(surface, load, surface.size, up), surface.V @ up
    low = heights.min() + LOW_SHARE * np.ptp(heights)
    return side if abs(side @ up) < 0.5 and all(heights[group].mean() >= low for group in groups) else None


def _carried(load: LoadCase, up: Floats) -> Bools:
    """Return supported vertices (n,), without those that hold sideways only, as at a plane of symmetry."""
    axis = int(np.argmax(np.abs(up)))
    upwards = load.fixed[:, axis] | (load.spring[:, axis] > 0)
    return np.asarray(upwards if upwards.any() else load.supported)


def _connected(surface: Surface, held: Bools) -> Ints:
    a, b = surface.edges.ends[held[surface.edges.ends].all(axis=1)].T
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(surface.n, surface.n))
    return np.asarray(connected_components(graph, directed=False)[1])


def _from_free_neighbours(surface: Surface, held: Bools) -> Floats:
    """Return the mean unit vector (n, 3) to each supported vertex from its free neighbours; 0 without any."""
    ends = surface.edges.ends[held[surface.edges.ends].sum(axis=1) == 1]
    ends = np.where(held[ends[:, :1]], ends, ends[:, ::-1])
    sums = group_sums(ends[:, 0], unit_vectors(surface.V[ends[:, 0]] - surface.V[ends[:, 1]]), surface.n)
    return np.asarray(sums / np.maximum(np.bincount(ends[:, 0], minlength=surface.n), 1)[:, None])


def _extent(points: Floats, axis: Floats) -> float:
    """Return the size (m) of points (k, 3) across an axis (3,)."""
    return float(np.linalg.norm(np.ptp(points - np.outer(points @ axis, axis), axis=0)))


def ground_level(surface: Surface, supports: Sequence[Support], up: Floats, half: float) -> float:
    """Return the height of the ground (m): 0 below a structure that is drawn with headroom, else that of its lowest
    point, less a plinth. A structure on hangers alone has headroom. half : half the thickness of the structure (m).
    """
    lowest, size = float((surface.V @ up).min()) - half, surface.size
    if HEADROOM < lowest < size:
        return 0.0
    hangs = bool(supports) and all(support.kind == "hanger" for support in supports)
    return lowest - (min(HEADROOM, 0.3 * size) if hangs else PLINTH * size)


def support_part(surface: Surface, support: Support, half: float, ground: float) -> MarkMesh:
    """Return the mesh of a part (metres). ground : its height (m). half : as for `ground_level`."""
    size, along, among = surface.size, support.along, support.vertices
    begin = surface.V @ along + half * np.abs(surface.vertex_normals @ along)  # at the skin of the structure
    first, last = float(begin[among].min()), float(begin[among].max())
    if support.kind == "hanger":
        wide = _extent(surface.V[among], along) > COLUMN_EXTENT * size
        places = surface.V[among[thin_points(surface.V[among], size, HANGER_SPACING)]] if wide else surface.V[among]
        groups = places[:, None] if wide else [places.mean(axis=0)[None]]
        return joined(
            [_prism(place, along, (last, last + HANGER_LENGTH * size), ROD_WIDTH / 2 * size) for place in groups]
        )
    end = last + ABUTMENT_DEPTH * size if support.kind == "abutment" else -ground
    width = max((FOOTING_WIDTH if end - last < 2 * PLINTH * size else WIDTH) * size, 2 * half)
    beside, V = bool(support.outwards.any()), surface.V.copy()
    V[among] += support.outwards * (half + width / 2)
    edges = support.edges[_extends_across(surface.V, support.edges, along)]
    if support.kind == "column" or not len(edges):
        return _prism(V[among], along, (first if beside else last, end), width / 2)
    if support.kind == "abutment" or end - last < TALL:
        return _strip(V, edges, along, begin, np.full(surface.n, end), width)
    beam = begin + 2 * width
    beam_mesh = _strip(V, edges, along, begin, beam, width)
    places = np.unique(edges)[thin_points(V[np.unique(edges)], size, COLUMN_SPACING)]
    return joined([beam_mesh, *(_prism(V[[k]], along, (float(beam[k]), end), width / 2) for k in places)])


def _extends_across(V: Floats, edges: Ints, axis: Floats) -> Bools:
    direction = unit_vectors(V[edges[:, 1]] - V[edges[:, 0]])
    return np.asarray(np.abs(direction @ axis) < 0.9)


def _prism(points: Floats, axis: Floats, ends: tuple[float, float], radius: float) -> MarkMesh:
    """Return a prism around points (k, 3) along an axis (3,), between two heights on it; its corners are round."""
    frame = _square_frame(axis)
    turn = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    plan = (points @ frame[:2].T)[:, None] + circle
    plan = plan.reshape(-1, 2)
    plan = plan[ConvexHull(plan).vertices]  # counter-clockwise
    count = len(plan)
    V = np.concatenate([np.column_stack([plan, np.full(count, end)]) for end in ends]) @ frame
    low, fan = np.arange(count), np.arange(1, count - 1)
    high = np.roll(low, -1)
    sides = [np.stack([low, high, high + count], axis=1), np.stack([low, high + count, low + count], axis=1)]
    caps = [np.stack([0 * fan, fan + 1, fan], axis=1), np.stack([0 * fan, fan, fan + 1], axis=1) + count]
    return V, np.concatenate([*sides, *caps])


def _square_frame(axis: Floats) -> Floats:
    across = unit_vectors(np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)[None])[0]
    return np.stack([across, np.cross(axis, across), axis])


def _strip(V: Floats, edges: Ints, axis: Floats, begin: Floats, end: Floats, width: float) -> MarkMesh:
    """Return a wall along edges (e, 2) of vertices V (n, 3), between two heights (n,) of each vertex on an axis.
    Walls of edges that meet are joined by a mitre.
    """
    used, edges = np.unique(edges, return_inverse=True)
    edges, points = edges.reshape(-1, 2), V[used]
    flat = points - np.outer(points @ axis, axis)
    side = unit_vectors(np.cross(axis, flat[edges[:, 1]] - flat[edges[:, 0]]))
    mitre = unit_vectors(group_sums(edges.ravel(), np.repeat(side, 2, axis=0), len(used)))
    cosine = np.einsum("ei,ei->e", mitre[edges[:, 0]], side), np.einsum("ei,ei->e", mitre[edges[:, 1]], side)
    least = np.full(len(used), 1.0)
    for k in (0, 1):
        np.minimum.at(least, edges[:, k], cosine[k])
    offset = mitre * (width / 2 / np.maximum(least, 0.5))[:, None]
    rows = [
        flat + sign * offset + np.multiply.outer(height, axis)
        for height in (begin[used], end[used])
        for sign in (1, -1)
    ]
    a, b, n = edges[:, 0], edges[:, 1], len(used)
    quads = [(0, 1), (1, 3), (3, 2), (2, 0)]
    faces = [
        np.stack(t, axis=1)
        for i, j in quads
        for t in ((a + i * n, b + i * n, b + j * n), (a + i * n, b + j * n, a + j * n))
    ]
    tips = np.flatnonzero(np.bincount(edges.ravel(), minlength=n) == 1)
    caps = [np.stack(t, axis=1) for t in ((tips, tips + n, tips + 3 * n), (tips, tips + 3 * n, tips + 2 * n))]
    return np.concatenate(rows), np.concatenate([*faces, *caps])
