"""The scene in VTK: depth, normal and colour of each pixel."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.sparse import release_freed_memory
from dsfab.render.view import View
from dsfab.surface import signed_volume

if TYPE_CHECKING:
    from dsfab.render.shader import StripeShader

NORMAL_STEPS = 1 << 10  # components of normals are rounded to 2 / `NORMAL_STEPS` for comparison


class Window:
    """Off-screen window with a black background. Create, use and close a window in one thread."""

    def __init__(self) -> None:
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (VTK draws nothing without it)
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
        """Draw a VTK actor in all following pictures."""
        self._renderer.AddActor(actor)

    def remove(self, actor: Any) -> None:
        """Stop drawing a VTK actor."""
        self._renderer.RemoveActor(actor)
        actor.ReleaseGraphicsResources(self.window)

    def close(self) -> None:
        """Release the window."""
        if not self.closed:
            self.window.Finalize()
            self._renderer.RemoveAllViewProps()
            self.closed = True

    def resize(self, width: int, height: int) -> None:
        """Set the size of the pictures (pixels)."""
        self.window.SetSize(width, height)

    def release_pictures(self) -> None:
        """Release the memory of the pictures in OpenGL."""
        width, height = self.window.GetSize()
        self.window.SetSize(64, 64)
        self._renderer.DrawOff()
        self.window.Render()
        self._renderer.DrawOn()
        release_freed_memory(6 * 4 * width * height)

    def fill(self, colour: tuple[float, float, float]) -> None:
        """Set the background colour, red green blue from 0 to 1."""
        self._renderer.SetBackground(*colour)

    def draw(self) -> None:
        """Draw all actors."""
        self.window.Render()

    def depth(self) -> NDArray[np.float32]:
        """Return the depth (h, w) of the picture, row 0 on top; 1 at empty pixels."""
        from vtkmodules.vtkCommonCore import vtkFloatArray

        width, height = self.window.GetSize()
        values = vtkFloatArray()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, values)
        return _numbers(values).reshape(height, width)[::-1]

    def colours(self) -> NDArray[np.uint8]:
        """Return the colours (h, w, 3) 0..255 of the picture, row 0 on top."""
        width, height = self.window.GetSize()
        return self._read(0, 0, width - 1, height - 1).reshape(height, width, 3)[::-1]

    def wait(self) -> None:
        """Wait until the picture is finished."""
        x, y = (pixels // 2 for pixels in self.window.GetSize())
        self._read(x, y, x, y)

    def _read(self, left: int, bottom: int, right: int, top: int) -> NDArray[np.uint8]:
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        values = vtkUnsignedCharArray()
        self.window.GetPixelData(left, bottom, right, top, 1, values, 0)
        return _numbers(values)


def load_renderer() -> bool:
    """Draw a red test picture; return True if the picture is red."""
    import PIL.ImageDraw
    import PIL.ImageFont
    import PIL.PngImagePlugin  # noqa: F401
    import scipy.ndimage  # noqa: F401
    import vtkmodules.vtkFiltersCore  # noqa: F401

    import dsfab.export  # noqa: F401  (writers of pictures)

    window = Window()
    window.fill((1.0, 0.0, 0.0))
    window.draw()
    red = bool((window.colours() == (255, 0, 0)).all())
    window.close()
    return red


def split_mesh(points: Floats, F: Ints, split: float) -> tuple[Any, NDArray[np.float32], Ints]:
    """Return a VTK mesh that is split at edges with an angle above `split` degrees, with k points.
    Also return the points' normals (k, 3), and the index (k,) of each point in `points` (n, 3).    F : (m, 3) faces."""
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    source_mesh = _polydata(points, F)
    set_array(source_mesh.GetPointData(), "vertex", np.arange(len(points), dtype=np.int32))
    normals_filter = vtkPolyDataNormals()
    normals_filter.SetInputData(source_mesh)
    normals_filter.SetFeatureAngle(split)
    normals_filter.ConsistencyOff()
    normals_filter.Update()
    mesh = normals_filter.GetOutput()
    attributes = mesh.GetPointData()
    normals, source = _numbers(attributes.GetNormals()).copy(), _numbers(attributes.GetArray("vertex")).copy()
    for name in (attributes.GetNormals().GetName(), "vertex"):  # OpenGL does not need these arrays
        attributes.RemoveArray(name)
    return mesh, normals, source


def mesh_with_normals(points: Floats, F: Ints, normals: NDArray[np.float32]) -> tuple[Any, NDArray[np.float32], Ints]:
    """Return a VTK mesh, split where normals (m, 3, 3) at face corners differ, with the results of `split_mesh`."""
    steps = np.rint((normals.reshape(-1, 3) + 1) * (NORMAL_STEPS / 2)).astype(np.int64)
    key = np.ravel_multi_index((F.ravel(), *steps.T), (len(points), *3 * (NORMAL_STEPS + 1,)), mode="clip")
    _, first_corner, corner = np.unique(key, return_index=True, return_inverse=True)
    source = F.ravel()[first_corner]
    mesh = _polydata(points[source], corner.reshape(-1, 3))
    return mesh, np.asarray(normals.reshape(-1, 3)[first_corner]), source


def set_array(attributes: Any, name: str, values: NDArray[Any]) -> None:
    """Store values (k, ...) at the points or cells of a VTK mesh, with a name. attributes : point or cell data."""
    array = _support().numpy_to_vtk(np.ascontiguousarray(values), deep=True)  # a copy, as numpy frees `values`
    array.SetName(name)
    attributes.AddArray(array)


def _polydata(points: Floats, F: Ints) -> Any:
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    places, corners, mesh = vtkPoints(), vtkCellArray(), vtkPolyData()
    places.SetData(_support().numpy_to_vtk(points.astype(np.float32), deep=True))
    corners.SetData(3, _support().numpy_to_vtkIdTypeArray(np.ascontiguousarray(F, dtype=np.int64).ravel(), deep=True))
    mesh.SetPoints(places)
    mesh.SetPolys(corners)
    return mesh


def _numbers(array: Any) -> NDArray[Any]:
    return np.asarray(_support().vtk_to_numpy(array))


def _support() -> Any:
    from vtkmodules.util import numpy_support

    return numpy_support


Floats32 = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Colour = tuple[int, int, int]

SHARP_DEGREES = 35.0  # degrees; smallest angle between the faces of an edge that looks sharp
LAMP_AWAY = 3.0  # distance of lamps from the centre, scene units
LAMP_DEPTHS = 1.9, 4.1  # nearest and farthest depth that a lamp lights, scene units


@dataclass(frozen=True, eq=False)
class Body:
    """Mesh of vertices V (n, 3), m, and faces F (m, 3), with a colour (3,) or (m, 3) in 0..255.
    casts   : True if the body throws shadows.    shader : hides the openings of a pattern, or None.
    half    : half of the thickness of the sheet, m.    normals : (m, 3, 3) normals at the corners of faces, or None."""

    V: Floats
    F: Ints
    colour: Bytes
    casts: bool = False
    shader: "StripeShader | None" = None
    half: float = 0.0
    normals: Floats32 | None = None

    @cached_property
    def encloses(self) -> bool:
        """True for a closed mesh with all faces oriented outwards."""
        F = np.asarray(self.F, dtype=np.int64)
        start, end = F.ravel(), np.roll(F, -1, axis=1).ravel()
        forward, backward = start * len(self.V) + end, end * len(self.V) + start
        return bool((np.sort(forward) == np.sort(backward)).all()) and signed_volume(self.V, F) > 0


def shading(V: Floats, F: Ints) -> Floats32:
    """Return the normals (m, 3, 3) at the corners of faces, smooth except at sharp edges."""
    mesh, normals, _ = split_mesh(V, F, SHARP_DEGREES)
    return np.asarray(normals[_numbers(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)])


@dataclass(frozen=True, eq=False)
class Pixels:
    """Depth, normal and colour of the pixels (h, w) of a picture, row 0 on top.
    depth  : (h, w) along the view, in units of `Scene.radius`; infinite where the picture is empty.
    normal : (h, w, 3) components as bytes: 0 for -1, 255 for 1.    colour : (h, w, 3) in 0..255."""

    depth: Floats32
    normal: Bytes
    colour: Bytes


class Scene:
    """Bodies in OpenGL; use as `with Scene(...) as scene`. Create, use and close a scene in one thread. In scene units,
    `centre` is the origin, and the length 1 is `radius`."""

    def __init__(self, bodies: list[Body], centre: Floats, radius: float) -> None:
        self.centre, self.radius = centre, radius
        self.window = Window()
        try:
            self.actors = [self._add(body) for body in bodies]
            self.bodies = list(bodies)
            self.empty = True
            self.casting = False  # True if a body was in view of a lamp in the latest picture
            self.casts = [body.casts for body in bodies]
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the window."""
        self.window.close()

    def replace_body(self, index: int, body: Body) -> None:
        """Replace the body with number `index` by a body of the same size."""
        actor = self._add(body)
        self.window.remove(self.actors[index])
        self.actors[index], self.bodies[index], self.casts[index] = actor, body, body.casts

    def pixels(self, view: View, width: int, height: int) -> Pixels:
        """Return depth, normal and colour of the pixels of a view."""
        near, far = self._aim_camera(view)
        self.window.resize(width, height)
        with self._walls(view):
            self._colour_by("normal")
            z, normal = self._depth(), self.window.colours()
            self._colour_by("colour")
            self.window.draw()
        hit = z < 1
        self.empty = not hit.any()
        z *= near - far  # change z in place; a print has 24 million pixels
        z += far
        depth = np.divide(near * far, z, out=z)
        depth[~hit] = np.inf
        colour = self.window.colours()
        self.window.release_pictures()
        return Pixels(depth, normal, colour)

    @contextmanager
    def _walls(self, view: View) -> Iterator[None]:
        eye = (view.eye - self.centre) / self.radius
        shaded = [(body.shader, body.half) for body in self.bodies if body.shader]
        for shader, half in shaded:
            shader.show_walls(eye, half / self.radius)
        yield
        for shader, _ in shaded:
            shader.show_walls(None, 0.0)

    @property
    def renderer(self) -> str:
        """Name of the OpenGL renderer, known after the first picture."""
        match = re.search(r"OpenGL renderer string:\s*(.+)", self.window.window.ReportCapabilities())
        return match.group(1).strip() if match else "unknown"

    def frame(self, view: View, width: int, height: int) -> None:
        """Draw a picture without reading the pixels."""
        self._aim_camera(view)
        self.window.resize(width, height)
        self.window.draw()
        self.window.wait()

    def mask(self, view: View, width: int, height: int) -> Bools:
        """Return a mask (h, w) of the pixels of all bodies that cast shadows."""
        with self.lamps():
            self._aim_camera(view)
            self.window.resize(width, height)
            return np.asarray(self._depth() < 1)

    @contextmanager
    def lamps(self) -> Iterator[None]:
        """Hide all bodies that cast no shadow during a `with` block, as `lamp` needs."""
        self.casting = False
        for actor, body, casts in zip(self.actors, self.bodies, self.casts, strict=True):
            actor.SetVisibility(casts)
            actor.GetMapper().SetScalarVisibility(body.shader is not None)  # colours would slow drawing tenfold
            if casts and body.shader is None:  # drawing hidden back faces would triple the time
                actor.GetProperty().SetBackfaceCulling(body.encloses)
        yield
        for actor in self.actors:
            actor.SetVisibility(True)
            actor.GetProperty().BackfaceCullingOff()
            actor.GetMapper().SetScalarVisibility(True)

    def lamp(self, frame: Floats, side: int) -> Floats32:
        """Return the depth (side, side) that a lamp sees, 0..1; 1 at empty pixels.
        frame : rows (3, 3): unit vectors right, up, towards the lamp."""
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

    def _aim_camera(self, view: View) -> tuple[float, float]:
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
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

        points = (body.V - self.centre) / self.radius
        if body.normals is None:
            mesh, normals, source = split_mesh(points, body.F, SHARP_DEGREES)
        else:
            mesh, normals, source = mesh_with_normals(points, body.F, body.normals)
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
