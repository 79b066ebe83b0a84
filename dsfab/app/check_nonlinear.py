"""The command `dsfab check DESIGN --nonlinear`: load limit with large displacements, by CalculiX."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.export import built_design, source_of
from dsfab.app.options import Source
from dsfab.app.terminal import Reporter, out, signals_as_interrupts
from dsfab.core.messages import length

if TYPE_CHECKING:
    from dsfab.study import NonlinearCheck


@Parameter(name="*")
@dataclass(frozen=True)
class Nonlinear:
    """Options of the nonlinear check."""

    nonlinear: Annotated[
        bool,
        Parameter(
            negative=(),
            help="Check a preset or built folder in place of a file: load the cut sheet by CalculiX (install ccx "
            "yourself) until it gives way, with large displacements and an imperfection. Takes minutes.",
        ),
    ] = False
    case: Annotated[
        str | None, Parameter(help="The load case or combination [the first combination, else the first case].")
    ] = None
    imperfection: Annotated[
        float | None, Parameter(help="Metres, in the shape of the first buckling [the longest side / 300].")
    ] = None
    check_edge: Annotated[
        float | None,
        Parameter(
            help="Edge of the triangles, metres. If the design's edges are shorter, it is cut again with these, "
            "without fillets; 0: the sheet as it is [the design's, without fillets]."
        ),
    ] = None
    minutes: Annotated[float, Parameter(help="Limit of each of the two or three runs of CalculiX.")] = 60.0


AS_A_FILE = Nonlinear()
"""The check of a file, which is not nonlinear."""


def check_nonlinear(name: str, source: Source, asked: Nonlinear, as_json: bool, quiet: bool) -> int:
    """Check a design and print the result; return 1 if it gives way under less than its loads, else 0."""
    from dsfab.design import Design
    from dsfab.study import nonlinear_check, require_ccx

    require_ccx()
    given, _ = source_of(name, source)
    with Reporter(quiet or as_json) as reporter, signals_as_interrupts():  # so that CalculiX and its files end too
        design = built_design(name, given) or Design.of(given, progress=reporter).until("slicing")
        found = nonlinear_check(design, asked.case, asked.imperfection, asked.minutes, reporter, asked.check_edge)
    if as_json:
        out(json.dumps(facts(found), indent=2))
    elif not quiet:
        for line in lines(found):
            out(line)
    return int(found.given_way and found.limit < 1)


def facts(found: "NonlinearCheck") -> dict[str, Any]:
    """Return the result as numbers in SI units."""
    return {
        "case": found.case,
        "linear_factor": found.linear,
        "limit_factor": found.limit,
        "gives_way": found.given_way,
        "stopped_after_minutes": found.minutes or None,
        "imperfection_m": found.imperfection,
        "displacement_m": found.moved,
        "wedges": found.triangles,
        "edge_m": found.edge,
        "path": {"factor": found.load.tolist(), "largest_displacement_m": found.u.tolist()},
    }


def lines(found: "NonlinearCheck") -> Iterator[str]:
    """Yield the result as text."""
    yield found.told
    at = "under its load" if found.limit >= 1 or not found.given_way else "where it gives way"
    yield f"largest displacement {at}: {length(found.moved)}; the material stays elastic here, whatever its strength"
    chosen = range(0, len(found.load), max(len(found.load) // 10, 1))
    yield "  times its load  " + "  ".join(f"{found.load[k]:>8.3g}" for k in chosen)
    yield "  moves           " + "  ".join(f"{length(float(found.u[k])):>8}" for k in chosen)
