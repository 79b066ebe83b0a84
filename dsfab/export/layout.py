"""Views on a sheet of paper: the largest usual scale at which they fit beside the title block, and where they stand."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.part import Part
from dsfab.export.views import DrawingView, views

PAPER = (420.0, 297.0)
"""A3, millimetres."""
MARGIN = 10.0
"""From the edge of the paper to the frame, millimetres."""
ROOM = (24.0, 10.0, 12.0, 24.0)
"""Paper left free around each view for its dimensions and its title: left, top, right, bottom; millimetres."""
MOST = 30.0
"""Free paper between views that stand in rows below each other, millimetres."""
STEPS = (1.0, 2.0, 2.5, 5.0)
"""Usual scales are these times a power of ten."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A view on paper: its upper left corner and its size, millimetres from the paper's upper left corner."""

    view: DrawingView
    corner: tuple[float, float]
    scale: float

    @property
    def size(self) -> Floats:
        """(2,) width and height on paper, millimetres."""
        return np.asarray(self.view.extent / self.scale)

    def on_paper(self, points: Floats) -> Floats:
        """Points (k, 2) of the view, in millimetres of paper, y downwards."""
        x, y = ((points - self.view.low) / self.scale).T
        return np.stack([self.corner[0] + x, self.corner[1] + self.size[1] - y], axis=1)


def arranged(part: Part, title: tuple[float, float]) -> tuple[float, list[Placed]]:
    """The scale (millimetres per millimetre of paper) and the views in rows, as large as they fit.

    title : width and height of the block that stays free in the lower right corner, millimetres.
    """
    by_name = {view.title.split()[0]: view for view in views(part)}
    rows = (("Plan", "Front", "Right"),), (("Front", "Right"), ("Plan",)), (("Plan",), ("Front",), ("Right",))
    choices = [[[by_name[k] for k in row if k in by_name] for row in layout] for layout in rows]
    scale, chosen = min(((_scale(c, title), i) for i, c in enumerate(choices)), key=lambda one: one)
    return scale, _placed([row for row in choices[chosen] if row], scale, title)


def _scale(rows: list[list[DrawingView]], title: tuple[float, float]) -> float:
    """The first of the usual scales at which the rows fit above the title block, or beside it in the last row."""
    extents = np.concatenate([view.extent for row in rows for view in row])
    power = 10.0 ** np.floor(np.log10(extents.max() / max(PAPER)) - 1)
    while True:
        for step in STEPS:
            if _fits(rows, float(f"{step * power:.6g}"), title):
                return float(f"{step * power:.6g}")
        power *= 10


def _fits(rows: list[list[DrawingView]], scale: float, title: tuple[float, float]) -> bool:
    wide, high = PAPER[0] - 2 * MARGIN, PAPER[1] - 2 * MARGIN
    sizes = [_row_size(row, scale) for row in rows if row]
    if any(width > wide for width, _ in sizes):
        return False
    beside = sizes[-1][0] <= wide - title[0]
    return sum(height for _, height in sizes) <= (high if beside else high - title[1])


def _row_size(row: list[DrawingView], scale: float) -> tuple[float, float]:
    width = sum(float(view.extent[0]) / scale + ROOM[0] + ROOM[2] for view in row)
    return width, max(float(view.extent[1]) / scale for view in row) + ROOM[1] + ROOM[3]


def _placed(rows: list[list[DrawingView]], scale: float, title: tuple[float, float]) -> list[Placed]:
    """Rows from the top, the free height shared out between them; views of a row stand on one line."""
    sizes = [_row_size(row, scale) for row in rows]
    total = sum(height for _, height in sizes)
    beside = sizes[-1][0] <= PAPER[0] - 2 * MARGIN - title[0]
    gap = max((PAPER[1] - 2 * MARGIN - (0 if beside and len(rows) > 1 else title[1]) - total) / (len(rows) + 1), 0.0)
    free = min((PAPER[0] - 2 * MARGIN - width) / (len(row) + 1) for row, (width, _) in zip(rows, sizes, strict=True))
    space = max(free if len(rows) == 1 else min(free, MOST), 0.0)  # the same in all rows: views stand below each other
    found, y = list[Placed](), MARGIN
    for row, (_, height) in zip(rows, sizes, strict=True):
        y, x = y + gap, MARGIN
        for view in row:
            w, h = (view.extent / scale).tolist()
            x += space
            found.append(Placed(view, (x + ROOM[0], y + height - ROOM[3] - h), scale))
            x += w + ROOM[0] + ROOM[2]
        y += height
    return found
