"""The window off the screen, and the meshes that are drawn in it.

Meshes are pyvista's. The window is VTK's own: with pyvista's plotter come matplotlib and all of VTK's modules, 75 MB
and half a second for nothing that is used here.
"""

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


def split_mesh(points: Floats, F: Ints, split: float) -> tuple[Any, NDArray[np.float32], Ints]:
    """A mesh of points (n, 3) and faces (m, 3), its corners split at edges sharper than `split`, degrees.

    Also the normals (k, 3) of its points, and the given point (k,) that each comes from.
    """
    import pyvista as pv

    made: Any = pv.PolyData.from_regular_faces  # typed for Python's own numbers only
    whole = made(points.astype(np.float32), F)
    whole.point_data["vertex"] = np.arange(len(points), dtype=np.int32)
    mesh = whole.compute_normals(cell_normals=False, split_vertices=True, feature_angle=split, consistent_normals=False)
    # taken out of the mesh, or they would be sent to the graphics side
    return mesh, np.array(mesh.point_data.pop("Normals")), np.array(mesh.point_data.pop("vertex"))


def _numbers(array: Any) -> NDArray[Any]:
    """VTK's memory itself, which lives as long as this does."""
    import pyvista as pv

    seen: Any = pv.convert_array
    values: NDArray[Any] = seen(array)
    return values
