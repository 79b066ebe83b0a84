"""What the readers of drawings share: curves as points, how finely they are divided, and what a drawing may cost."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import SurfaceError

FLAT = 2e-4
"""How far the sides of a polygon may be off the curve, as a share of the curve's size."""
FINEST = 1024
"""Points at most between two knots of a curve."""
LARGEST = 1e12
"""Larger numbers are no lengths and no angles, and some that foreign libraries count down from would take for ever."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """What is drawn: layer and points (k, 3) of each curve, in the drawing's unit; the layers; the unit, if it says;
    layer and place (1, 3) of each point that is drawn."""

    runs: tuple[tuple[str, Floats], ...]
    layers: tuple[str, ...]
    unit: str | None
    points: tuple[tuple[str, Floats], ...] = ()


@dataclass(frozen=True)
class DrawingBudget:
    """How much a drawing of outlines may take: nobody draws doors and supports with more.

    bytes, entities (those of a block count each time that it is inserted), points of all curves, seconds; depth of
    blocks within blocks.  started : when the reading began, seconds of the process's clock.
    """

    bytes: int = 50_000_000
    entities: int = 50_000
    points: int = 2_000_000
    seconds: float = 60.0
    depth: int = 16
    started: float = field(default_factory=time.monotonic)

    def require(self, kind: str, count: int) -> None:
        """Raise SurfaceError for more of a kind ("bytes", "entities", "points") than accepted, or after too long."""
        if count > getattr(self, kind):
            raise SurfaceError(f"the drawing has {count:,} {kind}, and {getattr(self, kind):,} is the limit; {_APART}")
        self.require_time()

    def require_time(self) -> None:
        """Raise SurfaceError after too long."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading the drawing took more than {self.seconds:.0f} s; {_APART}")


_APART = "put the outlines into a drawing of their own"
"""What to do about any of the limits."""


def flattened(spans: Floats, at: Callable[[Floats], Floats]) -> Floats:
    """(k, 3) points `at` the ends of spans (s,) of a curve and at as many between as it takes to be within `FLAT`."""
    count = 4
    while True:
        t = np.interp(np.arange(2 * count * (len(spans) - 1) + 1) / (2 * count), np.arange(len(spans)), spans)
        points = at(t)
        off = np.linalg.norm(points[1::2] - (points[:-1:2] + points[2::2]) / 2, axis=1).max()
        if off <= FLAT * np.linalg.norm(np.ptp(points, axis=0)) or count >= FINEST:
            return np.asarray(points[::2])
        count *= 2
