"""VTK's window off the screen and its meshes, by VTK alone: pyvista, which was here, takes 110 MB more."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsfab.arrays import Floats, Ints
from dsfab.sparse import give_back


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
        self.window.SetSize(64, 64)
        self._renderer.DrawOff()
        self.window.Render()
        self._renderer.DrawOn()
        give_back()

    def draw(self) -> None:
        """Draw what there is."""
        self.window.Render()

    def depth(self) -> NDArray[np.float32]:
        """(h, w) of the picture drawn, row 0 on top: 0 at the nearest depth of the camera, 1 where nothing is."""
        from vtkmodules.vtkCommonCore import vtkFloatArray

        width, height = self.window.GetSize()
        values = vtkFloatArray()
        self.window.GetZbufferData(0, 0, width - 1, height - 1, values)
        return _seen(values).reshape(height, width)[::-1]

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
        return _seen(values)


def split_mesh(points: Floats, F: Ints, split: float) -> tuple[Any, NDArray[np.float32], Ints]:
    """A vtkPolyData of points (n, 3) and faces (m, 3), its corners split at edges sharper than `split`, degrees.

    Also the normals (k, 3) of its points, and the given point (k,) that each comes from.
    """
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

    whole, corners, cells = vtkPolyData(), vtkPoints(), vtkCellArray()
    corners.SetData(_array(points.astype(np.float32)))
    cells.SetData(_array(np.arange(0, 3 * len(F) + 1, 3, dtype=np.int32)), _array(F.astype(np.int32).ravel()))
    whole.SetPoints(corners)
    whole.SetPolys(cells)
    put(whole.GetPointData(), "vertex", np.arange(len(points), dtype=np.int32))
    normals = vtkPolyDataNormals()
    normals.SetInputData(whole)
    normals.SetFeatureAngle(split)
    normals.ConsistencyOff()
    normals.Update()
    mesh = vtkPolyData()
    mesh.ShallowCopy(normals.GetOutput())
    at = mesh.GetPointData()
    along, source = (_numbers(at.GetArray(name)) for name in ("Normals", "vertex"))
    for name in ("Normals", "vertex"):
        at.RemoveArray(name)  # or they would be sent to the graphics side
    return mesh, along, source


def put(data: Any, name: str, values: NDArray[Any]) -> None:
    """Values as the array `name` of the points or cells of a mesh, in place of one that there may be."""
    array = _array(values)
    array.SetName(name)
    data.AddArray(array)


def _array(values: NDArray[Any]) -> Any:
    """A copy in VTK's memory."""
    from vtkmodules.util import numpy_support

    copied: Any = numpy_support.numpy_to_vtk
    return copied(np.ascontiguousarray(values), deep=True)


def _numbers(array: Any) -> NDArray[Any]:
    """A copy in numpy's memory."""
    return np.array(_seen(array))


def _seen(array: Any) -> NDArray[Any]:
    """VTK's memory itself, which lives as long as this does."""
    from vtkmodules.util import numpy_support

    seen: Any = numpy_support.vtk_to_numpy
    values: NDArray[Any] = seen(array)
    return values
