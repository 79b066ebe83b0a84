"""`remeshed`: a surface with edges of a wanted length."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Floats, first
from dsfab.errors import SurfaceError
from dsfab.surface.mesh import Surface
from dsfab.surface.refine import LARGEST
from dsfab.surface.remesh.collapse import with_short_edges_collapsed
from dsfab.surface.remesh.curves import FeatureCurves, feature_curves
from dsfab.surface.remesh.ears import with_ears_turned
from dsfab.surface.remesh.facets import SmoothPatches, barycentric
from dsfab.surface.remesh.flip import with_edges_flipped
from dsfab.surface.remesh.net import FREE, Net
from dsfab.surface.remesh.size import chord_lengths, with_sizes
from dsfab.surface.remesh.size_fields import SizeField, curvature_sizes
from dsfab.surface.remesh.smoothing import NearestOnSurface, with_even_vertices, with_vertices_at, with_vertices_on
from dsfab.surface.remesh.split import with_long_edges_halved
from dsfab.surface.topology import duplicate_faces, named_edges

ROUNDS = 8
"""How often edges are split, collapsed and flipped, and vertices moved."""

HALVINGS = 60
"""How often edges are halved at most in the first round."""

FLIPS = 10
"""How often edges are turned after each of these: each time those that touch no other."""

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
    that takes it, and where curves lie closer together. The same surface gives the same mesh.

    Raises SurfaceError for lengths that are none, edges that are longer than the surface or would take over `LARGEST`
    triangles, and a surface with repeated faces or edges of more than two.
    """
    _check(surface, edge, finest)
    if finest:
        sizes = [*sizes, SizeField(surface, curvature_sizes(surface, edge, finest))]
    for one in sizes or [SizeField(surface, np.full(surface.n, edge))]:
        _check_count(one, finest or float(one.length.min()))
    surface = with_ears_turned(surface)
    curves = feature_curves(surface, edge)
    nearest = NearestOnSurface(surface)
    net = _even(Net.of(surface, curves, edge), curves, nearest, sizes, edge)
    net = with_edges_flipped(net, by_valence=False, rounds=3)
    return Surface(_smoothed(net, surface, nearest).V if smooth else net.V, net.F)


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


def _smoothed(net: Net, surface: Surface, nearest: NearestOnSurface) -> Net:
    """The net with its free vertices on the smooth surface through those of the old one."""
    free = np.flatnonzero(net.kind == FREE)
    goal = net.V.copy()
    goal[free] = SmoothPatches(surface).points(*nearest(net.V[free]))
    return with_vertices_at(net, goal, net.at)


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
