"""The surroundings of a structure in preview.png: supports and the ground."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import ConvexHull

from dsfab.core.arrays import Bools, Floats, Ints, concatenated_mesh, group_sums, unit_vectors
from dsfab.render.light import frame_towards
from dsfab.render.marks import MarkMesh, Spacing, support_side, thin_points
from dsfab.surface import LoadCase, Surface, link_components

PartKind = Literal["column", "wall", "hanger", "abutment"]

HEADROOM = 2.2  # smallest height (m) of a structure above a ground at height 0
PLINTH = 0.012  # height of the lowest columns and walls, divided by the structure's size
COLUMN_EXTENT = 0.08  # a support becomes a column if it is smaller in plan than this share of the structure's size
LOW_SHARE = 0.25  # a support below this share of the structure's height is never an abutment
STEEP = 0.2  # least slope (sine) of a structure towards a support from which the structure hangs
UPRIGHT = 3.0  # an edge is upright if its height / its extent in plan is larger than this
SOIL_SHARE = 0.5  # a slab lies on soil if supported area / whole area is above this
CORNERS, MOST_PARTS = 20, 40  # corners of a round column; largest number of columns or rods of a support
ABUTMENT_DEPTH, HANGER_LENGTH = 0.04, 0.14  # lengths / the structure's size
HANGERS, COLUMNS = 0.05, 0.12  # spacings of rods, and of columns below an edge, divided by the structure's size
TALL = 4.5  # height (m) above which a long edge has a beam and columns instead of a wall
WIDTH, FOOTING_WIDTH, ROD = 0.01, 0.02, 0.004  # widths, divided by the structure's size


@dataclass(frozen=True, eq=False)
class SupportPart:
    """A connected support of a surface, drawn as a part of a building. vertices : (k,) of the support.
    edges    : (e, 2) edges of the support.    along : (3,) unit vector from the structure into the part.
    outwards : (k, 3) horizontal unit vectors away from the structure; 0 for a part below the structure."""

    kind: PartKind
    vertices: Ints
    edges: Ints
    along: Floats
    outwards: Floats


def building_supports(surface: Surface, load: LoadCase, up: Floats) -> list[SupportPart]:
    """Return a part of a building for each connected support; none for a slab on soil. up : (3,) unit vector."""
    supported = _upward_supports(load, up)
    if not supported.any() or surface.areas @ supported[surface.F].all(axis=1) > SOIL_SHARE * surface.area:
        return []
    inside = supported[surface.edges.ends].all(axis=1)
    lines, on_rim = surface.edges.ends[inside], surface.edges.boundary[inside]
    (_, label), inner = link_components(surface.n, *lines.T), _from_free_neighbours(surface, supported)
    groups = [np.flatnonzero(supported & (label == number)) for number in np.unique(label[supported])]
    side = _open_side(surface, load, groups, up)
    outer = np.isin(np.arange(surface.n), surface.loops[0] if surface.loops else [])
    kind: PartKind
    supports = list[SupportPart]()
    for group in groups:
        in_group, towards, points = label[lines[:, 0]] == label[group[0]], inner[group], surface.V[group]
        edges = lines[in_group & on_rim] if (in_group & on_rim).any() else lines[in_group]
        extent, is_high = _extent(points, up), float((towards @ up).mean()) > STEEP
        kind, along = "column" if extent < COLUMN_EXTENT * surface.size else "wall", -up
        if is_high and not outer[group].any():
            kind, along = "hanger", up
        elif side is not None:
            kind, along = "abutment", side
        is_beside = along is not up and side is None and (is_high or np.ptp(points @ up) > UPRIGHT * extent)
        outwards = unit_vectors(towards - np.outer(towards @ up, up)) if is_beside else np.zeros_like(points)
        supports.append(SupportPart(kind, group, edges, along, outwards))
    return supports


def _open_side(surface: Surface, load: LoadCase, groups: list[Ints], up: Floats) -> Floats | None:
    """Return the horizontal direction (3,) to the supports if they all lie on one side of the surface, else None."""
    side, heights = support_side(surface, load, surface.size, up), surface.V @ up
    low = heights.min() + LOW_SHARE * np.ptp(heights)
    return side if abs(side @ up) < 0.5 and all(heights[group].mean() >= low for group in groups) else None


def _upward_supports(load: LoadCase, up: Floats) -> Bools:
    axis = int(np.argmax(np.abs(up)))
    upwards = load.fixed[:, axis] | (load.spring[:, axis] > 0)
    return np.asarray(upwards if upwards.any() else load.supported)


def _from_free_neighbours(surface: Surface, supported: Bools) -> Floats:
    """Return the mean (n, 3) of the unit vectors from neighbours without support to each supported vertex."""
    ends = surface.edges.ends[supported[surface.edges.ends].sum(axis=1) == 1]
    ends = np.where(supported[ends[:, :1]], ends, ends[:, ::-1])
    sums = group_sums(ends[:, 0], unit_vectors(surface.V[ends[:, 0]] - surface.V[ends[:, 1]]), surface.n)
    return np.asarray(sums / np.maximum(np.bincount(ends[:, 0], minlength=surface.n), 1)[:, None])


def _extent(points: Floats, axis: Floats) -> float:
    return float(np.linalg.norm(np.ptp(points - np.outer(points @ axis, axis), axis=0)))


def ground_level(surface: Surface, supports: Sequence[SupportPart], up: Floats, half: float) -> float:
    """Return the height of the ground, m. half : half of the structure's thickness, m."""
    lowest, size = float((surface.V @ up).min()) - half, surface.size
    if HEADROOM < lowest < size:
        return 0.0
    hangs = bool(supports) and all(support.kind == "hanger" for support in supports)
    return lowest - (min(HEADROOM, 0.3 * size) if hangs else PLINTH * size)


def support_part(surface: Surface, support: SupportPart, half: float, ground: float) -> MarkMesh:
    """Return the mesh of a support, m. ground : height of the ground, m.    half : half of the sheet's thickness, m."""
    size, along, among = surface.size, support.along, support.vertices
    begin = surface.V @ along + half * np.abs(surface.vertex_normals @ along)  # position of the sheet's outer face
    deepest, V = float(begin[among].max()), surface.V.copy()
    if support.kind == "hanger":
        return _prisms(
            V, _spaced_vertices(V, among, HANGERS * size), along, begin, deepest + HANGER_LENGTH * size, ROD * size
        )
    end = deepest + ABUTMENT_DEPTH * size if support.kind == "abutment" else -ground
    width = max((FOOTING_WIDTH if end - deepest < 2 * PLINTH * size else WIDTH) * size, 2 * half)
    if support.outwards.any():  # the column or wall stands beside the structure, not below it
        V[among] += support.outwards * (half + width / 2)
        begin[among] = begin[among].min() if support.kind == "column" else begin[among]
    direction = unit_vectors(V[support.edges[:, 1]] - V[support.edges[:, 0]])
    edges = support.edges[np.abs(direction @ along) < 0.9]
    if support.kind == "column" or not len(edges):
        return _prisms(V, [among], along, begin, end, width)
    if support.kind == "abutment" or end - deepest < TALL:
        return _prisms(V, edges, along, begin, end, width)
    beam = _prisms(V, edges, along, begin, begin + 2 * width, width)
    return concatenated_mesh(
        [beam, _prisms(V, _spaced_vertices(V, np.unique(edges), COLUMNS * size), along, begin + width, end, width)]
    )


def _spaced_vertices(V: Floats, among: Ints, apart: float) -> list[Ints]:
    points = V[among]
    return [among[[k]] for k in thin_points(points, apart, Spacing(1.0, MOST_PARTS))]


def _prisms(
    V: Floats, groups: Iterable[Ints], axis: Floats, begin: Floats, end: Floats | float, width: float
) -> MarkMesh:
    frame, ends = frame_towards(axis), np.stack([begin, np.broadcast_to(end, len(V))])
    turn = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    circle, meshes = width / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=1), list[MarkMesh]()
    for group in groups:
        plan = ((V[group] @ frame[:2].T)[:, None] + circle).reshape(-1, 2)
        outline = ConvexHull(plan).vertices  # counter-clockwise
        heights, count = ends[:, group[outline // CORNERS]], len(outline)
        corners = np.concatenate([np.column_stack([plan[outline], height]) for height in heights]) @ frame
        low, fan = np.arange(count), np.arange(1, count - 1)
        high = np.roll(low, -1)
        sides = [(low, high, high + count), (low, high + count, low + count)]
        caps = [(0 * fan, fan + 1, fan), (0 * fan + count, fan + count, fan + count + 1)]
        meshes.append((corners, np.concatenate([np.stack(face, axis=1) for face in (*sides, *caps)])))
    return concatenated_mesh(meshes)
