"""`PlankPlan`: the parts of a design that is built of upright planks, and what is to be known of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import MemberGraph
from dsfab.wording import length, some_names, stopping
from dsfab.workshop.ground import Ground
from dsfab.workshop.parts import FlatPart
from dsfab.workshop.planks.found import PlankParts
from dsfab.workshop.planks.outline import PlankStock
from dsfab.workshop.planks.sawing import plank_parts
from dsfab.workshop.planks.slots import ORDER, SHARPEST, slot_width
from dsfab.workshop.planks.ways import SLIDE
from dsfab.workshop.plates import is_plate, plate_parts
from dsfab.workshop.splices import scarf_line

LEAST = 5e-5
"""Metres by which edges are said to be longer than drawn, at least."""


@dataclass(frozen=True, eq=False)
class PlankPlan:
    """Planks, what they are cut from, and all parts: planks, cover plates, and plates that lie on them.

    limit : the strain at which the material's strength is reached; 0 where the preset gives none.
    """

    found: PlankParts
    stock: PlankStock
    parts: tuple[FlatPart, ...]
    limit: float

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences: what is possible, and what is not."""
        return (*_bent(self), *_halved(self), *_put_on(self), *_left_out(self))

    @property
    def hindrance(self) -> str:
        """Why it cannot be built so, in numbers; "" where it can: what planks "would" be."""
        found, worst = self.found, max(self.found.bends.values(), default=0.0)
        if worst > self.limit:
            return f"would be bent across themselves to {worst:.2%}, of {self.limit:.2%} allowed"
        if found.crossings.sharp:
            return f"would meet at under {SHARPEST:g} degrees at {some_names(found.crossings.sharp)}, without slots"
        if found.crowded:
            return f"would have slots without wood between them: {some_names(found.crowded)}"
        if found.stuck:
            name, angle = max(found.stuck.items(), key=itemgetter(1))
            return (
                f"would not slide together: slots of {len(found.stuck)} of them turn from each other by up to "
                f"{np.degrees(angle):.0f} degrees from the middle ({name})"
            )
        return ""

    @property
    def merit(self) -> str:
        """How they are bent, cross and are put on, in numbers, where nothing hinders them."""
        found, stock = self.found, self.stock
        bend, lean = (max(some.values(), default=0.0) for some in (found.bends, found.steep))
        said = (
            f"planks {length(stock.depth)} deep and {length(stock.thickness)} thick are bent to {bend:.2%}, of "
            f"{self.limit:.2%} allowed"
        )
        if found.crossings.found:
            angle = min(one.angle for one in found.crossings.found)
            said += (
                f", cross at {np.degrees(angle):.0f} degrees or more, and their slots open by up to "
                f"{np.degrees(lean):.1f} degrees to be put on"
            )
        return said


def plank_plan(
    graph: MemberGraph,
    normals: Floats,
    stock: PlankStock,
    room: list[tuple[float, float]],
    limit: float,
    ground: Ground | None = None,
    order: Sequence[str] = ORDER,
) -> PlankPlan:
    """The planks of a graph, and its plates on them without holes; normals (n, 3) at the vertices of its sheet.

    limit : strain.    order : of families, from those that stand first.

    Raises PatternError where no piece fits on the stock.
    """
    found = plank_parts(graph, stock, room, ground, order)
    discs = [member for member in graph.members if is_plate(member)]
    over = (stock.depth + stock.thickness) / 2
    plates = [replace(plate, holes=()) for plate in plate_parts(graph, discs, normals, over, stock.bolt)]
    return PlankPlan(found, stock, (*found.pieces, *found.covers, *plates), limit)


def _bent(plan: PlankPlan) -> Iterator[str]:
    found, stock = plan.found, plan.stock
    if not found.bends:
        return
    order = sorted(found.bends, key=lambda one: -found.bends[one])
    worst, over = found.bends[order[0]], [name for name in order if found.bends[name] > plan.limit]
    size = f"upright planks, {length(stock.depth)} deep and {length(stock.thickness)} thick,"
    how = f"are bent across themselves to a strain of {worst:.2%} ({order[0]} most)"
    if not plan.limit:
        yield f"{len(order)} {size} {how}; name a material or set statics.strength to have that judged"
    elif over:
        yield (
            f"NOT POSSIBLE: {len(over)} of {len(order)} {size} {how}, {worst / plan.limit:.1f} times the "
            f"{plan.limit:.2%} at which the strength is reached ({some_names(over)}): set workshop.thickness to "
            f"{_rounded_down(stock.thickness * plan.limit / worst)} or less, or draw a pattern that bends less there"
        )
    else:
        yield f"{len(order)} {size} {how}, of {plan.limit:.2%} allowed"
    twisted = max(found.longer, key=lambda one: found.longer[one])
    longest = found.longer[twisted]
    yield (
        f"the surface twists planks: their edges are {f'up to {length(longest)}' if longest > LEAST else 'not'} longer "
        "in the structure than on the drawing" + (f" ({twisted})" if longest > LEAST else "")
    )


def _halved(plan: PlankPlan) -> Iterator[str]:
    found, stock = plan.found, plan.stock
    crossings = found.crossings
    if crossings.found:
        sharpest = min(crossings.found, key=lambda one: one.angle)
        yield (
            f"{len(crossings.found)} nodes with a slot in both planks, cut square to the face; the widest are "
            f"{length(slot_width(stock.thickness, sharpest.angle))}, where planks cross at "
            f"{np.degrees(sharpest.angle):.0f} degrees ({sharpest.node})"
        )
    if crossings.sharp:
        yield (
            f"NOT JOINED: at {some_names(crossings.sharp)} planks meet at under {SHARPEST:g} degrees "
            "and have no slots: notch or screw them there"
        )
    if found.crowded:
        yield (
            f"NOT POSSIBLE: slots are nearer to each other than wood is left between them, and were left out: "
            f"{some_names(found.crowded)}; set workshop.thickness smaller, or a larger spacing"
        )


def _put_on(plan: PlankPlan) -> Iterator[str]:
    found = plan.found
    steep = {name: angle for name, angle in found.steep.items() if name not in found.stuck and angle > 0}
    if steep:
        worst = max(steep, key=lambda one: steep[one])
        yield (
            f"planks with slots from below are put on along one direction, and their slots open for it by up to "
            f"{np.degrees(steep[worst]):.1f} degrees ({worst}); planks are spliced where it would be more than "
            f"{np.degrees(SLIDE):.0f}"
        )
    if found.stuck:
        worst = max(found.stuck, key=lambda one: found.stuck[one])
        yield (
            f"NOT TO SLIDE TOGETHER: slots of {some_names(list(found.stuck))} turn from each other, by up to "
            f"{np.degrees(found.stuck[worst]):.0f} degrees from the middle ({worst}): give smaller bolts or thinner "
            "planks, so that they can be spliced more often, or take strips or bars"
        )


def _left_out(plan: PlankPlan) -> Iterator[str]:
    found = plan.found
    if plan.stock.lap and found.splices:
        yield scarf_line(found.splices, plan.stock.lap)
    if found.near:
        yield f"{found.near} of {found.splices} splices are nearer to a node than they should be"
    if found.level:
        yield f"{found.level} ends at supports are cut along the ground"
    if found.stopped:
        yield (
            f"{some_names(found.stopped)} {stopping(len(found.stopped))} others of their family or curl up"
            + (f"; {some_names(found.left)} are without them" if found.left else "")
        )
    if found.gone:
        yield f"NOT BUILT, as others of their family stand where they would be: {some_names(found.gone)}"
    plates = [part for part in plan.parts if part.member and not len(part.axis)]
    if plates:
        yield f"plates lie on the planks, without holes, and are to be screwed on: {some_names([x.id for x in plates])}"


def _rounded_down(metres: float) -> str:
    """Two digits, never more than it is."""
    power = 10.0 ** (np.floor(np.log10(metres)) - 1)
    return f"{np.floor(metres / power) * power:.2g}"
