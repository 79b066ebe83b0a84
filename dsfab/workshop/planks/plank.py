"""A plank as flat parts: its divisions, outline, slots, ends and cover plates."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.members import Member
from dsfab.workshop.development import Development, StripCourse
from dsfab.workshop.ground import STEEP, Ground
from dsfab.workshop.layers import END, Layering
from dsfab.workshop.parts import FlatPart, Hole, label, text_length
from dsfab.workshop.planks.slots import SLIDE, Crossing, PlankParts, Slot, middle, spread
from dsfab.workshop.splices import SCARF, lap_marks, lapped, splice_cuts
from dsfab.workshop.strips import CALM, EDGE, letter_height

Ends = tuple[tuple[float, float], tuple[float, float]]
"""Arc lengths of a beginning, then of an end, at the right and left edges of a plank."""


@dataclass(frozen=True)
class PlankStock:
    """Thickness and depth of planks, bolt diameter of splices, and largest heights of letters (m).

    splice : "cover", "scarf" or "none".
    """

    thickness: float
    depth: float
    bolt: float
    splice: str
    letters: tuple[float, float]

    @property
    def layering(self) -> Layering:
        """Layering that fixes the lengths of cover plates and the places of their bolts."""
        return Layering(self.thickness, 2, self.bolt)

    @property
    def past(self) -> float:
        """Length beyond the last node (m)."""
        return max(3 * self.thickness, END * self.bolt)

    @property
    def lap(self) -> float:
        """Overlap of two pieces (m)."""
        return SCARF * self.thickness if self.splice == "scarf" else 0.0

    @property
    def reach(self) -> float:
        """Distance from a splice to the end of its cover or lap (m)."""
        return self.layering.half_cover if self.splice == "cover" else max(self.lap / 2, self.past)


def level_cut(layer: Development, ground: Ground, at: float, last: bool, depth: float) -> tuple[float, float] | None:
    """Return arc lengths at the right and left edge of a level end at a support; None for others and flat ends."""
    point = layer.course.at(np.array([at]))[0][0]
    height = ground.height_near(point, depth)
    way = layer.frame(np.array([at]))[1][0] * (1 if last else -1)
    if height is None or -way @ ground.up < STEEP:
        return None
    found = ground.meeting(layer, np.array([-depth / 2, depth / 2]), at, height)
    return None if found is None else (float(found[0]), float(found[1]))


def plank_outline(layer: Development, ends: Ends, slots: Sequence[Slot], depth: float) -> Floats:
    """Return the outline (k, 2), counter-clockwise from the right edge at the beginning."""
    (a, b), (c, d) = ends
    right = _notched(layer, (a, c), -depth / 2, [slot for slot in slots if not slot.above])
    left = _notched(layer, (b, d), depth / 2, [slot for slot in slots if slot.above])
    return np.concatenate([right, left[::-1]])


def _notched(layer: Development, span: tuple[float, float], edge: float, slots: Sequence[Slot]) -> Floats:
    """Return an edge (k, 2) of a plank, at a height over its axis (m), with its slots."""
    s = layer.stations(*span)
    found, first = list[Floats](), 0
    for slot in slots:
        stretch = 1 - edge * float(np.interp(slot.s, layer.course.s, layer.course.kg))
        low, high = (slot.s + x / stretch for x in slot.mouth(edge))
        before = s[first:][s[first:] < low]
        first = int(np.searchsorted(s, high, side="right"))
        bottom = np.array([slot.s - slot.half, slot.s + slot.half])
        found += [layer.flat(before, np.full(len(before), edge)), layer.flat(np.array([low]), np.array([edge]))]
        found += [layer.flat(bottom, np.full(2, slot.y)), layer.flat(np.array([high]), np.array([edge]))]
    return np.concatenate([*found, layer.flat(s[first:], np.full(len(s) - first, edge))])


def plank_marks(
    layer: Development, name: str, span: tuple[float, float], slots: Sequence[Slot], stock: PlankStock
) -> tuple[Floats, ...]:
    """Return strokes of a piece's name in its longest bay, and of node names opposite to slots."""
    stops = np.array([span[0], *(slot.s for slot in slots), span[1]])
    longest = int(np.diff(stops).argmax())
    middle = (stops[longest] + stops[longest + 1]) / 2
    at, angle = layer.at(np.array([middle]))
    wide = max((slot.half for slot in slots), default=0.0)
    room = (stops[longest + 1] - stops[longest]) / 2 - wide - stock.bolt
    found = list(label(name, at[0], float(angle[0]), letters_within(name, stock, max(room, stock.bolt))))
    small = min(letter_height(stock.depth, stock.letters[1]), stock.depth / 5)
    for slot in slots:
        long = text_length(slot.node, small)
        others = [one for one in slots if one is not slot and one.above != slot.above]
        if all(abs(one.s - slot.s) > long / 2 + 1.5 * one.half for one in others):
            y = stock.depth / 4 * (-1 if slot.above else 1)
            at, angle = layer.at(np.array([slot.s]))
            place = at[0] + y * np.array([-np.sin(angle[0]), np.cos(angle[0])])
            found += label(slot.node, place, float(angle[0]), small)
    return tuple(found)


def letters_within(name: str, stock: PlankStock, room: float) -> float:
    """Return the height of letters that fit into `room` metres on both sides of their middle."""
    high = letter_height(stock.depth, stock.letters[0])
    return high * min(1.0, 2 * room / text_length(name, high))


@dataclass
class Plank:
    """Member that becomes parts: stations of its ends and cuts, and the assembly direction (3,) of each piece."""

    member: Member
    course: StripCourse
    stock: PlankStock
    ends: Ends = ((0.0, 0.0), (0.0, 0.0))
    cuts: tuple[float, ...] = ()
    ways: list[Floats | None] = field(default_factory=list)
    slots: list[Slot] = field(default_factory=list)

    def divide(
        self, crossings: Sequence[Crossing], room: list[tuple[float, float]], ground: Ground | None, found: PlankParts
    ) -> None:
        """Divide the plank into pieces that fit on the stock and slide onto the lower planks."""
        course, stock = self.course, self.stock
        upper = [one for one in crossings if self._is(one, 1)]
        at, normals = np.array([one.at[1] for one in upper]), np.array([one.normal for one in upper]).reshape(-1, 3)
        stations = np.array([one.at[k] for one in crossings for k in (0, 1) if self._is(one, k)])
        self.ends = self._level_ends(ground, stations, found)

        def on_stock(begin: float, end: float) -> bool:
            return self._fits(begin, end, room)

        def slides(begin: float, end: float) -> bool:
            return on_stock(begin, end) and spread(normals[(at >= begin) & (at <= end)]) <= SLIDE

        clear = stock.reach + 2 * stock.thickness
        try:
            cuts = splice_cuts((course.begin, course.end), course.rounds(stations), clear, slides, self.member.id)
        except PatternError:
            cuts = splice_cuts((course.begin, course.end), course.rounds(stations), clear, on_stock, self.member.id)
        self.cuts = cuts.at
        found.near, found.splices = found.near + cuts.near, found.splices + len(cuts.at) - (1 if course.closed else 2)
        for name, (begin, end) in zip(self.names, self.spans, strict=True):
            some = normals[(at >= begin) & (at <= end)]
            angle = spread(some)
            if angle > SLIDE * (1 + 1e-9):
                found.stuck[name] = angle
            found.steep[name] = angle
            self.ways.append(middle(some) if len(some) and angle <= SLIDE * (1 + 1e-9) else None)

    def _is(self, one: Crossing, k: int) -> bool:
        return one.members[k] == self.member.id

    @property
    def spans(self) -> list[tuple[float, float]]:
        """Spans of the pieces without their laps."""
        return list(zip(self.cuts, self.cuts[1:], strict=False))

    @property
    def names(self) -> list[str]:
        """ "A07", or "A07.1" and "A07.2"."""
        count = len(self.spans)
        return [self.member.id] if count == 1 else [f"{self.member.id}.{k}" for k in range(1, count + 1)]

    def way_at(self, s: float) -> Floats | None:
        """Return the assembly direction of the piece at an arc length; None where slots stay as narrow as possible."""
        return next((way for way, (a, b) in zip(self.ways, self.spans, strict=True) if a <= s <= b), None)

    def _fits(self, begin: float, end: float, room: list[tuple[float, float]]) -> bool:
        layer, (a, b) = Development(self.course, 0.0), self._lapped((begin, end))
        x, angle = layer.at(np.linspace(a, b, 9))
        outline = plank_outline(layer, self._piece_ends((a, b)), (), self.stock.depth)
        way = (x[-1] - x[0]) / np.linalg.norm(x[-1] - x[0])
        p, q = float(np.ptp(outline @ way)), float(np.ptp(outline @ [-way[1], way[0]]))
        fits = any((p <= long and q <= wide) or (q <= long and p <= wide) for long, wide in room)
        return fits and bool(np.ptp(angle) < np.pi)

    def _lapped(self, span: tuple[float, float]) -> tuple[float, float]:
        course = self.course
        return lapped(span, (course.begin, course.end), self.stock.lap / 2, course.closed)

    def _piece_ends(self, long: tuple[float, float]) -> Ends:
        course, (begin, end) = self.course, self.ends
        return (
            begin if long[0] == course.begin and not course.closed else (long[0], long[0]),
            end if long[1] == course.end and not course.closed else (long[1], long[1]),
        )

    def into(self, found: PlankParts) -> None:
        """Add pieces and cover plates to `parts`."""
        course, stock, layer = self.course, self.stock, Development(self.course, 0.0)
        joints = list(self.cuts[:-1] if course.closed else self.cuts[1:-1])
        holes = [self._splice_holes(joint, k) for k, joint in enumerate(joints, 1)] if stock.splice == "cover" else []
        around = course.end - course.begin
        every = [one for some in holes for one in some]
        every += [(s + around, y, name) for s, y, name in every] if course.closed else []
        self._note(found)
        for name, span in zip(self.names, self.spans, strict=True):
            slots = self._slots(name, span, found)
            begin, end = self._lapped(span)
            outline = plank_outline(layer, self._piece_ends((begin, end)), slots, stock.depth)
            inside = [one for one in every if begin + EDGE * stock.bolt <= one[0] <= end - EDGE * stock.bolt]
            drilled = tuple(Hole(layer.flat(np.array([s]), np.array([y]))[0], stock.bolt, n) for s, y, n in inside)
            marks = plank_marks(layer, name, (begin, end), slots, stock)
            if stock.lap:
                marks += lap_marks(layer, span, (begin, end), stock.lap / 2, stock.letters[1])
            axis = layer.at(layer.stations(begin, end))[0]
            strain = found.bends[self.member.id]
            part = FlatPart(name, self.member.id, (begin, end), outline, drilled, (), marks, 0.0, strain, axis)
            found.pieces.append(part.lying())
        for k, (joint, some) in enumerate(zip(joints, holes, strict=False), 1):
            found.covers.append(self._cover(f"{self.member.id}.c{k}", joint, some))

    def _note(self, found: PlankParts) -> None:
        course, y = self.course, self.stock.depth / 2
        past = 0.0 if course.closed else min(CALM * self.member.mean_width, (course.end - course.begin) / 3)
        inside = (course.s >= course.begin + past) & (course.s <= course.end - past)
        kn, tg = course.kg[inside], course.tg[inside]  # of the surface; a plank swaps them
        found.bends[self.member.id] = self.stock.thickness / 2 * float(np.abs(course.kn[inside]).max(initial=0.0))
        more = [np.hypot(1 - side * kn, side * tg) - (1 - side * kn) for side in (y, -y)]
        found.longer[self.member.id] = max(float(np.trapezoid(x, course.s[inside])) for x in more)

    def _slots(self, name: str, span: tuple[float, float], found: PlankParts) -> list[Slot]:
        """Return slots of a piece, without those that run into the previous slot on the same edge."""
        kept = list[Slot]()
        for slot in sorted(self.slots, key=lambda one: one.s):
            if not span[0] <= slot.s <= span[1]:
                continue
            edge = self.stock.depth / 2 * (1 if slot.above else -1)
            low = slot.s + slot.mouth(edge)[0] - self.stock.thickness / 2  # wood between slots
            before = [one.s + one.mouth(edge)[1] for one in kept if one.above == slot.above]
            if before and before[-1] > low:
                found.crowded.append(f"{slot.node} in {name}")
            else:
                kept.append(slot)
        return kept

    def _level_ends(self, ground: Ground | None, stations: Floats, found: PlankParts) -> Ends:
        """Return the ends at the right and left edge, level at supports unless a slot is in the way."""
        course, layer = self.course, Development(self.course, 0.0)
        made = [(course.begin, course.begin), (course.end, course.end)]
        for k in (0, 1):
            if ground is None or course.closed:
                continue
            cut = level_cut(layer, ground, made[k][0], bool(k), self.stock.depth)
            if cut and all(min(cut) > s if k else max(cut) < s for s in stations + (2 * k - 1) * self.stock.thickness):
                made[k] = cut
                found.level += 1
        return made[0], made[1]

    def _splice_holes(self, joint: float, number: int) -> list[tuple[float, float, str]]:
        name = f"{self.member.id}.c{number}"
        return [(joint + x, y, name) for x, y in self.stock.layering.splice_bolts(self.stock.depth)]

    def _cover(self, name: str, joint: float, holes: Sequence[tuple[float, float, str]]) -> FlatPart:
        stock, reach = self.stock, self.stock.layering.half_cover
        layer, drilled = Development(self.course, stock.thickness), list[Hole]()
        for s, y, bolt in holes:
            P, T, N = (row[0] for row in self.course.at(np.array([s])))
            s, y = layer.place(P + y * np.cross(N, T), N, s)
            drilled.append(Hole(layer.flat(np.array([s]), np.array([y]))[0], stock.bolt, bolt))
        at, angle = layer.at(np.array([joint]))
        marks = label(name, at[0], float(angle[0]), letters_within(name, stock, 0.6 * END * stock.bolt))
        span = joint - reach, joint + reach
        outline, axis = layer.outline(*span), layer.at(layer.stations(*span))[0]
        strain = stock.thickness / 2 * float(np.abs(np.interp(joint, self.course.s, self.course.kn)))
        part = FlatPart(name, self.member.id, span, outline, tuple(drilled), (), marks, stock.thickness, strain, axis)
        return part.lying()
