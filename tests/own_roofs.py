"""Surfaces that architects hand over without a word, in metres with z up, with what holds them and their kind.

Each family is one function of a few measures. `MEANT` lists all surfaces, `TWELVE` those of rarer kinds."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dsfab.surface import Surface
from tests.shapes import grid


@dataclass(frozen=True)
class Meant:
    """A surface, the words of the readings that are right (see `dsfab new --stand`), and its kind."""

    surface: Surface
    words: str
    kind: str = "roof"


def sheet(height: Callable, length: float, width: float, cell: float, gone: Callable | None = None) -> Surface:
    """The sheet z = height(x, y) over a rectangle about the origin, without the faces whose middle is `gone`."""
    flat = grid(round(length / cell), round(width / cell), length, width)
    x, y = (flat.V - flat.V.mean(axis=0))[:, :2].T
    return without(Surface(np.stack([x, y, height(x, y) + 0 * x], axis=1), flat.F), gone)


def without(surface: Surface, gone: Callable | None) -> Surface:
    if gone is None:
        return surface
    used, F = np.unique(surface.F[~gone(*surface.centroids.T)], return_inverse=True)
    return Surface(surface.V[used], F.reshape(-1, 3))


def strip(place: Callable, long: int, across: int, around: bool = False, gone: Callable | None = None) -> Surface:
    """The sheet place(u, v) over the unit square; `around` joins u = 0 to u = 1."""
    flat = grid(long, across, 1.0, 1.0)
    u, v = (flat.V - flat.V.min(axis=0))[:, :2].T
    V, F = np.stack(np.broadcast_arrays(*place(u, v)), axis=1), flat.F
    if around:
        first = np.array([np.flatnonzero((u < 1e-9) & (np.abs(v - b) < 1e-9))[0] for b in v])
        F = np.where(u[F] > 1 - 1e-9, first[F], F)
        used, F = np.unique(F, return_inverse=True)
        V, F = V[used], F.reshape(-1, 3)
    return without(Surface(V, F), gone)


def platform_roof(length: float, width: float, bend: float = 0.0, lift: float = 0.6) -> Meant:
    def place(u, v):
        return (
            length * u,
            width * (v - 0.5) + bend * np.sin(2.5 * u),
            4 + lift * (2 * v - 1) ** 2 + 0.15 * np.sin(4 * u),
        )

    return Meant(strip(place, round(length), 8), "posts sides")


def footbridge(length: float, width: float, camber: float) -> Meant:
    def place(u, v):
        return length * u, width * (v - 0.5) + np.sin(2 * u), 5 + 4 * camber * u * (1 - u)

    return Meant(strip(place, round(1.5 * length), 6), "ends", "floor")


def ramp(turns: float, radius: float, width: float, rise: float) -> Meant:
    def place(u, v):
        r, angle = radius + width * (v - 0.5), 2 * np.pi * turns * u
        return r * np.cos(angle), r * np.sin(angle), rise * np.clip((u - 0.06) / 0.88, 0, 1)

    return Meant(strip(place, round(60 * turns) + 30, 6), "ends", "floor")


def _near(x, y, places):
    return np.min([np.hypot(x - a, y - b) for a, b in places], axis=0)


def _places(along: int, across: int, apart: float):
    return [
        ((i - (along - 1) / 2) * apart, (j - (across - 1) / 2) * apart) for i in range(along) for j in range(across)
    ]


def hall(along: int, across: int, apart: float, drop: float) -> Meant:
    """Column heads as funnels."""
    places = _places(along, across, apart)

    def height(x, y):
        return 5.5 - drop * np.exp(-np.maximum(_near(x, y, places) - 0.5, 0) / 1.2) + 0.2 * np.cos(x / 4)

    gone = lambda x, y, z: _near(x, y, places) < 0.55  # noqa: E731
    return Meant(sheet(height, along * apart, across * apart, 0.36, gone), "loops")


def ceiling(along: int, apart: float, lug: float) -> Meant:
    """Slender necks upwards, from which it hangs."""
    places = _places(along, 2, apart)

    def height(x, y):
        return 5 + 0.2 * np.sin(x) * np.cos(y / 2) + lug * np.exp(-np.maximum(_near(x, y, places) - 0.2, 0) / 0.35)

    gone = lambda x, y, z: _near(x, y, places) < 0.22  # noqa: E731
    return Meant(sheet(height, along * apart, 2 * apart, 0.14, gone), "hung", "hung")


def ring(radius: float, share: float, oval: float, wave: float = 0.0) -> Meant:
    def place(u, v):
        t, r = 2 * np.pi * u, radius * (1 - share + share * v)
        return r * np.cos(t), oval * r * np.sin(t), 12 + wave * np.cos(2 * t) + 0.15 * share * radius * (1 - v)

    return Meant(strip(place, 130, 9, around=True), "edge edges")


def cupola(radius: float, rise: float, open_: float = 0.04) -> Meant:
    def place(u, v):
        t, s = 2 * np.pi * u, np.pi / 2 * (1 - open_) * v
        return radius * np.cos(s) * np.cos(t), radius * np.cos(s) * np.sin(t), rise * np.sin(s)

    return Meant(strip(place, 64, 14, around=True), "edge")


def vault(length: float, width: float, rise: float) -> Meant:
    def place(u, v):
        return length * u, -width / 2 * np.cos(np.pi * v), rise * np.sin(np.pi * v)

    return Meant(strip(place, 30, 22), "feet sides")


def groin(length: float, width: float, rise: float) -> Meant:
    return Meant(
        sheet(lambda x, y: rise * (1 - (2 * x / length) ** 2 * (2 * y / width) ** 2), length, width, 0.5), "feet"
    )


def pavilion(feet: int, reach: float, rise: float, slope: float = 0.0, toe: float = 1.5) -> Meant:
    """A shell on feet that reach out; a smaller `toe` makes broad feet."""

    def place(u, v):
        t, r = 2 * np.pi * u, 0.04 + 0.96 * v
        foot = (0.5 + 0.5 * np.cos(feet * t)) ** toe
        d = r * reach * (0.62 + 0.38 * foot)
        return d * np.cos(t), d * np.sin(t), rise * (1 - foot * r**2) + 0.3 * (1 - foot) * r + slope * d * np.cos(t)

    return Meant(strip(place, 40 * feet, 16, around=True), "feet all-feet")


def sail(side: float, lift: float) -> Meant:
    def place(u, v):
        a, b = 2 * u - 1, 2 * v - 1
        return side / 2 * a * (0.78 + 0.22 * b**2), side / 2 * b * (0.78 + 0.22 * a**2), 4.5 + lift * a * b

    return Meant(strip(place, 24, 24), "corners")


def hills(length: float, width: float, height: float) -> Meant:
    return Meant(
        sheet(lambda x, y: 5 + height * np.sin(x / 2.7 + 1) * np.cos(y / 2.9 + 0.3), length, width, 0.8),
        "hollows columns",
    )


def umbrella(side: float, rise: float) -> Meant:
    return Meant(
        sheet(lambda x, y: 3 + rise * (np.abs(x) + np.abs(y) - 2 * np.abs(x * y) / side) / side * 2, side, side, 0.5),
        "hollows",
    )


def slab(length: float, width: float) -> Meant:
    return Meant(sheet(lambda x, y: 3.0, length, width, 0.45), "edge", "floor")


def wall(length: float, height: float, wave: float, door: bool = True) -> Meant:
    def place(u, v):
        return length * u, wave * np.sin(7 * u) * (1 - 0.5 * v), height * v

    opening = lambda x, y, z: (np.abs(x - 0.4 * length) < 0.6) & (z < 2.2)  # noqa: E731
    return Meant(strip(place, round(3 * length), round(3 * height), gone=opening if door else None), "base", "wall")


def tower(radius: float, height: float, waist: float) -> Meant:
    def place(u, v):
        t, r = 2 * np.pi * u, radius * (1 - waist * np.sin(np.pi * v))
        return r * np.cos(t), r * np.sin(t), height * v

    return Meant(strip(place, 48, 32, around=True), "base edge", "wall")


def hanging_roof(length: float, width: float, sag: float) -> Meant:
    """A sheet that hangs between two high level sides."""
    return Meant(sheet(lambda x, y: 9 - sag * (1 - (2 * x / length) ** 2), length, width, 0.7), "ends sides")


def walls_and_columns(length: float, width: float) -> Meant:
    """A level edge on walls, and column heads within."""
    places = [(-length / 4, 0.0), (0.0, 0.0), (length / 4, 0.0)]

    def height(x, y):
        dome = (1 - (2 * x / length) ** 2) * (1 - (2 * y / width) ** 2)
        return 4 + 2 * dome - 2 * dome * np.exp(-np.maximum(_near(x, y, places) - 0.5, 0) / 0.9)

    gone = lambda x, y, z: _near(x, y, places) < 0.55  # noqa: E731
    return Meant(sheet(height, length, width, 0.36, gone), "walls")


def mast_tent(corners: int, reach: float) -> Meant:
    """A tent with a high ring at its mast and low corners, between which its edge comes inwards."""

    def place(u, v):
        t = 2 * np.pi * u
        tip = np.abs(1 - np.mod(t * corners / np.pi, 2))
        r = reach * (0.08 + 0.92 * v) * (0.65 + 0.35 * tip**2)
        return r * np.cos(t), r * np.sin(t), 2.5 + 5 * (1 - v) ** 2 + 0.6 * (1 - tip**2) * v

    return Meant(strip(place, 24 * corners, 14, around=True), "tent")


def j_shelter(length: float, height: float, reach: float) -> Meant:
    """A sheet that rises from one edge in the ground and bends over."""

    def place(u, v):
        a = np.pi * 0.62 * v
        return (
            length * u,
            reach * (1 - np.cos(a)) * 0.75,
            height * np.sin(np.minimum(a, np.pi / 2)) - 0.4 * np.maximum(v - 0.8, 0),
        )

    return Meant(strip(place, 24, 16), "feet base")


def folded_roof(length: float, width: float) -> Meant:
    return Meant(sheet(lambda x, y: 4 + 1.2 * np.abs((y / 2) % 2 - 1), length, width, 0.4), "feet ends all-feet")


def cantilever_stair(rise: float) -> Meant:
    """A straight flight with two landings."""

    def place(u, v):
        return 6 * u, 1.2 * v, rise * np.clip((u - 0.15) / 0.7, 0, 1)

    return Meant(strip(place, 40, 8), "ends", "floor")


MEANT: dict[str, Meant] = {
    "platform roof": platform_roof(30, 5),
    "bent platform roof": platform_roof(48, 6, 6, -0.5),
    "narrow platform roof": platform_roof(20, 3.5, 1, 0.4),
    "footbridge": footbridge(28, 3, 1.1),
    "flat footbridge": footbridge(18, 2.2, 0.1),
    "long footbridge": footbridge(40, 3.5, 2.0),
    "spiral ramp": ramp(0.8, 5, 2.4, 3.2),
    "spiral ramp twice around": ramp(1.7, 6, 2, 6.0),
    "hall on nine columns": hall(3, 3, 8, 2.2),
    "hall on eight columns": hall(4, 2, 7, 3.5),
    "hall on four columns": hall(2, 2, 9, 1.8),
    "ceiling": ceiling(3, 3.2, 1.2),
    "long ceiling": ceiling(4, 2.8, 0.9),
    "ring": ring(30, 0.5, 1.0),
    "oval ring": ring(42, 0.35, 0.7, 1.5),
    "small ring": ring(17, 0.4, 0.85, 0.3),
    "cupola": cupola(9, 4.5),
    "high cupola": cupola(8, 7, 0.1),
    "flat cupola": cupola(16, 4, 0.25),
    "vault": vault(14, 9, 3.2),
    "short vault": vault(6, 12, 4.5),
    "long vault": vault(28, 7, 3),
    "groin": groin(12, 10, 3.6),
    "large groin": groin(18, 15, 4.5),
    "pavilion on three feet": pavilion(3, 9, 4.4),
    "pavilion on four feet": pavilion(4, 7, 3.6),
    "pavilion on five feet": pavilion(5, 8, 4.2),
    "pavilion on six feet": pavilion(6, 11, 4.5),
    "pavilion on a slope": pavilion(4, 8, 4, 0.1),
    "sail": sail(9, 1.5),
    "large sail": sail(14, 2.2),
    "hills": hills(28, 18, 0.9),
    "low hills": hills(34, 22, 0.7),
    "umbrella": umbrella(11, 2.0),
    "slab": slab(9, 7),
    "large slab": slab(14, 9),
    "wall": wall(10, 4, 0.4),
    "high wall": wall(8, 7, 0.8),
    "long wall": wall(24, 5, 1.2, door=False),
    "tower": tower(4, 22, 0.15),
    "cooling tower": tower(12, 36, 0.3),
}
TWELVE: dict[str, Meant] = {
    "hanging roof": hanging_roof(30, 20, 2.5),
    "short hanging roof": hanging_roof(14, 18, 1.2),
    "walls and columns": walls_and_columns(24, 14),
    "long walls and columns": walls_and_columns(36, 15),
    "mast tent": mast_tent(6, 9),
    "mast tent on four corners": mast_tent(4, 8),
    "J-shelter": j_shelter(9, 3, 2.4),
    "large J-shelter": j_shelter(16, 4.2, 3.2),
    "shell in broad feet": pavilion(4, 10, 4.5, toe=0.7),
    "folded roof": folded_roof(18, 12),
    "stair": cantilever_stair(3.2),
    "shell in three broad feet": pavilion(3, 12, 5, toe=0.8),
}
