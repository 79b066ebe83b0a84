"""What strips can be, in numbers: how far layers are bent and stretched, and whether holes are where they belong."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints, area_vectors
from dsfab.members import Member, MemberGraph, spherical_normals
from dsfab.surface import Surface
from dsfab.wording import length
from dsfab.workshop.strips import is_strip

CALM = 1.5
"""Widths from the ends of a member in which a spline tells its curvature less well."""
DRILL = 1 / 40
"""The mesh may be off its smooth surface by this share of a bolt's diameter: bays are then right to about twice that.

Measured on surfaces in closed form and by unrolling: at .2 mm off, bays are right to .7 mm; at 1.4 mm, to 14 mm.
"""
USUAL = 0.95
"""Curvatures that are passed by less than one in twenty places are not what a mesh is judged by."""

NOTHING = 5e-6
"""Stretching under this share would be told as 0.000 %: it is not told."""

ALIKE = 0.999
"""Of two members that mirror each other, which differ by round-off, the first is named."""


@dataclass(frozen=True)
class StripLimits:
    """Of all strips of a design, of one layer's thickness, metres.

    bending  : the largest strain that bending a layer takes, and of which member.
    shape    : the largest strain that the surface's own curvature takes: |K| w^2 / 12, however thin a layer is.
    limit    : the strain at which the material's strength is reached; 0 where the preset gives none.
    edge     : of the mesh, metres.    wanted : the one that is fine enough to drill by.
    """

    thickness: float
    bending: float
    member: str
    shape: float
    limit: float
    edge: float
    wanted: float

    @property
    def thickest(self) -> float:
        """Metres; the thickest layer that can be bent so far. Infinite where nothing is bent or no limit is known."""
        return self.thickness * self.limit / self.bending if self.limit and self.bending else np.inf

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences: what is possible, and what is not."""
        found = []
        how = f"layers of {length(self.thickness)} are bent to a strain of {self.bending:.2%} ({self.member} most)"
        if not self.limit:
            found.append(f"{how}; name a material or set statics.strength to have that judged")
        elif self.bending > self.limit:
            found.append(
                f"NOT POSSIBLE: {how}, {self.bending / self.limit:.1f} times the {self.limit:.2%} at which the "
                f"strength is reached; the thickest layer that can be bent is {length(self.thickest)}: set "
                f"workshop.thickness to {np.floor(1e4 * self.thickest) / 1e4:g} or less"
            )
        else:
            found.append(f"{how}, of {self.limit:.2%} allowed; up to {length(self.thickest)} could be bent")
        if self.shape >= NOTHING:
            found.append(f"the curvature of the surface stretches strips by up to {self.shape:.3%}")
        if self.edge > self.wanted * 1.05:
            found.append(
                f"NOT TO DRILL FROM: edges of {length(self.edge)} are too coarse a mesh, holes may be centimetres off; "
                f"set surface.edge to {self.wanted:.2g} or less"
            )
        return tuple(found)


def strip_limits(graph: MemberGraph, surface: Surface, thickness: float, limit: float, bolt: float) -> StripLimits:
    """The limits of all members of a graph that are strips, on the uncut surface that they were drawn on.

    thickness, bolt : metres.    limit : the strain that the material takes; 0 where it is not known.
    """
    strips = [member for member in graph.members if is_strip(member)]
    tree, K = cKDTree(surface.centroids), face_curvatures(surface)
    bends, shapes, usual = [0.0], [0.0], list[Floats]()
    for member in strips:
        calm = calm_stations(member)
        assert member.axis is not None
        kn = np.abs(member.axis.kn[calm])
        usual.append(kn)
        bends.append(float(kn.max(initial=0.0)))
        near = np.asarray(tree.query(member.axis.P[calm])[1])
        shapes.append(float(np.median(np.abs(K[near]))) * member.mean_width**2 / 12 if len(near) else 0.0)
    worst = int(np.argmax(np.array(bends) >= ALIKE * max(bends)))
    bend = float(np.quantile(np.concatenate(usual), USUAL)) if strips else 0.0
    wanted = float(np.sqrt(8 * DRILL * bolt / bend)) if bend > 0 else np.inf
    name = strips[worst - 1].id if worst else "none"
    return StripLimits(
        thickness, thickness * max(bends) / 2, name, max(shapes), limit, float(surface.mean_edge), wanted
    )


def calm_stations(member: Member) -> Ints:
    """(q,) the stations of a member's axis, by number, at which its curvature is well known."""
    axis = member.axis
    assert axis is not None
    past = 0.0 if axis.closed else min(CALM * member.mean_width, axis.length / 3)
    return np.flatnonzero((axis.s >= past) & (axis.s <= axis.length - past))


def face_curvatures(surface: Surface) -> Floats:
    """(m,) Gauss curvature of each face, 1/m2: of the linear map that its three normals are [Rusinkiewicz 2004]."""
    N, P = spherical_normals(surface)[surface.F], surface.V[surface.F]
    n = area_vectors(surface.V, surface.F)
    n = n / np.linalg.norm(n, axis=1)[:, None]
    edges, turns = P[:, 1:] - P[:, :1], N[:, 1:] - N[:, :1]
    x = edges[:, 0] / np.linalg.norm(edges[:, 0], axis=1)[:, None]
    frame = np.stack([x, np.cross(n, x)], axis=1)
    E, D = np.einsum("mei,mai->mae", edges, frame), np.einsum("mei,mai->mae", turns, frame)
    return np.asarray(np.linalg.det(D) / np.linalg.det(E))
