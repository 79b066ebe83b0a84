"""Drawing of docs/grasshopper.md: the component *structure* on a canvas with its inputs and outputs.

The sockets come from the server's own description; the numbers and the structure are its answer to this request.
"""

import json
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path

import dsfab
from dsfab.app.hops.components import COMPONENTS
from dsfab.app.hops.server import solve_request
from dsfab.export import mesh_json
from dsfab.render.picture import Look, picture
from dsfab.surface.files.rhino_and_step import read_rhino_json

INK, WIRE, CANVAS, BOX, DARK, NOTE = "#2b2b2b", "#5c5c5c", "#d6d6d0", "#f2f2ee", "#4a4a4a", "#f6edb8"
ROW = 0.42
"""Distance between sockets, inches."""

FED = {"snow": 1200.0, "spacing": 0.6, "share": 0.45}
"""Values of the sliders: Pa, metres, and the share of material."""

PRESET = 'statics.material = "GL28h"'


def body(V: Any, F: Any) -> dict[str, Any]:
    """Return the request that Hops sends for a model in metres."""
    values = [("mesh", "Rhino.Geometry.Mesh", mesh_json(V, F)), ("preset", "System.String", json.dumps(PRESET))]
    values += [(name, "System.Double", str(number)) for name, number in FED.items()]
    trees = [{"ParamName": name, "InnerTree": {"{0}": [{"type": kind, "data": one}]}} for name, kind, one in values]
    return {"modelunits": "Meters", "pointer": "/structure", "values": trees}


def drawn(file: Any) -> Figure:
    """Draw the canvas of the component for the surface of a mesh file."""
    surface = dsfab.read_surface(file, "m")
    done, answer = solve_request("structure", body(surface.V, surface.F))
    if not done:
        raise RuntimeError(answer)
    given = {one["ParamName"]: one["InnerTree"]["0"] for one in json.loads(answer)["values"]}
    figure = Figure((13.2, 4.6), dpi=100, facecolor=CANVAS)
    place = figure.add_axes((0, 0, 1, 1))
    place.set(xlim=(0, 13.2), ylim=(0, 4.6))
    place.set_axis_off()
    component(place)
    sources(place, len(surface.F))
    answers(place, given)
    mesh = read_rhino_json(given["solid"][0]["data"])
    solid = picture(mesh.V, mesh.F, look=Look((900, 768)))
    shown = figure.add_axes((9.3 / 13.2, 0.9 / 4.6, 3.75 / 13.2, 3.2 / 4.6))
    shown.imshow(solid, aspect="auto")
    shown.set_axis_off()
    return figure


def box(place: Axes, x: float, y: float, wide: float, tall: float, colour: str = BOX) -> None:
    place.add_patch(FancyBboxPatch((x, y), wide, tall, "round,pad=0,rounding_size=0.08", fc=colour, ec=INK, lw=1.2))


def wire(place: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    (a, b), (c, d), pull = start, end, 0.5 * (end[0] - start[0])
    curve = Path([(a, b), (a + pull, b), (c - pull, d), (c, d)], [Path.MOVETO, *[Path.CURVE4] * 3])
    place.add_patch(PathPatch(curve, fc="none", ec=WIRE, lw=2.2))


def socket(name: str, side: str) -> tuple[float, float]:
    """Return the position of a socket of the component, inches."""
    one = COMPONENTS["structure"]
    names = [each.name for each in (one.inputs if side == "in" else one.outputs)]
    return (4.2 if side == "in" else 6.9), 3.95 - ROW * (names.index(name) + 0.5)


def component(place: Axes) -> None:
    one = COMPONENTS["structure"]
    box(place, 4.2, 0.9, 2.7, 3.2)
    place.text(5.55, 4.25, "Hops", ha="center", color=INK, fontsize=11)
    place.text(5.55, 0.62, "http://localhost:5000/structure", ha="center", color=INK, fontsize=10)
    box(place, 5.34, 0.98, 0.42, 3.04, DARK)
    place.text(5.55, 2.5, one.name, rotation=90, ha="center", va="center", color="white", fontsize=12)
    for side, parameters, align, shift in (("in", one.inputs, "left", 0.14), ("out", one.outputs, "right", -0.14)):
        for each in parameters:
            x, y = socket(each.name, side)
            place.plot(x, y, "o", ms=8, mfc="white", mec=INK)
            place.text(x + shift, y, each.name, ha=align, va="center", color=INK, fontsize=11)


def sources(place: Axes, triangles: int) -> None:
    """Draw the sources: a mesh, sliders and a panel."""
    sliders = {"snow": (0, 3000, "Pa"), "spacing": (0.2, 2, "m"), "share": (0.2, 0.7, "")}
    top = 3.72
    box(place, 0.3, top, 2.3, 0.36)
    place.text(0.45, top + 0.18, f"Mesh   {triangles:,} triangles", va="center", color=INK, fontsize=10)
    wire(place, (2.6, top + 0.18), socket("mesh", "in"))
    for k, (name, (low, high, unit)) in enumerate(sliders.items(), 1):
        y = top - 0.7 * k
        box(place, 0.3, y, 2.3, 0.36)
        at = 1.1 + 0.8 * (FED[name] - low) / (high - low)
        place.plot((1.1, 1.9), (y + 0.18, y + 0.18), color=WIRE, lw=1.5)
        place.plot(at, y + 0.18, "o", ms=9, mfc="white", mec=INK)
        place.text(0.45, y + 0.18, name, va="center", color=INK, fontsize=10)
        place.text(2.0, y + 0.18, f"{FED[name]:g} {unit}".strip(), va="center", color=INK, fontsize=8)
        wire(place, (2.6, y + 0.18), socket(name, "in"))
    box(place, 0.3, 0.87, 2.3, 0.45, NOTE)
    place.text(0.42, 1.095, PRESET, va="center", color=INK, fontsize=8, family="monospace")
    wire(place, (2.6, 1.095), socket("preset", "in"))


def answers(place: Axes, given: dict[str, Any]) -> None:
    """Draw the outputs: counts of curves and names, compliance and mass."""
    numbers = {name: float(given[name][0]["data"]) for name in ("compliance", "mass")}
    told = {
        "lines": f"{len(given['lines'])} curves",
        "edges": f"{len(given['edges'])} curves",
        "names": f"{len(given['names'])} names",
        "compliance": f"{numbers['compliance']:,.0f} J",
        "mass": f"{numbers['mass'] / 1000:.2f} t",
    }
    wire(place, socket("solid", "out"), (9.3, socket("solid", "out")[1]))
    for name, words in told.items():
        x, y = socket(name, "out")
        box(place, 7.6, y - 0.17, 1.5, 0.34, NOTE)
        place.text(7.7, y, words, va="center", color=INK, fontsize=8.5, family="monospace")
        wire(place, (x, y), (7.6, y))
