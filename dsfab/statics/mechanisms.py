"""Is the sheet held? Rigid motions that the supports of a piece leave free, named for the person who forgot one."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints, first
from dsfab.errors import StaticsError
from dsfab.limits import FEW_VERTICES
from dsfab.surface import coincident, pieces
from dsfab.surface.loads import LoadCase
from dsfab.surface.mesh import Surface

RANK_TOLERANCE = 1e-9
"""Rigid motions that move the supports by less than this share of the piece's own motion count as free."""

MOTIONS = ("move along x", "move along y", "move along z", "turn about x", "turn about y", "turn about z")


def rigid_motions(points: Floats) -> Floats:
    """(n, 3, 6) displacements of points (n, 3) under the motions of `MOTIONS`, scaled to about unit length."""
    centred = points - points.mean(axis=0)
    reach = np.abs(centred).max() or 1.0
    motion = np.zeros((len(points), 3, 6))
    motion[:, [0, 1, 2], [0, 1, 2]] = 1
    for axis in range(3):
        motion[:, :, 3 + axis] = np.cross(np.eye(3)[axis], centred) / reach
    return motion


def require_held(surface: Surface, load: LoadCase, fixed: Bools, clamped: Bools | None = None) -> None:
    """Raise StaticsError if a piece of the sheet can move without deforming.

    fixed   : (n, 3) freedoms that do not move (the supports, and the normal of a sheet solved in its plane); the
              springs of `load` stop a motion as well.
    clamped : (e,) edges that do not turn about themselves.
    """
    count, label = pieces(surface.F, surface.edges)
    stopped = fixed | (load.spring > 0)
    unheld = [k for k in range(count) if not load.held[surface.F[label == k]].any()]
    if unheld:
        where = surface.centroids[label == unheld[0]].mean(axis=0).round(3).tolist()
        raise StaticsError(
            f"{len(unheld)} of {count} pieces of the surface touch no support (the first is around {where} m); "
            f"support each piece or remove it{_parted(surface)}"
            if count > 1
            else "no vertex of the surface is supported; add a [[surface.support]]"
        )
    for k in range(count):
        mine = label == k
        turning = np.zeros((0, 2), dtype=np.int64)
        if clamped is not None:
            own = np.unique(surface.edges.of[mine])
            turning = surface.edges.ends[own[clamped[own]]]
        free = free_motions(surface.V, np.unique(surface.F[mine]), stopped, turning)
        if free:
            which = "the surface" if count == 1 else f"piece {k + 1} of {count}"
            held = np.flatnonzero(load.held & np.isin(np.arange(surface.n), surface.F[mine]))
            raise StaticsError(
                f"{which} can {' and '.join(dict.fromkeys(free))}: {_remedy(surface, held)}"
                + (_parted(surface) if count > 1 else "")
            )


def _remedy(surface: Surface, held: Ints) -> str:
    """What keeps a piece from moving that is held at these vertices."""
    if len(held) >= FEW_VERTICES:
        return "the supports do not stop it; hold more directions"
    where = " and ".join(str(surface.V[k].round(3).tolist()) for k in held)
    count = "1 vertex" if len(held) == 1 else f"{len(held)} vertices"
    return f"the supports hold only {count} of it, at {where} m; let them pick more (of a side, with depth = ...)"


def _parted(surface: Surface) -> str:
    """What to do where pieces are parted by vertices at the same place; else nothing."""
    doubled = coincident(surface.V)
    return f", or merge its {doubled} vertices that lie where another one does" if doubled else ""


def free_motions(V: Floats, vertices: Ints, fixed: Bools, clamped: Ints) -> list[str]:
    """Names of the rigid motions of `vertices` that no fixed freedom and no clamped edge stops (a basis: shifts and
    turns, each by its largest part).

    clamped : (k, 2) ends of the edges that do not turn about themselves: a turn about w turns edge t by w . t.
    """
    motion = rigid_motions(V[vertices])
    at_supports = motion[fixed[vertices]]  # (number of fixed freedoms, 6)
    along = V[clamped[:, 1]] - V[clamped[:, 0]]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    stopped = np.concatenate([at_supports, np.pad(along, ((0, 0), (3, 0))), np.zeros((6, 6))])
    _, values, basis = np.linalg.svd(stopped, full_matrices=False)
    null = basis[values <= RANK_TOLERANCE * max(values.max(), 1.0)]
    # sort what shifts only from what turns: a turn about a line of supports shifts the centre as well
    mix, turns, _ = np.linalg.svd(null[:, 3:])
    turns = np.concatenate([turns, np.zeros(len(null) - len(turns))]) > RANK_TOLERANCE
    parts = np.abs(mix.T @ null)
    largest = np.where(turns, 3 + parts[:, 3:].argmax(axis=1), parts[:, :3].argmax(axis=1))
    return [MOTIONS[k] for k in sorted(largest)]  # equal values come in an order of their own on each machine


def require_loads_on_faces(surface: Surface, load: LoadCase) -> None:
    """Raise StaticsError if a force acts on a vertex that no face uses."""
    used = np.zeros(surface.n, dtype=bool)
    used[surface.F] = True
    lost = np.flatnonzero(~used & (load.force != 0).any(axis=1))
    if len(lost):
        raise StaticsError(f"{len(lost)} loaded vertices belong to no face (first: {first(lost)}); move these loads")
