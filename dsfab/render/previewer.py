"""Previews of a design. They show openings without a cut of the surface, so changes of parameters appear fast."""

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import DsfabError, PatternError
from dsfab.core.sparse import release_freed_memory
from dsfab.design import Progress, draft
from dsfab.design.design import Design
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.render import colouring, drawing, light
from dsfab.render.lettering import PAPER, Palette, with_legend
from dsfab.render.light import FINE, LightQuality
from dsfab.render.marks import crosses
from dsfab.render.opengl import require_rendering
from dsfab.render.picture import png_bytes, write_png
from dsfab.render.scene import Body, Bytes, Scene, shading
from dsfab.render.shader import ALL_MATERIAL, NO_MATERIAL, StripeShader
from dsfab.render.striped_mesh import StripedMesh, distances, needs_only_settings, shader_settings, vertex_fields
from dsfab.render.view import View, named_side, up_axis

DEFAULT_SIZE = (1600, 1200)  # default size of a picture (pixels)
TINTED_FAMILIES = ("major", "minor", "kept")  # names of the families that have tints
TRIAL_SIZE = (96, 72)  # size of the pictures that test the shader (pixels)


class Previewer:
    """Pictures of a design under changing parameters; use as `with Previewer(design) as previewer`.
    design  : a Design, or a draft from `dsfab.design.draft`. A cut sheet or a solid is not necessary.
    view    : iso, top, front, side or 'azimuth,elevation' in degrees, as in `dsfab.render.view.named_side`.
    show    : structure, stress, families; major or minor (one family and the kept regions). On the uncut sheet: loads,
              directions, major_mode, minor_mode, vonmises, utilisation or energy. With an exaggerated deformation:
              displacement, buckling or frequency.
    marks   : True for loads, supports and a person; or names from `EVERY_LAYER`.
    ground  : paper, white or transparent. A transparent picture has a fourth channel.
    A picture shows the pattern before the cut, without thickness. The cut moves edges a little (see `snap`), joins
    parts that touch in a point, and may drop pieces without a support.
    Create, use and close a Previewer in one thread. Raises DsfabError if this machine cannot draw correctly."""

    def __init__(
        self,
        design: Design,
        *,
        view: str = "iso",
        show: str = "structure",
        marks: bool | Collection[str] = True,
        ground: drawing.GroundKind = "paper",
        palette: Palette = PAPER,
    ) -> None:
        colouring.check_show(show)
        drawing.check_ground(ground)
        surface, load = design.surface, design.load
        up = up_axis(surface.V, surface, load)
        self._side = named_side(surface.V, up, view)
        require_rendering()
        self._thread = threading.get_ident()
        self._made: Design = design
        self._preset = design.preset
        self._show = show
        self._distance: tuple[Floats, Floats] | None = None
        self._views: dict[tuple[tuple[int, int], bool], View] = {}
        tints = self._tints = palette.tints if show == "families" else None
        palette = replace(palette, paper=(255, 255, 255)) if ground == "white" else palette
        self._clear = ground == "transparent"
        faces = colouring.face_colouring(design, show, palette)
        self._bar, self._words = faces.bar, faces.words
        self._V, self._face = faces.V, faces.face
        self._mesh = StripedMesh.from_design(design)
        body = self._body()
        shape = surface if faces.V is None else replace(surface, V=faces.V)
        half = design.preset.statics.thickness / 2
        layers = layer_names(marks, view)
        reaction = design.statics.equilibrium.reaction
        self._arrows = show in colouring.MODE_FIELDS and "gradients" in layers
        gradient = colouring.mode_gradient(design, show) if self._arrows else None
        blue = show in ("stress", "directions")  # blue means compression in these pictures
        mark_palette = replace(palette, load=palette.text) if blue else palette
        self._palette = mark_palette
        present = ("kept", *design.preset.pattern.family_names)
        pairs = zip(TINTED_FAMILIES, tints, strict=True) if tints else ()
        self._swatches = tuple((name, tint) for name, tint in pairs if name in present)
        annotations = drawing.Annotations(shape, load, reaction, gradient, layers)
        self._stage = drawing.set_stage(body, self._side, up, half, annotations, mark_palette, DEFAULT_SIZE)
        if show == "directions":
            self._stage = replace(self._stage, bodies=[*self._stage.bodies, crosses(design, palette)])
        if self._side.towards @ up < 0:  # views from below show no ground
            self._stage = replace(self._stage, level=None)
        self._scene = Scene(self._stage.bodies, self._stage.centre, self._stage.radius)
        try:
            self._try_shader()
            self._send_numbers()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the window."""
        self._scene.close()

    @property
    def preset(self) -> Preset:
        """Current preset."""
        return self._preset

    @property
    def words(self) -> str:
        """Description of the picture, or ""."""
        return self._words

    @property
    def bar(self) -> colouring.ColourBar | None:
        """Colour bar of the picture, or None."""
        return self._bar

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change values at dotted keys, e.g. {"pattern.major.frequency": 9}; see `display`."""
        self.display(with_overrides(self._preset, changes))

    def can_display(self, preset: Preset) -> bool:
        """Return True if `display` can draw a preset: its geometry and loads must be those of the current preset."""
        drawn, shown = self._preset, self._show
        same_shape = preset.first_difference(drawn) != "surface" and (
            (shown not in (*colouring.DEFORMED, "directions") and not self._arrows) or preset.statics == drawn.statics
        )
        if self._arrows and getattr(preset.pattern, shown[:5]).mode != getattr(drawn.pattern, shown[:5]).mode:
            return False
        return same_shape and (not (self._arrows or shown == "directions") or preset.diffusion == drawn.diffusion)

    def display(self, preset: Preset) -> None:
        """Draw a preset of the same surface in all later pictures.
        With the width rule "plain", changes of frequency, phase, threshold, `keep` and `rim` are fast, others slower.
        Raises DsfabError for a different [surface] or an invalid preset, and then keeps the old preset."""
        if preset.first_difference(self._preset) == "surface":
            raise DsfabError(
                "a change of [surface] or of a region changes geometry and loads: make a new Previewer for the preset"
            )
        if not self.can_display(preset):
            if self._arrows:
                raise DsfabError("the gradient arrows do not fit the new preset: make a new Previewer for the preset")
            why = "other directions" if self._show == "directions" else f"another shape of {self._show}"
            raise DsfabError(
                f"the change of [statics] in the preset leads to {why}: make a new Previewer for the preset"
            )
        if not needs_only_settings(self._made.preset, preset):
            design = draft(preset, earlier=self._made)
            mesh = StripedMesh.from_design(design)
            stressed = self._show in ("stress", *colouring.STATICS_RESULTS) and design.statics is not self._made.statics
            if stressed or self._show in colouring.MODE_FIELDS:
                faces = colouring.face_colouring(design, self._show, self._palette)
                self._face, self._bar, self._words = faces.face, faces.bar, faces.words
                self._shader.recolour(self._mesh.on_faces(self._face))
            now, old_pattern = design.preset.pattern, self._made.preset.pattern
            if now.region != old_pattern.region or (now.region and now.keep != old_pattern.keep):
                self._distance = None
            again = not mesh.is_same_mesh(self._mesh)
            self._made, self._mesh = design, mesh
            if again:
                body = self._body()
                self._stage = replace(self._stage, bodies=[body, *self._stage.bodies[1:]])
                self._scene.replace_body(0, body)
            else:
                self._shader.replace_fields(vertex_fields(design, mesh, self._distances(design)))
        self._preset = preset
        self._send_numbers()

    def picture(
        self,
        size: tuple[int, int] = DEFAULT_SIZE,
        caption: str | None = None,
        quality: light.LightQuality = light.FINE,
        words: bool = True,
    ) -> Bytes:
        """Return the current picture, (height, width, 3) bytes, or (height, width, 4) on transparent ground.
        size : (width, height), pixels.    words : True to draw caption and legend.
        Raises PatternError if the pattern leaves no material."""
        if threading.get_ident() != self._thread:
            raise DsfabError("a Previewer draws only in the thread that made it; make a Previewer in each thread")
        stage = replace(self._stage, view=self._view(size, words))
        image = drawing.render_stage(self._scene, stage, self._palette, size, quality, self._clear)
        release_freed_memory(16.0 * size[0] * size[1] * quality.finer**2)  # bytes of intermediate pictures
        alone = len(stage.bodies) == 1  # with a sheet alone, an empty picture means no material
        if self._scene.empty if alone else not self._scene.casting:
            raise PatternError(
                "the pattern leaves no material on the surface; lower pattern.major.threshold or raise pattern.keep"
            )
        if words:
            line = self._caption() if caption is None else caption
            image = with_legend(image, drawing.legend(stage, line, self._palette, size, self._swatches), self._palette)
            image = colouring.with_bar(image, self._bar, self._palette) if self._bar else image
        return np.asarray(image)

    def frame(self, size: tuple[int, int] = DEFAULT_SIZE) -> None:
        """Draw the current preset in the window, without lamps, for an editor, and wait until the image is finished."""
        self._scene.frame(self._view(size, False), *size)

    @property
    def renderer(self) -> str:
        """Name of the OpenGL renderer; it is known after the first picture."""
        return self._scene.renderer

    def mask(self, size: tuple[int, int] = DEFAULT_SIZE, words: bool = True) -> Bools:
        """Return a mask (h, w) of pixels that show material. Loads, supports and the person (for scale) are hidden."""
        return self._scene.mask(self._view(size, words), *size)

    def _view(self, size: tuple[int, int], words: bool) -> View:
        if (size, words) not in self._views:
            bodies, scale = self._stage.bodies, self._bar is not None
            self._views[size, words] = drawing.page_view(bodies, self._side, size, words, scale)
        return self._views[size, words]

    def write(self, path: str | Path, size: tuple[int, int] = DEFAULT_SIZE, caption: str | None = None) -> Path:
        """Write `picture` as a PNG file. If the file is not writable, raise ExportError and leave no partial file."""
        return write_png(self.picture(size, caption), Path(path))

    def _repr_png_(self) -> bytes:
        return png_bytes(self.picture((800, 600)))

    def _caption(self) -> str:
        before = "before cutting and tidying" if self._made.pattern.even else "before cutting"
        return f"{self._preset.name} - {self._words or f'{self._show}, preview {before}'}"

    def _body(self) -> Body:
        design, mesh = self._made, self._mesh
        self._shader = StripeShader(vertex_fields(design, mesh, self._distances(design)), self._tints)
        V, normals = self._V, None
        if mesh.even:  # equal normals on both sides of the mesh's cuts hide the cuts
            normals = mesh.at_corners(shading(design.surface.V if V is None else V, design.surface.F))
        return Body(
            mesh.surface.V if V is None else mesh.carry(V),
            mesh.surface.F,
            mesh.on_faces(self._face),
            casts=True,
            shader=self._shader,
            half=design.preset.statics.thickness / 2,
            normals=normals,
        )

    def _send_numbers(self) -> None:
        whole_sheet = self._show in colouring.WHOLE_SHEET
        self._shader.set(ALL_MATERIAL if whole_sheet else shader_settings(self._preset, self._made.pattern, self._show))

    def _try_shader(self) -> None:
        view = self._view(TRIAL_SIZE, True)
        seen = []  # a driver that refuses the shader draws all faces or no face, without error
        for settings in (ALL_MATERIAL, NO_MATERIAL):
            self._shader.set(settings)
            seen.append(int(self._scene.mask(view, *TRIAL_SIZE).sum()))
        if not seen[0] or seen[1]:
            raise DsfabError(
                f"this machine's graphics driver does not run the preview's shader: the shader drew {seen[0]} pixels "
                f"of a surface full of material, and {seen[1]} of a surface without material. To draw in software, "
                "set VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow, or use dsfab build, whose picture needs no shader"
            )

    def _distances(self, design: Design) -> tuple[Floats, Floats]:
        if self._distance is None:
            self._distance = distances(design)
        return self._distance


def layer_names(marks: bool | Collection[str], view: str) -> set[str]:
    """Return names from `EVERY_LAYER` that a picture shows. Raises DsfabError for unknown names."""
    layers = set(drawing.LAYERS if marks else ()) if isinstance(marks, bool) else set(marks)
    if unknown := sorted(layers - set(drawing.EVERY_LAYER)):
        raise DsfabError(f"layer {unknown[0]!r} is not known; use some of {', '.join(drawing.EVERY_LAYER)}")
    return layers - ({"person"} if view == "top" else set())


class Previewers:
    """Previewers for a sequence of presets; use as `with Previewers(view=..., ...) as previewers`.
    sketched : function that is called with the sketch (see `Design.sketch`) of each new design, or None.
    options  : options of every `Previewer`."""

    def __init__(self, sketched: Callable[[Design], None] | None = None, **options: Any) -> None:
        self._sketched, self._options = sketched, options
        self._previewer: Previewer | None = None
        self.design: Design | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the window."""
        if self._previewer:
            self._previewer.close()
        self._previewer = None

    def previewer_for(self, preset: Preset, progress: Progress | None = None) -> "Previewer":
        """Return a previewer with this preset. Raises DsfabError if the design or its picture is impossible."""
        if self._previewer and self._previewer.can_display(preset):
            self._previewer.display(preset)
            return self._previewer
        design = self.draft_for(preset, progress)
        self.close()
        self._previewer = Previewer(design, **self._options)
        return self._previewer

    def draft_for(self, preset: Preset, progress: Progress | None = None) -> Design:
        """Return the design of a preset up to the pattern. Unchanged stages are those of the previous design."""
        design = Design.from_preset(preset, self.design, progress)
        if self._sketched and not design.has("pattern"):
            show = self._options.get("show")
            modes, answers = show in colouring.MODE_FIELDS, show in ("stress", *colouring.STATICS_RESULTS)
            if sketch := design.sketch(modes=modes, answers=answers):
                self._sketched(sketch)
        self.design = design.until("pattern")
        return self.design


class PanelsPicture(NamedTuple):
    """A picture that consists of several pictures, and the names of omitted pictures with the reasons."""

    pixels: Bytes
    left_out: tuple[str, ...]


def panels(
    design: Design,
    names: Sequence[str],
    pixels: tuple[int, int],
    progress: Progress,
    quality: LightQuality = FINE,
    **options: Any,
) -> PanelsPicture:
    """Return one picture that consists of the pictures `names`. pixels : size of each picture.
    If `names` contains "loads", all other pictures have no arrows, unless `options` (of `Previewer`) contain `marks`.
    A picture is omitted and reported if the design lacks its result. Raises DsfabError if no picture is left."""
    pictures, refused = [], []
    alone = "marks" not in options and "loads" in names
    for name in names:
        progress("preview", f"drawing {name.replace('_', ' ')}")
        try:
            picture_options = {"marks": ("person",)} | options if alone and name != "loads" else options
            with Previewer(design, show=name, **picture_options) as previewer:
                pictures.append(previewer.picture(pixels, quality=quality))
        except DsfabError as error:
            refused.append(f"{name}: {error}")
    if not pictures:
        raise DsfabError(f"nothing can be shown; {'; '.join(refused)}")
    return PanelsPicture(_tile_pictures(pictures), tuple(refused))


def _tile_pictures(pictures: Sequence[Bytes]) -> Bytes:
    columns = {1: 1, 2: 2, 4: 2}.get(len(pictures), 3)
    empty = np.broadcast_to(pictures[0][:1, :1], pictures[0].shape)
    filled = [*pictures, *(empty for _ in range(-len(pictures) % columns))]
    return np.concatenate([np.concatenate(filled[i : i + columns], axis=1) for i in range(0, len(filled), columns)])
