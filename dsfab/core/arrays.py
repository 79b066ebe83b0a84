"""Array types, and operations on many vectors, groups or keys at once."""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def read_only_copy(values: ArrayLike, dtype: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """Return a read-only copy of `values` with this type and shape. `None` in `shape` allows any length.
    Raises ValueError if `values` has a different shape."""
    array = np.array(values, dtype=dtype, order="C")
    fits = array.ndim == len(shape) and all(s is None or s == a for s, a in zip(shape, array.shape, strict=False))
    if not fits:
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    array.setflags(write=False)
    return array


def lock(owner: object, name: str, dtype: Any, shape: tuple[int | None, ...]) -> None:
    """Replace field `name` of a frozen dataclass by a read-only array; call this function in `__post_init__`."""
    object.__setattr__(owner, name, read_only_copy(getattr(owner, name), dtype, shape))


def lock_floats(owner: object, **shapes: tuple[int | None, ...]) -> None:
    """Replace fields of a frozen dataclass by read-only float arrays. shapes : shape of each field, by field name."""
    for name, shape in shapes.items():
        lock(owner, name, np.float64, shape)


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products (k, 3) of a and b (k, 3)."""
    (x, y, z), (u, v, w) = a.T, b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def plane_cross(a: Floats, b: Floats) -> Floats:
    """Return the cross products (...) of vectors a and b (..., 2) in a plane."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def lengths(vectors: Floats) -> Floats:
    """Return the lengths (...) of vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def point_tuple(point: Floats) -> tuple[float, float, float]:
    """Return a point (3,) as three numbers, without -0."""
    x, y, z = (point + 0.0).tolist()
    return x, y, z


def row_max(rows: NDArray[Any]) -> NDArray[Any]:
    """Return the maximum (k,) of each row of an array (k, c)."""
    return np.asarray(reduce(np.maximum, rows.T))


def row_min(rows: NDArray[Any]) -> NDArray[Any]:
    """Return the minimum (k,) of each row of an array (k, c)."""
    return np.asarray(reduce(np.minimum, rows.T))


def group_sums(group: Ints, values: Floats, count: int = 0) -> Floats:
    """Return the sum (g, d) of the rows of `values` (k, d) in each group. group : (k,) group number of each row.
    count : g is at least this number."""
    return np.stack([np.bincount(group, column, count) for column in values.T], axis=1).astype(np.float64)


def weighted_quantiles(values: Floats, weight: Floats, shares: Sequence[float]) -> Floats:
    """Return quantiles (q,) of values (k,) with weights (k,), at fractions `shares` (q,) of the total weight."""
    order = np.argsort(values, kind="stable")
    upto = np.cumsum(weight[order])
    positions = np.searchsorted(upto, np.asarray(shares) * upto[-1] * (1 - 1e-12))
    return np.asarray(values[order][np.minimum(positions, len(order) - 1)])


def weighted_quantile(values: Floats, weight: Floats, share: float) -> float:
    """Return the quantile of values (k,) with weights (k,), at a fraction of the total weight."""
    return float(weighted_quantiles(values, weight, (share,))[0])


def edge_lengths(V: Floats, ends: Ints) -> Floats:
    """Return the lengths (e,) of edges (e, 2) between vertices V (n, 3)."""
    return lengths(V[ends[:, 1]] - V[ends[:, 0]])


def polygon_perimeter(P: Floats) -> float:
    """Return the perimeter of the polygon with corners P (k, d)."""
    return float(np.linalg.norm(P - np.roll(P, -1, axis=0), axis=1).sum())


def area_vectors(V: Floats, F: Ints) -> Floats:
    """Return vectors (m, 3) along the normals of faces F (m, 3); their lengths are twice the face areas."""
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    return cross(b - a, c - a)


def concatenated_mesh(parts: Sequence[tuple[Floats, Ints]]) -> tuple[Floats, Ints]:
    """Join meshes to a single mesh: vertices (n, 3) and faces (m, 3). parts : vertices and faces of each mesh."""
    starts = np.cumsum([0, *(len(V) for V, _ in parts)])[:-1].tolist()
    V = np.concatenate([np.empty((0, 3)), *(V for V, _ in parts)])
    faces = [F + start for (_, F), start in zip(parts, starts, strict=True)]
    return V, np.concatenate([np.empty((0, 3), dtype=np.int64), *faces])


def unit_vectors(x: Floats) -> Floats:
    """Return vectors x (..., 3), scaled to length 1; zero vectors stay zero."""
    return np.asarray(x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), np.finfo(float).tiny))


def face_angles(V: Floats, F: Ints) -> Floats:
    """Return the angles (m, 3) at the corners of faces F (m, 3) on vertices V (n, 3), radians."""
    P = V[F]
    u, v = np.roll(P, -1, axis=1) - P, np.roll(P, 1, axis=1) - P
    return np.asarray(np.arctan2(lengths(np.cross(u, v)), np.einsum("mci,mci->mc", u, v)))


def distances_from_segments(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return the distance (...) of each of the points (..., 3) from the segment between a and b (..., 3)."""
    return np.asarray(np.linalg.norm(points - a - positions_on_segments(points, a, b)[..., None] * (b - a), axis=-1))


def positions_on_segments(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return positions (...), 0 at a to 1 at b (..., 3), of the places on segments nearest to points (..., 3)."""
    along, to = b - a, points - a
    squared = np.maximum(np.einsum("...i,...i->...", along, along), np.finfo(float).tiny)
    return np.asarray(np.clip(np.einsum("...i,...i->...", to, along) / squared, 0, 1))


def transported_vectors(onto: Floats, normal: Floats, x: Floats) -> Floats:
    """Rotate vectors x (k, 3) by the smallest rotation from unit vectors `normal` to `onto` (k, 3) [Rodrigues 1840]."""
    across = np.cross(normal, onto)
    cosine = np.einsum("ki,ki->k", normal, onto)[:, None]
    along = np.einsum("ki,ki->k", across, x)[:, None]
    return np.asarray(x * cosine + np.cross(across, x) + across * along / np.maximum(1 + cosine, 1e-9))


def sorted_order(keys: Ints) -> Ints:
    """Return the indices (k,) that sort integers (k,); equal integers keep their order."""
    return _stable_sort(keys)[0]


def equal_key_groups(keys: Ints) -> tuple[Ints, Ints, Ints]:
    """Sort integers (k,) and group equal integers.
    Return the sorting indices (k,), the first position of each group in the sorted array, and group numbers (k,)."""
    order, ascending = _stable_sort(keys)
    is_start = np.concatenate([[True], ascending[1:] != ascending[:-1]]) if len(keys) else np.empty(0, dtype=bool)
    group = np.empty(len(keys), dtype=np.int64)
    group[order] = np.cumsum(is_start) - 1
    return order, np.flatnonzero(is_start), group


def distinct(keys: NDArray[np.integer[Any]]) -> Ints:
    """Return the distinct integers of an array (...), as an ascending array (k,)."""
    ascending = np.sort(keys, axis=None)
    return np.asarray(ascending[np.diff(ascending, prepend=ascending[:1] - 1) != 0])


def complement(indices: Ints, count: int) -> Ints:
    """Return the integers from 0 to count - 1 that are not in `indices` (k,), ascending."""
    is_absent = np.ones(count, dtype=bool)
    is_absent[indices] = False
    return np.flatnonzero(is_absent)


def _stable_sort(keys: Ints) -> tuple[Ints, Ints]:
    bits = max(len(keys) - 1, 1).bit_length()
    if not len(keys) or keys.min() < 0 or int(keys.max()).bit_length() + bits > 63:
        order = np.argsort(keys, kind="stable")
        return order, keys[order]
    packed = keys.astype(np.int64)
    packed <<= bits
    packed |= np.arange(len(keys))
    packed.sort()
    return packed & ((1 << bits) - 1), packed >> bits


def first_few(indices: Ints, count: int = 5) -> str:
    """Return the first `count` of indices (k,) as text: '3, 17, 20, ...'."""
    shown = ", ".join(str(int(i)) for i in indices[:count])
    return shown + (", ..." if len(indices) > count else "")


ALIKE = 0.05  # Widths of openings or bars with a smaller relative difference count as equal, because meshes are coarse.


def split_value(values: Floats, threshold: float, tolerance: float = ALIKE) -> float:
    """Return a limit near `threshold` that separates small from large values (k,) at a gap between values.
    tolerance : values within this distance of the threshold may be on either side of the limit."""
    close_values = values[np.abs(values - threshold) < tolerance]
    if not len(close_values):
        return threshold
    below = values[values <= threshold - tolerance].max(initial=threshold - 2 * tolerance)
    above = values[values >= threshold + tolerance].min(initial=threshold + 2 * tolerance)
    x = np.sort(np.array([below, *close_values, above]))
    widest = int(np.argmax(np.round(np.diff(x), 6)))
    return float(x[widest : widest + 2].mean())
