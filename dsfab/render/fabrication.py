"""The picture for the workshop: a solid with notes on its smallest member, gap, wall and edge."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.render.drawing import FINER, Annotations, GroundKind, check_ground, legend, render_stage, set_stage
from dsfab.render.lettering import PAPER, Palette, with_legend
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import write_png
from dsfab.render.scene import Body, Bytes, Colour, Scene
from dsfab.render.view import View, fit_view, named_side, up_axis

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

    from dsfab.design.design import Design
    from dsfab.study.fabrication import Check, FabricationMeasures

LIMIT_KEYS = {"member": "min_member", "gap": "min_gap", "wall": "min_wall", "edge": ""}  # preset key of each measure


@dataclass(frozen=True, eq=False)
class Callout:
    """A note on a place (3,), metres: two lines of text, and the colour of the ring around the place."""

    place: Floats
    lines: tuple[str, str]
    colour: Colour


def workshop_picture(
    design: "Design",
    measures: "FabricationMeasures",
    *,
    size: tuple[int, int] = (1600, 1200),
    view: str = "iso",
    ground: GroundKind = "paper",
    palette: Palette = PAPER,
) -> Bytes:
    """Return a picture of a solid with its fabrication measures, (height, width, 3 or 4) bytes. Raises DsfabError."""
    check_ground(ground)
    require_rendering()
    palette = replace(palette, paper=(255, 255, 255)) if ground == "white" else palette
    V, F = design.solid.V, design.solid.F
    up = up_axis(V, design.surface, design.load)
    side = named_side(V, up, view)
    body = Body(V, F, np.array(palette.plain, dtype=np.uint8), casts=True)
    half = design.preset.statics.thickness / 2
    stage = set_stage(body, side, up, half, Annotations(design.surface, design.load, layers=()), palette, size)
    aspect = size[0] / size[1]
    stage = replace(stage, view=fit_view(V, side, (-0.86 * aspect, 0.86 * aspect, -0.76, 0.66)))  # space for notes
    with Scene(stage.bodies, stage.centre, stage.radius) as scene:
        image = render_stage(scene, stage, palette, size, transparent=ground == "transparent")
    box = " x ".join(length(x) for x in measures.box)
    words = f"{design.preset.name} - {box}{_bed_text(measures)}"
    image = with_legend(image, legend(stage, words, palette, size), palette)
    return np.asarray(with_callouts(image, callouts(measures, palette), stage.view, palette))


def write_workshop_picture(
    path: Path, design: "Design", measures: "FabricationMeasures", size: tuple[int, int]
) -> Path:
    """Write `workshop_picture` as a PNG file. Raises ExportError."""
    return write_png(workshop_picture(design, measures, size=size), path)


def callouts(measures: "FabricationMeasures", palette: Palette) -> list[Callout]:
    """Return a note for each measure, with its limit and a verdict."""
    features = measures.features
    measured: dict[str, tuple[float, Floats]] = {
        name: (feature.size, feature.place)
        for name, feature in (("member", features.member), ("gap", features.gap), ("edge", features.edge))
        if feature is not None
    }
    if measures.wall is not None:
        measured["wall"] = (measures.wall.thickness, measures.wall.place)
    checks = {check.name: check for check in measures.checks}
    result = []
    for name, key in LIMIT_KEYS.items():
        if name in measured:
            value, place = measured[name]
            check = checks.get(key)
            words = (f"{'thinnest' if name == 'wall' else 'smallest'} {name} {length(value)}", _verdict(check))
            result.append(Callout(place, words, _colour(check, palette)))
    return result


def _verdict(check: "Check | None") -> str:
    return "no limit given" if check is None else f"at least {length(check.limit[0])}: {check.verdict}"


def _colour(check: "Check | None", palette: Palette) -> tuple[int, int, int]:
    if check is None:
        return palette.text
    return {"pass": palette.load, "fail": palette.tension}.get(check.verdict, palette.reaction)


def _bed_text(measures: "FabricationMeasures") -> str:
    bed = next((check for check in measures.checks if check.name == "bed"), None)
    return "" if bed is None else f", bed {' x '.join(length(x) for x in bed.limit)}: {bed.verdict}"


def with_callouts(image: "Image", callouts: list[Callout], view: View, palette: Palette) -> "Image":
    """Return the picture with a ring and a note at each measured place."""
    from PIL import Image, ImageDraw, ImageFont
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    if not callouts:
        return image
    width, height = FINER * np.array(image.size)
    letter = max(height / 46, FINER * 9.0)
    over = Image.new("RGBA", (int(width), int(height)))
    draw, font = ImageDraw.Draw(over), ImageFont.load_default(size=0.95 * letter)
    seen = view.page_coordinates(np.array([callout.place for callout in callouts]))
    spots = np.stack([width / 2 + seen[:, 0] * height / 2, height / 2 - seen[:, 1] * height / 2], axis=1)
    base = 2.2 * letter
    words = np.stack([(np.arange(len(spots)) + 0.5) * width / len(spots), np.full(len(spots), base)], axis=1)
    for k, which in zip(*linear_sum_assignment(cdist(words, spots)), strict=True):
        callout, middle = callouts[which], float(words[k, 0])
        for number, text in enumerate(callout.lines):
            position = (middle, base + 1.3 * letter * number)
            draw.text(position, text, fill=callout.colour if number == 0 else palette.text, font=font, anchor="ms")
        _lead(draw, np.array([middle, base + 1.9 * letter]), spots[which], 0.9 * letter, callout.colour)
    return Image.alpha_composite(image.convert("RGBA"), over.reduce(FINER)).convert(image.mode)


def _lead(draw: "ImageDraw", start: Floats, end: Floats, radius: float, colour: Colour) -> None:
    distance = max(float(np.linalg.norm(end - start)), np.finfo(float).tiny)
    edge = start + max(1 - radius / distance, 0.0) * (end - start)
    stroke = max(round(radius / 9), 1)
    draw.line((*start.tolist(), *edge.tolist()), fill=colour, width=stroke)
    draw.ellipse((*(end - radius).tolist(), *(end + radius).tolist()), outline=colour, width=2 * stroke)
