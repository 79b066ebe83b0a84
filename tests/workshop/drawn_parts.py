"""Drawn parts and the gaps between them."""

import numpy as np
from shapely import Polygon

from dsfab.workshop import FlatPart


def least_gap(sheets):
    """Metres between any two parts and from parts to the edges of their sheets, by shapely."""
    found = [np.inf]
    for sheet in sheets:
        placed = [Polygon(one.placed_part.outline) for one in sheet.parts]
        for k, one in enumerate(placed):
            (x0, y0, x1, y1), (a, b) = one.bounds, sheet.size
            found += [x0, y0, a - x1, b - y1, *(one.distance(other) for other in placed[:k])]
    return min(found)


def bowed(name, length, width, bend):
    """A strip with parallel edges that turns by an angle, radians."""
    bend = bend if abs(bend) > 1e-3 else 0.0
    t = np.linspace(-bend / 2, bend / 2, 25) if bend else np.linspace(-0.5, 0.5, 25)
    radius = length / bend if bend else 0.0
    axis = np.c_[radius * np.sin(t), radius * (np.cos(t) - 1)] if bend else np.c_[t * length, 0 * t]
    left = np.c_[np.sin(t), np.cos(t)] if bend else np.tile([0.0, 1.0], (25, 1))
    return FlatPart(
        name, name, (0.0, length), np.concatenate([axis - width / 2 * left, (axis + width / 2 * left)[::-1]])
    )


def drawn(path):
    """The layers on which something is drawn, and how many outlines are cut."""
    import ezdxf

    document = ezdxf.readfile(path)
    assert not document.audit().errors
    assert document.header["$INSUNITS"] == 4
    space = list(document.modelspace())
    assert {entity.dxftype() for entity in space} <= {"LWPOLYLINE", "CIRCLE"}
    return {entity.dxf.layer for entity in space}, sum(entity.dxf.layer == "CUT" for entity in space)
