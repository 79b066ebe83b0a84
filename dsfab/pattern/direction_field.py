"""Directions of stripes at vertices, along principal stresses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, dijkstra, minimum_spanning_tree

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import PatternError
from dsfab.pattern.frames import Frames, corner_sums, dots
from dsfab.pattern.guides import Guidance
from dsfab.surface import link_components
from dsfab.surface.mesh import Surface

ALONG = 0.3
"""Stripes follow a boundary if the sine of the angle between stripes and boundary is below this limit (17 degrees)."""


def boundary_lines(surface: Surface, g: Floats, shortest: float = 0.0) -> Bools:
    """Return a mask (n,) of vertices where stripes follow the boundary. g : (n, 3) unit vectors across stripes.
    shortest : length in metres; shorter parts of the boundary do not count."""
    ends = surface.edges.ends[surface.edges.boundary]
    step = surface.V[ends[:, 1]] - surface.V[ends[:, 0]]
    moment = np.zeros((surface.n, 3, 3))
    for k in (0, 1):
        np.add.at(moment, ends[:, k], step[:, :, None] * step[:, None, :])
    on_boundary = np.zeros(surface.n, dtype=bool)
    on_boundary[ends] = True
    boundary_vertices = np.flatnonzero(on_boundary)
    tangent = np.linalg.eigh(moment[boundary_vertices])[1][:, :, 2]
    is_line = np.zeros(surface.n, dtype=bool)
    is_line[boundary_vertices] = np.abs(np.einsum("ni,ni->n", tangent, g[boundary_vertices])) < ALONG
    on_line = is_line[ends].all(axis=1)
    count, run = link_components(surface.n, *ends[on_line].T)
    length = np.bincount(run[ends[on_line, 0]], np.linalg.norm(step[on_line], axis=1), count)
    return np.asarray(is_line & (length[run] >= shortest))


def family_crossings(frames: Frames, along: Floats) -> Bools:
    """Return a mask (n,) of vertices at which to exchange the major and minor direction, to agree with neighbours.
    along : (n, 3) tangents of major stripes; their sign has no meaning."""
    surface, (i, j) = frames.surface, frames.ends.T
    square = np.cross(frames.normal[j], along[j])
    turned = np.abs(dots(along[i], square)) > np.abs(dots(along[i], along[j]))
    count, region = link_components(surface.n, i[~turned], j[~turned])
    if count == 1:
        return np.zeros(surface.n, dtype=bool)
    metres = np.linalg.norm(surface.V[i] - surface.V[j], axis=1)
    region_i, region_j = region[i], region[j]
    is_border = region_i != region_j
    border = coo_array((metres[is_border], (region_i[is_border], region_j[is_border])), shape=(count, count)).tocsr()
    border = csr_array(border + border.T)
    border.data = -border.data  # negative lengths: the minimum spanning tree then contains the longest borders
    tree = minimum_spanning_tree(border)
    area = np.bincount(region, surface.vertex_areas, count) / surface.area
    crossed, unvisited = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    while unvisited.any():
        root = int(np.argmax(np.where(unvisited, np.rint(area / 1e-6), -1)))  # rounded, to ignore tiny differences
        order, predecessor = breadth_first_order(tree, root, directed=False)
        unvisited[order] = False
        for child in order[1:].tolist():
            crossed[child] = not crossed[predecessor[child]]
    return np.asarray(crossed[region])


def signs_with_short_seams(frames: Frames, along: Floats) -> Floats:
    """Return factors 1 or -1 (n,) for the tangents `along` (n, 3), so that few neighbouring tangents are opposite."""
    surface, (i, j) = frames.surface, frames.ends.T
    against = frames.sides(along, i, j) < 0
    singular = np.logical_xor.reduce(against[surface.edges.of], axis=1)
    return _propagated_signs(surface, against, _cut_edges(surface, singular))


def _cut_edges(surface: Surface, singular: Bools) -> Bools:
    """Return a mask (e,) of the edges that are crossed by short paths between singular faces and boundary loops."""
    edges = surface.edges
    is_cut = np.zeros(len(edges.ends), dtype=bool)
    if not singular.any():
        return is_cut
    name = _path_ends(surface, singular)
    h0, h1 = edges.pairs.T
    f, g, edge = h0 // 3, h1 // 3, edges.of.ravel()[h0]
    link = csr_array((np.ones(len(f), dtype=np.int8), (f, g)), shape=(surface.m, surface.m))
    steps_from, preceding, source = dijkstra(
        link, directed=False, unweighted=True, indices=np.flatnonzero(name), return_predecessors=True, min_only=True
    )
    reached = np.isfinite(steps_from[f]) & np.isfinite(steps_from[g])
    end_f, end_g = name[source[f]], name[source[g]]
    meeting = np.flatnonzero(reached & (end_f != end_g))
    meeting = meeting[np.argsort(steps_from[f[meeting]] + steps_from[g[meeting]], kind="stable")]
    low, high = np.minimum(end_f, end_g)[meeting], np.maximum(end_f, end_g)[meeting]
    _, least = np.unique(low * (name.max() + 1) + high, return_index=True)
    steps = steps_from[f[meeting]] + steps_from[g[meeting]] + 1
    count = int(name.max()) + 1
    tree = minimum_spanning_tree(coo_array((steps[least], (low[least], high[least])), shape=(count, count)).tocsr())
    number = csr_array((least + 1, (low[least], high[least])), shape=(count, count))
    predecessor = preceding.astype(np.int64)
    for pair in meeting[np.asarray(number[tree.nonzero()]).ravel() - 1].tolist():
        is_cut[edge[pair]] = True
        for face in (int(f[pair]), int(g[pair])):
            is_cut[_path_edges(surface, face, predecessor, singular)] = True
    return is_cut


def _path_edges(surface: Surface, face: int, predecessor: Ints, singular: Bools) -> list[int]:
    edges, path_edges = surface.edges, []
    while predecessor[face] >= 0:
        path_edges.append(int(np.intersect1d(edges.of[face], edges.of[predecessor[face]])[0]))
        face = int(predecessor[face])
    if not singular[face]:
        path_edges.append(next(k for k in edges.of[face].tolist() if edges.boundary[k]))
    return path_edges


def _path_ends(surface: Surface, singular: Bools) -> Ints:
    """Return a number (m,) for each singular face, and an equal number for all faces at a boundary loop; else 0."""
    edges = surface.edges
    count, loop = link_components(surface.n, *edges.ends[edges.boundary].T)
    name = np.zeros(surface.m, dtype=np.int64)
    half_edge = edges.outline
    name[half_edge // 3] = 1 + loop[edges.ends[edges.boundary, 0]]
    name[singular] = 1 + count + np.arange(singular.sum())
    return np.unique(np.append(name, 0), return_inverse=True)[1][:-1].astype(np.int64)


def _propagated_signs(surface: Surface, against: Bools, crossed: Bools) -> Floats:
    i, j = surface.edges.ends[~crossed].T
    link = csr_array((np.where(against[~crossed], -1, 1), (i, j)), shape=(surface.n, surface.n))
    link = csr_array(link + link.T)
    signs, unvisited = np.ones(surface.n), np.ones(surface.n, dtype=bool)
    while unvisited.any():
        order, predecessor = breadth_first_order(link, int(np.argmax(unvisited)), directed=False)
        unvisited[order] = False
        if len(order) > 1:
            signs[order] = _path_products(link, order.astype(np.int64), predecessor.astype(np.int64))
    return signs


def _path_products(link: csr_array, order: Ints, predecessor: Ints) -> Floats:
    parent = predecessor[order[1:]]
    sign = np.concatenate([[1.0], np.asarray(link[parent, order[1:]]).ravel()])
    place = np.empty(len(predecessor), dtype=np.int64)
    place[order] = np.arange(len(order))
    earlier = np.concatenate([[0], place[parent]])
    while earlier.any():
        sign = sign[earlier] * sign
        earlier = earlier[earlier]
    return sign


FLOOR = 1e-6  # Smallest weight of the stress; the largest is 1. At 0, the field would not be unique without stress.


@dataclass(frozen=True, eq=False)
class StressDirections:
    """Stresses on the faces, for a direction field.
    stress : (m, 2) principal stresses; major stripes follow the first. direction : (m, 2, 3) unit vectors."""

    stress: Floats
    direction: Floats

    def confidence(self, areas: Floats) -> Floats:
        """Return the confidence (m,) in the directions: 0 for equal stresses, near 1 for very different stresses.
        Raises PatternError if the stress is zero."""
        differ = np.abs(self.stress[:, 0] - self.stress[:, 1])
        reference = float(np.sqrt((areas @ (self.stress**2).sum(axis=1)) / (2 * areas.sum())))
        if not reference > 0:
            raise PatternError("the surface has no stress that stripes could follow; check the loads")
        return np.asarray(differ / (differ + 0.3 * reference))


RISE = (0.02, 0.75)
"""Range of the mean sin^2(slope) of a shell with arches. A flat plate has 0, half a sphere 2/3, a tower 1."""
CLEAR_SHARE = 0.75  # Fraction of a family's area in tension above which the family is called "pulled".


class FamilyRole(NamedTuple):
    """Way in which a family of stripes carries the loads.
    key    : "major" or "minor".    shape : "arches", "hoops", "purlins" or "".
    pulled : fraction of the area, weighted by stress, in tension; NaN if unknown."""

    key: str
    shape: str = ""
    pulled: float = float("nan")

    @property
    def title(self) -> str:
        """Name of the family in words, such as `arches (minor, pressed)`."""
        if np.isnan(self.pulled):
            return f"{self.key} members"
        action = "pulled" if self.pulled > CLEAR_SHARE else "partly pulled, partly pressed"
        action = "pressed" if self.pulled < 1 - CLEAR_SHARE else action
        return f"{self.shape} ({self.key}, {action})" if self.shape else f"{self.key} members ({action})"


def family_roles(surface: Surface, directions: StressDirections) -> tuple[FamilyRole, FamilyRole]:
    """Return the roles of the major and the minor family of stripes; z points up, and tension is positive."""
    size = surface.areas[:, None] * np.abs(directions.stress)
    total = size.sum(axis=0)
    pulled = np.divide((size * (directions.stress > 0)).sum(axis=0), total, out=np.full(2, np.nan), where=total > 0)
    level = np.cross([0.0, 0.0, 1.0], surface.normals)  # level directions, of length sin(slope)
    weight = surface.areas * (level**2).sum(axis=1)
    shapes = ["", ""]
    if RISE[0] * surface.area < weight.sum() < RISE[1] * surface.area:
        share = float(surface.areas @ dots(directions.direction[:, 0], level) ** 2 / weight.sum())
        is_straight = abs(surface.areas @ (level[:, 0] + 1j * level[:, 1]) ** 2) > CLEAR_SHARE * weight.sum()
        risen = 1 if share > 0.5 else 0
        if max(share, 1 - share) > CLEAR_SHARE and pulled[risen] < 0.5:
            shapes[risen], shapes[1 - risen] = "arches", "purlins" if is_straight else "hoops"
    return FamilyRole("major", shapes[0], float(pulled[0])), FamilyRole("minor", shapes[1], float(pulled[1]))


def cross_field(
    frames: Frames, directions: StressDirections, length: float, turn: float = 0.0, guidance: Sequence[Guidance] = ()
) -> Floats:
    """Return unit directions (n, 3) of the major stripes at the vertices; their sign has no meaning.
    length   : metres over which unclear directions are smoothed.
    turn     : angle from the first principal stress to the stripes, radians, counter-clockwise about the normal.
    guidance : guides that stripes follow.    Raises PatternError if the stress is zero."""
    surface = frames.surface
    share = (surface.areas * directions.confidence(surface.areas) / 3)[:, None].repeat(3, axis=1)
    e = directions.direction[:, 0]
    z = np.stack([_frame_numbers(frames, surface.F[:, c], e) ** 2 for c in range(3)], axis=1)
    z = z * np.exp(2j * turn) if turn else z
    right = corner_sums(surface, share * z.real) + 1j * corner_sums(surface, share * z.imag)
    weight = corner_sums(surface, share) + FLOOR * surface.vertex_areas
    for guide in guidance:
        right += surface.vertex_areas * guide.square
        weight += surface.vertex_areas * guide.weight
    weight[weight == 0] = FLOOR * surface.mean_edge**2  # for vertices without a face
    x = frames.twisted_factors.factor(length**2 * frames.coupling(2 * frames.turning), weight)(right)
    size = np.abs(x)
    # where the field is only a rounding error, the direction of an edge replaces it
    angle = np.where(size > 1e-6 * size.max(), np.angle(x) / 2, _first_edge_angles(frames))
    return frames.direction(angle)


def _first_edge_angles(frames: Frames) -> Floats:
    ends = np.concatenate([frames.ends, frames.ends[:, ::-1]])
    ends = ends[np.lexsort((ends[:, 1], ends[:, 0]))]
    vertices, begins = np.unique(ends[:, 0], return_index=True)
    step = frames.surface.V[ends[begins, 1]] - frames.surface.V[vertices]
    angle = np.zeros(frames.surface.n)
    angle[vertices] = np.angle(_frame_numbers(frames, vertices, step))
    return angle


def _frame_numbers(frames: Frames, vertex: Ints, e: Floats) -> Floats:
    return np.asarray(dots(e, frames.t1[vertex]) + 1j * dots(e, frames.t2[vertex]))
