"""The picture of a finished structure: a plaster-like model on white paper, with its loads, supports and scale."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from dsfab.app import light, marks
from dsfab.app.gl import require_rendering
from dsfab.app.lettering import Legend, lettered
from dsfab.app.palette import PAPER, MarkName, Palette
from dsfab.app.scene import Body, Bytes, Floats32, Pixels, Scene
from dsfab.app.view import Side, View, best_side, framed, up_axis
from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import DsfabError
from dsfab.surface import LoadCase, Surface

if TYPE_CHECKING:
    from PIL.Image import Image

FINER = 2
"""Drawn at twice the size and averaged: smooth edges."""

PERSON_FITS = (2.0, 60.0)
"""A person is drawn beside structures of these heights, metres."""

FADE = 0.12
"""Shadows fade out towards the edges of the page over this share of its height."""

BOARD = 0.012
"""Behind a plate that is seen face on lies a board, this share of its size away."""

TOUCHES = 0.05
"""Supports within this share of the height from the lowest point stand on the ground."""


@dataclass(frozen=True, eq=False)
class Stage:
    """Everything that is placed before a picture is taken; `level` is that of the floor along `view.floor`, or None."""

    bodies: list[Body]
    view: View
    level: float | None
    centre: Floats
    radius: float


def picture(
    V: ArrayLike,
    F: ArrayLike,
    *,
    surface: Surface | None = None,
    load: LoadCase | None = None,
    family: ArrayLike | None = None,
    caption: str = "",
    size: tuple[int, int] = (1600, 1200),
    up: ArrayLike | None = None,
    palette: Palette = PAPER,
) -> Bytes:
    """A picture of a solid (or a sheet), seen from a side that suits its shape, whole on the page.

    V, F    : (n, 3) metres and (m, 3), outward oriented.
    surface, load : the uncut surface and what acts on it, for arrows, supports and the ground; both or none.
    family  : (m,) index into `palette.families` for each face, -1 for the one colour of all members.
    caption : one line below. size : (width, height) in pixels. up : (3,) any length, found out when left out.

    Returns (height, width, 3) bytes, red green blue. Raises DsfabError where nothing can be drawn (see
    `dsfab.app.gl.require_rendering`) and for a solid without faces. Draw in one thread at a time.
    """
    vertices, faces = np.asarray(V, dtype=np.float64), np.asarray(F, dtype=np.int64)
    if not len(faces):
        raise DsfabError("there is nothing to draw: the solid has no faces; loosen the pattern's thresholds")
    require_rendering()
    member = _member_colours(faces, family, palette)
    axis = up_axis(vertices, surface, load) if up is None else np.asarray(up, dtype=np.float64)
    side = best_side(vertices, axis / np.linalg.norm(axis))
    half = _half_thickness(vertices, faces)
    stage = staged(Body(vertices, faces, member, casts=True), side, axis, half, surface, load, palette, size)
    with Scene(stage.bodies, stage.centre, stage.radius) as scene:
        image = rendered(scene, stage, palette, size)
    return np.asarray(lettered(image, legend(stage, caption, palette, size), palette))


def write_picture(
    path: str | Path,
    V: ArrayLike,
    F: ArrayLike,
    *,
    surface: Surface | None = None,
    load: LoadCase | None = None,
    family: ArrayLike | None = None,
    caption: str = "",
    size: tuple[int, int] = (1600, 1200),
    up: ArrayLike | None = None,
    palette: Palette = PAPER,
) -> Path:
    """Write `picture(V, F, ...)` as a PNG file, whole or not at all; returns its path.

    Raises what `picture` raises, and ExportError for a file that cannot be written.
    """
    from PIL import Image

    from dsfab.export.atomic import replacing

    pixels = picture(
        V, F, surface=surface, load=load, family=family, caption=caption, size=size, up=up, palette=palette
    )
    target = Path(path)
    with replacing(target) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG")
    return target


def _member_colours(F: Ints, family: ArrayLike | None, palette: Palette) -> Bytes:
    """(m, 3) colours of the faces."""
    table = np.array([*palette.families, palette.members], dtype=np.uint8)  # -1 is the last row
    index = np.full(len(F), -1) if family is None else np.asarray(family)
    if index.shape != (len(F),) or index.min() < -1 or index.max() >= len(palette.families):
        raise ValueError(f"expected {len(F)} families between -1 and {len(palette.families) - 1}")
    return np.asarray(table[index])


def staged(
    body: Body,
    side: Side,
    up: Floats,
    half: float,
    surface: Surface | None,
    load: LoadCase | None,
    palette: Palette,
    size: tuple[int, int],
    marked: bool = True,
    person: bool = True,
) -> Stage:
    """Place the camera, then the marks, then move the camera back until all of it is on the page.

    half   : half the thickness of the structure, metres.
    marked : whether loads and supports are drawn; person : whether somebody may stand beside the structure.
    """
    V, up = body.V, up / np.linalg.norm(up)
    low, high = V.min(axis=0), V.max(axis=0)
    centre, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    bodies, level = [body], float((V @ up).min())
    stands = True
    if surface is not None and load is not None:
        bodies += _marks(surface, load, side, up, reach, half, palette) if marked else []
        stands = _stands(surface, load, V, up, reach)
        if stands and marked:  # on the feet of its support cones; arrows that hang lower are drawn through the ground
            level -= marks.CONE * reach
    if side.front:
        level, stands = float((V @ side.floor).min()) - BOARD * reach, True
    elif person and stands and PERSON_FITS[0] <= float(np.ptp(V @ up)) <= PERSON_FITS[1]:
        bodies.append(Body(*_person_beside(V, side, level), palette.of("person")))
    view = on_page(bodies, side, size)
    radius = 1.02 * float(np.linalg.norm(V - centre, axis=1).max())
    return Stage(bodies, view, level if stands else None, centre, radius)


def on_page(bodies: list[Body], side: Side, size: tuple[int, int], words: bool = True) -> View:
    """The view in which the bodies fill a page with a strip for words below, or without one."""
    aspect = size[0] / size[1]
    wide, bottom, top = (0.86, -0.70, 0.88) if words else (0.92, -0.86, 0.92)
    return framed(np.concatenate([one.V for one in bodies]), side, (-wide * aspect, wide * aspect, bottom, top))


def _stands(surface: Surface, load: LoadCase, V: Floats, up: Floats, reach: float) -> bool:
    """Whether the structure stands on the ground: its supports are below it, and down at its lowest point."""
    if not load.held.any():
        return True
    lowest, height = float((V @ up).min()), float(np.ptp(V @ up))
    below = float(marks.support_side(surface, load, reach, up) @ up) < -0.5
    return below and float((surface.V[load.held] @ up).min()) < lowest + TOUCHES * (height + 0.2 * reach)


def _marks(
    surface: Surface, load: LoadCase, side: Side, up: Floats, reach: float, half: float, palette: Palette
) -> list[Body]:
    """Load arrows and support cones, those that there are."""
    arrows = marks.load_arrows(surface, load, reach, half, side.towards)
    cones = marks.support_cones(surface, load, reach, up, half)
    drawn = [Body(*arrows, palette.of("load")), Body(*cones, palette.of("support"))]
    return [body for body in drawn if len(body.F)]


def _half_thickness(V: Floats, F: Ints) -> float:
    """Half the mean thickness of a thin solid, metres: its volume over its area; 0 for a sheet."""
    a, b, c = (V[F[:, i]] - V.mean(axis=0) for i in range(3))
    area = np.cross(b - a, c - a)
    return abs(float(np.einsum("mi,mi->", a, area))) / 3 / float(np.linalg.norm(area, axis=1).sum())


def _person_beside(V: Floats, side: Side, foot: float) -> marks.Mesh:
    """Somebody on the ground to the right of the structure, a little in front of its middle."""
    up, right = side.up, np.cross(side.up, side.towards)
    right /= np.linalg.norm(right)
    level = np.cross(right, up)
    middle = (V.min(axis=0) + V.max(axis=0)) / 2
    middle = middle - (middle @ up) * up + foot * up
    near_foot = V[V @ up < foot + marks.PERSON + 0.6]  # what stands in the way of a person
    beside = float(((near_foot - middle) @ right).max()) + 0.55
    return marks.person(middle + beside * right + 0.15 * float(np.ptp(V @ level)) * level, right, up)


def rendered(
    scene: Scene,
    stage: Stage,
    palette: Palette,
    size: tuple[int, int],
    quality: light.Quality = light.FINE,
) -> "Image":
    """The picture without words."""
    from PIL import Image

    width, height = FINER * size[0], FINER * size[1]
    all_lamps = light.lamps(stage.view, stage.view.floor, quality)
    pixels = scene.pixels(stage.view, width, height)
    level = None
    if stage.level is not None:
        level = (stage.level - float(stage.centre @ stage.view.floor)) / stage.radius - 0.002
    brightness, share = light.shaded(scene, stage.view, pixels, all_lamps, stage.view.floor, level)
    canvas = _floor(share, palette, width, height)
    pixel = 2 * stage.view.slope / height * float(np.linalg.norm(stage.view.eye - stage.centre)) / stage.radius
    lines = light.edges(pixels, 2.5 * pixel)
    hit = np.isfinite(pixels.depth)
    canvas[hit] = _inked(pixels, hit, brightness, lines, palette)
    return Image.fromarray(canvas).reduce(FINER)


def _floor(share: Floats32 | None, palette: Palette, width: int, height: int) -> Bytes:
    """(height, width, 3) paper with the shadows on it."""
    from PIL import Image

    if share is None:
        return np.asarray(np.broadcast_to(np.array(palette.paper, dtype=np.uint8), (height, width, 3)).copy())
    x, y = (np.minimum(np.arange(k), np.arange(k)[::-1]) / (FADE * share.shape[0]) for k in share.shape[::-1])
    fade = np.clip(np.minimum(x, y[:, None]), 0, 1)  # no shadow ends at the edge of the page
    share = 1 - (1 - share) * (fade * fade * (3 - 2 * fade)).astype(np.float32)
    shades = Image.fromarray(np.round(np.clip(share, 0, 1) * 255).astype(np.uint8))
    smooth = shades.resize((width, height), Image.Resampling.BICUBIC)
    dark, bright = np.array(palette.shadow, dtype=np.float32), np.array(palette.paper, dtype=np.float32)
    table = dark + (np.arange(256, dtype=np.float32)[:, None] / 255) * (bright - dark)
    return np.asarray(np.round(table).astype(np.uint8)[np.asarray(smooth)])


def _inked(pixels: Pixels, hit: Bools, brightness: Floats32, lines: Floats32, palette: Palette) -> Bytes:
    """(k, 3) colours of what is drawn: light on colour, darker at edges; marks keep their colour, for the legend."""
    colour = pixels.colour[hit]
    fixed = (palette.load, palette.support, palette.person, palette.tension, palette.compression)
    flat = np.logical_or.reduce([(colour == np.array(mark, dtype=np.uint8)).all(axis=1) for mark in fixed])
    amount = np.where(flat, np.float32(0.8) + np.float32(0.2) * brightness, brightness)
    amount *= 1 - np.where(flat, np.float32(0.12), np.float32(palette.ink)) * lines[hit]
    tone = np.minimum(amount, np.float32(1.25)) ** np.float32(1 / 2.2)  # light adds up linearly, bytes do not
    return np.asarray(np.minimum(colour * tone[:, None], 255).astype(np.uint8))


def legend(stage: Stage, caption: str, palette: Palette, size: tuple[int, int]) -> Legend:
    """Words and scale: pixels per metre are those in the middle of the structure."""
    depth = float((stage.centre - stage.view.eye) @ stage.view.forward)
    kinds: tuple[MarkName, ...] = ("load", "support")
    names = [name for name in kinds if any(np.array_equal(body.colour, palette.of(name)) for body in stage.bodies[1:])]
    return Legend(caption, names, size[1] / 2 / (stage.view.slope * depth))
