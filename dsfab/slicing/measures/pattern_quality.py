"""Quality of a pattern: evenness, dead ends, bays between crossings, and arms of members at a node."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, group_sums, sorted_order, unfolded, unit_vectors, weighted_quantiles
from dsfab.core.limits import SLIT
from dsfab.slicing.measures.chart import ON, Drawn, Middles, middles
from dsfab.surface.edge_changes import refined
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import connected


@dataclass(frozen=True, eq=False)
class Bays:
    """The pieces of `StripeMiddles`, divided at the middles of the other family.

    piece  : (b,) of each part.    at : (b, 3) barycentric coordinates of its middle.    length : (b,) metres.
    bay    : (b,) the bay that it is a part of, of `count`.
    angle  : (c,) degrees between members at crossings, outside material besides the stripes.
    """

    middles: Middles
    piece: Ints
    at: Floats
    length: Floats
    bay: Ints
    count: int
    angle: Floats

    @cached_property
    def free(self) -> Floats:
        """(b,) metres outside the members of the other family and other material."""
        drawn, face = self.middles.drawn, self.middles.face[self.piece]
        met = drawn.inside(1 - self.middles.k, face, self.at) | drawn.is_kept(face, self.at)
        return np.where(met, 0.0, self.length)

    @cached_property
    def narrow(self) -> Bools:
        """(b,) True if the opening to the next member is narrower than the member."""
        drawn = self.middles.drawn
        corner = drawn.surface.F[self.middles.face[self.piece]]
        d = np.einsum("bc,bc->b", drawn.d[corner, self.middles.k], self.at)
        return np.asarray((d > SLIT + ON) & (d < 0.5 - ON))

    @property
    def slits(self) -> int:
        """Number of bays with an opening narrower than the member along more than half of the free length."""
        free = np.bincount(self.bay, self.free, self.count)
        slit = np.bincount(self.bay, self.free * self.narrow, self.count)
        return int((slit > free / 2).sum())

    @property
    def slit_share(self) -> float:
        """Share of the free length along an opening that is narrower than the member."""
        total = float(self.free.sum())
        return float(self.free @ self.narrow) / total if total > 0 else 0.0


def bays(middles: Middles) -> Bays:
    """Divide the middles of a family at whole numbers of the other family's phase, which is linear along a piece."""
    drawn, face = middles.drawn, middles.face
    other = 1 - middles.k
    corner = drawn.surface.F[face]
    z = np.einsum("sec,sc->se", middles.at, drawn.z[corner, other])
    whole = np.rint(z)
    there = drawn.known[face, other] & (drawn.d[corner, other].max(axis=1) > 0)
    on = (np.abs(z - whole) < ON) & there[:, None]
    z = np.where(on, whole, z)
    low, high = z.min(axis=1), z.max(axis=1)
    first = np.floor(low).astype(np.int64) + 1
    inner = np.where(there, np.maximum(np.ceil(high).astype(np.int64) - first, 0), 0)
    piece = np.repeat(np.arange(len(face)), inner + 1)
    start = np.cumsum(inner + 1) - inner - 1
    number = np.arange(len(piece)) - start[piece]  # of the part in its piece, by ascending z
    z0 = np.where(number == 0, low[piece], first[piece] + number - 1)
    z1 = np.where(number == inner[piece], high[piece], first[piece] + number)
    span = (high - low)[piece]
    share = np.divide(z1 - z0, span, out=np.ones_like(span), where=inner[piece] > 0)
    middle = np.divide((z0 + z1) / 2 - low[piece], span, out=np.full_like(span, 0.5), where=inner[piece] > 0)
    end = (z.argmin(axis=1) if len(z) else np.empty(0, dtype=np.int64))[piece]
    a, b = middles.at[piece, end], middles.at[piece, 1 - end]
    at = a + middle[:, None] * (b - a)
    barrier = middles.at_nodes(on)
    count, bay = _joined(middles, piece, end, number, inner, barrier)
    crossed = np.concatenate([np.repeat(np.arange(len(face)), inner), np.nonzero(on)[0]])
    where = np.concatenate([at[number > 0], middles.at[on]])
    return Bays(middles, piece, at, share * middles.length[piece], bay, count, _angles(middles, face[crossed], where))


def _joined(middles: Middles, piece: Ints, end: Ints, number: Ints, inner: Ints, barrier: Bools) -> tuple[int, Ints]:
    """Number of bays, and the bay of each part; parts connect at nodes that are no `barrier` (j,)."""
    parts, links = len(piece), []
    for last, side in ((number == 0, end), (number == inner[piece], 1 - end)):
        node = middles.node[piece, side]
        link = np.flatnonzero(last & ~barrier[node])
        links.append(np.stack([link, parts + node[link]]))
    i, j = np.concatenate(links, axis=1)
    label = connected(parts + len(middles.edge), i, j)[1][:parts]
    found, bay = np.unique(label, return_inverse=True)
    return len(found), bay.ravel()


def _angles(middles: Middles, face: Ints, at: Floats) -> Floats:
    drawn = middles.drawn
    face = face[~drawn.is_kept(face, at)]
    one, two = (g[face] for g in drawn.gradients)
    cosine = np.abs(np.einsum("cx,cx->c", one, two)) / (drawn.slope[0][face] * drawn.slope[1][face])
    return np.asarray(np.degrees(np.arccos(np.minimum(cosine, 1))))


OFF = 30.0
"""Largest deviation of a member from the stress, degrees."""


class DeadEnds(NamedTuple):
    """(e, 3) places of loose ends, and (t, 3) of turns, metres."""

    loose: Floats
    turns: Floats


def dead_ends(middles: Middles, along: Floats, deviation: Floats, confidence: Floats) -> DeadEnds:
    """Find the dead ends of a family.

    along      : (m, 3) unit direction of the stress on the faces; either sign.
    deviation  : (m,) degrees between members and that direction.    confidence : (m,) clarity of the direction, 0 to 1.
    """
    met = middles.at_nodes(middles.met)
    loose = (middles.degree == 1) & ~middles.edge & ~met
    clear = confidence[middles.face] > 0.25  # else principal stresses differ by under a tenth of their RMS
    back = _turned(middles, along[middles.face], clear)
    off = clear & (deviation[middles.face] > OFF)
    count, label = connected(len(back), middles.node[off, 0], middles.node[off, 1])
    odd = np.bincount(label[back], minlength=count) % 2 == 1
    counted = np.flatnonzero(back & ~met & odd[label])
    first = counted[np.unique(label[counted], return_index=True)[1]]
    return DeadEnds(middles.place[loose], middles.place[first])


def _turned(middles: Middles, along: Floats, clear: Bools) -> Bools:
    """(j,) nodes of two pieces on the same side of a stress that is clear in both: the member turns back."""
    some = np.flatnonzero(~middles.copy)
    step = middles.points[some, 1] - middles.points[some, 0]
    ahead = np.where(np.einsum("px,px->p", step, along[some]) < 0, -1, 1)  # zero counts as ahead
    node, piece = middles.node[some].T.ravel(), np.tile(some, 2)
    side = np.concatenate([ahead, -ahead])
    order = sorted_order(node)
    pair = np.flatnonzero((np.diff(node[order]) == 0) & (middles.degree[node[order][1:]] == 2))
    one, two = order[pair], order[pair + 1]
    here, there = (middles.drawn.surface.normals[middles.face[piece[end]]] for end in (one, two))
    straight = unfolded(here, there, along[piece[two]])  # around a sharp edge of the surface
    alike = np.where(np.einsum("px,px->p", along[piece[one]], straight) < 0, -1, 1)
    found = np.zeros(len(middles.edge), dtype=bool)
    found[node[one]] = (side[one] * side[two] * alike > 0) & clear[piece[one]] & clear[piece[two]]
    return found


class Arms(NamedTuple):
    """Strips of material in which a sheet leaves a ball.

    direction : (a, 3) unit vectors towards them; two zero vectors for a ball that material surrounds.
    normal    : (a, 3) mean unit normals there.    width : (a,) metres across.
    """

    direction: Floats
    normal: Floats
    width: Floats

    def tip(self, width: float) -> bool:
        """True if a member of a width in metres ends here; an arm wider than 3 members is a junction."""
        return len(self.width) == 0 or (len(self.width) == 1 and float(self.width[0]) < 3 * width)

    def hairpin(self, width: float) -> bool:
        """True if a member ends here or turns back.

        The second arm is unfolded around the edge of the surface, so that a member around a sharp edge counts as
        straight.
        """
        if len(self.width) != 2 or not self.direction.any():
            return self.tip(width)
        return float(self.direction[0] @ unfolded(self.normal[:1], self.normal[1:], self.direction[1:])[0]) > 0


def arms(sheet: Surface, place: Floats, radius: float) -> Arms:
    """Return the arms of a sheet around the ball of `radius` metres at a place (3,); none without a vertex in the ball.

    Faces that are large beside the ball are divided.
    """
    sheet = _near(sheet, place, radius)
    far = np.linalg.norm(sheet.V - place, axis=1)
    inside = far < radius
    if not inside.any():
        return Arms(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))
    ends, of = sheet.edges.ends, sheet.edges.of
    joined = ends[inside[ends].all(axis=1)]
    label = connected(sheet.n, joined[:, 0], joined[:, 1])[1]
    here = inside & (label == label[far.argmin()])
    faces = np.flatnonzero(here[sheet.F].any(axis=1) & ~here[sheet.F].all(axis=1))
    crossed = here[ends].sum(axis=1) == 1
    rows, sides = np.nonzero(crossed[of[faces]])  # the sphere enters and leaves each face
    edge = of[faces][rows, sides]
    order = np.argsort(edge, kind="stable")
    same = np.flatnonzero(np.diff(edge[order]) == 0)
    one, two = rows[order[same]], rows[order[same + 1]]
    count, strip = connected(len(faces), one, two)
    around = np.bincount(strip[one], minlength=count) == np.bincount(strip, minlength=count)
    at = _limit(sheet, far, edge, radius) - place
    towards, normal = group_sums(strip[rows], at, count), group_sums(strip, sheet.normals[faces], count)
    width = np.bincount(strip, np.linalg.norm(at[::2] - at[1::2], axis=1), count)
    closed = 2 * int(around.sum())
    return Arms(
        np.concatenate([unit_vectors(towards[~around]), np.zeros((closed, 3))]),
        np.concatenate([unit_vectors(normal[~around]), np.zeros((closed, 3))]),
        np.concatenate([width[~around], np.zeros(closed)]),
    )


def _near(sheet: Surface, place: Floats, radius: float) -> Surface:
    """The faces that may meet the ball, with edges up to half its radius; the whole sheet if none does."""
    corners = sheet.V[sheet.F]
    away = np.linalg.norm(corners - place, axis=2).min(axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    meet = away < radius + longest
    if not meet.any():
        return sheet
    used, F = np.unique(sheet.F[meet], return_inverse=True)
    return refined(Surface(sheet.V[used], F.reshape(-1, 3)), 0.5 * radius)


def _limit(sheet: Surface, far: Floats, edge: Ints, radius: float) -> Floats:
    a, b = sheet.edges.ends[edge].T
    share = np.clip((radius - far[a]) / np.where(far[a] == far[b], 1.0, far[b] - far[a]), 0, 1)[:, None]
    return np.asarray(sheet.V[a] + share * (sheet.V[b] - sheet.V[a]))


SHARES = (0.05, 0.5, 0.95)
"""Quantiles of spacings and openings, by area."""

Quantiles = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class FamilyQuality:
    """Quality of one family of members.

    spacing    : metres from middle to middle: P5, median and P95 over the area outside other material.
    opening    : metres of clear opening between neighbours: the same over the open area.
    deviation  : degrees off the stress, mean over area x stress along the members x confidence of its direction.
    off        : share of that weight off by more than 30 degrees.
    dead_ends  : see `dead_ends`.
    slits      : openings narrower than the members beside them: counted by bays, see `Bays`; on a cut sheet one by one,
                 see `dsfab.slicing.finishing.openings`.
    slit_share : share of the length of members beside such an opening.
    drawn      : False without members; then the other numbers are 0.
    """

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
        """P95 over P5 of the spacing: 1 for equal spacings."""
        if not self.drawn:
            return 1.0
        return self.spacing[2] / self.spacing[0] if self.spacing[0] > 0 else float("inf")

    @property
    def dead(self) -> int:
        """Number of dead ends."""
        return len(self.dead_ends.loose) + len(self.dead_ends.turns)


@dataclass(frozen=True, eq=False)
class PatternQuality:
    """Quality of both families together.

    crossing_angle : degrees, the smallest between two members that cross; 90 without crossings.
    symmetry_error : share of the surface where material differs from its image under a symmetry of the design, the
                     largest over all symmetries; None without any.
    turned         : intended degrees off the stress; deviations are measured from there.
    """

    major: FamilyQuality
    minor: FamilyQuality
    crossing_angle: float
    symmetry_error: float | None = None
    turned: float = 0.0

    @property
    def families(self) -> tuple[tuple[str, FamilyQuality], tuple[str, FamilyQuality]]:
        """Both families, by name."""
        return ("major", self.major), ("minor", self.minor)

    @property
    def evenness(self) -> float:
        """The larger P95 over P5 of the spacing."""
        return max(self.major.evenness, self.minor.evenness)

    @property
    def dead_ends(self) -> int:
        """Dead ends of both families."""
        return self.major.dead + self.minor.dead

    @property
    def slits(self) -> int:
        """Slits of both families."""
        return self.major.slits + self.minor.slits

    @property
    def deviation(self) -> float:
        """Degrees off the stress, the larger of both families."""
        return max(self.major.deviation, self.minor.deviation)

    @property
    def summary(self) -> str:
        """One line in plain words."""
        crossing = f", crossing at {self.crossing_angle:.0f} or more" if self.major.drawn and self.minor.drawn else ""
        turned = f" turned by {self.turned:g}" if self.turned else ""
        crooked = f"members {self.deviation:.1f} degrees off the stress{turned}{crossing}"
        same = "" if self.symmetry_error is None else f", {self.symmetry_error:.2%} not symmetric"
        return f"{_count(self.dead_ends, 'dead end')}, {_count(self.slits, 'slit')}, {crooked}{same}"


def pattern_quality(
    drawn: Drawn,
    stress: Floats,
    direction: Floats,
    confidence: Floats,
    symmetry_error: float | None = None,
    guided: Bools | None = None,
) -> PatternQuality:
    """Measure the quality of a pattern.

    stress     : (m, 2) principal stresses along the major and the minor members.
    direction  : (m, 2, 3) their unit directions.    confidence : (m,) clarity of these, 0 to 1.
    guided     : (m,) faces where members follow a guide, and no turn counts; default none.
    """
    turning = confidence if guided is None else np.where(guided, 0.0, confidence)
    found = [_family(drawn, k, stress[:, k], direction, confidence, turning) for k in (0, 1)]
    angles = np.concatenate([cut.angle for _, cut in found])
    (major, _), (minor, _) = found
    return PatternQuality(major, minor, float(angles.min(initial=90.0)), symmetry_error)


def _family(
    drawn: Drawn, k: int, stress: Floats, direction: Floats, confidence: Floats, turning: Floats
) -> tuple[FamilyQuality, Bays]:
    """Quality of family k: its members should run along direction k, and its phase grow along the other one."""
    shown = bool((drawn.d[:, k] > 0).any())
    area, known, slope = drawn.surface.areas, drawn.steep(k) & shown, drawn.slope[k]
    spacing = 1 / slope
    opening = (1 - 2 * drawn.corners(drawn.d[:, k]).mean(axis=0)) * spacing
    cosine = np.abs(np.einsum("mx,mx->m", drawn.gradients[k], direction[:, 1 - k])) / slope
    deviation = np.degrees(np.arccos(np.minimum(cosine, 1)))
    weight = area * np.abs(stress) * confidence * drawn.free * known
    total = max(float(weight.sum()), np.finfo(float).tiny)
    lines = middles(drawn, k)
    cut = bays(lines)
    found = FamilyQuality(
        _quantiles(spacing, area * drawn.free * known),
        _quantiles(opening, area * drawn.void * known),
        float(weight @ deviation) / total,
        float(weight @ (deviation > OFF)) / total,
        dead_ends(lines, direction[:, k], deviation, turning),
        cut.slits,
        cut.slit_share,
        shown,
    )
    return found, cut


def _quantiles(values: Floats, weight: Floats) -> Quantiles:
    if not weight.sum() > 0:
        return 0.0, 0.0, 0.0
    low, middle, high = weighted_quantiles(values, weight, SHARES).tolist()
    return low, middle, high


def _count(number: int, what: str) -> str:
    return f"{number or 'no'} {what}{'' if number == 1 else 's'}"
