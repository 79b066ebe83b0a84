"""Samples of many curves, curve after curve, and the spans that cubics through them have.

samples   o o o o o | o o o o | o o o o o o         those of a curve in rising order of x
spans     [   ] [  ] | [     ] | [ ] [] [  ]        row r with s spans has s + 3 poles and s + 7 knots
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class SplineRows:
    """The samples of some curves.

    number : (r,) of the curves; count, first, last (r,) : how many samples each has, and where these are.
    row    : (k,) the row of each sample.    x, Q, parts : see `fits.splines_through`.    tolerance : (r,).
    """

    number: Ints
    count: Ints
    first: Ints
    last: Ints
    row: Ints
    x: Floats
    Q: Floats
    tolerance: Floats
    parts: int

    @classmethod
    def of(cls, number: Ints, count: Ints, x: Floats, Q: Floats, tolerance: Floats, parts: int) -> "SplineRows":
        """Rows one behind the other: count (r,) points each, of x (k,) and Q (k, d), within a tolerance (r,)."""
        end, row = np.cumsum(count), np.repeat(np.arange(len(count)), count)
        return cls(number, count, end - count, end - 1, row, x, Q, tolerance, parts)

    def some(self, chosen: Bools) -> "SplineRows":
        """Some of the rows (r,)."""
        mine = chosen[self.row]
        number, count, tolerance = self.number[chosen], self.count[chosen], self.tolerance[chosen]
        return SplineRows.of(number, count, self.x[mine], self.Q[mine], tolerance, self.parts)

    @property
    def line(self) -> Floats:
        """(k, d) on the segments between the ends."""
        start, end = self.Q[self.first], self.Q[self.last]
        return start[self.row] + self.x[:, None] * (end - start)[self.row]

    def away(self, at: Floats) -> Floats:
        """(k,) the largest distance of each sample's points from those at (k, d)."""
        off = (at - self.Q).reshape(len(at), self.parts, -1)
        return np.asarray(np.sqrt(np.einsum("kpi,kpi->pk", off, off).max(axis=0)))

    def most(self, away: Floats) -> Floats:
        """(r,) the largest of each row."""
        return np.asarray(np.maximum.reduceat(away, self.first))


@dataclass(frozen=True, eq=False)
class RowSpans:
    """The spans of some rows: where they begin and end, their rows (s,), and the span of each sample (k,)."""

    low: Floats
    high: Floats
    row: Ints
    of: Ints

    @property
    def count(self) -> Ints:
        """(r,) of each row."""
        return np.bincount(self.row)

    @property
    def knots(self) -> Floats:
        """(s + 7 r,) the knots of one row after another: 0 and 1 count four times."""
        knots, end = np.zeros(len(self.row) + 7 * len(self.count)), np.cumsum(self.count + 7)
        knots[np.arange(len(self.row)) + 7 * self.row + 3] = self.low
        knots[(end[:, None] - np.arange(1, 5)).ravel()] = 1.0
        return knots

    def halved(self, bad: Bools, going: Bools, rows: SplineRows) -> "RowSpans":
        """The spans of those rows (r,) that are going on; the bad ones (s,) in two."""
        stays = going[self.row]
        low, high, row, two = self.low[stays], self.high[stays], (np.cumsum(going) - 1)[self.row[stays]], bad[stays]
        of = (np.cumsum(stays) - 1)[self.of[going[rows.row]]]
        x, middle = rows.x[going[rows.row]], (low + high) / 2
        left, times = np.cumsum(1 + two) - (1 + two), 1 + two
        low, high, row = (np.repeat(values, times) for values in (low, high, row))
        high[left[two]] = low[left[two] + 1] = middle[two]
        return RowSpans(low, high, row, left[of] + (two[of] & (x >= middle[of])))
