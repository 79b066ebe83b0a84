"""The statics that judge readings, and the choice of unit, vertical axis and supports with its doubts.

The shape chooses, the statics have a veto. Score of a reading = form x carries x steady x free:

form    : how far the shape says that it is held there (see `readings`).
carries : 1 / (1 + u^2), where u is the larger of movement over `LIMIT` times the span and stress over strength. A coarse
          sheet of a usual depth carries its weight and the usual load of its kind.
steady  : the middle of the sheet is over what it stands on, and nothing pulls on the ground.
free    : of readings that carry, the one that holds least of the edge is meant.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from dsfab.core.arrays import Bools, Floats, lengths, weighted_quantile
from dsfab.core.errors import DsfabError
from dsfab.core.units import GRAVITY
from dsfab.preset.proposal.readings import DRAWN, Reading, readings
from dsfab.preset.proposal.shape import HEAD, STRIP, Shape, coarse_surface
from dsfab.statics import PAPER, LoadCase, Material, SheetModel, equilibrium, sheet_stiffness, sheet_stress
from dsfab.surface import Surface, Up, upright_vertices

DEEP = {"roof": 50.0, "hung": 50.0, "floor": 25.0, "wall": 20.0}
"""Usual ratio of the size to the depth of ribs, by kind."""
LOAD = {"roof": 750.0, "hung": 300.0, "floor": 5000.0, "wall": 800.0}
"""Usual load by kind, Pa: snow, services, people, wind."""
TIMBER, STRENGTH = Material(11e9, 0.3, 420.0), 15e6
"""GL24h: 24 MPa x 0.8 / 1.25."""
LIMIT = 1 / 300
"""Largest usual movement, as a share of the span."""
EDGE = 0.5
"""Part of the score that a reading loses if it holds all of the edge."""
UNITS = {"m": (1.0, 0.45), "mm": (0.001, 0.33), "cm": (0.01, 0.12), "ft": (0.3048, 0.05), "in": (0.0254, 0.05)}
"""Metres, and how often architects model in it, by unit."""
BUILDING, SPREAD = 18.0, 1.1
"""Buildings are about 18 m long, within a factor of 3 (e^1.1) two times out of three."""
Y_UP = 0.7
"""Factor on an axis y, and on what would lie under the ground: z is up unless another axis is plainly better."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A reading with its score, and the figures behind it."""

    reading: Reading
    score: float
    up: Up
    built_in: bool = False
    figures: Mapping[str, float] = field(default_factory=dict)


def judged(shape: Shape, reading: Reading, up: Up = "z", usual: float = 1.0) -> Judged:
    """Return a reading of a shape with its score; `usual`: factor for the axis. A sheet that can move scores 0."""
    if reading.kind == "object":
        return Judged(reading, DRAWN * usual, up)
    surface, held = shape.surface, reading.held(shape.surface)
    is_line = len(reading.places) == 1 and np.linalg.norm(np.ptp(surface.V[held], axis=0)) > 0.5 * shape.width
    rows = held
    if reading.kind in ("wall", "floor") or reading.word in ("edge", "edges", "ring") or is_line:
        rows = held | np.isin(np.arange(surface.n), surface.F[held[surface.F].sum(axis=1) >= 2])
    thick = _depth(shape, reading.kind)
    sheet = SheetModel(surface, TIMBER, thick)
    load = LoadCase(np.repeat(rows[:, None], 3, axis=1), _forces(shape, reading.kind, thick), np.zeros(surface.n, bool))
    try:
        answer = equilibrium(surface, sheet_stiffness(sheet, PAPER), load)
    except DsfabError:
        return Judged(reading, 0.0, up)
    span = 2 * float(cKDTree(surface.V[held]).query(surface.V)[0].max())
    if reading.kind in ("roof", "hung"):
        span = min(span, 2 * shape.width)  # a long span is no excuse for a large movement
    moved = float(np.quantile(lengths(answer.u), 0.99))
    stress = weighted_quantile(sheet_stress(sheet, PAPER, answer).largest, surface.areas, 0.9)
    used = max(moved / (LIMIT * span), stress / STRENGTH)
    up_force = _upward(reading, surface, rows, answer.reaction)
    pull = float(-np.minimum(up_force, 0).sum() / max(np.abs(up_force).sum(), 1e-12))
    steady = float(np.clip(0.5 + _inside(shape, held) / (0.2 * shape.width), 0.05, 1) * (1 - pull))
    if reading.kind in ("wall", "floor"):
        steady = 1.0
    elif is_line:
        steady = max(steady, 0.5)
    if reading.kind == "hung" and len(reading.places) == 1 and reading.places[0].name != "upper rim":
        steady = 0.3
    ends = surface.edges.ends
    rim = surface.edge_lengths * surface.edges.boundary
    share = float(rim[held[ends].all(axis=1)].sum() / rim.sum())
    score = reading.form / (1 + used**2) * steady * (1 - EDGE * share) * usual
    figures = {"form": reading.form, "used": used, "moved": moved, "span": span, "steady": steady, "held": share}
    return Judged(reading, score, up, reading.kind == "wall" or bool(is_line), figures)


def _depth(shape: Shape, kind: str) -> float:
    long = shape.sides[1].length if shape.ratio > STRIP else shape.width
    size = {"floor": long, "wall": min(shape.height, shape.width, 0.4 * DEEP["wall"])}.get(kind, shape.width)
    return size / DEEP[kind]


def _forces(shape: Shape, kind: str, thick: float) -> Floats:
    """Return the forces (n, 3) of the weight and of the usual load of a kind, newtons."""
    surface = shape.surface
    down = np.array([0.0, 0.0, -1.0])
    pressure = surface.normals if kind == "wall" else np.abs(surface.normals[:, 2:]) * down
    force = surface.vertex_areas[:, None] * (TIMBER.density * GRAVITY * thick) * down
    on_corner = LOAD[kind] * pressure * (surface.areas / 3)[:, None]
    np.add.at(force, surface.F.ravel(), np.repeat(on_corner, 3, axis=0))
    return force


def _upward(reading: Reading, surface: Surface, rows: Bools, reaction: Floats) -> Floats:
    """Return the upward reaction at each place, newtons; a reaction belongs to the nearest place."""
    points = np.concatenate([place.points for place in reading.places])
    owner = np.repeat(np.arange(len(reading.places)), [len(place.points) for place in reading.places])
    nearest = owner[cKDTree(points).query(surface.V[rows])[1]]
    return np.bincount(nearest, reaction[rows, 2], len(reading.places))


def _inside(shape: Shape, held: Bools) -> float:
    """Return how far the middle of the sheet is within the outline of the held vertices in plan, metres; negative
    beside it."""
    P, middle = shape.surface.V[held, :2], shape.middle[:2]
    try:
        plane = ConvexHull(P).equations
        return float(-(plane[:, :2] @ middle + plane[:, 2]).max())
    except (QhullError, ValueError):  # all in one line
        across = np.linalg.svd(P - P.mean(axis=0))[2][-1] if len(P) > 1 else np.zeros(2)
        return -abs(float((middle - P.mean(axis=0)) @ across))


def likely_units(shape: Shape) -> list[tuple[str, float]]:
    """Return (unit, probability), the likeliest first, for a shape in the numbers of its file.
    Buildings have usual sizes, and people can stand below what comes down to the ground."""
    V = shape.surface.V
    size, plan = float(np.ptp(V, axis=0).max()), V[:, :2] - V[:, :2].mean(axis=0)
    narrow = np.ptp(plan @ np.linalg.svd(plan, full_matrices=False)[2].T, axis=0).min()
    comes_down = shape.plan_share < 0.4 or shape.height > 0.25 * narrow
    weight = {}
    for unit, (metres, usual) in UNITS.items():
        weight[unit] = usual * float(np.exp(-0.5 * (np.log(metres * size / BUILDING) / SPREAD) ** 2))
        weight[unit] *= 0.1 if comes_down and not HEAD <= metres * shape.height <= 40 else 1.0
    total = sum(weight.values())
    return sorted(((unit, share / total) for unit, share in weight.items()), key=lambda each: -each[1])
