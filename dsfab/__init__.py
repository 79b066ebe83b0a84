"""dsfab: Diffusion Structures, from a surface, its supports and its loads to a file that a fabricator opens.

    design = dsfab.run(dsfab.load_preset("dome"))
    dsfab.write(design.solid, "dome.step")

Heavy libraries are imported where they are used: `import dsfab` is quick, and so is `dsfab --help`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "Design": "dsfab.design",
    "DsfabError": "dsfab.errors",
    "LoadCase": "dsfab.surface",
    "Previewer": "dsfab.app.previewer",
    "Preset": "dsfab.preset",
    "Sheet": "dsfab.slicing",
    "Solid": "dsfab.thickening",
    "Surface": "dsfab.surface",
    "compare": "dsfab.study",
    "edit": "dsfab.app.editor.notebook",
    "inline_picture": "dsfab.app.inline",
    "load_preset": "dsfab.preset_file",
    "read_surface": "dsfab.surface",
    "revise": "dsfab.pipeline",
    "run": "dsfab.pipeline",
    "sweep": "dsfab.study",
    "write": "dsfab.export",
}
"""Where each public name lives; it is imported when first asked for."""

__all__ = sorted(_HOME)

if TYPE_CHECKING:
    from dsfab.app.editor.notebook import edit as edit
    from dsfab.app.inline import inline_picture as inline_picture
    from dsfab.app.previewer import Previewer as Previewer
    from dsfab.design import Design as Design
    from dsfab.errors import DsfabError as DsfabError
    from dsfab.export import write as write
    from dsfab.pipeline import revise as revise
    from dsfab.pipeline import run as run
    from dsfab.preset import Preset as Preset
    from dsfab.preset_file import load_preset as load_preset
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
