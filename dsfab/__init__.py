"""dsfab: Diffusion Structures, from a surface, its supports and its loads to a file that a fabricator opens.

    preset = dsfab.load_preset("dome", {"surface.edge": 0.6})   # a shipped one, or a TOML file of yours
    design = dsfab.run(preset)                                   # all of its stages; shown as a picture in a notebook
    design.write("dome.step")                                    # one file: step, stl, 3mf, dxf, ...
    design.save("outputs/dome")                                  # everything that `dsfab build` writes

    dsfab.revise(design, another)     the next design: only what has changed is made again
    dsfab.sweep(preset, ...)          many designs, and what is measured of each
    dsfab.compare(design)             beside others of the same mass
    dsfab.edit(preset)                in a notebook, changed by hand

    roof = dsfab.preset_for(mesh)                    # a mesh of yours, or a file: a sensible preset for it
    roof = dsfab.Preset(                             # or every choice your own
        surface=mesh,                                # yours, metres: trimesh, pyvista, compas, (V, F), or a path
        supports=[dsfab.Support(dsfab.Boundary())],  # or Side, Box, Ball, PlanPolygon, Facing, All ...
        loads=[dsfab.SelfWeight(), dsfab.Snow(800)], # or Cladding, Force, Line, ...; newtons, pascals
        statics={"thickness": 0.05},                 # and pattern=, diffusion=, ..., each key as in TOML
    )
    dsfab.Surface.of(mesh, "mm")      where its numbers are not metres;  dsfab.read_surface("roof.obj", "mm")

Heavy libraries are imported where they are used: `import dsfab` is quick, and so is `dsfab --help`.
"""

import os
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

try:
    __version__ = version("dsfab")  # from the git tag of the installed version
except PackageNotFoundError:  # the files were copied without an installation
    __version__ = "0+unknown"

# Threads of OpenBLAS that wait for work sleep after 2^20 cycles, a third of a millisecond, in place of 2^26: after one
# product of long vectors they kept a core busy for 20 ms. It is read when numpy is loaded, so not where that was loaded
# before.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "20")

_HOME = {
    "All": "dsfab.surface",
    "Ball": "dsfab.surface",
    "Boundary": "dsfab.surface",
    "Box": "dsfab.surface",
    "Brush": "dsfab.surface",
    "Cladding": "dsfab.surface",
    "ClosedCurves": "dsfab.surface",
    "Combination": "dsfab.surface",
    "Design": "dsfab.design",
    "Diffusion": "dsfab.preset.model",
    "DsfabError": "dsfab.core.errors",
    "Export": "dsfab.preset.model",
    "Fabrication": "dsfab.preset.model",
    "Facing": "dsfab.surface",
    "Force": "dsfab.surface",
    "Line": "dsfab.surface",
    "LoadCase": "dsfab.surface",
    "Nearest": "dsfab.surface",
    "Pattern": "dsfab.preset.model",
    "PatternRegion": "dsfab.surface",
    "PlanPolygon": "dsfab.surface",
    "Preset": "dsfab.preset.model",
    "Pressure": "dsfab.surface",
    "Previewer": "dsfab.render.previewer",
    "SelfWeight": "dsfab.surface",
    "Sheet": "dsfab.slicing",
    "Side": "dsfab.surface",
    "Slicing": "dsfab.preset.model",
    "Snow": "dsfab.surface",
    "Solid": "dsfab.thickening",
    "Statics": "dsfab.preset.model",
    "Support": "dsfab.surface",
    "Surface": "dsfab.surface",
    "Thickening": "dsfab.preset.model",
    "Vertices": "dsfab.surface",
    "Wind": "dsfab.surface",
    "compare": "dsfab.study",
    "edit": "dsfab.app.editor.notebook",
    "inline_picture": "dsfab.render.design_picture",
    "load_preset": "dsfab.preset.file",
    "preset_for": "dsfab.preset.proposal",
    "read_surface": "dsfab.surface",
    "revise": "dsfab.design",
    "run": "dsfab.design",
    "save": "dsfab.report.design.save",
    "sweep": "dsfab.study",
    "to_build123d": "dsfab.design.output",
    "write": "dsfab.design.output",
}
"""Where each public name lives; it is imported when first asked for."""

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
