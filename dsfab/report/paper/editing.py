"""The paper's figure of its editor: frequency and thickness of one pattern changed, and frames a second."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from typing import Any

from dsfab.errors import DsfabError
from dsfab.pipeline import Design
from dsfab.report.paper import drawing
from dsfab.report.paper.drawing import PaperComparison, PaperPicture, previewer_of, save_picture

CHANGES: Mapping[str, Mapping[str, Any]] = {
    "As the preset says": {},
    "Both frequencies 25": {"pattern.major.frequency": 25.0, "pattern.minor.frequency": 25.0},
    "Both thresholds -0.4: wider": {"pattern.major.threshold": -0.4, "pattern.minor.threshold": -0.4},
}
"""What is shown of the same modes."""

FRAMES = 24
"""Changes of a frequency that are drawn; the first two prepare what is drawn with."""
PAPER = 37
"""Frames a second that the paper tells of its editor, on a laptop of 2015."""


def edited(design: Design, folder: Path) -> PaperComparison:
    """Pictures of one pattern under other numbers, and frames a second while they change, as the paper tells of Bob."""
    title = "Frequency and thickness, edited"
    try:
        with previewer_of(design) as previewer:
            row = []
            for number, (name, changes) in enumerate(CHANGES.items(), 1):
                previewer.set(changes)
                file = f"{design.preset.name}-edited-{number}.webp"
                save_picture(previewer.picture(drawing.SMALL, quality=drawing.LIGHT, words=False), folder / file)
                row.append(PaperPicture(file, name, size=drawing.SMALL))
                previewer.display(design.preset)

            def change(number: int) -> None:
                previewer.set({"pattern.major.frequency": design.preset.pattern.major.frequency + 0.1 * number})
                previewer.frame(drawing.LARGE)

            rate, renderer = frames_a_second(change), previewer.renderer
    except DsfabError as error:
        return PaperComparison(title, f"Nothing can be drawn: {error}.", ())
    words = (
        "A slider changes a few numbers of the pattern and solves nothing anew. Each change was drawn whole, "
        f"{rate:.3g} times a second by the clock, at {drawing.LARGE[0]} by {drawing.LARGE[1]} pixels, of "
        f"{design.surface.m:,} triangles, by {renderer}. The paper tells {PAPER}, on a graphics card; `dsfab edit bob` "
        "opens the editor, and `dsfab bench --preview` counts more sizes on your machine."
    )
    return PaperComparison(title, words, (tuple(row),))


def frames_a_second(change: Callable[[int], None]) -> float:
    """How often something is changed and drawn: by the median of `FRAMES` times, but for the first two."""
    taken = list[float]()
    for number in range(FRAMES):
        begin = time.perf_counter()
        change(number)
        taken.append(time.perf_counter() - begin)
    return 1 / median(taken[2:])
