"""Smooth upper and lower skins of a sheet."""

from dataclasses import dataclass, field
from functools import cached_property

import igl
import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, cross, unit_vectors
from dsfab.core.limits import OFF_SURFACE
from dsfab.core.units import MM_PER_M
from dsfab.export.part import NO_PAIRS, Curved
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import on_boundary


@dataclass(frozen=True, eq=False)
class DenseSurface:
    """Surface with two skins. Fields in metres, properties in mm. parent : (m,) undivided triangle of each triangle.
    half  : (n,) half the thickness, m.    shift : distance from the surface to the sheet's middle / `half`.
    twins : (k, 2) vertex pairs at equal places with opposite normals."""

    surface: Surface
    half: Floats
    shift: int
    parent: Ints
    twins: Ints = field(default_factory=lambda: NO_PAIRS)

    @cached_property
    def points(self) -> Floats:
        """(n, 3) vertices of the surface, mm."""
        return MM_PER_M * self.surface.V

    @cached_property
    def normals(self) -> Floats:
        """(n, 3) unit normals at the vertices."""
        V, F = self.surface.V, self.surface.F
        N = np.asarray(igl.per_vertex_normals(V, F, igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE))
        a, b = self.twins.T
        N[a], N[b] = N[a] - N[b], N[b] - N[a]
        return unit_vectors(N)

    @cached_property
    def half_vectors(self) -> Floats:
        """(n, 3) vectors from `middle` to the upper skin, mm."""
        return np.asarray(MM_PER_M * self.half[:, None] * self.normals)

    @cached_property
    def middle(self) -> Floats:
        """(n, 3) points half way between the skins, mm."""
        return np.asarray(self.points + self.shift * self.half_vectors)

    @cached_property
    def boundary(self) -> Bools:
        """(n,) True for vertices of the boundary."""
        return on_boundary(self.surface.edges, self.surface.n)

    @cached_property
    def finer(self) -> "DenseSurface":
        """The surface after division of each triangle into four triangles."""
        surface, edges = self.surface, self.surface.edges
        M = np.concatenate([surface.V, cubic_midpoints(surface.V, self.normals, edges.ends)])
        (a, b, c), (ab, bc, ca) = surface.F.T, surface.n + edges.of.T
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        divided = Surface(M, np.concatenate([np.stack(corners, axis=1) for corners in four]))
        return DenseSurface(divided, self.carry(self.half), self.shift, np.tile(self.parent, 4))

    def carry(self, fields: Floats) -> Floats:
        """Interpolate values (n, ...) at the vertices to values at the vertices of `finer`."""
        return np.concatenate([fields, end_means(fields, self.surface.edges.ends)])


def dense_surface(surface: Surface, curved: Curved) -> DenseSurface:
    """Return a surface with its two skins. curved : sheet that gives the half-thickness vectors."""
    D = curved.D[surface.F]  # D is longer at creases, so that faces keep their thickness
    seen = np.bincount(surface.F.ravel(), np.einsum("mci,mi->mc", D, surface.normals).ravel(), surface.n)
    half = seen / np.bincount(surface.F.ravel(), minlength=surface.n)
    half[curved.twins] = half[curved.twins].mean(axis=1, keepdims=True)
    return DenseSurface(surface, half, curved.shift, np.arange(surface.m), curved.twins)


def cubic_midpoints(P: Floats, d: Floats, ends: Ints) -> Floats:
    """Return the middles (e, 3) of cubic curves between the pairs `ends` (e, 2) of points P (n, 3).
    d : (n, 3) vectors at the points. The curves are perpendicular to these vectors."""
    N, chord = unit_vectors(d), P[ends[:, 1]] - P[ends[:, 0]]
    slopes = [chord - N[e] * np.einsum("ki,ki->k", chord, N[e])[:, None] for e in ends.T]
    return np.asarray(end_means(P, ends) + (slopes[0] - slopes[1]) / 8)


def end_means(values: Floats, ends: Ints) -> Floats:
    """Return the means (k, ...) of the vertex values (n, ...) at the two ends of each edge (k, 2)."""
    a, b = ends.T
    return np.asarray((values[a] + values[b]) / 2)


def chord_errors(skins: DenseSurface) -> Floats:
    """Return the distance (m,) of each triangle's centre from the smooth surface through the vertices, metres."""
    V, edges = skins.surface.V, skins.surface.edges
    sags = np.linalg.norm(cubic_midpoints(V, skins.normals, edges.ends) - end_means(V, edges.ends), axis=1)
    return np.asarray(4 / 3 * sags[edges.of].max(axis=1))


def excess_volumes(skins: DenseSurface, curved: Curved) -> Floats:
    """Return the fraction (m,) by which the smooth solid at each triangle has more volume than the prism there."""
    coarse, D = prisms(skins.middle, skins.half_vectors, skins.surface.F), MM_PER_M * curved.D
    fine = skins.finer
    parts = np.bincount(fine.parent, prisms(fine.middle, fine.half_vectors, fine.surface.F), skins.surface.m)
    smooth = coarse + 4 / 3 * (parts - coarse)
    return np.asarray(smooth / prisms(skins.points + curved.shift * D, D, skins.surface.F) - 1)


def prisms(V: Floats, D: Floats, F: Ints) -> Floats:
    """Return the volumes (m,) of prisms between triangles F (m, 3) of points V - D and of points V + D (n, 3)."""
    a, b, c = F.T
    # mean area vector of the triangles V + s D for s from -1 to 1
    across = cross(V[b] - V[a], V[c] - V[a]) + cross(D[b] - D[a], D[c] - D[a]) / 3
    return np.asarray(np.einsum("mi,mi->m", across, D[a] + D[b] + D[c]) / 3)


GAP_SHARE = 1 / 20  # widest accepted gap between a skin and its edges, as a fraction of the thickness
OUTLINE_SHARE = 0.55  # tolerance of outlines, as a fraction of the allowed distance from the mesh
LOOP_SHARE = 0.03  # largest tolerance of an outline loop, divided by the loop's width; keeps slits open


def decimals(thickness: float) -> int:
    """Return the number of decimals for coordinates in mm of a sheet with the given thickness (mm)."""
    rounding = 3e-5
    return int(np.clip(np.ceil(-np.log10(rounding * thickness)), 2, 6))


MOST_CHORD = 1 / 4  # upper limit of estimated chord errors / thickness; at creases, the estimates are too large


@dataclass(frozen=True, eq=False)
class SmoothLimits:
    """Limits for the distance (mm) and the volume of a smooth solid, compared with the mesh.
    V, F     : (n, 3) and (m, 3) triangles of both skins.    chord : (m,) their distances from the smooth surface.
    distance : allowed distance from the mesh, in addition to `chord`.
    rounder  : (m,) fraction by which the solid may have more volume than the mesh."""

    thickness: float
    distance: float
    V: Floats
    F: Ints
    chord: Floats
    rounder: Floats

    @cached_property
    def usual_chord(self) -> float:
        """Value of `chord` that only 10 % of the triangles exceed, mm."""
        return float(np.percentile(self.chord, 90))

    @property
    def summary(self) -> str:
        """Phrase about the allowed distance and the chord errors, for messages."""
        coarse = 2  # the largest chord error is unusual if it exceeds twice `usual_chord`
        largest = float(self.chord.max())
        usual_text = f"usually under {self.usual_chord:.2g} mm" if self.usual_chord > 0 else "usually none"
        is_coarse = largest > coarse * self.usual_chord and largest > self.distance
        coarsest_text = f", up to {largest:.2g} mm at coarse triangles" if is_coarse else ""
        return f"allowed distance: {self.distance:.2g} mm plus the chord error of the mesh, {usual_text}{coarsest_text}"

    def allowed_distances(self, points: Floats) -> Floats:
        """Return the allowed distances (k,) of points (k, 3) from the mesh, mm."""
        return np.asarray(self.distance + self.chord[self.nearest(points)])

    def nearest(self, points: Floats) -> Ints:
        """Return the number (k,) of the triangle nearest to each point (k, 3)."""
        return np.asarray(self._tree.squared_distance(self.V, self.F, points)[1])

    @cached_property
    def _tree(self) -> igl.AABB:
        tree = igl.AABB()
        tree.init(self.V, self.F)
        return tree


def smooth_limits(surface: Surface, curved: Curved, tolerance: float = 0.0) -> SmoothLimits:
    """Return the limits for a smooth solid. tolerance : largest allowed distance from the mesh, mm; 0: the default."""
    mesh = dense_surface(surface, curved)
    t = 2 * MM_PER_M * float(np.median(np.linalg.norm(curved.D, axis=1)))
    chord = np.minimum(MM_PER_M * chord_errors(mesh), MOST_CHORD * t)
    V = np.concatenate([mesh.middle + mesh.half_vectors, mesh.middle - mesh.half_vectors])
    F = np.concatenate([surface.F, surface.F + surface.n])
    rounder = np.tile(excess_volumes(mesh, curved), 2)
    return SmoothLimits(t, tolerance or OFF_SURFACE * t, V, F, np.tile(chord, 2), rounder)
