"""`dsfab compare`: a design against others of the same mass under the same loads."""

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.build import Mesh, Set, Unit, read_preset
from dsfab.app.report import Reporter, mass, out, table

if TYPE_CHECKING:
    from dsfab.study import Comparison


def compare(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    json_: Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON instead of a table.")] = False,
) -> int:
    """Compare a design with others of the same mass: a thinner full sheet, and stripes that ignore the stress.

    Each is solved on its own cut mesh under the same loads. The smaller the compliance, the stiffer.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.pipeline import run
    from dsfab.study import compare as compared

    reporter = Reporter(quiet=json_)
    try:
        design = run(read_preset(preset, set_, mesh, unit), reporter)
        reporter("compare", "solving the design and its competitors")
        result = compared(design)
        reporter.done()
    finally:
        reporter.stop()
    out(json.dumps(asdict(result), indent=2) if json_ else _text(result))
    return 0


def _text(result: "Comparison") -> str:
    rows = [
        (rival.name, mass(rival.mass), f"{rival.compliance:.4g}", f"{rival.compliance / result.full.compliance:.2f}")
        for rival in (result.full, result.design, result.thinner, *result.carried)
    ]
    broken = [rival for rival in result.isotropic if rival.error]
    lines = [table(("structure", "mass", "compliance J", "over full"), rows)]
    if broken:
        lines.append(f"{len(broken)} of {len(result.isotropic)} isotropic structures do not carry the loads at all")
    lines.append(
        f"the design is {result.gain:.3g} x as stiff as the best isotropic structure and {result.median_gain:.3g} x as "
        "stiff as the median one, at the same mass"
    )
    lines.append("one solve each on the cut mesh: fit for comparing, not a verdict on safety")
    return "\n".join(lines)
