"""Test of a claim by Madan et al. on a sphere."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsfab.design import Design, Progress
from dsfab.report.compliance.figures import write_chart

if TYPE_CHECKING:
    from dsfab.study.judges import Judge

NAME = "sphere_volumes"  # Name of three files: .json, .svg and .png.
PRESET = "sphere_graded"
EDGE = 0.08  # Edge length of the mesh, metres; a finer mesh would exceed the memory.
MEMORY = 9e9  # Bytes of memory that a verdict may use.
ON_MODES = {
    "pattern.method": "modes",
    "pattern.width": {"rule": "graded", "q": 1.0, "solid_fraction": 0.5},
    "pattern.major": {"mode": 1, "frequency": 14.0, "phase": 0.875},
    "pattern.minor": {"mode": 3, "frequency": 14.0, "phase": 0.5625},
}
"""Settings of a design with graded stripes on eigenmodes; a search (`phase = "auto"`) chose the phases."""
ROW = {
    "pattern.method": "modes",
    "pattern.keep": 0.0,
    "pattern.width": {"rule": "plain", "solid_fraction": 0.5},
    "pattern.major": {"mode": 1, "frequency": 10.0, "phase": 0.0},
    "pattern.minor": {"mode": 1, "frequency": 10.0, "phase": 0.0},
}
"""Settings of the sphere in Table 1 of Madan et al., without kept regions. The stress sign labels the families."""
LETTER = {**ROW, "diffusion.labelling": "magnitude", "statics.law": "stvk"}  # labelling and elastic law of Madan et al.
SHARES = (0.3, 0.5, 0.7)  # Shares of material; each run takes minutes.

RIVALS = {
    "letter": "Table 1 of Madan et al., families assigned by the magnitude of the stress",
    "row": "Table 1 of Madan et al., families assigned by the sign of the stress",
    "plain": "tuned modes and phases, plain widths",
    "design": "tuned modes and phases, graded widths",
    "stripes": "dsfab's evenly spaced stripes",
    "isotropic": "best pair of isotropic modes",
    "thinner": "whole sheet, uniformly thinner",
    "full": "whole sheet, uncut (heavier)",
}
"""Names of all structures in the chart of `sphere_volumes`."""


def sphere_volumes(folder: Path, progress: Progress, coarser: float = 1.0, shares: Sequence[float] = SHARES) -> None:
    """Write data and a chart that compare the compliance of structures on a sphere.
    coarser : length of mesh edges / `EDGE`.    shares : shares of the surface that are material."""
    from dsfab.study import compare_at, full_at_many_shares

    graded = sphere_draft(ON_MODES, coarser)
    rivals, judge = sphere_rivals(coarser), full_at_many_shares(MEMORY)
    rows: list[dict[str, Any]] = []
    for share in shares:
        progress("volumes", f"{share:.0%} of the sphere")
        competitors = compare_at(graded, share, ("isotropic", "thinner"), judge).record()["competitors"]
        compliance = competitors[1]["compliance_J"]
        rows += [{"volume": share, **row} for row in (*competitors, *rival_rows(rivals, share, compliance, judge))]
    contents = {"preset": PRESET, "vertices": graded.surface.n, "competitors": rows}
    (folder / f"{NAME}.json").write_text(json.dumps(contents, indent=1) + "\n", encoding="utf-8")
    write_chart(rows, "Sphere held at one pole and pressed at the other", folder / NAME, RIVALS)


def sphere_draft(changes: Mapping[str, Any], coarser: float = 1.0) -> Design:
    """Return the sphere's design up to the pattern. changes : changed settings.    coarser : mesh edge / `EDGE`."""
    from dsfab.design import draft
    from dsfab.preset.file import load_preset, with_overrides

    preset = load_preset(PRESET, {"pattern.fillet": 0.0, **changes})
    return draft(with_overrides(preset, {"surface.edge": coarser * EDGE}))


def sphere_rivals(coarser: float = 1.0) -> dict[str, Design]:
    """Return designs `plain`, `row`, `letter`, `stripes` of the sphere. coarser : length of mesh edges / `EDGE`."""
    plain_widths = {**ON_MODES, "pattern.width": {"solid_fraction": 0.5}}
    settings: dict[str, Mapping[str, Any]] = {"plain": plain_widths, "row": ROW, "letter": LETTER, "stripes": {}}
    return {name: sphere_draft(changes, coarser) for name, changes in settings.items()}


def rival_rows(
    rivals: Mapping[str, Design], share: float, design: float | None, judge: "Judge"
) -> list[dict[str, Any]]:
    """Return a row of results for each of the designs `rivals`. share : share of the surface that is material.
    design : compliance of the reference design, J, or None."""
    from dsfab.study import compare_at

    rows = []
    for name, rival in rivals.items():
        row = {**compare_at(rival, share, (), judge).record()["competitors"][1], "name": name}
        compliance = row["compliance_J"]
        rows.append({**row, "ratio_to_design": compliance / design if compliance and design else None})
    return rows
