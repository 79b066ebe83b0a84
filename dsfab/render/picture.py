"""The picture of a finished structure, and its PNG file."""

import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import DsfabError
from dsfab.render.drawing import Annotations, legend, render_stage, set_stage
from dsfab.render.lettering import PAPER, Palette, with_legend
from dsfab.render.light import FINE, LightQuality
from dsfab.render.opengl import require_rendering
from dsfab.render.scene import Body, Bytes, Scene
from dsfab.render.view import ViewSide, best_side, up_axis
from dsfab.surface import LoadCase, Surface


def write_png(pixels: Bytes, path: Path, effort: int = 4) -> Path:
    """Write a picture as a PNG file, and return its path. Raises ExportError if the file cannot be written.
    effort : effort of compression, 1 to 9."""
    from PIL import Image

    from dsfab.export.writing import atomic_file

    with atomic_file(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG", compress_level=effort)
    return path


def png_bytes(pixels: Bytes) -> bytes:
    """Return a picture as the bytes of a PNG file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()


@dataclass(frozen=True, eq=False)
class Look:
    """Style of a picture. size : (width, height), pixels.    letters : size of letters / default size.
    up : upward direction (3,); None for a guess."""

    size: tuple[int, int] = (1600, 1200)
    up: ArrayLike | None = None
    palette: Palette = PAPER
    letters: float = 1.0


DEFAULT_LOOK = Look()  # white paper, and the default size of a picture


def picture(
    V: ArrayLike,
    F: ArrayLike,
    *,
    surface: Surface | None = None,
    load: LoadCase | None = None,
    family: ArrayLike | None = None,
    caption: str = "",
    look: Look = DEFAULT_LOOK,
) -> Bytes:
    """Return a picture (height, width, 3) of a whole solid or sheet, red green blue.
    V, F    : (n, 3) vertices, m, and (m, 3) faces, outward oriented.
    surface, load : uncut surface and its loads; give both or neither.
    family  : (m,) index of each face into `look.palette.families`; -1 for members.
    Raises DsfabError for a solid without faces, or if this machine cannot draw. Draw in one thread at a time."""
    require_rendering()
    vertices, faces = np.asarray(V, dtype=np.float64), np.asarray(F, dtype=np.int64)
    if not len(faces):
        raise DsfabError("there is nothing to draw: the solid has no faces; lower the pattern's thresholds")
    up, member = look.up, _member_colours(faces, family, look.palette)
    axis = up_axis(vertices, surface, load) if up is None else np.asarray(up, dtype=np.float64)
    side = best_side(vertices, axis / np.linalg.norm(axis))
    annotations, half = Annotations(surface, load), _half_thickness(vertices, faces)
    return StructurePicture(vertices, faces, half, side, axis, annotations, caption, look, colours=member).render()


@dataclass(frozen=True, eq=False)
class StructurePicture:
    """Data of a picture of a finished structure.
    V, F    : (n, 3) vertices, m, and (m, 3) faces, outward oriented.    half : half of the structure's thickness, m.
    side, up: view side, and (3,) unit vector up.    annotations : marks beside the structure.
    look    : size and colours; `up` is not used.    clear : True for a transparent ground.
    colours : (3,) or (m, 3) of the faces; None for the colour of members."""

    V: Floats
    F: Ints
    half: float
    side: ViewSide
    up: Floats
    annotations: Annotations
    caption: str
    look: Look
    clear: bool = False
    colours: Bytes | None = None

    def render(self, quality: LightQuality = FINE) -> Bytes:
        """Return the picture, (height, width, 3 or 4) bytes. Call `require_rendering` first."""
        palette, size = self.look.palette, self.look.size
        colours = np.array(palette.members, dtype=np.uint8) if self.colours is None else self.colours
        body = Body(self.V, self.F, colours, casts=True)
        stage = set_stage(body, self.side, self.up, self.half, self.annotations, palette, size)
        if self.side.towards @ self.up < 0:  # views from below show no ground
            stage = replace(stage, level=None)
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            image = render_stage(scene, stage, palette, size, quality, self.clear)
        words = legend(stage, self.caption, palette, size)
        return np.asarray(with_legend(image, words, palette, self.look.letters))


def _member_colours(F: Ints, family: ArrayLike | None, palette: Palette) -> Bytes:
    table = np.array([*palette.families, palette.members], dtype=np.uint8)  # -1 selects the last row
    index = np.full(len(F), -1) if family is None else np.asarray(family)
    if index.shape != (len(F),) or index.min() < -1 or index.max() >= len(palette.families):
        raise ValueError(f"expected {len(F)} families between -1 and {len(palette.families) - 1}")
    return np.asarray(table[index])


def _half_thickness(V: Floats, F: Ints) -> float:
    a, b, c = (V[F[:, i]] - V.mean(axis=0) for i in range(3))
    area = np.cross(b - a, c - a)
    return abs(float(np.einsum("mi,mi->", a, area))) / 3 / float(np.linalg.norm(area, axis=1).sum())
