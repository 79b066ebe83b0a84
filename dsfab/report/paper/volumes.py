"""The paper's claim, tested: on a sphere, the compliance of diffusion structures and isotropic ones over mass."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dsfab.pipeline import Design, Progress
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
ROW = {
    "pattern.method": "modes",
    "pattern.keep": 0.0,
    "pattern.fillet": 0.0,
    "pattern.width": {"rule": "plain", "solid_fraction": 0.5},
    "pattern.major": {"mode": 1, "frequency": 10.0, "phase": 0.0},
    "pattern.minor": {"mode": 1, "frequency": 10.0, "phase": 0.0},
}
"""Table 1's row of the sphere as it stands: nothing kept, plain widths, no phase tuned; but labelled by sign, for by
magnitude it carries nothing."""
SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Of the surface that is kept."""


def sphere_volumes(folder: Path, progress: Progress, coarser: float = 1.0, shares: Sequence[float] = SHARES) -> None:
    """Write the data and the chart: the graded design, isotropic ones and a thinner sheet, and the `sphere_rivals`.

    coarser : edges this many times as long as the preset's own.
    """
    from dsfab.study import compare_at

    graded = sphere_draft(ON_MODES, coarser)
    others = sphere_rivals(coarser)
    rows: list[dict[str, Any]] = []
    for share in shares:
        progress("volumes", f"{share:.0%} of the sphere")
        found = compare_at(graded, share, ("isotropic", "thinner")).record()["competitors"]
        rows += [{"volume": share, **row} for row in (*found, *rival_rows(others, share, found[1]["compliance_J"]))]
    told = {"preset": PRESET, "vertices": graded.surface.n, "competitors": rows}
    (folder / f"{NAME}.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    write_chart(rows, "Sphere held at one pole and pressed at the other", folder / NAME)


def sphere_draft(changes: Mapping[str, Any], coarser: float = 1.0) -> Design:
    """The sphere with these changes, up to its pattern."""
    from dsfab.pipeline import draft
    from dsfab.preset_file import load_preset, overridden

    preset = load_preset(PRESET, dict(changes))
    return draft(overridden(preset, {"surface.edge": coarser * getattr(preset.surface, "edge", 0.0)}))


def sphere_rivals(coarser: float = 1.0) -> dict[str, Design]:
    """By name: the graded design with plain widths, Table 1's row as it stands, and evenly spaced stripes."""
    plain = {**ON_MODES, "pattern.width": {"solid_fraction": 0.5}}
    return {name: sphere_draft(how, coarser) for name, how in (("plain", plain), ("row", ROW), ("stripes", {}))}


def rival_rows(rivals: Mapping[str, Design], share: float, design: float | None) -> list[dict[str, Any]]:
    """What `compare_at` tells of each with this share of the surface.

    design : joules of the design that all are compared with; None where it does not carry its loads.
    """
    from dsfab.study import compare_at

    rows = []
    for name, made in rivals.items():
        row = {**compare_at(made, share, ()).record()["competitors"][1], "name": name}
        own = row["compliance_J"]
        rows.append({**row, "ratio_to_design": own / design if own and design else None})
    return rows
