"""The pictures of a build: preview.png, and analysis.png with loads and utilisation."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dsfab.core.arrays import Floats, Ints, area_vectors, concatenated_mesh, unit_vectors
from dsfab.core.errors import DsfabError
from dsfab.core.messages import length
from dsfab.render.colouring import Colouring, with_bar
from dsfab.render.drawing import PERSON_HEIGHT, Stage, legend, page_view, person, render_stage, set_stage
from dsfab.render.fabrication import Callout, with_callouts
from dsfab.render.lettering import Legend, Palette, with_legend
from dsfab.render.light import LightQuality
from dsfab.render.marks import PENCIL_LENGTH, pencil, place_beside
from dsfab.render.picture import Look, StructurePicture
from dsfab.render.scene import Body, Bytes, Scene
from dsfab.render.surroundings import building_supports, ground_level, support_part
from dsfab.render.view import (
    View,
    best_side,
    fit_view,
    named_side,
    parallel_view,
    plan_and_elevation,
    plane_extents,
    up_axis,
)
from dsfab.surface import LoadCase, Surface

if TYPE_CHECKING:
    from PIL.Image import Image

CLIENT_LOOK = Look((1600, 1600))  # default style of preview.png
ANALYSIS_LOOK = Look((800, 760))  # default style of each half of analysis.png
SMALLEST_BUILDING = 2.5  # below this size (m), a pencil shows the scale instead of a person
MAIN_SHARE, WORDS_SHARE = 0.66, 0.06  # heights of main view and caption, divided by the picture's height
MAIN_LIGHT, PANEL_LIGHT = LightQuality(8, 24, 6), LightQuality(2, 4, 1, 320, 192, (0.012, 0.05))
"""Quality of the light in the main view, and in the smaller views."""
LETTERS = 0.68  # size of letters, divided by the default size
PANEL_SHARE = 0.84  # largest width and height of a plan or elevation / size of its panel
WALL_VIEW = "24,9"  # azimuth and elevation (degrees) of the view of a standing plate


@dataclass(frozen=True, eq=False)
class ClientPicture:
    """Data of the picture preview.png.
    V, F    : solid, (n, 3) vertices, m, and (m, 3) faces, outward oriented.    half : half of the sheet's thickness, m.
    surface, load : uncut surface, and its loads and supports."""

    V: Floats
    F: Ints
    half: float
    surface: Surface
    load: LoadCase
    caption: str
    look: Look = CLIENT_LOOK

    @cached_property
    def up(self) -> Floats:
        """Unit vector (3,) that points up."""
        up = up_axis(self.V, self.surface, self.load) if self.look.up is None else np.asarray(self.look.up, float)
        return np.asarray(up / np.linalg.norm(up))

    @property
    def is_small(self) -> bool:
        """True if a pencil, not a person, shows the scale."""
        return self.surface.size < SMALLEST_BUILDING

    @cached_property
    def stage(self) -> Stage:
        """Bodies and camera of the main view. Raises DsfabError for a solid without faces."""
        if not len(self.F):
            raise DsfabError("there is nothing to draw: the solid has no faces; lower the pattern's thresholds")
        palette, surface, up = self.look.palette, self.surface, self.up
        supports = building_supports(surface, self.load, up)
        level = ground_level(surface, supports, up, self.half)
        bodies = [Body(self.V, self.F, np.array(palette.members, dtype=np.uint8), casts=True)]
        if parts := [support_part(surface, support, self.half, level) for support in supports]:
            mesh = concatenated_mesh(parts)
            facing = np.repeat(unit_vectors(area_vectors(*mesh))[:, None], 3, axis=1).astype(np.float32)
            bodies.append(Body(*mesh, palette.colour_bytes("masonry"), casts=True, normals=facing))
        V = np.concatenate([body.V for body in bodies])
        low, high = V.min(axis=0), V.max(axis=0)
        centre = (low + high) / 2
        radius = 1.02 * float(np.linalg.norm(V - centre, axis=1).max())
        side = best_side(V, up)
        side = named_side(V, up, WALL_VIEW) if side.front else side
        foot, right = place_beside(V, side, up, level)
        figure = pencil(foot, right, up) if self.is_small else person(foot, right, up)
        bodies.append(Body(*figure, palette.colour_bytes("person")))
        return Stage(bodies, page_view(bodies, side, self._main_size, words=False), level, centre, radius)

    @property
    def _main_size(self) -> tuple[int, int]:
        return self.look.size[0], round(MAIN_SHARE * self.look.size[1])

    def render(self) -> Bytes:
        """Return the picture, (height, width, 3) bytes. Call `require_rendering` first: VTK may end the process.
        Raises DsfabError for a solid without faces."""
        from PIL import Image

        palette, stage = self.look.palette, self.stage
        page = Image.new("RGB", self.look.size, palette.paper)
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            page.paste(render_stage(scene, stage, palette, self._main_size, MAIN_LIGHT), (0, 0))
            scale = self._draw_panels(page, scene)
        words = f"pencil, {length(PENCIL_LENGTH)}" if self.is_small else f"person, {PERSON_HEIGHT:g} m"
        line = Legend(self.caption, [], scale, ((words, palette.person),))
        return np.asarray(with_legend(page, line, palette, LETTERS))

    def _draw_panels(self, page: "Image", scene: Scene) -> float:
        stage, palette, (width, top) = self.stage, self.look.palette, self._main_size
        size = width // 2, self.look.size[1] - top - round(WORDS_SHARE * self.look.size[1])
        sides = plan_and_elevation(np.concatenate([body.V for body in stage.bodies[:-1]]), self.up)
        V = np.concatenate([body.V for body in stage.bodies])
        scale = min(float((PANEL_SHARE * np.array(size) / plane_extents(V, side)).min()) for side in sides)
        for k, (name, side) in enumerate(zip(("plan", "elevation"), sides, strict=True)):
            view = parallel_view(V, side, size, scale)
            panel = render_stage(scene, replace(stage, view=view), palette, size, PANEL_LIGHT)
            _write_title(panel, name, view, stage, palette)
            page.paste(panel, (k * (width - size[0]), top))
        return scale


@dataclass(frozen=True, eq=False)
class AnalysisPicture:
    """Data of the picture analysis.png: loads and supports on the left, stress on the right.
    loaded  : picture of the left half.    V, F : vertices (n, 3) of the cut sheet, metres, and faces (m, 3).
    faces   : colours of the faces, with colour bar and caption."""

    loaded: StructurePicture
    V: Floats
    F: Ints
    faces: Colouring
    callouts: list[Callout]

    def render(self) -> Bytes:
        """Return the picture, (height, width, 3) bytes. Call `require_rendering` first: VTK may end the process."""
        loaded, faces = self.loaded, self.faces
        size, palette = loaded.look.size, loaded.look.palette
        body, annotations = Body(self.V, self.F, faces.face, casts=True), replace(loaded.annotations, layers=())
        stage = set_stage(body, loaded.side, loaded.up, loaded.half, annotations, palette, size)
        half = 0.86 * size[0] / size[1]
        stage = replace(stage, view=fit_view(self.V, loaded.side, (-half, half, -0.6, 0.6)))  # leaves space for notes
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            image = render_stage(scene, stage, palette, size, PANEL_LIGHT)
        image = with_legend(image, legend(stage, faces.words, palette, size), palette)
        image = with_bar(image, faces.bar, palette) if faces.bar else image
        image = with_callouts(image, self.callouts, stage.view, palette)
        return np.concatenate([loaded.render(PANEL_LIGHT), np.asarray(image)], axis=1)


def _write_title(panel: "Image", name: str, view: View, stage: Stage, palette: Palette) -> None:
    from PIL import ImageDraw, ImageFont

    assert stage.level is not None
    draw, (width, height) = ImageDraw.Draw(panel), panel.size
    font = ImageFont.load_default(size=max(height / 26, 8.0))
    draw.text((0.07 * width, 0.06 * height), name, fill=palette.text, font=font, anchor="ls")
    if abs(view.forward @ view.floor) < 0.5:
        base = stage.centre + (stage.level - stage.centre @ view.floor) * view.floor
        row = height / 2 * (1 - view.page_coordinates(base[None])[0, 1])
        draw.line((0.03 * width, row, 0.97 * width, row), fill=palette.text, width=max(height // 250, 1))
