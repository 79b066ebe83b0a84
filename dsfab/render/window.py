"""The window off the screen, and the meshes that are drawn in it.

Both are VTK's own: pyvista takes a quarter of a second to load, and its plotter, with which come matplotlib and all of
VTK's modules, 75 MB and half a second more.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Floats, Ints
from dsfab.sparse import give_back

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
