"""The faces of a surface in boxes that are larger than any prism on it."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints, grouped, lengths, unit_vectors
from dsfab.thickening.separation_proof.layer import OffsetLayer

REACH = 2
"""A block is a box and this many boxes around it on each side."""

MOST_BOXES = 2e7
"""Of the grid, empty ones too."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """The box of each face (m,), and of each of k boxes: place in the grid (k, 3), middle, direction, radius.

    grid : the box at each place, -1 where there is none, with a border of `REACH` empty ones.
    key  : (k,) the place in the flat grid.
    """

    of: Ints
    place: Ints
    middle: Floats
    axis: Floats
    radius: Floats
    grid: Ints
    key: Ints

    def near(self, box: Ints, step: Ints) -> Ints:
        """The box at a step (3,) from each of the given ones, -1 where there is none."""
        _, ny, nz = self.grid.shape
        return np.asarray(self.grid.ravel()[self.key[box] + (step[0] * ny + step[1]) * nz + step[2]])


def boxes_of(layer: OffsetLayer, off: float, count: int) -> Boxes:
    """The faces of the uncut surface in boxes that are larger than any prism."""
    uncut = layer.uncut
    middle = uncut.centroids
    size = lengths(layer.D) * (1 + abs(layer.shift))
    reach = np.zeros(uncut.m)
    for corner in uncut.F.T:
        arm = lengths(uncut.V.take(corner, axis=0) - middle)
        np.maximum(reach, arm + size[corner] + off, out=reach)
    low, extent = (np.array([of(column) for column in middle.T]) for of in (np.min, np.ptp))
    least = (uncut.area / count) ** 0.5, (extent.prod() / MOST_BOXES) ** (1 / 3), extent.max() / MOST_BOXES**0.4
    width = max(2.1 * reach.max(), *least)
    place = np.floor((middle - low) / width).astype(np.int64) + REACH
    shape = place.max(axis=0) + REACH + 1
    flat = np.ravel_multi_index(tuple(place.T), tuple(shape))
    order, begins, of = grouped(flat)
    key = flat[order[begins]]
    grid = np.full(shape, -1)
    grid.ravel()[key] = np.arange(len(key))
    centre: Floats = np.stack([np.bincount(of, column) for column in middle.T], axis=1) / np.bincount(of)[:, None]
    axis: Floats = np.stack([np.bincount(of, column) for column in uncut.normals.T], axis=1).astype(np.float64)
    axis = unit_vectors(axis)
    radius = np.zeros(len(key))
    np.maximum.at(radius, of, lengths(middle - centre.take(of, axis=0)) + reach)
    at = np.stack(np.unravel_index(key, tuple(shape)), axis=1)
    return Boxes(of, at, centre, axis, radius, grid, key)


def steps() -> list[Ints]:
    """All steps to the boxes of a block, (3,) each."""
    along = np.arange(-REACH, REACH + 1)
    return list(np.stack(np.meshgrid(along, along, along), axis=-1).reshape(-1, 3))
