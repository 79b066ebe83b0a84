"""`Chart`: a divided surface on which two phases have one value at each vertex: what pictures and measures look at."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from dsfab.arrays import Floats, Ints, grouped, lock, sorted_order
from dsfab.slicing.cut import filled_polygons
from dsfab.slicing.halving import Halved
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.seen import Seen
from dsfab.surface import Surface
from dsfab.surface.corner_field import CornerField

SAME = 2.0**-30
"""Phases that differ by less, in periods, are those of one vertex."""


@dataclass(frozen=True, eq=False)
class Chart:
    """A surface cut open where phases do not fit together; stripes are where a phase is near a whole number.

    surface : the same sheet on vertices of its own (n', m').    parent : (m',) face of the uncut surface (n, m).
    weights : (n', n) barycentric weights on the uncut vertices.
    z       : (n', 2) phases of both families in periods of the lines that are drawn there.
    scale   : (n', 2) periods of that in a period of the finest lines; 0 where there is no phase.
    """

    surface: Surface
    parent: Ints
    weights: csr_array
    z: Floats
    scale: Floats

    def __post_init__(self) -> None:
        lock(self, "z", np.float64, (self.surface.n, 2))
        lock(self, "scale", np.float64, (self.surface.n, 2))

    def carry(self, x: Floats) -> Floats:
        """Values (n, ...) at the uncut vertices, interpolated to this sheet's (n', ...)."""
        return np.asarray(self.weights @ x)


def chart_of(halved: Halved, phases: tuple[CornerField, CornerField] | None = None) -> Chart:
    """The chart of a surface that was divided where stripes are halved.

    phases : the fields (n, 1) that were halved, as they were: lines are drawn where they are cut, not where they were
             moved to so that openings end well; left out, they are drawn there.
    """
    mesh, phases = halved.mesh, phases or halved.phases
    surface, cell = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    slot = _slots(mesh, surface.F, cell)
    z, scale = np.empty((2, 3 * surface.m, 2))
    for k, phase in enumerate(phases):
        seen = Seen.of(mesh, phase)
        scale[:, k] = np.where(seen.blank, 0.0, 0.5 ** halved.level[mesh.cells.owner, k])[slot]
        z[:, k] = np.where(seen.blank, 0.5, seen.slots(0))[slot] * np.where(scale[:, k] > 0, scale[:, k], 1.0)
    flat = surface.F.ravel()
    first, of = _alike(flat, np.rint(np.concatenate([z, scale], axis=1) / SAME))
    own = Surface(surface.V[flat[first]], of.reshape(-1, 3))
    return Chart(own, mesh.parent[cell], mesh.weights[flat[first]], z[first], scale[first])


def _alike(key: Ints, rows: Floats) -> tuple[Ints, Ints]:
    """The first of all things (k,) that have the same key and row (k, r) of whole numbers, and the group of each.

    Nearly all with one key are alike: only those that differ from the first of it are sorted by their rows.
    """
    order, begins, of = grouped(key)
    lead = order[begins][of]
    other = np.flatnonzero((rows != rows[lead]).any(axis=1))
    lead = lead.copy()
    if len(other):
        table = np.column_stack([key[other], rows[other]])
        _, at, group = np.unique(table, axis=0, return_index=True, return_inverse=True)
        lead[other] = other[at][group.ravel()]
    leads = np.flatnonzero(lead == np.arange(len(key)))
    place = np.empty(len(key), dtype=np.int64)
    place[leads] = np.arange(len(leads))
    return leads, place[lead]


def _slots(mesh: PolygonMesh, F: Ints, cell: Ints) -> Ints:
    """(3 m',) the slot of each corner of triangles F (m', 3) in their polygons (m',)."""
    n = len(mesh.X)
    key = mesh.cells.owner * n + mesh.cells.corner
    order = sorted_order(key)
    wanted = (cell[:, None] * n + F).ravel()
    return np.asarray(order[np.searchsorted(key[order], wanted)])
