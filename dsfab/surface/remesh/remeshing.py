"""`remeshed`: a surface with edges of a wanted length."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from dsfab.core.arrays import Floats, face_angles, first
from dsfab.core.errors import SurfaceError
from dsfab.surface.edge_changes import LARGEST
from dsfab.surface.mesh import Surface, nearest
from dsfab.surface.remesh.edges import (
    FIXED,
    FREE,
    Net,
    NetFaces,
    with_ears_turned,
    with_edges_flipped,
    with_long_edges_halved,
    with_short_edges_collapsed,
)
from dsfab.surface.remesh.features import TOLERANCE, FeatureCurves, design_features, feature_curves
from dsfab.surface.remesh.mirrors import NEAR, Chamber, Mirrors
from dsfab.surface.remesh.sizes import SizeField, chord_lengths, curvature_sizes, with_sizes
from dsfab.surface.remesh.smoothing import (
    NearestOnSurface,
    SmoothPatches,
    barycentric,
    with_even_vertices,
    with_vertices_at,
    with_vertices_on,
)
from dsfab.surface.topology import duplicate_faces, named_edges

ROUNDS = 8
"""How often edges are split, collapsed and flipped, and vertices moved."""

HALVINGS = 60
"""How often edges are halved at most in the first round."""

FLIPS = 10
"""How often edges are turned after each of these: each time those that touch no other."""

SHARP = 20.0
"""Degrees: with sharper faces than these one side and its images must be about as good as the whole made at once."""

NOT_SHARPER = 0.9
"""That is, this share of the smallest angle: a mirror along a tip halves it."""

LEAST_SIDE = 100
"""Triangles of the wanted size that a side has at least: or its edges, which are kept, leave no room for even ones."""

BATCHES = 12
"""How many batches of collapses a round has."""


def remeshed(
    surface: Surface, edge: float, finest: float = 0.0, smooth: bool = False, sizes: Sequence[SizeField] = ()
) -> Surface:
    """The surface with nearly equilateral triangles whose edges are about `edge` metres long.

    finest : metres; where the surface is curved edges are shorter, down to this, so that it turns by 15 degrees along
             one; 0 leaves that out.
    smooth : whether new vertices lie on the smooth surface through the old ones [Vlachos et al. 2001]; else
             they lie on its facets.
    sizes  : lengths wanted at vertices of this surface or of others that lie on it, metres; the shortest counts.

    Boundaries, and creases of more than 30 degrees, are kept to a fiftieth of `edge`, their corners exactly, and so are
    the extent in x, y and z, the number of pieces and holes, and the sides that the faces have; not creases of slivers
    and noise, see `design_features`, nor of ears, see `with_ears_turned`. Edges are shorter than asked where
    that takes it, and where curves lie closer together. The same surface gives the same mesh, and one that is its own
    image in mirrors, but for a twentieth of `edge`, one that is so exactly, where all edges are wanted as long there;
    its extent is kept to a fiftieth of `edge` then.

    Raises SurfaceError for lengths that are none, edges that are longer than the surface or would take over `LARGEST`
    triangles, and a surface with repeated faces or edges of more than two.
    """
    _check(surface, edge, finest)
    mirrored = not sizes  # what is given may differ from side to side
    if finest:
        sizes = [*sizes, SizeField(surface, curvature_sizes(surface, edge, finest))]
    for one in sizes or [SizeField(surface, np.full(surface.n, edge))]:
        _check_count(one, finest or float(one.length.min()))
    surface = with_ears_turned(surface)
    nearest_to = NearestOnSurface(surface)
    found = _by_sides(nearest_to, edge, smooth, sizes) if mirrored else None
    if found and _sharpest(found) > SHARP:
        return found
    net = _net(nearest_to, sizes, edge)
    whole = Surface(_smoothed(net, nearest_to).V if smooth else net.V, net.F)
    return found if found and _sharpest(found) > NOT_SHARPER * _sharpest(whole) else whole


def _sharpest(surface: Surface) -> float:
    """The smallest angle of a face, degrees."""
    return float(np.degrees(face_angles(surface.V, surface.F).min()))


def _by_sides(on: NearestOnSurface, edge: float, smooth: bool, sizes: Sequence[SizeField]) -> Surface | None:
    """One side of all mirrors of the surface made anew, and its images; None where there is no mirror, where a side is
    too small for that, or where something of the surface would be lost."""
    surface = on.surface
    mirrors = Mirrors.of(on, edge, smooth)
    chamber = Chamber.of(surface, mirrors, edge) if mirrors else None
    piece = chamber.piece if chamber else None
    if chamber is None or piece is None or piece.area < LEAST_SIDE * np.sqrt(3) / 4 * edge**2:
        return None
    net = _net(NearestOnSurface(piece), sizes, edge)
    planes = chamber.within(net.V)
    moved = (net.kind == FREE) | planes.any(axis=0)
    goal = np.where(moved[:, None], _places(net.V, on, smooth), net.V) if smooth else net.V
    net = with_vertices_at(net, chamber.flat(goal, planes), net.at)
    found = chamber.all_sides(net.V, net.F)
    if found is None:
        return None
    every, of = found
    none = net.node[:0]
    whole = Net(every.V, NetFaces(every.F), net.kind[of], none, net.at[:0], none, net.size[of])
    V = with_vertices_at(whole, _on_whole(whole, on, edge, smooth), whole.at).V
    box, new = ((x.min(axis=0), x.max(axis=0)) for x in (surface.V, V))
    with suppress(SurfaceError):  # of faces in a narrow tip, where two vertices are at the same corner
        return Surface(V, every.F) if np.abs(np.subtract(box, new)).max() < TOLERANCE * edge else None
    return None


def _on_whole(net: Net, on: NearestOnSurface, edge: float, smooth: bool) -> Floats:
    """(n, 3) the places of a net's vertices on the boundaries, creases and corners of the surface, and on its facets if
    it is not smooth: the images of one side are a little beside them where another side's are."""
    surface = on.surface
    lines = surface.edges.ends[design_features(surface, edge)]
    goal = net.V.copy() if smooth else _places(net.V, on, smooth)
    held, fixed = np.flatnonzero(net.kind > FREE), feature_curves(surface, edge).fixed
    for some, there in ((held, lines), (held[net.kind[held] == FIXED], fixed[:, None])):
        if len(some) and len(there):
            found = nearest(net.V[some], surface.V, there)
            near = found.distance < TOLERANCE * edge
            goal[some[near]] = found.place[near]
    for most, ends in ((surface.V.max(axis=0), goal.argmax(axis=0)), (surface.V.min(axis=0), goal.argmin(axis=0))):
        now = goal[ends, (0, 1, 2)]
        goal[ends, (0, 1, 2)] = np.where(np.abs(now - most) < NEAR * edge, most, now)  # as a file rounds
    return goal


def _net(on: NearestOnSurface, sizes: Sequence[SizeField], edge: float) -> Net:
    """The surface made anew of even triangles on its facets."""
    curves = feature_curves(on.surface, edge)
    net = _even(Net.of(on.surface, curves, edge), curves, on, sizes, edge)
    return with_edges_flipped(net, by_valence=False, rounds=3)


def _even(net: Net, curves: FeatureCurves, nearest: NearestOnSurface, sizes: Sequence[SizeField], edge: float) -> Net:
    """The net after all rounds; edges are wanted `edge` metres long, or as the shortest of the sizes."""
    chords = chord_lengths(curves, edge)
    finer = [one for one in sizes if np.ptp(one.length)]
    others = {one.surface for one in finer} - {nearest.surface}
    trees = [nearest, *map(NearestOnSurface, others)]
    for k in range(ROUNDS):
        base = _shortest(net.V, finer, trees) if finer else edge
        net = with_sizes(net, chords, curves, np.minimum(base, edge))
        if not k:
            net = _roughly(net, curves, edge)
        for _ in range(2):
            net = with_long_edges_halved(net, curves, edge)
        net = with_short_edges_collapsed(net, curves, edge, BATCHES)
        net = with_edges_flipped(net, by_valence=k < ROUNDS - 1, rounds=4)
        net = with_even_vertices(net, curves, edge)
        net = with_even_vertices(net, curves, edge)
        net = with_vertices_on(net, nearest)
    return net


def _roughly(net: Net, curves: FeatureCurves, edge: float) -> Net:
    """The net with its long edges halved until there are none, turned and collapsed in between: of needles, which long
    edges come from, their long sides give the more points the more of them are still there."""
    net = with_short_edges_collapsed(net, curves, edge, BATCHES)
    for _ in range(HALVINGS):
        finer = with_long_edges_halved(net, curves, edge)
        if finer is net:
            break
        net = with_edges_flipped(finer, by_valence=False, rounds=FLIPS)
        net = with_short_edges_collapsed(net, curves, edge, batches=2)
    return net


def _shortest(points: Floats, sizes: Sequence[SizeField], trees: Sequence[NearestOnSurface]) -> Floats:
    """(k,) the shortest of the lengths of fields at points (k, 3), metres; one tree for all fields on a surface."""
    found = []
    for tree in trees:
        if mine := [one.length for one in sizes if one.surface is tree.surface]:
            face, place = tree(points)
            F = tree.surface.F[face]
            weights = barycentric(tree.surface.V[F], place)
            found += [np.einsum("kc,kc->k", weights, length[F]) for length in mine]
    return np.asarray(np.min(found, axis=0))


def _smoothed(net: Net, on: NearestOnSurface) -> Net:
    """The net with its free vertices on the smooth surface through those of the old one."""
    free = np.flatnonzero(net.kind == FREE)
    goal = net.V.copy()
    goal[free] = _places(net.V[free], on, smooth=True)
    return with_vertices_at(net, goal, net.at)


def _places(points: Floats, on: NearestOnSurface, smooth: bool) -> Floats:
    """(k, 3) the places nearest to points (k, 3) on the facets, or above these on the smooth surface, metres."""
    face, place = on(points)
    return SmoothPatches(on.surface).points(face, place) if smooth else place


def _check(surface: Surface, edge: float, finest: float) -> None:
    if not (np.isfinite(edge) and edge > 0):
        raise SurfaceError(f"the edge length {edge} to remesh to must be a positive length in metres")
    if not (np.isfinite(finest) and 0 <= finest <= edge):
        raise SurfaceError(f"the finest edge, {finest} m, must lie between 0 and the edge, {edge:g} m")
    if edge > surface.size:
        raise SurfaceError(
            f"edges of {edge:g} m are longer than the surface, {surface.size:.3g} m; ask for shorter ones, in metres"
        )
    if len(twice := duplicate_faces(surface.F)):
        raise SurfaceError(f"{len(twice)} faces repeat an earlier face (first: {first(twice)}); remove them to remesh")
    crowded = np.flatnonzero(surface.edges.count > 2)
    if len(crowded):
        where = named_edges(crowded, surface.edges)
        raise SurfaceError(
            f"{len(crowded)} edges have more than two faces (first: {where}); split the surface there to remesh it"
        )


def _check_count(sizes: SizeField, finest: float) -> None:
    """Of equilateral triangles, by their area; finest : metres, what is told."""
    surface = sizes.surface
    count = (surface.areas / (np.sqrt(3) / 4 * sizes.length[surface.F].mean(axis=1) ** 2)).sum()
    if count > LARGEST:
        raise SurfaceError(
            f"remeshing to edges of {finest:g} m takes over {LARGEST:,} triangles on a surface {surface.size:.3g} m "
            "large; ask for longer edges, or check the unit"
        )
