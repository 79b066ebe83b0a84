"""Flat designs as they are: the sheet in pieces of the stock's size, butted."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.slicing import cut
from dsfab.surface import Surface
from dsfab.workshop.parts import LABEL, FlatPart, label, polygon_area


@dataclass(frozen=True)
class SheetParts:
    """The pieces, and how many there are along and across the sheet."""

    pieces: tuple[FlatPart, ...]
    counts: tuple[int, int]


def sheet_parts(surface: Surface, room: list[tuple[float, float]]) -> SheetParts:
    """A flat sheet cut straight into rectangles, as few as there can be, none larger than one of `room`, metres.

    Pieces of one rectangle that do not hang together are parts of their own; openings become slots.
    """
    x = in_plane(surface)
    size = np.ptp(x, axis=0)
    turned = [*room, *((b, a) for a, b in room)]
    nx, ny = min(((int(np.ceil(size[0] / a)), int(np.ceil(size[1] / b))) for a, b in turned), key=lambda n: n[0] * n[1])
    divided = Surface(np.pad(x - x.min(axis=0), ((0, 0), (0, 1))), surface.F)
    for axis, count in enumerate((nx, ny)):
        lines = size[axis] * np.arange(1, count) / count
        if count > 1:
            divided = cut(divided, [divided.V[:, axis].copy()], [lines], snap=0.0).surface
    column, row = ((divided.centroids[:, axis] * n / size[axis]).astype(int) for axis, n in enumerate((nx, ny)))
    found = list[FlatPart]()
    for i, j in product(range(nx), range(ny)):
        cells = np.flatnonzero((column == i) & (row == j))
        if len(cells):
            found += _parts(divided, cells, f"S{i + 1}-{j + 1}")
    return SheetParts(tuple(found), (nx, ny))


def in_plane(surface: Surface) -> Floats:
    """(n, 2) the vertices of a flat surface in its plane, x and y as they are where it is level."""
    normal = surface.normals[0]
    if abs(normal[2]) > 1 - 1e-9:
        return np.asarray(surface.V[:, :2] * ([1, 1] if normal[2] > 0 else [1, -1]))
    x = np.cross([0.0, 0.0, 1.0], normal)
    x /= np.linalg.norm(x)
    return np.asarray(surface.V @ np.stack([x, np.cross(normal, x)], axis=1))


def _parts(divided: Surface, cells: Ints, name: str) -> list[FlatPart]:
    """The connected parts of some cells (c,)."""
    used, F = np.unique(divided.F[cells], return_inverse=True)
    piece = Surface(divided.V[used], F.reshape(-1, 3))
    count, of = piece.pieces
    found = []
    for k in range(count):
        mine, G = np.unique(piece.F[of == k], return_inverse=True)
        one = Surface(piece.V[mine], G.reshape(-1, 3))
        loops = [one.V[loop, :2] for loop in one.loops]
        outline, *slots = sorted(loops, key=lambda loop: -abs(polygon_area(loop)))
        title = name if count == 1 else f"{name}.{k + 1}"
        at, room = _widest_place(one)
        marks = label(title, at, 0.0, min(LABEL, room / 2)) if room > 0 else ()
        found.append(FlatPart(title, "", (0.0, 0.0), outline, slots=tuple(slots), marks=marks))
    return found


def _widest_place(surface: Surface) -> tuple[Floats, float]:
    """(2,) a place far from all edges of a flat surface, and how far it is from their corners, metres."""
    rim = surface.V[np.unique(surface.edges.ends[surface.edges.boundary])]
    away = np.array([np.linalg.norm(rim - place, axis=1).min() for place in surface.centroids])
    return surface.centroids[away.argmax(), :2], float(away.max())
