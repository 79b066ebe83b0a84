"""`SpreadLoad`: loads that are spread over faces and edges, which act on the bubbles of edges too."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from dsfab.arrays import Floats, lock
from dsfab.statics.elements import BUBBLES, Elements, edge_frames
from dsfab.surface.loads import Force, Line, Load
from dsfab.surface.mesh import Surface


@dataclass(frozen=True, eq=False)
class SpreadLoad:
    """The part of a load that is constant on each face or edge.

    face : (m, 3) force per area on each face, Pa.
    edge : (e, 3) force per length on each edge, N/m.
    """

    face: Floats
    edge: Floats

    def __post_init__(self) -> None:
        lock(self, "face", np.float64, (None, 3))
        lock(self, "edge", np.float64, (None, 3))

    @classmethod
    def on(cls, surface: Surface, face: object = 0.0, edge: object = 0.0) -> Self:
        """From anything that broadcasts to (m, 3) Pa and (e, 3) N/m."""
        shapes = (surface.m, 3), (len(surface.edges.ends), 3)
        return cls(*(np.broadcast_to(np.asarray(v, float), s) for v, s in zip((face, edge), shapes, strict=True)))

    @classmethod
    def total(cls, parts: Mapping[str, Self], factors: Mapping[str, float]) -> Self:
        """The sum of the named parts, each multiplied with its factor."""
        weight = {name: factors.get(name, 0.0) for name in parts}
        face, edge = (np.sum([f * getattr(parts[k], on) for k, f in weight.items()], axis=0) for on in ("face", "edge"))
        return cls(face, edge)

    def vertex_forces(self, surface: Surface) -> Floats:
        """(n, 3) newtons: a third of each face's force to its corners, half of each edge's to its ends."""
        force = np.zeros((surface.n, 3))
        np.add.at(force, surface.F.ravel(), np.repeat(self.face * surface.areas[:, None] / 3, 3, axis=0))
        np.add.at(force, surface.edges.ends.ravel(), np.repeat(self.edge * _lengths(surface) / 2, 2, axis=0))
        return force

    def bubble_forces(self, surface: Surface, elements: Elements) -> Floats:
        """(e, k) newtons on the edge unknowns of `elements`: the work of the load on each bubble.

        The integral of 4 phi_j phi_k is A / 3 on a face and 2 l / 3 on its edge.
        """
        work = self.edge * _lengths(surface) * 2 / 3
        np.add.at(work, surface.edges.of.ravel(), np.repeat(self.face * surface.areas[:, None] / 3, 3, axis=0))
        in_frame = np.einsum("edx,ex->ed", edge_frames(surface), work)
        forces = np.zeros((len(work), len(elements.on_edges)))
        for k, name in enumerate(elements.on_edges):
            if name in BUBBLES:
                forces[:, k] = in_frame[:, BUBBLES.index(name)]
        return forces


def spread_load(surface: Surface, loads: Sequence[Load], weight: float = 0.0) -> SpreadLoad:
    """What among `loads` is spread over faces and along lines; forces on picked vertices stay on the vertices.

    weight : of the sheet, newtons per square metre, as for `LoadCase.build`.
    """
    face, edge = np.zeros((surface.m, 3)), np.zeros((len(surface.edges.ends), 3))
    for load in loads:
        if isinstance(load, Line):
            edge += load.on_edges(surface)
        elif not isinstance(load, Force):
            face += load.traction(surface, weight)
    return SpreadLoad.on(surface, face, edge)


def _lengths(surface: Surface) -> Floats:
    """(e, 1) metres."""
    a, b = (surface.V[surface.edges.ends[:, i]] for i in range(2))
    return np.asarray(np.linalg.norm(b - a, axis=1, keepdims=True))
