"""Tables of a compliance report."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import count_phrase, force, mass
from dsfab.report.compliance.findings import (
    LABELS,
    CheckLine,
    Findings,
    length_or_na,
    percent,
    point_words,
    prefixed_unit,
    quantity,
    share_words,
    significant_digits,
    within,
)
from dsfab.report.html_pages import CaptionNumbers, Table, escaped_text
from dsfab.slicing.measures.pattern_quality import FamilyQuality, PatternQuality
from dsfab.statics import elements_of
from dsfab.study.alternatives import Competitor
from dsfab.surface import Surface

DUST = 5e-5  # A force below this share of the largest force is shown as 0.


def checks_table(checks: list[CheckLine], number: CaptionNumbers, caption: str) -> Table:
    """Return a table of checks."""
    rows = [(line.name, line.result, line.limit, line.status) for line in checks]
    return Table(number.table(caption), ("Check", "Found", "Wanted", "Verdict"), rows, 4, "", (3.2, 5.2, 2.4, 1.2))


def key_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return the table of key results for the first page of the report."""
    moving_case, moving = findings.decisive_case("displacement")
    stressed_case, stressed = findings.decisive_case("stress")
    several = len(findings.cases) > 1
    move_case, stress_case = (f", {escaped_text(name)}" * several for name in (moving_case, stressed_case))
    settled = quantity(stressed.stress.settled, "Pa")  # At corners the largest stress diverges.
    stress_words = f"on 99 % of the area; at most {settled} at points more than a rib's width from corners{stress_case}"
    move_words = f"at {point_words(moving.displacement.place)}{move_case}"
    compliance = within(findings.judgement.compliance, findings.judgement.bound, "J")
    rows = [
        ("Mass", mass(findings.design.mass), f"{share_words(findings.design.area_fraction)} of the surface kept"),
        ("Compliance", compliance, _full_sheet_ratio(findings)),
        ("Largest displacement", length_or_na(moving.displacement.value), move_words),
        ("Von Mises stress", quantity(stressed.stress.quantile, "Pa"), stress_words),
    ]
    if several:
        rows.insert(0, ("Governing load case", escaped_text(findings.cases[0]), f"of {len(findings.cases)}"))
    return Table(number.table("Key results."), ("Result", "Value", "Remark"), rows, 3, "", (2.2, 2.2, 5))


def _full_sheet_ratio(findings: Findings) -> str:
    full = findings.compared.full
    return f"{findings.design.compliance / full.compliance:.3g} times the compliance of a whole {mass(full.mass)} sheet"


def structure_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of sizes, mass and material of the structure."""
    preset, design, task = findings.task.preset, findings.design, findings.task
    statics, sheet = preset.statics, findings.structure.sheet.surface if findings.has_structure else None
    size = [length_or_na(float(x)) for x in np.ptp(task.surface.V, axis=0)]
    rows = [
        ("Surface", f"{significant_digits(task.surface.area)} m², {' × '.join(size)}"),
        ("Kept", _kept_words(design, sheet)),
        ("Thickness", length_or_na(statics.thickness)),
        ("Mass", mass(design.mass) if sheet else "-"),
        ("Smallest member", length_or_na(design.smallest_member)),
        *([("Material", statics.material_words)] if statics.material else []),
        ("Young's modulus; Poisson's ratio", f"{quantity(statics.young, 'Pa')}; {statics.poisson:g}"),
        ("Density", f"{statics.density:g} kg/m³"),
        (
            "Strength",
            quantity(statics.strength, "Pa")
            if statics.strength
            else "the preset gives no strength, so there is no verdict",
        ),
        (
            "Mesh of the surface",
            f"{_thousands(task.surface.n)} vertices, edges of {length_or_na(task.surface.mean_edge)}",
        ),
    ]
    if sheet:
        rows.append(("Mesh of the cut sheet", f"{_thousands(sheet.m)} triangles"))
    return Table(number.table("Structure and material."), ("Property", "Value"), rows, 2, "", (2, 5))


def pattern_table(quality: PatternQuality, number: CaptionNumbers) -> Table:
    """Return a table of the pattern's quality: spacing, dead ends and directions of the members."""
    titled = zip(quality.titles, quality.families, strict=True)
    families = [(title, family) for title, (_, family) in titled if family.drawn]
    rows = [
        ("Distance between members, median", *(length_or_na(family.spacing[1]) for _, family in families)),
        ("Clear width of openings, on 90 % of the open area", *(_opening_range(family) for _, family in families)),
        ("Widest / narrowest distance (P95 / P5)", *(f"{family.evenness:.2f}" for _, family in families)),
        ("Dead ends", *(str(family.dead) for _, family in families)),
        ("Openings narrower than the members beside them", *(str(family.slits) for _, family in families)),
        ("Angle between members and stress, mean", *(f"{family.deviation:.1f}°" for _, family in families)),
        ("Share of members at more than 30° to the stress", *(percent(family.off) for _, family in families)),
    ]
    note = (
        f"Members cross at {quality.crossing_angle:.0f}° or more." if len(families) == 2 else "One family of members."
    )
    if quality.symmetry_error is not None:
        note += f" {percent(quality.symmetry_error)} of the surface differs from its image under the design's symmetry."
    heads = [title[0].upper() + title[1:] for title, _ in families]
    widths = (3, *(2 for _ in families))
    return Table(number.table("The pattern."), ("Measure", *heads), rows, 1 + len(families), note, widths)


def _opening_range(family: FamilyQuality) -> str:
    low, _, high = family.opening
    return f"{length_or_na(low)} to {length_or_na(high)}" if high > 0 else "none"


def _kept_words(design: Competitor, sheet: Surface | None) -> str:
    if sheet is None:
        return "nothing: see the verdict"
    share, pieces = share_words(design.area_fraction), count_phrase(design.pieces, "piece")
    return f"{significant_digits(sheet.area)} m² ({share}), in {pieces}"


def loads_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of the forces of each load case."""
    task, rows = findings.task, []
    cases = task.statics.cases
    uncut = {name: case.load.force.sum(axis=0) for name, case in cases.items()}
    sums = findings.cut_load_sums or uncut
    factor, unit = prefixed_unit(max(float(np.abs(total).max()) for total in sums.values()), "N")
    combined = any(case.factors for case in cases.values())
    states = {combination.name: combination.limit_state for combination in task.preset.surface.sums}
    checked_words = {"ULS": "stress, buckling", "SLS": "displacement", "": "all" if any(states.values()) else "yes"}
    for name in ordered_cases(findings):
        case = cases[name]
        formula = " + ".join(f"{k:g} {escaped_text(part)}" for part, k in case.factors.items()) if case.factors else ""
        followed = "yes" if name in task.preset.followed_weights else "no"
        judged = "no" if name not in findings.cases else checked_words[states.get(name, "")]
        formula_cell = (formula,) if combined else ()
        rows.append(
            (escaped_text(name), *formula_cell, *(_force_digits(x / factor) for x in sums[name]), followed, judged)
        )
    formula_head, formula_width = (("Made of",), (2.4,)) if combined else ((), ())
    head = ("Load case", *formula_head, *(f"F{axis}, {unit}" for axis in "xyz"), "Pattern follows", "Checked")
    widths = (2, *formula_width, 1.3, 1.3, 1.3, 1.5, 1.2)
    caption = f"Sums of the loads on the {'cut' if findings.cut_load_sums else 'uncut'} sheet."
    rule = task.preset.surface.combinations
    note = f"Combined by {rule}; factors in surface.factors replace those of the standard. " if rule else ""
    return Table(number.table(caption), head, rows, 2 if combined else 1, note + _uncut_note(sums, uncut), widths)


def _uncut_note(sums: Mapping[str, Floats], uncut: Mapping[str, Floats]) -> str:
    size = {name: tuple(float(np.linalg.norm(sums_by_case[name])) for sums_by_case in (sums, uncut)) for name in uncut}
    larger = [
        f"{escaped_text(name)} {force(uncut_size)}"
        for name, (cut_size, uncut_size) in size.items()
        if uncut_size > (1 + 1e-6) * cut_size
    ]
    if not larger:
        return ""
    return f"Loads of the uncut sheet that are larger, from self-weight or without a covering: {', '.join(larger)}."


def ordered_cases(findings: Findings) -> list[str]:
    """Return the names of all load cases; the judged cases come first."""
    return [*findings.cases, *(name for name in findings.task.statics.cases if name not in findings.cases)]


def acting_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of the preset's loads and supports, with their settings."""
    surface = findings.task.preset.surface
    rows = [(x.name or "Load", x.case, x.kind.replace("_", " "), _settings_words(x)) for x in surface.load]
    rows += [
        (
            support.name or f"Support {k}",
            "all",
            f"holds {', '.join(support.hold)}" if support.hold else "springs" if support.spring else "clamps",
            _settings_words(support),
        )
        for k, support in enumerate(surface.support, start=1)
    ]
    cells = [tuple(escaped_text(cell) for cell in row) for row in rows]
    return Table(
        number.table("Loads and supports."), ("", "Case", "What", "Where and how much"), cells, 4, "",
        (1.2, 1.2, 1.6, 5),
    )  # fmt: skip


UNITS = {
    "force": "N",
    "pressure": "Pa",
    "per_metre": "N/m",
    "spring": "N/m",
    "radius": "m",
    "center": "m",
    "load": "Pa",
}


def _settings_words(thing: Any) -> str:
    words: list[str] = []
    for field in fields(thing):
        value = getattr(thing, field.name)
        if field.name in ("kind", "case", "hold", "name", "covered") or value is None or value is False:
            if field.name == "covered" and not value:
                words.append("on the members alone")
            continue
        if field.name == "at":
            words.insert(0, _picker_words(value))
        else:
            words.append(f"{field.name.replace('_', ' ')} {_value_words(value)} {UNITS.get(field.name, '')}".strip())
    return "; ".join(word for word in words if word)


def _picker_words(picker: Any) -> str:
    values = [(field.name, getattr(picker, field.name)) for field in fields(picker) if field.name != "pick"]
    shown = [f"{name} {_value_words(value)}" for name, value in values if value is not None and value is not False]
    return f"{picker.pick} ({', '.join(shown)})" if shown else str(picker.pick)


def _value_words(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"{len(value)} values" if len(value) > 6 else f"({', '.join(_value_words(item) for item in value)})"
    return str(value)


def levels_table(findings: Findings, number: CaptionNumbers) -> Table | None:
    """Return a table of results on each finer mesh; None after a quick check, which uses a single mesh."""
    check, name = findings.judgement.check, findings.cases[0]
    if check is None:
        return None
    factor, unit = prefixed_unit(check.case(name).value, "J")
    rows = []
    for k, level in enumerate(check.levels, start=1):
        spread = level.midedge[name] / level.compliance[name] - 1 if name in level.midedge else None
        rows.append(
            (
                str(k),
                _thousands(level.triangles),
                _thousands(level.unknowns),
                significant_digits(level.compliance[name] / factor, 5),
                significant_digits(level.midedge[name] / factor, 5) if name in level.midedge else "-",
                f"{100 * spread:+.2f} %" if spread is not None else "-",
                f"{100 * level.zz_membrane[name]:.2f} %",
                f"{100 * level.zz_bending[name]:.2f} %",
                f"{level.residual:.0e}",
                f"{level.seconds:.1f}",
                f"{level.memory / 1e9:.2f}",
            )
        )
    value = check.case(name)
    note = (
        f"Extrapolated: <b>{significant_digits(value.value / factor, 5)} {unit} ± {percent(value.bound)}</b>. "
        f"This holds for a thin sheet: the solid is up to {percent(value.theory)} softer. "
        "Level 1 is the mesh of the cut sheet. Each further level divides triangles into four, with new points on the "
        "smooth surface. Spread: difference of the pairs at level 1. ZZ: recovery error. GB: memory of the process."
    )
    pairs = (f"{elements_of(use)}, {unit}" for use in ("compliance", "spread"))
    head = ("Level", "Triangles", "Unknowns", *pairs, "Spread", "ZZ memb.", "ZZ bend.", "Residual", "s", "GB")
    caption = f"Compliance on finer meshes{'' if len(findings.cases) == 1 else f', load case {escaped_text(name)}'}."
    return Table(number.table(caption), head, rows, 1, note, (0.8, 1.2, 1.2, 1.3, 1.4, 1, 1, 1, 1, 0.8, 0.8))


def cases_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of results by load case, the governing case first."""
    check, rows = findings.judgement.check, []
    for name in findings.cases:
        case = findings.judgement.cases[name]
        value = check.case(name) if check else None
        compliance, bound = (value.value, value.bound) if value else (case.compliance, findings.judgement.bound)
        rows.append(
            (
                escaped_text(name),
                within(compliance, bound, "J"),
                value.status if value else "unknown",
                length_or_na(case.displacement.value),
                quantity(case.stress.quantile, "Pa"),
                quantity(case.tension.quantile, "Pa"),
                quantity(case.compression.quantile, "Pa"),
            )
        )
    head = ("Load case", "Compliance", "Verdict", "Moves at most", "von Mises", "Tension", "Compression")
    note = (
        "The table shows the stress that 99 % of the area does not exceed, at the top, middle and bottom of the sheet."
    )
    widths = (1.6, 2.4, 1.1, 1.4, 1.4, 1.4, 1.6)
    return Table(number.table("Load cases; the governing load case is first."), head, rows, 1, note, widths)


def stress_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of the largest stresses and their places."""
    name, case = findings.decisive_case("stress")
    rows = []
    for label, extreme in (
        ("von Mises", case.stress),
        ("Largest principal (tension)", case.tension),
        ("Smallest principal (compression)", case.compression),
    ):
        values = (quantity(value, "Pa") for value in (extreme.quantile, extreme.settled, extreme.value))
        rows.append((label, *values, point_words(extreme.place)))
    head = ("Stress", "99 % of the area", "Away from corners", "Largest of this mesh", "At")
    note = (
        "At inner corners and at ends of supports the exact stress is infinite, so finer meshes give larger values. "
        "Use instead the value that 99 % of the area does not exceed, and the largest value at more than a rib's "
        "width from inner corners and ends of supports."
    )
    under = f" under {escaped_text(name)}" if len(findings.cases) > 1 else ""
    caption = f"Stress{under}, on a mesh of {_thousands(case.triangles)} triangles."
    return Table(number.table(caption), head, rows, 1, note, (2.4, 1.4, 1.6, 1.4, 2))


def reactions_table(findings: Findings, name: str, number: CaptionNumbers) -> Table:
    """Return a table of reactions by support in the load case `name`."""
    case = findings.judgement.cases[name]
    loads = findings.fields[name].load.force.sum(axis=0)
    reaction_sum = np.sum(case.reactions, axis=0)
    factor, unit = prefixed_unit(float(np.abs(loads).max()), "N")
    dust = DUST * max(1.0, float(np.abs([*case.reactions, loads]).max()) / factor)

    def line(text: str, force: Any) -> tuple[str, ...]:
        level = float(np.hypot(*force[:2])) / factor
        direction = f"{np.degrees(np.arctan2(force[1], force[0])):.0f}" if level > dust else "-"
        return (text, *(_force_digits(x, dust) for x in (*(np.asarray(force) / factor), level)), direction)

    supports = findings.task.preset.surface.support
    names = [escaped_text(support.name) or f"Support {k}" for k, support in enumerate(supports, start=1)]
    rows = [line(text, force) for text, force in zip(names, case.reactions, strict=True)]
    rows += [line("All supports", reaction_sum), line("Loads", loads)]
    note = f"Loads and reactions differ by {case.imbalance:.0e} of the load. Relative residual: {case.residual:.0e}."
    head = ("", *(f"R{axis}, {unit}" for axis in "xyz"), f"H in x and y, {unit}", "Towards, degrees from x")
    caption = f"Reactions{'' if len(findings.cases) == 1 else f', load case {escaped_text(name)}'}."
    return Table(number.table(caption), head, rows, 1, note, (2, 1, 1, 1, 1, 1), (len(rows) - 2,))


def rivals_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of the design and its competitors: mass, compliance, displacement, stress."""
    rows = [_rival_row(findings, competitor) for competitor in findings.compared.competitors]
    _, unit = prefixed_unit(findings.reference_compliance, "J")
    head = (
        "Structure", "Mass", "Kept", f"Compliance, {unit}", "/ whole sheet", "/ design", "Moves", "99 % stress",
        "Level",
    )  # fmt: skip
    names = [competitor.name for competitor in findings.compared.competitors]
    levels = {competitor.judgement.level for competitor in findings.compared.competitors if competitor.judgement}
    note = (
        "A column with / shows the ratio of two compliances; above 1, the structure is softer. Level full: solved on "
        "two or three meshes. "
    )
    note += (
        "Level quick: one solve on the cut mesh; the error bounds hold for nine of ten designs."
        if "quick" in levels
        else ""
    )
    return Table(
        number.table("The design and its competitors, with the same loads, supports and kept regions."),
        head, rows, 1, note, (2.6, 1.1, 1.1, 1.9, 1, 1, 1.4, 1.4, 0.8), (names.index("design"),),
    )  # fmt: skip


def _rival_row(findings: Findings, competitor: Competitor) -> tuple[str, ...]:
    name = LABELS[competitor.name] + (f" ({escaped_text(competitor.variant)})" if competitor.variant else "")
    if competitor.judgement is None:
        sizes = (mass(competitor.mass), share_words(competitor.area_fraction)) if competitor.structure else ("-", "-")
        return (name, *sizes, "carries nothing", "-", "-", "-", "-", "-")
    factor, _ = prefixed_unit(findings.reference_compliance, "J")
    worst = competitor.judgement.worst
    return (
        name,
        mass(competitor.mass),
        share_words(competitor.area_fraction),
        f"{significant_digits(competitor.compliance / factor)} ± {percent(competitor.judgement.bound or 0)}",
        significant_digits(competitor.compliance / findings.compared.full.compliance),
        significant_digits(competitor.compliance / findings.design.compliance) if findings.carries else "-",
        length_or_na(worst("displacement").value),
        quantity(worst("stress").quantile, "Pa"),
        competitor.judgement.level,
    )


def volumes_table(findings: Findings, number: CaptionNumbers) -> Table:
    """Return a table of compliances, divided by that of the whole sheet, by structure and share of material."""
    names = [competitor.name for competitor in findings.volumes[0][1].competitors if competitor.name != "full"]
    rows = []
    for share, compared in findings.volumes:
        cells = [_ratio(compared[name], compared.full.compliance) for name in names]
        rows.append((percent(share), mass(share * compared.full.mass), *cells))
    head = ("Share", "Mass", *(LABELS[name] for name in names))
    competitors = [competitor for _, compared in findings.volumes for competitor in compared.competitors]
    levels = {competitor.judgement.level for competitor in competitors if competitor.judgement}
    level_note = {
        frozenset(("full",)): "Judged by full checks.",
        frozenset(("quick",)): "Each value is from one solve. The mesh of a sheet without openings is coarser.",
    }.get(frozenset(levels), "Sheets without openings were solved on finer and finer meshes, cut sheets on one mesh.")
    note = f"Compliance divided by that of the whole sheet; - : the structure does not carry the loads. {level_note}"
    return Table(number.table("Compliance at other masses."), head, rows, 1, note)


def _ratio(competitor: Competitor, full: float) -> str:
    return f"{competitor.compliance / full:.3g}" if competitor.judgement else "-"


def versions_table(versions: Mapping[str, str], number: CaptionNumbers) -> Table:
    """Return a table of the versions of dsfab and of its libraries."""
    return Table(number.table("Versions."), ("Part", "Version"), list(versions.items()), 2, "", (1, 3))


def _thousands(count: int) -> str:
    return f"{count:,}".replace(",", " ")


def _force_digits(value: float, dust: float = DUST) -> str:
    return "0" if abs(value) < dust else significant_digits(value, 4)
