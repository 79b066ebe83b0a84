"""Proposed supports: low parts of the boundary or of a closed surface, masts, and the check against tipping."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, closed_length, lengths
from dsfab.preset.proposal.reading import SOLE, is_nearly_closed
from dsfab.surface import Boundary, Box, Surface, connected

TIPS = 1.03
"""It falls over if all feet are within half a turn of the middle of its plan, by so much."""
LINE = 1 / 12
"""Feet in line are narrower in plan than this share of the width of the surface across that line."""


def tips(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Whether the middle of a surface's plan is beside all feet, (k, 3) points of each in metres: on those alone it
    would have to be held down."""
    if not feet:
        return False
    middle = surface.areas @ surface.centroids / surface.area
    x, y = (np.concatenate(feet) - middle)[:, :2].T
    angle = np.sort(np.arctan2(y, x))
    return bool(np.diff(angle, append=angle[0] + 2 * np.pi).max() > TIPS * np.pi)


def turns(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Whether two feet or more, points (k, 3) each, are in one line, about which the surface would turn: a saddle on
    two of its corners."""
    if len(feet) < 2:
        return False
    plan = np.concatenate(feet)[:, :2]
    along = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
    across = np.array([-along[1], along[0]])
    return bool(np.ptp(plan @ across) < LINE * np.ptp(surface.V[:, :2] @ across))


CORNER = 45.0
"""Degrees in plan by which the edge turns at a corner from which it may hang."""
SCALLOP = 0.05
"""Share of the way between two corners by which an edge that a cable holds comes inwards in plan between them."""
SAG = 0.08
"""Share of the height by which the edge hangs below the line between two corners."""
SLANT = 0.3
"""Share of the height by which two corners differ between which a sail's edge may be straight in elevation, as a cable
in tension all but is; a shell's edge rises above that line."""
TAUT = 0.02
"""Share of the height by which such an edge is above the line at most."""


def mast_corners(P: Floats, arm: float, height: float) -> Ints:
    """(k,) where a sheet whose edge is the closed line P (n, 3), metres, hangs from masts; none where it does not.

    It does where its edge has three corners or more, and between any two of them comes inwards in plan and hangs below
    the line between them, or goes along it from a high corner to a low one. The edge of a roof that stands on its
    corners rises from them; a saddle's is straight in plan, too.
    arm : metres along the edge over which a corner's directions are measured.     height : of the whole sheet, metres.
    """
    at = _corners(P, arm)
    if len(at) < 3:
        return at[:0]
    middle = P[at].mean(axis=0)
    arcs = [P[np.arange(a, b + 1) % len(P)] for a, b in zip(at, np.append(at[1:], at[0] + len(P)), strict=True)]
    return at if all(_masts_hangs(arc, middle, height) for arc in arcs) else at[:0]


def _masts_hangs(arc: Floats, middle: Floats, height: float) -> bool:
    """Whether the edge from corner to corner, the line `arc` (k, 3), comes inwards in plan, to the middle (3,), and
    hangs below the straight line between its ends, or goes along it where it slants; `height` of the sheet, metres."""
    start, chord = arc[0], arc[-1] - arc[0]
    long = max(float(np.hypot(*chord[:2])), 1e-300)
    normal = np.array([-chord[1], chord[0]]) / long
    normal *= np.sign(normal @ (middle - start)[:2])
    inwards = float(((arc - start)[:, :2] @ normal).max())
    share = np.clip((arc - start)[:, :2] @ chord[:2] / long**2, 0, 1)
    below = start[2] + share * chord[2] - arc[:, 2]
    taut = abs(chord[2]) >= SLANT * height and float(below.min()) >= -TAUT * height
    return inwards >= SCALLOP * long and (taut or float(below.max()) >= SAG * height)


def _corners(P: Floats, arm: float) -> Ints:
    """(k,) where a closed line P (n, 3) turns in plan by `CORNER` and most within an arm's length of it, metres."""
    step = lengths(np.roll(P, -1, axis=0) - P)
    along = np.concatenate([[0], np.cumsum(step)])
    total, n = float(along[-1]), len(P)
    before, after = (np.searchsorted(along, (along[:-1] + way) % total) % n for way in (-arm, arm))
    p, q = (P - P[before])[:, :2], (P[after] - P)[:, :2]
    turn = np.abs(np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.einsum("ni,ni->n", p, q)))
    turn[turn < np.radians(CORNER)] = 0
    most: Bools = turn > 0
    for i in np.flatnonzero(most):
        gap = np.abs(along[:-1] - along[i])
        near = np.minimum(gap, total - gap) <= arm
        most[i] = int(np.flatnonzero(near)[turn[near].argmax()]) == i
    return np.flatnonzero(most)


FLAT = 0.02
"""A surface that is lower than this share of its size is flat."""
LEVEL = 0.05
"""Share of the height by which a foot may rise from its lowest point."""
EVEN = 0.005
"""Share of the height by which a level ring may be out of level; of a window the lower half is its lowest part."""
DIP = 0.15
"""Share of the height by which the boundary has to rise between two feet."""
LOW = 0.35
"""Share of the height over the lowest foot in which others may begin."""
HIGHEST = 0.6
"""The same for what would tip over on those alone, as a folded roof that slopes does
on the lower ends of its valleys."""
SLOPE = 0.1
"""Share of the height by which a higher low point may be off the plane through three feet, and be on their ground."""
IN_LINE = 0.1
"""Feet whose plan is narrower than this share of its length are in line."""
SHORTEST = 1 / 25
"""Share of the span that a foot is long at least."""
ALIKE = 1e-4
"""Share of the height by which two sides of a foot may differ and be as high."""
RIM = "upper rim"
"""What a loop of boundary is called that a sheet hangs from."""
STEP = 1 / 200
"""Share of the span between two points of the boundary that are looked at."""


@dataclass(frozen=True, eq=False)
class Foot:
    """A part of a surface that stands on the ground.

    name : for people.  points : (k, 3) metres, along the free edge or on the surface.
    length : metres of free edge; 0 of a closed surface.  loop : the boundary loop that it is all of, if it is.
    """

    name: str
    points: Floats
    length: float
    loop: int | None = None

    def picker(self, margin: float, digits: int) -> Boundary | Box:
        """What picks it from finer and coarser meshes too: its loop, or the box around it, `margin` metres wider."""
        if self.loop is not None:
            return Boundary(self.loop)
        low, high = self.points.min(axis=0) - margin, self.points.max(axis=0) + margin
        corners = [tuple((np.round(corner, digits) + 0.0).tolist()) for corner in (low, high)]
        return Box(corners[0], corners[1], boundary=self.length > 0)


def feet(surface: Surface, span: float) -> tuple[Foot, ...]:
    """Where the surface stands, z up; `span`: metres that it bridges.

    flat   : on its outer edge.
    closed : on what lies within `SOLE` of its height over its lowest point, and so where it has holes in its side.
    hung   : from the corners of its outer edge, see `mast_corners`.
    else   : on the stretches of boundary around the low points of the outer edge, and of other edges that reach the
             ground, and of those that are higher on a site that slopes. Openings in the roof, with sheet below them,
             are not held.
    """
    height = float(np.ptp(surface.V[:, 2]))
    if is_nearly_closed(surface) or _has_sheet_below(surface, height):
        return _named(surface, soles(surface, height), span)
    if height < FLAT * surface.size:
        outline = surface.V[surface.loops[0]]
        return (Foot("edge", outline, closed_length(outline), loop=0),)
    ground = min(float(surface.V[loop, 2].min()) for loop in surface.loops)
    outer = _outer(surface)
    found = _masts(surface, outer, height, span)
    if found:
        return _named(surface, found, span)
    low = ground + LOW * height
    standing = [k for k, loop in enumerate(surface.loops) if outer[k] or _stands(surface, loop, low)]
    lines = {k: _resampled(surface.V[surface.loops[k]], STEP * span) for k in standing}
    found = [foot for k in standing for foot in _stretches(k, lines[k], height, low, span)]
    if tips(surface, [foot.points for foot in found]):
        found = _propped(surface, lines, found, ground, span)
    return _named(surface, _on_a_slope(surface, lines, found, span), span)


def _propped(surface: Surface, lines: dict[int, Floats], found: list[Foot], ground: float, span: float) -> list[Foot]:
    """The feet with the next higher low points of the outer edges, up to `HIGHEST`, by which it no longer tips over;
    as they were where there are none."""
    height = float(np.ptp(surface.V[:, 2]))
    outer = _outer(surface)
    places = sorted({float(P[at, 2]) for k, P in lines.items() if outer[k] for at in _valleys(P[:, 2], DIP * height)})
    for z in places:
        if ground + LOW * height < z <= ground + HIGHEST * height:
            highest = z + LEVEL * height
            more = [foot for k, P in lines.items() for foot in _stretches(k, P, height, highest, span)]
            if not tips(surface, [foot.points for foot in more]):
                return more
    return found


def _on_a_slope(surface: Surface, lines: dict[int, Floats], found: list[Foot], span: float) -> list[Foot]:
    """The feet on the plane through the lowest points of those that were found, where they are more: a shell on four
    feet on a slope stood on the lower three, and reached over the fourth into the air."""
    lowest = np.array([foot.points[foot.points[:, 2].argmin()] for foot in found])
    if len(found) < 3:
        return found
    middle = lowest.mean(axis=0)
    plan = (lowest - middle)[:, :2]
    across, along = np.linalg.svd(plan, compute_uv=False)[::-1]
    if across < IN_LINE * along:  # they say nothing of the ground beside their line
        return found
    slope, *_ = np.linalg.lstsq(plan, lowest[:, 2] - middle[2])

    def ground(P: Floats) -> Floats:
        z = middle[2] + (P - middle)[:, :2] @ slope
        return np.column_stack([np.zeros((len(P), 2)), z])

    height = float(np.ptp((surface.V - ground(surface.V))[:, 2]))
    level = {k: P - ground(P) for k, P in lines.items()}
    more = [foot for k, P in level.items() for foot in _stretches(k, P, height, SLOPE * height, span)]
    on_it = [replace(foot, points=foot.points + ground(foot.points)) for foot in more]
    return on_it if len(on_it) > len(found) else found


def _hangs(surface: Surface, loop: int) -> bool:
    """Whether a level boundary loop is above the middle of the sheet."""
    middle = float(surface.vertex_areas @ surface.V[:, 2]) / surface.area
    return float(surface.V[surface.loops[loop], 2].mean()) > middle


def _has_sheet_below(surface: Surface, height: float) -> bool:
    """Whether all boundary of one piece is over its lowest part, and the lowest of it below the middle: it stands on no
    hole in its side, and hangs from none."""
    if surface.pieces[0] > 1:
        return False
    lowest = min(float(surface.V[loop, 2].min()) for loop in surface.loops)
    return lowest > float(surface.V[:, 2].min()) + LEVEL * height and not any(
        _hangs(surface, k) for k in range(len(surface.loops))
    )


def _masts(surface: Surface, outer: list[bool], height: float, span: float) -> list[Foot]:
    """The corners of outer edges from which sheets hang."""
    found = []
    for loop in (loop for k, loop in enumerate(surface.loops) if outer[k]):
        line = _resampled(surface.V[loop], STEP * span)
        for at in mast_corners(line, SHORTEST * span, height):
            stretch = line[_widened(line, np.arange(len(line)) == at, SHORTEST * span)]
            found.append(Foot("mast", stretch, _length(stretch)))
    return found


def _outer(surface: Surface) -> list[bool]:
    """For each boundary loop whether it is the longest of its piece."""
    of = np.full(surface.n, -1)
    of[surface.F] = surface.pieces[1][:, None]
    met: set[int] = set()
    first = []
    for loop in surface.loops:
        first.append(int(of[loop[0]]) not in met)
        met.add(int(of[loop[0]]))
    return first


def _stands(surface: Surface, loop: Ints, ground: float) -> bool:
    """Whether the lowest edges of a loop are near the ground and have the sheet above them, as a column's foot."""
    z, edges = surface.V[:, 2], surface.edges
    on = np.zeros(surface.n, dtype=bool)
    on[loop] = True
    lowest = float(z[loop].min())
    if lowest > ground:
        return False
    height = float(np.ptp(z))
    on &= z <= lowest + min(LEVEL * height, max(float(np.ptp(z[loop])) / 2, EVEN * height))
    low = on[edges.ends].all(axis=1) & edges.boundary
    faces = np.flatnonzero(low[edges.of].any(axis=1))
    rises = [z[surface.F[f]].sum() - 1.5 * z[edges.ends[e]].sum() for f in faces for e in edges.of[f] if low[e]]
    return bool(rises) and float(np.mean(rises)) > 0


def soles(surface: Surface, height: float) -> list[Foot]:
    """The lowest parts of a surface; those of a closed one are on the ground. Specks beside larger parts are none."""
    z = surface.V[:, 2]
    low = z <= z.min() + SOLE * height
    ends = surface.edges.ends[low[surface.edges.ends].all(axis=1)]
    _, part = connected(surface.n, ends[:, 0], ends[:, 1])
    groups = [np.flatnonzero(low & (part == k)) for k in np.unique(part[low])]
    enough = 0.1 * max(map(len, groups))
    return [Foot("", surface.V[group], 0.0) for group in groups if len(group) >= enough]


def _resampled(P: Floats, step: float) -> Floats:
    """The closed line through P (k, 3) with points no further apart than `step`, those it had among them."""
    onward = np.roll(P, -1, axis=0) - P
    parts = np.maximum(np.ceil(np.linalg.norm(onward, axis=1) / step).astype(int), 1)
    index = np.repeat(np.arange(len(P)), parts)
    along = (np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[index]
    return np.asarray(P[index] + along[:, None] * onward[index])


def _stretches(loop: int, P: Floats, height: float, highest: float, span: float) -> list[Foot]:
    """The feet along one boundary loop, the closed line P (k, 3), whose lowest points are not higher than `highest`."""
    z = P[:, 2]
    if z.min() > highest:
        return []
    if np.ptp(z) < DIP * height:
        return [Foot("", P, closed_length(P), loop)]
    found = []
    for at in _valleys(z, DIP * height):
        if z[at] <= highest:
            low = _bridged(_around(z <= z[at] + 2 * LEVEL * height, at), z <= z[at] + LEVEL * height)
            stretch = P[_widened(P, low, SHORTEST * span)]
            found.append(Foot("", stretch, _length(stretch)))
    return found


def _valleys(z: Floats, depth: float) -> list[int]:
    """Where heights z (k,) along a closed line are lowest, with a rise of `depth` at least between two of them.

    Persistence of its low points [Edelsbrunner, Letscher and Zomorodian 2002]: from the lowest up, each begins a pool;
    where two pools meet, the one whose bottom is less deep ends, and counts if it is that deep there.
    """
    k = len(z)
    pool = np.full(k, -1)
    lasting = {int(z.argmin())}

    def bottom(i: int) -> int:
        while pool[i] != i:
            pool[i] = pool[pool[i]]
            i = int(pool[i])
        return i

    for i in np.argsort(z, kind="stable").tolist():
        pool[i] = i
        for other in ((i - 1) % k, (i + 1) % k):
            if pool[other] < 0 or bottom(other) == bottom(i):
                continue
            deep, shallow = sorted((bottom(i), bottom(other)), key=lambda b: (z[b], b))
            if z[i] - z[shallow] >= depth:
                lasting.add(shallow)
            pool[shallow] = deep
    return sorted(lasting)


def _around(low: Bools, at: int) -> Bools:
    """(k,) the connected stretch of a closed line around a place at which `low` holds."""
    if low.all():
        return low
    turned = np.roll(low, -at)
    stretch = np.zeros(len(low), dtype=bool)
    stretch[: int(turned.argmin())] = True
    stretch[len(low) - int(turned[::-1].argmin()) :] = True
    return np.roll(stretch, at)


def _bridged(reach: Bools, low: Bools) -> Bools:
    """(k,) the stretch from the first to the last place of a connected `reach` of a closed line that is `low`."""
    begin = int(np.flatnonzero(reach & ~np.roll(reach, 1))[0]) if not reach.all() else 0
    turned = np.roll(reach & low, -begin)
    places = np.flatnonzero(turned)
    turned[places[0] : places[-1] + 1] = True
    return np.roll(turned, begin)


def _widened(P: Floats, stretch: Bools, shortest: float) -> Ints:
    """Indices along a closed line P (k, 3) of a stretch, in order, made longer on its lower side until long enough; on
    both sides where they are as high: a foot on one side of its valley left a mirrored roof no mirror."""
    k, z = len(P), P[:, 2]
    same = ALIKE * float(np.ptp(z))
    begin = int(np.flatnonzero(stretch & ~np.roll(stretch, 1))[0])
    run = [(begin + j) % k for j in range(int(stretch.sum()))]
    while _length(P[run]) < shortest and len(run) < k // 3:
        before, after = (run[0] - 1) % k, (run[-1] + 1) % k
        left, right = z[before] <= z[after] + same, z[after] <= z[before] + same
        run = [before] * int(left) + run + [after] * int(right)
    return np.array(run)


def _length(P: Floats) -> float:
    return float(lengths(P[1:] - P[:-1]).sum())


def _named(surface: Surface, found: Sequence[Foot], span: float) -> tuple[Foot, ...]:
    """Masts, base rings, upper rims, springing lines and feet, those of a kind numbered where there are several."""
    kinds = [foot.name or _kind(surface, foot, span) for foot in found]
    several = [kinds.count(kind) > 1 for kind in kinds]
    names = [f"{kind} {kinds[: i + 1].count(kind)}" if several[i] else kind for i, kind in enumerate(kinds)]
    return tuple(replace(foot, name=name) for name, foot in zip(names, found, strict=True))


def _kind(surface: Surface, foot: Foot, span: float) -> str:
    if foot.loop is not None:
        return RIM if _hangs(surface, foot.loop) else "base ring"
    return "springing line" if foot.length > span / 2 else "foot"


STEM = 1 / 20
"""Share of the span that a stem under the lowest part of a hanging sheet reaches to each side."""


def stems(surface: Surface, stands: Sequence[Foot], span: float) -> tuple[Foot, ...]:
    """What a sheet that hangs from an upper rim, as a funnel or a bowl, might stand on instead: its lowest parts."""
    if not stands or not all(foot.name.startswith(RIM) for foot in stands):
        return ()
    x, y = surface.V[:, 0], surface.V[:, 1]
    found = []
    for sole in soles(surface, float(np.ptp(surface.V[:, 2]))):
        (left, front), (right, back) = sole.points[:, :2].min(axis=0), sole.points[:, :2].max(axis=0)
        reach = max(STEM * span, 2 * surface.mean_edge)
        near = (x >= left - reach) & (x <= right + reach) & (y >= front - reach) & (y <= back + reach)
        found.append(Foot("stem", surface.V[near], 0.0))
    return tuple(found)
