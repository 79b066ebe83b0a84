"""Flat sheets in STEP."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, area_vectors, lock
from dsfab.core.errors import ExportError
from dsfab.export.cad.step.entities import StepEntities
from dsfab.export.cad.step.planar import FLATNESS
from dsfab.export.curves import Curve, curves_through, split_at_knots
from dsfab.export.part import Part
from dsfab.surface.topology import boundary_loops, edge_table, pieces

SAME_PLACE = 1e-3  # points at a smaller distance (mm) count as equal
WIDTH_SHARE = 0.1  # largest tolerance of a loop, divided by its mean width (area / length); keeps narrow loops open
GAP_SHARE = 0.25  # largest tolerance of a loop, divided by its distance from other loops; keeps curves apart


class NotFlatError(ExportError):
    """The solid is not a sheet between two planes."""


@dataclass(frozen=True, eq=False)
class FlatOutlines:
    """Outlines of a flat sheet, as polylines. height : heights of the lower and the upper plane along axes[2], mm.
    axes   : (3, 3) unit vectors, right-handed: two in the plane, and the normal of the plane.
    pieces : loops of each piece, points (k, 2) along axes[0] and axes[1]. Outer loops come first, counter-clockwise."""

    axes: Floats
    height: tuple[float, float]
    pieces: tuple[tuple[Floats, ...], ...]

    def __post_init__(self) -> None:
        lock(self, "axes", np.float64, (3, 3))

    @property
    def thickness(self) -> float:
        """Distance between the lower and the upper plane, millimetres."""
        return self.height[1] - self.height[0]


@dataclass(frozen=True, eq=False)
class FlatPlate:
    """Flat sheet with curves as outlines. pieces[i][j] : curves along loop j of piece i."""

    outlines: FlatOutlines
    pieces: tuple[tuple[tuple[Curve, ...], ...], ...]

    @property
    def faces(self) -> int:
        """Number of faces of the solid."""
        return sum(2 + sum(len(loop) for loop in loops) for loops in self.pieces)

    @property
    def deviation(self) -> float:
        """Largest distance between a curve and the polyline to which it was fitted, millimetres."""
        return max(curve.deviation for loops in self.pieces for loop in loops for curve in loop)


def outlines_of(part: Part) -> FlatOutlines:
    """Return the outlines of a flat solid. Raises ExportError for any other solid."""
    vectors = area_vectors(part.V, part.F)
    lengths = np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)
    across = np.linalg.eigh(np.einsum("mi,mj,m->ij", vectors, vectors, 1 / lengths))[1].T
    used = np.unique(part.F)
    for axis in across[::-1]:  # begin with the last axis, which is usually normal to the sheet
        axis = axis * np.sign(axis[np.abs(axis).argmax()])
        height = part.V @ axis
        low, high = float(height[used].min()), float(height[used].max())
        if np.minimum(height[used] - low, high - height[used]).max() <= 2 * FLATNESS < high - low:
            return _skin_outlines(part, frame(axis), low, high)
    raise NotFlatError("the sheet is not flat, or its thickness varies")


def frame(across: Floats) -> Floats:
    """Return three right-handed orthogonal unit axes as rows (3, 3). The last axis is the unit vector `across`."""
    along = np.roll(np.eye(3), -1, axis=0)[np.abs(across).argmax()]
    axis = along - (along @ across) * across
    axis = axis / np.linalg.norm(axis)
    return np.stack([axis, np.cross(across, axis), across]) + 0.0


def _skin_outlines(part: Part, axes: Floats, low: float, high: float) -> FlatOutlines:
    upper = part.V @ axes[2] > (low + high) / 2
    top, bottom = (part.F[(side[part.F]).all(axis=1)] for side in (upper, ~upper))
    if not len(top) or not len(bottom):
        raise NotFlatError("the two outer surfaces of the sheet are not flat")
    flat = part.V @ axes[:2].T
    rims = [np.concatenate(boundary_loops(F, edge_table(F))) for F in (top, bottom)]
    over, under = (cKDTree(flat[rim]) for rim in rims)
    if max(np.max(over.query(under.data)[0]), np.max(under.query(over.data)[0])) > SAME_PLACE:
        raise ExportError("the two outer surfaces of the sheet have different outlines")
    count, label = pieces(top, edge_table(top))
    piece_loops = []
    for k in range(count):
        loops = [flat[loop] for loop in boundary_loops(top[label == k], edge_table(top[label == k]))]
        areas = np.array([signed_loop_area(loop) for loop in loops])
        if np.count_nonzero(areas > 0) != 1:
            raise ExportError("a piece of the sheet touches itself, so the outline of this piece is not a single loop")
        piece_loops.append(tuple(loops[i] for i in np.argsort(-areas, kind="stable")))
    return FlatOutlines(axes, (low, high), tuple(piece_loops))


def plate(outlines: FlatOutlines, corners: Floats, tolerance: float) -> FlatPlate:
    """Fit curves within `tolerance` (mm) to outlines. corners : (k, 3) points where curves end. Raises ExportError."""
    tree = cKDTree(corners @ outlines.axes[:2].T) if len(corners) else None
    piece_curves = []
    gaps = iter(gaps_between([loop for loops in outlines.pieces for loop in loops], tolerance))
    for loops in outlines.pieces:
        chains = []
        for loop in loops:
            marked = np.zeros(len(loop), bool) if tree is None else np.asarray(tree.query(loop)[0]) <= SAME_PLACE
            length = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum()
            loop_tolerance = min(tolerance, WIDTH_SHARE * abs(signed_loop_area(loop)) / length, GAP_SHARE * next(gaps))
            chain = curves_through(loop, marked, loop_tolerance)
            if chain is None:
                raise ExportError(f"no spline fits an outline of {len(loop)} points within {loop_tolerance:.3g} mm")
            chains.append(tuple(short for curve in chain for short in split_at_knots(curve)))
        piece_curves.append(tuple(chains))
    return FlatPlate(outlines, tuple(piece_curves))


def gaps_between(loops: list[Floats], tolerance: float, least: float = 0.0) -> list[float]:
    """Return, for each loop (k, 2), a lower bound (mm) of its distance from the nearest loop; inf if all are far away.
    tolerance : mm.    least : smallest bound, mm. Raises ExportError if outlines touch and `least` is 0."""
    gaps, reach_limit = [np.inf] * len(loops), tolerance / GAP_SHARE
    spacing, remaining = 8 * reach_limit, list(range(len(loops)))
    while remaining and len(loops) > 1 and spacing >= least:
        if spacing < SAME_PLACE:
            raise ExportError(f"{len(remaining)} outlines touch other outlines")
        trees, reach = [cKDTree(_samples_along(loop, spacing)) for loop in loops], reach_limit + spacing
        boxes = np.array([[loop.min(axis=0), loop.max(axis=0)] for loop in loops])
        unresolved = []
        for i in remaining:
            apart = np.maximum(boxes[:, 0] - boxes[i, 1], boxes[i, 0] - boxes[:, 1]).max(axis=1)
            neighbours = np.flatnonzero((apart < reach_limit) & (np.arange(len(loops)) != i))
            nearest_gap = min(
                (float(np.min(trees[j].query(trees[i].data, distance_upper_bound=reach)[0])) for j in neighbours),
                default=np.inf,
            )
            gaps[i] = max(nearest_gap - spacing, least)
            if gaps[i] < reach_limit and spacing > nearest_gap / 8:
                unresolved.append(i)
        remaining, spacing = unresolved, spacing / 8
    return gaps


def _samples_along(loop: Floats, spacing: float) -> Floats:
    along = np.roll(loop, -1, axis=0) - loop
    count = np.ceil(np.linalg.norm(along, axis=1) / spacing).astype(np.int64).clip(1)
    edge = np.repeat(np.arange(len(loop)), count)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)) / count[edge]
    return np.asarray(loop[edge] + share[:, None] * along[edge])


def signed_loop_area(loop: Floats) -> float:
    """Return the area inside a closed polyline (k, 2); negative if clockwise."""
    p = loop - loop.mean(axis=0)
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def plate_entities(plate: FlatPlate, name: str) -> Iterator[str]:
    """Yield the text of the STEP file of a flat sheet. name : name of the part."""
    entity_list = StepEntities()
    pieces = [_piece(entity_list, plate, loops) for loops in plate.pieces]
    yield from entity_list.file(pieces, name, f"flat solid, outline within {plate.deviation:.2g} mm of the mesh")


def _piece(entity_list: StepEntities, plate: FlatPlate, loops: tuple[tuple[Curve, ...], ...]) -> list[int]:
    axes, heights = plate.outlines.axes, plate.outlines.height
    walls, skins = list[int](), ([], [])  # type: tuple[list[int], tuple[list[int], list[int]]]
    for j, loop in enumerate(loops):
        kind = "FACE_BOUND" if j else "FACE_OUTER_BOUND"
        ends = [np.stack([_in_space(c.poles[:1], axes, h)[0] for c in loop]) for h in heights]
        vertices = [[entity_list.vertex(entity_list.point(p)) for p in row] for row in ends]
        posts = [
            entity_list.edge(v, w, entity_list.line(p, axes[2])) for v, w, p in zip(*vertices, ends[0], strict=True)
        ]
        edges = list[tuple[int, int]]()
        for k, curve in enumerate(loop):
            after = (k + 1) % len(loop)
            poles = [_in_space(curve.poles, axes, h) for h in heights]
            lines = [entity_list.curve(curve, p) for p in poles]
            low, high = (entity_list.edge(row[k], row[after], line) for row, line in zip(vertices, lines, strict=True))
            edges.append((low, high))
            wire = entity_list.wire([(low, True), (posts[after], True), (high, False), (posts[k], False)])
            walls.append(entity_list.face([wire], _wall(entity_list, curve, poles[0], lines[0], axes[2])))
        skins[0].append(entity_list.wire([(low, False) for low, _ in reversed(edges)], kind))
        skins[1].append(entity_list.wire([(high, True) for _, high in edges], kind))
    corner = [_in_space(loops[0][0].poles[:1], axes, h)[0] for h in heights]
    bottom = entity_list.face(skins[0], entity_list.plane(corner[0], -axes[2]))
    return [*walls, bottom, entity_list.face(skins[1], entity_list.plane(corner[1], axes[2]))]


def _in_space(points: Floats, axes: Floats, height: float) -> Floats:
    return np.asarray(points @ axes[:2] + height * axes[2])


def _wall(entity_list: StepEntities, curve: Curve, poles: Floats, line: int, across: Floats) -> int:
    if curve.is_straight:
        return entity_list.plane(poles[0], np.cross(poles[-1] - poles[0], across))
    return entity_list.add(f"SURFACE_OF_LINEAR_EXTRUSION('',#{line},#{entity_list.vector(across)})")
