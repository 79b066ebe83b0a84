"""Long edges halved."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, area_vectors, edge_lengths, lengths, row_max
from dsfab.surface.neighbours import faces_at
from dsfab.surface.refine import halved
from dsfab.surface.remesh.curves import FeatureCurves
from dsfab.surface.remesh.features import TOLERANCE
from dsfab.surface.remesh.net import FREE, ON_CURVE, Net, NetFaces

LONGEST = 4 / 3
"""Times the wanted length, from which an edge is halved: its halves are nearer to it [Botsch and Kobbelt 2004]."""

COMPARABLE = 0.7
"""An edge is halved in one step with the longest of its faces where it is at least this share of it."""

NEEDLE = 0.35
"""Twofold area over the longest edge squared, 0.87 of the best face, below which only the longest edge is halved: with
both long edges of a needle halved the parts are as bad."""


def with_long_edges_halved(net: Net, curves: FeatureCurves, edge: float) -> Net:
    """The net with its long edges halved once, those along curves also where they miss the curve; itself if none is.

    edge : metres, to which the tolerance is relative.
    """
    length = edge_lengths(net.V, net.edges.ends)
    deviation, most = curves.deviation(net.at[net.links], net.at[net.links + 1])
    missing = deviation > TOLERANCE * edge
    long = length > LONGEST * net.edge_sizes
    long[net.link_edges[missing]] = True
    long = _leading(net, long, length)
    return _halved(net, curves, long, np.where(missing, most, np.nan)) if long.any() else net


def _leading(net: Net, long: Bools, length: Floats) -> Bools:
    """(e,) the long edges that are among the longest of their faces."""
    faces = np.flatnonzero(faces_at(net.edges.of, long))
    edge = net.edges.of[faces]
    of = np.where(long, length, -1.0)[edge]
    flat = lengths(area_vectors(net.V, net.F[faces])) < NEEDLE * row_max(length[edge]) ** 2
    behind = long[edge] & (of < (np.where(flat, 1.0, COMPARABLE) * row_max(of))[:, None])
    leading = long.copy()
    leading[edge[behind]] = False
    return leading


def _halved(net: Net, curves: FeatureCurves, halves: Bools, most: Floats) -> Net:
    """Marked edges (e,) halved; those along curves at places (l,) of the axis, or in the middle where these are nan."""
    V, F, _ = halved(net.V, net.F, net.edges, halves)
    new = len(V) - net.n
    size = np.concatenate([net.size, net.edge_sizes[halves]])
    kind = np.concatenate([net.kind, np.full(new, FREE)])
    link = net.link_edges
    on = halves[link]
    before = net.links[on]
    at = np.where(np.isnan(most[on]), (net.at[before] + net.at[before + 1]) / 2, most[on])
    vertex = (np.cumsum(halves) - 1 + net.n)[link[on]]
    kind[vertex] = ON_CURVE
    V[vertex] = curves.place(at)
    return replace(
        net,
        V=V,
        faces=NetFaces(F),
        kind=kind,
        size=size,
        node=np.insert(net.node, before + 1, vertex),
        at=np.insert(net.at, before + 1, at),
        curve=np.insert(net.curve, before + 1, net.curve[before]),
    )
