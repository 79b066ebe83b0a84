"""The paper's cut by upsampling beside the exact one: error against the number of triangles."""

import io
from pathlib import Path
from typing import TYPE_CHECKING

from dsfab.errors import DsfabError
from dsfab.pipeline import Design
from dsfab.report.paper import drawing
from dsfab.report.paper.drawing import PaperComparison, PaperPicture, save_picture
from dsfab.study import CutComparison, compared_cuts

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
