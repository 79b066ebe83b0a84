"""Earlier methods: stripes of an integrated field, and lines traced along principal stresses."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.sparse import factorise
from dsfab.design import Design
from dsfab.diffusion import Modes, diffusion_operator
from dsfab.results import DiffusionResult
from dsfab.study.verdict.estimates import quantile
from dsfab.surface import Surface, hat_gradients


class DrawnFamily(NamedTuple):
    """A family of stripes along level lines of a diffusion mode. frequency : number of stripes per unit of the mode.
    D : (m, 3, 3) diffusion tensors.    number : number of the mode.    mode : (n,) values of the mode at vertices."""

    D: Floats
    number: int
    mode: Floats
    frequency: float


def drawn_families(design: Design) -> tuple[DrawnFamily, DrawnFamily]:
    """Return the major and the minor family of stripes. The preset must give each mode as a number, not `auto`."""
    diffusion, pattern = design.diffusion, design.preset.pattern
    major, minor = (
        DrawnFamily(D, number := int(family.mode), modes.mode(number), family.frequency)
        for D, modes, family in (
            (diffusion.tensors.major, diffusion.major, pattern.major),
            (diffusion.tensors.minor, diffusion.minor, pattern.minor),
        )
    )
    return major, minor


def integrated_design(design: Design) -> Design:
    """Return a design with stripes of `integrated_field` in place of diffusion modes."""
    surface, tensors, modes = design.surface, design.diffusion.tensors, []
    for family in drawn_families(design):
        field = integrated_field(surface, weakest_directions(family.D), ~tensors.isotropic)
        field *= typical_slope(surface, family.mode) / typical_slope(surface, field)
        modes.append(Modes(np.zeros(family.number), np.repeat(field[:, None], family.number, axis=1)))
    integrated = DiffusionResult(tensors, *modes)
    return Design.from_results(design.preset, surface=surface, statics=design.statics, diffusion=integrated)


def strongest_directions(D: Floats) -> Floats:
    """Return unit directions (m, 3) of the largest diffusion, for tensors D (m, 3, 3)."""
    return np.asarray(np.linalg.eigh(D)[1][:, :, 2])


def weakest_directions(D: Floats) -> Floats:
    """Return unit directions (m, 3) of the least diffusion in each face, for tensors D (m, 3, 3)."""
    return np.asarray(np.linalg.eigh(D)[1][:, :, 1])


def integrated_field(surface: Surface, direction: Floats, clear: Bools) -> Floats:
    """Return the field u (n,), m, with gradients nearest to given unit directions (least squares).
    direction : (m, 3) unit vectors, up to sign.    clear : (m,) True for faces with a direction."""
    target = consistent_directions(surface, direction) * clear[:, None]
    pull = np.einsum("mik,mk->mi", hat_gradients(surface), target) * surface.areas[:, None]
    K = diffusion_operator(surface, np.broadcast_to(np.eye(3), (surface.m, 3, 3)))
    # without this weak spring, K is singular: a constant may be added to u on each piece
    K = csr_array(K + 1e-9 * K.diagonal().mean() * eye_array(surface.n))
    b: Floats = np.bincount(surface.F.ravel(), pull.ravel(), minlength=surface.n).astype(np.float64)
    return np.asarray(factorise(K, surface.V)(b))


def consistent_directions(surface: Surface, direction: Floats) -> Floats:
    """Return directions (m, 3) of faces. Some are reversed, so that directions of neighbouring faces agree."""
    i, j = surface.edges.pairs.T // 3
    dot = np.einsum("ek,ek->e", direction[i], direction[j])
    turn = coo_array((1.0 + 1e-6 - np.abs(dot), (i, j)), shape=(surface.m, surface.m)).tocsr()
    tree = minimum_spanning_tree(turn)
    count, piece = connected_components(tree, directed=False)
    out = direction.copy()
    for k in range(count):
        order, before = breadth_first_order(tree, int(np.argmax(piece == k)), directed=False)
        for face in order[1:].tolist():
            if out[face] @ out[before[face]] < 0:
                out[face] = -out[face]
    return out


def typical_slope(surface: Surface, value: Floats) -> float:
    """Return the area-weighted median of the gradient's length, 1/m. value : (n,) field at vertices."""
    slope = np.linalg.norm(np.einsum("mik,mi->mk", hat_gradients(surface), value[surface.F]), axis=1)
    return quantile(slope, surface.areas, 0.5)


NEAR = 0.5  # A line ends if its distance to an earlier line is less than NEAR x the intended distance of lines.
End = Literal["boundary", "inside", "round"]


@dataclass(frozen=True, eq=False)
class StressLine:
    """A line along a principal stress. points : (k, 3) in order, m; a closed line ends at its first point.
    faces : (k - 1,) face of each segment.    loose : number of ends away from the boundary."""

    points: Floats
    faces: tuple[int, ...]
    loose: int

    @property
    def length(self) -> float:
        """Length in metres."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def traced_lines(design: Design) -> tuple[list[StressLine], list[StressLine]]:
    """Return lines traced along the principal stresses, for the major and the minor family."""
    surface, clear = design.surface, ~design.diffusion.tensors.isotropic
    major, minor = (
        stress_lines(
            surface, strongest_directions(family.D), clear, 1 / (family.frequency * typical_slope(surface, family.mode))
        )
        for family in drawn_families(design)
    )
    return major, minor


def stress_lines(surface: Surface, direction: Floats, clear: Bools, apart: float) -> list[StressLine]:
    """Return lines along unit directions (m, 3), up to sign, about `apart` metres from each other.
    clear : (m,) True for faces with a direction."""
    walk = _Walk(surface, direction, clear, apart)
    centres = surface.centroids
    distance = np.where(clear, np.inf, 0.0)
    lines = []
    while (seed := int(np.argmax(distance))) >= 0 and distance[seed] > apart:
        line = walk.line(seed)
        distance = np.minimum(distance, cKDTree(np.vstack([line.points, centres[seed]])).query(centres)[0])
        if line.length > apart:
            lines.append(line)
            walk.others = cKDTree(np.vstack([traced_line.points for traced_line in lines]))
    return lines


@dataclass(eq=False)
class _Walk:
    surface: Surface
    direction: Floats
    clear: Bools
    apart: float
    others: cKDTree | None = None

    def line(self, seed: int) -> StressLine:
        start = self.surface.centroids[seed]
        ahead, faces, end = self._half(seed, start, self.direction[seed])
        if end == "round":
            return StressLine(np.array(ahead), tuple(faces), loose=0)
        behind, back, back_end = self._half(seed, start, -self.direction[seed])
        loose = (end == "inside") + (back_end == "inside")
        return StressLine(np.array(behind[:0:-1] + ahead), (*back[::-1], *faces), loose)

    def _half(self, face: int, start: Floats, t: Floats) -> tuple[list[Floats], list[int], End]:
        points, runs, faces, entered = [start], [0.0], list[int](), -1
        while True:
            half_edge, p = self._exit(face, points[-1], t, entered)
            if half_edge < 0:
                break
            runs.append(runs[-1] + float(np.linalg.norm(p - points[-1])))
            points.append(p)
            faces.append(face)
            # ignore the last 3 x `apart` of the line, because its points are always near p
            passed = int(np.searchsorted(runs, runs[-1] - 3 * self.apart))
            if (back := self._return_index(points[:passed], p)) is not None:
                came = back * 2 < passed
                return ([*points, start], [*faces, face], "round") if came else (points, faces, "inside")
            entered = int(self.surface.edges.twins[half_edge])
            if entered < 0:
                return points, faces, "boundary"
            if not self.clear[face := entered // 3] or self._is_near(p):
                break
            turned = self.direction[face] * np.sign(self.direction[face] @ t)
            if turned @ t < 0.5:  # stop at turns over 60 degrees, because directions are unreliable there
                break
            t = turned
        return points, faces, "inside"

    def _return_index(self, passed: list[Floats], p: Floats) -> int | None:
        if not passed:
            return None
        distances = np.linalg.norm(np.array(passed) - p, axis=1)
        index = int(np.argmin(distances))
        return index if distances[index] < NEAR * self.apart else None

    def _exit(self, face: int, p: Floats, t: Floats, entered: int) -> tuple[int, Floats]:
        corners = self.surface.V[self.surface.F[face]]
        outward = np.cross(np.roll(corners, -1, axis=0) - corners, self.surface.normals[face])
        speed = outward @ t
        sides = [k for k in range(3) if speed[k] > 0 and 3 * face + k != entered]
        if not sides:
            return -1, p
        distances = [max(float((corners[k] - p) @ outward[k]) / speed[k], 0.0) for k in sides]
        choice = int(np.argmin(distances))
        return 3 * face + sides[choice], p + distances[choice] * t

    def _is_near(self, p: Floats) -> bool:
        reach = NEAR * self.apart
        return self.others is not None and bool(self.others.query(p, distance_upper_bound=reach)[0] < reach)


def ribbons(surface: Surface, lines: list[StressLine], width: float, lift: float) -> tuple[Floats, Ints]:
    """Return a mesh of flat ribbons along lines: vertices (n, 3), metres, and faces (m, 3).
    width : of a ribbon, metres.    lift : height of the ribbons above the surface, metres."""
    V, F, count = [], [], 0
    for line in lines:
        normal = surface.normals[[*line.faces, line.faces[-1]]]
        side = np.cross(normal, np.gradient(line.points, axis=0))
        side *= width / 2 / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
        k = len(line.points)
        V += [line.points + lift * normal + side, line.points + lift * normal - side]
        i = count + np.arange(k - 1)
        F += [np.stack([i, i + k, i + 1], axis=1), np.stack([i + 1, i + k, i + k + 1], axis=1)]
        count += 2 * k
    return np.vstack(V), np.vstack(F)
