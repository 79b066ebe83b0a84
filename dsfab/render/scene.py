"""What is where in a picture, asked from VTK: depth, normal and colour of each pixel, and depth as seen from a lamp.

No lighting of VTK is used, so software rendering and a graphics card give the same picture.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Bools, Floats, Ints
from dsfab.render.view import View
from dsfab.render.window import Window, corner_normals, jointed_mesh, set_array, split_mesh
from dsfab.surface import signed_volume

if TYPE_CHECKING:
    from dsfab.render.shader import StripeShader

Floats32 = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Colour = tuple[int, int, int]

SPLIT = 35.0
"""Edges sharper than this, degrees, are shaded as sharp; flatter ones as curved."""


LAMP_AWAY, LAMP_DEPTHS = 3.0, (1.9, 4.1)
"""Radii from a lamp to the middle of the scene, and to the nearest and farthest of what it sees."""


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh to draw: V (n, 3) m, F (m, 3), colour (3,) or (m, 3) in 0..255; casts: whether it throws shadows.

    shader : leaves away what a pattern does not cover.
    half   : half the thickness of what the shader draws, metres: its walls are shown.
    normals: (m, 3, 3) at the corners of the faces, see `shading`; None finds them out.
    """

    V: Floats
    F: Ints
    colour: Bytes
    casts: bool = False
    shader: "StripeShader | None" = None
    half: float = 0.0
    normals: Floats32 | None = None

    @cached_property
    def encloses(self) -> bool:
        """Whether it is the skin of something: closed, its faces outward. Whoever is outside sees no back of a face."""
        F = np.asarray(self.F, dtype=np.int64)
        start, end = F.ravel(), np.roll(F, -1, axis=1).ravel()
        there, back = start * len(self.V) + end, end * len(self.V) + start
        return bool((np.sort(there) == np.sort(back)).all()) and signed_volume(self.V, F) > 0


def shading(V: Floats, F: Ints) -> Floats32:
    """(m, 3, 3) the normals by which a body is shaded; for another one that is the same but for how it is divided."""
    return corner_normals(V, F, SPLIT)


@dataclass(frozen=True, eq=False)
class Pixels:
    """What is where in a picture of (h, w) pixels, row 0 on top; lengths in units of `Scene.radius`.

    depth : (h, w) along the view, infinity where nothing is.
    normal: (h, w, 3) 0..255 for -1..1.      colour: (h, w, 3) 0..255.
    """

    depth: Floats32
    normal: Bytes
    colour: Bytes


class Scene:
    """Bodies on the graphics side, seen from one eye and from many lamps; use as `with Scene(...) as scene`.

    Inside, `centre` is the origin and `radius` (of a ball around all that casts shadows) is the unit of length, so that
    millimetres and kilometres are drawn alike. It must be made, used and closed in one thread.
    """

    def __init__(self, bodies: list[Body], centre: Floats, radius: float) -> None:
        self.centre, self.radius = centre, radius
        self.window = Window()
        try:
            self.actors = [self._add(body) for body in bodies]
            self.bodies = list(bodies)
            self.empty = True
            self.casting = False  # whether a lamp saw anything, when lamps were asked last
            self.casts = [body.casts for body in bodies]
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the window back."""
        self.window.close()

    def put(self, index: int, body: Body) -> None:
        """Another body in the place of one that there is, as large as that."""
        actor = self._add(body)
        self.window.remove(self.actors[index])
        self.actors[index], self.bodies[index], self.casts[index] = actor, body, body.casts

    def pixels(self, view: View, width: int, height: int) -> Pixels:
        """What the eye sees."""
        near, far = self._look(view)
        self.window.resize(width, height)
        with self._walls(view):
            self._colour_by("normal")
            z, normal = self._depth(), self.window.colours()
            self._colour_by("colour")
            self.window.draw()
        hit = z < 1
        self.empty = not hit.any()
        z *= near - far  # in place: a picture for print has 24 million pixels
        z += far
        depth = np.divide(near * far, z, out=z)
        depth[~hit] = np.inf
        colour = self.window.colours()
        self.window.rest()
        return Pixels(depth, normal, colour)

    @contextmanager
    def _walls(self, view: View) -> Iterator[None]:
        """Inside, the walls of cut sheets are seen; for lamps and masks they are infinitely thin."""
        eye = (view.eye - self.centre) / self.radius
        shaded = [(body.shader, body.half) for body in self.bodies if body.shader]
        for shader, half in shaded:
            shader.look(eye, half / self.radius)
        yield
        for shader, _ in shaded:
            shader.look(None, 0.0)

    @property
    def renderer(self) -> str:
        """What draws, by its own words, once something was drawn."""
        said = re.search(r"OpenGL renderer string:\s*(.+)", self.window.window.ReportCapabilities())
        return said.group(1).strip() if said else "unknown"

    def frame(self, view: View, width: int, height: int) -> None:
        """Draw, wait until it is drawn, and read nothing back but the middle pixel."""
        self._look(view)
        self.window.resize(width, height)
        self.window.draw()
        self.window.wait()

    def mask(self, view: View, width: int, height: int) -> Bools:
        """(h, w) where the eye sees something that casts shadows, were it alone."""
        with self.lamps():
            self._look(view)
            self.window.resize(width, height)
            return np.asarray(self._depth() < 1)

    @contextmanager
    def lamps(self) -> Iterator[None]:
        """Inside, `lamp` may be called: only what casts shadows is there."""
        self.casting = False
        for actor, body, casts in zip(self.actors, self.bodies, self.casts, strict=True):
            actor.SetVisibility(casts)
            actor.GetMapper().SetScalarVisibility(body.shader is not None)  # depth has no colour: a tenth of the time
            if casts and body.shader is None:  # what no lamp sees is not drawn: a third of the time
                actor.GetProperty().SetBackfaceCulling(body.encloses)
        yield
        for actor in self.actors:
            actor.SetVisibility(True)
            actor.GetProperty().BackfaceCullingOff()
            actor.GetMapper().SetScalarVisibility(True)

    def lamp(self, frame: Floats, side: int) -> Floats32:
        """(s, s) depth of what a lamp sees first, 0..1 from the nearest of `LAMP_DEPTHS` to the farthest, 1 where that
        is nothing; s is `side`.

        frame : rows right, up, towards the lamp. Pixel [j, i] spans -1..1 along up (j) and right (i).
        """
        self.window.resize(side, side)
        camera = self.window.camera
        camera.SetParallelProjection(True)
        camera.SetParallelScale(1.0)
        camera.SetPosition(*(LAMP_AWAY * frame[2]))
        camera.SetFocalPoint(0, 0, 0)
        camera.SetViewUp(*frame[1])
        camera.SetClippingRange(*LAMP_DEPTHS)
        seen = self._depth()[::-1]
        self.casting = self.casting or bool((seen < 1).any())
        return seen

    def _look(self, view: View) -> tuple[float, float]:
        """Point the camera; returns its nearest and farthest depth."""
        camera = self.window.camera
        eye = (view.eye - self.centre) / self.radius
        camera.SetParallelProjection(False)
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*(eye + view.forward))
        camera.SetViewUp(*view.up)
        camera.SetViewAngle(float(np.degrees(2 * np.arctan(view.slope))))
        ahead = float(-eye @ view.forward)
        near, far = max(ahead - 2.0, 0.02 * ahead), ahead + 2.0
        camera.SetClippingRange(near, far)
        return near, far

    def _depth(self) -> Floats32:
        self.window.draw()
        return self.window.depth()

    def _colour_by(self, name: str) -> None:
        for actor, body in zip(self.actors, self.bodies, strict=True):
            if body.shader:
                body.shader.colour_by(name)
            mapper = actor.GetMapper()
            if name == "normal":
                mapper.SetScalarModeToUsePointFieldData()
            else:
                mapper.SetScalarModeToUseCellFieldData()
            mapper.SelectColorArray(name)

    def _add(self, body: Body) -> Any:
        """Hand a body to VTK with two colourings, by 'normal' of its corners and by 'colour' of its faces."""
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        points = (body.V - self.centre) / self.radius
        known = body.normals
        mesh, normals, source = (
            split_mesh(points, body.F, SPLIT) if known is None else jointed_mesh(points, body.F, known)
        )
        set_array(mesh.GetPointData(), "normal", np.round((normals + 1) * 127.5).astype(np.uint8))
        set_array(mesh.GetCellData(), "colour", np.broadcast_to(body.colour, (len(body.F), 3)).astype(np.uint8))
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(mesh)
        mapper.SetColorModeToDirectScalars()
        actor.SetMapper(mapper)
        actor.GetProperty().LightingOff()
        if body.shader:
            body.shader.attach(actor, mapper, mesh, source)
        self.window.add(actor)
        return actor
