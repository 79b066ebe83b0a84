"""Sheets of no file and no preset, for the table of STEP files."""

from collections.abc import Callable

import igl
import numpy as np

Sheet = tuple[np.ndarray, np.ndarray]
"""Vertices (n, 3), metres, and triangles (m, 3)."""


def strips(x: np.ndarray) -> Sheet:
    """Vertices and triangles of a grid of points (n, m, 3)."""
    i = np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return x.reshape(-1, 3), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def welded(V: np.ndarray, F: np.ndarray) -> Sheet:
    """Vertices and triangles whose vertices at one place are one."""
    _, first, of = np.unique(np.round(V, 9), axis=0, return_index=True, return_inverse=True)
    return V[first], of.reshape(-1)[F]


def folded() -> Sheet:
    """Eight flat strips of 1 x 6 m in plan, .6 m high."""
    u, v = np.meshgrid(np.arange(65) / 8, np.linspace(0, 6, 49), indexing="ij")
    return strips(np.stack([u, v, 0.6 * np.abs((u + 1) % 2 - 1)], axis=2))


def cube() -> Sheet:
    """Of 2 m."""
    import trimesh

    box = trimesh.creation.box((2, 2, 2))
    for _ in range(4):
        box = box.subdivide()
    return box.vertices + np.array([0, 0, 1.0]), box.faces


def helicoid() -> Sheet:
    """Three quarters of a turn, from 1 to 4 m, 3 m high."""
    r, a = np.meshgrid(np.linspace(1, 4, 25), np.linspace(0, 1.5 * np.pi, 97), indexing="ij")
    return strips(np.stack([r * np.cos(a), r * np.sin(a), 3 * a / a.max()], axis=2))


def moebius() -> Sheet:
    """Of radius 3 m, 1.6 m wide; its ends are joined by place."""
    w, a = np.meshgrid(np.linspace(-0.8, 0.8, 13), np.linspace(0, 2 * np.pi, 121), indexing="ij")
    r = 3 + w * np.cos(a / 2)
    return welded(*strips(np.stack([r * np.cos(a), r * np.sin(a), 1 + w * np.sin(a / 2)], axis=2)))


def cylinder() -> Sheet:
    """A half of radius 3 m whose grid runs at 45 degrees."""
    u, v = np.meshgrid(np.linspace(0, np.pi, 65), np.linspace(0, 8, 57), indexing="ij")
    return strips(np.stack([3 * np.cos(u), v + u, 3 * np.sin(u)], axis=2))


def catenoid() -> Sheet:
    """Of 1.5 m around its waist, 3 m high; its ends are joined by place."""
    z, a = np.meshgrid(np.linspace(-1.5, 1.5, 41), np.linspace(0, 2 * np.pi, 121), indexing="ij")
    r = 1.5 * np.cosh(z / 1.5)
    return welded(*strips(np.stack([r * np.cos(a), r * np.sin(a), z + 1.5], axis=2)))


def schwarz() -> Sheet:
    """A cell of Schwarz's P surface, 6 m."""
    x = np.linspace(-np.pi, np.pi, 44)  # of which none is in the surface: 43 is prime
    Z, Y, X = (axis.ravel() for axis in np.meshgrid(x, x, x, indexing="ij"))  # x runs fastest
    V, F, *_ = igl.marching_cubes(
        np.cos(X) + np.cos(Y) + np.cos(Z), np.stack([X, Y, Z], axis=1) * 3 / np.pi, 44, 44, 44, 0.0
    )
    return np.asarray(V), np.asarray(F)


def enneper() -> Sheet:
    """A square piece of Enneper's surface, 6 m across; it would cross itself from u = v = 1.22 on."""
    u, v = np.meshgrid(*[np.linspace(-1.1, 1.1, 73)] * 2, indexing="ij")
    return strips(1.5 * np.stack([u - u**3 / 3 + u * v**2, v**3 / 3 - v - v * u**2, u**2 - v**2], axis=2))


def genus_two() -> Sheet:
    """Two rings of 1.6 m and tubes of .62 m that run into each other, with slivers as marching cubes leave them."""
    count, reach = (83, 53, 19), (4.4, 2.6, 0.9)
    axes = [np.linspace(-x, x, k) for x, k in zip(reach, count, strict=True)]
    Z, Y, X = (axis.ravel() for axis in np.meshgrid(*axes[::-1], indexing="ij"))  # x runs fastest
    rings = [np.hypot(np.hypot(X - x, Y) - 1.6, Z) - 0.62 for x in (-1.95, 1.95)]
    field = -0.25 * np.logaddexp(-rings[0] / 0.25, -rings[1] / 0.25)
    V, F, *_ = igl.marching_cubes(field, np.stack([X, Y, Z], axis=1), *count, 0.0)
    return np.asarray(V), np.asarray(F)


def saddle() -> Sheet:
    """A hyperbolic paraboloid over 8 x 6 m, 3.2 m high."""
    x, y = np.meshgrid(np.linspace(-4, 4, 65), np.linspace(-3, 3, 49), indexing="ij")
    return strips(np.stack([x, y, 1.6 * ((x / 4) ** 2 - (y / 3) ** 2 + 1)], axis=2))


def terrain() -> Sheet:
    """Rugged ground of 20 x 20 m whose spectrum falls with the wave number to 2.2, of slopes up to 36 degrees."""
    n = 81
    wave = np.hypot(*np.meshgrid(*[np.fft.fftfreq(n, 1 / n)] * 2, indexing="ij"))
    falls = np.where((wave > 0) & (wave < 9), np.maximum(wave, 1) ** -2.2, 0)
    z = np.fft.ifft2(np.fft.fft2(np.random.default_rng(3).normal(size=(n, n))) * falls).real
    z *= np.tan(np.radians(36)) / np.hypot(*np.gradient(z, 20 / (n - 1))).max()
    x, y = np.meshgrid(*[np.linspace(0, 20, n)] * 2, indexing="ij")
    return strips(np.stack([x, y, z - z.min()], axis=2))


OWN: dict[str, Callable[[], Sheet]] = {
    f.__name__: f
    for f in (*(folded, cube, helicoid, moebius, cylinder, catenoid, schwarz), *(enneper, genus_two, saddle, terrain))
}
