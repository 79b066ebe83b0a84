"""Height fields over a square: poles of a Bezier surface, what they count somewhere, and how they differ."""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from scipy.special import comb

from dsfab.arrays import Floats


def places(poles: Floats, axes: Floats, points: Floats) -> Floats:
    """(k, 2) parameters of points (k, 3) over a surface with such poles (p + 1, p + 1, 3), which lie evenly over a
    parallelogram in the plane of the first two axes."""
    (a, b), (c, _) = poles[:: len(poles) - 1, :: len(poles) - 1] @ axes[:2].T
    return np.asarray(np.linalg.solve(np.stack([c - a, b - a], axis=1), (points @ axes[:2].T - a).T).T)


def height_rows(uv: Floats, degree: int) -> Floats:
    """(k, (degree + 1)^2) what each pole counts at places (k, 2) of a square."""
    both = np.einsum("ka,kb->kab", _powers(uv[:, 0], degree), _powers(uv[:, 1], degree))
    return np.asarray(both.reshape(len(uv), -1))


def rows_at(uv: Floats) -> Callable[[int], Floats]:
    """The same by degree at places (k, 2) that are asked often, found once."""
    return cache(partial(height_rows, uv))


def raised(poles: Floats, degree: int) -> Floats:
    """(degree + 1, degree + 1) poles of the same surface as those (p + 1, p + 1)."""
    while (n := len(poles)) <= degree:
        poles = _higher(n) @ poles @ _higher(n).T
    return poles


@cache
def _higher(n: int) -> Floats:
    """(n + 1, n) the poles of a curve a degree higher than its n are."""
    share = np.arange(n + 1)[:, None] / n
    return np.asarray(share * np.eye(n + 1, n, -1) + (1 - share) * np.eye(n + 1, n))


def _powers(x: Floats, degree: int) -> Floats:
    """(k, degree + 1) Bernstein polynomials at x (k,)."""
    i = np.arange(degree + 1)
    return np.asarray(_binomials(degree) * x[:, None] ** i * (1 - x[:, None]) ** (degree - i))


@cache
def _binomials(degree: int) -> Floats:
    """(degree + 1,) how many ways there are to take 0, 1 ... of as many things as the degree is."""
    return np.asarray(comb(degree, np.arange(degree + 1)))


@cache
def differences(count: int) -> Floats:
    """(2 (k - 2) k, k^2) second differences of a square (k, k) of poles, along both directions."""
    second = np.diff(np.eye(count), n=2, axis=0)
    return np.concatenate([np.kron(second, np.eye(count)), np.kron(np.eye(count), second)])
