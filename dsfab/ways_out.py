"""Ways out of a design: what its methods do that is made of floors above it (files, pictures, comparisons).

A design stands below the parts that write, draw and compare it, so it cannot import them. The facade, which knows
where each public name lives, opens a way for each when `dsfab` is imported; nothing heavy is loaded by that. The
surface stage opens `base_surface` to the regions below it: a mesh that follows the stress takes statics to be made.
"""

from collections.abc import Callable
from typing import Any

_WAYS: dict[str, Callable[..., Any]] = {}


def open_way(name: str, way: Callable[..., Any]) -> None:
    """From now on `name` leads to `way`."""
    _WAYS[name] = way


def through(name: str, *arguments: Any, **options: Any) -> Any:
    """What the way of that name returns."""
    return _WAYS[name](*arguments, **options)
