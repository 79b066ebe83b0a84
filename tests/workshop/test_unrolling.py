"""Bays against an unrolling that knows nothing of axes: the triangles of each strip, laid flat by libigl."""

from itertools import pairwise

import igl
import numpy as np
import pytest

from dsfab.preset.file import load_preset
from dsfab.workshop import is_strip
from dsfab.workshop.development import Development, member_course
from tests.designs import sliced

BEYOND = 2.0
"""Widths of a strip by which a window reaches beyond its bays."""
BAYS = 3
"""Bays of a window: a long strip of triangles drifts by centimetres before it is flat."""
ROUNDS = 300


def flattened(V, F):
    """(n, 2) a strip of triangles, open, laid flat as rigidly as possible [Liu et al. 2008] from a conformal map."""
    long = int(np.ptp(V, axis=0).argmax())
    ends = np.array([V[:, long].argmin(), V[:, long].argmax()])
    apart = np.linalg.norm(V[ends[1]] - V[ends[0]])
    start = igl.lscm(V, F, ends, np.array([[0.0, 0.0], [apart, 0.0]]))
    start = start[0] if isinstance(start, tuple) else start
    data = igl.ARAPData()
    data.max_iter = ROUNDS
    igl.arap_precomputation(V, F, 2, ends[:1], data)
    return igl.arap_solve(start[ends[:1]], data, start)


def window(graph, member, low, high):
    """Vertices and faces of a strip between two arc lengths, those that hang together with most of it."""
    surface, axis = graph.sheet.surface, member.axis
    cells = member.cells
    near = np.linalg.norm(surface.centroids[cells][:, None] - axis.P[None], axis=2).argmin(axis=1)
    s = axis.s[near]
    if axis.closed:
        s = low + np.mod(s - low, axis.length)
    F = surface.F[cells[(s >= low) & (s <= high)]]
    part = igl.facet_components(F)  # what hangs on a corner alone would turn about it
    part = part[-1] if isinstance(part, tuple) else part
    F = F[part == np.bincount(part).argmax()]
    used, F = np.unique(F, return_inverse=True)
    return surface.V[used], F.reshape(-1, 3)


def bay_differences(graph):
    """Metres by which straight distances of neighbouring nodes differ on both flat strips, each with its member's name
    and node's."""
    found = []
    strips = [member for member in graph.members if is_strip(member)]
    for member in strips[::2]:  # the other half repeats them, and triangles take long to lay flat
        layer = Development(member_course(graph, member, 0.04, 0.4), 0.0)
        nodes = [node for node in graph.nodes_along[member.id] if node.kind == "crossing"]
        for k in range(0, len(nodes) - 1, BAYS):
            found += _differences(graph, member, layer, nodes[k : k + BAYS + 1])
    return found


def _differences(graph, member, layer, nodes):
    at = [node.at[node.members.index(member.id)] for node in nodes]
    V, F = window(graph, member, at[0] - BEYOND * member.mean_width, at[-1] + BEYOND * member.mean_width)
    U = flattened(V, F)
    points = np.array([node.point for node in nodes])
    _, face, on = igl.point_mesh_squared_distance(points, V, F)
    corners = V[F[face]]
    weights = igl.barycentric_coordinates(on, *(np.ascontiguousarray(corners[:, k]) for k in range(3)))
    laid = np.einsum("qk,qki->qi", weights, U[F[face]])
    starts = [layer.course.wrapped_station(s) for s in at]
    drawn = np.array([layer.to_plane(*np.atleast_2d(layer.piercing_point(x.point, x.normal, s)).T)[0]
                      for x, s in zip(nodes, starts, strict=True)])  # fmt: skip
    return [
        (float(np.linalg.norm(laid[j] - laid[i]) - np.linalg.norm(drawn[j] - drawn[i])), member.id, nodes[i].id)
        for i, j in pairwise(range(len(nodes)))
        if starts[i] < starts[j]  # else a closed strip begins between them
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "edge", "least", "quicker"),
    [
        ("barrel_vault", 0.12, 15, {}),
        ("dome", 0.15, 120, {"pattern.width": {"rule": "constant", "member": 0.15}}),
        ("tower", 0.2, 100, {"pattern.weight_rounds": 0}),
    ],
    ids=["barrel_vault", "dome", "tower"],
)
def test_bays_are_those_of_strips_of_triangles_laid_flat(name, edge, least, quicker):
    """Within a millimetre and a half, on meshes that are fine enough to drill by.

    quicker : without a search for widths or weights, which take most of the time and change no bay.
    """
    graph = sliced(load_preset(name, {"surface.edge": edge, **quicker})).members
    found = bay_differences(graph)
    assert len(found) > least
    worst = max(found, key=lambda one: abs(one[0]))
    assert abs(worst[0]) < 1.5e-3, worst
