"""The report on members: section forces and utilisation."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError
from dsfab.design import Design
from dsfab.members.eurocode import Utilisation
from dsfab.members.frame import COMPONENTS
from dsfab.preset.file import preset_toml
from dsfab.render import up_axis
from dsfab.report.assembly import assembly_page
from dsfab.report.compliance.figures import (
    BANDS,
    SIZE,
    WHITE,
    ChartImage,
    jpeg,
    lettering,
    png_with_size,
    without_empty_rows,
)
from dsfab.report.compliance.findings import length_or_na, percent, prefixed_unit, round_number_above
from dsfab.report.compliance.sections import reproduction_section
from dsfab.report.design.facts import versions
from dsfab.report.html_pages import (
    Banner,
    Block,
    Bullets,
    CaptionNumbers,
    ColourScale,
    Document,
    Paragraph,
    ReportFigure,
    ReportSection,
    Table,
    escaped_text,
)
from dsfab.report.pdf_pages import write_document
from dsfab.workshop import workshop_plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dsfab.members.frame import MemberForces

UNITS = (*["N"] * 3, *["N m"] * 3)  # Units of the components: three forces, three moments.
DIAGRAM_COMPONENTS = tuple(enumerate(zip(COMPONENTS, UNITS, strict=True)))  # Number, name and unit of each component.
DIAGRAM_WIDTH, DIAGRAM_HEIGHT = 6.8, 0.68  # width and height of a row of diagrams, inches
RISING, FALLING, INK = "#b84f38", "#21508c", "#3a3532"  # colours of positive values, negative values, and lines


def force_diagrams(design: Design, rows: list[tuple[str, str]]) -> ChartImage:
    """Draw diagrams of the section forces along members; return a PNG file. rows : pairs of member and load case."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    across = 3  # a row has diagrams of three forces, and the next row has diagrams of three moments
    lines = len(DIAGRAM_COMPONENTS) // across
    with lettering(**{"font.size": 7.5}):
        layout = ConstrainedLayoutEngine(hspace=0.06, h_pad=0.02)
        figure = Figure(figsize=(DIAGRAM_WIDTH, DIAGRAM_HEIGHT * (lines * len(rows) + 0.4)), layout=layout)
        grid = figure.subplots(lines * len(rows), across, squeeze=False)
        for number, (name, case) in enumerate(rows):
            block = grid[lines * number : lines * (number + 1)]
            forces = design.member_forces[name]
            nodes = [node.at[node.members.index(name)] for node in design.members.nodes_along[name]]
            for axes, (column, (letter, unit)) in zip(block.flat, DIAGRAM_COMPONENTS, strict=True):
                _draw_component(axes, forces, case, (column, letter, unit))
                axes.plot(nodes, np.zeros(len(nodes)), "|", color=INK, ms=4, transform=axes.get_xaxis_transform())
            for axes in block[:-1].flat:
                axes.tick_params(labelbottom=False)
            _add_title(block[0, 0], name, case)
        for axes in grid[-1]:
            axes.set_xlabel("along the member, m")
        return png_with_size(figure)


def _add_title(axes: "Axes", name: str, case: str) -> None:
    above: dict[str, Any] = {"textcoords": "offset points", "va": "bottom", "fontsize": 8.5}
    bold = axes.annotate(name, (0, 1), (0, 10), xycoords="axes fraction", fontweight="bold", **above)
    axes.annotate(case, (1, 0), (6, 0), xycoords=bold, **above)


def _draw_component(axes: "Axes", forces: "MemberForces", case: str, component: tuple[int, str, str]) -> None:
    column, letter, unit = component
    value, least, greatest = forces.forces[case][:, column], *np.moveaxis(forces.envelope[:, column], -1, 0)
    factor, name = prefixed_unit(max(float(np.abs([least, greatest]).max()), 1e-9), unit)
    order = np.argsort(forces.s, kind="stable")
    s, value, least, greatest = forces.s[order], value[order] / factor, least[order] / factor, greatest[order] / factor
    for above, colour in ((True, RISING), (False, FALLING)):
        axes.fill_between(s, 0, value, where=(value >= 0) == above, color=colour, alpha=0.3, lw=0, interpolate=True)
    axes.plot(s, value, color=INK, lw=0.9)
    if len(forces.forces) > 1:
        for edge in (least, greatest):
            axes.plot(s, edge, color="#9a948d", lw=0.6)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set_title(f"{letter}, {name}", fontsize=7.5, loc="right", pad=2)
    axes.margins(x=0.01)
    axes.locator_params(axis="y", nbins=4)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.tick_params(length=2, pad=2)


WORST_COUNT = 10  # Number of members that get a row, a diagram and a name.


def rating_figure(design: Design, number: CaptionNumbers) -> ReportFigure:
    """Draw the structure, coloured by the utilisation of its members."""
    from dsfab.render import band_colours, rated_members_picture

    utilisation = design.member_utilisation
    value = bay_values(design)
    limit = float(np.nanmax(value)) if np.isfinite(value).any() else 1.0
    step = round_number_above(max(limit, 1e-3) / BANDS)
    count = max(2, math.ceil(limit / step - 1e-9))
    band = np.where(np.isnan(value), -1, np.minimum(np.nan_to_num(value) / step, count - 1)).astype(np.int64)
    names = [utilisation.bays.member[bay] for bay in utilisation.worst_bays(WORST_COUNT)]
    labels = [f"{100 * step * k:.4g} %" for k in range(count + 1)]
    caption = number.figure(
        f"Utilisation of each bay (the part of a member between two nodes), in its decisive load case and check. "
        f"Names are shown for the {len(names)} members with the largest utilisation; plates, discs and filled "
        f"openings are not checked and have no colour."
    )
    scale = ColourScale("utilisation; at 100 % the resistance is reached", band_colours(count), labels)
    try:
        pixels = rated_members_picture(design, band, count, names, size=SIZE, palette=WHITE)
    except DsfabError as error:
        return ReportFigure(caption, b"", SIZE, missing=f"no picture: {error}")
    pixels = without_empty_rows(pixels, WHITE.paper)
    return ReportFigure(caption, jpeg(pixels), (pixels.shape[1], pixels.shape[0]), 0.86, scale)


def bay_values(design: Design) -> Floats:
    """Return the utilisation (m,) of the bay that is nearest to each mesh cell; NaN for a cell without a bay.
    A bay is the part of a member between two nodes."""
    graph, utilisation = design.members, design.member_utilisation
    value, samples = np.full(graph.sheet.surface.m, -np.inf), 8  # eight points along a bay
    for name in dict.fromkeys(utilisation.bays.member):
        member = graph.by_id[name]
        bays = [k for k, bay_member in enumerate(utilisation.bays.member) if bay_member == name]
        assert member.axis is not None
        s = np.array([np.linspace(utilisation.bays.s[k, 0], utilisation.bays.s[k, -1], samples) for k in bays]).ravel()
        P = member.axis.frames_at(s % member.axis.length if member.axis.closed else s)[0]
        nearest = np.asarray(cKDTree(P).query(graph.sheet.surface.centroids[member.cells])[1]) // samples
        value[member.cells] = np.maximum(value[member.cells], utilisation.largest[np.array(bays)[nearest]])
    return np.where(np.isinf(value), np.nan, value)


def worst_member_words(utilisation: Utilisation) -> str:
    """Return text on the member with the largest utilisation, for example 'B10, 63 %'."""
    worst = utilisation.order[0]
    return f"{utilisation.bays.member[worst]}, {percent(float(utilisation.largest[worst]))}"


def summary_section(utilisation: Utilisation, picture: ReportFigure) -> ReportSection:
    """Return the first page: a verdict on the members, and a picture."""
    overloaded = sum(value > 1 for value in utilisation.by_member.values())
    if utilisation.standard.startswith("no standard"):
        status, title = "unknown", "No standard: stress / strength"
    elif overloaded:
        status, title = "fail", f"{overloaded} of {len(utilisation.by_member)} members exceed their resistance"
    else:
        status = "pass" if utilisation.combined else "unknown"
        title = f"Each of {len(utilisation.by_member)} members is loaded below its resistance"
        title += "" if utilisation.combined else ". These loads have no partial factors"
    text = f"{utilisation.summary}. Checked by {utilisation.standard}. {utilisation.assumed[0]}"
    words = (
        "The forces in each section of a member are sums of the internal forces of the shell. Joints and the "
        "stability of the whole structure are not checked: see 'What was assumed, and what was not checked'."
    )
    return ReportSection("Summary", [Banner(status, title, escaped_text(text)), Paragraph(words), picture])


def worst_section(utilisation: Utilisation, number: CaptionNumbers) -> ReportSection:
    """Return a section on the members with the largest utilisation, and on their forces."""
    bays = utilisation.worst_bays(WORST_COUNT)
    decisive = []
    for bay in bays:
        check, case, _ = utilisation.governing(bay)
        share = percent(float(utilisation.largest[bay]))
        words = check.name, check.clause, case
        decisive.append((utilisation.bays.member[bay], utilisation.bays.name[bay], *map(escaped_text, words), share))
    head = ("Member", "Bay", "Check", "Clause and formula", "Case", "Utilisation")
    caption = number.table("Members with the largest utilisation, and the bay with the largest value in each member.")
    table = Table(caption, head, decisive, 5, "", (1, 1.5, 2.6, 3.2, 1.5, 1.3))
    return ReportSection("Most used members", [table, _decisive_forces_table(utilisation, bays, number)], own_page=True)


def _decisive_forces_table(utilisation: Utilisation, worst_bays: Sequence[int], number: CaptionNumbers) -> Table:
    bays, stations = utilisation.bays, [(bay, *utilisation.governing(bay)[1:]) for bay in worst_bays]
    forces = np.array([bays.forces[case][bay, station] for bay, case, station in stations])
    scale = [_common_unit(forces[:, [unit == component_unit for component_unit in UNITS]], unit) for unit in UNITS]
    rows = []
    for (bay, _, station), row in zip(stations, forces, strict=True):
        section = f"{length_or_na(float(bays.width[bay, station]))} × {length_or_na(bays.thickness)}"
        numbers = [f"{x / factor:.{decimals}f}" for x, (factor, _, decimals) in zip(row, scale, strict=True)]
        rows.append((bays.member[bay], section, length_or_na(float(bays.length[bay])), *numbers))
    heads = [f"{name}, {unit}" for name, (_, unit, _) in zip(COMPONENTS, scale, strict=True)]
    title = number.table("Bays of the table above: cross-section, length between nodes, forces at largest utilisation.")
    note = (
        "Positive N is tension. Positive My stretches the side to which the normal of the surface points. Mz bends "
        "members within the surface."
    )
    return Table(title, ("Member", "Section", "Bay", *heads), rows, 2, note, (0.9, 2.2, 1.1, *[1.3] * len(COMPONENTS)))


def _common_unit(values: Floats, unit: str) -> tuple[float, str, int]:
    largest = max(float(np.abs(values).max()), 1e-9)
    factor, name = prefixed_unit(largest, unit)
    return factor, name, max(2, 3 - int(np.floor(np.log10(largest / factor))))


def diagrams_section(design: Design, number: CaptionNumbers) -> ReportSection:
    """Return a section with force diagrams of the members with the largest utilisation."""
    utilisation = design.member_utilisation
    rows = [(utilisation.bays.member[b], utilisation.governing(b)[1]) for b in utilisation.worst_bays(WORST_COUNT)]
    several = len(utilisation.bays.forces) > 1
    case_note = (
        "Each diagram shows the decisive load case, with its name; grey lines show the range of all load cases. "
        "" * several
    )
    figures, count = [], 3  # a figure of three members fills half a page
    for start in range(0, len(rows), count):
        part = rows[start : start + count]
        image, size = force_diagrams(design, part)
        names = ", ".join(name for name, _ in part)
        words = f"Section forces along {names}. {case_note}Strokes at the bottom mark the nodes."
        figures.append(ReportFigure(number.figure(words), image, size, 1.0))
    return ReportSection("Forces along these members", figures, own_page=True)


def checks_section(utilisation: Utilisation, number: CaptionNumbers) -> ReportSection:
    """Return a section with the largest utilisation by each check of the standard."""
    rows = []
    for column, check in enumerate(utilisation.checks):
        values = utilisation.worst[:, column]
        bay = int(values.argmax())
        member = utilisation.bays.member[bay] if values[bay] > 0 else "-"
        rows.append((escaped_text(check.name), escaped_text(check.clause), member, percent(float(values[bay]))))
    caption = number.table("The largest utilisation by each check, of all bays and cases.")
    table = Table(caption, ("Check", "Clause and formula", "Member", "Utilisation"), rows, 3, "", (3, 4.4, 1.2, 1.3))
    return ReportSection("Check by check", [table])


def scope_section(utilisation: Utilisation) -> ReportSection:
    """Return a section with the assumptions, and with the questions that dsfab does not check."""
    assumed = [escaped_text(line) for line in utilisation.assumed]
    missing = [escaped_text(line[0].upper() + line[1:]) + "." for line in utilisation.unchecked]
    blocks: list[Block] = [
        Paragraph(f"<b>Checked by</b> {escaped_text(utilisation.standard)}."),
        Bullets(assumed),
        Paragraph("<b>Not checked:</b>"),
        Bullets(missing),
        Paragraph("This is a first estimate, and does not replace the proof of an engineer.", "quiet"),
    ]
    return ReportSection("What was assumed, and what was not checked", blocks)


def members_section(utilisation: Utilisation, number: CaptionNumbers) -> ReportSection:
    """Return a section that lists the members in the order of utilisation, the largest first."""
    ranked, limit = sorted(utilisation.by_member.items(), key=lambda item: -item[1]), 400
    shown = [(name, percent(value)) for name, value in ranked[:limit]]
    third = -(-len(shown) // 3)
    columns = [[*shown[k * third : (k + 1) * third]] for k in range(3)]
    rows = [[cell for column in columns for cell in (column[k] if k < len(column) else ("", ""))] for k in range(third)]
    rest_words = f" {len(ranked) - limit} more members are in member_utilisation.csv." if len(ranked) > limit else ""
    caption = number.table("All members with bays between nodes, each with its largest utilisation." + rest_words)
    head = ("Member", "Utilisation") * 3
    return ReportSection("All members", [Table(caption, head, rows, 0, "", (1, 1, 1, 1, 1, 1))])


STRUCTURE_FILE = "structure.html"  # Name of the interactive page for clients.


def member_report(design: Design, command: str) -> Document:
    """Return the report on the utilisation of members. command : command line that repeats the report.
    Raises StaticsError for an unsuitable material, or if nothing carries the loads."""
    utilisation, number, library_versions = design.member_utilisation, CaptionNumbers(), versions()
    facts = [
        ("Design", design.preset.name),
        ("Date", datetime.now(UTC).strftime("%d %B %Y")),
        ("Checked by", f"dsfab {library_versions['dsfab']}"),
        ("Most used member", worst_member_words(utilisation)),
    ]
    document_sections = [
        summary_section(utilisation, rating_figure(design, number)),
        worst_section(utilisation, number),
        diagrams_section(design, number),
        checks_section(utilisation, number),
        scope_section(utilisation),
        members_section(utilisation, number),
        reproduction_section(command, library_versions, preset_toml(design.resolved_preset, for_people=True), number),
    ]
    footer = f"Made by dsfab {library_versions['dsfab']}; a first estimate, not a proof of safety under a building code"
    subject = design.preset.name.replace("_", " ").capitalize()
    return Document("Members checked by the building code", subject, facts, document_sections, footer)


def write_member_report(design: Design, command: str, folder: Path) -> tuple[list[str], list[str]]:
    """Write the report and an interactive page; return names of files, and a sentence for each missing file."""
    files, messages = write_document(member_report(design, command), folder)
    try:
        plan = workshop_plan(design, up_axis(design.surface.V, design.surface, design.load))
    except DsfabError as error:
        return files, [
            *messages,
            f"the file {STRUCTURE_FILE} is left out, because the design has no flat parts: {error}",
        ]
    if plan.graph is None:
        return files, messages
    (folder / STRUCTURE_FILE).write_text(assembly_page(plan, design, judged=True), encoding="utf-8")
    return [*files, STRUCTURE_FILE], messages
