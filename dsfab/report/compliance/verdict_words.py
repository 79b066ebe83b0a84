"""Sentences of a report: verdict and comparisons."""

from dsfab.core.messages import length, mass, sentence
from dsfab.report.compliance.findings import (
    LABELS,
    Findings,
    enumeration,
    percent,
    range_words,
    significant_digits,
    within,
)
from dsfab.report.html_pages import Banner, escaped_text, without_markup
from dsfab.study import losing_line
from dsfab.study.alternatives import Competitor

TITLES = {
    "pass": "Pass: the structure carries its loads, and its compliance is reliable",
    "fail": "Fail",
    "unknown": "Unknown: at least one check has no clear result",
}


def verdict_banner(findings: Findings) -> Banner:
    """Return the banner with the verdict on the structure."""
    missed = [check for check in findings.checks if check.status == findings.status != "pass"]
    if not findings.carries:
        error = findings.design.error
        text = escaped_text(error[0].upper() + error[1:])
        return Banner("fail", "Fail: the structure does not carry its loads", f"{text}.")
    if findings.status == "fail":
        text = " ".join(f"{check.name}: {check.result} (wanted: {check.limit})." for check in missed)
        return Banner("fail", f"Fail: {enumeration([check.name.lower() for check in missed])}", text)
    words = f"Compliance {within(findings.judgement.compliance, findings.judgement.bound, 'J')}"
    if theory := findings.judgement.theory:
        words += f" (thin-shell theory: a solid is up to {percent(theory)} softer than a thin sheet)"
    if findings.status == "unknown":
        text = f"{words}. " + " ".join(f"{check.name}: {check.result} (wanted: {check.limit})." for check in missed)
        return Banner("unknown", TITLES["unknown"], text)
    under = f" under the governing load case {escaped_text(findings.cases[0])}" if len(findings.cases) > 1 else ""
    moves = length(findings.governing.displacement.value)
    text = f"{words}; all loads reach a support; the largest displacement{under} is {moves}."
    return Banner("pass", TITLES["pass"], text)


def alternative_banners(findings: Findings) -> list[Banner]:
    """Return a warning if a thinner sheet or isotropic stripes of equal mass are stiffer."""
    stiffer = [alternative for alternative in findings.compared.alternatives if alternative.is_stiffer]
    if not stiffer:
        return []
    certain_names = {alternative.name for alternative in stiffer if alternative.low > 1}
    title = escaped_text(sentence(losing_line(stiffer)))
    if not certain_names:
        return [Banner("unknown", title, "The compliances of design and alternative are equal within their errors.")]
    reasons = {
        "thinner": "Openings make sense only for other reasons than stiffness, such as light or air.",
        "isotropic": "Stripes along the stress, as in this design, do not make this structure stiffer.",
    }
    return [Banner("fail", title, " ".join(reason for name, reason in reasons.items() if name in certain_names))]


def comparison_sentences(findings: Findings) -> list[str]:
    """Return a sentence for each competitor that compares its stiffness with the design's stiffness."""
    lines = [_rival_sentence(findings, rival) for rival in findings.compared.rivals]
    return lines or ["The design was compared with no other structure."]


def _rival_sentence(findings: Findings, rival: Competitor) -> str:
    label = LABELS[rival.name]
    label = label if label.startswith("SIMP") else label[0].lower() + label[1:]
    if rival.judgement is None:
        return f"No structure was found for <b>{label}</b>: {escaped_text(first_reason(rival.error))}."
    if not findings.carries:
        ratio = significant_digits(rival.compliance / findings.compared.full.compliance)
        words = f"compliance {ratio} times that of the whole sheet"
        return f"Of the same mass, <b>{label}</b> would carry the loads; {words}."
    low, middle, high = findings.stiffness_ratio(rival)
    if rival.name == "thinner":
        return _thinner_sentence(findings, rival)
    rival_words = f"the best variant of <b>{label}</b>" if rival.spread else f"<b>{label}</b>"
    words = f"The design is {range_words(low, middle, high)} times as stiff as {rival_words} of the same mass"
    if low > 1:
        return f"{words}."
    if high < 1:
        return f"{words}, so it is <b>softer</b>."
    return f"{words}; within the errors, either structure may be stiffer."


def first_reason(error: str) -> str:
    """Return the part of an error's text before the words '; the first: '."""
    return error.split("; the first: ")[0]


def _thinner_sentence(findings: Findings, rival: Competitor) -> str:
    low, middle, high = findings.stiffness_ratio(rival)
    kept_share, thickness = percent(findings.design.area_fraction), length(rival.thickness)
    thinner_words = f"a <b>whole sheet without openings, {thickness} thick</b>, of the same mass"
    if high < 1:
        return (
            f"Please note: {thinner_words} is <b>{1 / middle:.3g} times as stiff as this design</b> "
            f"({1 / high:.3g} to {1 / low:.3g}). Keeping only {kept_share} of the surface brings no stiffness here. "
            "Openings make sense only for other reasons, such as light, air, or a thin sheet that is not available."
        )
    verdict = (
        "concentrating the material helps" if low > 1 else "within the error bounds, either structure may be stiffer"
    )
    return f"The design is {range_words(low, middle, high)} times as stiff as {thinner_words}: {verdict}."


def thinner_sheet_words(findings: Findings) -> str:
    """Return sentences that compare the design with a thinner sheet at several masses; '' without a comparison."""
    pairs = [
        (f"{share:.0%}", _compliance_range(compared.design), _compliance_range(compared["thinner"]))
        for share, compared in findings.volumes
        if any(rival.name == "thinner" and rival.judgement for rival in compared.rivals)
    ]
    lost = [share for share, design, thinner in pairs if design[0] > thinner[1]]
    won = [share for share, design, thinner in pairs if design[1] < thinner[0]]
    open_shares = [share for share, _, _ in pairs if share not in (*lost, *won)]
    lines = []
    if lost:
        shares = f"{enumeration(lost)} of the material"
        lines.append(f"<b>At {shares} a thinner whole sheet of the same mass is stiffer.</b>")
    if won:
        where = "every tried share of material" if len(won) == len(pairs) else f"{enumeration(won)} of the material"
        lines.append(f"At {where} the design is stiffer than a thinner whole sheet of the same mass.")
    if open_shares:
        shares = enumeration(open_shares)
        lines.append(
            f"At {shares} of the material, the error bounds of the design and of the thinner sheet overlap, so either "
            f"may be stiffer."
        )
    return " ".join(lines)


def _compliance_range(competitor: Competitor) -> tuple[float, float]:
    bound = (competitor.judgement.bound if competitor.judgement else None) or 0.0
    return competitor.compliance * (1 - bound), competitor.compliance * (1 + bound)


def verdict_line(findings: Findings) -> str:
    """Return the verdict as a line for the terminal: 'pass: compliance 59.9 J ± 1.8 % ...'."""
    if not findings.carries:
        return "fail: the design does not carry its loads"  # the printed table has the reason
    words = within(findings.judgement.compliance, findings.judgement.bound, "J")
    missed_check = next((check for check in findings.checks if check.status == findings.status != "pass"), None)
    reason = findings.judgement.reason
    if missed_check is not None and missed_check.name != "Compliance is known":
        reason = f"{missed_check.name}: {missed_check.result}"
    return f"{findings.status}: compliance {words}, {mass(findings.design.mass)}; {without_markup(reason)}"
