"""Flat plates: discs, and members that turn within their own width, flattened from their cells [Liu et al. 2008]."""

from collections.abc import Container, Sequence
from dataclasses import dataclass

import igl
import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.members import Member, MemberGraph
from dsfab.surface import Surface, nearest, weights_at
from dsfab.workshop.layering import Layering
from dsfab.workshop.parts import LABEL, FlatPart, Hole, label, polygon_area
from dsfab.workshop.strips import EDGE, is_strip

STEPS = 60
"""Rounds of flattening; a plate of a few hundred triangles needs fewer."""


def is_plate(member: Member) -> bool:
    """Whether a member is built as a plate: fills are not built, and all others are strips."""
    return member.kind != "fill" and not is_strip(member)


def layer_numbers(layering: Layering, member: Member) -> tuple[int, ...]:
    """The layers that a member is in, counted from the top; none where it is not built."""
    if member.kind == "fill":
        return ()
    return layering.numbers(member.family) if is_strip(member) else (layering.plates,)


def plate_parts(
    graph: MemberGraph,
    members: Sequence[Member],
    normals: Floats,
    height: float,
    bolt: float,
    left: Container[str] = (),
) -> list[FlatPart]:
    """Members of a graph as plates at a height over the surface, with holes of a diameter at their nodes, metres;
    normals (n, 3) at the vertices of its sheet. Nodes that are left, by their names, have none."""
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    return [_plate(graph, member, normals, (height, bolt), left) for member in members]


def _plate(
    graph: MemberGraph, member: Member, normals: Floats, size: tuple[float, float], left: Container[str]
) -> FlatPart:
    height, bolt = size
    surface = graph.sheet.surface
    used, F = np.unique(surface.F[member.cells], return_inverse=True)
    flat = FlattenedMesh.of(surface.V[used] + height * normals[used], F.reshape(-1, 3))
    outline, *slots = flat.loops()
    holes = []
    for node in graph.along[member.id]:
        at = flat.at(node.point + height * node.normal)
        if node.id not in left and _inside(outline, at, EDGE * bolt):
            holes.append(Hole(at, bolt, node.id))
    middle = outline.mean(axis=0)
    marks = label(member.id, middle, 0.0, min(LABEL, 0.1 * float(np.ptp(outline, axis=0).min())))
    part = FlatPart(member.id, member.id, (0.0, 0.0), outline, tuple(holes), tuple(slots), marks, height, flat.strain)
    return part.lying()


def _inside(outline: Floats, at: Floats, least: float) -> bool:
    """Whether a place (2,) is so far inside of a polygon (k, 2)."""
    a, b = outline, np.roll(outline, -1, axis=0)
    t = np.clip(((at - a) * (b - a)).sum(axis=1) / np.maximum(((b - a) ** 2).sum(axis=1), 1e-30), 0, 1)
    away = np.linalg.norm(at - a - t[:, None] * (b - a), axis=1).min()
    crosses = (a[:, 1] > at[1]) != (b[:, 1] > at[1])
    x = a[:, 0] + (at[1] - a[:, 1]) / np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool(np.sum(crosses & (x > at[0])) % 2) and bool(away >= least)


@dataclass(frozen=True, eq=False)
class FlattenedMesh:
    """Triangles F (m, 3) of points V (n, 3) and their places U (n, 2) in the plane, metres."""

    V: Floats
    F: Ints
    U: Floats

    @classmethod
    def of(cls, V: Floats, F: Ints) -> "FlattenedMesh":
        """As rigid as possible, from the projection along the mean normal; what bends only keeps every length."""
        n = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]).sum(axis=0)
        n /= np.linalg.norm(n)
        x = np.eye(3)[np.abs(n).argmin()]
        x = np.cross(np.cross(n, x), n)
        x /= np.linalg.norm(x)
        U = (V - V.mean(axis=0)) @ np.stack([x, np.cross(n, x)], axis=1)
        data = igl.ARAPData()
        data.max_iter = STEPS
        igl.arap_precomputation(V, F, 2, np.zeros(1, dtype=np.int32), data)
        return cls(V, F, igl.arap_solve(U[:1], data, U))

    @property
    def strain(self) -> float:
        """The largest of all triangles, by the singular values of what flattening does to them."""
        e1, e2 = (self.V[self.F[:, k]] - self.V[self.F[:, 0]] for k in (1, 2))
        x = e1 / np.linalg.norm(e1, axis=1)[:, None]
        n = np.cross(e1, e2)
        y = np.cross(n / np.linalg.norm(n, axis=1)[:, None], x)
        E = np.stack([np.stack([(e * axis).sum(axis=1) for axis in (x, y)], axis=1) for e in (e1, e2)], axis=2)
        D = np.stack([self.U[self.F[:, k]] - self.U[self.F[:, 0]] for k in (1, 2)], axis=2)
        return float(np.abs(np.linalg.svd(D @ np.linalg.inv(E), compute_uv=False) - 1).max())

    def loops(self) -> list[Floats]:
        """(k, 2) the outline, then its openings."""
        found = [self.U[loop] for loop in Surface(self.V, self.F).loops]
        return sorted(found, key=lambda loop: -abs(polygon_area(loop)))

    def at(self, point: Floats) -> Floats:
        """(2,) where the place of the mesh nearest to a point (3,) is in the plane."""
        there = nearest(point[None], self.V, self.F)
        face = self.F[there.simplex]
        return np.asarray((weights_at(there.place, self.V, face) @ self.U[face[0]])[0])
