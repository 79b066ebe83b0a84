"""Chains between two regions of material, straightened: nothing is seen of them but an edge between two patches.

They come from the mesh, or from stripes below others, and wander. An outline is left as it is, and so is a crease.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.export.network.graph import VOID, ChainNet
from dsfab.export.network.lifting import Lifting
from dsfab.export.smooth.edges import spread
from dsfab.export.smooth.fits import splines_through

SIDEWAYS = 1 / 3
"""Share of the thickness that a chain may be moved by, sideways."""

POINTS = 9
"""Of a straightened chain."""


def straightened(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """The net with its inner chains on the simplest curves near them; thickness in millimetres."""
    P = np.asarray(net.weights @ lifting.skins.points)
    inner = [k for k, chain in net.chains.items() if chain.right != VOID and len(chain.points) > 2]
    if inner and len(lifting.sides.creases):
        crease = lifting.sides.on_creases(net.weights)
        inner = [k for k in inner if not crease[net.chains[k].points].all()]
    if not inner:
        return net
    fits = splines_through([spread(P[net.chains[k].points]) for k in inner], [SIDEWAYS * thickness] * len(inner))
    x = np.linspace(0, 1, POINTS)[1:-1]
    rows = lifting.weights_at(np.concatenate([curve(x) for curve, _ in fits]))
    chains, start = dict(net.chains), len(P)
    for k in inner:
        points = chains[k].points
        between = np.arange(start, start + len(x))
        chains[k] = replace(chains[k], points=np.concatenate([points[:1], between, points[-1:]]))
        start += len(x)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)
