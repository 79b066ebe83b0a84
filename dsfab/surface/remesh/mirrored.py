"""Mirrors that a surface has, by its shape alone: what is made anew on one side of them is so on all others."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.arrays import Floats, Ints, lengths
from dsfab.surface.mesh import Surface
from dsfab.surface.mirrors import centroid, far_directions, generated_group, mirror, planes_through, round_axis
from dsfab.surface.nearest import nearest
from dsfab.surface.remesh.facets import SmoothPatches
from dsfab.surface.remesh.features import TOLERANCE, design_features
from dsfab.surface.remesh.smoothing import NearestOnSurface
from dsfab.surface.topology import misoriented_edges

ALIKE = 1 / 20
"""Of the edge: images of a surface's points may be off it by this much, as files round and facets miss it."""
ROUND = (0.7, 1.9)
"""Radians: what also has mirrors turned by these is as round as a dome, and two of its mirrors are taken."""
MOST = 16
"""Sides that mirrors through an axis may make of a surface, where they meet in angles of 22.5 degrees: faces there
would be sharper. Of more, two mirrors are taken."""
GLANCE = 100
"""Points that are looked at before all of them are."""


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Mirrors through the middle of a surface, of a group.

    centre  : (3,) in all of their planes, metres.
    normals : (k, 3) unit, of all mirrors of the group.    group : (g, 3, 3) mirrors and turns, the identity first.
    """

    centre: Floats
    normals: Floats
    group: Floats

    @classmethod
    def of(cls, on: NearestOnSurface, edge: float, smooth: bool) -> Self | None:
        """Those that were found; None where there is none, or where sides of the surface are not told apart.

        edge   : metres, of the new mesh: a share of it makes no difference.
        smooth : whether the surface is the smooth one through its vertices.
        """
        if len(misoriented_edges(on.surface.F, on.surface.edges)):
            return None
        found = _Look(on.surface, on, edge, smooth)
        group, normals = np.eye(3)[None], list[Floats]()
        for normal in _candidates(found):
            with suppress(OverflowError):  # of planes that fit nearly, but not together
                group, normals = _generated([*normals, normal], 2 * MOST), [*normals, normal]
        if not normals:
            return None
        mirrors = group[(np.abs(np.trace(group, axis1=1, axis2=2) - 1) < TOLERANCE) & (np.linalg.det(group) < 0)]
        return cls(found.centre, np.linalg.eigh(mirrors)[1][:, :, 0], group)


@dataclass(frozen=True, eq=False)
class _Look:
    """A surface that is compared with its images."""

    surface: Surface
    find: NearestOnSurface
    edge: float
    smooth: bool

    @cached_property
    def centre(self) -> Floats:
        """(3,) the middle of the box along axes in which it is as far from the centroid as rounding is; metres."""
        middle = (self.surface.V.min(axis=0) + self.surface.V.max(axis=0)) / 2
        area = centroid(self.surface)
        return np.where(np.abs(middle - area) < ALIKE * self.edge, middle, area)

    @cached_property
    def on(self) -> Callable[[Floats], tuple[Floats, Floats]]:
        """Takes points (k, 3) to the nearest places (k, 3) of the surface, and to the normals (k, 3) there."""
        surface, find = self.surface, self.find
        patches = SmoothPatches(surface) if self.smooth else None

        def places(points: Floats) -> tuple[Floats, Floats]:
            face, place = find(points)
            return (patches.points(face, place) if patches else place), surface.normals[face]

        return places

    @cached_property
    def _lines(self) -> Ints:
        """(l, 2) ends of its boundaries and creases."""
        return self.surface.edges.ends[design_features(self.surface, self.edge)]

    @cached_property
    def _features(self) -> Floats:
        """(k, 3) points on its boundaries and creases, no farther apart than an edge; metres."""
        a, b = self.surface.V[self._lines].transpose(1, 0, 2)
        count = np.ceil(lengths(b - a) / self.edge).astype(np.int64)
        of = np.repeat(np.arange(len(a)), count)
        t = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
        return np.concatenate([a, a[of] + t[:, None] * (b - a)[of]])

    def holds(self, normal: Floats) -> bool:
        """Whether the surface, its boundaries and its creases are their own images, and have the same sides there."""
        s, R, limit = self.surface, mirror(normal), ALIKE * self.edge
        if np.ptp(s.V @ normal) < self.edge:
            return False
        step = max(s.n // GLANCE, 1)
        for points in (s.V[::step], s.V):
            image = self._image(points, R)
            if lengths(self.on(image)[0] - image).max() > limit:
                return False
        image = self._image(s.centroids, R)
        facets, beside = self.on(image)
        alike = np.einsum("mi,mi->m", s.normals @ R, beside) > 0
        if s.areas[~alike].sum() > ALIKE * s.area or (not self.smooth and lengths(facets - image).max() > limit):
            return False
        image = self._image(self._features, R)
        return not len(image) or float(nearest(image, s.V, self._lines).distance.max()) < TOLERANCE * self.edge

    def _image(self, points: Floats, R: Floats) -> Floats:
        return np.ascontiguousarray((points - self.centre) @ R + self.centre)


def _candidates(look: _Look) -> Iterator[Floats]:
    """Unit normals of mirrors that hold, those that all others are tried together with first."""
    surface, tried = look.surface, list[Floats]()

    def new(normal: Floats) -> bool:
        if any(abs(normal @ other) > 1 - TOLERANCE**2 for other in tried):
            return False
        tried.append(normal)
        return look.holds(normal)

    x = surface.centroids - look.centre
    inertia = np.linalg.eigh(np.einsum("m,mi,mj->ij", surface.areas, x, x))[1].T
    for axes in (np.eye(3), inertia):
        axis = round_axis(surface, axes)
        if axis is None:
            yield from filter(new, axes)
            continue
        yield from filter(new, _around(look, axis))
        yield from filter(new, axis[None])


def _around(look: _Look, axis: Floats) -> list[Floats]:
    """Normals of mirrors through an axis around which the surface is nearly the same; two where it is round."""
    x = look.surface.V - look.centre
    x = x - np.outer(x @ axis, axis)
    far = far_directions(x, look.surface.size)
    normals = [*far[:1], *np.cross(axis, far[:1]), *planes_through(axis, far)]
    normals += [np.cross(axis, one) / np.linalg.norm(np.cross(axis, one)) for one in np.eye(3) if abs(one @ axis) < 0.9]
    while normals and not look.holds(normals[0]):
        normals = normals[1:]
    if not normals:
        return []
    first = normals[0]
    square = np.cross(axis, first)
    if all(look.holds(np.cos(angle) * first + np.sin(angle) * square) for angle in ROUND):
        return [first, square]
    found = [first]
    for normal in filter(look.holds, normals[1:]):
        try:
            _generated([*found, normal], MOST)
        except OverflowError:
            return [first, square]
        found.append(normal)
    return found


def _generated(normals: list[Floats], largest: int) -> Floats:
    return generated_group([mirror(normal) for normal in normals], largest)
