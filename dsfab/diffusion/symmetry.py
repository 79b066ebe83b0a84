"""Symmetry of a surface with its supports and loads."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, lock
from dsfab.core.errors import PatternError
from dsfab.surface import (
    FAR_TOLERANCE,
    LARGEST_GROUP,
    MATRIX_TOLERANCE,
    LoadCase,
    Surface,
    centroid,
    far_directions,
    generated_group,
    mirror,
    nearest_places,
    planes_through,
    round_axis,
    weights_at,
)

IMAGE_OFF_SURFACE = 0.25  # Largest distance of a mirrored or rotated vertex from the surface, in mean edges.
OFF_SUPPORT = 1.0
"""Largest distance of the image of a supported vertex from the nearest supported vertex, in mean edge lengths."""
OFF_LOAD = (0.3, 0.02)
"""Largest changes of smoothed forces, then of resultants, by a mirror or rotation. Fractions of the total load."""
SAMPLE_POINTS = 100  # Approximate number of points in quick checks, which come before the check of all points.


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A group of g rotations and mirrors about a surface's centroid. R : (g, 3, 3) orthogonal, the identity first.
    maps  : g sparse (n, n) matrices. maps[i] @ x is the field x at the images of the vertices under R[i].
    faces : (g, m) face on which the image of each face's centroid lies."""

    R: Floats
    maps: tuple[csr_array, ...]
    faces: Ints

    def __post_init__(self) -> None:
        lock(self, "R", np.float64, (None, 3, 3))
        lock(self, "faces", np.int64, (len(self.R), None))

    @property
    def order(self) -> int:
        """Number of rotations and mirrors in the group, with the identity."""
        return len(self.R)

    def mean(self, x: Floats) -> Floats:
        """Return a symmetric field (n, ...): at each vertex, the mean of field x over all images of the vertex."""
        return np.asarray(sum((T @ x for T in self.maps[1:]), x) / self.order)

    def maximum(self, x: Floats) -> Floats:
        """Return a symmetric field (n,): at each vertex, the maximum of field x over all images of the vertex."""
        return np.asarray(np.max([x, *(T @ x for T in self.maps[1:])], axis=0))

    def mean_stress(self, sigma: Floats) -> Floats:
        """Return a symmetric tensor field (m, 3, 3): on each face, the mean over all images, each rotated back."""
        total = sum(R.T @ sigma[face] @ R for R, face in zip(self.R, self.faces, strict=True))
        return np.asarray(total / self.order)

    def asymmetry(self, surface: Surface, x: Floats) -> float:
        """Return the largest RMS difference between a field x (n,) and its images, divided by the RMS of x."""
        mass = surface.vertex_areas
        size = float(np.sqrt(mass @ x**2))
        return max(float(np.sqrt(mass @ (T @ x - x) ** 2)) for T in self.maps) / size

    def invariant(self, L: csr_array, X: Floats, mass: Floats) -> tuple[Floats, Floats]:
        """Return the symmetric modes (n, j) of L in the space that modes X (n, k) span, and their eigenvalues (j,).
        mass : (n,) diagonal of the mass matrix M, with X^T M X = I."""
        Y = self.mean(X)
        share, C = np.linalg.eigh(Y.T @ (mass[:, None] * Y))
        keep = share > 0.5**2  # shares are near 0 or near 1, so the exact limit does not matter
        B = Y @ (C[:, keep] / np.sqrt(share[keep]))
        lam, Q = np.linalg.eigh(B.T @ (L @ B))
        return lam, B @ Q


def symmetry_of(surface: Surface, words: Sequence[str], *loads: LoadCase) -> Symmetry:
    """Return the group of mirrors and rotations that `words` generate.
    words : texts, such as `x` for a mirror that negates x, or `rot:6:z` for a sixth of a rotation about z.
    Raises PatternError for unknown words, and if the surface, a support or a load is not symmetric."""
    return checked_symmetry(surface, symmetry_group(words), loads, str(list(words)))


def face_tree(surface: Surface) -> igl.AABB:
    tree = igl.AABB()
    tree.init(surface.V, surface.F)
    return tree


def checked_symmetry(
    surface: Surface, R: Floats, loads: Sequence[LoadCase], words: str, tree: igl.AABB | None = None
) -> Symmetry:
    """Return the symmetry that consists of given rotations and mirrors.
    R : (g, 3, 3) matrices, the identity first.    words : name of the symmetry in messages.
    Raises PatternError if the surface, a support or a load is not symmetric."""
    centre = centroid(surface)
    maps, faces, edge = [csr_array(eye_array(surface.n))], [np.arange(surface.m)], surface.mean_edge
    few = surface.V[:: max(surface.n // SAMPLE_POINTS, 1)]
    tree = tree or face_tree(surface)
    for g in R[1:]:  # for most asymmetric surfaces, a sample of vertices shows the asymmetry
        distance = largest_distance(surface, tree, (few - centre) @ g.T + centre)
        if distance > IMAGE_OFF_SURFACE * edge:
            raise _symmetry_error(words, "the surface is", f"a mirrored or rotated copy deviates by {distance:.3g} m")
    for g in R[1:]:
        distance, T = point_map(surface, tree, (surface.V - centre) @ g.T + centre)
        if distance > IMAGE_OFF_SURFACE * edge:
            raise _symmetry_error(words, "the surface is", f"a mirrored or rotated copy deviates by {distance:.3g} m")
        maps.append(T)
        image = np.ascontiguousarray((surface.centroids - centre) @ g.T + centre)
        faces.append(tree.squared_distance(surface.V, surface.F, image)[1])
    symmetry = Symmetry(R, tuple(maps), np.stack(faces))
    for load in loads:
        _check_supports(surface, symmetry, words, load, centre)
        _check_loads(surface, symmetry, words, load.force, centre)
    return symmetry


def _symmetry_error(words: str, subject: str, finding: str) -> PatternError:
    return PatternError(
        f"diffusion.symmetry = {words}, but {subject} not symmetric: {finding}; fix the model, or set fewer symmetries"
    )


def _generator(word: str) -> Floats:
    kind, *rest = word.split(":")
    if kind in ("x", "y", "z") and not rest:
        return np.diag([-1.0 if axis == kind else 1.0 for axis in "xyz"])
    if kind == "rot" and len(rest) == 2 and rest[0].isdigit() and rest[1] in ("x", "y", "z"):
        turns, axis = int(rest[0]), "xyz".index(rest[1])
        if 2 <= turns <= LARGEST_GROUP:
            i, j = (axis + 1) % 3, (axis + 2) % 3
            angle, R = 2 * np.pi / turns, np.eye(3)
            R[[i, j, i, j], [i, j, j, i]] = np.array([np.cos(angle)] * 2 + [-np.sin(angle), np.sin(angle)])
            return R
    raise PatternError(
        f"{word!r} is not a symmetry; write x, y or z for a mirror, or rot:6:z for a sixth of a turn "
        f"about z (or 2 to {LARGEST_GROUP} instead of 6)"
    )


def symmetry_group(words: Sequence[str]) -> Floats:
    """Return all products (g, 3, 3) of the given mirrors and rotations, the identity first.
    Raises PatternError for an unknown word, and for too many products."""
    try:
        return generated_group([_generator(word) for word in words])
    except OverflowError:
        raise PatternError(
            f"symmetry = {list(words)} gives over {LARGEST_GROUP} symmetric images; list fewer symmetries"
        ) from None


def largest_distance(surface: Surface, tree: igl.AABB, points: Floats) -> float:
    """Return the largest distance of points (p, 3) from the surface."""
    squared = tree.squared_distance(surface.V, surface.F, np.ascontiguousarray(points))[0]
    return float(np.sqrt(squared.max()))


def point_map(surface: Surface, tree: igl.AABB, points: Floats) -> tuple[float, csr_array]:
    """Return the largest distance of points (p, 3) from the surface, and a matrix (p, n) for interpolation."""
    squared, face, nearest_points = tree.squared_distance(surface.V, surface.F, np.ascontiguousarray(points))
    corner = surface.F[face]
    weight = np.clip(weights_at(nearest_points, surface.V, corner), 0, 1)
    weight[weight < 1e-3] = 0
    weight /= weight.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(points)), 3)
    T = csr_array((weight.ravel(), (rows, corner.ravel())), shape=(len(points), surface.n))
    T.eliminate_zeros()
    return float(np.sqrt(squared.max())), T


def _check_supports(surface: Surface, symmetry: Symmetry, words: str, load: LoadCase, centre: Floats) -> None:
    kinds, kind = np.unique(load.fixed, axis=0, return_inverse=True)
    for R in symmetry.R[1:]:
        for i, holds in enumerate(kinds):
            of_kind = kind.ravel() == i
            if not holds.any():
                continue
            turned = R @ np.diag(holds.astype(float)) @ R.T
            alike = [
                j
                for j, kind_held in enumerate(kinds)
                if np.abs(turned - np.diag(kind_held.astype(float))).max() < MATRIX_TOLERANCE
            ]
            if not alike:
                axes = "".join(axis for axis, is_held in zip("xyz", holds, strict=True) if is_held)
                raise _symmetry_error(
                    words,
                    "the supports are",
                    f"supports that hold only {axes} would hold other axes after the rotation or reflection",
                )
            image = (surface.V[of_kind] - centre) @ R.T + centre
            equal = np.flatnonzero(np.isin(kind.ravel(), alike))
            distance = float(nearest_places(image, surface.V, equal[:, None]).distance.max())
            if distance > OFF_SUPPORT * surface.mean_edge:
                raise _symmetry_error(
                    words,
                    "the supports are",
                    f"a mirrored or rotated support is {distance:.3g} m from the nearest support with the same axes",
                )


def _check_loads(surface: Surface, symmetry: Symmetry, words: str, force: Floats, centre: Floats) -> None:
    total = float(np.linalg.norm(force, axis=1).sum())
    arm = surface.V - centre
    for R, T in zip(symmetry.R[1:], symmetry.maps[1:], strict=True):
        change = T.T @ (force @ R.T) - force
        sum_off = float(np.linalg.norm(change.sum(axis=0)))
        moment_off = float(np.abs(arm.T @ change).max()) / (surface.size / 2)
        if (share := max(sum_off, moment_off) / total) > OFF_LOAD[1]:
            raise _symmetry_error(words, "the loads are", f"their resultants differ by {share:.0%}")
        if (share := float(np.linalg.norm(_smoothed_forces(surface, change), axis=1).sum()) / total) > OFF_LOAD[0]:
            raise _symmetry_error(
                words, "the loads are", f"{min(share / 2, 1):.0%} of the load has no mirrored or rotated counterpart"
            )


def _smoothed_forces(surface: Surface, force: Floats, rounds: int = 6) -> Floats:
    ends, n = surface.edges.ends, surface.n
    share = 0.5 / np.maximum(np.bincount(ends.ravel(), minlength=n), 1)
    i, j = np.concatenate([ends, ends[:, ::-1]]).T
    half = csr_array((share[j], (i, j)), shape=(n, n))
    for _ in range(rounds):
        force = force / 2 + half @ force
    return np.asarray(force)


TURNS = (12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2)
"""The search tries rotations about an axis by 1 / n of a full rotation, for each n."""
ROUND = (7, 5)
"""A surface counts as round if it is symmetric under rotations by 1 / 7 and by 1 / 5 of a full rotation."""
LENIENT = 1.5  # Quick checks multiply all tolerances by this factor.


def largest_symmetry(surface: Surface, axes: Floats, loads: Sequence[LoadCase]) -> Symmetry | None:
    """Return the largest symmetry group of a surface with its loads; None if it has no mirror and no rotation.
    axes : (3, 3) in rows, which determine the tried mirrors and rotations."""
    glance = _QuickCheck(surface, tuple(loads))
    generators = [R for R in _generators(surface, axes, glance) if glance.allows(R)]
    if not generators:
        return None
    with suppress(PatternError, OverflowError):
        return glance.checked(generated_group(generators))
    sound: list[Floats] = []
    for R in generators:
        with suppress(PatternError, OverflowError):
            glance.checked(generated_group([*sound, R]))
            sound.append(R)
    return glance.checked(generated_group(sound)) if sound else None


@dataclass(frozen=True, eq=False)
class _QuickCheck:
    surface: Surface
    loads: tuple[LoadCase, ...]

    @cached_property
    def centre(self) -> Floats:
        return centroid(self.surface)

    @cached_property
    def _tree(self) -> igl.AABB:
        return face_tree(self.surface)

    @cached_property
    def _sample(self) -> Floats:
        return self.surface.V[:: max(self.surface.n // SAMPLE_POINTS, 1)] - self.centre

    @cached_property
    def _held_points(self) -> list[tuple[Floats, cKDTree]]:
        """For each load case with supports: a sample of supported points, and a search tree of all supported points."""
        held_points = [self.surface.V[load.supported] - self.centre for load in self.loads]
        return [(x[:: max(len(x) // SAMPLE_POINTS, 1)], cKDTree(x)) for x in held_points if len(x)]

    @cached_property
    def _moments(self) -> list[tuple[Floats, Floats, float]]:
        """Resultant (N), first moments (N m) and sum of force magnitudes (N) of each load case."""
        arm = self.surface.V - self.centre
        forces = [load.force for load in self.loads]
        return [(f.sum(axis=0), arm.T @ f, float(np.linalg.norm(f, axis=1).sum())) for f in forces]

    def allows(self, R: Floats) -> bool:
        edge = self.surface.mean_edge
        for force, moment, total in self._moments:
            limit = LENIENT * OFF_LOAD[1] * total
            arm = self.surface.size / 2
            if np.linalg.norm(R @ force - force) > limit or np.abs(R @ moment @ R.T - moment).max() > limit * arm:
                return False
        if (
            largest_distance(self.surface, self._tree, self._sample @ R.T + self.centre)
            > LENIENT * IMAGE_OFF_SURFACE * edge
        ):
            return False
        reach = LENIENT * OFF_SUPPORT * edge
        return all(float(np.max(tree.query(P @ R.T)[0])) < reach for P, tree in self._held_points)

    def checked(self, group: Floats) -> Symmetry:
        return checked_symmetry(self.surface, group, self.loads, "found", self._tree)


def _generators(surface: Surface, axes: Floats, glance: _QuickCheck) -> Iterator[Floats]:
    axis = round_axis(surface, axes)
    if axis is None:
        yield from (mirror(direction) for direction in axes)
        yield from (_turn(direction, 2) for direction in axes)
        return
    x = surface.V - glance.centre
    x = x - np.outer(x @ axis, axis)
    if all(glance.allows(_turn(axis, parts)) for parts in ROUND):
        direction = _best_mirror(x, surface.V - glance.centre, axis, surface)
        yield from (mirror(direction), mirror(np.cross(axis, direction)))
    else:
        yield from (_turn(axis, p) for p in TURNS)
        yield from (mirror(plane) for plane in planes_through(axis, far_directions(x, surface.size)))
    yield mirror(axis)


def _best_mirror(x: Floats, V: Floats, axis: Floats, surface: Surface, samples: int = 200) -> Floats:
    """Return the normal of the mirror that best maps a round mesh onto itself.
    x : (n, 3) vectors from the axis to the vertices.    V : (n, 3) vertices, relative to the centroid."""
    distance = np.linalg.norm(x, axis=1)
    count = min(samples, len(x))
    outer = V[distance > np.partition(distance, -count)[-count] - FAR_TOLERANCE * surface.size]
    outer_tree, edge = cKDTree(outer), surface.mean_edge
    N = far_directions(x, surface.size)[:samples]
    images = np.concatenate([outer @ mirror(normal).T for normal in N])
    misfit = np.square(outer_tree.query(images)[0]).reshape(len(N), -1).sum(axis=1) / edge**2
    on_mirror = sum((1 / (1 + np.square(n @ outer.T / edge))).sum(axis=1) for n in (N, np.cross(axis, N)))
    # a tie goes to the mirror with the most vertices near its plane or near the perpendicular plane
    ranks = zip(np.round(misfit, 6).tolist(), (-np.round(on_mirror, 6)).tolist(), range(len(N)), strict=True)
    return np.asarray(N[min(ranks)[2]])


def _turn(axis: Floats, parts: int) -> Floats:
    """Return the rotation (3, 3) by 1 / parts of a full rotation [Rodrigues 1840]."""
    angle = 2 * np.pi / parts
    x, y, z = axis
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * across @ across)
