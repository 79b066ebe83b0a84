"""Splices of strips that are longer than the stock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.core.messages import length
from dsfab.workshop.development import Development
from dsfab.workshop.parts import label, polygon_area

SCARF_SLOPE = 8.0  # overlap of a scarf joint, in thicknesses, as usual for plywood and boards
BEVEL_TEXTS = ("BEVEL", "BEVEL BACK")  # engraved texts for a bevel on the engraved face, and on the back


@dataclass(frozen=True)
class Cuts:
    """Arc lengths at which a strip begins, is divided and ends. near_nodes : number of cuts near a node."""

    stations: tuple[float, ...]
    near_nodes: int


def box_fits(outline: Floats, along: Floats, room: Sequence[tuple[float, float]]) -> bool:
    """Return True if points (k, 2) fit into a rectangle with sides parallel to a vector `along` (2,).
    room : lengths and widths of the rectangles, metres."""
    direction = along / np.linalg.norm(along)
    a, b = float(np.ptp(outline @ direction)), float(np.ptp(outline @ [-direction[1], direction[0]]))
    return any((a <= x and b <= y) or (b <= x and a <= y) for x, y in room)


def fits_stock(outline: Floats, along: Floats, room: Sequence[tuple[float, float]]) -> bool:
    """Return True if the outline (k, 2) of a strip fits into a rectangle, and turns by at most 180 degrees.
    along : (2,) direction of the strip.    room : lengths and widths of the rectangles, metres."""
    k = len(outline) // 2
    turns = np.unwrap(np.arctan2(*np.diff(outline[:k], axis=0).T[::-1]))
    return bool(np.ptp(turns) <= np.pi and polygon_area(outline) > 0) and box_fits(outline, along, room)


def splice_cuts(
    course: tuple[float, float],
    nodes: Floats,
    clear: float,
    fits: Callable[[float, float], bool],
    name: str = "the strip",
) -> Cuts:
    """Return the cuts of a strip between two arc lengths.
    nodes : (q,) arc lengths near which cuts are avoided.    clear : least length of a piece, metres.
    fits  : function of two arc lengths; returns True if the piece fits on the stock.
    Raises PatternError if no long piece fits."""
    begin, end = course
    cuts, near_nodes = [begin], 0
    while not fits(cuts[-1], end):
        start = cuts[-1]
        farthest = _farthest(start, end, fits)
        if farthest - start < clear:
            raise PatternError(
                f"no piece of {name} fits on the stock and is long enough for a splice: give larger sheets in "
                "workshop.stock, or narrower members"
            )
        farthest = min(farthest, max(end - 2 * clear, (start + end) / 2))
        least = start + 0.3 * (farthest - start)  # avoids short pieces
        free = _farthest_clear(nodes, clear, least, farthest)
        near_nodes += free is None
        cuts.append(_middle_of_bay(nodes, least, farthest) if free is None else free)
    return Cuts((*cuts, end), near_nodes)


def _farthest(begin: float, end: float, fits: Callable[[float, float], bool]) -> float:
    low, high = begin, end
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (middle, high) if fits(begin, middle) else (low, middle)
    return low


def _farthest_clear(nodes: Floats, clear: float, least: float, limit: float) -> float | None:
    candidates = np.concatenate([[limit], nodes - clear * (1 + 1e-9)])
    candidates = candidates[(candidates >= least) & (candidates <= limit)]
    away = np.abs(candidates[:, None] - nodes[None]).min(axis=1, initial=np.inf)
    allowed = candidates[away >= clear]
    return float(allowed.max()) if len(allowed) else None


def _middle_of_bay(nodes: Floats, least: float, limit: float) -> float:
    ends = np.concatenate([[least], nodes[(nodes > least) & (nodes < limit)], [limit]])
    candidates = np.concatenate([(ends[1:] + ends[:-1]) / 2, [least, limit]])
    away = np.abs(candidates[:, None] - nodes[None]).min(axis=1, initial=np.inf)
    return float(candidates[away.argmax()])


def lapped_span(
    span: tuple[float, float], strip_span: tuple[float, float], lap: float, closed: bool
) -> tuple[float, float]:
    """Return the arc lengths `span` of a piece's ends, with `lap` metres added at each end that is a splice."""
    begin = span[0] - lap if closed or span[0] > strip_span[0] else span[0]
    return begin, span[1] + lap if closed or span[1] < strip_span[1] else span[1]


def scarf_line(splices: int, lap: float) -> str:
    """Return a sentence on scarf joints."""
    return (
        f"{splices} splices are glued: pieces overlap by {length(lap)} and are bevelled 1 to {SCARF_SLOPE:g}; the "
        f"text BEVEL marks bevels on the engraved face, and BEVEL BACK marks bevels on the back"
    )


def lap_marks(
    layer: Development, span: tuple[float, float], full_span: tuple[float, float], lap: float, height: float
) -> tuple[Floats, ...]:
    """Return lines and texts that mark the bevels of a piece at its splices, as polylines (k, 2).
    span, full_span : arc lengths of the piece's ends, without and with overlaps.    lap : half of an overlap (m)."""
    lines = list[Floats]()
    for k, (s, end) in enumerate(zip(span, full_span, strict=True)):
        if s != end:
            line = np.full(2, s + lap if k == 0 else s - lap)
            sides = np.array([-np.interp(line[0], layer.course.s, layer.course.right), 0.0])
            sides[1] = np.interp(line[1], layer.course.s, layer.course.left)
            lines.append(layer.to_plane(line, sides))
            high = min(height, 0.25 * float(np.ptp(sides)), lap / 5)
            place, angle = layer.middle_line_at(np.array([s]))
            lines += label(BEVEL_TEXTS[1 - k], place[0], float(angle[0]), high)
    return tuple(lines)


def strip_fits(development: Development, room: Sequence[tuple[float, float]]) -> Callable[[float, float], bool]:
    """Return a function of two arc lengths that tests whether the piece of a strip fits on the stock.
    room : lengths and widths of the stock, metres."""
    longest = max(np.hypot(x, y) for x, y in room) + 1e-6

    def fits(begin: float, end: float) -> bool:
        (x, y), _ = development.middle_line_at(np.array([begin, end]))  # compare ends first: most pieces are too long
        return float(np.linalg.norm(y - x)) <= longest and fits_stock(development.outline(begin, end), y - x, room)

    return fits
