"""A free-form canopy of 16 x 12 m on four feet with two openings: a roof that no preset knows."""

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from dsfab.surface import Surface


def _line(p, q, edge):
    p, q = np.array(p, float), np.array(q, float)
    count = max(int(np.linalg.norm(q - p) / edge), 2)
    return p + np.linspace(0, 1, count, endpoint=False)[:, None] * (q - p)


def _arc(p, q, sag, edge):
    """From p to q along a circle that comes `sag` metres inwards, to the left."""
    p, q = np.array(p, float), np.array(q, float)
    chord = np.linalg.norm(q - p)
    along = (q - p) / chord
    radius = (chord**2 / 4 + sag**2) / (2 * sag)
    half = np.arcsin(chord / 2 / radius)
    t = np.linspace(-half, half, max(int(2 * radius * half / edge), 4), endpoint=False)
    inwards = np.outer(radius * (np.cos(t) - np.cos(half)), [-along[1], along[0]])
    return (p + q) / 2 + np.outer(radius * np.sin(t), along) + inwards


def _ellipse(x, y, a, b, turn, edge):
    t = np.linspace(0, 2 * np.pi, int(2 * np.pi * np.sqrt((a * a + b * b) / 2) / edge), endpoint=False)
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([a * np.cos(t), b * np.sin(t)], axis=1) @ np.array([[c, s], [-s, c]]) + (x, y)


def _within(points, loop):
    """Which points a loop encloses: it crosses the ray from them towards larger x an odd number of times."""
    (x, y), (a, b) = points.T[:, :, None], (loop.T[:, None], np.roll(loop, -1, axis=0).T[:, None])
    crosses = (a[1] > y) != (b[1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    return (crosses & (x < at)).sum(axis=1) % 2 == 1


def _height(x, y):
    """A vault between the feet with a hump over one opening and a dip in the middle."""
    vault = 4.3 * (1 - ((x / 8) ** 4 + (y / 6) ** 4) / 2) * (1 + 0.05 * x / 8)
    return vault + 0.45 * np.exp(-((x + 3) ** 2 + (y - 1) ** 2) / 8) - 0.35 * np.exp(-((x - 1) ** 2 + (y + 1) ** 2) / 5)


def canopy(edge: float = 0.35) -> Surface:
    """The surface with edges of about so many metres."""
    feet = [(-8, -5.4), (-7.4, -6), (7.4, -6), (8, -5.4), (8, 5.4), (7.4, 6), (-7.4, 6), (-8, 5.4)]
    sags = [1.6, 1.3, 1.9, 1.1]
    sides = []
    for k, sag in enumerate(sags):
        a, b, c = feet[2 * k], feet[2 * k + 1], feet[(2 * k + 2) % 8]
        sides += [_line(a, b, edge), _arc(b, c, sag, edge)]
    outer = np.vstack(sides)
    holes = [_ellipse(-3, 0.6, 1.5, 1.0, 0.5, edge), _ellipse(3.2, -0.7, 1.1, 0.8, -0.3, edge)]

    def inside(points):
        return _within(points, outer) & ~np.any([_within(points, hole) for hole in holes], axis=0)

    X, Y = np.meshgrid(np.arange(-8.2, 8.2, edge), np.arange(-6.2, 6.2, edge * np.sqrt(3) / 2))
    X[1::2] += edge / 2
    points = np.stack([X.ravel(), Y.ravel()], axis=1)
    points += np.random.default_rng(0).normal(0, 0.06 * edge, points.shape)
    rim = np.vstack([outer, *holes])
    points = points[inside(points) & (cKDTree(rim).query(points)[0] > 0.55 * edge)]
    plan = np.vstack([rim, points])
    F = Delaunay(plan).simplices
    F = F[inside(plan[F].mean(axis=1))]
    V = np.column_stack([plan, _height(*plan.T)])
    down = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])[:, 2] < 0
    F[down] = F[down][:, ::-1]
    return Surface(V, F)
