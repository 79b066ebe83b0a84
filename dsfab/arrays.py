"""Array types, and the one way an array enters a frozen value: copied, checked, locked."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def locked(values: ArrayLike, dtype: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """A read-only copy of `values` of type `dtype`; `None` in `shape` stands for any length.

    Raises ValueError when the shape differs: wrong shapes are mistakes of a programmer, not of a user.
    """
    array = np.array(values, dtype=dtype, order="C")
    fits = array.ndim == len(shape) and all(s is None or s == a for s, a in zip(shape, array.shape, strict=False))
    if not fits:
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    array.setflags(write=False)
    return array


def lock(owner: object, name: str, dtype: Any, shape: tuple[int | None, ...]) -> None:
    """Replace field `name` of the frozen dataclass `owner` by its locked copy (call it in `__post_init__`)."""
    object.__setattr__(owner, name, locked(getattr(owner, name), dtype, shape))


def first(indices: Ints, count: int = 5) -> str:
    """The first few of many indices, for error messages: '3, 17, 20, ...'."""
    shown = ", ".join(str(int(i)) for i in indices[:count])
    return shown + (", ..." if len(indices) > count else "")
