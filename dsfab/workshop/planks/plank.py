"""Division of a plank into flat parts."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.members import Member
from dsfab.workshop.development import Development, StripCourse
from dsfab.workshop.ground import STEEP_SINE, BasePlane
from dsfab.workshop.layers import END_DISTANCE, Layering
from dsfab.workshop.parts import FlatPart, Hole, label, text_length
from dsfab.workshop.planks.slots import SLIDE_ANGLE, Crossing, PlankParts, Slot, largest_deviation, middle_direction
from dsfab.workshop.splices import SCARF_SLOPE, box_fits, lap_marks, lapped_span, splice_cuts
from dsfab.workshop.strips import HOLE_EDGE_DISTANCE, UNCERTAIN_WIDTHS, letter_height

EdgeStations = tuple[tuple[float, float], tuple[float, float]]
"""Arc lengths of the right and left corner at a plank's beginning, then of the right and left corner at its end."""


@dataclass(frozen=True)
class PlankStock:
    """Thickness and depth of planks, and bolt diameter of splices (m). splice : "cover", "scarf" or "none".
    letters : largest heights (m) of letters: for names of planks and cover plates; for other marks."""

    thickness: float
    depth: float
    bolt: float
    splice: str
    letters: tuple[float, float]

    @property
    def layering(self) -> Layering:
        """Rules for the lengths of cover plates and the positions of bolts."""
        return Layering(self.thickness, 2, self.bolt)

    @property
    def overhang(self) -> float:
        """Length of a plank beyond its last node (m)."""
        return max(3 * self.thickness, END_DISTANCE * self.bolt)

    @property
    def lap(self) -> float:
        """Overlap of two pieces at a scarf (m); 0 for other splices."""
        return SCARF_SLOPE * self.thickness if self.splice == "scarf" else 0.0

    @property
    def splice_reach(self) -> float:
        """Distance from a splice to the end of its cover plate or lap (m)."""
        return self.layering.half_cover_length if self.splice == "cover" else max(self.lap / 2, self.overhang)


def level_cut(
    layer: Development, ground: BasePlane, station: float, at_end: bool, depth: float
) -> tuple[float, float] | None:
    """Return arc lengths of the right and left corner of a plank's horizontal end at a support; None if impossible.
    station, at_end : arc length of the uncut end; True for the plank's last end."""
    height = ground.support_height(layer.course.frame_at(np.array([station]))[0][0], depth)
    direction = layer.frame(np.array([station]))[1][0] * (1 if at_end else -1)
    if height is None or -direction @ ground.up < STEEP_SINE:
        return None
    stations = ground.stations_at_height(layer, np.array([-depth / 2, depth / 2]), station, height)
    return None if stations is None else (float(stations[0]), float(stations[1]))


def plank_outline(layer: Development, ends: EdgeStations, slots: Sequence[Slot], depth: float) -> Floats:
    """Return the outline (k, 2) of a flat plank with slots, counter-clockwise."""
    (a, b), (c, d) = ends
    right_edge = _edge_with_slots(layer, (a, c), -depth / 2, [slot for slot in slots if not slot.above])
    left_edge = _edge_with_slots(layer, (b, d), depth / 2, [slot for slot in slots if slot.above])
    return np.concatenate([right_edge, left_edge[::-1]])


def _edge_with_slots(layer: Development, span: tuple[float, float], edge: float, slots: Sequence[Slot]) -> Floats:
    s = layer.stations(*span)
    lines, next_station = list[Floats](), 0
    for slot in slots:
        stretch = 1 - edge * float(np.interp(slot.s, layer.course.s, layer.course.kg))
        low, high = (slot.s + x / stretch for x in slot.mouth(edge))
        before = s[next_station:][s[next_station:] < low]
        next_station = int(np.searchsorted(s, high, side="right"))
        bottom = np.array([slot.s - slot.half, slot.s + slot.half])
        lines += [layer.to_plane(before, np.full(len(before), edge)), layer.to_plane(np.array([low]), np.array([edge]))]
        lines += [layer.to_plane(bottom, np.full(2, slot.y)), layer.to_plane(np.array([high]), np.array([edge]))]
    return np.concatenate([*lines, layer.to_plane(s[next_station:], np.full(len(s) - next_station, edge))])


def plank_marks(
    layer: Development, name: str, span: tuple[float, float], slots: Sequence[Slot], stock: PlankStock
) -> tuple[Floats, ...]:
    """Return the names to engrave on a piece of a plank, as polylines (k, 2)."""
    stops = np.array([span[0], *(slot.s for slot in slots), span[1]])
    longest = int(np.diff(stops).argmax())
    middle = (stops[longest] + stops[longest + 1]) / 2
    position, angle = layer.middle_line_at(np.array([middle]))
    wide = max((slot.half for slot in slots), default=0.0)
    room = (stops[longest + 1] - stops[longest]) / 2 - wide - stock.bolt
    marks = list(label(name, position[0], float(angle[0]), letters_within(name, stock, max(room, stock.bolt))))
    small = min(letter_height(stock.depth, stock.letters[1]), stock.depth / 5)
    for slot in slots:
        long = text_length(slot.node, small)
        opposite = [neighbour for neighbour in slots if neighbour is not slot and neighbour.above != slot.above]
        if all(abs(neighbour.s - slot.s) > long / 2 + 1.5 * neighbour.half for neighbour in opposite):
            y = stock.depth / 4 * (-1 if slot.above else 1)
            position, angle = layer.middle_line_at(np.array([slot.s]))
            place = position[0] + y * np.array([-np.sin(angle[0]), np.cos(angle[0])])
            marks += label(slot.node, place, float(angle[0]), small)
    return tuple(marks)


def letters_within(name: str, stock: PlankStock, room: float) -> float:
    """Return the height of letters (m) for a name that may be 2 `room` metres long."""
    high = letter_height(stock.depth, stock.letters[0])
    return high * min(1.0, 2 * room / text_length(name, high))


@dataclass
class Plank:
    """Plank of a member, to be cut into pieces.
    ends       : arc lengths of the corners at both ends.    cuts : arc lengths of beginning, divisions and end.
    directions : direction (3,) in which each piece slides onto lower planks, or None."""

    member: Member
    course: StripCourse
    stock: PlankStock
    ends: EdgeStations = ((0.0, 0.0), (0.0, 0.0))
    cuts: tuple[float, ...] = ()
    directions: list[Floats | None] = field(default_factory=list)
    slots: list[Slot] = field(default_factory=list)

    def divide(
        self,
        crossings: Sequence[Crossing],
        room: list[tuple[float, float]],
        ground: BasePlane | None,
        parts: PlankParts,
    ) -> None:
        """Divide the plank, in place, into pieces that fit on the stock. room : possible lengths and widths, metres."""
        course, stock = self.course, self.stock
        upper = [crossing for crossing in crossings if self._has_role(crossing, 1)]
        crossing_stations = np.array([crossing.at[1] for crossing in upper])
        normals = np.array([crossing.normal for crossing in upper]).reshape(-1, 3)
        stations = np.array([crossing.at[k] for crossing in crossings for k in (0, 1) if self._has_role(crossing, k)])
        self.ends = self._level_ends(ground, stations, parts)

        def on_stock(begin: float, end: float) -> bool:
            return self._fits(begin, end, room)

        def slides(begin: float, end: float) -> bool:
            inside = (crossing_stations >= begin) & (crossing_stations <= end)
            return on_stock(begin, end) and largest_deviation(normals[inside]) <= SLIDE_ANGLE

        clear = stock.splice_reach + 2 * stock.thickness
        span, repeated = (course.begin, course.end), course.repeated_stations(stations)
        try:
            cuts = splice_cuts(span, repeated, clear, slides, self.member.id)
        except PatternError:
            cuts = splice_cuts(span, repeated, clear, on_stock, self.member.id)
        self.cuts = cuts.stations
        parts.splices_near_nodes += cuts.near_nodes
        parts.splice_count += len(cuts.stations) - (1 if course.closed else 2)
        for name, (begin, end) in zip(self.names, self.spans, strict=True):
            piece_normals = normals[(crossing_stations >= begin) & (crossing_stations <= end)]
            angle = largest_deviation(piece_normals)
            if angle > SLIDE_ANGLE * (1 + 1e-9):
                parts.stuck[name] = angle
            parts.slide_angles[name] = angle
            slides_on = len(piece_normals) and angle <= SLIDE_ANGLE * (1 + 1e-9)
            self.directions.append(middle_direction(piece_normals) if slides_on else None)

    def _has_role(self, crossing: Crossing, k: int) -> bool:
        return crossing.members[k] == self.member.id

    @property
    def spans(self) -> list[tuple[float, float]]:
        """First and last arc length of each piece."""
        return list(zip(self.cuts, self.cuts[1:], strict=False))

    @property
    def names(self) -> list[str]:
        """Names of the pieces: "A07", or "A07.1" and "A07.2"."""
        count = len(self.spans)
        return [self.member.id] if count == 1 else [f"{self.member.id}.{k}" for k in range(1, count + 1)]

    def direction_at(self, s: float) -> Floats | None:
        """Return the direction in which the piece at arc length s slides onto lower planks, or None."""
        return next((d for d, (a, b) in zip(self.directions, self.spans, strict=True) if a <= s <= b), None)

    def _fits(self, begin: float, end: float, room: list[tuple[float, float]]) -> bool:
        layer, (a, b) = Development(self.course, 0.0), self._lapped_span((begin, end))
        x, angle = layer.middle_line_at(np.linspace(a, b, 9))
        outline = plank_outline(layer, self._piece_ends((a, b)), (), self.stock.depth)
        return box_fits(outline, x[-1] - x[0], room) and bool(np.ptp(angle) < np.pi)

    def _lapped_span(self, span: tuple[float, float]) -> tuple[float, float]:
        course = self.course
        return lapped_span(span, (course.begin, course.end), self.stock.lap / 2, course.closed)

    def _piece_ends(self, long: tuple[float, float]) -> EdgeStations:
        course, (begin, end) = self.course, self.ends
        return (
            begin if long[0] == course.begin and not course.closed else (long[0], long[0]),
            end if long[1] == course.end and not course.closed else (long[1], long[1]),
        )

    def add_parts(self, parts: PlankParts) -> None:
        """Add the pieces and cover plates of the plank to `parts`."""
        course, stock, layer = self.course, self.stock, Development(self.course, 0.0)
        joints = list(self.cuts[:-1] if course.closed else self.cuts[1:-1])
        bolts = stock.layering.splice_bolts(stock.depth) if stock.splice == "cover" else ()
        holes = [[(joint + x, y, f"{self.member.id}.c{k}") for x, y in bolts] for k, joint in enumerate(joints, 1)]
        holes = holes if stock.splice == "cover" else []
        around = course.end - course.begin
        every = [hole for joint_holes in holes for hole in joint_holes]
        every += [(s + around, y, name) for s, y, name in every] if course.closed else []
        self._record_strains(parts)
        for name, span in zip(self.names, self.spans, strict=True):
            slots = self._slots(name, span, parts)
            begin, end = self._lapped_span(span)
            outline = plank_outline(layer, self._piece_ends((begin, end)), slots, stock.depth)
            margin = HOLE_EDGE_DISTANCE * stock.bolt
            inside = [hole for hole in every if begin + margin <= hole[0] <= end - margin]
            drilled = tuple(Hole(layer.to_plane(np.array([s]), np.array([y]))[0], stock.bolt, n) for s, y, n in inside)
            marks = plank_marks(layer, name, (begin, end), slots, stock)
            if stock.lap:
                marks += lap_marks(layer, span, (begin, end), stock.lap / 2, stock.letters[1])
            axis = layer.middle_line_at(layer.stations(begin, end))[0]
            strain = parts.bends[self.member.id]
            part = FlatPart(name, self.member.id, (begin, end), outline, drilled, (), marks, 0.0, strain, axis)
            parts.pieces.append(part.along_x())
        for k, (joint, joint_holes) in enumerate(zip(joints, holes, strict=False), 1):
            parts.covers.append(self._cover(f"{self.member.id}.c{k}", joint, joint_holes))

    def _record_strains(self, parts: PlankParts) -> None:
        course, y = self.course, self.stock.depth / 2
        past = 0.0 if course.closed else min(UNCERTAIN_WIDTHS * self.member.mean_width, (course.end - course.begin) / 3)
        inside = (course.s >= course.begin + past) & (course.s <= course.end - past)
        kn, tg = course.kg[inside], course.tg[inside]  # an upright plank's kg is the surface's normal curvature
        parts.bends[self.member.id] = self.stock.thickness / 2 * float(np.abs(course.kn[inside]).max(initial=0.0))
        elongations = [np.hypot(1 - side * kn, side * tg) - (1 - side * kn) for side in (y, -y)]
        parts.longer[self.member.id] = max(float(np.trapezoid(x, course.s[inside])) for x in elongations)

    def _slots(self, name: str, span: tuple[float, float], parts: PlankParts) -> list[Slot]:
        accepted = list[Slot]()
        for slot in sorted(self.slots, key=lambda previous: previous.s):
            if not span[0] <= slot.s <= span[1]:
                continue
            edge = self.stock.depth / 2 * (1 if slot.above else -1)
            low = slot.s + slot.mouth(edge)[0] - self.stock.thickness / 2  # leave half a thickness between slots
            before = [previous.s + previous.mouth(edge)[1] for previous in accepted if previous.above == slot.above]
            if before and before[-1] > low:
                parts.crowded.append(f"{slot.node} in {name}")
            else:
                accepted.append(slot)
        return accepted

    def _level_ends(self, ground: BasePlane | None, stations: Floats, parts: PlankParts) -> EdgeStations:
        course, layer = self.course, Development(self.course, 0.0)
        ends = [(course.begin, course.begin), (course.end, course.end)]
        for k in (0, 1):
            if ground is None or course.closed:
                continue
            cut = level_cut(layer, ground, ends[k][0], bool(k), self.stock.depth)
            if cut and all(min(cut) > s if k else max(cut) < s for s in stations + (2 * k - 1) * self.stock.thickness):
                ends[k] = cut
                parts.level_ends += 1
        return ends[0], ends[1]

    def _cover(self, name: str, joint: float, holes: Sequence[tuple[float, float, str]]) -> FlatPart:
        stock, reach = self.stock, self.stock.layering.half_cover_length
        layer, drilled = Development(self.course, stock.thickness), list[Hole]()
        for s, y, bolt in holes:
            P, T, N = (row[0] for row in self.course.frame_at(np.array([s])))
            s, y = layer.piercing_point(P + y * np.cross(N, T), N, s)
            drilled.append(Hole(layer.to_plane(np.array([s]), np.array([y]))[0], stock.bolt, bolt))
        position, angle = layer.middle_line_at(np.array([joint]))
        marks = label(name, position[0], float(angle[0]), letters_within(name, stock, 0.6 * END_DISTANCE * stock.bolt))
        span = joint - reach, joint + reach
        outline, axis = layer.outline(*span), layer.middle_line_at(layer.stations(*span))[0]
        strain = stock.thickness / 2 * float(np.abs(np.interp(joint, self.course.s, self.course.kn)))
        part = FlatPart(name, self.member.id, span, outline, tuple(drilled), (), marks, stock.thickness, strain, axis)
        return part.along_x()
