"""Sections of a compliance report."""

from collections.abc import Mapping, Sequence

from dsfab.core.limits import CONVERGED
from dsfab.core.messages import mass
from dsfab.report.compliance import tables
from dsfab.report.compliance.figures import ChartImages, FindingsPictures
from dsfab.report.compliance.findings import (
    LABELS,
    Findings,
    enumeration,
    length_or_na,
    percent,
    quantity,
    share_words,
    significant_digits,
)
from dsfab.report.compliance.verdict_words import (
    alternative_banners,
    comparison_sentences,
    thinner_sheet_words,
    verdict_banner,
)
from dsfab.report.html_pages import (
    Block,
    Bullets,
    CaptionNumbers,
    Code,
    FigureRow,
    Paragraph,
    ReportFigure,
    ReportSection,
    Table,
    escaped_text,
)
from dsfab.statics import elements_of
from dsfab.study.verdict import calibration, estimates

PLANE = "The sheet is loaded in its own plane and does not bend, so the two kinds of elements give equal results."


def summary_section(findings: Findings, pictures: FindingsPictures, number: CaptionNumbers) -> ReportSection:
    """Return the first page: verdict, picture and key results."""
    caption = number.figure(f"The structure, {findings.size_words}. Arrows are loads, cones are supports.")
    picture = pictures.design(caption, 0.86)
    words = Paragraph(" ".join(comparison_sentences(findings)), "lead")
    banners = (*alternative_banners(findings), verdict_banner(findings))
    return ReportSection("Summary", [*banners, words, picture, tables.key_table(findings, number)])


def checks_section(findings: Findings, number: CaptionNumbers) -> ReportSection:
    """Return a section with tables of all checks and their verdicts."""
    blocks: list[Block] = [tables.checks_table(findings.checks, number, "The structure itself.")]
    if findings.claims:
        blocks.append(tables.checks_table(findings.claims, number, "Stiffness against structures of the same mass."))
    blocks.append(
        Paragraph(
            "<b>pass</b>: met. <b>fail</b>: not met. <b>unknown</b>: neither is certain. <b>note</b>: information "
            "without a verdict. Each ratio has a range, which follows from the bounds of both compliances.",
            "quiet",
        )
    )
    return ReportSection("Checks", blocks)


def structure_section(findings: Findings, number: CaptionNumbers) -> ReportSection:
    """Return a section with tables of the structure, its material and its pattern."""
    blocks: list[Block] = [tables.structure_table(findings, number)]
    if findings.compared.pattern is not None:
        blocks.append(tables.pattern_table(findings.compared.pattern, number))
    return ReportSection("The structure", blocks)


def loads_section(findings: Findings, pictures: FindingsPictures, number: CaptionNumbers) -> ReportSection:
    """Return a section with tables of loads and supports, and a picture for each load case."""
    names = findings.cases_shown(tables.ordered_cases(findings))
    several = len(names) > 1
    figures = []
    for name in names:
        caption = (
            f"Load case {escaped_text(name)}: loads (blue) and supports (dark)." if several else "Loads and supports."
        )
        figures.append(pictures.case(name, number.figure(caption), 1.0 if several else 0.7, side_by_side=several))
    load_tables = (tables.acting_table(findings, number), tables.loads_table(findings, number))
    return ReportSection("Loads and supports", [*load_tables, *([FigureRow(figures)] if several else figures)])


def convergence_section(findings: Findings, number: CaptionNumbers) -> ReportSection:
    """Return a section with the compliance on finer and finer meshes."""
    levels = tables.levels_table(findings, number)
    if levels is None:
        words = "The compliance comes from one solve on the mesh of the cut sheet; "
        words += (
            f"for nine designs in ten, the error of this compliance is at most {percent(estimates.QUICK_ERRORS[1])}. "
        )
        words += "To see the convergence on finer meshes, use <code>--level full</code>."
        return ReportSection("Compliance", [Paragraph(words), tables.cases_table(findings, number)])
    check = findings.judgement.check
    assert check is not None
    blocks: list[Block] = [
        Paragraph(
            "Compliance is the work of the loads; a smaller compliance means a stiffer structure. The structure was "
            "solved on the mesh of the cut sheet and on finer meshes, by two kinds of elements, whose errors mostly "
            f"have opposite signs. The extrapolated value is reliable if its error bound is up to {percent(CONVERGED)}."
        ),
        levels,
        *([Paragraph(PLANE, "quiet")] if findings.is_plane else []),
        tables.cases_table(findings, number),
    ]
    blocks += [Paragraph(escaped_text(f"{warning[0].upper()}{warning[1:]}.")) for warning in check.warnings]
    return ReportSection("Compliance and its convergence", blocks)


def comparison_section(
    findings: Findings, number: CaptionNumbers, charts: Mapping[str, tuple[bytes, tuple[int, int]]]
) -> ReportSection:
    """Return the comparison with structures of equal mass. charts : PNG files, and their sizes in pixels, by name."""
    blocks: list[Block] = [Paragraph(text) for text in comparison_sentences(findings)]
    blocks.append(tables.rivals_table(findings, number))
    blocks += [
        Paragraph(f"{LABELS[rival.name]}: {escaped_text(rival.error)}.", "quiet")
        for rival in findings.compared.rivals
        if rival.error
    ]
    spreads = [rival for rival in findings.compared.rivals if rival.spread and rival.judgement]
    full = findings.compared.full.compliance
    for rival in spreads:
        assert rival.spread is not None
        spread = rival.spread
        least, mean, worst = (significant_digits(x / full) for x in (spread.best, spread.mean, spread.worst))
        words = (
            f"{LABELS[rival.name]}: {spread.carried} of {spread.tried} variants carry the loads. By one solve each, "
            f"these variants have {least} to {worst} times the compliance of the whole sheet, on average {mean} "
            "times. The table shows the stiffest variant."
        )
        blocks.append(Paragraph(words, "quiet"))
    if "bars" in charts:
        caption = number.figure("Compliance of structures of the same mass; thin lines are error bounds.")
        blocks.append(ReportFigure(caption, *charts["bars"], 0.92))
    if findings.volumes:
        if words := thinner_sheet_words(findings):
            blocks.append(Paragraph(words))
        blocks.append(tables.volumes_table(findings, number))
    if "volumes" in charts:
        caption = number.figure(
            "Compliance against mass; for each mass, the widths of members in the design are scaled."
        )
        blocks.append(ReportFigure(caption, *charts["volumes"], 0.92))
    return ReportSection("Other structures of the same mass", blocks)


def displacement_and_stress_section(
    findings: Findings, pictures: FindingsPictures, number: CaptionNumbers
) -> ReportSection:
    """Return a section with pictures of the largest displacements and the largest stress."""
    moving_case, moving = findings.decisive_case("displacement")
    stressed_case, stressed_answer = findings.decisive_case("stress")
    several, names = len(findings.cases) > 1, (moving_case, stressed_case)
    under = {name: f" under {escaped_text(name)}" if several else "" for name in names}
    moved_figure = pictures.displacement(
        findings.fields[moving_case],
        moving.displacement.value,
        number.figure(f"Displacements{under[moving_case]}, drawn {{factor}} times as large."),
    )
    stress_figure = pictures.stress(
        findings.fields[stressed_case],
        number.figure(
            f"von Mises stress{under[stressed_case]}: the largest of the values at the top, middle and bottom of the "
            f"sheet; on 99 % of the area of the finest mesh at most {quantity(stressed_answer.stress.quantile, 'Pa')}."
        ),
    )
    words = Paragraph(
        f"The two pictures below show the results of one solve on the mesh of the cut sheet, by "
        f"{elements_of('displacement')} elements. The table shows the stress on the finest mesh.",
        "quiet",
    )
    blocks: list[Block] = [words, moved_figure, stress_figure, tables.stress_table(findings, number)]
    return ReportSection("Displacements and stress", blocks, own_page=True)


def reactions_section(findings: Findings, number: CaptionNumbers) -> ReportSection:
    """Return a section with the reactions of each support, in a table for each load case."""
    names = findings.cases_shown(findings.cases)
    return ReportSection("Reactions and balance", [tables.reactions_table(findings, name, number) for name in names])


def scope_sections(findings: Findings) -> list[ReportSection]:
    """Return two sections: the assumptions, and the effects that dsfab does not check."""
    preset = findings.task.preset
    statics = preset.statics
    assumed = [
        "Linear elastic, isotropic material; small displacements; loads that keep their direction.",
        f"A thin sheet of constant thickness ({length_or_na(statics.thickness)}). The self-weight of the design and "
        "of each competitor is the weight of its material. The directions of the stripes follow from the weight of the "
        f"{'cut' if preset.pattern.rounds else 'uncut'} sheet.",
        "Supports are rigid unless they are springs. They resist pulling as well as pushing.",
        "Snow, wind, pressure and cladding on openings are transferred by a covering to the nearest material along the "
        "surface, with the same total force and moment. A load without a covering acts on the members alone. A "
        "concentrated load on an opening acts on the nearest material, distributed over a small area.",
        "The middle surface counts as smooth: new points of finer meshes lie on a smooth surface through the vertices.",
        "All competitors have the mass of the design to 0.1 %, and the same loads, supports and kept regions. But the "
        "SIMP structure has other discs of material around loads and supports, and no rim. Only the thinner sheet has "
        "a different thickness.",
    ]
    if statics.law == "stvk":
        assumed[0] = "Material law of St. Venant and Kirchhoff, linearised; small displacements."
    cases = list(findings.judgement.cases.values()) if findings.carries else []
    if any(case.frequency for case in cases):
        snow = f", and {percent(statics.snow_mass)} of the snow" if statics.snow_mass else ""
        assumed.append(f"The vibrating mass is that of the sheet and of permanent loads{snow}.")
    missing = [
        "Strength: the preset gives no strength, so dsfab does not check the stress." if not statics.strength else "",
        ""
        if any(case.buckling for case in cases)
        else "Buckling: not requested (<code>--buckling</code>), but thin ribs in compression may buckle.",
        "" if any(case.frequency for case in cases) else "Vibration: not requested (<code>--frequency</code>).",
        "Effects of imperfections, cracks, fatigue, creep, temperature, shrinkage, moisture, fire and corrosion.",
        "Connections, joints between parts, bearings, foundations, assembly and erection.",
        "Partial factors and load combinations of a building code, unless the preset defines these factors.",
        "Orthotropy, as of timber and of printed layers: the results hold only for isotropic material.",
        "The finished part, and the file for its production (<code>dsfab check</code> measures the file).",
    ]
    words = Paragraph(
        "This report is about the stiffness of the sheet of this design. It is no proof of safety under any building "
        "code, and does not replace the proof of an engineer."
    )
    return [
        ReportSection("What was assumed", [Bullets(assumed)]),
        ReportSection("What was not checked", [words, Bullets([line for line in missing if line])]),
    ]


def calibration_section() -> ReportSection:
    """Return a section on tests of the error bound of compliances."""
    rows = calibration.shipped_table()
    result, kinds = calibration.summary(rows), len({row.kind for row in rows})
    text = (
        f"The rule for the bound was tested on {result.designs} random designs on {kinds} surfaces. Each was solved "
        "on one or two meshes finer than those of its verdict. The compliance found there lies within the bound in "
        f"<b>{round(result.inside * result.designs)} of {result.designs}</b> cases. The median bound is "
        f"<b>{percent(result.median_bound)}</b>, the largest error of the value {percent(result.largest_error)}. One "
        f"solve on the cut mesh (level quick) has a median error of {percent(result.quick_median)}, and at most "
        f"{percent(result.quick_most)} for nine designs in ten. The rule was fitted to these designs: it is "
        "calibrated, not proven. <code>dsfab verify --calibration</code> prints the table and computes it again; "
        "<code>dsfab verify</code> tests the elements on structures with published answers."
    )
    return ReportSection("How reliable is the error bound?", [Paragraph(text)])


def reproduction_section(
    command: str, versions: Mapping[str, str], preset: str, number: CaptionNumbers
) -> ReportSection:
    """Return a section with the command, the versions and the preset (as text) that repeat the report."""
    blocks: Sequence[Block] = [
        Paragraph("This command made the report, with the preset below and these versions of programs:"),
        Code(command),
        tables.versions_table(versions, number),
        Paragraph("The complete preset, with all default values:"),
        Code(preset),
    ]
    return ReportSection("How to repeat the report", blocks, own_page=True)


def carrying_sections(
    findings: Findings,
    pictures: FindingsPictures,
    number: CaptionNumbers,
    charts: ChartImages,
    versions: Mapping[str, str],
    preset: str,
) -> list[ReportSection]:
    """Return all sections of the report on a design that carries the loads."""
    return [
        summary_section(findings, pictures, number),
        checks_section(findings, number),
        structure_section(findings, number),
        loads_section(findings, pictures, number),
        convergence_section(findings, number),
        reactions_section(findings, number),
        comparison_section(findings, number, charts),
        displacement_and_stress_section(findings, pictures, number),
        *scope_sections(findings),
        calibration_section(),
        reproduction_section(findings.command, versions, preset, number),
    ]


def failed_sections(
    findings: Findings,
    pictures: FindingsPictures,
    number: CaptionNumbers,
    charts: ChartImages,
    versions: Mapping[str, str],
    preset: str,
) -> list[ReportSection]:
    """Return all sections of the report on a design that cannot carry the loads."""
    return [
        _failed_summary(findings, pictures, number),
        checks_section(findings, number),
        structure_section(findings, number),
        loads_section(findings, pictures, number),
        *([comparison_section(findings, number, charts)] if findings.compared.rivals or findings.volumes else []),
        *scope_sections(findings),
        reproduction_section(findings.command, versions, preset, number),
    ]


def _failed_summary(findings: Findings, pictures: FindingsPictures, number: CaptionNumbers) -> ReportSection:
    blocks: list[Block] = [verdict_banner(findings)]
    blocks += [Paragraph(text, "lead") for text in (_advice(findings), *comparison_sentences(findings))]
    blocks.append(_failed_picture(findings, pictures, number))
    if findings.has_structure:
        blocks.append(_failed_table(findings, number))
    return ReportSection("Summary", blocks)


def _advice(findings: Findings) -> str:
    carrying = [share for share, compared in findings.volumes if compared.design.judgement]
    words = "A design without equilibrium has no compliance, displacement or stress. "
    if carrying:
        shares = enumeration([f"{share:.0%}" for share in carrying])
        return words + f"With scaled widths of members, the design carries its loads at {shares} of the material."
    return words + (
        "More material (wider stripes, lower thresholds), a rim, or kept regions around loads and supports may connect "
        "the loads to the supports. Other phases, modes or frequencies of the stripes may help, too."
    )


def _failed_picture(findings: Findings, pictures: FindingsPictures, number: CaptionNumbers) -> ReportFigure:
    if findings.has_structure:
        red = "; red reaches no support" if findings.design.loose > 0 else ""
        caption = f"The picture shows all material of the pattern{red}. Arrows are loads, cones are supports."
        return pictures.all_material(number.figure(caption), 0.86)
    caption = "The surface before it is cut. Arrows are loads, cones are supports."
    return pictures.case(findings.cases[0], number.figure(caption), 0.86)


def _failed_table(findings: Findings, number: CaptionNumbers) -> Table:
    design = findings.design
    size = f"{share_words(design.area_fraction)} of the surface, {length_or_na(design.thickness)} thick"
    rows = [
        ("Mass", mass(design.mass), size),
        ("Pieces", str(design.pieces), f"{share_words(design.loose)} of the material reaches no support"),
        ("Compliance", "none", "not in equilibrium"),
        *(_competitor_row(findings, name) for name in ("full", *(rival.name for rival in findings.compared.rivals))),
    ]
    return Table(number.table("Key results."), ("Result", "Value", "Remark"), rows, 3, "", (3, 2, 4))


def _competitor_row(findings: Findings, name: str) -> tuple[str, str, str]:
    competitor, full = findings.compared[name], findings.compared.full
    label = escaped_text(LABELS[name])
    if competitor.judgement is None:
        exists = competitor.structure or competitor.spread
        return label, "none", "this structure does not carry the loads" if exists else "no structure was found"
    ratio = f"{significant_digits(competitor.compliance / full.compliance)} times the compliance of the whole sheet"
    return label, mass(competitor.mass), "carries the loads" if name == "full" else f"carries the loads, with {ratio}"
