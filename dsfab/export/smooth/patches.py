"""Spline surfaces over a rectangle, and their nearest points."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints, lock
from dsfab.export.splines import basis, hats

CLOSE = 1e-8
"""Nearest points are found to this share of a surface's size: a tenth of a micrometre on ten metres."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A bicubic B-spline surface: clamped knots u (p + 4,) and v (q + 4,), poles (p, q, d)."""

    u: Floats
    v: Floats
    poles: Floats

    def __post_init__(self) -> None:
        lock(self, "u", np.float64, (None,))
        lock(self, "v", np.float64, (None,))
        lock(self, "poles", np.float64, (None, None, None))

    def __call__(self, uv: Floats) -> Floats:
        """(k, d) points at uv (k, 2)."""
        (i, a), (j, b) = basis(uv[:, 0], self.u), basis(uv[:, 1], self.v)
        return self._along_v(b, self._across_u(a, self._around(i, j)))

    def slopes(self, uv: Floats) -> tuple[Floats, Floats, Floats]:
        """Points, and derivatives by u and by v, (k, d) each."""
        (i, a, da), (j, b, db) = hats(uv[:, 0], self.u), hats(uv[:, 1], self.v)
        around = self._around(i, j)
        at, du = self._across_u(a, around), self._across_u(da, around)
        return self._along_v(b, at), self._along_v(b, du), self._along_v(db, at)

    def _around(self, i: Ints, j: Ints) -> Floats:
        """(k, 4, 4, d) the poles from (i, j) on."""
        _, q, d = self.poles.shape
        at = (i * q + j)[:, None] + (q * np.arange(4)[:, None] + np.arange(4)).ravel()
        return np.asarray(self.poles.reshape(-1, d).take(at, axis=0).reshape(-1, 4, 4, d))

    @staticmethod
    def _across_u(hat: Floats, around: Floats) -> Floats:
        """(k, 4, d) sums over the first direction, weighted with hats (k, 4)."""
        k, *_, d = around.shape
        return np.asarray(np.einsum("ka,kax->kx", hat, around.reshape(k, 4, -1)).reshape(k, 4, d))

    @staticmethod
    def _along_v(hat: Floats, rows: Floats) -> Floats:
        return np.asarray(np.einsum("kb,kbd->kd", hat, rows))

    def only(self, first: int, last: int) -> "Patch":
        """The surface of some of the coordinates."""
        return Patch(self.u, self.v, self.poles[:, :, first:last])

    def nearest(self, points: Floats, uv: Floats, rounds: int = 8) -> Floats:
        """(k, 2) parameters of the surface's points nearest to `points` (k, 3), by Gauss-Newton from uv."""
        low, high = np.array([self.u[0], self.v[0]]), np.array([self.u[-1], self.v[-1]])
        uv, going = np.clip(uv, low, high), np.arange(len(uv))
        for _ in range(rounds):
            at, a, b = self.slopes(uv[going])
            r = points[going] - at
            aa, ab, bb, ra, rb = (np.einsum("ki,ki->k", x, y) for x, y in ((a, a), (a, b), (b, b), (r, a), (r, b)))
            det = np.maximum(aa * bb - ab * ab, 1e-300)
            step = np.stack([bb * ra - ab * rb, aa * rb - ab * ra], axis=1) / det[:, None]
            uv[going] = np.clip(uv[going] + step, low, high)
            going = going[np.abs(step).max(axis=1) >= CLOSE * (high - low).max()]
            if not len(going):
                break
        return uv
