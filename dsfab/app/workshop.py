"""`dsfab workshop`: the members of a design as flat parts, nested on the stock."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.export import built_design, source_of
from dsfab.app.options import UNCHANGED, Quiet, Source
from dsfab.app.terminal import Reporter, out
from dsfab.wording import length

if TYPE_CHECKING:
    from dsfab.workshop import WorkshopPlan


def workshop(
    preset: str,
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME/workshop].")
    ] = None,
    source: Source = UNCHANGED,
    quiet: Quiet = False,
) -> int:
    """Cut a design from sheets: flat parts with holes and names, nested on the stock, as DXF, SVG and a cut list.

    What is possible and what is not is told first, in numbers. Stock, thickness, bolts and gap are those of [workshop].

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    """
    from dsfab.pipeline import Design
    from dsfab.report.assembly import assembly_page, assembly_pdf
    from dsfab.workshop import workshop_plan, write_workshop

    given, folder = source_of(preset, source)
    reporter = Reporter(quiet)
    try:
        design = built_design(preset, given) or Design.of(given, progress=reporter).until("slicing")
        reporter("export", "developing and nesting")
        plan = workshop_plan(design)
        documents = {"assembly.pdf": assembly_pdf(plan, design)}
        if plan.graph is not None:
            documents["index.html"] = assembly_page(plan, design).encode()
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        for note in plan.notes:
            out(note)
    where = write_workshop(plan, output or folder / "workshop", given.name, documents)
    if not quiet:
        kinds = len(plan.same)
        parts, sheets = (f"{n} {word}{'' if n == 1 else 's'}" for n, word in _counted(plan))
        out(f"{parts} of {length(plan.thickness)}, {kinds} different; {sheets}, {plan.used:.0%} used")
        out(f"  {where / 'nest.dxf'}  {where / 'cutlist.csv'}  and a .dxf and an .svg for each different part")
        out("  ".join(["", *(str(where / name) for name in ("cutlist.xlsx", *documents))]))
    return 0


def _counted(plan: "WorkshopPlan") -> tuple[tuple[int, str], tuple[int, str]]:
    return (len(plan.parts), "part"), (len(plan.sheets), "sheet")
