"""Tables of a compliance report."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import counted, force, mass
from dsfab.report.compliance.findings import (
    LABELS,
    CheckLine,
    Findings,
    digits_of,
    length,
    percent,
    point,
    quantity,
    share_of,
    unit_for,
    within,
)
from dsfab.report.html_pages import Numbers, Table, escaped
from dsfab.slicing.measures.pattern_quality import FamilyQuality, PatternQuality
from dsfab.statics import elements_of
from dsfab.study.alternatives import Competitor
from dsfab.surface import Surface

OFF_CORNERS = "further than a rib's width from corners"
"""Region in which the largest stress converges."""

DUST = 5e-5
"""Share of the largest force below which a force is shown as 0."""


def checks_table(checks: list[CheckLine], number: Numbers, caption: str) -> Table:
    """Checks with their result, limit and verdict."""
    rows = [(one.name, one.found, one.limit, one.status) for one in checks]
    return Table(number.table(caption), ("Check", "Found", "Wanted", "Verdict"), rows, 4, "", (3.2, 5.2, 2.4, 1.2))


def key_table(found: Findings, number: Numbers) -> Table:
    """The numbers of the first page."""
    (moved, moves), (strained, strains) = found.decisive("displacement"), found.decisive("stress")
    several = len(found.cases) > 1
    rows = [
        ("Mass", mass(found.design.mass), f"{share_of(found.design.area_fraction)} of the surface kept"),
        ("Compliance", within(found.judged.compliance, found.judged.bound, "J"), _over_full(found)),
        (
            "Largest displacement",
            length(moves.displacement.value),
            f"at {point(moves.displacement.place)}{f', {escaped(moved)}' if several else ''}",
        ),
        (
            "Von Mises stress",
            quantity(strains.stress.quantile, "Pa"),
            f"on 99 % of the area; {quantity(strains.stress.settled, 'Pa')} {OFF_CORNERS}"
            + (f", {escaped(strained)}" if several else ""),
        ),
    ]
    if several:
        rows.insert(0, ("Governing load case", escaped(found.cases[0]), f"of {len(found.cases)}"))
    return Table(number.table("Key results."), ("Result", "Value", "Remark"), rows, 3, "", (2.2, 2.2, 5))


def _over_full(found: Findings) -> str:
    full = found.compared.full
    return f"{found.design.compliance / full.compliance:.3g} times that of the whole sheet of {mass(full.mass)}"


def structure_table(found: Findings, number: Numbers) -> Table:
    """Sizes, mass and material of the structure."""
    preset, design, task = found.task.preset, found.design, found.task
    statics, sheet = preset.statics, found.structure.sheet.surface if found.drawn else None
    size = [length(float(x)) for x in np.ptp(task.surface.V, axis=0)]
    rows = [
        ("Surface", f"{digits_of(task.surface.area)} m², {' × '.join(size)}"),
        ("Kept", _kept(design, sheet)),
        ("Thickness", length(statics.thickness)),
        ("Mass", mass(design.mass) if sheet else "-"),
        ("Smallest member", length(design.smallest_member)),
        *([("Material", statics.material_words)] if statics.material else []),
        ("Young's modulus; Poisson's ratio", f"{quantity(statics.young, 'Pa')}; {statics.poisson:g}"),
        ("Density", f"{statics.density:g} kg/m³"),
        ("Strength", quantity(statics.strength, "Pa") if statics.strength else "not given: stress is not judged"),
        ("Mesh of the surface", f"{_thousands(task.surface.n)} vertices, edges of {length(task.surface.mean_edge)}"),
    ]
    if sheet:
        rows.append(("Mesh as it is cut", f"{_thousands(sheet.m)} triangles"))
    return Table(number.table("Structure and material."), ("Property", "Value"), rows, 2, "", (2, 5))


def pattern_table(found: PatternQuality, number: Numbers) -> Table:
    """Spacing, dead ends and direction of both families of members."""
    drawn = [(name, one) for name, one in found.families if one.drawn]
    rows = [
        ("Distance of members, median", *(length(one.spacing[1]) for _, one in drawn)),
        ("Clear opening, on nine tenths of the area", *(_between(one) for _, one in drawn)),
        ("Widest over narrowest distance (P95/P5)", *(f"{one.evenness:.2f}" for _, one in drawn)),
        ("Dead ends", *(str(one.dead) for _, one in drawn)),
        ("Openings narrower than the members beside them", *(str(one.slits) for _, one in drawn)),
        ("Off the stress, mean", *(f"{one.deviation:.1f}°" for _, one in drawn)),
        ("Off the stress by over 30°", *(percent(one.off) for _, one in drawn)),
    ]
    told = f"Members cross at {found.crossing_angle:.0f}° or more." if len(drawn) == 2 else "One family of members."
    if found.symmetry_error is not None:
        told += f" {percent(found.symmetry_error)} of the surface differs from its image under the design's symmetry."
    heads = [f"{name.capitalize()} members" for name, _ in drawn]
    widths = (3, *(2 for _ in drawn))
    return Table(number.table("The pattern."), ("Measure", *heads), rows, 1 + len(drawn), told, widths)


def _between(one: FamilyQuality) -> str:
    return f"{length(one.opening[0])} to {length(one.opening[2])}" if one.opening[2] > 0 else "none"


def _kept(design: Competitor, sheet: Surface | None) -> str:
    if sheet is None:
        return "nothing: see the verdict"
    return f"{digits_of(sheet.area)} m² ({share_of(design.area_fraction)}), in {counted(design.pieces, 'piece')}"


def loads_table(found: Findings, number: Numbers) -> Table:
    """Sums of the forces of each case and combination, on the cut sheet if it carries them all, and the checks on
    each.
    """
    task, rows = found.task, []
    cases = task.statics.cases
    uncut = {name: case.load.force.sum(axis=0) for name, case in cases.items()}
    sums = found.sums or uncut
    factor, unit = unit_for(max(float(np.abs(total).max()) for total in sums.values()), "N")
    combined = any(case.factors for case in cases.values())
    states = {one.name: one.limit_state for one in task.preset.surface.sums}
    asked = {"ULS": "stress, buckling", "SLS": "displacement", "": "all" if any(states.values()) else "yes"}
    for name in found_order(found):
        case = cases[name]
        made = " + ".join(f"{k:g} {escaped(part)}" for part, k in case.factors.items()) if case.factors else ""
        followed = "yes" if name in task.preset.followed else "no"
        judged = "no" if name not in found.cases else asked[states.get(name, "")]
        made_of = (made,) if combined else ()
        rows.append((escaped(name), *made_of, *(_small(x / factor) for x in sums[name]), followed, judged))
    more, wide = (("Made of",), (2.4,)) if combined else ((), ())
    head = ("Load case", *more, *(f"F{axis}, {unit}" for axis in "xyz"), "Pattern follows", "Checked")
    widths = (2, *wide, 1.3, 1.3, 1.3, 1.5, 1.2)
    told = f"Sums of the loads on the {'cut' if found.sums else 'uncut'} sheet."
    rule = task.preset.surface.combinations
    note = f"Combined after {rule}, with its factors where surface.factors gives no others. " if rule else ""
    return Table(number.table(told), head, rows, 2 if combined else 1, note + _uncut_note(sums, uncut), widths)


def _uncut_note(sums: Mapping[str, Floats], uncut: Mapping[str, Floats]) -> str:
    size = {name: tuple(float(np.linalg.norm(of[name])) for of in (sums, uncut)) for name in uncut}
    more = [f"{escaped(name)} {force(whole)}" for name, (cut, whole) in size.items() if whole > (1 + 1e-6) * cut]
    if not more:
        return ""
    return f"The uncut sheet carries more of its own weight, or of what is not covered: {', '.join(more)}."


def found_order(found: Findings) -> list[str]:
    """Return the names of all cases, those with a judgement first."""
    return [*found.cases, *(name for name in found.task.statics.cases if name not in found.cases)]


def acting_table(found: Findings, number: Numbers) -> Table:
    """Loads and supports of the preset."""
    given = found.task.preset.surface
    rows = [(load.name or "Load", load.case, load.kind.replace("_", " "), _places(load)) for load in given.load]
    rows += [
        (
            one.name or f"Support {k}",
            "all",
            f"holds {', '.join(one.hold)}" if one.hold else "springs" if one.spring else "clamps",
            _places(one),
        )
        for k, one in enumerate(given.support, start=1)
    ]
    cells = [tuple(escaped(cell) for cell in row) for row in rows]
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


def _places(thing: Any) -> str:
    """For example 'axis x, end min; force (0, -1000, 0) N' of a load or a support."""
    told: list[str] = []
    for one in fields(thing):
        value = getattr(thing, one.name)
        if one.name in ("kind", "case", "hold", "name", "covered") or value is None or value is False:
            if one.name == "covered" and not value:
                told.append("on the members alone")
            continue
        if one.name == "at":
            told.insert(0, _picker(value))
        else:
            told.append(f"{one.name.replace('_', ' ')} {_value(value)} {UNITS.get(one.name, '')}".strip())
    return "; ".join(word for word in told if word)


def _picker(at: Any) -> str:
    given = [(one.name, getattr(at, one.name)) for one in fields(at) if one.name != "pick"]
    kept = [f"{name} {_value(value)}" for name, value in given if value is not None and value is not False]
    return f"{at.pick} ({', '.join(kept)})" if kept else str(at.pick)


def _value(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        if len(value) > 6:
            return f"{len(value)} values"
        return f"({', '.join(_value(one) for one in value)})"
    return str(value)


def levels_table(found: Findings, number: Numbers) -> Table | None:
    """Meshes of the full check, for the governing case; None after a quick one."""
    check, name = found.judged.check, found.cases[0]
    if check is None:
        return None
    factor, unit = unit_for(check.case(name).value, "J")
    rows = []
    for k, level in enumerate(check.levels, start=1):
        apart = level.midedge[name] / level.compliance[name] - 1 if name in level.midedge else None
        rows.append(
            (
                str(k),
                _thousands(level.triangles),
                _thousands(level.unknowns),
                digits_of(level.compliance[name] / factor, 5),
                digits_of(level.midedge[name] / factor, 5) if name in level.midedge else "-",
                f"{100 * apart:+.2f} %" if apart is not None else "-",
                f"{100 * level.zz_membrane[name]:.2f} %",
                f"{100 * level.zz_bending[name]:.2f} %",
                f"{level.residual:.0e}",
                f"{level.seconds:.1f}",
                f"{level.memory / 1e9:.2f}",
            )
        )
    value = check.case(name)
    note = (
        f"Extrapolated: <b>{digits_of(value.value / factor, 5)} {unit} ± {percent(value.bound)}</b>. "
        f"That is of a thin sheet: a solid of it is up to {percent(value.theory)} softer. "
        "Level 1 is the mesh as it is cut, each further one has four triangles for one, new points on the smooth "
        "surface. The spread of the pairs is that of level 1. ZZ: recovery error. Memory of the whole process."
    )
    head = (
        "Level",
        "Triangles",
        "Unknowns",
        f"{elements_of('compliance')}, {unit}",
        f"{elements_of('spread')}, {unit}",
        "Spread",
        "ZZ memb.",
        "ZZ bend.",
        "Residual",
        "s",
        "GB",
    )
    told = f"Compliance mesh after mesh{'' if len(found.cases) == 1 else f', load case {escaped(name)}'}."
    return Table(number.table(told), head, rows, 1, note, (0.8, 1.2, 1.2, 1.3, 1.4, 1, 1, 1, 1, 0.8, 0.8))


def cases_table(found: Findings, number: Numbers) -> Table:
    """Cases with a judgement, the governing one first."""
    check, rows = found.judged.check, []
    for name in found.cases:
        case = found.judged.cases[name]
        value = check.case(name) if check else None
        rows.append(
            (
                escaped(name),
                within(value.value, value.bound, "J") if value else within(case.compliance, found.judged.bound, "J"),
                value.status if value else "unknown",
                length(case.displacement.value),
                quantity(case.stress.quantile, "Pa"),
                quantity(case.tension.quantile, "Pa"),
                quantity(case.compression.quantile, "Pa"),
            )
        )
    head = ("Load case", "Compliance", "Verdict", "Moves at most", "von Mises", "Tension", "Compression")
    note = "Stress: what 99 % of the area does not exceed, of the top, the middle and the bottom of the sheet."
    return Table(
        number.table("Load cases, the governing one first."), head, rows, 1, note, (1.6, 2.4, 1.1, 1.4, 1.4, 1.4, 1.6)
    )


def stress_table(found: Findings, number: Numbers) -> Table:
    """Largest stresses with their places, of the case that decides the stress."""
    name, case = found.decisive("stress")
    rows = [
        (what, quantity(one.quantile, "Pa"), quantity(one.settled, "Pa"), quantity(one.value, "Pa"), point(one.place))
        for what, one in (
            ("von Mises", case.stress),
            ("Largest principal (tension)", case.tension),
            ("Smallest principal (compression)", case.compression),
        )
    ]
    head = ("Stress", "99 % of the area", "Off corners by a rib's width", "This mesh shows", "At")
    note = (
        "At corners that bend inwards and where supports end, the peak is not a number: it is infinite, and what a "
        "mesh shows grows with every finer one. Judge by the first two columns: what 99 % of the area does not exceed, "
        "and the largest further than a rib's width from all of them."
    )
    under = f" under {escaped(name)}" if len(found.cases) > 1 else ""
    told = f"Stress{under}, of a mesh of {_thousands(case.triangles)} triangles."
    return Table(number.table(told), head, rows, 1, note, (2.4, 1.4, 1.6, 1.4, 2))


def reactions_table(found: Findings, name: str, number: Numbers) -> Table:
    """Reactions of each support in one case, and their balance with the load."""
    case = found.judged.cases[name]
    loads = found.fields[name].load.force.sum(axis=0)
    held = np.sum(case.reactions, axis=0)
    factor, unit = unit_for(float(np.abs(loads).max()), "N")
    dust = DUST * max(1.0, float(np.abs([*case.reactions, loads]).max()) / factor)

    def line(text: str, force: Any) -> tuple[str, ...]:
        return (text, *(_small(float(x) / factor, dust) for x in (*force, np.linalg.norm(force))))

    supports = found.task.preset.surface.support
    names = [escaped(one.name) or f"Support {k}" for k, one in enumerate(supports, start=1)]
    rows = [line(text, force) for text, force in zip(names, case.reactions, strict=True)]
    rows += [line("All supports", held), line("Loads", loads)]
    note = (
        f"Sum of loads and reactions: {case.imbalance:.0e} of the load. Residual of the equations: {case.residual:.0e}."
    )
    head = ("", *(f"R{axis}, {unit}" for axis in "xyz"), f"Size, {unit}")
    told = f"Reactions{'' if len(found.cases) == 1 else f', load case {escaped(name)}'}."
    return Table(number.table(told), head, rows, 1, note, (2, 1, 1, 1, 1), (len(rows) - 2,))


def rivals_table(found: Findings, number: Numbers) -> Table:
    """Competitors with mass, compliance, displacement, stress and level of judgement."""
    rows = [_rival(found, one) for one in found.compared.competitors]
    _, unit = unit_for(found.unit_of, "J")
    head = (
        "Structure", "Mass", "Kept", f"Compliance, {unit}", "Over whole sheet", "Over design", "Moves", "99 % stress",
        "Level",
    )  # fmt: skip
    names = [one.name for one in found.compared.competitors]
    asked = {one.judgement.level for one in found.compared.competitors if one.judgement}
    note = "Ratios of compliance: above 1 is softer. Level full: two meshes or three, extrapolated. "
    note += (
        "Level quick: one solve on the cut mesh; its bound holds for nine designs in ten." if "quick" in asked else ""
    )
    return Table(
        number.table("The design and others under the same loads, on the same supports, with the same kept regions."),
        head, rows, 1, note, (2.6, 1.1, 1.1, 1.9, 1, 1, 1.4, 1.4, 0.8), (names.index("design"),),
    )  # fmt: skip


def _rival(found: Findings, one: Competitor) -> tuple[str, ...]:
    name = LABELS[one.name] + (f" ({escaped(one.variant)})" if one.variant else "")
    if one.judgement is None:
        sizes = (mass(one.mass), share_of(one.area_fraction)) if one.structure else ("-", "-")
        return (name, *sizes, "carries nothing", "-", "-", "-", "-", "-")
    factor, _ = unit_for(found.unit_of, "J")
    worst = one.judgement.worst
    return (
        name,
        mass(one.mass),
        share_of(one.area_fraction),
        f"{digits_of(one.compliance / factor)} ± {percent(one.judgement.bound or 0)}",
        digits_of(one.compliance / found.compared.full.compliance),
        digits_of(one.compliance / found.design.compliance) if found.carries else "-",
        length(worst("displacement").value),
        quantity(worst("stress").quantile, "Pa"),
        one.judgement.level,
    )


def volumes_table(found: Findings, number: Numbers) -> Table:
    """Compliance over that of the whole sheet, at each share of the surface."""
    names = [one.name for one in found.volumes[0][1].competitors if one.name != "full"]
    rows = []
    for share, compared in found.volumes:
        cells = [_ratio(compared[name], compared.full.compliance) for name in names]
        rows.append((percent(share), mass(share * compared.full.mass), *cells))
    head = ("Share", "Mass", *(LABELS[name] for name in names))
    asked = {one.judgement.level for _, compared in found.volumes for one in compared.competitors if one.judgement}
    how = {
        frozenset(("full",)): "Judged by full checks.",
        frozenset(("quick",)): "Judged by one solve each, whole sheets on their coarse meshes too.",
    }.get(frozenset(asked), "Whole sheets are judged by full checks, those that are cut by one solve.")
    note = f"Compliance over that of the whole sheet; - : carries nothing at that share. {how}"
    return Table(number.table("Compliance at other masses."), head, rows, 1, note)


def _ratio(one: Competitor, full: float) -> str:
    return f"{one.compliance / full:.3g}" if one.judgement else "-"


def versions_table(versions: Mapping[str, str], number: Numbers) -> Table:
    """Versions of dsfab and of the libraries that a result depends on."""
    return Table(number.table("Versions."), ("Part", "Version"), list(versions.items()), 2, "", (1, 3))


def _thousands(count: int) -> str:
    return f"{count:,}".replace(",", " ")


def _small(value: float, dust: float = DUST) -> str:
    return "0" if abs(value) < dust else digits_of(value, 4)
