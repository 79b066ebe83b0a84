"""The command `dsfab workshop`: the members of a design as flat parts on sheets of stock."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.export import built_design, preset_and_folder
from dsfab.app.options import UNCHANGED, OutputName, Quiet, Source, Switch
from dsfab.app.terminal import Reporter, print_lines, print_result
from dsfab.core.errors import PatternError, PresetError
from dsfab.core.messages import length
from dsfab.core.units import METRES_PER

if TYPE_CHECKING:
    from dsfab.design import Design
    from dsfab.preset.model import Preset
    from dsfab.workshop import WorkshopPlan


@Parameter(name="*")
@dataclass(frozen=True)
class WorkshopFlags:
    """Options of the flat parts."""

    model: Annotated[
        str | None,
        Parameter(help="Make a model in card at a scale such as 1:50; by default from A3 sheets of card, 1 mm thick."),
    ] = None
    stock: Annotated[
        str | None, Parameter(help="Sheets to cut from: A3, or length and width: 2.5x1.25m, 420x297mm.")
    ] = None
    thickness: Annotated[str | None, Parameter(help="Thickness of one layer: 1mm, 0.012m.")] = None
    ifc: Annotated[bool, Switch(help="Also write members.ifc: each member with its quantities and its drawings.")] = (
        False
    )


PRESET_FLAGS = WorkshopFlags()  # No option is set, so the preset's own values apply.


def workshop(
    preset: str,
    /,
    *,
    output: Annotated[Path | None, OutputName(help="Folder for the files [outputs/NAME/workshop].")] = None,
    flags: WorkshopFlags = PRESET_FLAGS,
    source: Source = UNCHANGED,
    quiet: Quiet = False,
) -> int:
    """Cut a design from sheets: flat parts with holes and names, nested on the stock, as DXF, SVG and a cut list.

    Notes on possible problems come first. [workshop] has stock, thickness, bolts and gap. With --model the parts make a
    card model with a base plate.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote."""
    from dsfab.design import Design
    from dsfab.export import require_writable
    from dsfab.render import up_axis
    from dsfab.workshop import workshop_plan, write_workshop

    loaded, folder = preset_and_folder(preset, options_source(source, flags.model, flags.stock, flags.thickness))
    if flags.ifc:
        _check_ifc(loaded)
    target = output or folder / ("model" if loaded.workshop.model else "workshop")
    require_writable(target)
    with Reporter(quiet) as reporter:
        design = built_design(preset, loaded) or Design.from_preset(loaded, progress=reporter).until("slicing")
        reporter("export", "developing and nesting")
        load = design.load if design.has("statics") else None
        plan = workshop_plan(design, up_axis(design.surface.V, design.surface, load))
        documents = _documents(plan, design, flags.ifc)
    if not quiet:
        print_lines(plan.notes)
    written_folder = write_workshop(plan, target, loaded.name, documents)
    if not quiet:
        _print_files(plan, written_folder, documents)
    return 0


def _documents(plan: "WorkshopPlan", design: "Design", ifc: bool) -> dict[str, bytes]:
    from dsfab.report.assembly import assembly_page, assembly_pdf

    documents = {"assembly.pdf": assembly_pdf(plan, design)}
    if plan.graph is not None:
        documents["index.html"] = assembly_page(plan, design).encode()
    return documents | ({MEMBERS: members_ifc(plan, design)} if ifc else {})


MEMBERS = "members.ifc"  # Name of the file of members for a building model (BIM).


def _check_ifc(preset: "Preset") -> None:
    from dsfab.export import FORMATS

    FORMATS[f".{MEMBERS}"].ready()
    if preset.workshop.model:
        raise PresetError(
            "--ifc needs a structure at full size, but --model makes a card model; leave out --ifc or --model"
        )


def members_ifc(plan: "WorkshopPlan", design: "Design") -> bytes:
    """Return the bytes of an IFC file of the members as flat parts.
    Raises PatternError for a flat design, because its parts belong to no member."""
    from dsfab.design.output import body_details
    from dsfab.export import temporary_folder, write
    from dsfab.thickening import SHIFT
    from dsfab.workshop import built_shapes, drawing_files

    if plan.graph is None:
        raise PatternError(
            "parts of a flat design belong to no member, because dsfab cuts this design as one sheet; leave out "
            "--ifc, or write the members with: dsfab export ... --to members.ifc"
        )
    details = body_details(design)
    details = replace(
        details,
        shapes=built_shapes(plan, details.shapes, SHIFT[design.preset.thickening.side]),
        whole_members=True,  # members cross in different layers, so nodes do not divide members
        drawings=drawing_files(plan),
        measures={**details.measures, "thickness": plan.thickness},
    )
    with temporary_folder("dsfab") as folder:
        sheet = design.sheet.surface
        return write(sheet, Path(folder) / MEMBERS, name=design.preset.name, details=details).read_bytes()


def _print_files(plan: "WorkshopPlan", folder: Path, documents: Mapping[str, bytes]) -> None:
    counts = ((len(plan.parts), "part"), (len(plan.sheets), "sheet"))
    parts, sheets = (f"{n} {word}{'' if n == 1 else 's'}" for n, word in counts)
    thick = sorted({plan.part_thickness(part) for part in plan.parts}, reverse=True)
    shown = " and ".join(length(thickness) for thickness in thick)
    print_result(f"{parts} of {shown}, {len(plan.equal_parts)} different; {sheets}, {plan.used_share:.0%} used")
    if plan.model:
        print_result(f"  {folder / 'sheet_1.dxf'} and .svg{', and so on: each sheet' if len(plan.sheets) > 1 else ''}")
    print_result(
        f"  {folder / 'nest.dxf'}  {folder / 'cutlist.csv'}  and a .dxf file and an .svg file for each different part"
    )
    listed = ("cutlist.xlsx", *(("bars.csv",) if plan.bars else ()), *documents)
    print_result("  ".join(["", *(str(folder / name) for name in listed)]))


CARD_MODEL = {"stock": "[0.42, 0.297]", "prices": "[]", "thickness": "0.001", "bolt": "0.0006", "gap": "0.001"}
"""Values of [workshop] for card: A3 sheets of 1 mm, holes for pins, and the laser's kerf; metres."""
PAPER_SIZES = {
    "A4": (0.297, 0.21),
    "A3": (0.42, 0.297),
    "A2": (0.594, 0.42),
    "A1": (0.841, 0.594),
    "A0": (1.189, 0.841),
}
"""Sizes of sheets of card, metres [ISO 216]."""


def options_source(source: Source, model: str | None, stock: str | None, thickness: str | None) -> Source:
    """Return `source`, changed by --model, --stock and --thickness. Raises PresetError for an invalid value."""
    texts = []
    if model is not None:
        set_values = source.set_values()
        defaults = {key: value for key, value in CARD_MODEL.items() if f"workshop.{key}" not in set_values}
        texts = [f"model={_scale(model):g}", *(f"{key}={value}" for key, value in defaults.items())]
    if stock is not None:
        texts.append("stock=[{:.10g}, {:.10g}]".format(*_stock(stock)))
    if thickness is not None:
        texts.append(f"thickness={_metres(thickness, '--thickness'):.10g}")
    return source.with_overrides(*(f"workshop.{text}" for text in texts))


def _scale(text: str) -> float:
    numerator, colon, scale = text.rpartition(":")
    try:
        value = float(scale) / (float(numerator) if colon else 1.0)
    except (ValueError, ZeroDivisionError):
        value = 0.0
    if not 1 <= value < 1e5:
        raise PresetError(f"--model {text!r} is not a scale; write for instance --model 1:50")
    return value


def _stock(text: str) -> tuple[float, float]:
    if text.upper() in PAPER_SIZES:
        return PAPER_SIZES[text.upper()]
    length_, cross, width = text.lower().partition("x")
    if not cross:
        raise PresetError(
            f"--stock {text!r} is not a size of a sheet; write {', '.join(PAPER_SIZES)}, or for instance 2.5x1.25m"
        )
    unit = width.lstrip("0123456789. ") or "m"
    length_ = length_ if length_.strip()[-1:].isalpha() else length_ + unit
    return _metres(length_, "--stock"), _metres(width, "--stock")


def _metres(text: str, option: str) -> float:
    number = text.strip().rstrip("abcdefghijklmnopqrstuvwxyz ")
    unit = text.strip()[len(number) :].strip() or "m"
    try:
        value = float(number) * METRES_PER[unit]
    except (ValueError, KeyError):
        value = 0.0
    if not 0 < value < 1e3:
        raise PresetError(f"{option} {text!r} is not a length; write for instance 1mm, 12mm or 0.012m")
    return value
