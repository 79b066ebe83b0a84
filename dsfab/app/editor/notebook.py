"""`dsfab.edit`: the editor in a notebook."""

from pathlib import Path
from typing import TYPE_CHECKING

from dsfab.app.editor.workspace import OpenedPreset, open_preset
from dsfab.core.errors import DsfabError
from dsfab.design import draft
from dsfab.design.design import Design
from dsfab.preset.model import Preset

if TYPE_CHECKING:
    from dsfab.app.editor.widget import Editor


def edit(target: Design | Preset | str | Path = "dome", /, *, height: int = 640) -> "Editor":
    """Open the page of `dsfab edit` as a widget for Jupyter, VS Code and marimo; no data leave this machine.

        editor = dsfab.edit("dome")
        editor                                              # last line of a cell: sliders and the structure
        editor.changes = {"pattern.major.frequency": 12.0}  # the page follows; sliders set this, too
        design = dsfab.run(editor.preset)                   # the design on the page

    target : a preset, the name of a shipped preset, the path of a TOML or mesh file, or a solved design or draft.
    height : height of the widget, pixels. Raises DsfabError for another target, and without the package anywidget."""
    try:
        from dsfab.app.editor.widget import Editor
    except ImportError:
        raise DsfabError('the widget needs anywidget; install it with: pip install "dsfab[notebook]"') from None
    if isinstance(target, Design):
        drafted = draft(target.preset, None, target)
        return Editor(OpenedPreset(drafted.preset), drafted, height=height)
    if isinstance(target, str | Path):
        return Editor(open_preset(str(target)), height=height)
    return Editor(OpenedPreset(Design.from_preset(target).preset), height=height)
