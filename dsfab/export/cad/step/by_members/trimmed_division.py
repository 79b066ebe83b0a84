"""Division of trimmed regions by chords and seams where their surface misses the edges or the mesh."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, pairwise

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.limits import DEFLECTION
from dsfab.export.cad.step.by_members.curves import ChainCurve, on_skins, parts_of
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, turned
from dsfab.export.cad.step.by_members.patches import FaceLimits
from dsfab.export.cad.step.by_members.regions import Loop
from dsfab.export.cad.step.by_members.trimmed import (
    SPLIT,
    TrimmedFace,
    axes_of,
    beyond,
    middle_normal,
    misfit,
    misfits,
    trimmed_face,
)
from dsfab.export.cad.step.by_members.trimmed_corrections import without_strays
from dsfab.export.splines import bernstein

CLEAR = 0.3
"""Distance of each point of a chord from the outline over that from the chord's nearer end, at least: the sine of the
angle there, and no other edge is nearer."""

WIDE = 1 / 20
"""Mean width of what a chord cuts off, as a share of the thickness, at least: of a lens of two edges, 1.6 mm long and
.2 wide beside an edge that wiggles, OCCT draws no triangles."""

BESIDE = np.linspace(0, 1, 17)[1:-1]
"""Shares of a chord where that is asked."""

TRIED = 24
"""Chords that are tried, half of them from where the gap is widest."""

POINTS = 8
"""Of the outline along half an edge."""


@dataclass(frozen=True, eq=False)
class HalvedOutline:
    """A region's outline in halves of its edges; a place is where one begins.

    poles : (2 e, 4, 6) cubics in a row, two for each step of the loop.
    """

    poles: Floats

    @classmethod
    def of(cls, model: NetModel, loop: Loop) -> "HalvedOutline":
        """Of e steps."""
        whole = np.stack([model.poles(step) for step in loop])
        start, end = np.tile([0.0, 0.5], len(loop)), np.tile([0.5, 1.0], len(loop))
        poles = parts_of(np.repeat(whole, 2, axis=0), start, end)
        poles[::2, 0], poles[1::2, 3] = whole[:, 0], whole[:, 3]
        return cls(poles)

    @cached_property
    def line(self) -> Floats:
        """(2 e POINTS, 6) points along it, the first of them at its first place."""
        return np.asarray(bernstein(np.arange(POINTS) / POINTS) @ self.poles).reshape(-1, 6)

    def part(self, a: int, b: int, seam: Floats) -> Floats:
        """(k, 6) the closed line along it from place a to place b, and back along the cubics (c, 4, 6) of a seam from a
        to b."""
        turned = np.roll(self.line, -a * POINTS, axis=0)[: (b - a) % len(self.poles) * POINTS]
        back = bernstein(1 - np.arange(2 * POINTS) / (2 * POINTS)) @ seam[::-1]
        return np.concatenate([turned, back.reshape(-1, 6)])

    def chords(self, worst: Ints, times: int = 1) -> Iterator[tuple[int, int]]:
        """Pairs of places, ascending, between which a chord is inside and clear: those that are short for the smaller
        area that they cut off first, once of those from the worst places (k,), and once of all others; so many times
        `TRIED`."""
        axes = axes_of(middle_normal(self.line))
        line, at = self.line[:, :3] @ axes[:2].T, self.poles[:, 0, :3] @ axes[:2].T
        i, j = np.triu_indices(len(at), 1)
        area = np.append(0.0, np.cumsum(_cross(line, np.roll(line, -1, axis=0)))) / 2
        one = area[POINTS * j] - area[POINTS * i] + _cross(at[j], at[i]) / 2
        least = np.minimum(one, area[-1] - one)
        long = np.linalg.norm(at[j] - at[i], axis=1)
        order = np.argsort(long / np.maximum(least, 1e-300), kind="stable")
        narrow = WIDE * float(np.linalg.norm(self.line[:, :3] - self.line[:, 3:], axis=1).mean())
        order = order[least[order] > narrow * long[order]]  # what a chord outside cuts off runs the other way
        near = np.isin(i[order], worst) | np.isin(j[order], worst)
        for some in (order[near], order[~near]):
            clear = (k for k in some.tolist() if _is_clear(at[i[k]], at[j[k]], line))
            yield from ((int(i[k]), int(j[k])) for k in islice(clear, times * TRIED // 2))


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _is_clear(a: Floats, b: Floats, line: Floats) -> bool:
    """Whether the chord between two points (2,) of a closed line (k, 2) is as far from it as it has to be."""
    P, way = a + BESIDE[:, None] * (b - a), np.roll(line, -1, axis=0) - line
    from_start = P[:, None] - line
    x = np.clip((from_start * way).sum(axis=2) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
    apart = np.linalg.norm(from_start - x[..., None] * way, axis=2).min(axis=1)
    return bool((apart >= CLEAR * np.minimum(BESIDE, 1 - BESIDE) * np.linalg.norm(b - a)).all())


AT_GAP = 4
"""Places nearest to the widest gap, from which half of the seams that are tried begin."""

DEGREE = 6
"""Of the surfaces that seams are tried with."""

MANY = 2000
"""Points inside with which seams are tried, about, of more that there are: over a foot there were ten thousand."""

FULL = 3
"""Seams whose faces are made, of those that were tried, the best first."""

TIMES = 3
"""Times as many seams at most, where fewer do not help enough; then the best of all is taken: the first made of a cow's
nostril six parts of a few millimetres, two of degree 15, that crossed where OCCT drew them, and the best four."""

LESS = 0.9
"""Share of a region's `allowance_used` that the worse of its parts' is at most."""

OUT, OFF = 1 / 150, 2.0
"""Share of the box's diagonal that poles may be out of it, and times the distance that points inside may be off: a
hoof's poles were 320 mm beyond a cow of 2.3 m, and OCCT's box with them; the inside of another was 3.7 mm off where .8
are asked for."""

MOST = 12
"""Parts of a region."""

CUBICS, STRAYS = (1, 2, 4), 1 / 2
"""Of a seam, tried in this order until it is off the skins by no more than this share of what points inside may be:
one cubic through the foot of a figure of eight, 1.2 m long where the sheet waves, was 6.7 mm off, and so were faces.
Where seams are asked how far off the mesh they are, those of one cubic that are too far off are not taken: OCCT drew no
triangles of a cow's face beside one of more."""

READ = 8
"""Steps along a cubic between which that is asked."""

ALONG = np.linspace(0, 1, 17)
"""Shares of a seam where it is asked how far it is off the mesh."""


def parted(
    model: NetModel,
    faces: Mapping[int, TrimmedFace],
    inside: Callable[[Sequence[int]], dict[int, Floats]],
    away: Callable[[Floats], Floats],
    limits: FaceLimits,
) -> list[TrimmedFace]:
    """The faces of regions, those divided of which no edge can be split; the model gets the edges between their parts.

    inside : (k, 6) points inside of regions.    away : see `net_model`.
    """
    bad = [region for region, face in faces.items() if allowance_used(face, limits) > 1 and len(face.loops) == 1]
    if not bad:
        return list(faces.values())
    work, points = _Parting(model, away, limits), inside(bad)
    parts = {region: work.parts(faces[region], points[region]) for region in bad}
    found = [part for region, face in faces.items() for part in parts.get(region, [face])]
    return work.settled(found)


def allowance_used(face: TrimmedFace, limits: FaceLimits) -> float:
    """The largest of a face's gap, its distance from points inside, that of its poles from the box and, where that is
    asked, that from the mesh, each over what is allowed: over 1 it is divided."""
    out = max(beyond(poles, limits.box) for poles in (face.outer, face.inner))
    size = float(np.linalg.norm(limits.box[1] - limits.box[0]))
    astray = 1 + (face.astray + DEFLECTION * limits.off) / limits.off  # by so much what is drawn is farther off
    return max(face.gap / SPLIT, face.off / (OFF * limits.off), out / (OUT * size), astray)


class _Parting:
    """Divides regions of a model one after another; halves : of edges that became two, which.    times : as
    many seams as usual that are tried."""

    def __init__(self, model: NetModel, away: Callable[[Floats], Floats], limits: FaceLimits) -> None:
        self.model, self.away, self.limits = model, away, limits
        self.halves = dict[int, tuple[int, int]]()
        self.times = 1

    def parts(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        """The faces of a region with points (k, 6) inside that was one; where one of them still is too far off, and it
        is asked how far they are off the mesh, more seams are tried."""
        edges, vertices, halves = len(self.model.edges), len(self.model.vertices), dict(self.halves)
        for times in range(1, TIMES + 1 if self.limits.beyond_mesh else 2):
            del self.model.edges[edges:], self.model.vertices[vertices:]
            self.halves, self.times = dict(halves), times
            found = self._parts(face, points)
            if all(allowance_used(part, self.limits) <= 1 for part in found):
                break
        return found

    def _parts(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        todo, done = [replace(face, loops=[self.along(loop) for loop in face.loops])], list[TrimmedFace]()
        while todo:
            todo.sort(key=lambda face: allowance_used(face, self.limits))
            whole = todo.pop()
            two = self._two(whole, points) if len(todo) + len(done) + 1 < MOST else []
            for part in two or [whole]:
                (todo if two and allowance_used(part, self.limits) > 1 else done).append(part)
        return done

    def along(self, loop: Loop) -> Loop:
        """A loop over the halves of edges."""
        found: Loop = []
        for e, ahead in loop:
            two = self.halves.get(e, ())[:: 1 if ahead else -1]
            found += self.along([(half, ahead) for half in two]) if two else [(e, ahead)]
        return found

    def _two(self, face: TrimmedFace, points: Floats) -> list[TrimmedFace]:
        """Two faces instead of one, if neither is as bad: by the first seam that does it, or the best of many."""
        loop, model = self.along(face.loops[0]), self.model  # a seam that it has may have become two since
        best: tuple[int, int, Floats] | None = None
        least = LESS * allowance_used(face, self.limits)
        for ends, cubics in self._seams(HalvedOutline.of(model, loop), points):
            edges, vertices, halves = len(model.edges), len(model.vertices), dict(self.halves)
            two = self._faces(self._with_seam(loop, *ends, cubics), points)
            worse = max((allowance_used(part, self.limits) for part in two), default=np.inf)
            wide = face.gap <= SPLIT < max((part.gap for part in two), default=0.0)  # what could be cut still can
            if worse < least and not wide:
                if self.times == 1:
                    return two
                best, least = (*ends, cubics), worse
            del model.edges[edges:], model.vertices[vertices:]
            self.halves = halves
        return self._faces(self._with_seam(loop, *best), points) if best else []

    def _faces(self, loops: Iterable[Loop], points: Floats) -> list[TrimmedFace]:
        """Of parts with one loop each, if all can be made."""
        try:
            two = {i: trimmed_face(self.model, [loop], points, self.limits, True) for i, loop in enumerate(loops)}
        except ExportError:
            return []
        return list(without_strays(self.model, two, dict.fromkeys(two, points), self.away, self.limits).values())

    def _seams(self, outline: HalvedOutline, points: Floats) -> list[tuple[tuple[int, int], Floats]]:
        """Between which places seams may be, and the poles (k, 4, 6) of their cubics on the skins; those few whose
        parts fit best, the best first."""
        points = points[:: 1 + len(points) // MANY]
        off = misfit(points, outline.line, DEGREE).reshape(-1, POINTS).max(axis=1)
        worst = np.argsort(-np.maximum(off, np.roll(off, 1)), kind="stable")[:AT_GAP]
        pairs = list(outline.chords(worst, self.times))
        seams = self._on_skins([(outline.poles[a, 0], outline.poles[b, 0]) for a, b in pairs])
        near = [i for i, cubics in enumerate(seams) if self._is_near(cubics)]
        pairs, seams = [pairs[i] for i in near], [seams[i] for i in near]
        left, most = list[float](), self.times * FULL
        for (a, b), P in zip(pairs, seams, strict=True):
            two = outline.part(a, b, P), outline.part(b, a, P[::-1, ::-1])
            left.append(_worst_misfit(points, two, sorted(left)[most - 1] if len(left) >= most else np.inf))
        return [(pairs[i], seams[i]) for i in np.argsort(left, kind="stable").tolist()[:most]]

    def _on_skins(self, chords: Sequence[tuple[Floats, Floats]]) -> list[Floats]:
        """Between both points (6,) of chords, the poles (k, 4, 6) of so many cubics that they are near to the skins, or
        of as many as may be."""
        found, todo, share = [np.zeros((0, 4, 6))] * len(chords), list(range(len(chords))), np.linspace(0, 1, 4)
        for count in CUBICS[:1] if self.limits.beyond_mesh else CUBICS:
            if not todo:
                break
            breaks, places = (np.linspace(0, 1, k * count + 1) for k in (1, READ))
            at = (breaks[:-1, None] + share / count)[..., None]
            straight = [ChainCurve(breaks, a + at * (b - a)) for a, b in (chords[i] for i in todo)]
            curves = on_skins(straight, self.away)
            ways = self.away(np.concatenate([curve(places) for curve in curves])).reshape(len(curves), -1, 3)
            for i, curve in zip(todo, curves, strict=True):
                found[i] = curve.spans
            strays = np.linalg.norm(ways, axis=2).max(axis=1) > STRAYS * self.limits.off
            todo = [i for i, stray in zip(todo, strays, strict=True) if stray]
        return found

    def _is_near(self, cubics: Floats) -> bool:
        """Whether a seam (k, 4, 6) is near enough to the mesh, where that is asked: some pass by a crease."""
        beyond = self.limits.beyond_mesh
        return beyond is None or float(beyond((bernstein(ALONG) @ cubics).reshape(-1, 3)).max()) <= 0

    def _with_seam(self, loop: Loop, a: int, b: int, cubics: Floats) -> tuple[Loop, Loop]:
        """Both parts of a loop, with new edges in a row (k, 4, 6) from a place to a later one between them."""
        steps, at, model = list[tuple[int, bool]](), list[int](), self.model
        for i, step in enumerate(loop):
            at.append(len(steps))
            if 2 * i + 1 in (a, b):
                self._halve(step[0])
            steps += self.along([step])
            at.append(len(steps) - 1)
        start, end = (model.vertex(steps[at[place]], True) for place in (a, b))
        first, inner = len(model.edges), range(len(model.vertices), len(model.vertices) + len(cubics) - 1)
        model.vertices += [poles[3] for poles in cubics[:-1]]
        nodes = [start, *inner, end]
        model.edges += [NetEdge(*two, poles) for two, poles in zip(pairwise(nodes), cubics, strict=True)]
        onwards, count = [*steps[at[a] :], *steps[: at[a]]], at[b] - at[a]
        seam = [(first + i, True) for i in range(len(cubics))]
        return [*onwards[:count], *turned(seam)], [*onwards[count:], *seam]

    def _halve(self, e: int) -> None:
        """Make an edge two, in whose middle a vertex is."""
        edge, edges, middle = self.model.edges[e], self.model.edges, len(self.model.vertices)
        one, two = parts_of(np.stack([edge.poles] * 2), np.array([0.0, 0.5]), np.array([0.5, 1.0]))
        one[0], two[3], two[0] = edge.poles[0], edge.poles[3], one[3]
        self.model.vertices.append(one[3])
        self.halves[e] = len(edges), len(edges) + 1
        edges += [NetEdge(edge.start, middle, one), NetEdge(middle, edge.end, two)]

    def settled(self, faces: list[TrimmedFace]) -> list[TrimmedFace]:
        """The faces, and all of the model, over halves instead of what they are of."""
        model = self.model
        left = [e for e in range(len(model.edges)) if e not in self.halves]
        number = {e: i for i, e in enumerate(left)}

        def over(loop: Loop) -> Loop:
            return [(number[e], ahead) for e, ahead in self.along(loop)]

        new = model.over(over)
        model.edges = [model.edges[e] for e in left]
        model.walls, model.patches, model.trimmed = new.walls, new.patches, new.trimmed
        return [replace(face, loops=[over(loop) for loop in face.loops]) for face in faces]


def _worst_misfit(points: Floats, lines: Iterable[Floats], least: float) -> float:
    """The largest misfit of some outlines on either skin; infinite as soon as one is not less than `least`."""
    worst = 0.0
    for line in lines:
        for off in misfits(points, line, DEGREE):
            worst = max(worst, float(off.max()))
            if worst >= least:
                return np.inf
    return worst
