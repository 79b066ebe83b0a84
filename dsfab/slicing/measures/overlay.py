"""Overlay: a finished sheet that is divided along the edges of all stripes.

A cut makes the stripes of one field after another. The overlay also divides crossings:

     |     |              |     |
-----+     +-----    -----+-----+-----     The cell * of the crossing is now a part of both members.
     |     |     ->       |  *  |
-----+     +-----    -----+-----+-----
     |     |              |     |

Material that finishing added (fillets, bridges, filled openings) belongs to no stripe."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from dsfab.core.arrays import Bools, Floats, Ints, lock
from dsfab.core.limits import SAME_PHASE
from dsfab.slicing.cutting.cells import TIP, Cells, nearest_levels
from dsfab.slicing.cutting.corner_fields import PolygonField, corner_band
from dsfab.slicing.cutting.cut import filled_polygons
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import VOID, Sheet
from dsfab.surface import CornerField, Surface, link_components


@dataclass(frozen=True, eq=False)
class DrawnBand:
    """Stripes of a field of a cut. Each stripe has a level, which lies between the field's two values in the stripe.
    family : name. Fields of the same family do not cross.
    field  : the two values at corners of the uncut surface, or (n', 2) at the vertices of the material sheet.
    levels : (k,) level of each stripe, ascending.
    centre : mean of the field's two values on a stripe's middle line, minus the stripe's level.
    hides  : True for stripes in front: at crossings, only earlier fields with `hides` = True cover these stripes."""

    family: str
    field: CornerField | Floats
    levels: Floats
    centre: float = 0.0
    hides: bool = False


@dataclass(frozen=True, eq=False)
class Overlay:
    """A material sheet with the stripes of each cell. Cells are also divided along stripe edges inside crossings.
    sheet  : m cells, all material. `family` is the field that made each cell.
    source : (m,) cell of the sheet before this division.
    part   : (m, f) for each of f fields, the stripe that contains the cell; -1 for none.
    of     : (count,) field of each stripe.    level : (count,) level of each stripe.
    own    : (m,) True if the cell lies in a stripe of the field that made the cell.
    offset : (m, 3, f) field at the corners, minus the value on the stripe's middle line; never 0."""

    sheet: Sheet
    source: Ints
    part: Ints
    of: Ints
    level: Floats
    own: Bools
    offset: Floats

    def __post_init__(self) -> None:
        m, f = self.sheet.surface.m, self.part.shape[1]
        lock(self, "source", np.int64, (m,))
        lock(self, "part", np.int64, (m, f))
        lock(self, "of", np.int64, (None,))
        lock(self, "own", np.bool_, (m,))
        lock(self, "offset", np.float64, (m, 3, f))

    @cached_property
    def adjacent_cells(self) -> Ints:
        """(p, 2) pairs of cells that share an edge."""
        return np.asarray(self.sheet.surface.edges.pairs // 3)


def stripe_overlay(sheet: Sheet, uncut: Surface, bands: Sequence[DrawnBand], snap: float = 0.05) -> Overlay:
    """Divide a material sheet, cut from the surface `uncut`, along the edges of all stripes.
    bands : stripes of each field of the cut, in order.
    snap  : largest move of a stripe edge onto a vertex, as a fraction of a cell's side."""
    base = sheet.surface
    fields = [_on_sheet(sheet, uncut, band.field) for band in bands]
    mesh = PolygonMesh.from_surface(base).with_lines_of(sheet)
    tip = min(max(snap, SAME_PHASE), TIP)
    for k, band in enumerate(bands):
        hidden = _hidden_cells(sheet.family, bands, k)
        mesh = replace(mesh, family=np.where(hidden[mesh.parent], VOID, 0))
        mesh, _ = corner_band(mesh, fields[k], band.levels, (snap, tip), base.size, np.zeros((1, 2), dtype=np.int64))
    surface, cell, sides_on = filled_polygons(mesh.cells, mesh.X, mesh.parent)
    source = mesh.parent[cell]
    family = sheet.family[source]
    weights = csr_array(mesh.weights @ sheet.weights)
    triangles, void = Cells.triangles(surface.F), np.full(surface.m, VOID)
    divided_base = PolygonMesh.from_cells(base.F, triangles, surface.V, mesh.weights, source, void)
    stripes = [_BandOnCells.from_band(divided_base, x, band) for x, band in zip(fields, bands, strict=True)]
    divided = Sheet(surface, sheet.parent[source], family, weights, 0, sides_on, sheet.lines)
    return _labelled_overlay(divided, source, stripes, bands)


def _on_sheet(sheet: Sheet, uncut: Surface, field: CornerField | Floats) -> CornerField:
    m = sheet.surface.m
    if not isinstance(field, CornerField):
        return CornerField(field, np.ones((m, 3)), np.zeros((m, 3)), np.zeros(m, dtype=bool))
    cells = Cells.triangles(sheet.surface.F)
    mesh = PolygonMesh.from_cells(uncut.F, cells, sheet.surface.V, sheet.weights, sheet.parent, sheet.family)
    seen = PolygonField.from_field(mesh, field)
    return CornerField(seen.values, seen.sign.reshape(-1, 3), seen.shift.reshape(-1, 3), field.blank[sheet.parent])


def _hidden_cells(family: Ints, bands: Sequence[DrawnBand], k: int) -> Bools:
    covers = np.array([band.family != bands[k].family and (band.hides or not bands[k].hides) for band in bands])
    covers &= ~np.array([bands[k].hides]) | (np.arange(len(bands)) < k)
    return np.asarray(covers[family])


@dataclass(frozen=True, eq=False)
class _BandOnCells:
    """Values of a field and the nearest level on each triangle, for the stripes of the field."""

    F: Ints
    z: Floats
    d: Floats
    number: Floats
    off: Floats
    sign: Floats
    shift: Floats
    blank: Bools

    @classmethod
    def from_band(cls, mesh: PolygonMesh, field: CornerField, band: DrawnBand) -> "_BandOnCells":
        seen = PolygonField.from_field(mesh, field)
        upper, lower = (seen.slot_values(side).reshape(-1, 3) for side in (0, 1))
        z = (upper + lower) / 2
        number = nearest_levels(z.mean(axis=1), band.levels) if len(band.levels) else np.full(len(z), np.inf)
        distance = np.abs(z.mean(axis=1) - number)
        sign, shift = seen.sign.reshape(-1, 3), seen.shift.reshape(-1, 3)
        F = mesh.cells.corner.reshape(-1, 3)
        half, blank = ((upper - lower) / 2).mean(axis=1), field.blank[mesh.parent]
        return cls(F, z - band.centre, half, number, distance, sign, shift, blank)

    def inside(self, slack: Floats) -> Bools:
        """Return a mask (m,) of triangles with the centroid in a stripe. slack : (m,) added half width."""
        return np.asarray((self.off < self.d + slack) & ~self.blank & np.isfinite(self.number))

    def links(self, pairs: Ints) -> Bools:
        """Return a mask (p,) of adjacent triangles with the same nearest level. pairs : (p, 2) common half-edges."""
        h, g = pairs.T
        flat = self.F.ravel()
        g = np.where(flat[g] == flat[h], g, g - g % 3 + (g + 1) % 3)  # corner of g's cell at the first vertex of h
        sign = self.sign.ravel()[h] * self.sign.ravel()[g]
        shift = self.shift.ravel()[h] - sign * self.shift.ravel()[g]
        return np.asarray(np.abs(self.number[h // 3] - (sign * self.number[g // 3] + shift)) < SAME_PHASE)

    def offsets(self, in_stripe: Bools) -> Floats:
        """Return the field (m, 3) at triangle corners, minus the value on the stripe's middle line; never 0.
        Triangles outside `in_stripe` (m,) get NaN."""
        offset = np.where(in_stripe[:, None], self.z - np.where(in_stripe, self.number, 0.0)[:, None], np.nan)
        zero = np.abs(offset) < SAME_PHASE
        offset[zero] = 0.0
        row, corner = np.nonzero(zero)
        vertex, sign = self.F[row, corner], self.sign[row, corner]
        other_corners = offset[row, (corner + 1) % 3] + offset[row, (corner + 2) % 3]
        if not len(row):
            return offset
        total = np.bincount(vertex, sign * other_corners, int(vertex.max()) + 1)
        offset[row, corner] = np.where(total[vertex] > 0, -SAME_PHASE, SAME_PHASE) * sign
        return offset


def _labelled_overlay(sheet: Sheet, source: Ints, stripes: list[_BandOnCells], bands: Sequence[DrawnBand]) -> Overlay:
    m, count = sheet.surface.m, 0
    part, offset = np.full((m, len(bands)), -1), np.full((m, 3, len(bands)), np.nan)
    in_own_band, field_of_stripe, level = np.zeros(m, dtype=bool), list[int](), list[float]()
    reach = [_value_ranges(stripe_values.z, source) for stripe_values in stripes]
    for k, stripe_values in enumerate(stripes):
        own_cells = sheet.family == k
        in_own_band |= own_cells & stripe_values.inside(0.1 * reach[k])  # allows for edges that the cut moved
    taken = {band.family: np.zeros(m, dtype=bool) for band in bands}
    for k, band in enumerate(bands):
        taken[band.family] |= in_own_band & (sheet.family == k)
    pairs = sheet.surface.edges.pairs
    for k, stripe_values in enumerate(stripes):
        own_cells = in_own_band & (sheet.family == k)
        covered = _hidden_cells(sheet.family, bands, k) & ~taken[bands[k].family] & stripe_values.inside(np.zeros(m))
        in_stripe = own_cells | covered
        f, g = pairs.T // 3
        joined = in_stripe[f] & in_stripe[g] & stripe_values.links(pairs)
        total, label = link_components(m, f[joined], g[joined])
        real = np.bincount(label, own_cells, total) > 0
        in_stripe &= real[label]
        taken[bands[k].family] |= in_stripe
        stripe_labels, label = np.unique(label[in_stripe], return_inverse=True)
        part[in_stripe, k] = count + label.ravel()
        field_of_stripe += [k] * len(stripe_labels)
        level += _dominant_levels(label.ravel(), stripe_values.number[in_stripe], sheet.surface.areas[in_stripe])
        offset[:, :, k] = stripe_values.offsets(in_stripe)
        count += len(stripe_labels)
    return Overlay(sheet, source, part, np.array(field_of_stripe, dtype=np.int64), np.array(level), in_own_band, offset)


def _value_ranges(z: Floats, source: Ints) -> Floats:
    top, bottom = np.full(int(source.max()) + 1, -np.inf), np.full(int(source.max()) + 1, np.inf)
    np.maximum.at(top, source, z.max(axis=1))
    np.minimum.at(bottom, source, z.min(axis=1))
    return np.asarray((top - bottom)[source])


def _dominant_levels(label: Ints, number: Floats, area: Floats) -> list[float]:
    values, which = np.unique(number, return_inverse=True)
    total = np.zeros((int(label.max(initial=-1)) + 1, len(values)))
    np.add.at(total, (label, which.ravel()), area)
    return [float(x) for x in values[total.argmax(axis=1)]] if len(values) else []
