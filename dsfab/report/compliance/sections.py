"""Sections of a compliance report, for designs with and without equilibrium."""

from collections.abc import Mapping, Sequence

from dsfab.core.limits import CONVERGED
from dsfab.core.messages import mass
from dsfab.report.compliance import tables
from dsfab.report.compliance.figures import Charts, Pictures
from dsfab.report.compliance.findings import (
    LABELS,
    Findings,
    digits_of,
    enumeration,
    length,
    percent,
    quantity,
    share_of,
)
from dsfab.report.compliance.verdict_words import banner, losses, standing, thinner_at_volumes
from dsfab.report.html_pages import (
    Across,
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
from dsfab.statics import elements_of
from dsfab.study.verdict import calibration, estimates

PLANE = "The sheet is loaded in its own plane: there is no bending, and the two pairs of elements are one."


def summary(found: Findings, drawn: Pictures, number: Numbers) -> ReportSection:
    """The first page: verdict, picture and key results."""
    picture = drawn.design(number.figure(f"The structure, {found.extent}. Arrows are loads, cones are supports."), 0.86)
    return ReportSection(
        "Summary",
        [
            *losses(found),
            banner(found),
            Paragraph(" ".join(standing(found)), "lead"),
            picture,
            tables.key_table(found, number),
        ],
    )


def checks(found: Findings, number: Numbers) -> ReportSection:
    """Verdict by verdict."""
    blocks: list[Block] = [tables.checks_table(found.checks, number, "The structure itself.")]
    if found.claims:
        blocks.append(tables.checks_table(found.claims, number, "Stiffness beside others of the same mass."))
    blocks.append(
        Paragraph(
            "<b>pass</b>: shown. <b>fail</b>: shown not to be so. <b>unknown</b>: not shown either way. <b>note</b>: "
            "to be read, without a verdict. Ratios are given with the range that the bounds of both compliances leave.",
            "quiet",
        )
    )
    return ReportSection("Checks", blocks)


def subject(found: Findings, number: Numbers) -> ReportSection:
    """Structure, material and pattern."""
    blocks: list[Block] = [tables.structure_table(found, number)]
    if found.compared.pattern is not None:
        blocks.append(tables.pattern_table(found.compared.pattern, number))
    return ReportSection("The structure", blocks)


def loads(found: Findings, drawn: Pictures, number: Numbers) -> ReportSection:
    """Loads and supports, drawn for each case."""
    names = found.detailed(tables.found_order(found))
    several = len(names) > 1
    figures = []
    for name in names:
        told = f"Load case {escaped(name)}: loads (blue) and supports (dark)." if several else "Loads and supports."
        figures.append(drawn.case(name, number.figure(told), 1.0 if several else 0.7, beside=several))
    return ReportSection(
        "Loads and supports",
        [
            tables.acting_table(found, number),
            tables.loads_table(found, number),
            *([Across(figures)] if several else figures),
        ],
    )


def convergence(found: Findings, number: Numbers) -> ReportSection:
    """The compliance on finer and finer meshes, or by one solve."""
    levels = tables.levels_table(found, number)
    if levels is None:
        words = "The compliance was found by one solve on the mesh as it is cut; "
        words += f"its bound, {percent(estimates.QUICK[1])}, holds for nine designs in ten. "
        words += "It shows no convergence: <code>--level full</code> does."
        return ReportSection("Compliance", [Paragraph(words), tables.cases_table(found, number)])
    check = found.judged.check
    assert check is not None
    blocks: list[Block] = [
        Paragraph(
            "Compliance is the work of the loads: the smaller, the stiffer. The structure was solved on the mesh as it "
            "is cut and on finer ones, by two pairs of finite elements that mostly err to opposite sides; the value is "
            f"extrapolated and counts as known when its bound is {percent(CONVERGED)} or less."
        ),
        levels,
        *([Paragraph(PLANE, "quiet")] if found.plane else []),
        tables.cases_table(found, number),
    ]
    blocks += [Paragraph(escaped(f"{told[0].upper()}{told[1:]}.")) for told in check.warnings]
    return ReportSection("Compliance and its convergence", blocks)


def comparison(found: Findings, number: Numbers, charts: Mapping[str, tuple[bytes, tuple[int, int]]]) -> ReportSection:
    """Structures of the same mass."""
    blocks: list[Block] = [Paragraph(text) for text in standing(found)]
    blocks.append(tables.rivals_table(found, number))
    blocks += [
        Paragraph(f"{LABELS[one.name]}: {escaped(one.error)}.", "quiet") for one in found.compared.rivals if one.error
    ]
    spreads = [one for one in found.compared.rivals if one.spread and one.judgement]
    full = found.compared.full.compliance
    for one in spreads:
        assert one.spread is not None
        best, mean, worst = (digits_of(getattr(one.spread, name) / full) for name in ("best", "mean", "worst"))
        told = (
            f"{LABELS[one.name]}: {one.spread.carried} of {one.spread.tried} variants carry the loads, by one solve "
            f"each from {best} to {worst} times the compliance of the whole sheet, {mean} times in the mean; the table "
            "has the stiffest."
        )
        blocks.append(Paragraph(told, "quiet"))
    if "bars" in charts:
        blocks.append(
            _chart(number.figure("Compliance of structures of one mass; thin lines are bounds."), charts["bars"])
        )
    if found.volumes:
        if told := thinner_at_volumes(found):
            blocks.append(Paragraph(told))
        blocks.append(tables.volumes_table(found, number))
    if "volumes" in charts:
        blocks.append(_chart(number.figure("Compliance over mass; the design's widths are scaled."), charts["volumes"]))
    return ReportSection("The same mass spent otherwise", blocks)


def _chart(caption: str, chart: tuple[bytes, tuple[int, int]]) -> ReportFigure:
    image, size = chart
    return ReportFigure(caption, image, size, 0.92)


def answers(found: Findings, drawn: Pictures, number: Numbers) -> ReportSection:
    """Displacements and stress, each of the case or combination that decides it."""
    (farthest, moves), (strained, strains) = found.decisive("displacement"), found.decisive("stress")
    under = {name: f" under {escaped(name)}" if len(found.cases) > 1 else "" for name in (farthest, strained)}
    moved = drawn.displacement(
        found.fields[farthest],
        moves.displacement.value,
        number.figure(f"Displacements{under[farthest]}, drawn {{factor}} times as large."),
    )
    stressed = drawn.stress(
        found.fields[strained],
        number.figure(
            f"von Mises stress{under[strained]}, the largest of top, middle and bottom of the sheet as it is cut; on "
            f"99 % of the area of the finest mesh at most {quantity(strains.stress.quantile, 'Pa')}."
        ),
    )
    words = Paragraph(
        f"Both pictures are those of one solve on the mesh as it is cut, by {elements_of('displacement')} elements; "
        "the table has the stress of the finest mesh that was solved.",
        "quiet",
    )
    return ReportSection(
        "Displacements and stress", [words, moved, stressed, tables.stress_table(found, number)], own_page=True
    )


def reactions(found: Findings, number: Numbers) -> ReportSection:
    """Reactions of each support, in each case."""
    return ReportSection(
        "Reactions and balance", [tables.reactions_table(found, name, number) for name in found.detailed(found.cases)]
    )


def scope(found: Findings) -> list[ReportSection]:
    """Assumptions, and questions that nobody checked."""
    preset = found.task.preset
    statics = preset.statics
    assumed = [
        "Linear elastic, isotropic material; small displacements; loads that do not follow the motion.",
        f"A thin sheet of one thickness ({length(statics.thickness)}); where a load asks for its own weight, it is "
        "that of the material that is there, of the design and of each competitor. The directions of the stripes were "
        f"sought with that of {'what stripes leave' if preset.pattern.rounds else 'the uncut sheet'}.",
        "Supports are rigid unless they are springs, and hold in both directions.",
        "What lies on openings (snow, wind, pressure, cladding) is carried by a covering to the material nearest along "
        "the surface, with its sum and its moment, unless a load is not covered: then it acts on the members alone. A "
        "concentrated load on what was cut away goes to the nearest material, and is spread over the material around.",
        "The middle surface is smooth: new points of finer meshes lie on a surface through the vertices.",
        "All competitors have the same mass to a thousandth, the same loads, supports, kept regions (SIMP those that "
        "are drawn, and discs of its own) and, but for the thinner sheet, the same thickness.",
    ]
    if statics.law == "stvk":
        assumed[0] = "The paper's material (St. Venant and Kirchhoff's, linearised); small displacements."
    cases = list(found.judged.cases.values()) if found.carries else []
    missing = [
        "Strength: the preset gives none, so stress is shown and not judged." if not statics.strength else "",
        ""
        if any(case.buckling for case in cases)
        else "Buckling: not asked for (<code>--buckling</code>); thin ribs in compression may need it.",
        "" if any(case.frequency for case in cases) else "Vibration: not asked for (<code>--frequency</code>).",
        "Imperfections, cracks, fatigue, creep, temperature, shrinkage, moisture, fire and corrosion.",
        "Connections, joints between parts, bearings, foundations, assembly and erection.",
        "Partial factors and load combinations of any code, except those of the preset.",
        "Orthotropy of the material (timber, printed layers); the numbers hold for the two constants given.",
        "The part as it is made, and the file that it is made from (<code>dsfab check</code> measures that).",
    ]
    words = Paragraph(
        "This report is about the stiffness of one sheet as it is drawn. It is no proof of safety under any building "
        "code, and does not take the place of an engineer's."
    )
    return [
        ReportSection("What was assumed", [Bullets(assumed)]),
        ReportSection("What was not checked", [words, Bullets([one for one in missing if one])]),
    ]


def calibrated(number: Numbers) -> ReportSection:
    """Tests of the rule for the bound."""
    rows = calibration.shipped_table()
    told = calibration.summary(rows)
    kinds = len({row.kind for row in rows})
    inside = round(told.inside * told.designs)
    return ReportSection(
        "Can the bound be believed?",
        [
            Paragraph(
                f"The rule that gives the bound was tested on {told.designs} random designs on {kinds} surfaces, each "
                f"solved on one or two meshes beyond those of its verdict: the compliance found there lies within the "
                f"bound in <b>{inside} of {told.designs}</b> cases. The median bound is "
                f"<b>{percent(told.median_bound)}</b>, the largest error of the value {percent(told.largest_error)}. "
                f"One solve on the cut mesh (level quick) is off by {percent(told.quick_median)} in the median, and by "
                f"{percent(told.quick_most)} at most for nine in ten. The rule was fitted on these designs: it is "
                "calibrated, not proven. <code>dsfab verify --calibration</code> prints the table and makes it anew; "
                "<code>dsfab verify</code> tests the elements on structures with published answers."
            )
        ],
    )


def reproduction(found: Findings, versions: Mapping[str, str], preset: str, number: Numbers) -> ReportSection:
    """Command, versions and preset of the report."""
    blocks: Sequence[Block] = [
        Paragraph("Made by this command, with the preset below and these versions:"),
        Code(found.command),
        tables.versions_table(versions, number),
        Paragraph("The preset in full, with every value that was left out:"),
        Code(preset),
    ]
    return ReportSection("Making it again", blocks, own_page=True)


def parts(
    found: Findings, pictures: Pictures, number: Numbers, charts: Charts, versions: Mapping[str, str], preset: str
) -> list[ReportSection]:
    """Return the sections for a design without equilibrium: it has no displacements, stresses and reactions."""
    return [
        _summary(found, pictures, number),
        checks(found, number),
        subject(found, number),
        loads(found, pictures, number),
        *([comparison(found, number, charts)] if found.compared.rivals or found.volumes else []),
        *scope(found),
        reproduction(found, versions, preset, number),
    ]


def _summary(found: Findings, pictures: Pictures, number: Numbers) -> ReportSection:
    blocks: list[Block] = [banner(found)]
    blocks += [Paragraph(text, "lead") for text in (_advice(found), *standing(found))]
    blocks.append(_drawn(found, pictures, number))
    if found.drawn:
        blocks.append(_sizes(found, number))
    return ReportSection("Summary", blocks)


def _advice(found: Findings) -> str:
    carrying = [share for share, one in found.volumes if one.design.judgement]
    told = "No compliance, displacement or stress can be given for what is not in equilibrium. "
    if carrying:
        shares = enumeration([f"{share:.0%}" for share in carrying])
        return told + f"With its widths scaled it carries them at {shares} of the material."
    return told + (
        "More material (wider stripes, lower thresholds), a rim, or kept regions around loads and supports close such "
        "gaps; so do other phases, modes or frequencies."
    )


def _drawn(found: Findings, pictures: Pictures, number: Numbers) -> ReportFigure:
    if found.drawn:
        red = "; red reaches no support" if found.design.loose > 0 else ""
        told = f"What the pattern draws{red}. Arrows are loads, cones are supports."
        return pictures.everything(number.figure(told), 0.86)
    told = "The surface before it is cut. Arrows are loads, cones are supports."
    return pictures.case(found.cases[0], number.figure(told), 0.86)


def _sizes(found: Findings, number: Numbers) -> Table:
    made = found.design
    rows = [
        ("Mass", mass(made.mass), f"{share_of(made.area_fraction)} of the surface, {length(made.thickness)} thick"),
        ("Pieces", str(made.pieces), f"{share_of(made.loose)} of what is drawn reaches no support"),
        ("Compliance", "none", "not in equilibrium"),
        *(_carried(found, name) for name in ("full", *(rival.name for rival in found.compared.rivals))),
    ]
    return Table(number.table("Key results."), ("Result", "Value", "Remark"), rows, 3, "", (3, 2, 4))


def _carried(found: Findings, name: str) -> tuple[str, str, str]:
    one, full = found.compared[name], found.compared.full
    label = escaped(LABELS[name])
    if one.judgement is None:
        return label, "none", "does not carry the loads either" if one.structure or one.spread else "was not found"
    ratio = f"{digits_of(one.compliance / full.compliance)} times the compliance of the whole sheet"
    return label, mass(one.mass), "carries the loads" if name == "full" else f"carries the loads, with {ratio}"
