"""dsfab: Diffusion Structures, from a surface, its supports and its loads to a file that a fabricator opens.

    preset = dsfab.load_preset("dome", {"surface.edge": 0.6})   # a shipped one, or a TOML file of yours
    design = dsfab.run(preset)                                   # all of its stages; shown as a picture in a notebook
    design.write("dome.step")                                    # one file: step, stl, 3mf, dxf, ...
    design.save("outputs/dome")                                  # everything that `dsfab build` writes

    dsfab.revise(design, another)     the next design: only what has changed is made again
    dsfab.sweep(preset, ...)          many designs, and what is measured of each
    dsfab.compare(design)             beside others of the same mass
    dsfab.edit(preset)                in a notebook, changed by hand
    dsfab.Surface(V, F)               a mesh of your own;  dsfab.read_surface("roof.obj", "m")

Heavy libraries are imported where they are used: `import dsfab` is quick, and so is `dsfab --help`.
"""

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from dsfab import ways_out

__version__ = "0.1.0"

_HOME = {
    "Design": "dsfab.pipeline",
    "DsfabError": "dsfab.errors",
    "LoadCase": "dsfab.surface",
    "Previewer": "dsfab.render.previewer",
    "Preset": "dsfab.preset",
    "Sheet": "dsfab.slicing",
    "Solid": "dsfab.thickening",
    "Surface": "dsfab.surface",
    "compare": "dsfab.study",
    "edit": "dsfab.app.editor.notebook",
    "inline_picture": "dsfab.render.notebook",
    "load_preset": "dsfab.preset_file",
    "read_surface": "dsfab.surface",
    "revise": "dsfab.pipeline",
    "run": "dsfab.pipeline",
    "save": "dsfab.report.design.save",
    "sweep": "dsfab.study",
    "to_build123d": "dsfab.delivery",
    "write": "dsfab.delivery",
}
"""Where each public name lives; it is imported when first asked for."""

__all__ = sorted(_HOME)

if TYPE_CHECKING:
    from dsfab.app.editor.notebook import edit as edit
    from dsfab.delivery import to_build123d as to_build123d
    from dsfab.delivery import write as write
    from dsfab.errors import DsfabError as DsfabError
    from dsfab.pipeline import Design as Design
    from dsfab.pipeline import revise as revise
    from dsfab.pipeline import run as run
    from dsfab.preset import Preset as Preset
    from dsfab.preset_file import load_preset as load_preset
    from dsfab.render.notebook import inline_picture as inline_picture
    from dsfab.render.previewer import Previewer as Previewer
    from dsfab.report.design.save import save as save
    from dsfab.slicing import Sheet as Sheet
    from dsfab.study import compare as compare
    from dsfab.study import sweep as sweep
    from dsfab.surface import LoadCase as LoadCase
    from dsfab.surface import Surface as Surface
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


def _public(name: str, /, *arguments: Any, **options: Any) -> Any:
    """What the public function of that name returns."""
    return __getattr__(name)(*arguments, **options)


for _name in ("inline_picture", "save", "to_build123d", "write"):
    ways_out.opened(_name, partial(_public, _name))
