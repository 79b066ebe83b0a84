"""Angles of triangles."""

import numpy as np


def angles(surface):
    P = surface.V[surface.F]
    u, v = np.roll(P, -1, axis=1) - P, np.roll(P, -2, axis=1) - P
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), (u * v).sum(axis=2)))
