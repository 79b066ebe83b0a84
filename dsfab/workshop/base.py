"""The base plate of a model: where supports are is engraved, and each foot has its slot, with its name beside it."""

from itertools import product

import numpy as np

from dsfab.arrays import Floats
from dsfab.surface import Surface
from dsfab.wording import length
from dsfab.workshop.ground import Ground, StripFoot
from dsfab.workshop.parts import FlatPart, label

BORDER = 0.012
"""Metres of plate around what stands on it."""
NAME = 0.002
"""Height of names beside slots, metres."""
ASIDE = 0.002
"""Metres from a slot to its name."""
CROSS = 0.002
"""Metres from the middle of a cross to its ends: a support in one place."""

NO_FEET = "no strip ends on the base plate steeply enough for a tab: glue the model on the engraved lines"


def base_parts(
    ground: Ground, surface: Surface, feet: list[tuple[str, StripFoot]], room: list[tuple[float, float]]
) -> list[FlatPart]:
    """The plate, in as few equal rectangles as fit into one of `room`, lengths and widths in metres; each where it lies
    under the model, as `Ground.plan` sees it.

    surface : as large as the model; its supports are at the ground's places.    feet : with the names of their parts.
    """
    engraved = [*_support_marks(ground, surface), *_slot_names(feet)]
    slots = [foot.slot for _, foot in feet]
    every = np.concatenate([ground.plan(ground.supports), *slots])
    low, size = every.min(axis=0) - BORDER, np.ptp(every, axis=0) + 2 * BORDER
    turned = [*room, *((b, a) for a, b in room)]
    counts = ((int(np.ceil(size[0] / a)), int(np.ceil(size[1] / b))) for a, b in turned)
    nx, ny = min(counts, key=lambda n: n[0] * n[1])
    step = size / [nx, ny]
    found = []
    for i, j in product(range(nx), range(ny)):
        box = np.stack([low + step * [i, j], low + step * [i + 1, j + 1]])
        name = "base" if nx * ny == 1 else f"base {i + 1}-{j + 1}"
        outline = np.array([[box[x, 0], box[y, 1]] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
        inside = [clipped for slot in slots if len(clipped := clipped_polygon(slot, box)) > 2]
        title = label(name, box.mean(axis=0), 0.0, 3 * NAME)
        marks = [*_lines_inside(engraved, box), *title]
        found.append(FlatPart(name, "", (0.0, 0.0), outline, slots=tuple(inside), marks=tuple(marks)))
    return found


def clipped_polygon(P: Floats, box: Floats) -> Floats:
    """(k, 2) what a box, its low and its high corner (2, 2), has of a convex polygon (q, 2) [Sutherland, Hodgman]."""
    for axis, side in product((0, 1), (0, 1)):
        sign = 1 if side == 0 else -1
        inside = sign * (P[:, axis] - box[side, axis])
        found = list[Floats]()
        for k in range(len(P)):
            a, b = inside[k - 1], inside[k]
            if (a < 0) != (b < 0):
                found.append(P[k - 1] + a / (a - b) * (P[k] - P[k - 1]))
            if b >= 0:
                found.append(P[k])
        P = np.array(found).reshape(-1, 2)
    return P


def _lines_inside(lines: list[Floats], box: Floats) -> list[Floats]:
    """Those lines (k, 2) that lie in a box; what goes across its edge is short, and left out."""
    return [line for line in lines if ((line >= box[0]) & (line <= box[1])).all(axis=1).all()]


def _support_marks(ground: Ground, surface: Surface) -> list[Floats]:
    """Lines where edges of the surface are held, and crosses where single places are, as seen from above."""
    held = {tuple(place) for place in ground.supports.tolist()}
    on = np.array([tuple(place) in held for place in surface.V.tolist()])
    ends = surface.edges.ends[surface.edges.boundary]
    ends = ends[on[ends].all(axis=1)]
    alone = on.copy()
    alone[np.unique(ends)] = False
    alone &= np.bincount(surface.edges.ends[on[surface.edges.ends].all(axis=1)].ravel(), minlength=surface.n) == 0
    arms = CROSS * np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]])
    lines = [ground.plan(surface.V[pair]) for pair in ends]
    return lines + [place + arm for place in ground.plan(surface.V[alone]) for arm in arms]


def _slot_names(feet: list[tuple[str, StripFoot]]) -> list[Floats]:
    """The name of each foot beside its slot, on the side that is away from the middle of all."""
    if not feet:
        return []
    middles = np.array([foot.slot.mean(axis=0) for _, foot in feet])
    centre = middles.mean(axis=0)
    found = list[Floats]()
    for (name, foot), middle in zip(feet, middles, strict=True):
        way = foot.slot[3] - foot.slot[0]
        deep = float(np.linalg.norm(way))
        way = way / deep * (1 if way @ (middle - centre) >= 0 else -1)
        angle = float(np.arctan2(*(foot.slot[1] - foot.slot[0])[::-1]))
        angle -= np.pi * round(angle / np.pi) if abs(angle) > np.pi / 2 else 0.0  # to be read from below
        found += label(name, middle + (deep / 2 + ASIDE + NAME / 2) * way, angle, NAME)
    return found


def base_notes(ground: Ground, feet: list[tuple[str, StripFoot]], plates: list[FlatPart]) -> list[str]:
    """How many feet stand in the plate, what does not, and whether it is in pieces."""
    names = {name for name, _ in feet}
    found = [f"{len(feet)} feet of {len(names)} parts stand in slots of the base plate" if feet else NO_FEET]
    highest = float(ground.heights(ground.supports).max())
    if highest > ground.reach:
        found.append(f"some supports are up to {length(highest)} above the base plate: prop what ends there")
    if len(plates) > 1:
        found.append(f"the base plate is in {len(plates)} pieces, butted: glue them on a board")
    return found
