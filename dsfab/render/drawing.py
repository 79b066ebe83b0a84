"""The drawing of a scene: structure, marks, ground and camera."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.core.sparse import release_freed_memory
from dsfab.render import light, marks
from dsfab.render.lettering import Legend, MarkName, Palette
from dsfab.render.marks import MarkMesh
from dsfab.render.scene import Body, Bytes, Colour, Floats32, Pixels, Scene
from dsfab.render.view import View, ViewSide, fit_view
from dsfab.surface import LoadCase, Surface

if TYPE_CHECKING:
    from PIL.Image import Image

EVERY_LAYER = ("loads", "supports", "reactions", "person", "tree", "gradients")  # all kinds of marks
LAYERS = ("loads", "supports", "person")  # marks that a picture shows by default
PERSON_RANGE = (2.0, 60.0)  # least and largest height (m) of a structure with a person beside it
PERSON_HEIGHT, TREE_HEIGHT = 1.75, 6.0  # heights of the person and of the tree (m)


@dataclass(frozen=True, eq=False)
class Annotations:
    """Marks beside a structure. surface, load : uncut surface and loads; give both or neither.
    reaction      : (n, 3) forces of the supports on the structure, N.
    gradient      : (m, 3) gradient of a mode.    layers : names from `EVERY_LAYER`."""

    surface: Surface | None = None
    load: LoadCase | None = None
    reaction: Floats | None = None
    gradient: Floats | None = None
    layers: Collection[str] = LAYERS


@dataclass(frozen=True, eq=False)
class Stage:
    """Bodies, camera and floor of a picture.
    level : height of the floor along `view.floor`, m, or None.    centre, radius : sphere around the structure, m."""

    bodies: list[Body]
    view: View
    level: float | None
    centre: Floats
    radius: float


def set_stage(
    body: Body,
    side: ViewSide,
    up: Floats,
    half: float,
    annotations: Annotations,
    palette: Palette,
    size: tuple[int, int],
) -> Stage:
    """Return the bodies, camera and floor of a picture.    half : half of the structure's thickness (m).
    up : (3,) upward vector of any length.    size : width and height of the picture, pixels."""
    V, up = body.V, up / np.linalg.norm(up)
    low, high = V.min(axis=0), V.max(axis=0)
    centre, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    bodies, level = [body], float((V @ up).min())
    stands, surface, load = True, annotations.surface, annotations.load
    if surface is not None and load is not None:
        mark_meshes = _marks(annotations, surface, load, (side.towards, up), reach, half)
        bodies += [Body(*mesh, palette.colour_bytes(name)) for name, mesh in mark_meshes.items() if len(mesh[1])]
        stands = _stands_on_ground(surface, load, V, up, reach)
        if stands and "supports" in annotations.layers:
            level -= marks.CONE_HEIGHT * reach
    if side.front:
        level, stands = float((V @ side.floor).min()) - 0.012 * reach, True  # front view: the floor is behind the sheet
    elif "person" in annotations.layers and stands and PERSON_RANGE[0] <= float(np.ptp(V @ up)) <= PERSON_RANGE[1]:
        bodies.append(Body(*person(*marks.place_beside(V, side, up, level), up), palette.colour_bytes("person")))
    if "tree" in annotations.layers and stands:
        foot, right = marks.place_beside(V, side, up, level, -1.0)
        tree = marks.tree(foot - 0.2 * TREE_HEIGHT * right, up, TREE_HEIGHT)
        bodies.append(Body(*tree, palette.colour_bytes("person")))
    view = page_view(bodies, side, size)
    radius = 1.02 * float(np.linalg.norm(V - centre, axis=1).max())
    return Stage(bodies, view, level if stands else None, centre, radius)


def page_view(
    bodies: list[Body], side: ViewSide, size: tuple[int, int], words: bool = True, scale: bool = False
) -> View:
    """Return the view in which bodies fill a picture.
    size : of the picture, pixels.    words, scale : True to leave space for a caption, and for a colour scale."""
    aspect = size[0] / size[1]
    half, bottom, top = (0.86, -0.62 if scale else -0.70, 0.88) if words else (0.92, -0.86, 0.92)
    return fit_view(np.concatenate([body.V for body in bodies]), side, (-half * aspect, half * aspect, bottom, top))


def _stands_on_ground(surface: Surface, load: LoadCase, V: Floats, up: Floats, reach: float) -> bool:
    if not load.supported.any():
        return True
    lowest, height = float((V @ up).min()), float(np.ptp(V @ up))
    below, tolerance = float(marks.support_side(surface, load, reach, up) @ up) < -0.5, 0.05 * (height + 0.2 * reach)
    return below and float((surface.V[load.supported] @ up).min()) < lowest + tolerance


def _marks(
    annotations: Annotations,
    surface: Surface,
    load: LoadCase,
    directions: tuple[Floats, Floats],
    reach: float,
    half: float,
) -> dict[MarkName, MarkMesh]:
    (towards, up), meshes = directions, dict[MarkName, MarkMesh]()
    if "loads" in annotations.layers:
        meshes["load"] = marks.load_arrows(surface, load, reach, half, towards, up)
    if "supports" in annotations.layers:
        meshes["support"] = marks.support_cones(surface, load, reach, up, half)
    if "reactions" in annotations.layers and annotations.reaction is not None:
        meshes["reaction"] = marks.reaction_arrows(surface, load, annotations.reaction, reach)
    if "gradients" in annotations.layers and annotations.gradient is not None:
        meshes["gradient"] = marks.gradient_arrows(surface, annotations.gradient, reach, half, towards)
    return meshes


def legend(
    stage: Stage, caption: str, palette: Palette, size: tuple[int, int], swatches: tuple[tuple[str, Colour], ...] = ()
) -> Legend:
    """Return the legend of a picture. size : of the picture, pixels.    swatches : its colours, with names."""
    depth = float((stage.centre - stage.view.eye) @ stage.view.forward)
    kinds: tuple[MarkName, ...] = ("load", "support", "reaction")
    colours = [body.colour for body in stage.bodies[1:]]
    names = [name for name in kinds if any(np.array_equal(c, palette.colour_bytes(name)) for c in colours)]
    return Legend(caption, names, size[1] / 2 / (stage.view.slope * depth), swatches)


def person(foot: Floats, right: Floats, up: Floats) -> MarkMesh:
    """Return a flat figure of a person, 1.75 m tall, at `foot` (3,), m. right, up : (3,) unit vectors."""
    strips = [[(0.0, half, y) for half, y in _BODY]]
    strips += [[(side * x, half, y) for x, half, y in limb] for limb in (_ARM, _LEG) for side in (-1.0, 1.0)]
    vertices, faces, count = [], [], 0
    for strip in strips:
        x, half, y = np.array(strip).T
        vertices += [np.stack([x - half, y], axis=1), np.stack([x + half, y], axis=1)]
        low = count + np.arange(len(strip) - 1)
        high = low + len(strip)
        faces += [np.stack([low, low + 1, high + 1], axis=1), np.stack([low, high + 1, high], axis=1)]
        count += 2 * len(strip)
    flat = np.concatenate(vertices)
    return foot + flat[:, :1] * right + flat[:, 1:] * up, np.concatenate(faces)


# rows (m) from top to bottom: (half width, height) of the body; (middle, half width, height) of a limb
_BODY = [
    (0.002, 1.75), (0.040, 1.743), (0.064, 1.720), (0.077, 1.680), (0.078, 1.640), (0.070, 1.590), (0.053, 1.545),
    (0.047, 1.515), (0.052, 1.490), (0.090, 1.467), (0.145, 1.447), (0.188, 1.420), (0.200, 1.385), (0.180, 1.280),
    (0.163, 1.150), (0.153, 1.050), (0.161, 0.960), (0.172, 0.880), (0.174, 0.820), (0.120, 0.790), (0.002, 0.780),
]  # fmt: skip
_ARM = [
    (0.180, 0.012, 1.425), (0.196, 0.034, 1.405), (0.205, 0.042, 1.360), (0.214, 0.040, 1.250), (0.229, 0.036, 1.100),
    (0.243, 0.031, 0.950), (0.252, 0.025, 0.850), (0.257, 0.030, 0.790), (0.258, 0.027, 0.730), (0.256, 0.010, 0.690),
]  # fmt: skip
_LEG = [
    (0.088, 0.086, 0.860), (0.092, 0.077, 0.700), (0.093, 0.057, 0.500), (0.095, 0.056, 0.400), (0.097, 0.053, 0.300),
    (0.098, 0.035, 0.140), (0.099, 0.034, 0.060), (0.106, 0.046, 0.020), (0.108, 0.048, 0.0),
]  # fmt: skip

GroundKind = Literal["paper", "white", "transparent"]  # background of a picture
FINER = light.FINE.finer  # enlargement of a picture before it is reduced, for smooth edges
EDGE_COSINE = np.float32(0.87)  # edges are drawn where the normals of neighbouring pixels have a smaller cosine


def check_ground(ground: str) -> None:
    """Raise DsfabError unless `ground` is paper, white or transparent."""
    if ground not in get_args(GroundKind):
        raise DsfabError(f"ground {ground!r} is not known; use one of {', '.join(get_args(GroundKind))}")


def render_stage(
    scene: Scene,
    stage: Stage,
    palette: Palette,
    size: tuple[int, int],
    quality: light.LightQuality = light.FINE,
    transparent: bool = False,
) -> "Image":
    """Return the picture of a stage without words. transparent : True to draw no ground."""
    from PIL import Image

    finer = quality.finer
    width, height = finer * size[0], finer * size[1]
    all_lamps = light.lamps(stage.view, stage.view.floor, quality.fitting(size[1]))
    pixels = scene.pixels(stage.view, width, height)
    level = None
    if stage.level is not None:
        level = (stage.level - float(stage.centre @ stage.view.floor)) / stage.radius - 0.002
    brightness, share = light.pixel_and_floor_light(scene, stage.view, pixels, all_lamps, stage.view.floor, level)
    release_freed_memory(all_lamps.quality.bytes)  # the shadow maps are not needed any more
    canvas = (_clear_floor if transparent else _floor)(share, palette, width, height)
    pixel = 2 * stage.view.slope / height * float(np.linalg.norm(stage.view.eye - stage.centre)) / stage.radius
    lines = edge_strengths(pixels, 2.5 * pixel)
    covered = np.flatnonzero(np.isfinite(pixels.depth))
    inked, flat = _shaded_colours(pixels, covered, brightness, lines, palette), canvas.reshape(-1, canvas.shape[2])
    for channel in range(canvas.shape[2]):  # this loop is six times as fast as a mask for all channels
        flat[covered, channel] = inked[:, channel] if channel < 3 else 255
    return Image.fromarray(canvas).reduce(finer)


def _light_share(share: Floats32, width: int, height: int) -> Bytes:
    from PIL import Image

    margin = 0.12 * share.shape[0]
    x, y = (np.minimum(np.arange(k), np.arange(k)[::-1]) / margin for k in share.shape[::-1])
    fade = np.clip(np.minimum(x, y[:, None]), 0, 1)
    share = 1 - (1 - share) * (fade * fade * (3 - 2 * fade)).astype(np.float32)
    shades = Image.fromarray(np.round(np.clip(share, 0, 1) * 255).astype(np.uint8))
    return np.asarray(shades.resize((width, height), Image.Resampling.BICUBIC))


def _floor(share: Floats32 | None, palette: Palette, width: int, height: int) -> Bytes:
    if share is None:
        return np.asarray(np.broadcast_to(np.array(palette.paper, dtype=np.uint8), (height, width, 3)).copy())
    dark, bright = np.array(palette.shadow, dtype=np.float32), np.array(palette.paper, dtype=np.float32)
    table = dark + (np.arange(256, dtype=np.float32)[:, None] / 255) * (bright - dark)
    return np.asarray(np.round(table).astype(np.uint8).take(_light_share(share, width, height), axis=0))


def _clear_floor(share: Floats32 | None, palette: Palette, width: int, height: int) -> Bytes:
    canvas = np.zeros((height, width, 4), dtype=np.uint8)
    canvas[:, :, :3] = palette.shadow
    if share is not None:
        canvas[:, :, 3] = 255 - _light_share(share, width, height)
    return canvas


def _shaded_colours(pixels: Pixels, numbers: Ints, brightness: Floats32, lines: Floats32, palette: Palette) -> Bytes:
    colours, lines = pixels.colour.reshape(-1, 3).take(numbers, axis=0), lines.ravel().take(numbers)
    marks = (palette.load, palette.support, palette.reaction, palette.person, palette.tension, palette.compression)
    fixed = _codes(np.array(marks, dtype=np.uint8))
    for start in range(0, len(colours), light.CHUNK):
        part = slice(start, start + light.CHUNK)
        colour = colours[part]
        code = _codes(colour)
        flat = np.logical_or.reduce([code == mark for mark in fixed])
        amount = np.where(flat, np.float32(0.8) + np.float32(0.2) * brightness[part], brightness[part])
        amount *= 1 - np.where(flat, np.float32(0.12), np.float32(palette.ink)) * lines[part]
        tone = np.minimum(amount, np.float32(1.25)) ** np.float32(1 / 2.2)  # screens show light ~ byte^2.2
        colours[part] = np.minimum(colour * tone[:, None], 255).astype(np.uint8)
    return colours


def _codes(colours: Bytes) -> Ints:
    red, green, blue = colours.T.astype(np.int32)
    return np.asarray(red << 16 | green << 8 | blue)


def edge_strengths(pixels: Pixels, jump: float) -> Floats32:
    """Return the strength (h, w) of edge lines, 0..1 [Saito, Takahashi 1990].
    jump : smallest change of depth that gives a line, in units of `Scene.radius`."""
    strong, rows = np.zeros(pixels.depth.shape, dtype=np.float32), 64
    for start in range(0, len(strong), rows):  # strips of rows need less memory than the whole picture
        columns = np.flatnonzero(np.isfinite(pixels.depth[start : start + rows]).any(axis=0))
        if not len(columns):
            continue
        low, high = max(start - 2, 0), min(start + rows + 2, len(strong))
        window = slice(max(columns[0] - 2, 0), columns[-1] + 3)
        strip = _strip_edge_strengths(pixels.depth[low:high, window], pixels.normal[low:high, window], jump)
        strong[start : start + rows, window] = strip[start - low : start - low + rows]
    return strong


def _strip_edge_strengths(depth: Floats32, normal: Bytes, jump: float) -> Floats32:
    strong = np.zeros(depth.shape, dtype=np.float32)
    flat = np.where(np.isfinite(depth), depth, np.float32(1e3))
    units = np.moveaxis(normal, 2, 0).astype(np.float32, order="C")
    units /= np.float32(127.5)
    units -= 1
    for axis in (0, 1):
        head = tuple(slice(None, -1) if a == axis else slice(None) for a in range(2))
        tail = tuple(slice(1, None) if a == axis else slice(None) for a in range(2))
        inner = tuple(slice(1, -1) if a == axis else slice(None) for a in range(2))
        head_depth, tail_depth = flat[head], flat[tail]
        step = np.abs(head_depth - tail_depth)
        # steps of depth between pixels are equal on a slanted face, and unequal at an edge
        steady = np.full_like(flat, np.inf)
        steady[inner] = np.minimum(step[head], step[tail])
        excess = step - 2 * np.minimum(steady[head], steady[tail])
        cosine = sum(unit[head] * unit[tail] for unit in units)
        turned = (EDGE_COSINE - cosine) * (np.float32(2) / EDGE_COSINE) * (np.minimum(head_depth, tail_depth) < 100)
        line = np.clip(np.maximum(excess / np.float32(jump) - 1, turned), 0, 1)
        strong[head] = np.maximum(strong[head], line * (head_depth <= tail_depth))
        strong[tail] = np.maximum(strong[tail], line * (tail_depth < head_depth))
    return strong
