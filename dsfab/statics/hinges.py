"""Hinges: pairs of faces that share an edge, and the angle between them."""

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.surface import next_half_edge
from dsfab.surface.mesh import Surface


def hinges(surface: Surface) -> Ints:
    """(i, 4) vertices of every pair of faces that share an edge: edge start, edge end, and the two opposite vertices.

          2
         / \\
        0---1      0 -> 1 runs counter-clockwise in the face of vertex 2
         \\ /
          3
    """
    h0, h1 = surface.edges.pairs.T
    corner = surface.F.ravel()
    ends = [corner[h0], corner[next_half_edge(h0)]]
    opposite = [corner[next_half_edge(h, 2)] for h in (h0, h1)]
    return np.stack(ends + opposite, axis=1)


def angle_gradients(surface: Surface, hinge: Ints) -> tuple[Floats, Floats]:
    """Gradients of the angles between the faces of each hinge, (i, 4, 3) per metre, and weights l^2 / (A1 + A2), (i,).

    With heights h2, h3 of the opposite vertices over the edge, the angle changes by n2 / h2 and n3 / h3 when these move
    along their normals; the edge's ends take up the rest so that no rigid motion changes the angle.
    """
    p0, p1, p2, p3 = (surface.V[hinge[:, k]] for k in range(4))
    edge = p1 - p0
    length = np.linalg.norm(edge, axis=1)
    n2, n3 = np.cross(edge, p2 - p0), np.cross(p3 - p0, edge)
    area2, area3 = np.linalg.norm(n2, axis=1) / 2, np.linalg.norm(n3, axis=1) / 2
    g2 = n2 * (length / (4 * area2**2))[:, None]
    g3 = n3 * (length / (4 * area3**2))[:, None]
    s2 = np.einsum("ij,ij->i", p2 - p0, edge) / length**2
    s3 = np.einsum("ij,ij->i", p3 - p0, edge) / length**2
    g1 = -(g2 * s2[:, None] + g3 * s3[:, None])
    return np.stack([-(g1 + g2 + g3), g1, g2, g3], axis=1), length**2 / (area2 + area3)
