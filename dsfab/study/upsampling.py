"""Stripes cut as the paper does: triangles that two lines pass through are divided first, then values decide.

A field that is linear over a triangle has its lines at known values, so dsfab cuts along all of them at once. The paper
divides triangles at the middles of their edges until no more than one line passes through each, and cuts where the
interpolated stripe value is zero. Both are made here from the same modes, to compare error and number of triangles.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Bools, Floats, Ints
from dsfab.pattern import Stripes
from dsfab.pipeline import Design
from dsfab.slicing import Sheet, cut_polygons, sheet_of
from dsfab.study.integration import drawn_families
from dsfab.surface import Surface, halved

ROUNDS = 6
"""Of division at most: where lines of two families cross, no division leaves one line alone."""

MANY = 200_000
"""Triangles of a divided mesh that is not divided further."""

FINE = 9
"""Places on a side of a triangle at which material is compared."""


class StripedField(NamedTuple):
    """A family's stripes, and the values x (n,) of its mode."""

    stripes: Stripes
    x: Floats


class UpsampledCut(NamedTuple):
    """A cut after some rounds of division; before them it is the cut of the mesh as it is.

    triangles : of the cut sheet, material and void.
    crowded   : triangles of the divided mesh that more than one line passes through.
    wrong     : share of the surface that is material in one of this and the exact cut only.
    """

    rounds: int
    triangles: int
    crowded: int
    wrong: float


class CutComparison(NamedTuple):
    """The paper's way, round by round, and the triangles of the exact cut of the same stripes."""

    upsampled: tuple[UpsampledCut, ...]
    exact: int


def compared_cuts(design: Design, rounds: int = ROUNDS) -> CutComparison:
    """The stripes of a design on modes, in plain widths, cut in both ways."""
    settings = (design.preset.pattern.major, design.preset.pattern.minor)
    families = [
        StripedField(Stripes(one.frequency, float(own.phase), own.threshold), one.mode)
        for one, own in zip(drawn_families(design), settings, strict=True)
    ]
    return cuts_of(design.surface, families, rounds)


def cuts_of(surface: Surface, families: Sequence[StripedField], rounds: int = ROUNDS) -> CutComparison:
    """The same of any surface and any stripes.

    It ends before `rounds` where no triangle is crowded any more, or there are `MANY`.
    """
    exact = _cut(surface, [one.x for one in families], [one.stripes.levels(one.x) for one in families])
    found: list[UpsampledCut] = []
    for number in range(rounds + 1):
        crowded = lines_through(surface, families) > 1
        value = [one.stripes.value(one.x) for one in families]
        sheet = _cut(surface, value, [np.zeros(1)] * len(families))
        found.append(UpsampledCut(number, sheet.surface.m, int(crowded.sum()), _wrong(surface, families, value)))
        if not crowded.any() or surface.m > MANY:
            break
        surface, families = _divided(surface, families, crowded)
    return CutComparison(tuple(found), exact.surface.m)


def _cut(surface: Surface, fields: Sequence[Floats], levels: Sequence[Floats]) -> Sheet:
    """Along these levels, to the last bit."""
    return sheet_of(cut_polygons(surface, fields, levels, snap=0.0))


def lines_through(surface: Surface, families: Sequence[StripedField]) -> Ints:
    """(m,) how many edges of stripes pass through each triangle."""
    count = np.zeros(surface.m, dtype=np.int64)
    for stripes, x in families:
        levels, corners = stripes.levels(x), x[surface.F]
        below = np.searchsorted(levels, corners.max(axis=1))
        up_to = np.searchsorted(levels, corners.min(axis=1), side="right")
        count += np.maximum(below - up_to, 0)
    return count


def _divided(surface: Surface, families: Sequence[StripedField], crowded: Bools) -> tuple[Surface, list[StripedField]]:
    """Crowded triangles in four; their neighbours in two or three, so that corners meet corners."""
    edges = surface.edges
    marked = np.zeros(len(edges.ends), dtype=bool)
    marked[edges.of[crowded]] = True
    V, F, _ = halved(surface.V, surface.F, edges, marked)
    ends = edges.ends[marked]
    return Surface(V, F), [one._replace(x=np.append(one.x, one.x[ends].mean(axis=1))) for one in families]


def _wrong(surface: Surface, families: Sequence[StripedField], value: Sequence[Floats]) -> float:
    """Share of the surface where the interpolated stripe value (n,) and that of the interpolated mode disagree."""
    i, j = np.meshgrid(*[np.arange(FINE)] * 2, indexing="ij")
    inside = i + j < FINE
    u, v = (i[inside] + 1 / 3) / FINE, (j[inside] + 1 / 3) / FINE
    weight = np.stack([1 - u - v, u, v])
    told, true = (np.zeros((surface.m, len(u)), dtype=bool) for _ in range(2))
    for (stripes, x), s in zip(families, value, strict=True):
        told |= s[surface.F] @ weight > 0
        true |= stripes.value(x[surface.F] @ weight) > 0
    return float(surface.areas @ (told != true).mean(axis=1) / surface.area)
