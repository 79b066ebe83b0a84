"""The report on a design that does not carry its loads: why, what was drawn, and what carries them at its mass."""

from collections.abc import Mapping

from dsfab.report.compliance import sections
from dsfab.report.compliance.charts import Charts
from dsfab.report.compliance.document import Block, Numbers, Paragraph, ReportFigure, ReportSection, Table, escaped
from dsfab.report.compliance.findings import LABELS, Findings
from dsfab.report.compliance.pictures import Pictures
from dsfab.report.compliance.verdict_words import banner, standing
from dsfab.report.compliance.words import digits_of, enumeration, length, share_of
from dsfab.wording import mass


def parts(
    found: Findings,
    pictures: Pictures,
    number: Numbers,
    charts: Charts,
    versions: Mapping[str, str],
    preset: str,
) -> list[ReportSection]:
    """All of it; there are no displacements, stresses and reactions of what is not in equilibrium."""
    return [
        _summary(found, pictures, number),
        sections.checks(found, number),
        sections.subject(found, number),
        sections.loads(found, pictures, number),
        *([sections.comparison(found, number, charts)] if found.compared.rivals or found.volumes else []),
        *sections.scope(found),
        sections.reproduction(found, versions, preset, number),
    ]


def _summary(found: Findings, pictures: Pictures, number: Numbers) -> ReportSection:
    blocks: list[Block] = [banner(found)]
    blocks += [Paragraph(text, "lead") for text in (_advice(found), *standing(found))]
    blocks.append(_drawn(found, pictures, number))
    if found.drawn:
        blocks.append(_sizes(found, number))
    return ReportSection("Summary", blocks)


def _advice(found: Findings) -> str:
    """What there is to know and to do."""
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
