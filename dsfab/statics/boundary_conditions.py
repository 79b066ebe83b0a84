"""Boundary conditions of a sheet."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.sparse import csr_array, diags_array

from dsfab.core.arrays import Bools, Floats, Ints, first_few, lock_floats
from dsfab.core.errors import StaticsError
from dsfab.core.limits import FEW_VERTICES
from dsfab.core.messages import count_phrase
from dsfab.statics.elements import BUBBLES, Elements, edge_frames
from dsfab.surface import coincident, pieces
from dsfab.surface.loads.load_case import Force, Line, Load, LoadCase
from dsfab.surface.mesh import Surface

FREE_MOTION = 1e-9  # A rigid motion is free if it moves the supports by less than this fraction of the motion.
MOTIONS = ("move along x", "move along y", "move along z", "turn about x", "turn about y", "turn about z")


def rigid_motions(points: Floats) -> Floats:
    """Return the displacement (n, 3, 6) of each point (n, 3) in each of the six rigid-body `MOTIONS`."""
    centred = points - points.mean(axis=0)
    reach = np.abs(centred).max() or 1.0
    motion = np.zeros((len(points), 3, 6))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1
    for axis in range(3):
        motion[:, :, 3 + axis] = np.cross(np.eye(3)[axis], centred) / reach
    return motion


def require_held(surface: Surface, load: LoadCase, fixed: Bools, clamped: Bools | None = None) -> None:
    """Raise StaticsError if a connected piece of the sheet can move as a rigid body.
    fixed : (n, 3) mask: directions in which each vertex cannot move.    clamped : (e,) mask of clamped edges."""
    count, label = pieces(surface.F, surface.edges)
    stopped = fixed | (load.spring > 0)
    unheld = [k for k in range(count) if not load.supported[surface.F[label == k]].any()]
    if unheld:
        where = surface.centroids[label == unheld[0]].mean(axis=0).round(3).tolist()
        raise StaticsError(
            f"{len(unheld)} of {count} pieces of the surface touch no support (the first is around {where} m); "
            f"support or remove each piece{_merge_hint(surface)}"
            if count > 1
            else "no vertex of the surface is supported; add a [[surface.support]]"
        )
    for k in range(count):
        in_piece = label == k
        turning = np.zeros((0, 2), dtype=np.int64)
        if clamped is not None:
            piece_edges = np.unique(surface.edges.of[in_piece])
            turning = surface.edges.ends[piece_edges[clamped[piece_edges]]]
        free = free_motions(surface.V, np.unique(surface.F[in_piece]), stopped, turning)
        if free:
            which = "the surface" if count == 1 else f"piece {k + 1} of {count}"
            held_vertices = np.flatnonzero(load.supported & np.isin(np.arange(surface.n), surface.F[in_piece]))
            raise StaticsError(
                f"{which} can {' and '.join(dict.fromkeys(free))}: {_support_remedy(surface, held_vertices)}"
                + (_merge_hint(surface) if count > 1 else "")
            )


def _support_remedy(surface: Surface, held_vertices: Ints) -> str:
    if len(held_vertices) >= FEW_VERTICES:
        return "the supports do not prevent this motion; hold more directions at the supports"
    where = " and ".join(str(surface.V[k].round(3).tolist()) for k in held_vertices)
    count = count_phrase(len(held_vertices), "vertex")
    return f"the supports hold only {count}, at {where} m; pick more vertices (if pick = 'side', with a larger depth)"


def _merge_hint(surface: Surface) -> str:
    doubled = coincident(surface.V)
    return f", or merge the {doubled} vertices that coincide with other vertices" if doubled else ""


def free_motions(V: Floats, vertices: Ints, fixed: Bools, clamped: Ints) -> list[str]:
    """Return the names of the rigid motions of `vertices` that the supports allow. clamped : (k, 2) end vertices of
    edges that cannot rotate.    fixed : (n, 3) mask: directions in which each vertex cannot move."""
    at_supports = rigid_motions(V[vertices])[fixed[vertices]]  # (fixed directions, 6)
    along = V[clamped[:, 1]] - V[clamped[:, 0]]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    stopped = np.concatenate([at_supports, np.pad(along, ((0, 0), (3, 0))), np.zeros((6, 6))])
    _, values, basis = np.linalg.svd(stopped, full_matrices=False)
    null = basis[values <= FREE_MOTION * max(values.max(), 1.0)]
    # find rotations first, because a rotation about a line of supports also moves the centre
    mix, turns, _ = np.linalg.svd(null[:, 3:])
    turns = np.concatenate([turns, np.zeros(len(null) - len(turns))]) > FREE_MOTION
    parts = np.abs(mix.T @ null)
    largest = np.where(turns, 3 + parts[:, 3:].argmax(axis=1), parts[:, :3].argmax(axis=1))
    return [MOTIONS[k] for k in sorted(largest)]  # sorted, because the order of equal values depends on the machine


def require_loads_on_faces(surface: Surface, load: LoadCase) -> None:
    """Raise StaticsError if a force acts on a vertex that no face uses."""
    used = np.zeros(surface.n, dtype=bool)
    used[surface.F] = True
    lost = np.flatnonzero(~used & (load.force != 0).any(axis=1))
    if len(lost):
        raise StaticsError(
            f"{len(lost)} loaded vertices belong to no face (first: {first_few(lost)}); move these loads"
        )


def held_on_edges(surface: Surface, elements: Elements, fixed: Bools, clamped: Bools | None) -> Bools:
    """Return a mask (e, k) of the unknowns on edges that supports fix. `elements.on_edges` lists the k unknowns.
    fixed : (n, 3) mask: directions in which each vertex cannot move.    clamped : (e,) mask of clamped edges."""
    faces, held_directions = held_faces(surface, fixed), held_middles(surface, fixed)
    no_rotation = np.zeros(len(held_directions), dtype=bool)
    no_rotation[surface.edges.of[faces.all(axis=1)]] = True
    if clamped is not None:
        no_rotation |= clamped
    bubbles = np.einsum("edx,ex->ed", edge_frames(surface) ** 2, held_directions.astype(float)) > 0.5
    columns = [bubbles[:, BUBBLES.index(name)] if name in BUBBLES else no_rotation for name in elements.on_edges]
    return np.stack(columns, axis=1) if columns else np.zeros((len(held_directions), 0), dtype=bool)


def held_middles(surface: Surface, fixed: Bools) -> Bools:
    """Return a mask (e, 3) of directions in which edge midpoints cannot move. fixed : (n, 3) mask for the vertices."""
    edges, faces = surface.edges, held_faces(surface, fixed)
    is_held = fixed[edges.ends].all(axis=1) & edges.boundary[:, None]
    for axis in range(3):
        is_held[edges.of[faces[:, axis]], axis] = True
    return np.asarray(is_held)


def held_faces(surface: Surface, fixed: Bools) -> Bools:
    """Return a mask (m, 3): directions in which all corners of a face are fixed; False with >= 2 boundary edges."""
    ears = surface.edges.boundary[surface.edges.of].sum(axis=1) >= 2
    return np.asarray(fixed[surface.F].all(axis=1) & ~ears[:, None])


def require_clampable(surface: Surface, elements: Elements, clamped: Bools | None) -> None:
    """Raise StaticsError if `elements` have no edge rotations to clamp. clamped : (e,) mask of clamped edges."""
    if clamped is None:
        return
    if clamped.shape != (len(surface.edges.ends),):
        raise StaticsError(
            f"clamped has the shape {clamped.shape}; it must have one value for each of {len(surface.edges.ends)} edges"
        )
    if elements.bending == "hinge" and clamped.any():
        raise StaticsError(
            f"{clamped.sum()} edges are clamped, but `hinge` bending has no rotations of edges; "
            'choose bending = "midedge" or "hhj"'
        )


def all_clamped(load: LoadCase) -> Bools | None:
    """Return the load case's mask (e,) of edges that cannot rotate, or None if the mask is empty."""
    return load.clamped if len(load.clamped) else None


def with_springs(K: csr_array, load: LoadCase) -> csr_array:
    """Return the stiffness matrix K (u, u), N/m, plus the spring supports of a load case on its diagonal."""
    if not load.spring.any():
        return K
    springs = np.zeros(K.shape[0])
    springs[: load.spring.size] = load.spring.ravel()
    return csr_array(K + diags_array(springs))


@dataclass(frozen=True, eq=False)
class SpreadLoad:
    """A distributed load that is constant on each face and on each edge.
    face : (m, 3) force per area of each face, Pa.    edge : (e, 3) force per length of each edge, N/m."""

    face: Floats
    edge: Floats

    def __post_init__(self) -> None:
        lock_floats(self, face=(None, 3), edge=(None, 3))

    @classmethod
    def broadcast(cls, surface: Surface, face: object = 0.0, edge: object = 0.0) -> Self:
        """Return a load with `face` (Pa) and `edge` (N/m) broadcast (as in NumPy) to the shapes (m, 3) and (e, 3)."""
        shapes = (surface.m, 3), (len(surface.edges.ends), 3)
        return cls(*(np.broadcast_to(np.asarray(v, float), s) for v, s in zip((face, edge), shapes, strict=True)))

    @classmethod
    def total(cls, parts: Mapping[str, Self], factors: Mapping[str, float]) -> Self:
        """Return the sum of the loads `parts`. Each load is multiplied by the factor of the same name, 0 by default."""
        weight = {name: factors.get(name, 0.0) for name in parts}
        face, edge = (
            np.sum([f * getattr(parts[k], field) for k, f in weight.items()], axis=0) for field in ("face", "edge")
        )
        return cls(face, edge)

    def vertex_forces(self, surface: Surface) -> Floats:
        """Return the equivalent nodal forces (n, 3), N, of the distributed load at the vertices."""
        force = np.zeros((surface.n, 3))
        np.add.at(force, surface.F.ravel(), np.repeat(self.face * surface.areas[:, None] / 3, 3, axis=0))
        np.add.at(force, surface.edges.ends.ravel(), np.repeat(self.edge * _lengths(surface) / 2, 2, axis=0))
        return force

    def bubble_forces(self, surface: Surface, elements: Elements) -> Floats:
        """Return the load's forces (e, k), N, on the k unknowns `elements.on_edges` of each edge; 0 for rotations."""
        work = self.edge * _lengths(surface) * 2 / 3
        np.add.at(work, surface.edges.of.ravel(), np.repeat(self.face * surface.areas[:, None] / 3, 3, axis=0))
        in_frame = np.einsum("edx,ex->ed", edge_frames(surface), work)
        forces = np.zeros((len(work), len(elements.on_edges)))
        for k, name in enumerate(elements.on_edges):
            if name in BUBBLES:
                forces[:, k] = in_frame[:, BUBBLES.index(name)]
        return forces


def spread_load(surface: Surface, loads: Sequence[Load], weight: float = 0.0) -> SpreadLoad:
    """Return the sum of all `loads` on faces and lines, without forces at points. weight : sheet's weight, N/m2."""
    face, edge = np.zeros((surface.m, 3)), np.zeros((len(surface.edges.ends), 3))
    for load in loads:
        if isinstance(load, Line):
            edge += load.on_edges(surface)
        elif not isinstance(load, Force):
            face += load.traction(surface, weight)
    return SpreadLoad.broadcast(surface, face, edge)


def _lengths(surface: Surface) -> Floats:
    a, b = (surface.V[surface.edges.ends[:, i]] for i in range(2))
    return np.asarray(np.linalg.norm(b - a, axis=1, keepdims=True))
