"""The picture for the workshop: a solid with the places of its smallest member, gap, wall and edge."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Floats
from dsfab.render.callouts import ROW, Callout, called_out
from dsfab.render.drawing import Ground, check_ground, rendered
from dsfab.render.lettering import lettered
from dsfab.render.opengl import require_rendering
from dsfab.render.palette import PAPER, Palette
from dsfab.render.png import write_png
from dsfab.render.scene import Body, Bytes, Scene
from dsfab.render.stage import Annotations, legend, staged
from dsfab.render.view import framed, named_side, up_axis
from dsfab.wording import length

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design
    from dsfab.study.fabrication import Check, Fabrication

KEYS = {"member": "min_member", "gap": "min_gap", "wall": "min_wall", "edge": ""}
"""What is marked, and the limit that it is compared with."""


def workshop_picture(
    design: "Design",
    made: "Fabrication",
    *,
    size: tuple[int, int] = (1600, 1200),
    view: str = "iso",
    ground: Ground = "paper",
    palette: Palette = PAPER,
) -> Bytes:
    """The solid of a design in one pale colour, and what was measured on it, (height, width, 3 or 4) bytes.

    Raises DsfabError where nothing can be drawn.
    """
    check_ground(ground)
    require_rendering()
    palette = replace(palette, paper=(255, 255, 255)) if ground == "white" else palette
    V, F = design.solid.V, design.solid.F
    up = up_axis(V, design.surface, design.load)
    side = named_side(V, up, view)
    body = Body(V, F, np.array(palette.plain, dtype=np.uint8), casts=True)
    half = design.preset.statics.thickness / 2
    stage = staged(body, side, up, half, Annotations(design.surface, design.load, layers=()), palette, size)
    aspect = size[0] / size[1]
    stage = replace(stage, view=framed(V, side, (-0.86 * aspect, 0.86 * aspect, -0.76, ROW)))
    with Scene(stage.bodies, stage.centre, stage.radius) as scene:
        image = rendered(scene, stage, palette, size, clear=ground == "transparent")
    box = " x ".join(length(x) for x in made.box)
    image = lettered(image, legend(stage, f"{design.preset.name} - {box}{_fits(made)}", palette, size), palette)
    return np.asarray(called_out(image, callouts(made, palette), stage.view, palette))


def write_workshop_picture(path: Path, design: "Design", made: "Fabrication", size: tuple[int, int]) -> Path:
    """Write `workshop_picture` as a PNG file, whole or not at all; raises ExportError where that cannot be."""
    return write_png(workshop_picture(design, made, size=size), path)


def callouts(made: "Fabrication", palette: Palette) -> list[Callout]:
    """What was found, with its limit and verdict where the preset has one; limits that are missed in red."""
    found = made.features
    measured: dict[str, tuple[float, Floats]] = {
        name: (feature.size, feature.place)
        for name, feature in (("member", found.member), ("gap", found.gap), ("edge", found.edge))
        if feature is not None
    }
    if made.wall is not None:
        measured["wall"] = (made.wall.thickness, made.wall.place)
    checks = {check.name: check for check in made.checks}
    result = []
    for name, key in KEYS.items():
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


def _fits(made: "Fabrication") -> str:
    bed = next((check for check in made.checks if check.name == "bed"), None)
    return "" if bed is None else f", bed {' x '.join(length(x) for x in bed.limit)}: {bed.verdict}"
