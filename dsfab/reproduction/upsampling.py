"""The paper's cut by upsampling beside the exact cut: error against number of triangles."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.design import Design
from dsfab.pattern import Stripes
from dsfab.reproduction import drawing
from dsfab.reproduction.drawing import PaperComparison, PaperPicture, save_picture
from dsfab.reproduction.earlier_methods import drawn_families
from dsfab.slicing import Sheet, cut_polygons, sheet_of
from dsfab.surface import Surface, halved

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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


INCHES = 8.6
"""As wide is the chart, however many pixels it has: words are as large as those of the page."""


def upsampled_beside_exact(design: Design, folder: Path) -> PaperComparison:
    """The same stripes in plain widths, cut after more and more rounds of division, and at once."""
    title = "Adaptive upsampling beside the exact cut"
    try:
        found = compared_cuts(design)
    except DsfabError as error:
        return PaperComparison(title, f"Nothing can be compared: {error}.", ())
    first, last = found.upsampled[0], found.upsampled[-1]
    words = (
        "The paper divides triangles that more than one line passes through at the middles of their sides, and cuts "
        "where the stripe value, interpolated between corners, is zero. dsfab cuts along all lines of a triangle at "
        "once, at values that are known. Measured, of the same modes: without division "
        f"{_percent(first.wrong)} of the surface is on the wrong side with {first.triangles:,} triangles, after "
        f"{last.rounds} rounds {_percent(last.wrong)} with {last.triangles:,}; the exact cut has {found.exact:,} and "
        f"no such error. {last.crowded:,} triangles still have more than one line: where families cross, no division "
        "leaves one alone. What error is left comes from crests of the wave within triangles with one line."
    )
    file = f"{design.preset.name}-upsampled.webp"
    _write_chart(found, folder / file)
    told = "Share of the surface on the wrong side, by the number of triangles; at each point its rounds."
    return PaperComparison(title, words, ((PaperPicture(file, "Error against triangles", told, size=drawing.LARGE),),))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _write_chart(found: CutComparison, path: Path) -> None:
    import numpy as np
    from matplotlib.figure import Figure
    from PIL import Image

    wide, tall = drawing.LARGE
    figure = Figure((INCHES, INCHES * tall / wide), dpi=wide / INCHES, layout="constrained")
    _draw(figure.subplots(), found)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    with Image.open(buffer) as drawn:
        save_picture(np.asarray(drawn.convert("RGB")), path)


def _draw(axes: "Axes", found: CutComparison) -> None:
    triangles = [one.triangles for one in found.upsampled]
    wrong = [100 * one.wrong for one in found.upsampled]
    axes.semilogy(triangles, wrong, "o-", color="#3d7fc4", label="divided, then cut where values are zero")
    for one, x, y in zip(found.upsampled, triangles, wrong, strict=True):
        axes.annotate(str(one.rounds), (x, y), (0, 7), textcoords="offset points", ha="center")
    axes.axvline(found.exact, color="#b4441c", ls="--", label="cut along all lines at once: no error")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xlabel("triangles")
    axes.set_ylabel("% of the surface on the wrong side")
    axes.grid(alpha=0.3)
    axes.legend()
