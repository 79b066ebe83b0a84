"""The scene in VTK: an off-screen window with meshes, and depth, normal and colour of each pixel."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.sparse import give_back
from dsfab.render.view import View
from dsfab.surface import signed_volume

if TYPE_CHECKING:
    from dsfab.render.shader import StripeShader


NORMAL_STEPS = 1 << 10
"""Steps from -1 to 1 by which normals are told apart: finer than a picture's bytes."""


class Window:
    """A window that nobody sees: black, without lamps, and without a mean of samples at edges, which mixes normals.

    It must be made, used and closed in one thread.
    """

    def __init__(self) -> None:
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (it brings what draws)
        from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

        self.window: Any = vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(64, 64)
        self._renderer = vtkRenderer()
        self._renderer.AutomaticLightCreationOff()
        self.window.AddRenderer(self._renderer)
        self.camera: Any = self._renderer.GetActiveCamera()
        self.closed = False

    def add(self, actor: Any) -> None:
        """Draw an actor from now on."""
        self._renderer.AddActor(actor)

    def remove(self, actor: Any) -> None:
        """Draw an actor no longer, and give back what the graphics side holds of it."""
        self._renderer.RemoveActor(actor)
        actor.ReleaseGraphicsResources(self.window)

    def close(self) -> None:
        """Give back what the window holds; a second time does nothing."""
        if not self.closed:
            self.window.Finalize()
            self._renderer.RemoveAllViewProps()
            self.closed = True

    def resize(self, width: int, height: int) -> None:
        """Pixels of the pictures from now on."""
        self.window.SetSize(width, height)

    def rest(self) -> None:
        """Give the pictures back that the graphics side holds, six of the last size, until the next one is drawn."""
        width, height = self.window.GetSize()
        self.window.SetSize(64, 64)
        self._renderer.DrawOff()
        self.window.Render()
        self._renderer.DrawOn()
        give_back(6 * 4 * width * height)

    def fill(self, colour: tuple[float, float, float]) -> None:
        """Another ground than black, red green blue from 0 to 1."""
        self._renderer.SetBackground(*colour)

    def draw(self) -> None:
        """Draw what there is."""
        self.window.Render()

    def depth(self) -> NDArray[np.float32]:
        """(h, w) of the picture drawn, row 0 on top: 0 at the nearest depth of the camera, 1 where nothing is."""
        from vtkmodules.vtkCommonCore import vtkFloatArray

        width, height = self.window.GetSize()
        values = vtkFloatArray()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, values)
        return _numbers(values).reshape(height, width)[::-1]

    def colours(self) -> NDArray[np.uint8]:
        """(h, w, 3) 0..255 of the picture drawn, row 0 on top."""
        width, height = self.window.GetSize()
        return self._read(0, 0, width - 1, height - 1).reshape(height, width, 3)[::-1]

    def wait(self) -> None:
        """Until the picture is drawn: its middle pixel is read back."""
        x, y = (pixels // 2 for pixels in self.window.GetSize())
        self._read(x, y, x, y)

    def _read(self, left: int, bottom: int, right: int, top: int) -> NDArray[np.uint8]:
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        values = vtkUnsignedCharArray()
        self.window.GetPixelData(left, bottom, right, top, 1, values, 0)
        return _numbers(values)


def warm_up() -> bool:
    """Load what draws, and draw nothing but red once: for a process that waits until it is asked for a picture.

    Returns whether that was seen.
    """
    import PIL.ImageDraw
    import PIL.ImageFont
    import PIL.PngImagePlugin  # noqa: F401
    import scipy.ndimage  # noqa: F401
    import vtkmodules.vtkFiltersCore  # noqa: F401

    import dsfab.export  # noqa: F401  (it writes pictures)

    window = Window()
    window.fill((1.0, 0.0, 0.0))
    window.draw()
    red = bool((window.colours() == (255, 0, 0)).all())
    window.close()
    return red


def split_mesh(points: Floats, F: Ints, split: float) -> tuple[Any, NDArray[np.float32], Ints]:
    """A mesh of points (n, 3) and faces (m, 3), its corners split at edges sharper than `split`, degrees.

    Also the normals (k, 3) of its points, and the given point (k,) that each comes from.
    """
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    whole = _polydata(points, F)
    set_array(whole.GetPointData(), "vertex", np.arange(len(points), dtype=np.int32))
    asked = vtkPolyDataNormals()
    asked.SetInputData(whole)
    asked.SetFeatureAngle(split)
    asked.ConsistencyOff()
    asked.Update()
    mesh = asked.GetOutput()
    at = mesh.GetPointData()
    normals, source = _numbers(at.GetNormals()).copy(), _numbers(at.GetArray("vertex")).copy()
    for name in (at.GetNormals().GetName(), "vertex"):  # or they would be sent to the graphics side
        at.RemoveArray(name)
    return mesh, normals, source


def corner_normals(points: Floats, F: Ints, split: float) -> NDArray[np.float32]:
    """(m, 3, 3) the normals of `split_mesh` at the corners of its faces."""
    mesh, normals, _ = split_mesh(points, F, split)
    return np.asarray(normals[_numbers(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)])


def jointed_mesh(points: Floats, F: Ints, normals: NDArray[np.float32]) -> tuple[Any, NDArray[np.float32], Ints]:
    """`split_mesh` where the normals (m, 3, 3) at the corners of faces are known: split where they differ."""
    steps = np.rint((normals.reshape(-1, 3) + 1) * (NORMAL_STEPS / 2)).astype(np.int64)
    key = np.ravel_multi_index((F.ravel(), *steps.T), (len(points), *3 * (NORMAL_STEPS + 1,)), mode="clip")
    _, first, corner = np.unique(key, return_index=True, return_inverse=True)
    source = F.ravel()[first]
    mesh = _polydata(points[source], corner.reshape(-1, 3))
    return mesh, np.asarray(normals.reshape(-1, 3)[first]), source


def set_array(attributes: Any, name: str, values: NDArray[Any]) -> None:
    """Numbers (k, ...) for the points or the cells of a mesh, `GetPointData()` or `GetCellData()`, under a name."""
    array = _support().numpy_to_vtk(np.ascontiguousarray(values), deep=True)  # VTK does not keep what it did not copy
    array.SetName(name)
    attributes.AddArray(array)


def _polydata(points: Floats, F: Ints) -> Any:
    """A mesh of points (n, 3) and faces (m, 3)."""
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    places, corners, mesh = vtkPoints(), vtkCellArray(), vtkPolyData()
    places.SetData(_support().numpy_to_vtk(points.astype(np.float32), deep=True))
    corners.SetData(3, _support().numpy_to_vtkIdTypeArray(np.ascontiguousarray(F, dtype=np.int64).ravel(), deep=True))
    mesh.SetPoints(places)
    mesh.SetPolys(corners)
    return mesh


def _numbers(array: Any) -> NDArray[Any]:
    """VTK's memory itself, which lives as long as this does."""
    return np.asarray(_support().vtk_to_numpy(array))


def _support() -> Any:
    """What changes arrays of numpy into VTK's and back; it has no types."""
    from vtkmodules.util import numpy_support

    return numpy_support


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
