"""The verdict of a report in sentences: on the structure itself, and beside others of its mass."""

from dsfab.core.messages import length, mass, sentence
from dsfab.report.compliance.findings import LABELS, Findings, digits_of, enumeration, percent, times, within
from dsfab.report.html_pages import Banner, escaped, without_markup
from dsfab.study import losing_line
from dsfab.study.alternatives import Competitor

TITLES = {
    "pass": "Pass: the structure carries its loads, and its compliance is known",
    "fail": "Fail",
    "unknown": "Unknown: not everything that was asked could be established",
}


def banner(found: Findings) -> Banner:
    """Return the verdict on the structure itself."""
    bad = [one for one in found.checks if one.status == found.status != "pass"]
    if not found.carries:
        return Banner("fail", "Fail: the structure does not carry its loads", f"{_sentence(found.design.error)}.")
    if found.status == "fail":
        text = " ".join(f"{one.name}: {one.found} (wanted: {one.limit})." for one in bad)
        return Banner("fail", f"Fail: {enumeration([one.name.lower() for one in bad])}", text)
    sure = f"Compliance {within(found.judged.compliance, found.judged.bound, 'J')}"
    if theory := found.judged.theory:
        sure += f" (thin-shell theory: a solid is up to {percent(theory)} softer)"
    if found.status == "unknown":
        text = f"{sure}. " + " ".join(f"{one.name}: {one.found} (wanted: {one.limit})." for one in bad)
        return Banner("unknown", TITLES["unknown"], text)
    under = f" under load case {escaped(found.cases[0])}, which governs," if len(found.cases) > 1 else ""
    moves = length(found.governing.displacement.value)
    text = f"{sure}; all loads reach a support; the structure moves{under} by {moves} at most."
    return Banner("pass", TITLES["pass"], text)


def losses(found: Findings) -> list[Banner]:
    """Return a warning if a thinner sheet or isotropic stripes of the same mass are stiffer; else nothing."""
    stiffer = [one for one in found.compared.alternatives if one.is_stiffer]
    if not stiffer:
        return []
    sure = {one.name for one in stiffer if one.low > 1}
    title = escaped(sentence(losing_line(stiffer)))
    if not sure:
        return [Banner("unknown", title, "What is known of the two compliances does not tell them apart.")]
    why = {
        "thinner": "Openings have to be wanted for other reasons than stiffness, such as light or air.",
        "isotropic": "Following the stress, as this design does it, does not pay here.",
    }
    return [Banner("fail", title, " ".join(told for name, told in why.items() if name in sure))]


def standing(found: Findings) -> list[str]:
    """Return a sentence on the design beside each competitor."""
    told = [_against(found, rival) for rival in found.compared.rivals]
    if not told:
        told = ["It was compared with no other structure."]
    return told


def _against(found: Findings, rival: Competitor) -> str:
    label = LABELS[rival.name]
    label = label if label.startswith("SIMP") else label[0].lower() + label[1:]
    if rival.judgement is None:
        return f"No structure was found for <b>{label}</b>: {escaped(shortly(rival.error))}."
    if not found.carries:
        ratio = f"{digits_of(rival.compliance / found.compared.full.compliance)} times that of the whole sheet"
        return f"Of the same mass, <b>{label}</b> would carry the loads; compliance {ratio}."
    low, middle, high = found.gain(rival)
    if rival.name == "thinner":
        return _against_thinner(found, rival)
    best = ", the best of its variants," if rival.spread else ""
    at = f"Beside <b>{label}</b>{best} of the same mass the design is"
    if low > 1:
        return f"{at} {times(low, middle, high)} times as stiff."
    if high < 1:
        return f"{at} <b>softer</b>: {times(low, middle, high)} times as stiff."
    return f"{at} {times(low, middle, high)} times as stiff: too close to call within what is known."


def _sentence(error: str) -> str:
    return escaped(error[0].upper() + error[1:])


def shortly(error: str) -> str:
    """Return the reason of a failure without the example that follows it."""
    return error.split("; the first: ")[0]


def _against_thinner(found: Findings, rival: Competitor) -> str:
    low, middle, high = found.gain(rival)
    kept, thin = percent(found.design.area_fraction), length(rival.thickness)
    whole = f"a <b>whole sheet without openings, {thin} thick</b>, of the same mass"
    if high < 1:
        return (
            f"It must be said plainly: {whole} is <b>{1 / middle:.3g} times as stiff as this design</b> "
            f"({1 / high:.3g} to {1 / low:.3g}). Keeping {kept} of the surface does not pay in stiffness here; "
            "openings have to be wanted for other reasons, such as light, air, or a thickness that cannot be had."
        )
    if low > 1:
        return f"Beside {whole} the design is {times(low, middle, high)} times as stiff: concentrating material pays."
    return f"Beside {whole} the design is {times(low, middle, high)} times as stiff: too close to call."


def thinner_at_volumes(found: Findings) -> str:
    """Say at which masses a thinner whole sheet is stiffer; '' if the comparison has none."""
    pairs = [
        (f"{share:.0%}", one.design, one["thinner"])
        for share, one in found.volumes
        if any(rival.name == "thinner" and rival.judgement for rival in one.rivals)
    ]
    lost = [share for share, own, thin in pairs if _least(own) > _most(thin)]
    won = [share for share, own, thin in pairs if _most(own) < _least(thin)]
    left = [share for share, _, _ in pairs if share not in (*lost, *won)]
    told = []
    if lost:
        told.append(f"<b>At {enumeration(lost)} of the material a thinner whole sheet of the same mass is stiffer.</b>")
    if won:
        where = "every share that was tried" if len(won) == len(pairs) else f"{enumeration(won)} of the material"
        told.append(f"At {where} the design is stiffer than a thinner whole sheet of the same mass.")
    if left:
        told.append(f"At {enumeration(left)} design and thinner sheet are too close to call within their bounds.")
    return " ".join(told)


def _least(one: Competitor) -> float:
    return one.compliance * (1 - ((one.judgement.bound if one.judgement else None) or 0.0))


def _most(one: Competitor) -> float:
    return one.compliance * (1 + ((one.judgement.bound if one.judgement else None) or 0.0))


def one_line(found: Findings) -> str:
    """Return for the terminal 'pass: compliance 59.9 J ± 1.8 % ...'."""
    if not found.carries:
        return "fail: the design does not carry its loads"  # the table above has the reason
    told = within(found.judged.compliance, found.judged.bound, "J")
    bad = next((one for one in found.checks if one.status == found.status != "pass"), None)
    known = bad is None or bad.name == "Compliance is known"
    reason = found.judged.reason if known or bad is None else f"{bad.name}: {bad.found}"
    return f"{found.status}: compliance {told}, {mass(found.design.mass)}; {without_markup(reason)}"
