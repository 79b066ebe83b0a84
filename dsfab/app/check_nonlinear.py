"""The command `dsfab check DESIGN --nonlinear`, which finds the load limit of a design by CalculiX."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.export import built_design, preset_and_folder
from dsfab.app.options import Source, Switch
from dsfab.app.terminal import ExitCode, Reporter, print_lines, print_result, signals_as_interrupts
from dsfab.core.messages import length

if TYPE_CHECKING:
    from dsfab.study import NonlinearCheck


@Parameter(name="*")
@dataclass(frozen=True)
class Nonlinear:
    """Options of the nonlinear check."""

    nonlinear: Annotated[
        bool,
        Switch(
            help="Check a preset or built folder in place of a file: load the cut sheet by CalculiX (install ccx "
            "yourself) until it gives way, with large displacements and an imperfection. Takes minutes."
        ),
    ] = False
    case: Annotated[
        str | None, Parameter(help="The load case or combination [the first combination, else the first case].")
    ] = None
    imperfection: Annotated[
        float | None,
        Parameter(
            help="Largest imperfection in metres, in the shape of the first buckling mode [the longest side / 300]."
        ),
    ] = None
    check_edge: Annotated[
        float | None,
        Parameter(
            help="Smallest edge length of the triangles, metres. For a design with shorter edges, dsfab cuts a new "
            "sheet without fillets. 0 keeps the sheet of the design, with fillets [edge length of the design, "
            "without fillets]."
        ),
    ] = None
    minutes: Annotated[float, Parameter(help="Time limit for each of the two or three runs of CalculiX.")] = 60.0


LINEAR_FILE_CHECK = Nonlinear()  # Default options, with which `dsfab check` makes no nonlinear analysis.


def check_nonlinear(name: str, source: Source, options: Nonlinear, as_json: bool, quiet: bool) -> int:
    """Find the load limit of the design `name`, print the result, and return the exit code."""
    from dsfab.design import Design
    from dsfab.study import nonlinear_check, require_ccx

    require_ccx()
    preset, _ = preset_and_folder(name, source)
    with Reporter(quiet or as_json) as reporter, signals_as_interrupts():  # a signal must also stop CalculiX
        design = built_design(name, preset) or Design.from_preset(preset, progress=reporter).until("slicing")
        result = nonlinear_check(
            design, options.case, options.imperfection, options.minutes, reporter, options.check_edge
        )
    if as_json:
        print_result(json.dumps(nonlinear_facts(result), indent=2))
    elif not quiet:
        print_lines(nonlinear_lines(result))
    return ExitCode.DOES_NOT_CARRY if result.given_way and result.limit < 1 else ExitCode.DONE


def nonlinear_facts(result: "NonlinearCheck") -> dict[str, Any]:
    """Return the result of a nonlinear check as values for JSON, in SI units."""
    return {
        "case": result.case,
        "linear_factor": result.linear,
        "limit_factor": result.limit or None,
        "gives_way": result.given_way,
        "stopped_after_minutes": result.minutes or None,
        "imperfection_m": result.imperfection if result.linear else None,
        "displacement_m": result.moved if result.linear else None,
        "wedges": result.triangles,
        "edge_m": result.edge,
        "path": {"factor": result.load.tolist(), "largest_displacement_m": result.u.tolist()},
    }


def nonlinear_lines(result: "NonlinearCheck") -> Iterator[str]:
    """Yield the result of a nonlinear check as lines of text."""
    yield result.sentence
    if result.linear is None:
        return
    situation = "under its load" if result.limit >= 1 or not result.given_way else "where it gives way"
    yield (
        f"largest displacement {situation}: {length(result.moved)}; this check assumes elasticity and ignores strength"
    )
    steps = range(0, len(result.load), max(len(result.load) // 10, 1))
    yield "  times its load  " + "  ".join(f"{result.load[k]:>8.3g}" for k in steps)
    yield "  moves           " + "  ".join(f"{length(float(result.u[k])):>8}" for k in steps)
