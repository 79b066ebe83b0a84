"""dsfab: structures that follow the stress on a surface.

    preset = dsfab.load_preset("dome", {"surface.edge": 0.6})   # a shipped preset, or your TOML file
    design = dsfab.run(preset)                                   # runs all stages; a notebook shows a picture
    design.write("dome.step")                                    # one file: step, stl, 3mf, dxf, ...
    design.save("outputs/dome")                                  # all files that `dsfab build` writes

    dsfab.revise(design, preset)      the design of a changed preset
    dsfab.sized_design(preset)        the design with the thinnest sufficient sheet from the material's stock
    dsfab.sweep(preset, ...)          many designs, with measures of each
    dsfab.compare(design)             compares the design with other designs of the same mass
    dsfab.edit(preset)                opens an editor in a notebook

    roof = dsfab.preset_for(mesh)                    # proposes a preset for your mesh, or for a file
    roof = dsfab.Preset(                             # or you make every choice
        surface=mesh,                                # your mesh, metres: trimesh, pyvista, compas, (V, F), or a path
        supports=[dsfab.Support(dsfab.Boundary())],  # or Side, Box, Ball, PlanPolygon, Facing, All ...
        loads=[dsfab.SelfWeight(), dsfab.Snow(800)], # or Cladding, Force, Line, ...; newtons, pascals
        statics={"thickness": 0.05},                 # and pattern=, diffusion=, ..., each key as in TOML
    )
    dsfab.Surface.of(mesh, "mm")      for a mesh in another unit;  dsfab.read_surface("roof.obj", "mm")

dsfab imports heavy libraries at their first use."""

import os
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

try:
    __version__ = version("dsfab")  # the version of the installed package, from its git tag
except PackageNotFoundError:  # the files were copied without an installation
    __version__ = "0+unknown"

# Threads of OpenBLAS sleep after 2^20 cycles, because the default of 2^26 cycles keeps cores busy for 20 ms.
# OpenBLAS reads this variable when numpy is first imported.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "20")

_HOME = {
    name: module
    for module, names in {
        "dsfab.app.editor.notebook": "edit",
        "dsfab.core.errors": "DsfabError",
        "dsfab.design": "Design revise run",
        "dsfab.design.output": "to_build123d write",
        "dsfab.preset.file": "load_preset",
        "dsfab.preset.model": "Diffusion Export Fabrication Pattern Preset Slicing Statics Thickening",
        "dsfab.preset.proposal": "preset_for",
        "dsfab.render.design_picture": "inline_picture",
        "dsfab.render.previewer": "Previewer",
        "dsfab.report.design.save": "save",
        "dsfab.slicing": "Sheet",
        "dsfab.study": "compare sized_design sweep",
        "dsfab.surface": (
            "All Ball Boundary Box Brush Cladding ClosedCurves Combination Facing Force Line LoadCase Nearest "
            "PatternRegion PlanPolygon Pressure SelfWeight Side Snow Support Surface Vertices Wind read_surface"
        ),
        "dsfab.thickening": "Solid",
    }.items()
    for name in names.split()
}
"""Module of each public name; dsfab imports the module at the first use of the name."""

__all__ = sorted(_HOME)

if TYPE_CHECKING:
    from dsfab.app.editor.notebook import edit as edit
    from dsfab.core.errors import DsfabError as DsfabError
    from dsfab.design import Design as Design
    from dsfab.design import revise as revise
    from dsfab.design import run as run
    from dsfab.design.output import to_build123d as to_build123d
    from dsfab.design.output import write as write
    from dsfab.preset.file import load_preset as load_preset
    from dsfab.preset.model import Diffusion as Diffusion
    from dsfab.preset.model import Export as Export
    from dsfab.preset.model import Fabrication as Fabrication
    from dsfab.preset.model import Pattern as Pattern
    from dsfab.preset.model import Preset as Preset
    from dsfab.preset.model import Slicing as Slicing
    from dsfab.preset.model import Statics as Statics
    from dsfab.preset.model import Thickening as Thickening
    from dsfab.preset.proposal import preset_for as preset_for
    from dsfab.render.design_picture import inline_picture as inline_picture
    from dsfab.render.previewer import Previewer as Previewer
    from dsfab.report.design.save import save as save
    from dsfab.slicing import Sheet as Sheet
    from dsfab.study import compare as compare
    from dsfab.study import sized_design as sized_design
    from dsfab.study import sweep as sweep
    from dsfab.surface import All as All
    from dsfab.surface import Ball as Ball
    from dsfab.surface import Boundary as Boundary
    from dsfab.surface import Box as Box
    from dsfab.surface import Brush as Brush
    from dsfab.surface import Cladding as Cladding
    from dsfab.surface import ClosedCurves as ClosedCurves
    from dsfab.surface import Combination as Combination
    from dsfab.surface import Facing as Facing
    from dsfab.surface import Force as Force
    from dsfab.surface import Line as Line
    from dsfab.surface import LoadCase as LoadCase
    from dsfab.surface import Nearest as Nearest
    from dsfab.surface import PatternRegion as PatternRegion
    from dsfab.surface import PlanPolygon as PlanPolygon
    from dsfab.surface import Pressure as Pressure
    from dsfab.surface import SelfWeight as SelfWeight
    from dsfab.surface import Side as Side
    from dsfab.surface import Snow as Snow
    from dsfab.surface import Support as Support
    from dsfab.surface import Surface as Surface
    from dsfab.surface import Vertices as Vertices
    from dsfab.surface import Wind as Wind
    from dsfab.surface import read_surface as read_surface
    from dsfab.thickening import Solid as Solid


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'dsfab' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
