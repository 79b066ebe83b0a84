"""Graphs of members and the drawings of their strips."""

from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from dsfab.export import flat_dxf
from dsfab.members import member_graph
from dsfab.workshop.files import part_drawing
from tests.analytic import SURFACES


@cache
def graph_of(name, edge):
    given = SURFACES[name](edge)
    return given, member_graph(given.surface, given.sheet(), given.pattern)


class ReadPart:
    """A part of a DXF file as ezdxf alone reads it, millimetres turned into metres."""

    def __init__(self, part, folder):
        import ezdxf

        path = folder / f"{part.id}.dxf"
        path.write_bytes(flat_dxf(part_drawing(part)))
        space = ezdxf.readfile(path).modelspace()
        lines = {layer: space.query(f'LWPOLYLINE[layer=="{layer}"]') for layer in ("CUT", "AXIS", "ENGRAVE")}
        (outline,), (axis,) = lines["CUT"], lines["AXIS"]
        assert outline.closed
        assert not axis.closed
        self.outline, self.axis = (np.array([p[:2] for p in line.get_points()]) / 1000 for line in (outline, axis))
        circles = space.query('CIRCLE[layer=="HOLES"]')
        self.holes = np.array([tuple(c.dxf.center)[:2] for c in circles]).reshape(-1, 2) / 1000
        self.diameters = {round(2 * c.dxf.radius, 6) for c in circles}
        self.engraved = len(lines["ENGRAVE"])

    def beside_axis(self, points):
        """Lengths along the drawn axis and distances to its left of points (q, 2), by its nearest segment."""
        a, b = self.axis[:-1], self.axis[1:]
        way = b - a
        long = np.linalg.norm(way, axis=1)
        t = np.einsum("qsi,si->qs", points[:, None] - a, way) / long**2
        t[:, 1:-1] = np.clip(t[:, 1:-1], 0, 1)
        t[:, 0], t[:, -1] = np.minimum(t[:, 0], 1), np.maximum(t[:, -1], 0)
        off = points[:, None] - (a + t[..., None] * way)
        away = np.linalg.norm(off, axis=2)
        k = away.argmin(axis=1)
        q = np.arange(len(points))
        start = np.concatenate([[0], np.cumsum(long)])
        side = np.sign(way[k, 0] * off[q, k, 1] - way[k, 1] * off[q, k, 0])
        return start[k] + t[q, k] * long[k], side * away[q, k]


class Bent:
    """The curve P + h N through a member's stations, sampled finely: lengths and lefts are its own."""

    def __init__(self, course, height, span):
        self.s = np.linspace(*span, 4001)
        curve = CubicSpline(course.s, course.P + height * course.N)
        self.P, way, N = curve(self.s), curve(self.s, 1), CubicSpline(course.s, course.N)(self.s)
        self.long = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(self.P, axis=0), axis=1))])
        N /= np.linalg.norm(N, axis=1)[:, None]
        way -= np.einsum("ki,ki->k", way, N)[:, None] * N
        self.B = np.cross(N, way / np.linalg.norm(way, axis=1)[:, None])

    def points(self, along, left):
        """(q, 3) places of the layer, and (q,) the arc lengths of the axis below them."""
        s = np.interp(along, self.long, self.s)
        P, B = (np.stack([np.interp(along, self.long, x) for x in y.T], axis=1) for y in (self.P, self.B))
        return P + left[:, None] * B, s
