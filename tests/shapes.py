"""The shapes that tests build, each defined once, and a zoo of them for laws that hold on every mesh.

Lengths are in metres. A division (`nx`, `cells`, `around`) counts cells; each square cell holds two triangles.
"""

from collections.abc import Callable

import numpy as np
import pytest

from dsfab.surface import Surface


def grid(nx: int, ny: int, length: float, width: float, staggered: bool = False) -> Surface:
    """A plate of length x width in the plane z = 0, a corner at the origin, of nx x ny squares.

    Alternating diagonals halve the squares; `staggered` makes rows of triangles that are shifted by half an edge.
    """
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
    """A plane surface whose inner vertices are moved at random in the plane by up to `amount` of the mean edge."""
    V = surface.V.copy()
    inner = np.ones(surface.n, dtype=bool)
    inner[surface.edges.ends[surface.edges.boundary]] = False
    V[inner, :2] += amount * surface.mean_edge * np.random.default_rng(seed).uniform(-0.7, 0.7, (inner.sum(), 2))
    return Surface(V, surface.F)


def square(cells: int = 24, half: float = 1.0) -> Surface:
    """A plane square of side 2 half about the origin, of cells x cells squares: x and y are among its symmetries."""
    plate = grid(cells, cells, 2 * half, 2 * half)
    return Surface(plate.V - [half, half, 0], plate.F)


def lifted(height: Callable, cells: int = 10, length: float = 1.0) -> Surface:
    """z = height(x, y) over a jittered square with sides of `length` and a corner at the origin."""
    flat = jittered(grid(cells, cells, length, length))
    return Surface(np.c_[flat.V[:, :2], height(flat.V[:, 0], flat.V[:, 1])], flat.F)


def subsurface(surface: Surface, faces: np.ndarray) -> Surface:
    """The faces that a mask (m,) marks, without the vertices of the other faces."""
    used, F = np.unique(surface.F[faces], return_inverse=True)
    return Surface(surface.V[used], F.reshape(-1, 3))


def joined(*surfaces: Surface) -> Surface:
    """Several surfaces as the pieces of one; no vertices are merged."""
    first = np.cumsum([0, *(surface.n for surface in surfaces[:-1])])
    faces = [surface.F + k for surface, k in zip(surfaces, first, strict=True)]
    return Surface(np.concatenate([surface.V for surface in surfaces]), np.concatenate(faces))


def stacked(surface: Surface, gap: float) -> Surface:
    """A surface and its copy, `gap` above it."""
    return joined(surface, Surface(surface.V + [0, 0, gap], surface.F))


def glued(surface: Surface) -> Surface:
    """The surface with vertices merged that lie in one place."""
    _, first, vertex = np.unique(surface.V.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return Surface(surface.V[first], vertex.reshape(-1)[surface.F])


def quartered(surface: Surface) -> Surface:
    """Every triangle cut into four at the middles of its edges, on the same flat facets."""
    V, F, edges = surface.V, surface.F, surface.edges
    a, b, c = F.T
    ab, bc, ca = (surface.n + edges.of).T
    corners = [np.c_[a, ab, ca], np.c_[b, bc, ab], np.c_[c, ca, bc], np.c_[ab, bc, ca]]
    return Surface(np.concatenate([V, V[edges.ends].mean(axis=1)]), np.concatenate(corners))


def with_mixed_sides(surface: Surface, seed: int = 0) -> tuple[Surface, np.ndarray]:
    """The surface with a random share of 0.4 of its faces turned over, and a mask (m,) of these faces."""
    flips = np.random.default_rng(seed).random(surface.m) < 0.4
    return Surface(surface.V, np.where(flips[:, None], surface.F[:, ::-1], surface.F)), flips


def with_mixed_corners(surface: Surface, seed: int = 3) -> Surface:
    """The surface with half of its faces turned over, and with every face begun at another corner."""
    flips = np.random.default_rng(seed).random(surface.m) < 0.5
    F = np.roll(surface.F, 1, axis=1)
    return Surface(surface.V, np.where(flips[:, None], F[:, ::-1], F))


def fan(corners: np.ndarray, top: float = 0.0) -> Surface:
    """Triangles from the point (0, 0, top), vertex 0, to the sides of a polygon (k, 2) in the plane z = 0."""
    k = len(corners)
    i = np.arange(k)
    V = np.concatenate([[[0, 0, top]], np.c_[corners, np.zeros(k)]])
    return Surface(V, np.c_[np.zeros(k, dtype=int), 1 + i, 1 + (i + 1) % k])


def folded(angle: float, cells: int = 8) -> Surface:
    """Two squares of side 1 in cells x cells squares that meet on the y axis at an angle, degrees; 180 is flat."""
    flat = grid(2 * cells, cells, 2.0, 1.0)
    x, y = flat.V[:, 0] - 1, flat.V[:, 1]
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Surface(np.c_[np.where(x < 0, x, -x * c), y, np.where(x < 0, 0, x * s)], flat.F)


def wrapped(around: int, across: int, place: Callable) -> Surface:
    """A grid of around x across cells brought to place(u, v), u and v from 0 to 1, and closed in u.

    All diagonals run one way.
    """
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")

    def vertex(di, dj):
        return ((i + di) % around * (across + 1) + j + dj).ravel()

    a, b, c, d = vertex(0, 0), vertex(1, 0), vertex(1, 1), vertex(0, 1)
    u, v = np.meshgrid(np.arange(around) / around, np.arange(across + 1) / across, indexing="ij")
    return Surface(np.stack(place(u.ravel(), v.ravel()), axis=1), np.concatenate([np.c_[a, b, c], np.c_[a, c, d]]))


def tube(around: int, along: int, radius: float = 1.0, length: float = 2.0) -> Surface:
    """A cylinder about z from z = 0 upwards, open at both ends; its normals point outwards."""

    def place(u, v):
        return radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), length * v

    return wrapped(around, along, place)


def annulus(around: int, across: int, inner: float = 1.0, outer: float = 2.0) -> Surface:
    """A plane ring about the origin; its normals point upwards."""

    def place(u, v):
        r = inner + (outer - inner) * v
        return r * np.cos(-2 * np.pi * u), r * np.sin(-2 * np.pi * u), 0 * u

    return wrapped(around, across, place)


def arch(radius: float, half_angle: float, length: float = 8.0, along: int = 128, across: int = 4) -> Surface:
    """A cylindrical roof along y; its arc reaches from -half_angle to half_angle (degrees) about the vertical."""
    flat = grid(along, across, 1.0, length)
    angle = np.radians(half_angle) * (2 * flat.V[:, 0] - 1)
    return Surface(np.stack([radius * np.sin(angle), flat.V[:, 1], radius * np.cos(angle)], axis=1), flat.F)


def torus(around: int, about: int, radius: float, tube_radius: float) -> Surface:
    """A closed ring about z whose tube has its middle at `radius`."""

    def place(u, v):
        r = radius + tube_radius * np.cos(2 * np.pi * v)
        return r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), tube_radius * np.sin(2 * np.pi * v)

    return glued(wrapped(around, about, place))


def disc(cells: int) -> Surface:
    """A plane disc of radius 1: a square of cells x cells squares, whose squares about the middle become circles."""
    flat = square(cells)
    r = np.linalg.norm(flat.V, axis=1)
    return Surface(flat.V * (np.abs(flat.V).max(axis=1) / np.where(r > 0, r, 1))[:, None], flat.F)


def l_shape(cells: int = 12, side: float = 2.0, cut: float = 1.0) -> Surface:
    """A plane square with a corner at the origin, without the square beyond `cut` in both x and y."""
    plate = grid(cells, cells, side, side)
    return subsurface(plate, ~(plate.centroids[:, :2] > cut).all(axis=1))


def windows(width: int = 2, cells: int = 24) -> Surface:
    """A plane square of side 1 with square windows, ribs of `width` cells between them."""
    plate = grid(cells, cells, 1.0, 1.0)
    column_row = np.floor(plate.centroids[:, :2] * cells).astype(int)
    return subsurface(plate, ((column_row % 6 < width) | (column_row >= cells - width)).any(axis=1))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Surface:
    """A closed box between two corners, of twelve triangles; its normals point outwards."""
    V = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Surface(V, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])


def corner_angles(surface: Surface) -> np.ndarray:
    """The angles (m, 3) of the triangles at their corners, degrees."""
    P = surface.V[surface.F]
    u, v = np.roll(P, -1, axis=1) - P, np.roll(P, -2, axis=1) - P
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v), axis=2), (u * v).sum(axis=2)))


def smallest_angle(surface: Surface) -> float:
    """The smallest angle of all triangles, degrees."""
    return float(corner_angles(surface).min())


def sphere(level: int = 2, radius: float = 1.0) -> Surface:
    """A closed sphere about the origin: an octahedron, subdivided `level` times, of 8 * 4**level faces."""
    V = np.concatenate([np.eye(3), -np.eye(3)])
    F = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    ball = Surface(V, F)
    for _ in range(level):
        ball = quartered(ball)
        ball = Surface(ball.V / np.linalg.norm(ball.V, axis=1, keepdims=True), ball.F)
    return Surface(radius * ball.V, ball.F)


def three_leaves() -> Surface:
    """Three rectangles of 0.4 x 1.0 in 2 x 3 cells that meet in one edge line, like a girder's web and flanges."""
    leaf = grid(2, 3, 0.4, 1.0)
    x, y, _ = leaf.V.T
    turns = (0.0, 2.0, 4.0)
    return glued(joined(*(Surface(np.c_[x * np.cos(turn), y, x * np.sin(turn)], leaf.F) for turn in turns)))


def two_pieces() -> Surface:
    """Two squares of side 1 in 4 x 4 cells, one above the other at a distance of 1."""
    return stacked(grid(4, 4, 1.0, 1.0), 1.0)


def obtuse() -> Surface:
    """A sheared, gently curved plate of 8 x 8 cells and length 3.5: its triangles have obtuse angles."""
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
