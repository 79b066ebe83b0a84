"""The comparisons that the paper draws: towards a truss, the anisotropy, stripes of the von Mises stress, Bob."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.diffusion import Modes
from dsfab.errors import DsfabError
from dsfab.pipeline import Design, draft
from dsfab.preset_file import overridden
from dsfab.report.paper.drawing import PaperComparison, PaperPicture, paper_picture
from dsfab.report.paper.earlier import beside_earlier
from dsfab.report.paper.editing import edited
from dsfab.report.paper.upsampled import upsampled_beside_exact
from dsfab.results import DiffusionResult
from dsfab.study.baselines.striped import as_mode

RATIOS = (1.0, 10.0, 100.0)
"""The anisotropies that are compared."""


def comparisons(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> list[PaperComparison]:
    """The comparisons that the paper draws on this figure; pictures that are there already are shown again."""
    name = design.preset.name
    if name == "hanging_bar":
        return [_michell(design, shown), _ratios(design, folder)]
    if name == "sphere":
        return [_one_family(design, folder, shown), upsampled_beside_exact(design, folder)]
    if name == "bridge":
        return [beside_earlier(design, folder, shown)]
    if name == "bob":
        words = "What the statics find on Bob: the stress gathers between the head and the feet."
        again = tuple(shown[file] for file in ("bob-loads.webp", "bob-vonmises.webp") if file in shown)
        return [PaperComparison("Bob under his load", words, (again,)), edited(design, folder)]
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
