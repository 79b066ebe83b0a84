"""Checks of captions in the paper by Madan, Jacobson and Levin."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.design import Design
from dsfab.reproduction.renditions import Rendition
from dsfab.surface import Surface, edge_table

RINGS, SPOKES = 2, 4  # Least number of rings in a web, and of spokes across each ring.


@dataclass(frozen=True)
class Web:
    """Rings of one family of stripes around a load, the innermost ring first.
    family  : family of the rings; '' without rings.
    crossed : for each ring, the number of lines of the other family that cross the ring."""

    family: str = ""
    crossed: tuple[int, ...] = ()

    @property
    def is_web(self) -> bool:
        """True if at least `RINGS` rings are each crossed by at least `SPOKES` lines of the other family."""
        return sum(count >= SPOKES for count in self.crossed) >= RINGS

    @property
    def sentence(self) -> str:
        """Clause about rings and spokes, for a caption."""
        rings = [count for count in self.crossed if count >= SPOKES]
        if self.is_web:
            spokes = f"{min(rings)} to {max(rings)}" if min(rings) < max(rings) else f"{rings[0]}"
            return (
                f"a radial web: {len(rings)} rings of the {self.family} family around the load, each crossed by "
                f"{spokes} spokes"
            )
        if not self.crossed:
            return "no web here, because no line of either family forms a closed ring around the load"
        counted = f"{len(self.crossed)} ring{'s' * (len(self.crossed) > 1)} of the {self.family} family"
        return (
            f"no web here, because {len(rings)} of {counted} around the load "
            f"{'is' if len(rings) == 1 else 'are'} crossed by {SPOKES} spokes or more (spokes of each ring: "
            f"{', '.join(map(str, self.crossed))}); a web has at least {RINGS} of these rings"
        )


def web(surface: Surface, phases: Floats, load: Bools, supported: Bools) -> Web:
    """Return the closed rings of stripes around a load.
    phases : (n, 2) phases of the major and the minor family; a whole number at the middle of each member.
    load, supported : (n,) True for vertices under the load, and for vertices at supports."""
    webs = []
    for k, name in enumerate(("major", "minor")):
        levels = _levels(phases[:, k])
        regions = [_disc_around(surface, phases[:, k], level, load, supported) for level in levels]
        rings = sorted((int(r.sum()), level, r) for level, r in zip(levels, regions, strict=True) if r is not None)
        crossed = tuple(_crossings(surface, phases[:, k] - z, phases[:, 1 - k], r) for _, z, r in rings)
        webs.append(Web(name if crossed else "", crossed))
    return max(webs, key=lambda one: (sum(c >= SPOKES for c in one.crossed), len(one.crossed)))


def links(surface: Surface, phases: Floats, start: Bools, end: Bools) -> tuple[int, int]:
    """Return the numbers of major and minor members that connect vertices `start` (n,) with vertices `end` (n,)."""
    counts = [0, 0]
    for k, z in enumerate(phases.T):
        for level in _levels(z):
            faces, label = _lines(surface, z - level)
            start_lines, end_lines = (label[marked[surface.F[faces]].any(axis=1)] for marked in (start, end))
            counts[k] += len(np.intersect1d(start_lines, end_lines))
    return counts[0], counts[1]


def design_phases(design: Design) -> Floats:
    """Return phases (n, 2) of major and minor stripes from diffusion modes: mode * frequency + phase."""
    pattern, modes = design.pattern, (design.diffusion.major, design.diffusion.minor)
    x = np.stack([family.mode(number) for family, number in zip(modes, pattern.mode, strict=True)], axis=1)
    return np.asarray(x * np.array(pattern.frequency) + np.array(pattern.phase))


def loaded_patches(surface: Surface, loaded: Bools) -> list[Bools]:
    """Return a mask (n,) for each connected group of loaded vertices, the largest group first."""
    a, b = surface.edges.ends.T
    is_loaded = loaded[a] & loaded[b]
    label = _labels(a[is_loaded], b[is_loaded], surface.n)
    names, count = np.unique(label[loaded], return_counts=True)
    return [loaded & (label == name) for name in names[np.argsort(-count, kind="stable")]]


def _levels(z: Floats) -> Ints:
    return np.arange(np.ceil(z.min()), np.floor(z.max()) + 1).astype(int)


def _labels(a: Ints, b: Ints, n: int) -> Ints:
    return np.asarray(connected_components(coo_array((np.ones(len(a)), (a, b)), (n, n)), directed=False)[1])


def _disc_around(surface: Surface, z: Floats, level: int, load: Bools, supported: Bools) -> Bools | None:
    """Return a mask (n,) of the vertices around the load inside the contour z = `level`.
    Returns None unless the contour encloses a disc with the whole load and no support."""
    a, b = surface.edges.ends.T
    above = z >= level
    same_side = above[a] == above[b]
    label = _labels(a[same_side], b[same_side], surface.n)
    inside = np.unique(label[load])
    if len(inside) != 1:  # the contour crosses the load
        return None
    region = label == inside[0]
    return region if not region[supported].any() and _is_disc(surface, region) else None


def _is_disc(surface: Surface, region: Bools) -> bool:
    faces = surface.F[region[surface.F].any(axis=1)]
    rim = surface.edges.ends[surface.edges.boundary]
    return not region[rim].any() and len(np.unique(faces)) - len(edge_table(faces).ends) + len(faces) == 1


def _crossings(surface: Surface, ring: Floats, z: Floats, region: Bools) -> int:
    F = surface.F
    faces = np.flatnonzero(region[F].any(axis=1) & ~region[F].all(axis=1))
    crossing_values = np.empty((len(faces), 3))
    p, q = ring[F[faces]], z[F[faces]]
    inside = region[F[faces]]
    for side in range(3):
        next_side = (side + 1) % 3
        cut = inside[:, side] != inside[:, next_side]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = p[:, side] / (p[:, side] - p[:, next_side])
        crossing_values[:, side] = np.where(cut, q[:, side] + t * (q[:, next_side] - q[:, side]), np.nan)
    low, high = np.nanmin(crossing_values, axis=1), np.nanmax(crossing_values, axis=1)
    return int((np.floor(high) - np.floor(low)).sum())


def _lines(surface: Surface, z: Floats) -> tuple[Ints, Ints]:
    side = (z >= 0)[surface.F]
    faces = np.flatnonzero(side.any(axis=1) & ~side.all(axis=1))
    face_edges = surface.edges.of[faces]
    cut = side[faces] != np.roll(side[faces], -1, axis=1)
    pair = np.sort(np.where(cut, face_edges, -1), axis=1)[:, 1:]
    return faces, _labels(pair[:, 0], pair[:, 1], len(surface.edges.ends))[pair[:, 0]]


def nearby(surface: Surface, marked: Bools, rows: int = 1) -> Bools:
    """Return a mask (n,) of the marked vertices (n,) and of vertices up to `rows` edges away."""
    reached = marked.copy()
    a, b = surface.edges.ends.T
    for _ in range(rows):
        reach = reached[a] | reached[b]
        reached[a[reach]] = reached[b[reach]] = True
    return reached


ANGLE, EVENNESS = 60.0, 3.0  # limits for a grid: least crossing angle, degrees; largest P95 / P5 of member spacings


def finding(claim: str, rendition: Rendition) -> str:
    """Return a clause on whether dsfab's figure shows the paper's claim (web, beam, grid); '' without a claim."""
    if not claim or rendition.design is None:
        return ""
    if claim == "grid":
        return _grid_finding(rendition)
    design = rendition.design
    phases, loads = design_phases(design), loaded_patches(design.surface, design.load.loaded)
    if claim == "web":
        text = web(design.surface, phases, loads[0], design.load.supported).sentence
    else:
        text = _beam_finding(design, phases, loads, between=claim == "beams")
    return f"{text}; the design carries {rendition.carried:.0%} of the load" if rendition.carried < 0.995 else text


def _beam_finding(design: Design, phases: Floats, loads: list[Bools], between: bool) -> str:
    surface = design.surface
    start, end = (loads[0], loads[-1]) if between else (np.logical_or.reduce(loads), design.load.supported)
    counts = links(surface, phases, nearby(surface, start), nearby(surface, end))
    origin, goal = ("one load", "the other") if between else ("the load", "the supports")
    if not any(counts):
        return f"no beam here, because no line of either family runs without a break from {origin} to {goal}"
    name = "a beam" if sum(counts) == 1 else "beams"
    return (
        f"{name}: {counts[0]} lines of the major family and {counts[1]} lines of the minor family run without a break "
        f"from {origin} to {goal}"
    )


def _grid_finding(rendition: Rendition) -> str:
    text = f"members cross at {rendition.crossing:.0f} degrees or more, and the ratio P95 / P5 of their distances is "
    text += f"{rendition.evenness:.3g}"
    if rendition.crossing >= ANGLE and rendition.evenness <= EVENNESS:
        return f"a grid: {text}"
    return (
        f"no even grid here, because {text} (in a grid, this angle is {ANGLE:g} degrees or more, and this "
        f"ratio is up to {EVENNESS:g})"
    )
