"""Surfaces of which the middles of stripes are known in closed form, with two families of stripes on them.

Each is a map of a grid, shaken so that nothing runs along its lines, on which z of both families is a function of the
parameters. Lengths in metres.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dsfab.results import PatternResult
from dsfab.slicing import cut
from dsfab.surface import Surface

WIDTH = 0.12


@dataclass(frozen=True)
class Drawn:
    """A surface and the stripes z = k of both families on it.

    truth : for a family and a number k: what is known of that line, by name: bay (a length, or a function of the two
            numbers of the crossing family), kn, kg, tg (sizes).
    """

    surface: Surface
    z: tuple[np.ndarray, np.ndarray]
    d: tuple[np.ndarray, np.ndarray]
    truth: Callable[[str, int], dict]

    @property
    def pattern(self) -> PatternResult:
        fields = tuple(np.stack([z + d, z - d], axis=1) for z, d in zip(self.z, self.d, strict=True))
        levels = tuple(np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2) for z in self.z)
        return PatternResult(("major", "minor"), fields, levels, self.d)

    def sheet(self):
        return cut(self.surface, self.pattern.fields, self.pattern.levels).subset()


def chart_grid(place, u, v, shake=0.2):
    """Points place(u, v) of a grid of parameters, faces, and the parameters at the points."""
    U, V = np.meshgrid(u, v, indexing="ij")
    random = np.random.default_rng(0)
    for X, x in ((U, u), (V, v)):
        X[1:-1, 1:-1] += random.uniform(-shake, shake, X[1:-1, 1:-1].shape) * (x[1] - x[0])
    n, m = U.shape
    index = np.arange(n * m).reshape(n, m)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    even = (np.add.outer(np.arange(n - 1), np.arange(m - 1)) % 2 == 0).ravel()[:, None]
    one = np.where(even, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1))
    two = np.where(even, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1))
    points = np.stack(place(U, V), axis=-1).reshape(-1, 3)
    return Surface(points, np.concatenate([one, two])), U.ravel(), V.ravel()


def _steps(low, high, edge, scale=1.0):
    return np.linspace(low, high, max(4, round(scale * (high - low) / edge) + 1))


def sphere(edge, R=6.5):
    """Parallels t = .33 + .1 k and meridians p = .05 + .16 k of a part of a sphere."""
    surface, t, p = chart_grid(
        lambda t, p: (R * np.sin(t) * np.cos(p), R * np.sin(t) * np.sin(p), R * np.cos(t)),
        _steps(0.3, 1.0, edge, R),
        _steps(0.0, 2.5, edge, np.sin(1.0) * R),
    )
    z = (t - 0.33) / 0.1, (p - 0.05) / 0.16
    d = np.full(len(t), WIDTH / 2 / (0.1 * R)), WIDTH / 2 / (0.16 * R * np.sin(t))

    def truth(family, k):
        t = 0.33 + 0.1 * k
        if family == "minor":
            return {"bay": 0.1 * R, "kn": 1 / R, "kg": 0.0, "tg": 0.0}
        return {"bay": 0.16 * R * np.sin(t), "kn": 1 / R, "kg": 1 / np.tan(t) / R, "tg": 0.0}

    return Drawn(surface, z, d, truth)


def cylinder(edge, R=4.45):
    """Helices at 45 degrees on a part of a cylinder, .8 m apart."""
    surface, a, y = chart_grid(
        lambda a, y: (R * np.sin(a), y, R * np.cos(a)), _steps(-1, 1, edge, R), _steps(0, 8, edge)
    )
    z = (R * a + y) / np.sqrt(2) / 0.8 + 0.3, (R * a - y) / np.sqrt(2) / 0.8 + 0.3
    d = np.full(len(a), WIDTH / 2 / 0.8)
    truth = {"bay": 0.8, "kn": 1 / (2 * R), "kg": 0.0, "tg": 1 / (2 * R)}
    return Drawn(surface, z, (d, d), lambda family, k: truth)


def hypar(edge, c=6.0):
    """The straight lines x = .6 (k - .25) and y = .6 (k - .25) of z = x y / c."""
    surface, x, y = chart_grid(lambda x, y: (x, y, x * y / c), _steps(-3, 3, edge), _steps(-3, 3, edge))
    z = x / 0.6 + 0.25, y / 0.6 + 0.25
    d = np.full(len(x), WIDTH / 2 / 0.6)

    def truth(family, k):
        return {"bay": 0.6 * np.hypot(1, 0.6 * (k - 0.25) / c), "kn": 0.0, "kg": 0.0}

    return Drawn(surface, z, (d, d), truth)


def catenoid(edge, c=3.0):
    """Parallels v = .5 k + .2 and meridians u = .2 k + .07 of r = c cosh(v / c)."""
    surface, u, v = chart_grid(
        lambda u, v: (c * np.cosh(v / c) * np.cos(u), c * np.cosh(v / c) * np.sin(u), v),
        _steps(0.0, 2.4, edge, np.cosh(2 / 3) * c),
        _steps(-2.0, 2.0, edge),
    )
    z = (v - 0.2) / 0.5, (u - 0.07) / 0.2
    d = WIDTH / 2 / 0.5 / np.cosh(v / c), WIDTH / 2 / (0.2 * c * np.cosh(v / c))

    def truth(family, k):
        if family == "minor":
            return {"bay": lambda i: c * (np.sinh((0.5 * i + 0.7) / c) - np.sinh((0.5 * i + 0.2) / c)), "kg": 0.0}
        r = c * np.cosh((0.5 * k + 0.2) / c)
        return {"bay": 0.2 * r, "kn": c / r**2, "kg": np.sinh((0.5 * k + 0.2) / c) * c / r**2, "tg": 0.0}

    return Drawn(surface, z, d, truth)


SURFACES = {"sphere": sphere, "cylinder": cylinder, "hypar": hypar, "catenoid": catenoid}
