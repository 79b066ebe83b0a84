"""What a workshop opens: `nest.dxf`, a DXF and an SVG for each part to cut, and `cutlist.csv`, in one folder."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from dsfab.export import check_flat_dxf, flat_dxf, flat_svg, whole_or_nothing, write_chunks
from dsfab.units import MM_PER_M
from dsfab.workshop.drawings import nest_drawing, part_drawing
from dsfab.workshop.plan import WorkshopPlan

NEST, CUTLIST = "nest", "cutlist.csv"
HEAD = (
    *("part", "count", "same_as_it", "member", "length_mm", "width_mm", "thickness_mm", "area_m2", "holes", "layer_mm"),
    *("strain", "sheets", "file"),
)


def write_workshop(plan: WorkshopPlan, folder: Path, name: str) -> Path:
    """Write the files of a plan into a folder, all of them or none. Those of an earlier plan that this one does not
    have are removed, as its cut list names them. The same plan gives the same bytes.

    Raises ExportError where the folder cannot be written.
    """
    with whole_or_nothing(folder, _outdated) as partial:
        nest = nest_drawing(plan, name)
        write_chunks(partial / f"{NEST}.dxf", [flat_dxf(nest)])
        check_flat_dxf(nest, partial / f"{NEST}.dxf")
        write_chunks(partial / f"{NEST}.svg", [flat_svg(nest)])
        for group in plan.same:
            part = plan.parts[group[0]]
            drawing = part_drawing(part)
            write_chunks(partial / f"{file_stem(part.id)}.dxf", [flat_dxf(drawing)])
            write_chunks(partial / f"{file_stem(part.id)}.svg", [flat_svg(drawing)])
        write_chunks(partial / CUTLIST, [cut_list(plan).encode()])
    return folder


def file_stem(part: str) -> str:
    """The name of a part as that of a file."""
    return part.replace(" ", "_").replace("/", "_")


def cut_list(plan: WorkshopPlan) -> str:
    """CSV, a row for each part that differs from all others: how often it is cut, and as which parts. Millimetres."""
    where = {one.part.id: k for k, sheet in enumerate(plan.sheets, 1) for one in sheet.parts}
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(HEAD)
    for group in plan.same:
        part, names = plan.parts[group[0]], [plan.parts[k].id for k in group]
        a, b = (MM_PER_M * part.size).round(1).tolist()
        sheets = sorted({where[one] for one in names})
        writer.writerow(
            (part.id, len(names), " ".join(x.replace(" ", "_") for x in names[1:]), part.member, a, b)
            + (round(MM_PER_M * plan.thickness, 3), round(part.area, 4), len(part.holes))
            + (round(MM_PER_M * part.layer, 3), f"{part.strain:.2e}", " ".join(map(str, sheets)))
            + (f"{file_stem(part.id)}.dxf",)
        )
    return text.getvalue()


def _outdated(target: Path, partial: Path) -> set[str]:
    """Files that the cut list of an earlier plan names, or that go with it, and that are not written again."""
    try:
        with open(target / CUTLIST, encoding="utf-8", newline="") as file:
            named = {row["file"] for row in csv.DictReader(file)}
    except (OSError, ValueError, KeyError):
        return set()
    names = {name for name in named if name == Path(name).name} if None not in named else set()
    return set(_with_svg(names)) - {path.name for path in partial.iterdir()}


def _with_svg(names: set[str]) -> Iterator[str]:
    for name in names:
        yield name
        yield Path(name).with_suffix(".svg").name
