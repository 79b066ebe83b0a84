"""Proposed supports: low parts of the boundary or of a closed surface, masts, and the check against tipping."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints, lengths, polygon_perimeter
from dsfab.preset.proposal.reading import SOLE, is_nearly_closed
from dsfab.surface import Boundary, Box, Surface, link_components

LINE = 1 / 12
"""Feet are in one line if their plan is narrower than this share of the surface's width across that line."""


def tips(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Return True if a surface would tip over, because the middle of its plan lies outside the area between its feet.
    feet : points (k, 3) of each foot, metres."""
    if not feet:
        return False
    middle = surface.areas @ surface.centroids / surface.area
    x, y = (np.concatenate(feet) - middle)[:, :2].T
    angle = np.sort(np.arctan2(y, x))
    return bool(np.diff(angle, append=angle[0] + 2 * np.pi).max() > 1.03 * np.pi)  # all feet on one side of the middle


def turns(surface: Surface, feet: Sequence[Floats]) -> bool:
    """Return True if all feet (two or more) lie in one line, so that the surface could turn about this line.
    A saddle on two corners is an example. feet : points (k, 3) of each foot, metres."""
    if len(feet) < 2:
        return False
    plan = np.concatenate(feet)[:, :2]
    along = np.linalg.svd(plan - plan.mean(axis=0), full_matrices=False)[2][0]
    across = np.array([-along[1], along[0]])
    return bool(np.ptp(plan @ across) < LINE * np.ptp(surface.V[:, :2] @ across))


def mast_corners(P: Floats, arm: float, height: float) -> Ints:
    """Return the corners at which a sheet hangs from masts, as indices (k,) of P; empty for a sheet that does not.

    The sheet's edge needs three corners or more. Between two corners it bends inwards in plan. It also hangs below the
    straight line between the corners, or follows this line from a high corner to a low one. In contrast, the edge of a
    roof that stands on its corners rises from the corners; a saddle's edge is straight in plan.

    P      : (n, 3) points of the edge, a closed line, metres.
    arm    : distance (m) along the edge over which a corner's directions are measured.
    height : of the whole sheet, metres."""
    c = _corners(P, arm)
    if len(c) < 3:
        return c[:0]
    middle = P[c].mean(axis=0)
    arcs = [P[np.arange(a, b + 1) % len(P)] for a, b in zip(c, np.append(c[1:], c[0] + len(P)), strict=True)]
    return c if all(_masts_hangs(arc, middle, height) for arc in arcs) else c[:0]


def _masts_hangs(arc: Floats, middle: Floats, height: float) -> bool:
    start, chord = arc[0], arc[-1] - arc[0]
    long = max(float(np.hypot(*chord[:2])), 1e-300)
    normal = np.array([-chord[1], chord[0]]) / long
    normal *= np.sign(normal @ (middle - start)[:2])
    inwards = float(((arc - start)[:, :2] @ normal).max())
    share = np.clip((arc - start)[:, :2] @ chord[:2] / long**2, 0, 1)
    below = start[2] + share * chord[2] - arc[:, 2]
    # the edge of a sail is as straight as a cable in tension and slants by 0.3 of the height; the edge of a shell rises
    taut = abs(chord[2]) >= 0.3 * height and float(below.min()) >= -0.02 * height
    sags = float(below.max()) >= 0.08 * height
    return inwards >= 0.05 * long and (taut or sags)


def _corners(P: Floats, arm: float) -> Ints:
    """Return the sharpest corners (k,) of a closed line P (n, 3), of 45 degrees or more in plan, an `arm` apart."""
    along = np.concatenate([[0], np.cumsum(lengths(np.roll(P, -1, axis=0) - P))])
    total, n = float(along[-1]), len(P)
    before, after = (np.searchsorted(along, (along[:-1] + shift) % total) % n for shift in (-arm, arm))
    p, q = (P - P[before])[:, :2], (P[after] - P)[:, :2]
    turn = np.abs(np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], np.einsum("ni,ni->n", p, q)))
    turn[turn < np.radians(45.0)] = 0
    is_sharpest: Bools = turn > 0
    for i in np.flatnonzero(is_sharpest):
        gap = np.abs(along[:-1] - along[i])
        in_reach = np.minimum(gap, total - gap) <= arm
        is_sharpest[i] = int(np.flatnonzero(in_reach)[turn[in_reach].argmax()]) == i
    return np.flatnonzero(is_sharpest)


LEVEL = 0.05
"""A foot may rise from its lowest point by this share of the height."""
DIP = 0.15
"""The boundary has to rise by this share of the height between two feet."""
LOW = 0.35
"""The lowest point of a foot may be above the lowest foot by this share of the height."""
HIGHEST = 0.6
"""Value in place of `LOW` for a surface that would tip over on low feet, such as a folded roof on its valleys."""
SHORTEST = 1 / 25
"""Least length of a foot, as a share of the span."""
RIM = "upper rim"
"""Name of a loop of the boundary if a sheet hangs from it."""
STEP = 1 / 200
"""Distance between sampled points of the boundary, as a share of the span."""


@dataclass(frozen=True, eq=False)
class Foot:
    """A part of a surface that stands on the ground.
    name   : text for the user.    points : (k, 3) points along the free edge or on the surface, metres.
    length : length of free edge (m), 0 for a closed surface.    loop : number of the boundary loop, for a whole loop.
    """

    name: str
    points: Floats
    length: float
    loop: int | None = None

    def picker(self, margin: float, digits: int) -> Boundary | Box:
        """Return a picker for any mesh of the surface: the foot's loop, or its box enlarged by `margin` metres."""
        if self.loop is not None:
            return Boundary(self.loop)
        low, high = self.points.min(axis=0) - margin, self.points.max(axis=0) + margin
        corners = [tuple((np.round(corner, digits) + 0.0).tolist()) for corner in (low, high)]
        return Box(corners[0], corners[1], boundary=self.length > 0)


def feet(surface: Surface, span: float) -> tuple[Foot, ...]:
    """Return the proposed supports of a surface with z up; `span`: metres that the surface bridges.
    flat   : the outer edge is the support.
    closed : the lowest parts, up to `SOLE` times the height, are feet. Holes in the side of the surface are allowed.
    hung   : corners of the outer edge are feet, see `mast_corners`.
    else   : stretches of boundary around low points are feet: of the outer edge, of further edges that reach the
             ground, and of higher edges on a slope. Openings in the roof, with sheet below them, have no support."""
    height = float(np.ptp(surface.V[:, 2]))
    if is_nearly_closed(surface) or _has_sheet_below(surface, height):
        return _name_feet(surface, soles(surface, height), span)
    if height < 0.02 * surface.size:
        outline = surface.V[surface.loops[0]]
        return (Foot("edge", outline, polygon_perimeter(outline), loop=0),)
    ground = min(float(surface.V[loop, 2].min()) for loop in surface.loops)
    outer = _outer(surface)
    low_feet = _masts(surface, outer, height, span)
    if low_feet:
        return _name_feet(surface, low_feet, span)
    low = ground + LOW * height
    standing = [k for k, loop in enumerate(surface.loops) if outer[k] or _stands(surface, loop, low)]
    lines = {k: _densified_line(surface.V[surface.loops[k]], STEP * span) for k in standing}
    low_feet = [foot for k in standing for foot in _stretches(k, lines[k], height, low, span)]
    if tips(surface, [foot.points for foot in low_feet]):
        low_feet = _with_higher_feet(surface, lines, low_feet, ground, span)
    return _name_feet(surface, _on_a_slope(surface, lines, low_feet, span), span)


def _with_higher_feet(
    surface: Surface, lines: dict[int, Floats], low_feet: list[Foot], ground: float, span: float
) -> list[Foot]:
    """Add low points of the outer edges, the lowest first and up to `HIGHEST`, until the surface does not tip.
    If it tips with all of them, return the feet unchanged."""
    h = float(np.ptp(surface.V[:, 2]))
    outer = _outer(surface)
    places = sorted({float(P[v, 2]) for k, P in lines.items() if outer[k] for v in _valleys(P[:, 2], DIP * h)})
    for z in places:
        if ground + LOW * h < z <= ground + HIGHEST * h:
            highest = z + LEVEL * h
            more_feet = [foot for k, P in lines.items() for foot in _stretches(k, P, h, highest, span)]
            if not tips(surface, [foot.points for foot in more_feet]):
                return more_feet
    return low_feet


def _on_a_slope(surface: Surface, lines: dict[int, Floats], low_feet: list[Foot], span: float) -> list[Foot]:
    """Return the feet on the plane through the lowest points, if that gives more feet, as for a shell on a slope."""
    lowest = np.array([foot.points[foot.points[:, 2].argmin()] for foot in low_feet])
    if len(low_feet) < 3:
        return low_feet
    middle = lowest.mean(axis=0)
    plan = (lowest - middle)[:, :2]
    across, along = np.linalg.svd(plan, compute_uv=False)[::-1]
    if across < 0.1 * along:  # points near one line do not define a plane
        return low_feet
    slope, *_ = np.linalg.lstsq(plan, lowest[:, 2] - middle[2])

    def ground(P: Floats) -> Floats:
        z = middle[2] + (P - middle)[:, :2] @ slope
        return np.column_stack([np.zeros((len(P), 2)), z])

    height = float(np.ptp((surface.V - ground(surface.V))[:, 2]))
    level = {k: P - ground(P) for k, P in lines.items()}
    more_feet = [foot for k, P in level.items() for foot in _stretches(k, P, height, 0.1 * height, span)]
    on_it = [replace(foot, points=foot.points + ground(foot.points)) for foot in more_feet]
    return on_it if len(on_it) > len(low_feet) else low_feet


def _hangs(surface: Surface, loop: int) -> bool:
    middle = float(surface.vertex_areas @ surface.V[:, 2]) / surface.area
    return float(surface.V[surface.loops[loop], 2].mean()) > middle


def _has_sheet_below(surface: Surface, height: float) -> bool:
    """Return True for a single piece with sheet below its whole boundary that does not hang from an upper rim."""
    if surface.pieces[0] > 1:
        return False
    lowest = min(float(surface.V[loop, 2].min()) for loop in surface.loops)
    is_above = lowest > float(surface.V[:, 2].min()) + LEVEL * height
    return is_above and not any(_hangs(surface, k) for k in range(len(surface.loops)))


def _masts(surface: Surface, outer: list[bool], height: float, span: float) -> list[Foot]:
    masts = []
    for loop in (loop for k, loop in enumerate(surface.loops) if outer[k]):
        line = _densified_line(surface.V[loop], STEP * span)
        for corner in mast_corners(line, SHORTEST * span, height):
            stretch = line[_widen_stretch(line, np.arange(len(line)) == corner, SHORTEST * span)]
            masts.append(Foot("mast", stretch, _length(stretch)))
    return masts


def _outer(surface: Surface) -> list[bool]:
    piece = np.full(surface.n, -1)
    piece[surface.F] = surface.pieces[1][:, None]
    met: set[int] = set()
    is_longest = []
    for loop in surface.loops:
        is_longest.append(int(piece[loop[0]]) not in met)
        met.add(int(piece[loop[0]]))
    return is_longest


def _stands(surface: Surface, loop: Ints, ground: float) -> bool:
    z, edges = surface.V[:, 2], surface.edges
    on_loop = np.zeros(surface.n, dtype=bool)
    on_loop[loop] = True
    lowest = float(z[loop].min())
    if lowest > ground:
        return False
    height = float(np.ptp(z))
    even = 0.005  # a ring that rises by less than this share of the height is level
    on_loop &= z <= lowest + min(LEVEL * height, max(float(np.ptp(z[loop])) / 2, even * height))
    low = on_loop[edges.ends].all(axis=1) & edges.boundary
    faces = np.flatnonzero(low[edges.of].any(axis=1))
    rises = [z[surface.F[f]].sum() - 1.5 * z[edges.ends[e]].sum() for f in faces for e in edges.of[f] if low[e]]
    return bool(rises) and float(np.mean(rises)) > 0


def soles(surface: Surface, height: float) -> list[Foot]:
    """Return the lowest parts of a closed surface, on which it stands, without parts far smaller than the largest."""
    z = surface.V[:, 2]
    low = z <= z.min() + SOLE * height
    ends = surface.edges.ends[low[surface.edges.ends].all(axis=1)]
    _, part = link_components(surface.n, ends[:, 0], ends[:, 1])
    groups = [np.flatnonzero(low & (part == k)) for k in np.unique(part[low])]
    enough = 0.1 * max(map(len, groups))
    return [Foot("", surface.V[group], 0.0) for group in groups if len(group) >= enough]


def _densified_line(P: Floats, step: float) -> Floats:
    onward = np.roll(P, -1, axis=0) - P
    parts = np.maximum(np.ceil(np.linalg.norm(onward, axis=1) / step).astype(int), 1)
    index = np.repeat(np.arange(len(P)), parts)
    along = (np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[index]
    return np.asarray(P[index] + along[:, None] * onward[index])


def _stretches(loop: int, P: Floats, height: float, highest: float, span: float) -> list[Foot]:
    z = P[:, 2]
    if z.min() > highest:
        return []
    if np.ptp(z) < DIP * height:
        return [Foot("", P, polygon_perimeter(P), loop)]
    result = []
    for v in _valleys(z, DIP * height):
        if z[v] <= highest:
            low = _bridge_gaps(_stretch_around(z <= z[v] + 2 * LEVEL * height, v), z <= z[v] + LEVEL * height)
            stretch = P[_widen_stretch(P, low, SHORTEST * span)]
            result.append(Foot("", stretch, _length(stretch)))
    return result


def _valleys(z: Floats, depth: float) -> list[int]:
    """Return the lowest points of heights z (k,) along a closed line, with a rise of at least `depth` between any two.
    Method: persistence of minima [Edelsbrunner, Letscher and Zomorodian 2002]. Water fills the line in ascending order,
    and each minimum begins a pool. If two pools meet, the shallower pool ends; its minimum counts if it is `depth`
    deep."""
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
        for neighbour in ((i - 1) % k, (i + 1) % k):
            if pool[neighbour] < 0 or bottom(neighbour) == bottom(i):
                continue
            deep, shallow = sorted((bottom(i), bottom(neighbour)), key=lambda b: (z[b], b))
            if z[i] - z[shallow] >= depth:
                lasting.add(shallow)
            pool[shallow] = deep
    return sorted(lasting)


def _stretch_around(low: Bools, place: int) -> Bools:
    if low.all():
        return low
    turned = np.roll(low, -place)
    stretch = np.zeros(len(low), dtype=bool)
    stretch[: int(turned.argmin())] = True
    stretch[len(low) - int(turned[::-1].argmin()) :] = True
    return np.roll(stretch, place)


def _bridge_gaps(reach: Bools, low: Bools) -> Bools:
    begin = int(np.flatnonzero(reach & ~np.roll(reach, 1))[0]) if not reach.all() else 0
    turned = np.roll(reach & low, -begin)
    places = np.flatnonzero(turned)
    turned[places[0] : places[-1] + 1] = True
    return np.roll(turned, begin)


def _widen_stretch(P: Floats, stretch: Bools, shortest: float) -> Ints:
    """Extend a stretch of a closed line P (k, 3) on its lower side to the length `shortest` (m); return point numbers.
    At equal heights it grows on both sides, so that feet of a mirrored roof are mirror images."""
    k, z = len(P), P[:, 2]
    tolerance = 1e-4 * float(np.ptp(z))
    begin = int(np.flatnonzero(stretch & ~np.roll(stretch, 1))[0])
    run = [(begin + j) % k for j in range(int(stretch.sum()))]
    while _length(P[run]) < shortest and len(run) < k // 3:
        before, after = (run[0] - 1) % k, (run[-1] + 1) % k
        add_before, add_after = z[before] <= z[after] + tolerance, z[after] <= z[before] + tolerance
        run = [before] * int(add_before) + run + [after] * int(add_after)
    return np.array(run)


def _length(P: Floats) -> float:
    return float(lengths(P[1:] - P[:-1]).sum())


def _name_feet(surface: Surface, unnamed: Sequence[Foot], span: float) -> tuple[Foot, ...]:
    kinds = [foot.name or _kind(surface, foot, span) for foot in unnamed]
    several = [kinds.count(kind) > 1 for kind in kinds]
    names = [f"{kind} {kinds[: i + 1].count(kind)}" if several[i] else kind for i, kind in enumerate(kinds)]
    return tuple(replace(foot, name=name) for name, foot in zip(names, unnamed, strict=True))


def _kind(surface: Surface, foot: Foot, span: float) -> str:
    if foot.loop is not None:
        return RIM if _hangs(surface, foot.loop) else "base ring"
    return "springing line" if foot.length > span / 2 else "foot"


def stems(surface: Surface, stands: Sequence[Foot], span: float) -> tuple[Foot, ...]:
    """Return the lowest parts of a sheet that hangs from an upper rim, such as a funnel: an alternative support."""
    if not stands or not all(foot.name.startswith(RIM) for foot in stands):
        return ()
    x, y = surface.V[:, 0], surface.V[:, 1]
    result = []
    for sole in soles(surface, float(np.ptp(surface.V[:, 2]))):
        (x_min, front), (x_max, back) = sole.points[:, :2].min(axis=0), sole.points[:, :2].max(axis=0)
        reach = max(1 / 20 * span, 2 * surface.mean_edge)
        is_near = (x >= x_min - reach) & (x <= x_max + reach) & (y >= front - reach) & (y <= back + reach)
        result.append(Foot("stem", surface.V[is_near], 0.0))
    return tuple(result)
