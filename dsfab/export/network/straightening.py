"""Chains between two regions of material, straightened: nothing is seen of them but an edge between two patches.

They come from the mesh, or from stripes below others, and wander. An outline is left as it is, and so is a crease.

----------------.       Where a stripe ends below another, a chain runs out and back (a hairpin). No four-sided patches
   one region    )      fit around such a tip: what is inside and what is beside become one region, and a face of a few
----------------'       edges goes over both.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

from dsfab.arrays import Floats
from dsfab.export.network.crossings import without_chain
from dsfab.export.network.graph import VOID, ChainNet
from dsfab.export.network.lifting import Lifting
from dsfab.export.smooth.edges import spread
from dsfab.export.smooth.fits import splines_through
from dsfab.export.splines import Spline

SIDEWAYS = 1 / 3
"""Share of the thickness that a chain may be moved by, sideways."""

POINTS = 9
"""Of a straightened chain, at least."""

SAG = 1 / 400
"""Share of the thickness by which the chords between its points are off its curve, about: what is fitted to the corners
of a polyline has many spans."""

PLACES = np.linspace(0, 1, 65)
"""Where a curve is asked how it bends."""

BACK = 1.5
"""Times the distance between its ends that a hairpin is long, at least: half a circle is 1.57."""

SPANS = 4
"""Of a chain that wanders too much to be the side of a patch, there are more."""

LEVEL = 0.5
"""Least cosine between the mean normal around a region that others become part of and any one."""


def straightened(net: ChainNet, lifting: Lifting, thickness: float) -> ChainNet:
    """The net without hairpins, its inner chains on the simplest curves near them; thickness in millimetres."""
    P = np.asarray(net.weights @ lifting.skins.points)
    inner = [k for k, chain in net.chains.items() if chain.right != VOID and len(chain.points) > 2]
    if inner and len(lifting.sides.creases):
        crease = lifting.sides.on_creases(net.weights)
        inner = [k for k in inner if not crease[net.chains[k].points].all()]
    fits = splines_through([spread(P[net.chains[k].points]) for k in inner], [SIDEWAYS * thickness] * len(inner))
    curves = {k: curve for k, (curve, _) in zip(inner, fits, strict=True)}
    N = np.asarray(net.weights @ lifting.skins.normals)
    net = _without_hairpins(net, [k for k, curve in curves.items() if _turns_back(curve)], N)
    curves = {k: curve for k, curve in curves.items() if k in net.chains}
    if not curves:
        return net
    between = [curve(np.linspace(0, 1, _points(curve, SAG * thickness))[1:-1]) for curve in curves.values()]
    rows = lifting.weights_at(np.concatenate(between))
    chains, start = dict(net.chains), len(P)
    for k, some in zip(curves, between, strict=True):
        points, new = chains[k].points, np.arange(start, start + len(some))
        chains[k] = replace(chains[k], points=np.concatenate([points[:1], new, points[-1:]]))
        start += len(some)
    return replace(net, weights=csr_array(vstack([net.weights, rows], format="csr")), chains=chains)


def _turns_back(curve: Spline) -> bool:
    """Whether a chain is a hairpin, or wanders as much."""
    line = curve(PLACES)
    way = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    return way > BACK * float(np.linalg.norm(line[-1] - line[0])) or len(np.unique(curve.knots)) - 1 > SPANS


def _without_hairpins(net: ChainNet, some: Sequence[int], N: Floats) -> ChainNet:
    """The net without some chains, where one plane sees both regions beside them; N (p, 3) normals at its points."""
    for k in some:
        chain = net.chains.get(k)
        if chain is None or chain.left == chain.right:
            continue
        steps = [step for region in (chain.left, chain.right) for loop in net.loops[region] for step, _ in loop]
        around = N[np.concatenate([net.chains[step].points for step in steps])]
        mean = around.mean(axis=0)
        if (around @ mean).min() > LEVEL * np.linalg.norm(mean):
            net = without_chain(net, k)
    return net


def _points(curve: Spline, sag: float) -> int:
    """How many points of a curve have chords between them that are off it by no more than `sag`, in its unit."""
    bends = np.diff(curve(PLACES), n=2, axis=0) * (len(PLACES) - 1) ** 2
    most = float(np.linalg.norm(bends, axis=1).max())
    return max(POINTS, 1 + int(np.ceil(np.sqrt(most / (8 * sag)))))
