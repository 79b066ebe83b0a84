"""A lamp shade for a 3D printer: a shape of revolution from trimesh, 240 mm high, as STL."""

from pathlib import Path

import numpy as np
import trimesh

import dsfab

height = np.linspace(0, 0.24, 40)
radius = 0.05 + 0.045 * np.sin(np.pi * (height / 0.24) ** 0.8)
shade = trimesh.creation.revolve(np.column_stack([radius, height]), sections=72)

lamp = dsfab.Preset(
    surface=shade,
    supports=[dsfab.Support(dsfab.Side(axis="z", end="min"))],
    loads=[dsfab.Force(dsfab.Side(axis="z", end="max"), force=(0, 0, -20.0))],
    statics={"thickness": 0.0024, "material": "PLA"},
    pattern={
        "method": "stripes",
        "rim": 0.006,
        "major": {"spacing": 0.022},
        "minor": {"spacing": 0.022},
        "rotate": 45,
        "width": {"rule": "constant", "solid_fraction": 0.4},
    },
)
design = dsfab.run(lamp)
design.write("lamp.stl")
print(design)
Path("lamp.png").write_bytes(dsfab.inline_picture(design))
