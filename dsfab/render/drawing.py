"""A picture out of what is where: light and shadow on the structure and on the ground, and lines at its edges."""

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from dsfab.arrays import Ints
from dsfab.errors import DsfabError
from dsfab.render import light
from dsfab.render.palette import Palette
from dsfab.render.scene import Bytes, Floats32, Pixels, Scene
from dsfab.render.stage import Stage
from dsfab.sparse import give_back

if TYPE_CHECKING:
    from PIL.Image import Image

Ground = Literal["paper", "white", "transparent"]
"""What a structure stands on."""

FINER = light.FINE.finer
"""How many times as large a fine picture is drawn before it is averaged."""

FADE = 0.12
"""Shadows fade out towards the edges of the page over this share of its height."""

TURN = np.float32(0.87)
"""Cosine of the angle from which an edge between faces is drawn."""

STRIP = 64
"""Rows searched for edges at a time."""


def check_ground(ground: str) -> None:
    """Raises DsfabError for a ground that there is not."""
    if ground not in get_args(Ground):
        raise DsfabError(f"ground {ground!r} is not known; use one of {', '.join(get_args(Ground))}")


def rendered(
    scene: Scene,
    stage: Stage,
    palette: Palette,
    size: tuple[int, int],
    quality: light.LightQuality = light.FINE,
    clear: bool = False,
) -> "Image":
    """The picture without words; `clear` leaves the paper away and gives the shadows their share of opacity."""
    from PIL import Image

    finer = quality.finer
    width, height = finer * size[0], finer * size[1]
    all_lamps = light.lamps(stage.view, stage.view.floor, quality.fitting(size[1]))
    pixels = scene.pixels(stage.view, width, height)
    level = None
    if stage.level is not None:
        level = (stage.level - float(stage.centre @ stage.view.floor)) / stage.radius - 0.002
    brightness, share = light.shaded(scene, stage.view, pixels, all_lamps, stage.view.floor, level)
    give_back(all_lamps.quality.bytes)  # what the lamps saw
    canvas = (_clear_floor if clear else _floor)(share, palette, width, height)
    pixel = 2 * stage.view.slope / height * float(np.linalg.norm(stage.view.eye - stage.centre)) / stage.radius
    lines = edges(pixels, 2.5 * pixel)
    drawn = np.flatnonzero(np.isfinite(pixels.depth))
    inked, flat = _inked(pixels, drawn, brightness, lines, palette), canvas.reshape(-1, canvas.shape[2])
    for channel in range(canvas.shape[2]):  # by numbers and one by one: a sixth of the time of all by a mask
        flat[drawn, channel] = inked[:, channel] if channel < 3 else 255
    return Image.fromarray(canvas).reduce(finer)


def _open(share: Floats32, width: int, height: int) -> Bytes:
    """(height, width) 0..255, how much of the light reaches the ground, without shadows at the edge of the page."""
    from PIL import Image

    x, y = (np.minimum(np.arange(k), np.arange(k)[::-1]) / (FADE * share.shape[0]) for k in share.shape[::-1])
    fade = np.clip(np.minimum(x, y[:, None]), 0, 1)  # no shadow ends at the edge of the page
    share = 1 - (1 - share) * (fade * fade * (3 - 2 * fade)).astype(np.float32)
    shades = Image.fromarray(np.round(np.clip(share, 0, 1) * 255).astype(np.uint8))
    return np.asarray(shades.resize((width, height), Image.Resampling.BICUBIC))


def _floor(share: Floats32 | None, palette: Palette, width: int, height: int) -> Bytes:
    """(height, width, 3) paper with the shadows on it."""
    if share is None:
        return np.asarray(np.broadcast_to(np.array(palette.paper, dtype=np.uint8), (height, width, 3)).copy())
    dark, bright = np.array(palette.shadow, dtype=np.float32), np.array(palette.paper, dtype=np.float32)
    table = dark + (np.arange(256, dtype=np.float32)[:, None] / 255) * (bright - dark)
    return np.asarray(np.round(table).astype(np.uint8).take(_open(share, width, height), axis=0))


def _clear_floor(share: Floats32 | None, palette: Palette, width: int, height: int) -> Bytes:
    """(height, width, 4) shadows alone, as opaque as paper would be dark."""
    canvas = np.zeros((height, width, 4), dtype=np.uint8)
    canvas[:, :, :3] = palette.shadow
    if share is not None:
        canvas[:, :, 3] = 255 - _open(share, width, height)
    return canvas


def _inked(pixels: Pixels, hit: Ints, brightness: Floats32, lines: Floats32, palette: Palette) -> Bytes:
    """(k, 3) colours of the pixels drawn, of these numbers (k,): light on colour, darker at edges; marks keep their
    colour, for the legend."""
    drawn, lines = pixels.colour.reshape(-1, 3).take(hit, axis=0), lines.ravel().take(hit)
    marks = (palette.load, palette.support, palette.reaction, palette.person, palette.tension, palette.compression)
    fixed = _codes(np.array(marks, dtype=np.uint8))
    for start in range(0, len(drawn), light.CHUNK):
        part = slice(start, start + light.CHUNK)
        colour = drawn[part]
        code = _codes(colour)
        flat = np.logical_or.reduce([code == mark for mark in fixed])
        amount = np.where(flat, np.float32(0.8) + np.float32(0.2) * brightness[part], brightness[part])
        amount *= 1 - np.where(flat, np.float32(0.12), np.float32(palette.ink)) * lines[part]
        tone = np.minimum(amount, np.float32(1.25)) ** np.float32(1 / 2.2)  # light adds up linearly, bytes do not
        drawn[part] = np.minimum(colour * tone[:, None], 255).astype(np.uint8)
    return drawn


def _codes(colours: Bytes) -> Ints:
    """(k,) one number for each of the colours (k, 3)."""
    red, green, blue = colours.T.astype(np.int32)
    return np.asarray(red << 16 | green << 8 | blue)


def edges(pixels: Pixels, jump: float) -> Floats32:
    """(h, w) 0..1: where depth jumps by more than `jump` (radii) to a neighbouring pixel, or the normals turn.

    Lines where one thing ends in front of another, or where faces meet (Saito and Takahashi 1990), drawn on the nearer
    of the two pixels, so that they lie on what they bound.
    """
    strong = np.zeros(pixels.depth.shape, dtype=np.float32)
    for start in range(0, len(strong), STRIP):  # in strips: bounds the memory
        drawn = np.flatnonzero(np.isfinite(pixels.depth[start : start + STRIP]).any(axis=0))
        if not len(drawn):
            continue
        low, high = max(start - 2, 0), min(start + STRIP + 2, len(strong))
        some = slice(max(drawn[0] - 2, 0), drawn[-1] + 3)
        strip = _edges(pixels.depth[low:high, some], pixels.normal[low:high, some], jump)
        strong[start : start + STRIP, some] = strip[start - low : start - low + STRIP]
    return strong


def _edges(depth: Floats32, normal: Bytes, jump: float) -> Floats32:
    strong = np.zeros(depth.shape, dtype=np.float32)
    flat = np.where(np.isfinite(depth), depth, np.float32(1e3))
    units = np.moveaxis(normal, 2, 0).astype(np.float32, order="C")
    units /= np.float32(127.5)
    units -= 1
    for axis in (0, 1):
        head = tuple(slice(None, -1) if a == axis else slice(None) for a in range(2))
        tail = tuple(slice(1, None) if a == axis else slice(None) for a in range(2))
        inner = tuple(slice(1, -1) if a == axis else slice(None) for a in range(2))
        one, two = flat[head], flat[tail]
        step = np.abs(one - two)
        # along a slanted face depth changes as well: only what the pixels on either side do not continue is a jump
        steady = np.full_like(flat, np.inf)
        steady[inner] = np.minimum(step[head], step[tail])
        excess = step - 2 * np.minimum(steady[head], steady[tail])
        cosine = sum(unit[head] * unit[tail] for unit in units)
        turned = (TURN - cosine) * (np.float32(2) / TURN) * (np.minimum(one, two) < 100)
        line = np.clip(np.maximum(excess / np.float32(jump) - 1, turned), 0, 1)
        strong[head] = np.maximum(strong[head], line * (one <= two))
        strong[tail] = np.maximum(strong[tail], line * (two < one))
    return strong
