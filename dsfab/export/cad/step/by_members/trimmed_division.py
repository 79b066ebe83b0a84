"""Division of trimmed regions by seams."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints, plane_cross
from dsfab.core.errors import ExportError
from dsfab.core.limits import DEFLECTION
from dsfab.export.cad.step.by_members.curves import ChainCurve, on_skins, parts_of
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, backwards
from dsfab.export.cad.step.by_members.patches import FaceLimits
from dsfab.export.cad.step.by_members.regions import ChainLoop
from dsfab.export.cad.step.by_members.trimmed import (
    SPLIT,
    TrimmedFace,
    axes_of,
    distance_outside,
    middle_normal,
    misfit,
    misfits,
    trimmed_face,
)
from dsfab.export.cad.step.by_members.trimmed_corrections import without_strays
from dsfab.export.splines import bernstein

TRIED = 24  # largest number of chords that are tried across a region; half of them begin at the widest gaps
POINTS = 8  # number of points of the outline along half an edge


@dataclass(frozen=True, eq=False)
class HalvedOutline:
    """Outline of a region with e edges, each cut into halves. Place i is the start of half number i.
    poles : (2 e, 4, 6) control points of the halves in order, mm."""

    poles: Floats

    @classmethod
    def from_loop(cls, model: NetModel, loop: ChainLoop) -> "HalvedOutline":
        """Cut each edge of a loop into halves, and return the outline."""
        step_poles = np.stack([model.poles(step) for step in loop])
        start, end = np.tile([0.0, 0.5], len(loop)), np.tile([0.5, 1.0], len(loop))
        poles = parts_of(np.repeat(step_poles, 2, axis=0), start, end)
        poles[::2, 0], poles[1::2, 3] = step_poles[:, 0], step_poles[:, 3]
        return cls(poles)

    @cached_property
    def line(self) -> Floats:
        """Points (k, 6) along the outline, `POINTS` on each half of an edge."""
        return np.asarray(bernstein(np.arange(POINTS) / POINTS) @ self.poles).reshape(-1, 6)

    def part(self, a: int, b: int, seam: Floats) -> Floats:
        """Return a closed line (k, 6) along the outline from place a to place b, and back along a seam (c, 4, 6)."""
        turned = np.roll(self.line, -a * POINTS, axis=0)[: (b - a) % len(self.poles) * POINTS]
        back = bernstein(1 - np.arange(2 * POINTS) / (2 * POINTS)) @ seam[::-1]
        return np.concatenate([turned, back.reshape(-1, 6)])

    def chords(self, worst: Ints, times: int = 1) -> Iterator[tuple[int, int]]:
        """Yield pairs (i, j), i < j, of places with a chord well inside the outline. times : factor on their number.
        worst : (k,) places with the widest gaps."""
        least_width = 1 / 20  # smallest width of a part / thickness; OCCT fails on narrower parts
        axes = axes_of(middle_normal(self.line))
        line, place_points = self.line[:, :3] @ axes[:2].T, self.poles[:, 0, :3] @ axes[:2].T
        i, j = np.triu_indices(len(place_points), 1)
        area = np.append(0.0, np.cumsum(plane_cross(line, np.roll(line, -1, axis=0)))) / 2
        cut_area = area[POINTS * j] - area[POINTS * i] + plane_cross(place_points[j], place_points[i]) / 2
        least = np.minimum(cut_area, area[-1] - cut_area)
        long = np.linalg.norm(place_points[j] - place_points[i], axis=1)
        order = np.argsort(long / np.maximum(least, 1e-300), kind="stable")
        narrow = least_width * float(np.linalg.norm(self.line[:, :3] - self.line[:, 3:], axis=1).mean())
        order = order[least[order] > narrow * long[order]]  # drop chords that leave the outline or make narrow parts
        is_near = np.isin(i[order], worst) | np.isin(j[order], worst)
        for group in (order[is_near], order[~is_near]):
            clear = (k for k in group.tolist() if _is_clear(place_points[i[k]], place_points[j[k]], line))
            yield from ((int(i[k]), int(j[k])) for k in islice(clear, times * TRIED // 2))


def _is_clear(a: Floats, b: Floats, line: Floats) -> bool:
    clear = 0.3  # least distance of a point on a chord to the outline / to the nearer end of the chord
    shares = np.linspace(0, 1, 17)[1:-1]
    P, directions = a + shares[:, None] * (b - a), np.roll(line, -1, axis=0) - line
    from_start = P[:, None] - line
    x = np.clip((from_start * directions).sum(axis=2) / np.maximum((directions**2).sum(axis=1), 1e-300), 0, 1)
    apart = np.linalg.norm(from_start - x[..., None] * directions, axis=2).min(axis=1)
    return bool((apart >= clear * np.minimum(shares, 1 - shares) * np.linalg.norm(b - a)).all())


TRIAL_DEGREE = 6  # degree of the surfaces that are fitted to compare possible seams

TIMES = 3
"""Largest factor on the number of seams tried in a face. It rises while parts of the divided face exceed a limit."""

OUT, OFF = 1 / 150, 2.0
"""Limits beyond which a face is divided. OUT : distance of poles outside of `limits.box` / the box's diagonal.
OFF : distance of the face from the inner points of its region / `limits.off`."""

CUBIC_COUNTS, STRAY_SHARE = (1, 2, 4), 1 / 2
"""CUBIC_COUNTS : tried numbers of cubics in a seam. STRAY_SHARE : limit of a seam's distance from skins / `limits.off`.
If the distance from the mesh is limited, a seam is a single cubic: OCCT would fail beside a seam of several cubics."""


def divided_faces(
    model: NetModel,
    faces: Mapping[int, TrimmedFace],
    inside: Callable[[Sequence[int]], dict[int, Floats]],
    away: Callable[[Floats], Floats],
    limits: FaceLimits,
) -> list[TrimmedFace]:
    """Divide each face that exceeds its limits, and add the new edges to the model.
    inside : function of region numbers; returns, by number, points (k, 6) inside the region.
    away   : function of pairs of points (k, 6), one near each skin; returns the vectors (k, 6) to the skins."""
    bad = [region for region, face in faces.items() if allowance_used(face, limits) > 1 and len(face.loops) == 1]
    if not bad:
        return list(faces.values())
    work, points = FaceDivision(model, away, limits), inside(bad)
    parts = {region: work.parts(faces[region], points[region]) for region in bad}
    return work.finish([part for region, face in faces.items() for part in parts.get(region, [face])])


def allowance_used(face: TrimmedFace, limits: FaceLimits) -> float:
    """Return the largest ratio of a face's gap or distances to their limits. Above 1, the face is divided."""
    out = max(distance_outside(poles, limits.box) for poles in (face.outer, face.inner))
    size = float(np.linalg.norm(limits.box[1] - limits.box[0]))
    astray = 1 + (face.astray + DEFLECTION * limits.off) / limits.off  # includes the error of OCCT's triangles
    return max(face.gap / SPLIT, face.off / (OFF * limits.off), out / (OUT * size), astray)


class FaceDivision:
    """Division of a model's faces by seams. halves : number of a halved edge -> numbers of its two halves."""

    def __init__(self, model: NetModel, away: Callable[[Floats], Floats], limits: FaceLimits) -> None:
        self.model, self.away, self.limits = model, away, limits
        self.halves = dict[int, tuple[int, int]]()
        self.times = 1

    def parts(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        """Divide a face until its parts keep the limits, if possible; return the parts. points : (k, 6) inside."""
        edges, vertices, halves = len(self.model.edges), len(self.model.vertices), dict(self.halves)
        for times in range(1, TIMES + 1 if self.limits.beyond_mesh else 2):
            del self.model.edges[edges:], self.model.vertices[vertices:]
            self.halves, self.times = dict(halves), times
            pieces = self._parts(face, points)
            if all(allowance_used(part, self.limits) <= 1 for part in pieces):
                break
        return pieces

    def _parts(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        largest_count = 12  # one region has at most 12 parts
        todo, finished = [replace(face, loops=[self.over_halves(loop) for loop in face.loops])], list[TrimmedFace]()
        while todo:
            todo.sort(key=lambda face: allowance_used(face, self.limits))
            worst_face = todo.pop()
            two = self.two_parts(worst_face, points) if len(todo) + len(finished) + 1 < largest_count else []
            for part in two or [worst_face]:
                (todo if two and allowance_used(part, self.limits) > 1 else finished).append(part)
        return finished

    def over_halves(self, loop: ChainLoop) -> ChainLoop:
        """Replace each halved edge of a loop by its two halves, and return the new loop."""
        steps: ChainLoop = []
        for e, ahead in loop:
            two = self.halves.get(e, ())[:: 1 if ahead else -1]
            steps += self.over_halves([(half, ahead) for half in two]) if two else [(e, ahead)]
        return steps

    def two_parts(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        """Divide a face into two parts that keep the limits better; [] if no seam helps. points : (k, 6) inside."""
        less = 0.9  # `allowance_used` of each part / `allowance_used` of the undivided face must be less than this
        loop, model = self.over_halves(face.loops[0]), self.model  # divisions of other faces may have halved edges
        best_seam: tuple[int, int, Floats] | None = None
        least = less * allowance_used(face, self.limits)
        for ends, cubics in self.seams(HalvedOutline.from_loop(model, loop), points):
            edges, vertices, halves = len(model.edges), len(model.vertices), dict(self.halves)
            two = self.part_faces(self.seam_loops(loop, *ends, cubics), points)
            worse = max((allowance_used(part, self.limits) for part in two), default=np.inf)
            # CAD programs cannot cut an edge whose gap to its face is wider than SPLIT
            wide = face.gap <= SPLIT < max((part.gap for part in two), default=0.0)
            if worse < least and not wide:
                if self.times == 1:
                    return two
                best_seam, least = (*ends, cubics), worse
            del model.edges[edges:], model.vertices[vertices:]
            self.halves = halves
        return self.part_faces(self.seam_loops(loop, *best_seam), points) if best_seam else []

    def part_faces(self, loops: Iterable[ChainLoop], points: Floats) -> list[TrimmedFace]:
        """Return a face fitted inside each loop of edges; [] if a fit fails. points : (k, 6) inside the region."""
        try:
            two = {i: trimmed_face(self.model, [loop], points, self.limits, True) for i, loop in enumerate(loops)}
        except ExportError:
            return []
        return list(without_strays(self.model, two, dict.fromkeys(two, points), self.away, self.limits).values())

    def seams(self, outline: HalvedOutline, points: Floats) -> list[tuple[tuple[int, int], Floats]]:
        """Return the best seams across a region: the two places on the outline and the cubics (c, 4, 6) of each."""
        full = 3  # the 3 * `times` seams with the smallest errors are returned
        many = 2000  # largest number of points in a trial
        at_gap = 4  # half of the tried seams begin at the four places with the widest gaps
        points = points[:: 1 + len(points) // many]
        distances = misfit(points, outline.line, TRIAL_DEGREE).reshape(-1, POINTS).max(axis=1)
        worst = np.argsort(-np.maximum(distances, np.roll(distances, 1)), kind="stable")[:at_gap]
        pairs = list(outline.chords(worst, self.times))
        seams = self.chord_cubics([(outline.poles[a, 0], outline.poles[b, 0]) for a, b in pairs])
        near_numbers = [i for i, cubics in enumerate(seams) if self._is_near(cubics)]
        pairs, seams = [pairs[i] for i in near_numbers], [seams[i] for i in near_numbers]
        errors, limit = list[float](), self.times * full
        for (a, b), P in zip(pairs, seams, strict=True):
            two = outline.part(a, b, P), outline.part(b, a, P[::-1, ::-1])
            errors.append(worst_misfit(points, two, sorted(errors)[limit - 1] if len(errors) >= limit else np.inf))
        return [(pairs[i], seams[i]) for i in np.argsort(errors, kind="stable").tolist()[:limit]]

    def chord_cubics(self, chords: Sequence[tuple[Floats, Floats]]) -> list[Floats]:
        """Return, for each chord with ends (6,), the cubics (k, 4, 6) of a curve on both skins between the ends."""
        checks = 8  # the distance of each cubic from the skins is measured at 8 places
        result, todo, share = [np.zeros((0, 4, 6))] * len(chords), list(range(len(chords))), np.linspace(0, 1, 4)
        for count in CUBIC_COUNTS[:1] if self.limits.beyond_mesh else CUBIC_COUNTS:
            if not todo:
                break
            breaks, places = (np.linspace(0, 1, k * count + 1) for k in (1, checks))
            pole_shares = (breaks[:-1, None] + share / count)[..., None]
            straight = [ChainCurve(breaks, a + pole_shares * (b - a)) for a, b in (chords[i] for i in todo)]
            curves = on_skins(straight, self.away)
            ways = self.away(np.concatenate([curve(places) for curve in curves])).reshape(len(curves), -1, 3)
            for i, curve in zip(todo, curves, strict=True):
                result[i] = curve.spans
            strays = np.linalg.norm(ways, axis=2).max(axis=1) > STRAY_SHARE * self.limits.off
            todo = [i for i, stray in zip(todo, strays, strict=True) if stray]
        return result

    def _is_near(self, cubics: Floats) -> bool:
        beyond, samples = self.limits.beyond_mesh, bernstein(np.linspace(0, 1, 17)) @ cubics
        return beyond is None or float(beyond(samples.reshape(-1, 3)).max()) <= 0

    def seam_loops(self, loop: ChainLoop, a: int, b: int, cubics: Floats) -> tuple[ChainLoop, ChainLoop]:
        """Divide a loop at places a and b by a seam of cubics (c, 4, 6); return the two loops."""
        steps, place_steps, model = list[tuple[int, bool]](), list[int](), self.model
        for i, step in enumerate(loop):
            place_steps.append(len(steps))
            if 2 * i + 1 in (a, b):
                self.halve(step[0])
            steps += self.over_halves([step])
            place_steps.append(len(steps) - 1)
        start, end = (model.vertex(steps[place_steps[place]], True) for place in (a, b))
        first_edge, inner = len(model.edges), range(len(model.vertices), len(model.vertices) + len(cubics) - 1)
        model.vertices += [poles[3] for poles in cubics[:-1]]
        nodes = [start, *inner, end]
        model.edges += [NetEdge(*two, poles) for two, poles in zip(pairwise(nodes), cubics, strict=True)]
        onwards, count = [*steps[place_steps[a] :], *steps[: place_steps[a]]], place_steps[b] - place_steps[a]
        seam = [(first_edge + i, True) for i in range(len(cubics))]
        return [*onwards[:count], *backwards(seam)], [*onwards[count:], *seam]

    def halve(self, e: int) -> None:
        edge, edges, middle = self.model.edges[e], self.model.edges, len(self.model.vertices)
        first_poles, second_poles = parts_of(np.stack([edge.poles] * 2), np.array([0.0, 0.5]), np.array([0.5, 1.0]))
        first_poles[0], second_poles[3], second_poles[0] = edge.poles[0], edge.poles[3], first_poles[3]
        self.model.vertices.append(first_poles[3])
        self.halves[e] = len(edges), len(edges) + 1
        edges += [NetEdge(edge.start, middle, first_poles), NetEdge(middle, edge.end, second_poles)]

    def finish(self, faces: list[TrimmedFace]) -> list[TrimmedFace]:
        """Remove halved edges from the model, and return the faces with new edge numbers."""
        model = self.model
        remaining = [e for e in range(len(model.edges)) if e not in self.halves]
        number = {e: i for i, e in enumerate(remaining)}

        def renumber(loop: ChainLoop) -> ChainLoop:
            return [(number[e], ahead) for e, ahead in self.over_halves(loop)]

        new_model = model.with_loops(renumber)
        model.edges = [model.edges[e] for e in remaining]
        model.walls, model.patches, model.trimmed = new_model.walls, new_model.patches, new_model.trimmed
        return [replace(face, loops=[renumber(loop) for loop in face.loops]) for face in faces]


def worst_misfit(points: Floats, lines: Iterable[Floats], least: float) -> float:
    """Return the largest distance (mm) of closed lines (k, 6) from fitted surfaces; inf if a value reaches `least`."""
    worst = 0.0
    for line in lines:
        for distances in misfits(points, line, TRIAL_DEGREE):
            worst = max(worst, float(distances.max()))
            if worst >= least:
                return np.inf
    return worst
