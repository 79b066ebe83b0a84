"""The comparisons that the paper draws: towards a truss, the anisotropy, stripes of the von Mises stress, Bob."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.diffusion import Modes
from dsfab.errors import DsfabError
from dsfab.pipeline import draft
from dsfab.pipeline.design import Design
from dsfab.preset_file import overridden
from dsfab.report.paper.drawing import PaperPicture, paper_picture
from dsfab.results import DiffusionResult
from dsfab.study.baselines.striped import as_mode
from dsfab.study.integration import integrated_design

RATIOS = (1.0, 10.0, 100.0)
"""The anisotropies that are compared."""


@dataclass(frozen=True, eq=False)
class PaperComparison:
    """Pictures side by side, in rows, as the paper compares them."""

    title: str
    words: str
    rows: tuple[tuple[PaperPicture, ...], ...]


def comparisons(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> list[PaperComparison]:
    """The comparisons that the paper draws on this figure; pictures that are there already are shown again."""
    name = design.preset.name
    if name == "hanging_bar":
        return [_michell(design, shown), _ratios(design, folder)]
    if name == "sphere":
        return [_one_family(design, folder, shown)]
    if name == "bridge":
        return [_earlier(design, folder, shown)]
    if name == "bob":
        words = "What the statics find on Bob: the stress gathers between the head and the feet."
        again = tuple(shown[file] for file in ("bob-loads.webp", "bob-vonmises.webp") if file in shown)
        return [PaperComparison("Bob under his load", words, (again,))]
    return []


def _michell(design: Design, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    """From the principal directions to a truss: the two families, the gradients that they lie across, and both."""
    name = design.preset.name
    rows = (("directions", "structure"), ("major-mode", "major"), ("minor-mode", "minor"))
    pictures = (tuple(shown[file] for one in row if (file := f"{name}-{one}.webp") in shown) for row in rows)
    told = "what is kept cannot be cut"
    with suppress(DsfabError):
        found = design.quality(symmetry=False)
        told = (
            f"members lie {found.deviation:.1f} degrees off the principal directions in the mean, of the family that "
            f"is further off, and cross at {found.crossing_angle:.0f} degrees or more"
        )
    words = (
        "In the stiffest frame of so much material each member lies along a principal direction of the stress, and the "
        "families cross at right angles [Michell 1904]. Stripes lie across the gradient of their mode, so modes whose "
        f"gradients follow the directions give such a frame. Here {told}."
    )
    return PaperComparison("Towards the Michell truss", words, tuple(pictures))


def _ratios(design: Design, folder: Path) -> PaperComparison:
    """The same design with little and much anisotropy."""
    rows = []
    for show, name in (("major_mode", "major mode 1"), ("minor_mode", "minor mode 1"), ("structure", "structure")):
        row = []
        for r in RATIOS:
            other = draft(overridden(design.preset, {"diffusion.r": r}), old=design)
            row.append(paper_picture(other, folder, show, f"r{r:g}-{design.preset.name}", f"r = {r:g}, {name}"))
        rows.append(tuple(row))
    words = (
        "With r = 1 the stress is not heard and both families have the same modes; the larger r, the closer modes, "
        "and with them stripes, keep to the principal directions."
    )
    return PaperComparison("The effect of the anisotropy r", words, tuple(rows))


def _earlier(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    """The same number of stripes by diffusion, and by a direction on every face and one field over all of them."""
    name = design.preset.name
    other = integrated_design(design)
    rows = []
    for show, title in (("major", "Major stripes"), ("minor", "Minor stripes"), ("structure", "Structure")):
        drawn = paper_picture(other, folder, show, f"{name}-integrated", f"{title}, integrated")
        rows.append(tuple(one for one in (shown.get(f"{name}-{show}.webp"), drawn) if one))
    words = (
        "Earlier methods choose a direction on every face and integrate one field over all of them. Where directions "
        "part or turn round a point no choice is right everywhere: stripes are squeezed, break off, or run askew. "
        f"Diffusion makes no choice. Measured on both: by diffusion {_regular(design)}; integrated {_regular(other)}."
    )
    return PaperComparison("Beside earlier work: one integrated field", words, tuple(rows))


def _regular(design: Design) -> str:
    try:
        found = design.quality(symmetry=False)
    except DsfabError as error:
        return f"nothing can be measured ({error})"
    major, minor = found.major, found.minor
    return (
        f"members lie {major.deviation:.0f} and {minor.deviation:.0f} degrees off the stress (major and minor, in the "
        f"mean), cross at {found.crossing_angle:.0f} degrees or more, P95/P5 of their spacing is {major.evenness:.1f} "
        f"and {minor.evenness:.1f}, and {found.dead_ends} ends lie in the air"
    )


def _one_family(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    """Stripes along the von Mises stress, between those of the two families."""
    value = as_mode(design.surface, design.statics.answers.stress.largest)
    modes = Modes(np.zeros(1), value[:, None])
    changed = overridden(design.preset, {"pattern.major.mode": 1, "pattern.minor.mode": 1})
    along = DiffusionResult(design.diffusion.tensors, modes, modes)
    kept: dict[str, Any] = {"surface": design.surface, "statics": design.statics, "pattern": design.pattern}
    striped = Design.known(changed, diffusion=along, **kept)
    name = design.preset.name
    field = shown.get(f"{name}-vonmises.webp")
    stripes = paper_picture(striped, folder, "major", f"{name}-vonmises", "Stripes along the von Mises stress")
    pairs = [tuple(shown.get(f"{name}-{family}{end}.webp") for end in ("-mode", "")) for family in ("major", "minor")]
    columns = (pairs[0], (field, stripes), pairs[1])
    rows = tuple(tuple(one for column in columns if (one := column[i])) for i in range(2))
    words = (
        "Stripes of the same frequency along the von Mises stress, a single field: it hardly changes away from the "
        "poles, and neither do its stripes. The families of the diffusion give rings and meridians everywhere."
    )
    return PaperComparison("Why not stripes along the von Mises stress?", words, rows)
