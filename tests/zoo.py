"""A zoo of small surfaces for laws that hold on every mesh, and plane grids with closed forms."""

from collections.abc import Callable

import numpy as np
import pytest

from dsfab.surface import Surface


def grid(nx: int, ny: int, length: float, width: float, staggered: bool = False) -> Surface:
    """A plate in the plane z = 0 in squares halved by alternating diagonals, or in rows of staggered triangles."""
    x, y = np.meshgrid(np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1), indexing="ij")
    if staggered:
        inner = (np.arange(nx + 1) > 0) & (np.arange(nx + 1) < nx)
        x = x + np.outer(inner, np.arange(ny + 1) % 2 - 0.5) * 0.5 * length / nx
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    a = (i * (ny + 1) + j).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    odd = (j % 2 == 0).ravel() if staggered else ((i + j) % 2 == 1).ravel()
    F = np.concatenate([np.c_[a, b, c][~odd], np.c_[a, c, d][~odd], np.c_[a, b, d][odd], np.c_[b, c, d][odd]])
    return Surface(np.c_[x.ravel(), y.ravel(), np.zeros(x.size)], F)


def jittered(surface: Surface, amount: float = 0.25, seed: int = 0) -> Surface:
    """The plate with its inner vertices moved at random by up to `amount` of the mean edge."""
    V = surface.V.copy()
    inner = np.ones(surface.n, dtype=bool)
    inner[surface.edges.ends[surface.edges.boundary]] = False
    V[inner, :2] += amount * surface.mean_edge * np.random.default_rng(seed).uniform(-0.7, 0.7, (inner.sum(), 2))
    return Surface(V, surface.F)


def lifted(height: Callable, cells: int = 10, length: float = 1.0) -> Surface:
    """z = height(x, y) over a square."""
    flat = jittered(grid(cells, cells, length, length))
    return Surface(np.c_[flat.V[:, :2], height(flat.V[:, 0], flat.V[:, 1])], flat.F)


def sphere(level: int = 2, radius: float = 1.0) -> Surface:
    """An octahedron subdivided `level` times onto the sphere."""
    V = np.concatenate([np.eye(3), -np.eye(3)])
    F = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    for _ in range(level):
        edges = Surface(V, F).edges
        V = np.concatenate([V, V[edges.ends].mean(axis=1)])
        mid = len(V) - len(edges.ends) + edges.of
        F = np.concatenate(
            [
                np.c_[F[:, 0], mid[:, 0], mid[:, 2]],
                np.c_[F[:, 1], mid[:, 1], mid[:, 0]],
                np.c_[F[:, 2], mid[:, 2], mid[:, 1]],
                mid,
            ]
        )
        V = V / np.linalg.norm(V, axis=1, keepdims=True)
    return Surface(radius * V, F)


def two_pieces() -> Surface:
    """Two plates, one above the other."""
    one = grid(4, 4, 1.0, 1.0)
    return Surface(np.concatenate([one.V, one.V + [0, 0, 1]]), np.concatenate([one.F, one.F + one.n]))


def obtuse() -> Surface:
    """A sheared, gently curved plate of flat triangles."""
    flat = grid(8, 8, 1.0, 1.0)
    x, y = flat.V[:, 0], flat.V[:, 1]
    return Surface(np.c_[x + 2.5 * y, y, 0.1 * x * y], flat.F)


def moebius(around: int = 40, across: int = 4, width: float = 1.0) -> Surface:
    """A strip of radius 1 glued after half a turn: one piece with one side; neighbours disagree along the seam."""
    i, j = np.meshgrid(np.arange(around), np.arange(across + 1), indexing="ij")
    turn, s = np.pi * i / around, width * (j / across - 0.5)
    r = 1 + s * np.cos(turn)
    V = np.stack([r * np.cos(2 * turn), r * np.sin(2 * turn), s * np.sin(turn)], axis=-1).reshape(-1, 3)
    a = i[:, :-1] * (across + 1) + j[:, :-1]
    last = i[:, :-1] == around - 1
    b = np.where(last, across - j[:, :-1], a + across + 1)
    c, d = np.where(last, b - 1, b + 1), a + 1
    a, b, c, d = (x.ravel() for x in (a, b, c, d))
    return Surface(V, np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]))


def projective_plane(level: int = 3, size: float = 1.0) -> Surface:
    """Boy's surface, closed: opposite points of the sphere made one, then immersed [Apery 1987, Bryant and Kusner]."""
    ball = sphere(level)
    key = np.round(ball.V, 9) + 0.0
    flip = (key[:, 2] < 0) | ((key[:, 2] == 0) & ((key[:, 1] < 0) | ((key[:, 1] == 0) & (key[:, 0] < 0))))
    upper = np.where(flip[:, None], -key, key) + 0.0
    points, of = np.unique(upper, axis=0, return_inverse=True)
    F = of.reshape(-1)[ball.F]
    F = F[np.unique(np.sort(F, axis=1), axis=0, return_index=True)[1]]
    w = (points[:, 0] + 1j * points[:, 1]) / (1 + points[:, 2])
    a = w**6 + np.sqrt(5) * w**3 - 1
    g = np.stack([-1.5 * (w * (1 - w**4) / a).imag, -1.5 * (w * (1 + w**4) / a).real, ((1 + w**6) / a).imag - 0.5])
    return Surface(size * (g / (g**2).sum(axis=0)).T, F)


ZOO: dict[str, Callable[[], Surface]] = {
    "flat": lambda: jittered(grid(8, 5, 2.0, 1.0)),
    "saddle": lambda: lifted(lambda x, y: (x - 0.5) * (y - 0.5) * 1.5),
    "dome": lambda: lifted(lambda x, y: 16 * x * (1 - x) * y * (1 - y)),
    "closed": sphere,
    "two pieces": two_pieces,
    "obtuse": obtuse,
    "tiny": lambda: sphere(2, 1e-4),
    "huge": lambda: sphere(2, 1e5),
    "moebius": moebius,
}

zoo = pytest.mark.parametrize("name", list(ZOO))
"""Run a test on every surface of the zoo."""
