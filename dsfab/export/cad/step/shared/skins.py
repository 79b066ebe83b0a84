"""Points of smooth skins between the vertices of a mesh, and the allowed distance of a solid from the mesh."""

from dataclasses import dataclass, field
from functools import cached_property

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, cross
from dsfab.core.limits import OFF_SURFACE
from dsfab.core.units import MM_PER_M
from dsfab.export.part import NO_PAIRS, Curved
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import on_boundary


@dataclass(frozen=True, eq=False)
class Dense:
    """A surface divided some times, with its skins. Lengths in millimetres.

    surface : metres.    half : (n,) half the thickness of the faces, metres.    shift : see `Curved`.
    parent  : (m,) the face of the mesh that each face is a part of.    twins : see `Curved`.
    """

    surface: Surface
    half: Floats
    shift: int
    parent: Ints
    twins: Ints = field(default_factory=lambda: NO_PAIRS)

    @cached_property
    def points(self) -> Floats:
        """(n, 3) points of the surface."""
        return MM_PER_M * self.surface.V

    @cached_property
    def normals(self) -> Floats:
        """(n, 3) of the vertices: the means of their faces', weighted with the angles there."""
        V, F = self.surface.V, self.surface.F
        N = np.asarray(igl.per_vertex_normals(V, F, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE))
        a, b = self.twins.T
        N[a], N[b] = N[a] - N[b], N[b] - N[a]
        return np.asarray(N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300))

    @cached_property
    def across(self) -> Floats:
        """(n, 3) vectors to the skins along the mean normals.

        Those that a face sees best lean a little this way and that: on a skin that is noise of the vertices, not shape.
        """
        return np.asarray(MM_PER_M * self.half[:, None] * self.normals)

    @cached_property
    def middle(self) -> Floats:
        """(n, 3) half way between the skins."""
        return np.asarray(self.points + self.shift * self.across)

    @cached_property
    def boundary(self) -> Bools:
        """(n,) vertices of the boundary."""
        return on_boundary(self.surface.edges, self.surface.n)

    @cached_property
    def finer(self) -> "Dense":
        """Each triangle in four."""
        return Dense(self._divided, self.carry(self.half), self.shift, np.tile(self.parent, 4))

    @property
    def _divided(self) -> Surface:
        """The surface with points on cubics half way along the edges after the other points."""
        surface, edges = self.surface, self.surface.edges
        M = np.concatenate([surface.V, between(surface.V, self.normals, edges.ends)])
        (a, b, c), (ab, bc, ca) = surface.F.T, surface.n + edges.of.T
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        return Surface(M, np.concatenate([np.stack(corners, axis=1) for corners in four]))

    def carry(self, fields: Floats) -> Floats:
        """Linear fields (n, ...) on the vertices of `finer`."""
        return np.concatenate([fields, halfway(fields, self.surface.edges.ends)])


def dense(surface: Surface, curved: Curved) -> Dense:
    """The surface as it is."""
    D = curved.D[surface.F]  # longer at corners: so long that the faces have their thickness
    seen = np.bincount(surface.F.ravel(), np.einsum("mci,mi->mc", D, surface.normals).ravel(), surface.n)
    half = seen / np.bincount(surface.F.ravel(), minlength=surface.n)
    half[curved.twins] = half[curved.twins].mean(axis=1, keepdims=True)
    return Dense(surface, half, curved.shift, np.arange(surface.m), curved.twins)


def between(P: Floats, d: Floats, ends: Ints) -> Floats:
    """(e, 3) points half way along edges (e, 2) of P (n, 3), on the cubic whose ends are normal to d (n, 3): fits
    then do not wave between vertices."""
    N = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
    chord = P[ends[:, 1]] - P[ends[:, 0]]
    slopes = [chord - N[e] * np.einsum("ki,ki->k", chord, N[e])[:, None] for e in ends.T]
    return np.asarray(halfway(P, ends) + (slopes[0] - slopes[1]) / 8)


def halfway(values: Floats, ends: Ints) -> Floats:
    """Means of values (n, ...) at both ends of edges (k, 2): numpy's own over pairs takes three times as long."""
    a, b = ends.T
    return np.asarray((values[a] + values[b]) / 2)


def chord_errors(given: Dense) -> Floats:
    """(m,) how far each triangle lies below the smooth surface through its corners, metres.

    In its middle, where it is a third more than in the middles of its edges: h^2 / 6R and h^2 / 8R of triangles with
    three edges h on a sphere with radius R.
    """
    V, edges = given.surface.V, given.surface.edges
    sags = np.linalg.norm(between(V, given.normals, edges.ends) - halfway(V, edges.ends), axis=1)
    return np.asarray(4 / 3 * sags[edges.of].max(axis=1))


def excess(given: Dense, curved: Curved) -> Floats:
    """(m,) by what share the smooth solid over each triangle is larger than the mesh's.

    Its area is, and so is its thickness between the vertices, whose normals part. What is missing goes with the square
    of the edges, so when each triangle is divided in four a third of the difference is left.
    """
    coarse, D = prisms(given.middle, given.across, given.surface.F), MM_PER_M * curved.D
    fine = given.finer
    parts = np.bincount(fine.parent, prisms(fine.middle, fine.across, fine.surface.F), given.surface.m)
    smooth = coarse + 4 / 3 * (parts - coarse)
    return np.asarray(smooth / prisms(given.points + curved.shift * D, D, given.surface.F) - 1)


def prisms(V: Floats, D: Floats, F: Ints) -> Floats:
    """(m,) volumes between triangles V - D and V + D; (n, 3) each."""
    a, b, c = F.T
    across = cross(V[b] - V[a], V[c] - V[a]) + cross(D[b] - D[a], D[c] - D[a]) / 3  # of V + s D, from s = -1 to 1
    return np.asarray(np.einsum("mi,mi->m", across, D[a] + D[b] + D[c]) / 3)


MOST_CHORD = 1 / 4
"""No more of the mesh's own chord error counts, as a share of the thickness: at creases it is no such thing."""

COARSE = 2
"""Times the usual chord error from which the largest is told, too."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Millimetres: the thickness, and how far the smooth solid may be off the mesh beside the mesh's own chord error.

    V, F    : (n, 3) and (m, 3) both skins of the uncut surface.
    chord   : (m,) the chord error of their triangles.
    rounder : (m,) by what share the volume over them may be larger, since the mesh cuts its curves short.
    """

    thickness: float
    distance: float
    V: Floats
    F: Ints
    chord: Floats
    rounder: Floats

    @cached_property
    def usual(self) -> float:
        """The chord error that nine of ten triangles stay under."""
        return float(np.percentile(self.chord, 90))

    @property
    def told(self) -> str:
        """What is allowed, as part of a sentence: where triangles are coarse, or at creases, it is far more."""
        most = float(self.chord.max())
        some = f"usually under {self.usual:.2g} mm" if self.usual > 0 else "usually none"
        more = f", {most:.2g} mm where it is coarsest" if most > COARSE * self.usual and most > self.distance else ""
        return f"allowed are {self.distance:.2g} mm and the mesh's own chord error, {some}{more}"

    def allowed(self, points: Floats) -> Floats:
        """(k,) how far points may be off: the chord error of the triangle where they are counts.

        That of a vertex beside them does not say it: where triangles are long, no corner of theirs may be the nearest.
        """
        return np.asarray(self.distance + self.chord[self.nearest(points)])

    def nearest(self, points: Floats) -> Ints:
        """(k,) the triangles nearest to points."""
        return np.asarray(self._tree.squared_distance(self.V, self.F, points)[1])

    @cached_property
    def _tree(self) -> igl.AABB:
        """Of the triangles: it takes as long as asking it about as many points."""
        tree = igl.AABB()
        tree.init(self.V, self.F)
        return tree


def smooth_limits(surface: Surface, curved: Curved, tolerance: float = 0.0) -> Limits:
    """For a solid cut from a surface; tolerance : millimetres that were asked for, `OFF_SURFACE` if 0.

    What a build makes smooth solids within, and what `dsfab check` accepts of their files.
    """
    mesh = dense(surface, curved)
    t = 2 * MM_PER_M * float(np.median(np.linalg.norm(curved.D, axis=1)))
    chord = np.minimum(MM_PER_M * chord_errors(mesh), MOST_CHORD * t)
    V = np.concatenate([mesh.middle + mesh.across, mesh.middle - mesh.across])
    F = np.concatenate([surface.F, surface.F + surface.n])
    return Limits(t, tolerance or OFF_SURFACE * t, V, F, np.tile(chord, 2), np.tile(excess(mesh, curved), 2))
