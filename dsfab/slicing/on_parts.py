"""Fields on parts of faces, at the vertices of a sheet that was cut."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.slicing.sheet import Sheet
from dsfab.surface import DividedField, Surface


def divided_at_vertices(sheet: Sheet, uncut: Surface, field: DividedField) -> Floats:
    """(n',) or (n', 2) a field that is linear over parts of the faces of `uncut`, at the vertices of a sheet."""
    divided, F = field.divided, sheet.surface.F
    found = sheet.carry(field.at_vertices)
    parts = divided.new()
    order = np.argsort(divided.parent[parts], kind="stable")
    parts = parts[order]
    parents = divided.parent[parts]
    face = np.full(sheet.surface.n, -1)
    inside = np.isin(sheet.parent, parents)
    face[F[inside]] = sheet.parent[inside][:, None]
    vertex = np.flatnonzero(face >= 0)
    at = np.stack([np.asarray(sheet.weights[vertex, uncut.F[face[vertex], c]]).ravel() for c in range(3)], axis=1)
    begin, end = (np.searchsorted(parents, face[vertex], side=side) for side in ("left", "right"))
    count = end - begin
    of = np.repeat(np.arange(len(vertex)), count)
    part = parts[np.repeat(begin - (np.cumsum(count) - count), count) + np.arange(int(count.sum()))]
    own = np.einsum("ki,kij->kj", at[of], np.linalg.inv(divided.corners(part)))
    order = np.lexsort([-own.min(axis=1), of])
    best = order[np.concatenate([[True], np.diff(of[order]) > 0])] if len(order) else order
    corners = field.x[divided.surface.F[part[best]]]
    found[vertex[of[best]]] = np.einsum("kc,kc...->k...", own[best], corners)
    return found
