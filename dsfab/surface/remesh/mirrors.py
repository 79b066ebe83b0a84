"""Mirror symmetries of a surface, for remeshing."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, lengths
from dsfab.surface.mesh import Surface, nearest_places
from dsfab.surface.remesh.features import TOLERANCE, design_features
from dsfab.surface.remesh.smoothing import NearestOnSurface, SmoothPatches
from dsfab.surface.topology import euler_characteristic, half_edges, link_components, misoriented_edges, pieces

LARGEST_GROUP = 240  # Largest number of elements of a symmetry group.
MATRIX_TOLERANCE = 1e-6  # Two matrices count as equal if no entry differs by more than this.
INERTIA_TOLERANCE = 1e-2  # Moments of inertia count as equal within this fraction of the largest moment.
FAR_TOLERANCE = 1e-3  # Distances count as equal within this fraction of the surface's size.


def mirror(normal: Floats) -> Floats:
    """Return the reflection (3, 3) across the plane with a unit normal (3,)."""
    return np.eye(3) - 2 * np.outer(normal, normal)


def centroid(surface: Surface) -> Floats:
    """Return the centroid (3,) of the area, metres."""
    return np.asarray(surface.areas @ surface.centroids / surface.area)


def round_axis(surface: Surface, axes: Floats) -> Floats | None:
    """Return the first of `axes` (3, 3) with nearly equal second moments of area along the other axes, or None."""
    x = surface.centroids - centroid(surface)
    inertia = [float(surface.areas @ (x @ axis) ** 2) for axis in axes]
    for k in range(3):
        i, j = (inertia[(k + step) % 3] for step in (1, 2))
        if abs(i - j) < INERTIA_TOLERANCE * max(inertia):
            return np.asarray(axes[k])
    return None


def far_directions(x: Floats, size: float, count: int = 1) -> Floats:
    """Return unit vectors (k, 3) from the origin to the farthest of the points x (n, 3).
    count : least number k of vectors.    size : size of the surface, in the unit of x."""
    distance = lengths(x)
    farthest = np.flatnonzero(distance > np.partition(distance, -count)[-count] - FAR_TOLERANCE * size)
    return np.asarray(x[farthest] / distance[farthest, None])


def planes_through(axis: Floats, directions: Floats) -> Iterator[Floats]:
    """Yield normals (3,) of possible mirror planes through an axis.
    directions : (d, 3) unit vectors that the mirrors must map onto each other."""
    for direction in directions[:24]:
        for through in (directions[0] + direction, np.cross(axis, directions[0] + direction)):
            if (length := np.linalg.norm(through)) > INERTIA_TOLERANCE:
                yield np.cross(axis, through / length)


def generated_group(generators: Sequence[Floats], largest: int = LARGEST_GROUP) -> Floats:
    """Return all products (g, 3, 3) of the mirrors and rotations `generators` (3, 3), the identity first.
    Raises OverflowError for more than `largest` products."""
    elements = np.empty((largest + 1 + len(generators), 3, 3))
    elements[0], count, walked = np.eye(3), 1, 0
    while walked < count:
        for g in generators:
            product = g @ elements[walked]
            if not (np.abs(elements[:count] - product).max(axis=(1, 2)) < MATRIX_TOLERANCE).any():
                elements[count] = product
                count += 1
        walked += 1
        if count > largest:
            raise OverflowError
    return elements[:count].copy()


IMAGE_TOLERANCE = 1 / 20  # Largest distance of a surface from its mirror image, divided by the edge length.
ROUND_ANGLES = (0.7, 1.9)  # A surface is round if planes at these angles (radians) to a mirror plane are also mirrors.
MOST_SIDES = 16  # Largest number of mirrored sectors around an axis; with more sectors, only two mirrors are used.


@dataclass(frozen=True, eq=False)
class Mirrors:
    """A group of mirrors through the middle of a surface.
    centre : (3,) point that lies in all mirror planes, metres.    normals : (k, 3) unit normals of all mirrors.
    group   : (g, 3, 3) reflections and rotations, the identity first."""

    centre: Floats
    normals: Floats
    group: Floats

    @classmethod
    def from_surface(cls, nearest_on: NearestOnSurface, edge: float, smooth: bool) -> Self | None:
        """Return the mirror planes of a surface; None without mirror planes, or for a surface that is not oriented.
        edge   : edge length of the new mesh, metres.
        smooth : True to test the smooth surface through the vertices, False to test the flat faces."""
        if len(misoriented_edges(nearest_on.surface.F, nearest_on.surface.edges)):
            return None
        look = _MirrorTest(nearest_on.surface, nearest_on, edge, smooth)
        group, normals = np.eye(3)[None], list[Floats]()
        for normal in _candidate_mirrors(look):
            with suppress(OverflowError):  # inexact mirror planes can generate too many images
                group, normals = _mirror_group([*normals, normal], 2 * MOST_SIDES), [*normals, normal]
        if not normals:
            return None
        mirrors = group[(np.abs(np.trace(group, axis1=1, axis2=2) - 1) < TOLERANCE) & (np.linalg.det(group) < 0)]
        return cls(look.centre, np.linalg.eigh(mirrors)[1][:, :, 0], group)


@dataclass(frozen=True, eq=False)
class _MirrorTest:
    surface: Surface
    find: NearestOnSurface
    edge: float
    smooth: bool

    @cached_property
    def centre(self) -> Floats:
        """Middle (3,) of the surface, metres."""
        middle = (self.surface.V.min(axis=0) + self.surface.V.max(axis=0)) / 2
        area = centroid(self.surface)
        return np.where(np.abs(middle - area) < IMAGE_TOLERANCE * self.edge, middle, area)

    @cached_property
    def places_on(self) -> Callable[[Floats], tuple[Floats, Floats]]:
        """Function of points (k, 3) that returns the nearest points (k, 3) of the surface, and the normals (k, 3)."""
        surface, find = self.surface, self.find
        patches = SmoothPatches(surface) if self.smooth else None

        def places(points: Floats) -> tuple[Floats, Floats]:
            face, place = find(points)
            return (patches.points(face, place) if patches else place), surface.normals[face]

        return places

    @cached_property
    def _lines(self) -> Ints:
        return self.surface.edges.ends[design_features(self.surface, self.edge)]

    @cached_property
    def _features(self) -> Floats:
        a, b = self.surface.V[self._lines].transpose(1, 0, 2)
        count = np.ceil(lengths(b - a) / self.edge).astype(np.int64)
        line = np.repeat(np.arange(len(a)), count)
        t = (np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[line]
        return np.concatenate([a, a[line] + t[:, None] * (b - a)[line]])

    def holds(self, normal: Floats) -> bool:
        """Return whether the surface has a mirror plane with the unit normal (3,)."""
        s, R, limit = self.surface, mirror(normal), IMAGE_TOLERANCE * self.edge
        if np.ptp(s.V @ normal) < self.edge:
            return False
        step = max(s.n // 100, 1)  # test a sample of the vertices first
        for points in (s.V[::step], s.V):
            image = self._image(points, R)
            if lengths(self.places_on(image)[0] - image).max() > limit:
                return False
        image = self._image(s.centroids, R)
        facets, normals = self.places_on(image)
        alike = np.einsum("mi,mi->m", s.normals @ R, normals) > 0
        if s.areas[~alike].sum() > IMAGE_TOLERANCE * s.area or (
            not self.smooth and lengths(facets - image).max() > limit
        ):
            return False
        image = self._image(self._features, R)
        return not len(image) or float(nearest_places(image, s.V, self._lines).distance.max()) < TOLERANCE * self.edge

    def _image(self, points: Floats, R: Floats) -> Floats:
        return np.ascontiguousarray((points - self.centre) @ R + self.centre)


def _candidate_mirrors(look: _MirrorTest) -> Iterator[Floats]:
    surface, tried = look.surface, list[Floats]()

    def is_new_mirror(normal: Floats) -> bool:
        if any(abs(normal @ previous) > 1 - TOLERANCE**2 for previous in tried):
            return False
        tried.append(normal)
        return look.holds(normal)

    x = surface.centroids - look.centre
    for axes in (np.eye(3), np.linalg.eigh(np.einsum("m,mi,mj->ij", surface.areas, x, x))[1].T):
        axis = round_axis(surface, axes)
        if axis is None:
            yield from filter(is_new_mirror, axes)
            continue
        yield from filter(is_new_mirror, _mirrors_around(look, axis))
        yield from filter(is_new_mirror, axis[None])


def _mirrors_around(look: _MirrorTest, axis: Floats) -> list[Floats]:
    x = look.surface.V - look.centre
    x = x - np.outer(x @ axis, axis)
    directions = far_directions(x, look.surface.size)
    normals = [*directions[:1], *np.cross(axis, directions[:1]), *planes_through(axis, directions)]
    crosses = (np.cross(axis, unit) for unit in np.eye(3) if abs(unit @ axis) < 0.9)
    normals += [normal / np.linalg.norm(normal) for normal in crosses]
    while normals and not look.holds(normals[0]):
        normals = normals[1:]
    if not normals:
        return []
    first_normal = normals[0]
    square = np.cross(axis, first_normal)
    if all(look.holds(np.cos(angle) * first_normal + np.sin(angle) * square) for angle in ROUND_ANGLES):
        return [first_normal, square]
    chosen = [first_normal]
    for normal in filter(look.holds, normals[1:]):
        try:
            _mirror_group([*chosen, normal], MOST_SIDES)
        except OverflowError:
            return [first_normal, square]
        chosen.append(normal)
    return chosen


def _mirror_group(normals: list[Floats], largest: int) -> Floats:
    return generated_group([mirror(normal) for normal in normals], largest)


PLANE_TOLERANCE = 1e-3  # Tolerance, in edge lengths, for vertices on mirror planes and for coinciding mirror images.


@dataclass(frozen=True, eq=False)
class Chamber:
    """The part of a surface (`whole`) on one side of all mirror planes.
    toward : (k, 3) unit normals of the planes, pointing to the part.    edge : edge length of the new mesh, metres."""

    whole: Surface
    mirrors: Mirrors
    toward: Floats
    edge: float

    @classmethod
    def from_mirrors(cls, surface: Surface, mirrors: Mirrors, edge: float) -> "Chamber":
        """Return the part of a surface on one side of all mirror planes."""
        mix = np.cos(np.arange(surface.n) + 1.0) @ (surface.V - mirrors.centre)
        return cls(surface, mirrors, np.where(mirrors.normals @ mix < 0, -1.0, 1.0)[:, None] * mirrors.normals, edge)

    @cached_property
    def piece(self) -> Surface | None:
        """The part of the surface between the mirror planes; None if a face lies in a mirror plane."""
        V, F = self.whole.V, self.whole.F
        for normal in self.toward:
            cut = _positive_side(V - self.mirrors.centre, F, normal, PLANE_TOLERANCE * self.edge)
            if cut is None:
                return None
            V, F = cut[0] + self.mirrors.centre, cut[1]
        return Surface(V, F) if len(F) else None

    def planes_of(self, V: Floats) -> Bools:
        """Return a mask (k, p): True where a mirror plane contains a point of V (p, 3)."""
        return np.asarray(np.abs(self.toward @ (V - self.mirrors.centre).T) < 1e-9 * self.whole.size)

    def moved_into_planes(self, V: Floats, planes: Bools) -> Floats:
        """Return points V (p, 3), moved into the mirror planes that `planes` (k, p) marks."""
        moved = V.copy()
        for _ in range(2 * len(self.toward)):  # a point that moves into one plane can leave another plane
            for normal, in_plane in zip(self.toward, planes, strict=True):
                moved[in_plane] -= np.outer((moved[in_plane] - self.mirrors.centre) @ normal, normal)
        return moved

    def all_sides(self, V: Floats, F: Ints) -> tuple[Surface, Ints] | None:
        """Join mirrored copies of a part V (p, 3), F. Return the whole surface, and each vertex's index (n,) in V.
        Return None if the topology would change."""
        n, centre = len(V), self.mirrors.centre
        images = [(V - centre) @ R.T + centre for R in self.mirrors.group]
        faces = [F[:, ::-1] if np.linalg.det(R) < 0 else F for R in self.mirrors.group]
        every = np.concatenate(images)
        pairs = cKDTree(every).query_pairs(PLANE_TOLERANCE * self.edge, output_type="ndarray").astype(np.int64)
        count, label = link_components(len(every), pairs[:, 0], pairs[:, 1])
        first_image = np.full(count, len(every))
        np.minimum.at(first_image, label, np.arange(len(every)))
        order = np.argsort(first_image)
        number = np.empty(count, dtype=np.int64)
        number[order] = np.arange(count)
        image_faces = np.concatenate([f + k * n for k, f in enumerate(faces)])
        surface = Surface(every[first_image[order]], number[label[image_faces]])
        return (surface, first_image[order] % n) if self._is_like_whole(surface) else None

    def _is_like_whole(self, surface: Surface) -> bool:
        original = self.whole

        def facts(s: Surface) -> tuple[int, ...]:
            return pieces(s.F, s.edges)[0], euler_characteristic(s.F, s.edges), len(s.loops), len(s.pinches)

        if surface.edges.count.max() > 2 or facts(surface) != facts(original):
            return False
        new_length, old_length = (float(s.edge_lengths[s.edges.boundary].sum()) for s in (surface, original))
        return abs(new_length - old_length) <= 0.05 * old_length  # new edges may shorten a curved boundary


def _positive_side(x: Floats, F: Ints, normal: Floats, tolerance: float) -> tuple[Floats, Ints] | None:
    d = x @ normal
    is_on_plane = np.abs(d) <= tolerance
    x, d = x - np.outer(np.where(is_on_plane, d, 0.0), normal), np.where(is_on_plane, 0.0, d)
    sign = np.sign(d[F]).astype(np.int64)
    if (sign == 0).all(axis=1).any():
        return None
    uncut, cut = F[sign.min(axis=1) >= 0], F[(sign.min(axis=1) < 0) & (sign.max(axis=1) > 0)]
    a, b = half_edges(cut)
    ends = np.sort(np.stack([a, b], axis=1), axis=1)
    crossed, crossing = np.unique(ends[np.sign(d[a]) * np.sign(d[b]) < 0], axis=0, return_inverse=True)
    t = (d[crossed[:, 0]] / (d[crossed[:, 0]] - d[crossed[:, 1]]))[:, None]
    crossing_vertex = np.full(len(a), -1)
    crossing_vertex[np.sign(d[a]) * np.sign(d[b]) < 0] = len(x) + crossing.ravel()
    points = (1 - t) * x[crossed[:, 0]] + t * x[crossed[:, 1]]
    points -= np.outer(points @ normal, normal)
    parts = [uncut]
    # columns: corner a, edge ab, corner b, edge bc, corner c, edge ca
    corner = np.stack([cut, crossing_vertex.reshape(-1, 3)], axis=2).reshape(-1, 6)
    stays = (corner >= 0) & (np.concatenate([d, np.zeros(len(points))])[corner] >= 0)
    for k in (3, 4):
        polygon_corners = corner[stays.sum(axis=1) == k][stays[stays.sum(axis=1) == k]].reshape(-1, k)
        parts += [polygon_corners[:, [0, i, i + 1]] for i in range(1, k - 1)]
    F = np.concatenate(parts)
    used, F = np.unique(F, return_inverse=True)
    return np.concatenate([x, points])[used], F.reshape(-1, 3)
