"""Triangles between rows or rings of vertices."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, ParamSpec

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import SurfaceError
from dsfab.core.limits import POSSIBLE_SIZE
from dsfab.surface.mesh import Surface

P = ParamSpec("P")
Length = Annotated[float, Gt(0), Le(POSSIBLE_SIZE[1])]  # A length in metres, up to the largest size of a surface.
ROW = np.sqrt(3) / 2  # Ratio of height to edge of an equilateral triangle.


def shape(function: Callable[P, Surface]) -> Callable[P, Surface]:
    """Decorate a function that returns a surface. Arguments outside their bounds raise SurfaceError."""
    bounds = {
        name: [m for m in getattr(parameter.annotation, "__metadata__", ()) if isinstance(m, (Gt, Ge, Lt, Le))]
        for name, parameter in inspect.signature(function, eval_str=True).parameters.items()
    }

    @functools.wraps(function)
    def checked_shape(*args: P.args, **kwargs: P.kwargs) -> Surface:
        for name, value in inspect.signature(function).bind(*args, **kwargs).arguments.items():
            if not np.isfinite(value):
                raise SurfaceError(f"{function.__name__}: {name} = {value} is not a finite number")
            for bound in bounds[name]:
                _check(f"{function.__name__}: {name} = {value}", value, bound)
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return function(*args, **kwargs)
        except (ArithmeticError, np.linalg.LinAlgError):
            raise SurfaceError(f"{function.__name__}: the given lengths differ too much; make them similar") from None

    return checked_shape


def _check(what: str, value: object, bound: object) -> None:
    match bound:
        case Gt(gt):
            holds, words = value > gt, f"greater than {gt}"  # type: ignore[operator]
        case Ge(ge):
            holds, words = value >= ge, f"at least {ge}"  # type: ignore[operator]
        case Lt(lt):
            holds, words = value < lt, f"less than {lt}"  # type: ignore[operator]
        case Le(le):
            holds, words = value <= le, f"at most {le}"  # type: ignore[operator]
        case _:
            raise TypeError(bound)
    if not holds:
        raise SurfaceError(f"{what} must be {words}")


def check_density(area: float, edge: float) -> None:
    """Raise SurfaceError if a mesh of an area (m2) with edges of length `edge` (m) has too many vertices."""
    vertices = area / (ROW * edge**2)
    if vertices > 2_000_000:
        raise SurfaceError(f"edge = {edge:g} m would give about {vertices:.2g} vertices; use a longer edge")


def pieces_of(length: float, edge: float, multiple: int = 1, least: int = 1) -> int:
    """Return the number of equal parts, about `edge` long, of a length: at least `least`, a multiple of `multiple`."""
    return max(least, multiple * round(length / (edge * multiple)))


def staggered_rows(columns: int, rows: int) -> tuple[Floats, Ints]:
    r"""Mesh the unit square with `rows` rows of triangles. Return vertices (n, 2) and faces.

    x---x---x      even lines: columns + 1 vertices
    |\ / \ / \ |     odd lines: one vertex more, half edges at both ends
    o-o---o-o
    |/ \ / \ / |
    x---x---x"""
    even_row = np.arange(columns + 1) / columns
    odd_row = np.concatenate([[0.0], (np.arange(columns) + 0.5) / columns, [1.0]])
    lines = [odd_row if j % 2 else even_row for j in range(rows + 1)]
    start = np.cumsum([0] + [len(line) for line in lines])
    uv = np.concatenate([np.stack([u, np.full(len(u), j / rows)], axis=1) for j, u in enumerate(lines)])
    i, k = np.arange(columns), np.arange(columns + 1)
    faces = []
    for j in range(rows):
        few, many = (start[j], start[j + 1]) if j % 2 == 0 else (start[j + 1], start[j])
        on_few = np.stack([few + i, few + i + 1, many + i + 1], axis=1)
        strip = np.concatenate([on_few, np.stack([many + k, few + k, many + k + 1], axis=1)])
        faces.append(strip if j % 2 == 0 else strip[:, ::-1])
    return uv, np.concatenate(faces)


def ring_turns(counts: Ints) -> list[Floats]:
    """Return the angles (k,) of the vertices of each ring, as fractions of a full turn. counts : vertices per ring."""
    turns, shift = [], 0.0
    for j, count in enumerate(counts):
        shift = 0.5 - shift if j and count == counts[j - 1] else 0.0
        turns.append((np.arange(count) + shift) / count)
    return turns


def ring_faces(turns: list[Floats], closed: bool = False) -> Ints:
    """Return faces (m, 3) between neighbouring rings of vertices, counter-clockwise if later rings lie outside.
    turns  : angles (k,) of the vertices of each ring, as fractions of a full turn.
    closed : true to join the last ring to the first."""
    start = np.cumsum([0] + [len(t) for t in turns])
    pairs = [(j, j + 1) for j in range(len(turns) - 1)] + ([(len(turns) - 1, 0)] if closed else [])
    return np.concatenate([_band_faces(turns[a], start[a], turns[b], start[b]) for a, b in pairs])


def _band_faces(inner: Floats, at_inner: int, outer: Floats, at_outer: int) -> Ints:
    middle_in, middle_out = (t + 0.5 / len(t) for t in (inner, outer))
    parts = []
    if len(inner) > 1:
        i = np.arange(len(inner))
        across = np.searchsorted(middle_out, middle_in, side="right") if len(outer) > 1 else 0 * i
        parts.append(np.stack([at_inner + (i + 1) % len(inner), at_inner + i, at_outer + across % len(outer)], axis=1))
    if len(outer) > 1:
        j = np.arange(len(outer))
        across = np.searchsorted(middle_in, middle_out, side="left") if len(inner) > 1 else 0 * j
        parts.append(np.stack([at_outer + j, at_outer + (j + 1) % len(outer), at_inner + across % len(inner)], axis=1))
    return np.concatenate(parts)
