"""The load case of a cut sheet: what the uncut surface carried, handed to the material that is left."""

import numpy as np
from scipy.spatial import cKDTree

from dsfab.errors import StaticsError
from dsfab.slicing import Sheet
from dsfab.surface import LoadCase, Surface

REACH = 0.1
"""Loads are handed over this share of the surface's size at most: further away, nothing carries them."""


def sheet_load(surface: Surface, sheet: Sheet, load: LoadCase) -> LoadCase:
    """The supports and loads of the uncut surface on a kept sheet of it.

    Supports hold what is left of them. A force on a vertex that the sheet still has stays there; any other goes to the
    nearest vertex of the sheet, so that resultants are kept exactly and moments up to the distance moved.

    Raises StaticsError when no supported vertex is left, or when a load finds no material near it.
    """
    fixed = sheet.between(load.fixed)
    if not fixed.any():
        raise StaticsError("no supported vertex is left on the sheet; set pattern.keep to protect the supports")
    acting = np.flatnonzero((load.force != 0).any(axis=1))
    at = sheet.same_vertex()[acting]
    lost = at < 0
    if lost.any():
        found = cKDTree(sheet.surface.V).query(surface.V[acting[lost]])
        moved, at[lost] = np.asarray(found[0]), np.asarray(found[1])
        if moved.max() > REACH * surface.size:
            place = surface.V[acting[lost][moved.argmax()]].round(3).tolist()
            raise StaticsError(
                f"the load at {place} m finds no material within {moved.max():.3g} m; set pattern.keep to protect loads"
            )
    force = np.zeros((sheet.surface.n, 3))
    np.add.at(force, at, load.force[acting])
    return LoadCase(fixed, force, sheet.between(load.loaded))
