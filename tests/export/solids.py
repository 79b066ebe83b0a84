"""Small solids with known volumes."""

import numpy as np

from dsfab.thickening import Solid

SIZE = np.array([0.2, 0.3, 0.05])


def solid_box(size=SIZE, corner=(0.0, 0.0, 0.0)) -> Solid:
    """Twelve triangles around a box."""
    V = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size + corner
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Solid(V, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), genus=0, pieces=1)


def solid_torus(nu: int = 24, nv: int = 12) -> Solid:
    """Radii 1 m and 0.3 m, in triangles facing outwards."""
    u, v = (2 * np.pi * x / n for x, n in zip(np.divmod(np.arange(nu * nv), nv), (nu, nv), strict=True))
    r = 1 + 0.3 * np.cos(v)
    i, j = np.divmod(np.arange(nu * nv), nv)
    a, b = i * nv + j, (i + 1) % nu * nv + j
    c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
    F = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    return Solid(np.c_[r * np.cos(u), r * np.sin(u), 0.3 * np.sin(v)], F, genus=1, pieces=1)


def needle(gap: float, corner: float) -> Solid:
    """A box whose edge 0-1 is cut in two by a vertex `gap` from its upper end."""
    solid = solid_box(corner=(corner, 0.0, 0.0))
    V = np.r_[solid.V, [solid.V[1] - [0, 0, gap]]]
    on = [f for f in solid.F.tolist() if {0, 1} <= set(f)]
    halves = [[8 if v == old else v for v in f] for f in on for old in (0, 1)]
    return Solid(V, np.array([f for f in solid.F.tolist() if f not in on] + halves), genus=0, pieces=1)
