"""Stripes and openings that tests of slicing share."""

import numpy as np

from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField

LEVELS = np.arange(-80.0, 81.0)


def plain(z: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Stripes of half width d around whole numbers, as two fields on the vertices."""
    return np.stack([z + d, z - d], axis=1)


def regauged(surface: Surface, z: np.ndarray, d: np.ndarray, seed: int) -> CornerField:
    """The same stripes with a sign and a whole number of its own for every vertex and for every face."""
    rng = np.random.default_rng(seed)
    at_vertex, at_face = (rng.choice([-1.0, 1.0], size) for size in (surface.n, surface.m))
    own, seen = (rng.integers(-3, 4, size).astype(float) for size in (surface.n, surface.m))
    sign = at_face[:, None] * at_vertex[surface.F]
    shift = seen[:, None] - sign * own[surface.F]
    return CornerField(plain(at_vertex * z + own, d), sign, shift, np.zeros(surface.m, bool))


def ripples(surface: Surface, seed: int, count: float = 6.0, bend: float = 3.0) -> np.ndarray:
    """A phase that is linear in space, and bent a little."""
    rng = np.random.default_rng(seed)
    x = (surface.V - surface.V.mean(axis=0)) / surface.size
    return np.asarray(count * (x @ rng.normal(size=3)) + bend * (x @ rng.normal(size=3)) ** 2 + 0.123)


def widths(surface: Surface, kind: str, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    wave = np.sin(6 * surface.V @ rng.normal(size=3) / surface.size)
    return {
        "even": lambda: np.full(surface.n, 0.2),
        "varying": lambda: 0.25 + 0.15 * wave,
        "tips": lambda: np.clip(0.2 + 0.35 * wave, 0, 0.5),
        "any": lambda: rng.uniform(0, 0.5, surface.n),
        "none": lambda: np.zeros(surface.n),
        "touching": lambda: np.full(surface.n, 0.5),
        "some touching": lambda: np.where(rng.random(surface.n) < 0.3, 0.5, 0.1),
    }[kind]()


def striped(surface: Surface, seed: int = 0, snap: float = 0.0) -> Sheet:
    """Two wavy families without pinches, slivers wanted."""
    random = np.random.default_rng(seed)
    fields = [surface.V @ random.normal(size=3) + 0.05 * random.normal(size=surface.n) for _ in range(2)]
    cells = cut(surface, fields, [np.linspace(f.min(), f.max(), 10)[1:-1] for f in fields], snap)
    return resolve_pinches(cells, 0.2 * surface.mean_edge).sheet


def dumbbell(plate: Surface, half: float, far: float = 0.1, size: float = 0.15) -> Sheet:
    """A unit plate with two square openings and a passage between them, 2 `half` wide."""
    x, y = plate.V[:, :2].T - 0.5
    squares = np.maximum(np.abs(np.abs(x) - far - size) - size, np.abs(y) - size)
    return cut(plate, [np.minimum(squares, np.maximum(np.abs(x) - far - 0.05, np.abs(y) - half))], [[0.0]], snap=0)
