"""Measures of the quality of a stripe pattern."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import (
    Bools,
    Floats,
    Ints,
    group_sums,
    sorted_order,
    transported_vectors,
    unit_vectors,
    weighted_quantiles,
)
from dsfab.core.limits import SLIT
from dsfab.slicing.measures.chart import ON, StripeChart, StripeMiddles, stripe_middles
from dsfab.surface.edge_changes import refined_surface
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import link_components


@dataclass(frozen=True, eq=False)
class Bays:
    """Middle lines of a family's members, divided into b parts. Parts between two crossings form a bay.
    piece  : (b,) piece of `middles` that contains each part.    at : (b, 3) barycentric coordinates of the midpoint.
    length : (b,) metres.    bay : (b,) number of each part's bay.    count : number of bays.
    angle  : (c,) angle between members at crossings, degrees."""

    middles: StripeMiddles
    piece: Ints
    at: Floats
    length: Floats
    bay: Ints
    count: int
    angle: Floats

    @cached_property
    def free(self) -> Floats:
        """(b,) length of each part, metres; 0 for parts inside crossing members or kept material."""
        chart, face = self.middles.drawn, self.middles.face[self.piece]
        met = chart.inside(1 - self.middles.k, face, self.at) | chart.is_kept(face, self.at)
        return np.where(met, 0.0, self.length)

    @cached_property
    def narrow(self) -> Bools:
        """(b,) mask of parts where the opening beside the member is narrower than the member."""
        chart = self.middles.drawn
        corner = chart.surface.F[self.middles.face[self.piece]]
        d = np.einsum("bc,bc->b", chart.d[corner, self.middles.k], self.at)
        return np.asarray((d > SLIT + ON) & (d < 0.5 - ON))

    @property
    def slits(self) -> int:
        """Number of bays that lie mostly beside an opening narrower than the member."""
        free = np.bincount(self.bay, self.free, self.count)
        slit = np.bincount(self.bay, self.free * self.narrow, self.count)
        return int((slit > free / 2).sum())

    @property
    def slit_share(self) -> float:
        """Fraction of the members' length beside openings narrower than the members."""
        total = float(self.free.sum())
        return float(self.free @ self.narrow) / total if total > 0 else 0.0


def bays(middles: StripeMiddles) -> Bays:
    """Divide the middle lines of a family at their crossings with middle lines of the second family."""
    chart, face = middles.drawn, middles.face
    other_family = 1 - middles.k
    corner = chart.surface.F[face]
    z = np.einsum("sec,sc->se", middles.at, chart.z[corner, other_family])
    nearest_whole = np.rint(z)
    has_stripes = chart.known[face, other_family] & (chart.d[corner, other_family].max(axis=1) > 0)
    on_middle = (np.abs(z - nearest_whole) < ON) & has_stripes[:, None]
    z = np.where(on_middle, nearest_whole, z)
    low, high = z.min(axis=1), z.max(axis=1)
    first_whole = np.floor(low).astype(np.int64) + 1
    inner = np.where(has_stripes, np.maximum(np.ceil(high).astype(np.int64) - first_whole, 0), 0)
    piece = np.repeat(np.arange(len(face)), inner + 1)
    start = np.cumsum(inner + 1) - inner - 1
    number = np.arange(len(piece)) - start[piece]  # number of each part in its piece, by ascending z
    z0 = np.where(number == 0, low[piece], first_whole[piece] + number - 1)
    z1 = np.where(number == inner[piece], high[piece], first_whole[piece] + number)
    span = (high - low)[piece]
    share = np.divide(z1 - z0, span, out=np.ones_like(span), where=inner[piece] > 0)
    middle = np.divide((z0 + z1) / 2 - low[piece], span, out=np.full_like(span, 0.5), where=inner[piece] > 0)
    end = (z.argmin(axis=1) if len(z) else np.empty(0, dtype=np.int64))[piece]
    a, b = middles.at[piece, end], middles.at[piece, 1 - end]
    coordinates = a + middle[:, None] * (b - a)
    barrier = middles.at_nodes(on_middle)
    count, bay = _bay_labels(middles, piece, end, number, inner, barrier)
    crossed = np.concatenate([np.repeat(np.arange(len(face)), inner), np.nonzero(on_middle)[0]])
    crossing_coordinates = np.concatenate([coordinates[number > 0], middles.at[on_middle]])
    angles = _angles(middles, face[crossed], crossing_coordinates)
    return Bays(middles, piece, coordinates, share * middles.length[piece], bay, count, angles)


def _bay_labels(
    middles: StripeMiddles, piece: Ints, end: Ints, number: Ints, inner: Ints, barrier: Bools
) -> tuple[int, Ints]:
    parts, links = len(piece), []
    for at_node, side in ((number == 0, end), (number == inner[piece], 1 - end)):
        node = middles.node[piece, side]
        link = np.flatnonzero(at_node & ~barrier[node])
        links.append(np.stack([link, parts + node[link]]))
    i, j = np.concatenate(links, axis=1)
    label = link_components(parts + len(middles.edge), i, j)[1][:parts]
    bay_ids, bay = np.unique(label, return_inverse=True)
    return len(bay_ids), bay.ravel()


def _angles(middles: StripeMiddles, face: Ints, coordinates: Floats) -> Floats:
    chart = middles.drawn
    face = face[~chart.is_kept(face, coordinates)]
    major, minor = (g[face] for g in chart.gradients)
    cosine = np.abs(np.einsum("cx,cx->c", major, minor)) / (chart.slope[0][face] * chart.slope[1][face])
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1))))


OFF = 30.0  # Largest acceptable angle between a member and the stress, degrees.


class DeadEnds(NamedTuple):
    """Dead ends of members. loose : (e, 3) points at which a member ends and touches no further material, metres.
    turns : (t, 3) points at which a member makes a U-turn, metres."""

    loose: Floats
    turns: Floats


def dead_ends(middles: StripeMiddles, along: Floats, deviation: Floats, confidence: Floats) -> DeadEnds:
    """Return the dead ends of a family's members.
    along      : (m, 3) unit direction of the stress; the sign has no meaning.
    deviation  : (m,) angle between members and this direction, degrees.    confidence : (m,) clarity, 0 to 1."""
    met = middles.at_nodes(middles.ends_in_material)
    loose = (middles.degree == 1) & ~middles.edge & ~met
    clear = confidence[middles.face] > 0.25  # principal stresses differ by over 10 % of their RMS
    turns_back = _turning_nodes(middles, along[middles.face], clear)
    deviates = clear & (deviation[middles.face] > OFF)
    count, label = link_components(len(turns_back), middles.node[deviates, 0], middles.node[deviates, 1])
    odd = np.bincount(label[turns_back], minlength=count) % 2 == 1
    counted = np.flatnonzero(turns_back & ~met & odd[label])
    first_nodes = counted[np.unique(label[counted], return_index=True)[1]]
    return DeadEnds(middles.place[loose], middles.place[first_nodes])


def _turning_nodes(middles: StripeMiddles, along: Floats, clear: Bools) -> Bools:
    pieces = np.flatnonzero(~middles.copy)
    step = middles.points[pieces, 1] - middles.points[pieces, 0]
    ahead = np.where(np.einsum("px,px->p", step, along[pieces]) < 0, -1, 1)  # -1: opposite to `along`
    node, piece = middles.node[pieces].T.ravel(), np.tile(pieces, 2)
    side = np.concatenate([ahead, -ahead])
    order = sorted_order(node)
    pair = np.flatnonzero((np.diff(node[order]) == 0) & (middles.degree[node[order][1:]] == 2))
    end_a, end_b = order[pair], order[pair + 1]
    normals_a, normals_b = (middles.drawn.surface.normals[middles.face[piece[end]]] for end in (end_a, end_b))
    straight = transported_vectors(normals_a, normals_b, along[piece[end_b]])
    alike = np.where(np.einsum("px,px->p", along[piece[end_a]], straight) < 0, -1, 1)
    result = np.zeros(len(middles.edge), dtype=bool)
    result[node[end_a]] = (side[end_a] * side[end_b] * alike > 0) & clear[piece[end_a]] & clear[piece[end_b]]
    return result


class Arms(NamedTuple):
    """Arms: strips of material that leave a ball around a point of the sheet.
    direction : (a, 3) unit vectors from the point to the strips.    normal : (a, 3) mean unit normals of the strips.
    width     : (a,) metres."""

    direction: Floats
    normal: Floats
    width: Floats

    def is_tip(self, width: float) -> bool:
        """Return True if a member of `width` metres ends at this point."""
        return len(self.width) == 0 or (len(self.width) == 1 and float(self.width[0]) < 3 * width)

    def is_hairpin(self, width: float) -> bool:
        """Return True if a member of `width` metres ends or makes a U-turn at this point."""
        if len(self.width) != 2 or not self.direction.any():
            return self.is_tip(width)
        unfolded = transported_vectors(self.normal[:1], self.normal[1:], self.direction[1:])[0]
        return float(self.direction[0] @ unfolded) > 0


def arms(sheet: Surface, place: Floats, radius: float) -> Arms:
    """Return the strips of material that leave a ball of `radius` metres at a place (3,)."""
    sheet = _faces_near(sheet, place, radius)
    distance = np.linalg.norm(sheet.V - place, axis=1)
    inside = distance < radius
    if not inside.any():
        return Arms(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    ends, face_edges = sheet.edges.ends, sheet.edges.of
    joined = ends[inside[ends].all(axis=1)]
    label = link_components(sheet.n, joined[:, 0], joined[:, 1])[1]
    core = inside & (label == label[distance.argmin()])
    faces = np.flatnonzero(core[sheet.F].any(axis=1) & ~core[sheet.F].all(axis=1))
    crossed = core[ends].sum(axis=1) == 1
    rows, sides = np.nonzero(crossed[face_edges[faces]])  # two edges per face
    edge = face_edges[faces][rows, sides]
    order = np.argsort(edge, kind="stable")
    shared = np.flatnonzero(np.diff(edge[order]) == 0)
    face_a, face_b = rows[order[shared]], rows[order[shared + 1]]
    count, strip = link_components(len(faces), face_a, face_b)
    around = np.bincount(strip[face_a], minlength=count) == np.bincount(strip, minlength=count)
    ball_points = _ball_crossings(sheet, distance, edge, radius) - place
    towards, normal = group_sums(strip[rows], ball_points, count), group_sums(strip, sheet.normals[faces], count)
    width = np.bincount(strip, np.linalg.norm(ball_points[::2] - ball_points[1::2], axis=1), count)
    closed = 2 * int(around.sum())
    return Arms(
        np.concatenate([unit_vectors(towards[~around]), np.zeros((closed, 3))]),
        np.concatenate([unit_vectors(normal[~around]), np.zeros((closed, 3))]),
        np.concatenate([width[~around], np.zeros(closed)]),
    )


def _faces_near(sheet: Surface, place: Floats, radius: float) -> Surface:
    corners = sheet.V[sheet.F]
    away = np.linalg.norm(corners - place, axis=2).min(axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    meet = away < radius + longest
    if not meet.any():
        return sheet
    used, F = np.unique(sheet.F[meet], return_inverse=True)
    return refined_surface(Surface(sheet.V[used], F.reshape(-1, 3)), 0.5 * radius)


def _ball_crossings(sheet: Surface, distance: Floats, edge: Ints, radius: float) -> Floats:
    a, b = sheet.edges.ends[edge].T
    step = np.where(distance[a] == distance[b], 1.0, distance[b] - distance[a])
    share = np.clip((radius - distance[a]) / step, 0, 1)[:, None]
    return np.asarray(sheet.V[a] + share * (sheet.V[b] - sheet.V[a]))


SHARES = (0.05, 0.5, 0.95)  # Quantiles of spacings and openings, weighted by area.
Quantiles = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FamilyQuality:
    """Quality of one family of members.
    spacing    : distance between middle lines of neighbours, metres: 5 %, 50 %, 95 % quantiles.
    opening    : clear distance between neighbours, metres: the same quantiles.
    deviation  : mean angle between members and stress, degrees; weight: area x stress x clarity.
    off        : fraction of this weight where the angle is over 30 degrees.
    slits      : number of openings narrower than the members beside them.
    slit_share : fraction of the members' length beside slits.
    drawn      : False if the family has no members; then all numbers are 0."""

    spacing: Quantiles
    opening: Quantiles
    deviation: float
    off: float
    dead_ends: DeadEnds = field(repr=False)
    slits: int
    slit_share: float
    drawn: bool = True

    @property
    def evenness(self) -> float:
        """95 % quantile of the spacing divided by the 5 % quantile."""
        if not self.drawn:
            return 1.0
        return self.spacing[2] / self.spacing[0] if self.spacing[0] > 0 else float("inf")

    @property
    def dead(self) -> int:
        """Number of dead ends of members."""
        return len(self.dead_ends.loose) + len(self.dead_ends.turns)


@dataclass(frozen=True, eq=False)
class PatternQuality:
    """Quality of both families together.
    crossing_angle : the smallest angle between two members that cross, degrees; 90 without crossings.
    symmetry_error : fraction of the surface where the pattern is not symmetric; None without symmetries.
    turned         : angle, degrees, by which the user rotated the stress directions."""

    major: FamilyQuality
    minor: FamilyQuality
    crossing_angle: float
    symmetry_error: float | None = None
    turned: float = 0.0
    titles: tuple[str, str] = ("major members", "minor members")

    @property
    def families(self) -> tuple[tuple[str, FamilyQuality], tuple[str, FamilyQuality]]:
        """Names and qualities of the families."""
        return ("major", self.major), ("minor", self.minor)

    @property
    def evenness(self) -> float:
        """95 % quantile of the spacing divided by the 5 % quantile, for the less even family."""
        return max(self.major.evenness, self.minor.evenness)

    @property
    def dead_ends(self) -> int:
        """Number of dead ends of members."""
        return self.major.dead + self.minor.dead

    @property
    def slits(self) -> int:
        """Number of openings narrower than the members beside them."""
        return self.major.slits + self.minor.slits

    @property
    def deviation(self) -> float:
        """Mean angle between members and stress, degrees, for the worse family."""
        return max(self.major.deviation, self.minor.deviation)

    @property
    def summary(self) -> str:
        """A line of text about dead ends, slits, angles and symmetry."""
        crossing = f", crossing at {self.crossing_angle:.0f} or more" if self.major.drawn and self.minor.drawn else ""
        turned = f" turned by {self.turned:g}" if self.turned else ""
        crooked = f"members {self.deviation:.1f} degrees off the stress direction{turned}{crossing}"
        symmetry = "" if self.symmetry_error is None else f", {self.symmetry_error:.2%} not symmetric"
        return f"{_count(self.dead_ends, 'dead end')}, {_count(self.slits, 'slit')}, {crooked}{symmetry}"


def pattern_quality(
    chart: StripeChart,
    stress: Floats,
    direction: Floats,
    confidence: Floats,
    symmetry_error: float | None = None,
    guided: Bools | None = None,
) -> PatternQuality:
    """Measure the quality of a pattern of stripes.
    stress     : (m, 2) principal stresses along the major and the minor members.
    direction  : (m, 2, 3) unit directions of these stresses.    confidence : (m,) clarity of directions, 0 to 1.
    guided     : (m,) mask of faces where members follow a guide. Default: none."""
    turning = confidence if guided is None else np.where(guided, 0.0, confidence)
    families = [_family(chart, k, stress[:, k], direction, confidence, turning) for k in (0, 1)]
    angles = np.concatenate([cut.angle for _, cut in families])
    (major, _), (minor, _) = families
    return PatternQuality(major, minor, float(angles.min(initial=90.0)), symmetry_error)


def _family(
    chart: StripeChart, k: int, stress: Floats, direction: Floats, confidence: Floats, turning: Floats
) -> tuple[FamilyQuality, Bays]:
    shown = bool((chart.d[:, k] > 0).any())
    area, has_spacing, slope = chart.surface.areas, chart.steep(k) & shown, chart.slope[k]
    spacing = 1 / slope
    opening = (1 - 2 * chart.corners(chart.d[:, k]).mean(axis=0)) * spacing
    cosine = np.abs(np.einsum("mx,mx->m", chart.gradients[k], direction[:, 1 - k])) / slope
    deviation = np.degrees(np.arccos(np.minimum(cosine, 1)))
    weight = area * np.abs(stress) * confidence * chart.free * has_spacing
    total = max(float(weight.sum()), np.finfo(float).tiny)
    lines = stripe_middles(chart, k)
    family_bays = bays(lines)
    sizes = (spacing, area * chart.free * has_spacing), (opening, area * chart.void * has_spacing)
    quantiles = _quantiles(*sizes[0]), _quantiles(*sizes[1])
    off_direction = float(weight @ deviation) / total, float(weight @ (deviation > OFF)) / total
    ends = dead_ends(lines, direction[:, k], deviation, turning)
    return FamilyQuality(
        *quantiles, *off_direction, ends, family_bays.slits, family_bays.slit_share, shown
    ), family_bays


def _quantiles(values: Floats, weight: Floats) -> Quantiles:
    if not weight.sum() > 0:
        return 0.0, 0.0, 0.0
    low, middle, high = weighted_quantiles(values, weight, SHARES).tolist()
    return low, middle, high


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
