"""What of a sheet lies in no stripe (fillets, bridges, filled openings): it goes to the member beside, or is one."""

import numpy as np

from dsfab.arrays import Floats, Ints, edge_lengths
from dsfab.members.components import Component
from dsfab.slicing import Overlay
from dsfab.surface import connected

FILLED = 0.5
"""What no stripe covers is a member of its own where 4 area / perimeter is over this share of the width of the member
that it borders on most; else it belongs to that."""


def owners(overlay: Overlay, found: list[Component]) -> Ints:
    """(m, f) the component that each cell is a part of for each field, -1 for none; others than fields have none."""
    member = np.full((overlay.sheet.surface.m, overlay.part.shape[1]), -1)
    for number, one in enumerate(found):
        if one.field >= 0:
            member[one.cells, one.field] = number
    return member


def with_loose(overlay: Overlay, found: list[Component]) -> list[Component]:
    """The components with what lies in no stripe; together they have every cell."""
    surface, member = overlay.sheet.surface, owners(overlay, found)
    loose = np.asarray((member < 0).all(axis=1))
    if not loose.any():
        return found
    f, g = overlay.linked.T
    both = loose[f] & loose[g]
    _, patch = np.unique(connected(surface.m, f[both], g[both])[1][loose], return_inverse=True)
    of = np.full(surface.m, -1)
    of[loose] = patch.ravel()
    count = int(of.max()) + 1
    beside, length = _borders(overlay, member, of)
    area, around = _sizes(overlay, of, count)
    inside = np.flatnonzero(loose)[np.argsort(of[loose], kind="stable")]
    cells = np.split(inside, np.cumsum(np.bincount(of[loose]))[:-1])
    begin = np.searchsorted(beside[:, 0], np.arange(count + 1))
    more = list[Component]()
    for number, mine in enumerate(cells):
        here = slice(begin[number], begin[number + 1])
        others, shared = beside[here, 1], length[here]
        most = int(others[shared.argmax()]) if len(others) else -1
        broad = len(others) > 1 and 4 * area[number] / around[number] > FILLED * found[most].width(surface.areas)
        if broad or not len(others):
            more.append(Component("fill" if broad else "plate", "", 0, mine, np.ones(len(mine), dtype=bool)))
        else:
            found[most] = found[most].along(mine, core=len(others) == 1)
    return found + more


def _borders(overlay: Overlay, member: Ints, patch: Ints) -> tuple[Ints, Floats]:
    """(b, 2) patches and the components (m, f) that they border on, ascending, and (b,) metres of that."""
    surface, total = overlay.sheet.surface, int(member.max()) + 1
    f, g = np.concatenate([overlay.linked, overlay.linked[:, ::-1]]).T
    edge = np.tile(surface.edges.of.ravel()[surface.edges.pairs[:, 0]], 2)
    across = (patch[f] >= 0) & (patch[g] < 0)
    f, g, metres = f[across], g[across], edge_lengths(surface.V, surface.edges.ends[edge[across]])
    row, field = np.nonzero(member[g] >= 0)
    key = patch[f[row]] * total + member[g[row], field]
    values, of = np.unique(key, return_inverse=True)
    shared = np.bincount(of.ravel(), metres[row], len(values)).astype(np.float64)
    return np.stack([values // total, values % total], axis=1).astype(np.int64), shared


def _sizes(overlay: Overlay, patch: Ints, count: int) -> tuple[Floats, Floats]:
    """(count,) areas of patches (m,), and (count,) the lengths of their outlines."""
    surface = overlay.sheet.surface
    here = patch >= 0
    area = np.bincount(patch[here], surface.areas[here], count).astype(np.float64)
    size = surface.edge_lengths[surface.edges.of]
    whole = np.bincount(patch[here], size[here].sum(axis=1), count).astype(np.float64)
    f, g = overlay.linked.T
    inner = here[f] & (patch[f] == patch[g])
    pair = surface.edges.of.ravel()[surface.edges.pairs[:, 0]][inner]
    return area, whole - 2 * np.bincount(patch[f[inner]], surface.edge_lengths[pair], count)
