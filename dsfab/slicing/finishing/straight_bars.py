"""Replace uneven bars (pieces of members) by straight or evenly bent bars, at nodes and near singular points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, split_value
from dsfab.slicing.cutting.cut import Field, adjacent_faces
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh, adjacent_sides
from dsfab.slicing.cutting.sheet import VOID, LineKind
from dsfab.slicing.cutting.split import Snapping, clean_split
from dsfab.slicing.finishing.loose_ends import CLOSED, Tidy, between_crossings, nodes_of
from dsfab.slicing.finishing.stubs import with_crossings
from dsfab.surface import Surface, link_components
from dsfab.surface.fields import CornerField


@dataclass(frozen=True, eq=False)
class FairBar:
    """The new shape of a bar (piece of a member): straight or evenly bent.
    cells : (c,) polygons of the old bar.    ends : (2, 3) middles of the contacts with further material, metres.
    across, normal : (3,) unit vectors.    half : (2,) half widths, metres.
    bow   : (2,) a, b: at the fraction t of the length, the middle line is t (1 - t) (a + b t) metres to the left."""

    cells: Bools
    ends: Floats
    across: Floats
    normal: Floats
    half: tuple[float, float]
    bow: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def straight(cls, mesh: PolygonMesh, cells: Bools) -> Self | None:
        """Return a straight bar in place of the polygons `cells` (c,).
        Returns None unless the bar has two contacts with further material, roughly at right angles."""
        contacts = _contacts(mesh, cells)
        if len(contacts) != 2:
            return None
        ends, step = contacts.mean(axis=1), np.diff(contacts, axis=1)[:, 0]
        spoke, ahead = (mesh.X[vertices] - ends[0] for vertices in mesh.cells.sides(cells))
        normal = np.cross(spoke, ahead).sum(axis=0)
        normal /= np.linalg.norm(normal)
        axis = ends[1] - ends[0]
        tiny = np.finfo(float).tiny  # avoids NaN for a bar that ends where it begins
        across = np.cross(normal, axis / max(float(np.linalg.norm(axis)), tiny))
        across /= max(float(np.linalg.norm(across)), tiny)
        widths, lengths = np.abs(step @ across), np.linalg.norm(step, axis=1)
        if (widths < 0.4 * lengths).any():  # an end of the bar is oblique to its axis
            return None
        return cls(cells, ends, across, normal, (float(widths.min()) / 2,) * 2)

    def with_bow(self, mesh: PolygonMesh) -> Self | None:
        """Return the bar with a curved middle line, or None if no such bar fits."""
        start, end = _walls(mesh, self.cells)
        t, y = self._places((start + end) / 2)
        ahead = (end - start) @ np.cross(self.across, self.normal)
        side = np.where(ahead > 0, -1, 1)  # -1 on the right, because walls run along the axis there; 1 on the left
        between_ends, weight = (t > 0) & (t < 1), np.sqrt(np.abs(ahead))
        basis = np.stack([t * (1 - t), t**2 * (1 - t), side * (1 - t), side * t], axis=1)
        equations = (basis * weight[:, None])[between_ends], (y * weight)[between_ends]
        (a, b, *half), *_ = np.linalg.lstsq(*equations, rcond=None)
        bowed = replace(self, bow=(float(a), float(b)), half=(float(half[0]), float(half[1])))
        steepest = np.abs(bowed._bow_at(np.linspace(0, 1, 21))[1]).max()
        return bowed if steepest < 1 and min(half) > 0 else None

    @property
    def width(self) -> float:
        """Mean width, metres."""
        return sum(self.half)

    def heights(self, X: Floats) -> Floats:
        """Return distances (2, k) of points X (k, 3) from the two sides of the bar, metres; positive inside the bar."""
        t, y = self._places(X)
        t = np.clip(t, 0, 1)
        middle, slope = self._bow_at(t)
        half = self.half[0] + (self.half[1] - self.half[0]) * t
        return np.array([half + y - middle, half - y + middle]) / np.hypot(1, slope)

    def near_length(self, X: Floats) -> Bools:
        """Return a mask (k,) of points X (k, 3) between the bar's ends, or at most a bar width beyond an end."""
        beyond = self.width / self.length
        t, _ = self._places(X)
        return np.asarray((t > -beyond) & (t < 1 + beyond))

    def deviation(self, mesh: PolygonMesh) -> float:
        """Return the largest distance from corners of the old bar to the new bar, divided by the bar's width."""
        corners = np.unique(mesh.cells.corner[self.cells[mesh.cells.owner]])
        return float(-self.heights(mesh.X[corners]).min()) / self.width

    @property
    def length(self) -> float:
        """Distance between the ends of the bar, metres."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    def _places(self, X: Floats) -> tuple[Floats, Floats]:
        """Return positions (k,) of points X (k, 3) along the bar, 0 to 1, and metres (k,) to the left of its axis."""
        away = X - self.ends[0]
        return away @ (self.ends[1] - self.ends[0]) / self.length**2, away @ self.across

    def _bow_at(self, t: Floats) -> tuple[Floats, Floats]:
        (a, b), parabola = self.bow, t * (1 - t)
        return parabola * (a + b * t), ((1 - 2 * t) * (a + b * t) + parabola * b) / self.length


def _walls(mesh: PolygonMesh, bar: Bools) -> tuple[Floats, Floats]:
    in_bar, beyond = bar[mesh.cells.owner], mesh.polygon_across
    wall = np.flatnonzero(in_bar & (beyond >= 0) & mesh.void[beyond])
    return mesh.X[mesh.cells.corner[wall]], mesh.X[mesh.cells.next_values(mesh.cells.corner)[wall]]


def _contacts(mesh: PolygonMesh, bar: Bools) -> Floats:
    """Return start and end (k, 2, 3), metres, of each line where a bar touches material; empty if unsuitable."""
    cells, in_bar, beyond = mesh.cells, bar[mesh.cells.owner], mesh.polygon_across
    contact_slots = np.flatnonzero(in_bar & (beyond >= 0) & ~mesh.void[beyond] & ~bar[beyond])
    if (in_bar & (beyond < 0)).any() or not len(contact_slots):
        return np.empty((0, 2, 3))
    start, end = cells.corner[contact_slots], cells.next_values(cells.corner)[contact_slots]
    touching = adjacent_sides(np.zeros_like(contact_slots), np.stack([start, end], axis=1), len(mesh.X))
    count, place = link_components(len(contact_slots), *touching)
    contacts = []
    for k in range(count):
        a, b = start[place == k], end[place == k]
        begins, finishes = np.setdiff1d(a, b), np.setdiff1d(b, a)
        if len(begins) != 1 or len(finishes) != 1:  # the contact is a closed ring, or two contacts touch each other
            return np.empty((0, 2, 3))
        contacts.append(mesh.X[[begins[0], finishes[0]]])
    return np.array(contacts)


ASKEW = 0.25  # Smallest `deviation` at which a straight new bar replaces an old bar.
UNEVEN = 0.12  # Smallest `deviation` at which an evenly bent bar replaces an old bar.
FAR = 1.5  # Largest `deviation` at which a new bar replaces an old bar.
SNAP = 0.02  # Largest distance at which a vertex moves onto a bar's side, divided by the bar's width.
LARGER = 2.5  # A bar is replaced only if its area changes by less than this factor.


def with_straight_bars(
    mesh: PolygonMesh, surface: Surface, fields: Sequence[Field], tidy: Tidy
) -> tuple[PolygonMesh, int]:
    """Straighten bars through nodes, and bend bars near singular points evenly. Return also the number of new bars.
    Node : material that joins ends of stripes."""
    nodes = nodes_of(mesh) | ((mesh.also == CLOSED) & ~mesh.void)
    near_singular, count = _near_singular(mesh, surface, fields), 0
    if not (nodes | near_singular).any() or not mesh.void.any():
        return mesh, count
    bars = _askew_bars(mesh, nodes, near_singular, tidy)
    mark = np.full(len(nodes), -1)
    for k, bar in enumerate(bars):
        mark[bar.cells] = k
    for k, bar in enumerate(bars):
        better, label = _with_fair_bar(mesh, mark == k, bar, surface.size)
        if better is not None:
            mesh, mark, count = better, mark[label], count + 1
    return mesh, count


def _near_singular(mesh: PolygonMesh, surface: Surface, fields: Sequence[Field]) -> Bools:
    blank = [x.blank if isinstance(x, CornerField) else np.zeros(surface.m, dtype=bool) for x in fields]
    near_blank = np.array([adjacent_faces(surface, faces) for faces in blank])
    return np.asarray(near_blank[mesh.family, mesh.parent] & ~mesh.void)


def _askew_bars(mesh: PolygonMesh, nodes: Bools, near_singular: Bools, tidy: Tidy) -> list[FairBar]:
    bars, taken, none = list[FairBar](), np.zeros_like(nodes), np.zeros_like(nodes)
    for lumps, seeds in ((with_crossings(mesh, nodes), nodes), (nodes, nodes), (none, near_singular)):
        label = mesh.part_labels(_with_touching_stretches(mesh, lumps | seeds, between_crossings(mesh, tidy, lumps)))
        for part in np.unique(label[seeds & (label >= 0) & ~taken]):
            cells = label == part
            bar = None if taken[cells].any() else FairBar.straight(mesh, cells)
            if bar is not None and seeds is not nodes:
                bar = bar.with_bow(mesh)
            if bar is not None:
                bars.append(bar)
                taken |= cells
    deviations = np.array([bar.deviation(mesh) for bar in bars])
    straight, bent, largest = (split_value(deviations, threshold) for threshold in (ASKEW, UNEVEN, FAR))
    return [bar for bar, x in zip(bars, deviations, strict=True) if (bent if any(bar.bow) else straight) < x < largest]


def _with_touching_stretches(mesh: PolygonMesh, seeds: Bools, part: Ints) -> Bools:
    slot_a, slot_b, _ = mesh.neighbours
    f, g = mesh.cells.owner[slot_a], mesh.cells.owner[slot_b]
    touching = seeds.copy()
    touching[np.concatenate([g[seeds[f]], f[seeds[g]]])] = True
    return np.asarray((part >= 0) & np.isin(part, part[touching & (part >= 0)]))


def _with_fair_bar(mesh: PolygonMesh, bar: Bools, fair_bar: FairBar, size: float) -> tuple[PolygonMesh | None, Ints]:
    """Replace `bar` by `fair_bar`. Return the mesh, or None if the areas differ too much; and polygons' old numbers."""
    opening = mesh.part_labels(mesh.void | bar)
    inside, source = np.isin(opening, opening[bar]) & (opening >= 0), np.arange(len(bar))
    line = mesh.lines.count + np.arange(2)
    result = replace(mesh, lines=mesh.lines.with_more(LineKind.STRIP, 2))
    for side in (0, 1):
        x = fair_bar.heights(result.X)[side]
        x[np.abs(x) < SNAP * fair_bar.width] = 0.0
        inside = inside & result.cells.per_polygon(np.logical_or, fair_bar.near_length(result.X)[result.cells.corner])
        split = clean_split(result.cells, result.X, x, np.zeros(1), inside, Snapping(0.0, size))
        result, source = result.after_split(split, line[side : side + 1, None]), source[split.source]
        inside = inside[split.source] & (split.strip == 1)
    old_bar, part = bar[source], result.part_labels(inside)
    filled = np.isin(part, part[old_bar & inside]) & inside
    area = result.cells.areas(result.X)[0]
    sizes = sorted((float(area[old_bar].sum()), float(area[filled].sum())))
    if not sizes[1] < LARGER * sizes[0]:
        return None, source
    family = np.where(old_bar, VOID, result.family)
    family[filled] = np.bincount(mesh.family[bar]).argmax()
    return replace(result, family=family, also=np.where(old_bar & ~filled, VOID, result.also)), source
