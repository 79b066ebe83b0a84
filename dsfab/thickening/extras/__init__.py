"""Extras of a solid: feet, ring beams, holes, trims and splits. Presets list them as `[[thickening.extra]]`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dsfab.core.errors import SolidError
from dsfab.surface.topology import edge_table, euler_characteristic
from dsfab.thickening.extras.bodies import Base
from dsfab.thickening.extras.cutting import Holes, SplitBodies, Trim
from dsfab.thickening.extras.feet_and_rings import Feet, Ring
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.solid import Solid, check_solid

if TYPE_CHECKING:
    import manifold3d

Extra = Feet | Ring | Holes | Trim | SplitBodies


def with_extras(solid: Solid, extras: Sequence[Extra], base: Base) -> Solid:
    """Apply extras (feet, ring beams, holes, ...) to a solid in order. Raises SolidError for an impossible extra."""
    if not extras:
        return solid
    import manifold3d

    body = manifold3d.Manifold(manifold3d.Mesh64(np.array(solid.V), np.array(solid.F, dtype=np.uint64)))
    for extra in extras:
        body = extra.apply(body, base)
        if body.status() != manifold3d.Error.NoError or body.is_empty():
            raise SolidError(f"thickening.extra {extra.kind!r} removes the whole solid; check its sizes and places")
    return _judged_solid(body, solid)


def _judged_solid(body: "manifold3d.Manifold", before: Solid) -> Solid:
    import manifold3d

    total_volume = body.volume()
    parts = [part for part in body.decompose() if abs(part.volume()) > 1e-6 * total_volume]
    body = manifold3d.Manifold.compose(parts)
    mesh = body.to_mesh64()
    V, F = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    notes, repairs = list(before.notes), replace(before.repairs, pairs=0, pairs_at=None)
    if len(pairs := intersecting_pairs(V, F)):
        x, y, z = (float(c) for c in V[F[pairs[0]]].mean(axis=(0, 1)))
        repairs = replace(repairs, pairs=len(pairs), pairs_at=(x, y, z))
        notes.append(
            f"{len(pairs)} pairs of faces intersect in the solid with its [[thickening.extra]] entries, the first "
            f"near ({x:.4g}, {y:.4g}, {z:.4g}) m; slightly change the place or the size of one entry"
        )
    outer = sum(part.volume() > 0 for part in parts)
    result = Solid(V, F, len(parts) - euler_characteristic(F, edge_table(F)) // 2, outer, tuple(notes), repairs)
    check_solid(result)
    return result
