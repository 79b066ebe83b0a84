"""Several pictures of one design on one page: `--show all`, `--show modes` or names with commas."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dsfab.errors import DsfabError
from dsfab.pipeline.design import Design
from dsfab.pipeline.log import Progress
from dsfab.preset import Preset
from dsfab.render.colouring import MODES, check_show
from dsfab.render.light import FINE, Quality
from dsfab.render.previewer import Previewer
from dsfab.render.scene import Bytes

WORDS = {
    "deflection": ("displacement",),
    "modes": ("major_mode", "minor_mode"),
    "all": (
        *("structure", "families", "loads", "stress", "directions", "vonmises"),
        *("major_mode", "minor_mode", "displacement"),
    ),
}
"""Words that stand for other names of what is shown."""

ASKED = {"utilisation": "strength", "buckling": "buckling", "frequency": "frequencies"}
"""What `all` adds when this key of [statics] asks for it."""


def shows(text: str, preset: Preset) -> tuple[str, ...]:
    """The names in 'structure', 'modes', 'all', 'structure,stress'; raises DsfabError for those that there are not."""
    names: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if word == "all":
            modes = preset.pattern.method != "stripes"  # these run along none
            names += [name for name in WORDS[word] if modes or name not in MODES]
            names += [name for name, key in ASKED.items() if getattr(preset.statics, key)]
        else:
            names += WORDS.get(word, (word,))
    for name in names:
        check_show(name)
    return tuple(dict.fromkeys(names))


def across(count: int) -> int:
    """Pictures in a row: 1, 2, 3 stand side by side, 4 are a square, more have rows of three."""
    return {1: 1, 2: 2, 4: 2}.get(count, 3)


class Panels(NamedTuple):
    """One picture of several, and what is not on it: its name and why."""

    pixels: Bytes
    left_out: tuple[str, ...]


def panels(
    made: Design,
    names: Sequence[str],
    pixels: tuple[int, int],
    progress: Progress,
    quality: Quality = FINE,
    **options: Any,
) -> Panels:
    """One picture with those of all `names`, each `pixels` large; `options` are those of `Previewer`.

    Where loads are a picture of their own, the others are drawn without their arrows, unless `marks` are given.
    What this design has no answer for is left out and told. Raises DsfabError when nothing is left.
    """
    drawn, refused = [], []
    alone = "marks" not in options and "loads" in names
    for name in names:
        progress("preview", f"drawing {name.replace('_', ' ')}")
        try:
            given = {"marks": ("person",)} | options if alone and name != "loads" else options
            with Previewer(made, show=name, **given) as previewer:
                drawn.append(previewer.picture(pixels, quality=quality))
        except DsfabError as error:
            refused.append(f"{name}: {error}")
    if not drawn:
        raise DsfabError(f"nothing can be shown; {'; '.join(refused)}")
    return Panels(_tiled(drawn), tuple(refused))


def _tiled(pictures: Sequence[Bytes]) -> Bytes:
    wide = across(len(pictures))
    empty = np.broadcast_to(pictures[0][:1, :1], pictures[0].shape)
    filled = [*pictures, *(empty for _ in range(-len(pictures) % wide))]
    return np.concatenate([np.concatenate(filled[i : i + wide], axis=1) for i in range(0, len(filled), wide)])
