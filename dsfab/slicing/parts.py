"""Parts of a sheet as surfaces of their own, and how large their pieces are."""

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.surface import Surface


def part_of(surface: Surface, mask: Bools) -> tuple[Surface, Ints]:
    """The marked faces as a surface, and the faces that they were."""
    F, used = surface.F[mask], np.zeros(surface.n, dtype=bool)
    used[F] = True
    number = np.cumsum(used) - 1
    return Surface(surface.V[used], number[F]), np.flatnonzero(mask)


def whole_edges(part: Surface, whole: Surface, faces: Ints) -> Ints:
    """(e,) the edges of the whole that those of a part are; `faces` (f,) are those of the part."""
    found = np.empty(len(part.edges.ends), dtype=np.int64)
    found[part.edges.of] = whole.edges.of[faces]
    return found


def inner_walls(void: Surface, whole: Surface, faces: Ints) -> Bools:
    """(e,) the boundary edges of a part that are not on the boundary of the whole."""
    return np.asarray(void.edges.boundary & ~whole.edges.boundary[whole_edges(void, whole, faces)])


def round_sizes(part: Surface, walls: Bools, label: Ints, count: int) -> Floats:
    """(count,) 4 area / perimeter of the pieces of a part; infinite for those that walls do not enclose wholly."""
    length = part.edge_lengths
    edge = np.flatnonzero(part.edges.boundary)
    whose = label[part.edges.order[part.edges.start[:-1]][edge] // 3]
    around = np.bincount(whose, length[edge], count)
    enclosed = (np.bincount(whose, ~walls[edge], count) == 0) & (around > 0)
    areas = np.bincount(label, part.areas, count)
    sizes: Floats = np.divide(4 * areas, around, out=np.full(count, np.inf), where=enclosed)
    return sizes


def medians(values: Floats, weight: Floats, label: Ints, count: int) -> Floats:
    """(count,) the value that half of the weight under each label does not exceed; infinite where nothing weighs.

    Values that are not a number do not count.
    """
    good = np.flatnonzero((weight > 0) & ~np.isnan(values))
    order = good[np.lexsort((values[good], label[good]))]
    x, of = values[order], label[order]
    total = np.bincount(of, weight[order], count)
    upto = np.cumsum(weight[order]) - (np.cumsum(total) - total)[of]
    half = np.flatnonzero(upto >= 0.5 * total[of])
    found = np.full(count, np.inf)
    found[of[half][::-1]] = x[half][::-1]
    return found
