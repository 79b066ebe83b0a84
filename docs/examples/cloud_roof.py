"""A roof from a formula: a shallow shell with humps on four feet, under snow, as STL."""

from pathlib import Path

import numpy as np
import pyvista

import dsfab

plane = pyvista.Plane(i_size=12, j_size=9, i_resolution=40, j_resolution=30)
x, y, _ = plane.points.T
plane.points[:, 2] = 4 - 0.045 * (x**2 + y**2) + 0.35 * np.cos(x * np.pi / 3) * np.cos(y * np.pi / 3)  # metres

corners = plane.points[[0, 40, -41, -1]].tolist()
roof = dsfab.Preset(
    surface=plane,
    supports=[dsfab.Support(dsfab.Ball(center=corner, radius=0.5)) for corner in corners],
    loads=[dsfab.SelfWeight(), dsfab.Snow(800)],
    statics={"thickness": 0.12, "material": "GL24h"},
    pattern={
        "method": "stripes",
        "rim": 0.2,
        "keep": 0.4,
        "major": {"spacing": 0.8},
        "minor": {"spacing": 0.8},
        "width": {"rule": "constant", "solid_fraction": 0.42},
    },
)
design = dsfab.run(roof)
design.write("cloud_roof.stl")
print(design)
Path("cloud_roof.png").write_bytes(dsfab.inline_picture(design))
