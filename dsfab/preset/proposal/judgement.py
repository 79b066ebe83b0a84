"""Ways to support a surface, called readings, with scores.

Score of a reading = form x carries x steady x free.

form    : 0 to 1, from the shape alone.
carries : 1 / (1 + u^2), u is the larger of movement / (`LIMIT` x span) and stress / strength.
steady  : 1 if the centre of mass is well inside the supports.
free    : 1 if no edge is supported, 1 - `EDGE` if all edges are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, lengths, weighted_quantile
from dsfab.core.errors import DsfabError, PresetError
from dsfab.core.units import GRAVITY, metres_per
from dsfab.preset.proposal.readings import (
    DRAWN,
    Kind,
    SupportReading,
    distinct_readings,
    low_places,
    numbered_places,
    readings,
    soles,
)
from dsfab.preset.proposal.shape import HEAD, STRIP, Shape, coarse_surface, depth_within, is_nearly_closed
from dsfab.statics import PAPER, Material, SheetModel, equilibrium, sheet_stiffness, sheet_stress
from dsfab.surface import LoadCase, Surface, Up, upright_vertices

DEEP = {"roof": 50.0, "hung": 50.0, "floor": 25.0, "wall": 20.0}
"""Usual ratio of a surface's size (see `_depth`) to the depth of the surface's ribs, by kind of surface."""
LOAD = {"roof": 750.0, "hung": 300.0, "floor": 5000.0, "wall": 800.0}  # Usual load, Pa: snow, services, people, wind.
TIMBER, STRENGTH = Material(11e9, 0.3, 420.0), 15e6  # GL24h: strength 24 MPa x 0.8 / 1.25.
LIMIT = 1 / 300  # Largest usual movement, divided by the span.
EDGE = 0.5  # Fraction by which a score is reduced if all edges of the sheet are supported.
UNITS = {"m": 0.45, "mm": 0.33, "cm": 0.12, "ft": 0.05, "in": 0.02}  # Share of each unit among files without a unit.
BUILDING, SPREAD = 18.0, 1.1  # Median length of buildings, metres, and standard deviation of its logarithm.
LEAST, DOUBT = 0.02, 0.25  # Smallest score of plausible supports; smallest score of supports that dsfab does not doubt.
CLOSE = 0.75  # dsfab asks about supports whose score is at least this share of the best score.
OPEN = 0.13  # dsfab asks about the unit if the second most probable unit has at least this probability.
UNDER = 0.7  # Factor on the score of a vertical axis if the surface would then reach below the ground (z = 0).


@dataclass(frozen=True, eq=False)
class JudgedReading:
    """A way to support a surface, with its score. up : axis of the user's mesh that points up.
    built_in : True for clamped supports: for a wall, and for a single line of support that is not a closed loop.
    figures  : values from which the score is computed, by name; may be empty."""

    reading: SupportReading
    score: float
    up: Up
    built_in: bool = False
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def tips(self) -> bool:
        """True if the centre of mass lies outside the supports."""
        return not self.built_in and self.figures.get("steady", 1.0) < 0.5


def judgement(shape: Shape, reading: SupportReading, up: Up = "z", usual: float = 1.0) -> JudgedReading:
    """Return the way `reading` to support a shape, with a score. The score is 0 if the sheet could move freely.
    up : axis of the user's mesh that points up.    usual : factor on the score, smaller for an improbable axis."""
    if reading.kind == "object":
        return JudgedReading(reading, DRAWN * usual, up)
    surface, supported = shape.surface, reading.vertices(shape.surface)
    free = ~np.isin(surface.vertex_pieces, surface.vertex_pieces[supported])
    is_line = len(reading.places) == 1 and bool(
        np.linalg.norm(np.ptp(surface.V[supported], axis=0)) > 0.5 * shape.width
    )
    rows = supported
    if reading.kind in ("wall", "floor") or reading.word in ("edge", "edges", "ring") or is_line:
        rows = supported | np.isin(np.arange(surface.n), surface.F[supported[surface.F].sum(axis=1) >= 2])
    thick = _depth(shape, reading.kind)
    sheet = SheetModel(surface, TIMBER, thick)
    fixed = np.repeat((rows | free)[:, None], 3, axis=1)
    load = LoadCase(fixed, _forces(shape, reading.kind, thick), np.zeros(surface.n, dtype=bool))
    try:
        answer = equilibrium(surface, sheet_stiffness(sheet, PAPER), load)
    except DsfabError:
        return JudgedReading(reading, 0.0, up)
    span = 2 * float(np.max(cKDTree(surface.V[supported]).query(surface.V)[0]))
    if reading.kind in ("roof", "hung"):
        span = min(span, 2 * shape.width)  # a larger span does not increase the allowed movement
    moved = float(np.quantile(lengths(answer.u), 0.99))
    stress = weighted_quantile(sheet_stress(sheet, PAPER, answer).largest, surface.areas, 0.9)
    used = max(moved / (LIMIT * span) if span else 0.0, stress / STRENGTH)  # span 0: all vertices are supported
    steady = _steadiness(shape, reading, supported, _upward(reading, surface, rows, answer.reaction), is_line)
    rim = surface.edge_lengths * surface.edges.boundary
    share = float(rim[supported[surface.edges.ends].all(axis=1)].sum() / rim.sum())
    carried = 1 - float(surface.vertex_areas[free].sum()) / surface.area
    score = reading.form / (1 + used**2) * steady * (1 - EDGE * share) * carried * usual
    figures = {"form": reading.form, "used": used, "steady": steady, "held": share}
    built_in = reading.kind == "wall" or (is_line and not reading.places[0].is_loop)
    return JudgedReading(reading, score, up, built_in, figures)


def _steadiness(shape: Shape, reading: SupportReading, supported: Bools, upward: Floats, is_line: bool) -> float:
    if reading.kind in ("wall", "floor"):
        return 1.0
    if reading.kind == "hung" and len(reading.places) == 1 and reading.places[0].name != "upper rim":
        return 0.3
    pull = float(-np.minimum(upward, 0).sum() / max(np.abs(upward).sum(), 1e-12))
    steady = float(np.clip(0.5 + _inside(shape, supported) / (0.2 * shape.width), 0.05, 1) * (1 - pull))
    return max(steady, 0.5) if is_line else steady


def _depth(shape: Shape, kind: str) -> float:
    long = shape.sides[1].length if shape.ratio > STRIP else shape.width
    size = {"floor": long, "wall": min(shape.rise, shape.width, 0.4 * DEEP["wall"])}.get(kind, shape.width)
    return size / DEEP[kind]


def _forces(shape: Shape, kind: str, thick: float) -> Floats:
    surface = shape.surface
    down = np.array([0.0, 0.0, -1.0])
    pressure = surface.normals if kind == "wall" else np.abs(surface.normals[:, 2:]) * down
    force = surface.vertex_areas[:, None] * (TIMBER.density * GRAVITY * thick) * down
    on_corner = LOAD[kind] * pressure * (surface.areas / 3)[:, None]
    np.add.at(force, surface.F.ravel(), np.repeat(on_corner, 3, axis=0))
    return np.asarray(force)


def _upward(reading: SupportReading, surface: Surface, rows: Bools, reaction: Floats) -> Floats:
    points = np.concatenate([place.points for place in reading.places])
    owner = np.repeat(np.arange(len(reading.places)), [len(place.points) for place in reading.places])
    nearest = owner[cKDTree(points).query(surface.V[rows])[1]]
    return np.asarray(np.bincount(nearest, reaction[rows, 2], len(reading.places)), dtype=np.float64)


def _inside(shape: Shape, supported: Bools) -> float:
    """Return the distance in plan (m) from the centre of mass to the convex hull of the supports; negative outside."""
    P, middle = shape.surface.V[supported, :2], shape.middle[:2]
    depth = depth_within(P, middle)
    if depth is not None:
        return depth
    across = np.linalg.svd(P - P.mean(axis=0))[2][-1] if len(P) > 1 else np.zeros(2)
    return -abs(float((middle - P.mean(axis=0)) @ across))


def usual_unit(unit: str, size: float) -> float:
    """Return the relative probability of a length unit. size : longest side of the surface, in this unit."""
    return UNITS[unit] * float(np.exp(-0.5 * (np.log(metres_per(unit) * size / BUILDING) / SPREAD) ** 2))


def likely_units(shape: Shape) -> list[tuple[str, float]]:
    """Return pairs (unit, probability), the most probable first, for a shape in an unknown unit."""
    V = shape.surface.V
    size, plan = float(np.ptp(V, axis=0).max()), V[:, :2] - V[:, :2].mean(axis=0)
    narrow = np.ptp(plan @ np.linalg.svd(plan, full_matrices=False)[2].T, axis=0).min()
    comes_down = shape.plan_share < 0.4 or shape.rise > 0.25 * narrow
    weight = {}
    for unit in UNITS:
        is_low = comes_down and metres_per(unit) * shape.rise < HEAD
        weight[unit] = usual_unit(unit, size) * (0.1 if is_low else 1.0)
    total = sum(weight.values())
    return sorted(((unit, share / total) for unit, share in weight.items()), key=lambda candidate: -candidate[1])


@dataclass(frozen=True, eq=False)
class SupportChoice:
    """Scored ways to support a surface, and the unit of the surface.    ranking : the best score first.
    units : pairs of a possible unit and its probability; empty if the unit is known."""

    ranking: tuple[JudgedReading, ...]
    unit: str
    units: tuple[tuple[str, float], ...]

    @property
    def best(self) -> JudgedReading:
        return self.ranking[0]

    def require_plausible(self) -> None:
        """Raise PresetError if no way of support is plausible."""
        if self.best.score < LEAST:
            tried = "; ".join(
                f"{candidate.reading.word} ({candidate.up} up): {_flaw(candidate)}" for candidate in self.ranking[:4]
            )
            raise PresetError(
                f"dsfab finds no plausible way to support the surface; dsfab tried {tried}; name the supports with "
                f"--stand, the unit with --unit, or the vertical axis with --up"
            )

    @property
    def rivals(self) -> list[JudgedReading]:
        """Up to two further ways of support with nearly the best score."""
        rivals = [rival for rival in self.ranking[1:] if rival.score > CLOSE * self.best.score]
        best_on = {rival.up: rival for rival in reversed(rivals)}
        return [rival for rival in rivals if rival.up == self.best.up or rival is best_on[rival.up]][:2]

    @property
    def runners_up(self) -> list[JudgedReading]:
        """Up to three plausible ways of support after the best, with the same vertical axis."""
        return [rival for rival in self.ranking[1:] if rival.up == self.best.up and rival.score > LEAST][:3]

    @property
    def rival_unit(self) -> str:
        """Second most probable unit of the surface; '' if the unit is known or this second unit is improbable."""
        return self.units[1][0] if self.units and self.units[1][1] > OPEN else ""


def choice(surface: Surface, axes: Mapping[Up, float], unit: str = "", stand: str = "") -> SupportChoice:
    """Return the scored ways to support a surface, with the unit and the vertical axis of the surface.
    surface : surface in metres, or in the numbers of its file if the unit is unknown.
    axes    : possible vertical axes, each with a factor on the scores.    unit : unit, or "" if unknown.
    stand   : name of a way of support, or height (m) of supports above the lowest point; "" for the best way.
    Raises PresetError for an unknown name."""
    coarse = surface if is_nearly_closed(surface) else coarse_surface(surface)
    size = float(np.ptp(coarse.V, axis=0).max())
    shapes = {up: Shape(Surface(upright_vertices(coarse.V, up), coarse.F)) for up in axes}
    units = {up: [] if unit else likely_units(shape) for up, shape in shapes.items()}
    usual = {up: usual_unit(units[up][0][0], size) if units[up] else 1.0 for up in axes}
    candidates = list[tuple[float, Up, SupportReading]]()
    for up, factor in axes.items():
        if units[up]:
            shapes[up] = Shape(Surface(shapes[up].surface.V * metres_per(units[up][0][0]), coarse.F))
        z = shapes[up].surface.V[:, 2]
        factor *= UNDER if z.min() < -0.2 * np.ptp(z) else 1.0
        factor *= usual[up] / max(usual.values())  # an axis is less probable if it suggests an unusual unit
        candidates += [(factor, up, reading) for reading in _readings(shapes[up], stand)]
    if not candidates:
        raise PresetError(_no_word(stand, [reading for shape in shapes.values() for reading in readings(shape)]))
    ranking = _ranking(shapes, candidates)
    up = ranking[0].up
    return SupportChoice(tuple(ranking), units[up][0][0] if units[up] else unit, tuple(units[up]))


def _ranking(shapes: Mapping[Up, Shape], candidates: Sequence[tuple[float, Up, SupportReading]]) -> list[JudgedReading]:
    """Return the best ways of support with scores, the highest score first.
    candidates : factor on the score, vertical axis and way of support."""
    ranking = list[JudgedReading]()
    for factor, up, reading in sorted(candidates, key=lambda candidate: -candidate[0] * candidate[2].form):
        highest = factor * reading.form
        if ranking:
            on_axis = [candidate.score for candidate in ranking if candidate.up == ranking[0].up]
            if highest < (CLOSE * ranking[0].score if up != ranking[0].up else (*on_axis, 0, 0, 0)[3]):
                continue
        ranking.append(judgement(shapes[up], reading, up, factor))
        ranking.sort(key=lambda candidate: -candidate.score)
    return ranking


def _readings(shape: Shape, stand: str) -> list[SupportReading]:
    if shape.is_object:
        return [SupportReading("sole", "object", soles(shape.surface), DRAWN)]
    if not stand:
        return distinct_readings(shape)
    try:
        reach = float(stand)
    except ValueError:
        return [reading for reading in readings(shape) if reading.word == stand]
    kind: Kind = "wall" if shape.wall > 0.5 else "floor" if shape.is_floor else "roof"
    places = numbered_places("base", low_places(shape, reach))
    return [SupportReading(stand, kind, places, DRAWN)] if places else []


def _no_word(stand: str, candidates: Sequence[SupportReading]) -> str:
    words = "".join(f"{word}, " for word in dict.fromkeys(reading.word for reading in candidates))
    fault = (
        f"--stand {stand}: the surface has no place of this kind"
        if stand
        else "dsfab finds no plausible way to support the surface"
    )
    option = "use" if stand else "choose with --stand:"
    return f"{fault}; {option} {words}{'or ' if words else ''}a height in metres above the surface's lowest point"


def _flaw(candidate: JudgedReading) -> str:
    if not candidate.figures:
        return "the surface with these supports would move without resistance"
    flaws = {
        f"displacement or stress is {candidate.figures['used']:.2g} times the limit": candidate.figures["used"] - 1,
        "it would tip": 0.5 - candidate.figures["steady"],
        "the shape of the surface does not suggest supports of this kind": 0.3 - candidate.figures["form"],
    }
    return max(flaws, key=lambda words: flaws[words])
