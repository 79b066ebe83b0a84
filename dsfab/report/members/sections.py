"""The parts of the report on members, in their order."""

from collections.abc import Mapping, Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.eurocode import Utilisation
from dsfab.frame import COMPONENTS
from dsfab.pipeline import Design
from dsfab.preset_file import preset_toml
from dsfab.report.compliance import tables
from dsfab.report.compliance.document import (
    Banner,
    Block,
    Bullets,
    Code,
    Numbers,
    Paragraph,
    ReportFigure,
    ReportSection,
    Table,
    escaped,
)
from dsfab.report.compliance.words import length, percent, unit_for
from dsfab.report.members.diagrams import UNITS, force_diagrams
from dsfab.report.members.rating import WORST

LISTED = 400
"""Members in the list of all of them, at most."""
IN_A_FIGURE = 3
"""Members in one figure of diagrams: two of these are a page."""


def worst_words(found: Utilisation) -> str:
    """'B10, 63 %'."""
    return f"{found.bays.member[found.order[0]]}, {percent(float(found.largest[found.order[0]]))}"


def summary(found: Utilisation, picture: ReportFigure, number: Numbers) -> ReportSection:
    """One page: a verdict of the members alone, and the structure."""
    over = sum(value > 1 for value in found.by_member.values())
    if found.standard.startswith("no standard"):
        status, title = "unknown", "No standard: stress over strength"
    elif over:
        status, title = "fail", f"{over} of {len(found.by_member)} members bear more than they can"
    else:
        status = "pass" if found.combined else "unknown"
        title = f"Each of {len(found.by_member)} members bears less than it can"
        title += "" if found.combined else ", of loads without partial factors"
    blocks: list[Block] = [
        Banner(status, title, escaped(f"{found.told}. Checked by {found.standard}. {found.assumed[0]}")),
        Paragraph(
            "Forces are summed up from the shell, section by section. Joints, and the stability of the structure as a "
            "whole, are not checked here: see what was not checked.",
        ),
        picture,
    ]
    return ReportSection("Summary", blocks)


def worst(found: Utilisation, number: Numbers) -> ReportSection:
    """The members that bear most of what they can, with the clause and the forces that decide."""
    chosen = found.worst_bays(WORST)
    decisive = []
    for bay in chosen:
        check, case, _ = found.governing(bay)
        share = percent(float(found.largest[bay]))
        words = check.name, check.clause, case
        decisive.append((found.bays.member[bay], found.bays.name[bay], *map(escaped, words), share))
    head = ("Member", "Bay", "Check", "Clause and formula", "Case", "Utilisation")
    caption = number.table("The worst bay of each of the worst members.")
    one = Table(caption, head, decisive, 5, "", (1, 1.5, 2.6, 3.2, 1.5, 1.3))
    return ReportSection("The worst members", [one, _forces_table(found, chosen, number)], own_page=True)


def _forces_table(found: Utilisation, chosen: Sequence[int], number: Numbers) -> Table:
    """Sections and forces of some bays, where the check that decides over them is largest."""
    bays, at = found.bays, [(bay, *found.governing(bay)[1:]) for bay in chosen]
    forces = np.array([bays.forces[case][bay, station] for bay, case, station in at])
    scale = [_scale(forces[:, [unit == one for one in UNITS]], unit) for unit in UNITS]
    rows = []
    for (bay, _, station), row in zip(at, forces, strict=True):
        section = f"{length(float(bays.width[bay, station]))} × {length(bays.thickness)}"
        numbers = [f"{x / factor:.{after}f}" for x, (factor, _, after) in zip(row, scale, strict=True)]
        rows.append((bays.member[bay], section, length(float(bays.length[bay])), *numbers))
    heads = [f"{name}, {unit}" for name, (_, unit, _) in zip(COMPONENTS, scale, strict=True)]
    caption = number.table("The same: section, length from node to node, and forces where that check decides.")
    note = "N positive is tension. My bends with the surface and stretches the side of its normal, Mz bends in it."
    return Table(
        caption, ("Member", "Section", "Bay", *heads), rows, 2, note, (0.9, 2.2, 1.1, *[1.3] * len(COMPONENTS))
    )


def _scale(values: Floats, unit: str) -> tuple[float, str, int]:
    """One unit for all forces or all moments, so that columns can be compared: what to divide by, its name, and digits
    behind the point, four of the largest and two at least."""
    largest = max(float(np.abs(values).max()), 1e-9)
    factor, name = unit_for(largest, unit)
    return factor, name, max(2, 3 - int(np.floor(np.log10(largest / factor))))


def along(design: Design, number: Numbers) -> ReportSection:
    """Diagrams of the same members."""
    found = design.member_utilisation
    rows = [(found.bays.member[bay], found.governing(bay)[1]) for bay in found.worst_bays(WORST)]
    several = len(found.bays.forces) > 1
    told = "Each in the case that decides, named beside it; grey: least and greatest of all cases. " if several else ""
    figures = []
    for first in range(0, len(rows), IN_A_FIGURE):
        part = rows[first : first + IN_A_FIGURE]
        image, size = force_diagrams(design, part)
        names = ", ".join(name for name, _ in part)
        words = f"Section forces along {names}. {told}Strokes at the bottom are nodes."
        figures.append(ReportFigure(number.figure(words), image, size, 1.0))
    return ReportSection("Forces along them", figures, own_page=True)


def checks(found: Utilisation, number: Numbers) -> ReportSection:
    """The largest of each check."""
    rows = []
    for column, check in enumerate(found.checks):
        values = found.worst[:, column]
        bay = int(values.argmax())
        member = found.bays.member[bay] if values[bay] > 0 else "-"
        rows.append((escaped(check.name), escaped(check.clause), member, percent(float(values[bay]))))
    caption = number.table("The largest of each check over all bays and cases.")
    table = Table(caption, ("Check", "Clause and formula", "Member", "Utilisation"), rows, 3, "", (3, 4.4, 1.2, 1.3))
    return ReportSection("Check by check", [table])


def scope(found: Utilisation) -> ReportSection:
    """What was taken for granted, and what nobody looked at."""
    assumed = [escaped(line) for line in found.assumed]
    missing = [escaped(line[0].upper() + line[1:]) + "." for line in found.unchecked]
    blocks: list[Block] = [
        Paragraph(f"<b>Checked by</b> {escaped(found.standard)}."),
        Bullets(assumed),
        Paragraph("<b>Not checked:</b>"),
        Bullets(missing),
        Paragraph("This is a first look, and does not take the place of an engineer's proof.", "quiet"),
    ]
    return ReportSection("What was assumed, and what was not checked", blocks)


def members(found: Utilisation, number: Numbers) -> ReportSection:
    """All members, those that bear most first, in three columns."""
    ranked = sorted(found.by_member.items(), key=lambda one: -one[1])
    shown = [(name, percent(value)) for name, value in ranked[:LISTED]]
    third = -(-len(shown) // 3)
    columns = [[*shown[k * third : (k + 1) * third]] for k in range(3)]
    rows = [_across(columns, row) for row in range(third)]
    more = f" {len(ranked) - LISTED} more are in member_utilisation.csv." if len(ranked) > LISTED else ""
    caption = number.table("All members with bays between nodes, the largest of each." + more)
    head = ("Member", "Utilisation") * 3
    return ReportSection("All members", [Table(caption, head, rows, 0, "", (1, 1, 1, 1, 1, 1))])


def _across(columns: Sequence[Sequence[tuple[str, str]]], row: int) -> list[str]:
    return [cell for column in columns for cell in (column[row] if row < len(column) else ("", ""))]


def reproduction(design: Design, command: str, known: Mapping[str, str], number: Numbers) -> ReportSection:
    """Everything that is needed to make it again."""
    blocks: list[Block] = [
        Paragraph("Made by this command, with the preset below and these versions:"),
        Code(command),
        tables.versions_table(known, number),
        Paragraph("The preset in full, with every value that was left out:"),
        Code(preset_toml(design.settled, brief=True)),
    ]
    return ReportSection("Making it again", blocks, own_page=True)
