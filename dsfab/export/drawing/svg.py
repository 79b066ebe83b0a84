"""SVG drawings with plan and elevations on A3 paper.

A unit of the file is a millimetre of paper. Line widths follow ISO 128."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats
from dsfab.core.errors import ExportError
from dsfab.export.drawing.views import PAPER, PAPER_MARGIN, PlacedView, views_on_paper
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, require_equal
from dsfab.export.writing import one_line

TITLE = (185.0, 34.0)  # width and height of the title block, millimetres of paper
STYLE = """
text { font-family: "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; fill: #000;
  stroke: none }
svg { fill: none; stroke: #000; stroke-linecap: round; stroke-linejoin: round }
.fill { fill: #e4e2dd; stroke: none }
.boundary { stroke-width: 0.5 } .edges { stroke-width: 0.25 }
.centre { stroke-width: 0.13; stroke-dasharray: 4 0.8 0.5 0.8; stroke-linecap: butt }
.centre-major { stroke: #1f4e9c } .centre-minor { stroke: #b3261e }
.frame { stroke-width: 0.5 } .thin { stroke-width: 0.13 } .dark { fill: #000; stroke-width: 0.13 }
"""


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of the SVG drawing of a part."""
    return (text.encode() for text in _texts(part))


def _texts(part: Part) -> Iterator[str]:
    scale, placed = views_on_paper(part, TITLE)
    name = one_line(part.name)
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" '
        'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{PAPER[0]:g}mm" height="{PAPER[1]:g}mm" viewBox="0 0 {PAPER[0]:g} {PAPER[1]:g}">\n'
        f"<title>{escape(name)}</title>\n<desc>Scale {scale_name(scale)}; one user unit is 1 mm of paper; dimensions "
        f"in millimetres; lines within {part.details.tolerance:.3g} mm; dsfab {__version__}</desc>\n"
        f"<style>{STYLE}</style>\n"
        f'<rect x="0" y="0" width="{PAPER[0]:g}" height="{PAPER[1]:g}" style="fill: #fff; stroke: none"/>\n'
        f'<rect class="frame" x="{PAPER_MARGIN:g}" y="{PAPER_MARGIN:g}" width="{PAPER[0] - 2 * PAPER_MARGIN:g}" '
        f'height="{PAPER[1] - 2 * PAPER_MARGIN:g}"/>\n'
    )
    for placed_view in placed:
        yield from _view(placed_view, scale)
    yield from _title_block(part, name, scale)
    yield "</svg>\n"


def scale_name(scale: float) -> str:
    """Format a scale as text: '1:20', or '5:1' for an enlargement."""
    return f"1:{scale:g}" if scale >= 1 else f"{1 / scale:g}:1"


def _view(placed: PlacedView, scale: float) -> Iterator[str]:
    view = placed.view
    yield f'<g inkscape:groupmode="layer" inkscape:label={quoteattr(view.title)} data-scale="{scale:g}">\n'
    if view.loops:
        shape = " ".join(_path(placed.on_paper(loop)) + "Z" for loop in view.loops)
        yield f'<path class="fill" fill-rule="evenodd" d="{shape}"/>\n'
    order = {"centre": 0, "edges": 1, "boundary": 2}  # heavy lines are drawn over light lines
    for layer in sorted({line.layer for line, _ in view.runs}, key=lambda layer: (order[layer.split("-")[0]], layer)):
        group = layer.split("-")[0]
        yield f'<g class="{group} {layer}" inkscape:groupmode="layer" inkscape:label="{layer}">\n'
        for line, run in view.runs:
            if line.layer == layer:
                yield f'<path data-id="{line.id}" d="{_path(placed.on_paper(run))}"/>\n'
        yield "</g>\n"
    yield from _dimensions(placed, scale)
    x, y = placed.corner
    yield f'<text x="{x:.2f}" y="{y + placed.size[1] + 16:.2f}" font-size="4">{view.title}'
    yield f'<tspan font-size="3" dx="3">{scale_name(scale)}</tspan></text>\n</g>\n'


def _path(points: Floats) -> str:
    return "M" + " ".join(f"{x:.3f},{y:.3f}" for x, y in (points + 0.0).tolist())


def _dimensions(placed: PlacedView, scale: float) -> Iterator[str]:
    (x, y), (w, h) = placed.corner, placed.size
    wide, high = (f"{value:,.0f}".replace(",", " ") if value >= 100 else f"{value:.3g}" for value in placed.view.extent)
    below, left_x = y + h + 7, x - 7
    yield '<g class="thin" font-size="2.8">'
    yield _line(x - 2, below, x + w + 2, below) + _line(left_x, y - 2, left_x, y + h + 2)
    for tx, ty in ((x, below), (x + w, below), (left_x, y), (left_x, y + h)):
        yield _line(tx - 1, ty + 1, tx + 1, ty - 1)
    yield _text(x + w / 2, below - 1, 2.8, wide, 'text-anchor="middle"')
    turned = f'transform="rotate(-90 {left_x - 1:.2f} {y + h / 2:.2f})" text-anchor="middle"'
    yield _text(left_x - 1, y + h / 2, 2.8, high, turned) + "</g>\n"


def _line(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}"/>'


def _text(x: float, y: float, size: float, text: str, attributes: str = "") -> str:
    return f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size:g}" {attributes}>{escape(one_line(text))}</text>'


def _box(x: float, y: float, wide: float, high: float, kind: str) -> str:
    return f'<rect class="{kind}" x="{x:.3f}" y="{y:.3f}" width="{wide:.3f}" height="{high:.3f}"/>'


def _title_block(part: Part, name: str, scale: float) -> Iterator[str]:
    x, y = PAPER[0] - PAPER_MARGIN - TITLE[0], PAPER[1] - PAPER_MARGIN - TITLE[1]
    yield '<g inkscape:groupmode="layer" inkscape:label="title block">\n'
    yield _box(x, y, *TITLE, "frame") + f'<g class="thin">{_line(x + 105, y, x + 105, y + TITLE[1])}</g>\n'
    yield _text(x + 4, y + 8, 5, name, 'font-weight="bold"')
    for i, fact in enumerate(part.details.facts[:5]):
        yield _text(x + 4, y + 14 + 4.4 * i, 3, fact)
    yield _text(x + 109, y + 8, 5, f"Scale {scale_name(scale)}", 'font-weight="bold"')
    yield from _scale_bar(x + 109, y + 13, scale)
    yield _text(x + 109, y + 26, 2.4, "Dimensions in millimetres. Paper A3. The drawing shows the middle surface.")
    yield _text(x + 109, y + 30.5, 2.4, f"Drawn by dsfab {__version__}") + "\n</g>\n"


def _scale_bar(x: float, y: float, scale: float) -> Iterator[str]:
    rough = 10 * scale
    power = 10.0 ** np.floor(np.log10(rough))
    field = float(max(k for k in (power, 2 * power, 5 * power) if k <= rough * (1 + 1e-9)))
    unit, per = ("m", 1000.0) if field >= 200 else ("mm", 1.0)
    for i in range(5):
        yield _box(x + i * field / scale, y, field / scale, 2, "thin" if i % 2 else "dark")
    for i in range(6):
        yield _text(x + i * field / scale, y + 5.5, 2.4, f"{i * field / per:g}", 'text-anchor="middle"')
    yield _text(x + 5 * field / scale + 5, y + 5.5, 2.4, unit) + "\n"


def check(part: Part, path: Path) -> ReadBack:
    """Compare the lines in the file with the part's drawing. Raises ExportError for a difference."""
    root = ElementTree.parse(path).getroot()
    lines = [element for element in root.iter() if element.get("data-id")]
    expected = sum(len(placed_view.view.runs) for placed_view in views_on_paper(part, TITLE)[1])
    require_equal(part, "lines", expected, len(lines))
    if root.get("width") != f"{PAPER[0]:g}mm":
        raise ExportError(
            f"the drawing of {part.name!r} does not contain the width of the paper in mm; write .dxf instead"
        )
    return ReadBack(len(lines), "lines")
