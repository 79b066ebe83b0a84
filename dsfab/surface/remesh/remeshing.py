"""Remeshing of a surface to edges of a wanted length."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from dsfab.core.arrays import Floats, face_angles
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import MOST_TRIANGLES
from dsfab.surface.mesh import Surface, nearest_places
from dsfab.surface.remesh.edges import (
    FIXED,
    FREE,
    Net,
    NetFaces,
    with_ears_flipped,
    with_edges_flipped,
    with_long_edges_halved,
    with_short_edges_collapsed,
    without_rim_slivers,
)
from dsfab.surface.remesh.features import TOLERANCE, FeatureCurves, design_features, feature_curves
from dsfab.surface.remesh.mirrors import PLANE_TOLERANCE, Chamber, Mirrors
from dsfab.surface.remesh.sizes import SizeField, chord_lengths, curvature_sizes, with_sizes
from dsfab.surface.remesh.smoothing import (
    NearestOnSurface,
    SmoothPatches,
    barycentric,
    with_even_vertices,
    with_vertices_at,
    with_vertices_on,
)
from dsfab.surface.topology import crowded_edge_fault, repeated_face_fault

SHARP_ANGLE = 20.0  # A mirrored mesh is always kept if its smallest angle is above this, degrees.


def remeshed_surface(
    surface: Surface, edge: float, finest: float = 0.0, smooth: bool = False, sizes: Sequence[SizeField] = ()
) -> Surface:
    """Return the surface with nearly equilateral triangles whose edges are about `edge` metres long.
    finest : least edge length on curved parts, metres; 0 for no shorter edges.
    smooth : True for new vertices on a smooth surface [Vlachos et al. 2001], False for vertices on old facets.
    sizes  : fields of wanted edge lengths, metres; the shortest length counts.
    - Boundaries, and creases of more than 30 degrees, move by at most a fiftieth of `edge`. Corners do not move.
    - Without `sizes`, a surface with mirror symmetries gets an exactly symmetric mesh.
    Raises SurfaceError for invalid lengths, edges that are longer than the surface, over `MOST_TRIANGLES` triangles,
    repeated faces, and edges of more than two faces."""
    _check(surface, edge, finest)
    mirrored = not sizes  # `sizes` need not be symmetric
    if finest:
        sizes = [*sizes, SizeField(surface, curvature_sizes(surface, edge, finest))]
    for field in sizes or [SizeField(surface, np.full(surface.n, edge))]:
        _check_count(field, finest or float(field.length.min()))
    surface = with_ears_flipped(without_rim_slivers(surface, smooth))
    nearest_to = NearestOnSurface(surface)
    by_sides = _by_sides(nearest_to, edge, smooth, sizes) if mirrored else None
    if by_sides and _smallest_angle(by_sides) > SHARP_ANGLE:
        return by_sides
    net = _net(nearest_to, sizes, edge)
    direct = Surface(_on_smooth_surface(net, nearest_to).V if smooth else net.V, net.F)
    # the mirrored mesh can be worse: a mirror plane along a pointed tip halves the tip's angle
    return by_sides if by_sides and _smallest_angle(by_sides) > 0.9 * _smallest_angle(direct) else direct


def _smallest_angle(surface: Surface) -> float:
    return float(np.degrees(face_angles(surface.V, surface.F).min()))


def _by_sides(nearest_on: NearestOnSurface, edge: float, smooth: bool, sizes: Sequence[SizeField]) -> Surface | None:
    """Remesh one side of the surface's mirror planes, and copy the mesh to all sides. None if this is impossible."""
    surface = nearest_on.surface
    mirrors = Mirrors.from_surface(nearest_on, edge, smooth)
    chamber = Chamber.from_mirrors(surface, mirrors, edge) if mirrors else None
    piece = chamber.piece if chamber else None
    if chamber is None or piece is None or piece.area < 100 * np.sqrt(3) / 4 * edge**2:  # under 100 triangles
        return None
    net = _net(NearestOnSurface(piece), sizes, edge)
    planes = chamber.planes_of(net.V)
    moved = (net.kind == FREE) | planes.any(axis=0)
    goal = np.where(moved[:, None], _places(net.V, nearest_on, smooth), net.V) if smooth else net.V
    net = with_vertices_at(net, chamber.moved_into_planes(goal, planes), net.at)
    copied = chamber.all_sides(net.V, net.F)
    if copied is None:
        return None
    every, original = copied
    none = net.node[:0]
    whole_net = Net(every.V, NetFaces(every.F), net.kind[original], none, net.at[:0], none, net.size[original])
    V = with_vertices_at(whole_net, _places_on_curves(whole_net, nearest_on, edge, smooth), whole_net.at).V
    box, new_box = ((x.min(axis=0), x.max(axis=0)) for x in (surface.V, V))
    with suppress(SurfaceError):  # at a narrow tip, two vertices may move to one corner
        return Surface(V, every.F) if np.abs(np.subtract(box, new_box)).max() < TOLERANCE * edge else None
    return None


def _places_on_curves(net: Net, nearest_on: NearestOnSurface, edge: float, smooth: bool) -> Floats:
    surface = nearest_on.surface
    lines = surface.edges.ends[design_features(surface, edge)]
    goal = net.V.copy() if smooth else _places(net.V, nearest_on, smooth)
    on_curve, fixed = np.flatnonzero(net.kind > FREE), feature_curves(surface, edge).fixed
    for vertices, simplices in ((on_curve, lines), (on_curve[net.kind[on_curve] == FIXED], fixed[:, None])):
        if len(vertices) and len(simplices):
            hits = nearest_places(net.V[vertices], surface.V, simplices)
            is_near = hits.distance < TOLERANCE * edge
            goal[vertices[is_near]] = hits.place[is_near]
    for extreme, ends in ((surface.V.max(axis=0), goal.argmax(axis=0)), (surface.V.min(axis=0), goal.argmin(axis=0))):
        now = goal[ends, (0, 1, 2)]
        goal[ends, (0, 1, 2)] = np.where(np.abs(now - extreme) < PLANE_TOLERANCE * edge, extreme, now)
    return goal


def _net(nearest_on: NearestOnSurface, sizes: Sequence[SizeField], edge: float) -> Net:
    curves = feature_curves(nearest_on.surface, edge)
    net = _even_net(Net.from_surface(nearest_on.surface, curves, edge), curves, nearest_on, sizes, edge)
    return with_edges_flipped(net, by_valence=False, rounds=3)


def _even_net(
    net: Net, curves: FeatureCurves, nearest: NearestOnSurface, sizes: Sequence[SizeField], edge: float
) -> Net:
    chords = chord_lengths(curves, edge)
    finer = [field for field in sizes if np.ptp(field.length)]
    trees = [nearest, *map(NearestOnSurface, {field.surface for field in finer} - {nearest.surface})]
    rounds = 8
    for k in range(rounds):
        base = _shortest_lengths(net.V, finer, trees) if finer else edge
        net = with_sizes(net, chords, curves, np.minimum(base, edge))
        if not k:
            net = _roughly(net, curves, edge)
        for _ in range(2):
            net = with_long_edges_halved(net, curves, edge)
        net = with_short_edges_collapsed(net, curves, edge)
        net = with_edges_flipped(net, by_valence=k < rounds - 1, rounds=4)
        net = with_even_vertices(net, curves, edge)
        net = with_even_vertices(net, curves, edge)
        net = with_vertices_on(net, nearest)
    return net


def _roughly(net: Net, curves: FeatureCurves, edge: float) -> Net:
    net = with_short_edges_collapsed(net, curves, edge)
    for _ in range(60):
        finer = with_long_edges_halved(net, curves, edge)
        if finer is net:
            break
        net = with_edges_flipped(finer, by_valence=False, rounds=10)
        net = with_short_edges_collapsed(net, curves, edge, batches=2)
    return net


def _shortest_lengths(points: Floats, sizes: Sequence[SizeField], trees: Sequence[NearestOnSurface]) -> Floats:
    candidates = []
    for tree in trees:
        if tree_lengths := [field.length for field in sizes if field.surface is tree.surface]:
            face, place = tree(points)
            F = tree.surface.F[face]
            weights = barycentric(tree.surface.V[F], place)
            candidates += [np.einsum("kc,kc->k", weights, length[F]) for length in tree_lengths]
    return np.asarray(np.min(candidates, axis=0))


def _on_smooth_surface(net: Net, nearest_on: NearestOnSurface) -> Net:
    free = np.flatnonzero(net.kind == FREE)
    goal = net.V.copy()
    goal[free] = _places(net.V[free], nearest_on, smooth=True)
    return with_vertices_at(net, goal, net.at)


def _places(points: Floats, nearest_on: NearestOnSurface, smooth: bool) -> Floats:
    face, place = nearest_on(points)
    return SmoothPatches(nearest_on.surface).points(face, place) if smooth else place


def _check(surface: Surface, edge: float, finest: float) -> None:
    if not (np.isfinite(edge) and edge > 0):
        raise SurfaceError(f"the edge length {edge} for remeshing must be a positive length in metres")
    if not (np.isfinite(finest) and 0 <= finest <= edge):
        raise SurfaceError(f"the finest edge length, {finest} m, must lie between 0 and the edge length, {edge:g} m")
    if edge > surface.size:
        raise SurfaceError(
            f"edges of {edge:g} m are longer than the surface, whose size is {surface.size:.3g} m; use shorter edges"
        )
    if fault := repeated_face_fault(surface.F):
        raise SurfaceError(f"{fault}; remove the repeated faces")
    if fault := crowded_edge_fault(surface.edges):
        raise SurfaceError(f"{fault}; split the surface there")


def _check_count(sizes: SizeField, finest: float) -> None:
    surface = sizes.surface
    count = (surface.areas / (np.sqrt(3) / 4 * sizes.length[surface.F].mean(axis=1) ** 2)).sum()
    if count > MOST_TRIANGLES:
        raise SurfaceError(
            f"remeshing to edges of {finest:g} m takes over {MOST_TRIANGLES:,} triangles on a surface "
            f"{surface.size:.3g} m large; use longer edges, or check the unit"
        )
