"""Flat drawings for cutters and engravers as DXF (R2010) and SVG, in millimetres."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, lock
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.drawing.dxf import dxf_bytes, reproducible_output
from dsfab.export.writing import one_line

COLOURS = {"STOCK": 8, "CUT": 1, "HOLES": 5, "SLOTS": 6, "ENGRAVE": 3, "FOLD": 4, "AXIS": 9}
"""Colour numbers of the AutoCAD palette by layer: grey, red, blue, magenta, green, cyan, light grey."""
STROKES = {
    "STOCK": "#888",
    "CUT": "#c00",
    "HOLES": "#00c",
    "SLOTS": "#c0c",
    "ENGRAVE": "#080",
    "FOLD": "#088",
    "AXIS": "#bbb",
}
"""Colours of the layers in SVG, equal to the colours in DXF."""


@dataclass(frozen=True, eq=False)
class FlatLine:
    """A polyline through points (k, 2), metres; a closed polyline does not repeat its first point."""

    layer: str
    points: Floats
    closed: bool = False

    def __post_init__(self) -> None:
        lock(self, "points", np.float64, (None, 2))


@dataclass(frozen=True)
class FlatCircle:
    """A circle with the centre `at` and a diameter, metres."""

    layer: str
    at: tuple[float, float]
    diameter: float


@dataclass(frozen=True)
class FlatDrawing:
    """Title, lines and circles of a drawing."""

    title: str
    lines: tuple[FlatLine, ...]
    circles: tuple[FlatCircle, ...] = ()

    @property
    def layers(self) -> list[str]:
        """Names of the layers that lines or circles use, in the order of `COLOURS`."""
        used = {line.layer for line in self.lines} | {circle.layer for circle in self.circles}
        return [name for name in COLOURS if name in used]


def flat_dxf(drawing: FlatDrawing) -> bytes:
    """Return a drawing as the bytes of a DXF file."""
    frame = _frame(tuple(drawing.layers))
    count = len(drawing.lines) + len(drawing.circles)
    seed = "  9\n$HANDSEED\n  5\n{:X}\n"
    head = frame.before.replace(_TITLE, one_line(drawing.title))
    head = head.replace(seed.format(frame.free), seed.format(frame.free + count))
    return "".join([head, *_entities(drawing, frame), frame.after]).encode(frame.encoding, errors="dxfreplace")


_TITLE = "title of the drawing"


class _Frame(NamedTuple):
    before: str
    after: str
    encoding: str
    free: int
    space: str


@lru_cache(maxsize=8)
def _frame(layers: tuple[str, ...]) -> _Frame:
    with reproducible_output():
        import ezdxf

        document = ezdxf.new("R2010")
        document.header["$INSUNITS"], document.header["$MEASUREMENT"] = 4, 1
        document.header.custom_vars.append("program", f"dsfab {__version__}")
        document.header.custom_vars.append("unit", "millimetre")
        document.header.custom_vars.append("title", _TITLE)
        for name in layers:
            document.layers.add(name, color=COLOURS[name])
        space, encoding = document.modelspace().layout_key, document.output_encoding
        text = dxf_bytes(document).decode(encoding)
    begin = "  0\nSECTION\n  2\nENTITIES\n"
    before, _, after = text.partition(begin)
    free = int(before.partition("  9\n$HANDSEED\n  5\n")[2].partition("\n")[0], 16)
    return _Frame(before + begin, after, encoding, free, space)


def _entities(drawing: FlatDrawing, frame: _Frame) -> Iterator[str]:
    handle = frame.free
    for line in drawing.lines:
        points = ((MM_PER_M * line.points).round(6) + 0.0).tolist()
        yield _entity("LWPOLYLINE", handle, frame.space, line.layer, "AcDbPolyline")
        yield f" 90\n{len(points)}\n 70\n{int(line.closed)}\n"
        yield "".join(f" 10\n{x!r}\n 20\n{y!r}\n" for x, y in points)
        handle += 1
    for circle in drawing.circles:
        x, y = (round(MM_PER_M * x, 6) + 0.0 for x in circle.at)
        yield _entity("CIRCLE", handle, frame.space, circle.layer, "AcDbCircle")
        yield f" 10\n{x!r}\n 20\n{y!r}\n 30\n0.0\n 40\n{MM_PER_M * circle.diameter / 2!r}\n"
        handle += 1


def _entity(kind: str, handle: int, space: str, layer: str, subclass: str) -> str:
    return f"  0\n{kind}\n  5\n{handle:X}\n330\n{space}\n100\nAcDbEntity\n  8\n{layer}\n100\n{subclass}\n"


def check_flat_dxf(drawing: FlatDrawing, path: Path) -> None:
    """Raise ExportError unless a DXF file has the lines and circles of the drawing, in millimetres."""
    words = path.read_text("utf-8", errors="replace").removesuffix("\n").split("\n")
    codes, values = [code.strip() for code in words[::2]], [value.strip() for value in words[1::2]]
    begun = Counter(value for code, value in zip(codes, values, strict=False) if code == "0")
    unit = values[values.index("$INSUNITS") + 1] if "$INSUNITS" in values else ""
    is_complete = len(codes) == len(values) and values[-1:] == ["EOF"] and all(map(str.isdecimal, codes))
    counts = begun["LWPOLYLINE"], begun["CIRCLE"]
    if not is_complete or counts != (len(drawing.lines), len(drawing.circles)) or unit != "4":
        raise ExportError(
            f"the drawing {drawing.title!r} differs when the file is read back; use the .svg files instead"
        )


def flat_svg(drawing: FlatDrawing, hair: float = 0.0) -> bytes:
    """Return the bytes of a full-size SVG file with layers for Inkscape. hair : width of lines, m; 0 for a default."""
    return "".join(_svg(drawing, MM_PER_M * hair)).encode()


def _svg(drawing: FlatDrawing, thin: float) -> Iterator[str]:
    points = np.concatenate([line.points for line in drawing.lines]) * MM_PER_M
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.02 * float((high - low).max())
    (w, h), hair = high - low + 2 * margin, thin or 0.001 * float((high - low).max())
    shift = np.array([margin - low[0], high[1] + margin])
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" '
        'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{w:.3f}mm" height="{h:.3f}mm" viewBox="0 0 {w:.3f} {h:.3f}">\n'
        f"<title>{escape(one_line(drawing.title))}</title>\n<desc>Full size, millimetres; dsfab {__version__}</desc>\n"
    )
    for name in drawing.layers:
        width = min(hair, 0.8) if name == "ENGRAVE" else hair  # text 8 mm high must stay legible
        style = f"fill: none; stroke: {STROKES[name]}; stroke-width: {width:.3f}; stroke-linejoin: round"
        yield f'<g inkscape:groupmode="layer" inkscape:label={quoteattr(name)} id="{name}" style="{style}">\n'
        yield from _svg_layer(drawing, name, shift)
        yield "</g>\n"
    yield "</svg>\n"


def _svg_layer(drawing: FlatDrawing, name: str, shift: Floats) -> Iterator[str]:
    for line in drawing.lines:
        if line.layer == name:
            places = MM_PER_M * line.points * [1, -1] + shift
            path = " ".join(f"{x:.3f},{y:.3f}" for x, y in (places + 0.0).tolist())
            yield f'<path d="M{path}{"Z" if line.closed else ""}"/>\n'
    for circle in drawing.circles:
        if circle.layer == name:
            x, y = MM_PER_M * np.array(circle.at) * [1, -1] + shift
            yield f'<circle cx="{x:.3f}" cy="{y:.3f}" r="{MM_PER_M * circle.diameter / 2:.3f}"/>\n'
