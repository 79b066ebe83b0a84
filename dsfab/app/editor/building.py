"""What the page's Build does: what `dsfab build` does, with its own words for the progress."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsfab.app.build import caption, write_all
from dsfab.app.editor.job import Telling
from dsfab.app.fabrication import fabrication_facts
from dsfab.app.report import Reporter
from dsfab.design import Draft
from dsfab.pipeline import draft, revise, run
from dsfab.preset import Preset


@dataclass(frozen=True)
class Built:
    """The files, those asked for first, and what the page is told about the solid."""

    files: list[Path]
    facts: dict[str, Any]


class _Telling(Reporter):
    """A reporter that speaks to the page instead of the terminal."""

    def __init__(self, progress: Telling) -> None:
        super().__init__(quiet=True)
        self.progress, self.lines = progress, list[str]()

    def __call__(self, stage: str, doing: str) -> None:
        self.progress(stage, doing)

    def say(self, text: str) -> None:
        self.lines.append(text)


def built(preset: Preset, old: Draft | None, folder: Path, progress: Telling, picture: bool) -> Built:
    """Make the solid, from the first stage that `old` has not, and write what the command line writes.

    picture : whether it is drawn too.
    Raises DsfabError, of the stage that refuses; a STEP file that is too large is told in `facts` instead.
    """
    from dsfab.study.fabrication import fabrication

    teller = _Telling(progress)
    design = revise(old, preset, teller) if old else run(preset, teller)
    teller("fabrication", "measuring members, gaps and walls")
    made = fabrication_facts(fabrication(design))
    refused = write_all(design, folder, teller, picture, made)
    asked = [folder / f"{preset.name}.{suffix}" for suffix in preset.export.formats]
    first = [path for path in asked if path.exists()]
    rest = sorted(path for path in folder.iterdir() if path not in first)
    facts = {
        "caption": caption(design),
        "mass": design.mass,
        "volume": design.solid.volume,
        "triangles": len(design.solid.F),
        "pieces": design.solid.pieces,
        "refused": refused,
        "notes": [*(note.text for note in design.notes), *teller.lines],
    }
    return Built([*first, *rest], facts)


def drawn(preset: Preset, old: Draft | None, view: str, show: str, size: tuple[int, int], progress: Telling) -> bytes:
    """A PNG picture, drawn here. Raises DsfabError where nothing can be drawn."""
    from PIL import Image

    from dsfab.app import light
    from dsfab.app.fields import asking
    from dsfab.app.previewer import Previewer

    made = draft(asking(preset, show), progress, old)
    progress("preview", "drawing")
    with Previewer(made, view=view, show=show) as previewer:
        pixels = previewer.picture(size, quality=light.QUICK)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG")
    return file.getvalue()
