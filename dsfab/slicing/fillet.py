"""`rounded_corners`: the corners of the openings of a sheet rounded off with a radius.

void   .-'''----- wall b      The void beyond the chords of an arc that touches both walls becomes material. All
     .'  \\ material           chords are straight in the plane that touches the surface at the corner; each is cut
    /  new \\                  through the void's cells as the level of a linear field, so that neighbours fit.
wall a      corner
"""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import PatternError
from dsfab.slicing.clean import Snapping, clean_split
from dsfab.slicing.fillet_chords import SNAP, Fillets, fitting_fillets
from dsfab.slicing.opening_corners import Corners
from dsfab.slicing.pinch import pinched_vertices
from dsfab.slicing.polygon_mesh import PolygonMesh
from dsfab.slicing.recut import Recut
from dsfab.slicing.sheet import Sheet

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it, less their whole parts, are spread evenly."""


def rounded_corners(sheet: Sheet, radius: float) -> tuple[Sheet, Floats]:
    """All cells of a sheet with the corners of its openings rounded off, and the radius (k,) that each became, metres.

    sheet  : material and void, without pinches.
    radius : metres; smaller where the walls beside a corner leave no room for it. The arc is one in the plane that
             touches the surface at the corner, to a 20th of its radius; corners that turn by under 20 degrees stay. At
             a blunt tip, where a disc of that radius stops before several corners, one arc rounds them all.

    Material is added only, never taken away; it takes the family of the member before the corner. Corners stay whose
    arcs, on cells that are coarse beside the radius, would touch other material in a point.
    Raises PatternError for a radius that is no length.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise PatternError(f"the radius {radius} of fillets must be a positive length in metres")
    corners = Corners.of(sheet)
    if not len(corners.walls.start):
        return sheet, np.empty(0)
    fillets = fitting_fillets(corners, radius)
    while fillets.count:
        done = _with_fillets(corners, fillets)
        clear = _clear_of(corners, fillets, done.surface.V[pinched_vertices(done)])
        if clear.all():
            return done, fillets.radius
        fillets = fillets.some(clear)
    return sheet, np.empty(0)


def _clear_of(corners: Corners, fillets: Fillets, X: Floats) -> Bools:
    """(k,) which arcs cut no cell with one of a few points X (p, 3) in its box."""
    surface, (arc, cell) = corners.sheet.surface, fillets.pair.T
    box, near = surface.V[surface.F[cell]], SNAP * fillets.radius[arc][:, None]
    clear = np.ones(fillets.count, dtype=bool)
    for x in X:
        clear[arc[((box.min(axis=1) - near <= x) & (x <= box.max(axis=1) + near)).all(axis=1)]] = False
    return clear


def _with_fillets(corners: Corners, fillets: Fillets) -> Sheet:
    """Only the cells that are cut and their neighbours are divided as polygons; the others are as they were."""
    sheet, surface = corners.sheet, corners.sheet.surface
    some = Recut.of(sheet, fillets.pair[:, 1])
    which, mesh = some.cells, some.mesh
    corner = np.searchsorted(some.vertices, corners.walls.start[fillets.wall])
    family = sheet.family[corners.walls.outside[fillets.wall] // 3]
    arc, cell = fillets.pair[:, 0], np.searchsorted(which, fillets.pair[:, 1])
    colour, root = _colours(arc, mesh.cells.corner.reshape(-1, 3)[cell]), np.arange(len(which))
    for group in range(int(colour.max()) + 1):
        mine = np.full(len(which), -1)
        pairs = colour[arc] == group
        mine[cell[pairs]] = arc[pairs]
        mesh, source, filled_in = _filled_corners(mesh, mine[root], fillets, corner, surface.size)
        root = root[source]
        mesh.family[filled_in] = family[mine[root[filled_in]]]
    return some.together(mesh, root)


def _colours(arc: Ints, corner: Ints) -> Ints:
    """(k,) arcs in groups such that cells of two of a group have no vertex in common.

    arc : (p,) of a cell, and corner : (p, 3) the vertices of that. Of the arcs left, those come next that are first at
    all their vertices, in an order without rhyme: few rounds are needed.
    """
    vertex, arc = corner.ravel(), np.repeat(arc, 3)
    count = int(arc.max()) + 1
    rank = np.argsort(np.argsort(np.arange(count) * GOLDEN % 1))
    colour, waiting, group = np.full(count, -1), np.ones(count, dtype=bool), 0
    while waiting.any():
        on = waiting[arc]
        best = np.full(int(vertex.max()) + 1, count)
        np.minimum.at(best, vertex[on], rank[arc[on]])
        chosen = waiting.copy()
        chosen[arc[on & (best[vertex] != rank[arc])]] = False
        colour[chosen], group = group, group + 1
        waiting &= ~chosen
    return colour


def _filled_corners(
    mesh: PolygonMesh, arc: Ints, fillets: Fillets, corner: Ints, size: float
) -> tuple[PolygonMesh, Ints, Bools]:
    """The polygons cut along the chords of an arc (c,) each, -1 for none; what each was before, and which to fill.

    corner : (k,) the vertex that each arc rounds off.    size : of the surface, metres.
    """
    arc = np.where(mesh.void, arc, -1)
    source, beyond = np.arange(len(arc)), np.zeros(len(arc), dtype=bool)
    planes = [(fillets.ray[:, k], fillets.ray_distance[:, k], True) for k in range(fillets.ray.shape[1])]
    planes += [(fillets.normal[:, k], fillets.distance[:, k], False) for k in range(fillets.normal.shape[1])]
    for normal, distance, outside in planes:
        active = (arc >= 0) & ~beyond
        active[active] = normal[arc[active]].any(axis=1)
        if not active.any():
            continue
        x = _heights(mesh, arc, active, normal, distance, SNAP * fillets.radius)
        split = clean_split(mesh.cells, mesh.X, x, np.zeros(1), active, Snapping(0.0, size))
        mesh, came = mesh.after(split), split.source
        source, arc, beyond = source[came], arc[came], beyond[came]
        if outside:
            arc = np.where(split.strip == 1, -1, arc)
        else:
            beyond |= split.strip == 1
    part = mesh.parts(beyond)
    at = beyond[mesh.cells.owner] & (mesh.cells.corner == corner[arc[mesh.cells.owner]])
    wanted = np.zeros(len(beyond), dtype=bool)
    wanted[part[mesh.cells.owner[at]]] = True
    return mesh, source, beyond & wanted[part]


def _heights(mesh: PolygonMesh, arc: Ints, active: Bools, normal: Floats, distance: Floats, snap: Floats) -> Floats:
    """(n',) metres by which vertices of the active polygons lie beyond a plane (k, 3), (k,) of the polygon's arc (c,);
    none where it is less than `snap` (k,)."""
    slots = mesh.cells.slots(np.flatnonzero(active))
    vertex, mine = mesh.cells.corner[slots], arc[mesh.cells.owner[slots]]
    height = np.einsum("ki,ki->k", normal[mine], mesh.X[vertex]) - distance[mine]
    x = np.zeros(len(mesh.X))
    x[vertex] = np.where(np.abs(height) < snap[mine], 0.0, height)
    return x
