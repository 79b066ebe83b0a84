"""Long edges halved."""

from dataclasses import replace

import numpy as np

from dsfab.arrays import Bools, Floats, area_vectors, edge_lengths, lengths
from dsfab.surface.refine import halved
from dsfab.surface.remesh.curves import FeatureCurves
from dsfab.surface.remesh.features import TOLERANCE
from dsfab.surface.remesh.net import FREE, ON_CURVE, Net, edges_of
from dsfab.surface.topology import EdgeTable

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
    edges = edges_of(net)
    length = edge_lengths(net.V, edges.ends)
    link = net.link_edges(edges)
    deviation, most = curves.deviation(net.at[net.links], net.at[net.links + 1])
    missing = deviation > TOLERANCE * edge
    long = length > LONGEST * net.size[edges.ends].mean(axis=1)
    long[link[missing]] = True
    long = _leading(net, long, length, edges)
    return _halved(net, curves, edges, long, np.where(missing, most, np.nan)) if long.any() else net


def _leading(net: Net, long: Bools, length: Floats, edges: EdgeTable) -> Bools:
    """(e,) the long edges that are among the longest of their faces."""
    of = np.where(long, length, -1.0)[edges.of]
    longest = of.max(axis=1)
    flat = lengths(area_vectors(net.V, net.F)) < NEEDLE * length[edges.of].max(axis=1) ** 2
    behind = long[edges.of] & (of < (np.where(flat, 1.0, COMPARABLE) * longest)[:, None])
    leading = long.copy()
    leading[edges.of[behind]] = False
    return leading


def _halved(net: Net, curves: FeatureCurves, edges: EdgeTable, halves: Bools, most: Floats) -> Net:
    """Marked edges (e,) halved; those along curves at places (l,) of the axis, or in the middle where these are nan."""
    V, F, _ = halved(net.V, net.F, edges, halves)
    new = len(V) - net.n
    size = np.concatenate([net.size, net.size[edges.ends[halves]].mean(axis=1)])
    kind = np.concatenate([net.kind, np.full(new, FREE)])
    link = net.link_edges(edges)
    on = halves[link]
    before = net.links[on]
    at = np.where(np.isnan(most[on]), (net.at[before] + net.at[before + 1]) / 2, most[on])
    vertex = (np.cumsum(halves) - 1 + net.n)[link[on]]
    kind[vertex] = ON_CURVE
    V[vertex] = curves.place(at)
    return replace(
        net,
        V=V,
        F=F,
        kind=kind,
        size=size,
        node=np.insert(net.node, before + 1, vertex),
        at=np.insert(net.at, before + 1, at),
        curve=np.insert(net.curve, before + 1, net.curve[before]),
    )
