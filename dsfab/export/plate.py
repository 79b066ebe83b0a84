"""Flat sheets as what they are: an outline of lines and splines in one plane, and a thickness.

The solid alone tells whether it is one: all its vertices lie in two parallel planes, and both skins have the same
outline. So any solid can be asked, however it was made; only the corners where two stripes meet at a small angle are
better known to who cut the sheet.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, lock
from dsfab.errors import ExportError
from dsfab.export.coplanar import FLATNESS
from dsfab.export.curves import Curve, curves_through, of_few_spans
from dsfab.export.part import Part
from dsfab.surface.topology import boundary_loops, edge_table, pieces

SAME_PLACE = 1e-3
"""Millimetres within which a given corner is a vertex of the outline, and both skins have the same outline."""

SLIMMEST = 0.1
"""A loop is followed at least as closely as this share of its area over its length: slits and dots keep their shape."""


SHARE_OF_GAP = 0.25
"""A loop is followed at least as closely as this share of its distance to the next: curves never cross a member."""


class NotFlatError(ExportError):
    """A solid that is no sheet between two planes."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """The polylines of a flat sheet.

    axes   : (3, 3) unit vectors, right-handed: two in the plane, and the one across it.
    height : lower and upper plane along axes[2], millimetres.
    pieces : per piece its loops, (k, 2) along axes[0] and axes[1]; the outer one first and counter-clockwise, holes
             clockwise.
    """

    axes: Floats
    height: tuple[float, float]
    pieces: tuple[tuple[Floats, ...], ...]

    def __post_init__(self) -> None:
        lock(self, "axes", np.float64, (3, 3))

    @property
    def thickness(self) -> float:
        """Millimetres between both planes."""
        return self.height[1] - self.height[0]


@dataclass(frozen=True, eq=False)
class Plate:
    """Outlines as curves: pieces[i][j] is the chain of loop j of piece i."""

    outlines: Outlines
    pieces: tuple[tuple[tuple[Curve, ...], ...], ...]

    @property
    def faces(self) -> int:
        """A wall for each curve, and two skins for each piece."""
        return sum(2 + sum(len(loop) for loop in loops) for loops in self.pieces)

    @property
    def deviation(self) -> float:
        """Largest distance of a curve from its polyline, both ways, millimetres."""
        return max(curve.deviation for loops in self.pieces for loop in loops for curve in loop)


def outlines_of(part: Part) -> Outlines:
    """The outlines of a flat solid; raises ExportError, with the reason, when it is not a sheet between two planes."""
    corners = part.V[part.F]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)
    across = np.linalg.eigh(np.einsum("mi,mj,m->ij", vectors, vectors, 1 / lengths))[1].T
    used = np.unique(part.F)
    for axis in across[::-1]:  # the skins are an eigenspace of their own, and usually the larger part of the area
        axis = axis * np.sign(axis[np.abs(axis).argmax()])
        height = part.V @ axis
        low, high = float(height[used].min()), float(height[used].max())
        if np.minimum(height[used] - low, high - height[used]).max() <= 2 * FLATNESS < high - low:
            return _between(part, frame(axis), low, high)
    raise NotFlatError("the sheet is not flat, or not equally thick")


def frame(across: Floats) -> Floats:
    """(3, 3) right-handed axes with `across` last; those of the world when it is one of them."""
    along = np.roll(np.eye(3), -1, axis=0)[np.abs(across).argmax()]
    first = along - (along @ across) * across
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(across, first), across]) + 0.0


def _between(part: Part, axes: Floats, low: float, high: float) -> Outlines:
    """Loops of the upper skin, by piece, if the lower one has the same."""
    upper = part.V @ axes[2] > (low + high) / 2
    top, bottom = (part.F[(side[part.F]).all(axis=1)] for side in (upper, ~upper))
    if not len(top) or not len(bottom):
        raise NotFlatError("the two skins of the sheet are not flat")
    flat = part.V @ axes[:2].T
    rims = [np.concatenate(boundary_loops(F, edge_table(F))) for F in (top, bottom)]
    over, under = (cKDTree(flat[rim]) for rim in rims)
    if max(np.max(over.query(under.data)[0]), np.max(under.query(over.data)[0])) > SAME_PLACE:
        raise ExportError("the two skins of the sheet have different outlines")
    count, label = pieces(top, edge_table(top))
    found = []
    for k in range(count):
        loops = [flat[loop] for loop in boundary_loops(top[label == k], edge_table(top[label == k]))]
        areas = np.array([enclosed(loop) for loop in loops])
        if np.count_nonzero(areas > 0) != 1:
            raise ExportError("a piece of the sheet touches itself, so its outline is not one loop")
        found.append(tuple(loops[i] for i in np.argsort(-areas, kind="stable")))
    return Outlines(axes, (low, high), tuple(found))


def plate(outlines: Outlines, corners: Floats, tolerance: float) -> Plate:
    """The outlines as curves within `tolerance`, millimetres; `corners` (k, 3) stay corners at any angle.

    Raises ExportError when a spline cannot follow so closely.
    """
    tree = cKDTree(corners @ outlines.axes[:2].T) if len(corners) else None
    found = []
    gaps = iter(gaps_between([loop for loops in outlines.pieces for loop in loops], tolerance))
    for loops in outlines.pieces:
        chains = []
        for loop in loops:
            marked = np.zeros(len(loop), bool) if tree is None else np.asarray(tree.query(loop)[0]) <= SAME_PLACE
            length = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum()
            close = min(tolerance, SLIMMEST * abs(enclosed(loop)) / length, SHARE_OF_GAP * next(gaps))
            chain = curves_through(loop, marked, close)
            if chain is None:
                raise ExportError(f"no spline follows an outline of {len(loop)} points within {close:.3g} mm")
            chains.append(tuple(short for curve in chain for short in of_few_spans(curve)))
        found.append(tuple(chains))
    return Plate(outlines, tuple(found))


def gaps_between(loops: list[Floats], tolerance: float, least: float = 0.0) -> list[float]:
    """A length per loop that is not above its distance to any other loop; inf where a curve could not get so far.

    Points every s along two loops are at most s farther apart than the loops are. Where s is not small against what
    is found, it is made smaller, but not smaller than `least`, which no gap is then said to be under.
    """
    gaps, far = [np.inf] * len(loops), tolerance / SHARE_OF_GAP
    spacing, left = 8 * far, list(range(len(loops)))
    while left and len(loops) > 1 and spacing >= least:
        if spacing < SAME_PLACE:
            raise ExportError(f"{len(left)} outlines touch another one")
        trees, reach = [cKDTree(_every(loop, spacing)) for loop in loops], far + spacing
        boxes = np.array([[loop.min(axis=0), loop.max(axis=0)] for loop in loops])
        again = []
        for i in left:
            apart = np.maximum(boxes[:, 0] - boxes[i, 1], boxes[i, 0] - boxes[:, 1]).max(axis=1)
            others = np.flatnonzero((apart < far) & (np.arange(len(loops)) != i))
            found = min(
                (float(np.min(trees[j].query(trees[i].data, distance_upper_bound=reach)[0])) for j in others),
                default=np.inf,
            )
            gaps[i] = max(found - spacing, least)
            if gaps[i] < far and spacing > found / 8:
                again.append(i)
        left, spacing = again, spacing / 8
    return gaps


def _every(loop: Floats, spacing: float) -> Floats:
    """Points along a closed polyline (k, 2), its vertices among them, at most `spacing` apart."""
    along = np.roll(loop, -1, axis=0) - loop
    count = np.ceil(np.linalg.norm(along, axis=1) / spacing).astype(np.int64).clip(1)
    edge = np.repeat(np.arange(len(loop)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)) / count[edge]
    return np.asarray(loop[edge] + share[:, None] * along[edge])


def enclosed(loop: Floats) -> float:
    """Area inside a closed polyline (k, 2), negative when clockwise."""
    p = loop - loop.mean(axis=0)
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)
