"""The paper's claim on the sphere, on its page: compliance over mass of each rival with its bound."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from dsfab.report.paper.volumes import RIVALS
from dsfab.wording import bounded

Row = Mapping[str, Any]
"""A row of sphere_volumes.json."""

OURS = ("row", "design", "stripes")
OTHERS = (("isotropic", "the best isotropic stripes"), ("thinner", "a thinner sheet"))
"""Whose stiffness is told over whose."""


def claim_section(rows: Sequence[Row]) -> str:
    """The section of the page about the sphere; '' without rows."""
    if not rows:
        return ""
    known = {(row["name"], row["volume"]): row for row in rows}
    shares = sorted({row["volume"] for row in rows})
    head = "".join(f"<th>{share:.0%}</th>" for share in shares)
    lines = []
    for name in (name for name in RIVALS if any(key[0] == name for key in known)):
        cells = "".join(_cell(known.get((name, share))) for share in shares)
        lines.append(f"<tr><th>{escape(RIVALS[name])}</th>{cells}</tr>")
    words = (
        "<p>The paper's claim, tested: how stiff is a sphere of one mass, held at a pole and pressed at the other?</p>"
        f"<ul>{''.join(f'<li>{line}</li>' for line in _words(known, shares))}</ul><p>{_verdicts(rows)} The numbers are "
        'in <a href="sphere_volumes.json">its data</a>, again by <code>dsfab reproduce sphere --volumes</code>.</p>'
    )
    table = (
        '<table class="measured"><caption>Compliance, mJ, of the share of the surface that is kept, with its bound'
        f"</caption><tr><th></th>{head}</tr>{''.join(lines)}</table>"
    )
    image = '<img src="sphere_volumes.svg" alt="Compliance over mass on the sphere" style="max-width: 54rem">'
    return f'<section id="volumes"><h2>Compliance over mass</h2>{words}{table}{image}</section>'


def stiffness(own: Row | None, rival: Row | None) -> tuple[float, float, float] | None:
    """How many times as stiff one is as another, and the least and the most of it by the bounds of both; None where
    either does not carry its loads."""
    if not own or not rival or not own["compliance_J"] or not rival["compliance_J"]:
        return None
    ratio = rival["compliance_J"] / own["compliance_J"]
    mine, theirs = (float(row.get("bound") or 0.0) for row in (own, rival))
    return ratio, ratio * (1 - theirs) / (1 + mine), ratio * (1 + theirs) / (1 - mine)


def _cell(row: Row | None) -> str:
    """A compliance with its bound, in italics where the verdict is not that it passes; why is its title."""
    if not row or not row["compliance_J"]:
        reason = (row or {}).get("error") or "not judged"
        return f'<td title="{escape(reason, quote=True)}">not carried</td>'
    value, bound = 1000 * row["compliance_J"], row.get("bound")
    told = bounded(value, bound) if bound else f"{value:.3g}"
    if row["verdict"] != "pass":
        told = f"<i>{told}</i>"
    return f'<td title="{escape(row["reason"], quote=True)}">{told}</td>'


def _words(known: Mapping[tuple[str, float], Row], shares: Sequence[float]) -> Iterator[str]:
    """A line for each of ours over isotropic stripes and over a thinner sheet, whoever wins."""
    for name in OURS:
        for other, called in OTHERS:
            told = []
            for share in shares:
                if found := stiffness(known.get((name, share)), known.get((other, share))):
                    ratio, least, most = found
                    alike = " (too close to tell)" if least <= 1 <= most else ""
                    how = f"{ratio:.3g} times as stiff" if ratio >= 1 else f"{1 / ratio:.3g} times as soft"
                    told.append(f"{how} at {share:.0%}{alike}")
            if told:
                yield f"{RIVALS[name][0].upper()}{RIVALS[name][1:]} against {called}: {', '.join(told)}."


def _verdicts(rows: Sequence[Row]) -> str:
    """How well the numbers are known, and what is not."""
    judged = [row for row in rows if row["compliance_J"]]
    sure = [row for row in judged if row["verdict"] == "pass"]
    if not sure:
        return "Every number is of one solve on the cut mesh; none is a verdict of finer and finer meshes."
    least, most = (f"{100 * end(row['bound'] for row in sure):.1f}" for end in (min, max))
    told = (
        f"{len(sure)} of {len(judged)} numbers are verdicts that pass, of finer and finer meshes, known to {least} to "
        f"{most} %; all are about thin sheets."
    )
    open_ones = [f"{RIVALS[row['name']]} at {row['volume']:.0%}" for row in judged if row["verdict"] != "pass"]
    return told + (f" Without a verdict, in italics: {', '.join(open_ones)}." if open_ones else "")
