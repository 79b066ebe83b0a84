"""Construction of the beam model of a cut sheet."""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import StaticsError
from dsfab.members import MemberGraph
from dsfab.members.frame.beams import (
    Beams,
    NodeSupports,
    beams_along,
    fixed_in_plane,
    nearest_beams,
    nodal_loads,
    supports_at_nodes,
)
from dsfab.members.frame.joints import add_hubs, join_ends, joints_at_nodes
from dsfab.members.frame.model import BeamMaterial, Combinations, Frame
from dsfab.statics import flat_axis
from dsfab.surface import LoadCase, Surface


def frame_of(
    graph: MemberGraph,
    surface: Surface,
    loads: Mapping[str, LoadCase],
    combinations: Combinations,
    thickness: float,
    material: BeamMaterial,
) -> Frame:
    """Return the beam model of a cut sheet. surface : the sheet; the loads act on the vertices of the sheet.
    loads : loads and supports of each case; all cases have equal supports.    thickness : of the sheet, metres.
    combinations : factors of the cases, by name of the load combination.
    Raises StaticsError if no member has an axis, or if a part of the structure has no support."""
    if not any(member.axis for member in graph.members):
        raise StaticsError(
            "no member of the structure has an axis, so dsfab cannot make a beam model; use the model of the sheet"
        )
    joints = joints_at_nodes(graph)
    join_ends(joints)
    add_hubs(joints)
    beams = beams_along(joints)
    points, beams, names = _merge_nodes(np.array(joints.points), beams, joints.names)
    beams = _connect_parts(points, beams)
    any_load = next(iter(loads.values()))
    supports = supports_at_nodes(any_load, surface, points, beams)
    places = nearest_beams(surface.V, points, beams)
    forces = {name: nodal_loads(load, surface.V, places, points, beams) for name, load in loads.items()}
    points, beams, names, fixed, spring = _with_supports(points, beams, names, supports)
    forces = {name: np.concatenate([force, np.zeros((len(points) - len(force), 6))]) for name, force in forces.items()}
    axis = flat_axis(surface, *loads.values())
    fixed = fixed if axis is None else fixed_in_plane(fixed, axis)
    members = tuple(member.id for member in joints.members_with_axis)
    sections = beams.ends, _local_z(points, beams), beams.width, np.full(len(beams.width), thickness), beams.member
    acting = forces, material, dict(combinations)
    return Frame(points, distinct_names(names), *sections, members, fixed, spring, *acting, beams.shift, beams.stout)


def distinct_names(names: list[str]) -> tuple[str, ...]:
    """Return the names without duplicates: the second "a" becomes "a (2)"."""
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(unique)


def _merge_nodes(points: Floats, beams: Beams, names: list[str]) -> tuple[Floats, Beams, list[str]]:
    tolerance = 0.01  # nodes merge if their distance is below this fraction of the beams' median width
    pairs = cKDTree(points).query_pairs(tolerance * float(np.median(beams.width)), output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    label = connected_components(links, directed=False)[1]
    used, first_node = np.unique(label, return_index=True)
    ends = np.searchsorted(used, label[beams.ends])
    chosen = np.flatnonzero(ends[:, 0] != ends[:, 1])
    nodes, new_ends = np.unique(ends[chosen], return_inverse=True)
    ends[chosen] = new_ends.reshape(-1, 2)
    return points[first_node[nodes]], beams.subset(chosen, ends), [names[k] for k in first_node[nodes]]


def _connect_parts(points: Floats, beams: Beams) -> Beams:
    while True:
        n = len(points)
        joined = coo_array((np.ones(len(beams.ends)), beams.ends.T), shape=(n, n))
        count, label = connected_components(joined, directed=False)
        if count == 1:
            return beams
        part = np.bincount(label).argmin()
        inside, rest = np.flatnonzero(label == part), np.flatnonzero(label != part)
        distance, nearest = (np.asarray(x) for x in cKDTree(points[rest]).query(points[inside]))
        k = int(distance.argmin())
        ends = np.array([[inside[k], rest[nearest[k]]]])
        normal = beams.normal[(beams.ends == ends[0, 1]).any(axis=1)][:1]
        beams = beams.and_links(ends, normal, np.array([np.median(beams.width)]))


def _with_supports(
    points: Floats, beams: Beams, names: list[str], supports: NodeSupports
) -> tuple[Floats, Beams, list[str], Bools, Floats]:
    count, apart = len(points), np.flatnonzero(supports.apart)
    where = supports.node.copy()
    where[apart] = count + np.arange(len(apart))
    points = np.concatenate([points, supports.place[apart]])
    names = [*names, *(f"support {k + 1}" for k in range(len(apart)))]
    normal = np.zeros((len(apart), 3))
    for row, node in enumerate(supports.node[apart]):
        normal[row] = beams.normal[(beams.ends == node).any(axis=1)].sum(axis=0)
    ends = np.stack([supports.node[apart], where[apart]], axis=1)
    beams = beams.and_links(ends, normal, supports.width[apart])
    fixed, spring = np.zeros((len(points), 6), dtype=bool), np.zeros((len(points), 6))
    fixed[where], spring[where] = supports.fixed, supports.spring
    return points, beams, names, fixed, spring


def _local_z(points: Floats, beams: Beams) -> Floats:
    """Return the local z axes (b, 3): unit vectors perpendicular to the beams, as near as possible to the normals."""
    x = points[beams.ends[:, 1]] - points[beams.ends[:, 0]]
    x /= np.linalg.norm(x, axis=1)[:, None]
    axis = np.eye(3)[np.abs(x).argmin(axis=1)]
    normal = beams.normal - np.einsum("bi,bi->b", beams.normal, x)[:, None] * x
    short = np.linalg.norm(normal, axis=1) < 0.1 * np.maximum(np.linalg.norm(beams.normal, axis=1), 1e-9)
    normal[short] = np.cross(x[short], axis[short])
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])
