"""The paper's claim, tested: on a sphere, the compliance of diffusion structures and isotropic ones over mass."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dsfab.pipeline.log import Progress
from dsfab.report.comparison_chart import write_chart

NAME = "sphere_volumes"
"""Of the files: .json, .svg and .png."""

PRESET = "sphere_graded"
ON_MODES = {
    "pattern.method": "modes",
    "pattern.fillet": 0.0,
    "pattern.width": {"rule": "graded", "q": 1.0, "solid_fraction": 0.5},
    "pattern.major": {"mode": 1, "frequency": 14.0, "phase": 0.875},
    "pattern.minor": {"mode": 3, "frequency": 14.0, "phase": 0.5625},
}
"""The claim is one about stripes on modes; the phases were found by "auto"."""
SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Of the surface that is kept."""


def sphere_volumes(folder: Path, progress: Progress, coarser: float = 1.0, shares: Sequence[float] = SHARES) -> None:
    """Write the data and the chart: the graded design, the same with plain widths, isotropic ones and a thinner sheet.

    coarser : edges this many times as long as the preset's own.
    """
    from dsfab.pipeline import draft
    from dsfab.preset_file import load_preset, overridden
    from dsfab.study import compare_at

    preset = load_preset(PRESET, ON_MODES)
    graded = draft(overridden(preset, {"surface.edge": coarser * getattr(preset.surface, "edge", 0.0)}))
    plain = draft(overridden(graded.preset, {"pattern.width": {"solid_fraction": 0.5}}), old=graded)
    rows: list[dict[str, Any]] = []
    for share in shares:
        progress("volumes", f"{share:.0%} of the sphere")
        found = compare_at(graded, share, ("isotropic", "thinner")).record()["competitors"]
        other = compare_at(plain, share, ()).record()["competitors"][1]
        rows += [{"volume": share, **row} for row in (*found, {**other, "name": "plain"})]
    told = {"preset": PRESET, "vertices": graded.surface.n, "competitors": rows}
    (folder / f"{NAME}.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    write_chart(rows, "Sphere held at one pole and pressed at the other", folder / NAME)
