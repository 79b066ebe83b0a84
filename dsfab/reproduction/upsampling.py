"""Comparison of two ways to cut stripes: after upsampling the mesh (Madan et al.), and exactly."""

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
from dsfab.surface import Surface, halved_edges

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class StripedField(NamedTuple):
    """Stripes of a family. x : (n,) diffusion mode at the vertices. The stripes follow level lines of the mode."""

    stripes: Stripes
    x: Floats


class UpsampledCut(NamedTuple):
    """A cut by upsampling: triangles that several stripe edges cross (crowded triangles) are divided before the cut.
    rounds    : number of divisions.    triangles : number of triangles of the cut sheet.
    crowded   : remaining crowded triangles.    wrong : share of the surface where this cut swaps material and void."""

    rounds: int
    triangles: int
    crowded: int
    wrong: float


class CutComparison(NamedTuple):
    """Cuts after 0, 1, 2 ... divisions of triangles. exact : number of triangles of the exact cut."""

    upsampled: tuple[UpsampledCut, ...]
    exact: int


def compare_design_cuts(design: Design, rounds: int = 6) -> CutComparison:
    """Compare the cut by upsampling with the exact cut of a design's stripes. rounds : largest number of divisions."""
    settings = (design.preset.pattern.major, design.preset.pattern.minor)
    families = [
        StripedField(Stripes(family.frequency, float(options.phase), options.threshold), family.mode)
        for family, options in zip(drawn_families(design), settings, strict=True)
    ]
    return compare_cuts(design.surface, families, rounds)


def compare_cuts(surface: Surface, families: Sequence[StripedField], rounds: int = 6) -> CutComparison:
    """Compare the cut by upsampling with the exact cut of stripes on a surface. rounds : limit of divisions."""
    exact = _cut(surface, [family.x for family in families], [family.stripes.levels(family.x) for family in families])
    cuts: list[UpsampledCut] = []
    for number in range(rounds + 1):
        crowded = lines_through(surface, families) > 1
        value = [family.stripes.value(family.x) for family in families]
        sheet = _cut(surface, value, [np.zeros(1)] * len(families))
        cuts.append(UpsampledCut(number, sheet.surface.m, int(crowded.sum()), _wrong_share(surface, families, value)))
        if not crowded.any() or surface.m > 200_000:
            break
        surface, families = division(surface, families, crowded)
    return CutComparison(tuple(cuts), exact.surface.m)


def _cut(surface: Surface, fields: Sequence[Floats], levels: Sequence[Floats]) -> Sheet:
    return sheet_of(cut_polygons(surface, fields, levels, snap=0.0))


def lines_through(surface: Surface, families: Sequence[StripedField]) -> Ints:
    """Return the number of stripe edges that cross each triangle (m,)."""
    count = np.zeros(surface.m, dtype=np.int64)
    for stripes, x in families:
        levels, corners = stripes.levels(x), x[surface.F]
        below = np.searchsorted(levels, corners.max(axis=1))
        count += np.maximum(below - np.searchsorted(levels, corners.min(axis=1), side="right"), 0)
    return count


def division(surface: Surface, families: Sequence[StripedField], crowded: Bools) -> tuple[Surface, list[StripedField]]:
    """Divide all edges of the triangles `crowded` (m,) in half; return the new surface and the stripes on it."""
    edges = surface.edges
    marked = np.zeros(len(edges.ends), dtype=bool)
    marked[edges.of[crowded]] = True
    V, F, _ = halved_edges(surface.V, surface.F, edges, marked)
    ends = edges.ends[marked]
    return Surface(V, F), [family._replace(x=np.append(family.x, family.x[ends].mean(axis=1))) for family in families]


def _wrong_share(surface: Surface, families: Sequence[StripedField], value: Sequence[Floats], side: int = 9) -> float:
    i, j = np.meshgrid(*[np.arange(side)] * 2, indexing="ij")
    inside = i + j < side
    u, v = (i[inside] + 1 / 3) / side, (j[inside] + 1 / 3) / side
    weight = np.stack([1 - u - v, u, v])
    interpolated, true = (np.zeros((surface.m, len(u)), dtype=bool) for _ in range(2))
    for (stripes, x), s in zip(families, value, strict=True):
        interpolated |= s[surface.F] @ weight > 0
        true |= stripes.value(x[surface.F] @ weight) > 0
    return float(surface.areas @ (interpolated != true).mean(axis=1) / surface.area)


def upsampled_beside_exact(design: Design, folder: Path) -> PaperComparison:
    """Compare the cut by upsampling with the exact cut of a design; save a chart in `folder`."""
    title = "Adaptive upsampling compared with the exact cut"
    try:
        comparison = compare_design_cuts(design)
    except DsfabError as error:
        return PaperComparison(title, f"Nothing can be compared: {error}.", ())
    coarsest, finest = comparison.upsampled[0], comparison.upsampled[-1]
    words = (
        "The paper divides triangles with more than one stripe edge at the middles of their sides. The paper cuts "
        "where the stripe value, interpolated between corners, is zero. dsfab cuts along all stripe edges of a "
        "triangle at once, at known values. Both methods cut the same modes. The paper's method swaps material and "
        f"void on a part of the surface. Without division this part is {_percent(coarsest.wrong)}, with "
        f"{coarsest.triangles:,} triangles; after {finest.rounds} rounds of division {_percent(finest.wrong)}, with "
        f"{finest.triangles:,}. The exact cut has {comparison.exact:,} triangles and "
        f"no error of this kind. {finest.crowded:,} triangles still have two stripe edges or more: division cannot "
        "separate families that cross. The other errors are at crests of the stripe wave, in triangles with one "
        "stripe edge."
    )
    file = f"{design.preset.name}-upsampled.webp"
    _write_chart(comparison, folder / file)
    caption = (
        "Share of the surface with material and void swapped, by number of triangles. Labels show the number of "
        "rounds of division."
    )
    return PaperComparison(
        title, words, ((PaperPicture(file, "Error against triangles", caption, size=drawing.LARGE),),)
    )


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _write_chart(comparison: CutComparison, path: Path) -> None:
    from matplotlib.figure import Figure
    from PIL import Image

    wide, tall = drawing.LARGE
    inches = 8.6  # makes the chart's text as large as the page's text
    figure = Figure((inches, inches * tall / wide), dpi=wide / inches, layout="constrained")
    _draw_chart(figure.subplots(), comparison)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    with Image.open(buffer) as image:
        save_picture(np.asarray(image.convert("RGB")), path)


def _draw_chart(axes: "Axes", comparison: CutComparison) -> None:
    triangles = [upsampled_cut.triangles for upsampled_cut in comparison.upsampled]
    wrong = [100 * upsampled_cut.wrong for upsampled_cut in comparison.upsampled]
    axes.semilogy(triangles, wrong, "o-", color="#3d7fc4", label="Madan et al.: division, cut at interpolated zeros")
    for upsampled_cut, x, y in zip(comparison.upsampled, triangles, wrong, strict=True):
        axes.annotate(str(upsampled_cut.rounds), (x, y), (0, 7), textcoords="offset points", ha="center")
    axes.axvline(comparison.exact, color="#b4441c", ls="--", label="dsfab: exact cut, without error")
    axes.xaxis.set_major_formatter("{x:,.0f}")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.set_xlabel("triangles")
    axes.set_ylabel("% of the surface where material and void are swapped")
    axes.grid(alpha=0.3)
    axes.legend()
