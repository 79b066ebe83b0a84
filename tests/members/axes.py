"""The axis of a member."""

import numpy as np

from dsfab.members import MemberAxis


def axis(points, normals, closed=False) -> MemberAxis:
    """Through points (k, 3), straight between them."""
    P, normals = np.asarray(points, dtype=float), np.asarray(normals, dtype=float)
    step = np.linalg.norm(np.diff(P, axis=0), axis=1)
    s = np.concatenate([[0], np.cumsum(step)])
    T = np.gradient(P, s, axis=0)
    if closed:
        T[0] = T[-1] = P[1] - P[-2]
    T /= np.linalg.norm(T, axis=1)[:, None]
    zero = np.zeros(len(s))
    return MemberAxis(s, P, T, np.broadcast_to(normals, P.shape), zero, zero, zero, closed, s, 0.0)
