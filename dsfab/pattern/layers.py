"""Layers of a pattern: fields and levels of stripes, and the fraction of material."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import NamedTuple, Protocol, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.limits import CROWDING, SLIT
from dsfab.core.sparse import one_blas_thread
from dsfab.pattern.phases import CornerPhase
from dsfab.pattern.stripes import Stripes
from dsfab.pattern.widths import SOLID, Widths, slopes, solved_factor
from dsfab.surface.fields import CornerField, DividedField
from dsfab.surface.mesh import Surface


class Layer(NamedTuple):
    """Values on the surface, and levels of these values that divide material from openings.
    field      : values (n,): a point is material if an odd number of levels is below its value. Values (n, 2): a
                 point is material if a level lies between its second and its first value.
    half_width : (n,) half widths of stripes, in periods.
    closed     : (n,) or None. An opening becomes material if the mean of these values in it is positive."""

    name: str
    field: Floats | CornerField | DividedField
    levels: Floats
    half_width: Floats
    closed: Floats | None = None


@dataclass(frozen=True, eq=False)
class ModeFamily:
    """Stripes along level lines of an eigenmode x (n,). slope : (n,) stripes per metre."""

    name: str
    stripes: Stripes
    x: Floats
    slope: Floats
    stress: Floats

    @classmethod
    def from_mode(
        cls, surface: Surface, name: str, stripes: Stripes, x: Floats, stress: Floats | None = None, radius: float = 0.0
    ) -> "ModeFamily":
        """Return the stripes on an eigenmode x (n,). stress : (n,) size of the stress along the stripes, default 1.
        radius : radius (m) of the disc over which stripes per metre are averaged."""
        stress = np.ones(surface.n) if stress is None else stress
        return cls(name, stripes, x, slopes(surface, stripes.phases(x), radius), stress)

    def with_stress(self, stress: Floats) -> Self:
        return replace(self, stress=stress)

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """Return half widths (n,) of the stripes, in periods. factor : factor on half widths, before limits apply."""
        return widths.half_widths(self.stripes.half_width, self.slope, self.stress, factor)

    adds = 0  # no effect, because stripes on a mode add no finer stripes

    @property
    def density(self) -> Floats:
        """Stripes per metre (n,)."""
        return self.slope

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """Return a list of one layer with all stripes. `closing` has no effect."""
        d = self.half_widths(widths, factor)
        if widths.vary:
            return [Layer(self.name, self.stripes.band(self.x, d), self.stripes.middles(self.x), d)]
        return [Layer(self.name, self.x, self.stripes.with_width_factor(factor).levels(self.x), d)]


class DrawableFamily(Protocol):
    """Interface of families of stripes.
    density : (n,) stripes per metre.    adds : place in the order in which families add finer stripes; 0 is first."""

    @property
    def adds(self) -> int: ...

    @property
    def name(self) -> str: ...

    @property
    def stripes(self) -> Stripes: ...

    @property
    def density(self) -> Floats: ...

    @property
    def stress(self) -> Floats: ...

    def with_stress(self, stress: Floats) -> Self:
        """Return a copy of the family with another stress (n,)."""
        ...

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """Return half widths (n,) of the stripes, in periods. factor : factor on half widths, before limits apply."""
        ...

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """Return the layers: first coarse stripes, then finer stripes in the openings.
        closing : factor on the half widths that decides which openings are filled; 0: use `factor`."""
        ...


def stripe_layers(
    families: Sequence[DrawableFamily], widths: Widths, factor: float = 1.0, closing: float = 0.0
) -> list[Layer]:
    """Return the layers of all families: first coarse stripes, then finer stripes in the openings."""
    family_layers = [(family.adds, family.layers(widths, factor, closing)) for family in families]
    return [layers[0] for _, layers in family_layers] + [
        layer for _, layers in sorted(family_layers, key=itemgetter(0)) for layer in layers[1:]
    ]


def mean_duty_factor(surface: Surface, families: Sequence[DrawableFamily], widths: Widths) -> float:
    """Return the factor on half widths that makes their mean equal to the mean of the width rule `plain`.
    Raises PatternError if too little of the surface is stressed."""
    free = Widths(widths.rule, widths.member, widths.q)

    def duty(factor: float) -> float:
        means = [surface.vertex_areas @ family.half_widths(free, factor) for family in families]
        return float(2 * sum(means) / (len(families) * surface.area))

    return solved_factor(duty, float(np.mean([2 * family.stripes.half_width for family in families])), 1e-9)


CLOSING_WIDTHS = (1.45, 1.55)
"""Two limits of half widths, as multiples of the crowded half width: max(`SLIT`, `CROWDING` x median half width).
Up to the first limit, half widths are cut to the crowded half width, so that openings stay. Above the second limit,
neighbouring members merge. For openings that are filled as a whole (see `Layer.closed`), the limit is `WHOLE`."""
FOLLOWING_WIDTHS = (1.15, 1.25)
"""Limits in place of `CLOSING_WIDTHS` if widths follow stress; lower, because large stress needs material."""
WHOLE = 1.3
"""An opening is filled if the mean half width in it is over WHOLE x the crowded half width (see `CLOSING_WIDTHS`).
If widths follow the stress, the factor is the mean of the two `FOLLOWING_WIDTHS` instead of `WHOLE`."""
WIDTH_RULES = {
    "solid": SOLID,
    "open": SLIT,
    "closer": CROWDING,
    "closing": CLOSING_WIDTHS,
    "following": FOLLOWING_WIDTHS,
}
"""Limits of stripe widths for the page of the editor, which shows widths while the user moves a slider."""


@dataclass(frozen=True, eq=False)
class EvenFamily:
    """Evenly spaced stripes, with centre lines where a phase is a whole number. A halving removes every second line
    in a part of the surface.
    wanted  : for each halving, the fraction (m,) of each face in which no lines are removed.
    slope   : (n,) lines per metre before halvings.    density : (n,) remaining lines per metre.
    whole   : True to fill whole openings between members that are too close, False to fill narrow parts only."""

    name: str
    stripes: Stripes
    phase: CornerPhase
    wanted: tuple[Floats, ...]
    slope: Floats
    density: Floats
    stress: Floats
    adds: int = 0
    whole: bool = False

    def with_stress(self, stress: Floats) -> Self:
        return replace(self, stress=stress)

    def half_widths(self, widths: Widths, factor: float = 1.0) -> Floats:
        """Return half widths (n,) of stripes, divided by the distance between the centre lines after halvings.
        factor : factor on the half widths, before narrow gaps are closed."""
        return self._closed_half_widths(self._requested_half_widths(widths, factor), widths)

    def layers(self, widths: Widths, factor: float = 1.0, closing: float = 0.0) -> list[Layer]:
        """Return a layer of the stripes that remain after all halvings, then a layer of stripes for each halving."""
        requested = self._requested_half_widths(widths, factor)
        local = self._closed_half_widths(requested, widths)
        opened, closed = local, None
        if self.whole and widths.rule != "plain":
            requested = self._requested_half_widths(widths, closing) if closing else requested
            closed = requested / self._crowded_half_width(requested) - (
                float(np.mean(FOLLOWING_WIDTHS)) if widths.follow_stress else WHOLE
            )
            opened = self._open_half_widths(self._requested_half_widths(widths, factor), widths)
        z, c = self.phase.value, len(self.wanted)
        d = finest_half_widths(opened, self.slope, self.density, c)
        band = np.stack([z + d, z - d], axis=1)
        layers = [Layer(self.name, self._field(band, None), self._levels(2**c, 0, d), local, closed)]
        for level in range(c - 1, -1, -1):
            field = self._field(band, self.wanted[level])
            layers.append(Layer(self.name, field, self._levels(2 ** (level + 1), 2**level, d), local))
        return layers

    def _requested_half_widths(self, widths: Widths, factor: float) -> Floats:
        """Return half widths (n,) before narrow gaps are closed, divided by the distance between centre lines."""
        rule = replace(widths, min_gap=0.0) if widths.rule != "plain" else widths
        return rule.half_widths(self.stripes.half_width, self.density, self.stress, factor)

    def _crowded_half_width(self, requested: Floats) -> float:
        return max(SLIT, CROWDING * float(np.median(requested)))

    def _open_half_widths(self, requested: Floats, widths: Widths) -> Floats:
        d = np.minimum(requested, self._crowded_half_width(requested))
        return np.where(d + self.density * (widths.min_gap / 2) > SOLID, SOLID, d)  # fills gaps under `min_gap`

    def _closed_half_widths(self, requested: Floats, widths: Widths) -> Floats:
        if widths.rule == "plain":
            return requested
        crowded = self._crowded_half_width(requested)
        ratios = FOLLOWING_WIDTHS if widths.follow_stress else CLOSING_WIDTHS
        d = np.interp(requested, np.array([0, 1, *ratios]) * crowded, [0, crowded, crowded, SOLID])
        return np.where(d + self.density * (widths.min_gap / 2) > SOLID, SOLID, d)

    def _field(self, band: Floats, line_shares: Floats | None) -> CornerField:
        phase = self.phase
        return CornerField(band, phase.sign, phase.shift, phase.singular, line_shares)

    def _levels(self, period: int, offset: int, d: Floats) -> Floats:
        phase = self.phase
        seen = np.abs(phase.value).max() + np.abs(phase.shift[~phase.singular]).max(initial=0.0) + d.max()
        count = np.ceil(seen / period) + 1
        return np.asarray(offset + period * np.arange(-count, count + 1))


def finest_half_widths(local: Floats, slope: Floats, density: Floats, halvings: int) -> Floats:
    """Return half widths (n,) of stripes, divided by the distance of centre lines before halvings.
    local : half widths, divided by the distance of centre lines after halvings.
    slope, density : (n,) centre lines per metre before and after halvings."""
    return np.asarray(np.where(local >= SOLID, SOLID * 2**halvings, local * slope / density))


def face_points(side: int = 3) -> Floats:
    r"""Return barycentric coordinates (side^2, 3): the centroids of equal triangles that divide a face.
    side = 2:    .         three upright triangles, and one upside down
                /_\
               /_\/_\
    """
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    upright, inverted = i + j < side, i + j < side - 1
    thirds = [np.stack([i[mask], j[mask]], axis=1) + shift for mask, shift in ((upright, 1 / 3), (inverted, 2 / 3))]
    a, b = np.concatenate(thirds).T / side
    return np.stack([a, b, 1 - a - b], axis=1)


def material_points(surface: Surface, layers: Sequence[Layer], points: Floats) -> Bools:
    """Return a mask (m, p) of the points in each face that lie in material. points : (p, 3) barycentric coordinates."""
    is_material = np.zeros((surface.m, len(points)), dtype=bool)
    for layer in layers:
        below = [np.searchsorted(layer.levels, x) for x in _point_values(surface, layer.field, points)]
        if isinstance(layer.field, CornerField):
            is_material |= (below[0] > below[1]) & _is_drawn(layer.field)[:, None]
            if layer.closed is not None:  # only an estimate: the cut fills or keeps each opening as a whole
                is_material |= (layer.closed[surface.F] @ points.T > 0) & ~layer.field.blank[:, None]
            continue
        is_material |= below[0] % 2 == 1 if len(below) == 1 else below[0] > below[1]
    return is_material


def _point_values(surface: Surface, field: Floats | CornerField | DividedField, points: Floats) -> list[Floats]:
    if isinstance(field, DividedField):
        return [column.at_points(points) for column in field.columns]
    return [np.asarray(x @ points.T) for x in _corner_values(surface, field)]


def _corner_values(surface: Surface, field: Floats | CornerField) -> list[Floats]:
    if isinstance(field, CornerField):
        seen = field.corners(surface.F)
        return [seen[..., k] for k in range(seen.shape[2])]
    return [x[surface.F] for x in field.reshape(surface.n, -1).T]


def _is_drawn(field: CornerField) -> Bools:
    return ~field.blank if field.wanted is None else ~field.blank & (field.wanted > 0.5)


def counted_share(surface: Surface, kept_layers: Sequence[Layer], side: int = 3) -> Callable[[Sequence[Layer]], float]:
    """Return a function that estimates the fraction of the surface that layers cover.
    The argument of the function is a list of layers that begins with `kept_layers`."""
    points = face_points(side)
    kept_points = material_points(surface, kept_layers, points)

    def share(layers: Sequence[Layer]) -> float:
        with one_blas_thread():  # for narrow matrices, two threads take sixty times as long
            stripes = material_points(surface, layers[len(kept_layers) :], points)
        return float((kept_points | stripes).mean(axis=1) @ surface.areas / surface.area)

    return share
