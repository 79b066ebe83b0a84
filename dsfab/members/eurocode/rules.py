"""Checks of members by the Eurocode of their material. A bay is the part of a member between two nodes."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from dsfab.core.errors import StaticsError
from dsfab.core.materials import NO_STRENGTH
from dsfab.core.messages import length
from dsfab.members.eurocode import steel, timber
from dsfab.members.eurocode.checks import CheckRatios, MemberBays, Utilisation, plain_checks
from dsfab.members.eurocode.grades import STEEL, TIMBER, Duration, SteelGrade, TimberGrade, k_mod
from dsfab.members.eurocode.steel import SteelFactors
from dsfab.members.eurocode.timber import TimberFactors

UNCHECKED = (
    "joints: bolts, welds, holes, splices, and stress within nodes",
    "stability of the whole structure: each bay is checked for buckling as if its nodes could not move",
    "effects of displacements on forces (second order), and imperfections of the surface",
    "slip between layers: dsfab treats each section as solid, as thick as the sheet",
    "plates, filled openings, and discs and short members without a bay between two nodes",
    "fire, fatigue, brittle fracture, corrosion, and limits of displacements",
)
"""Topics that dsfab does not check."""


@dataclass(frozen=True)
class Rules:
    """Rules for checking members. young, shear : elastic moduli, Pa.    strength : Pa, if no standard applies.
    durations : load duration of each case.    loads : sentence on the loads.
    combined : True if the cases are load combinations with partial factors."""

    material: str
    young: float
    shear: float
    strength: float
    durations: Mapping[str, Duration] = field(default_factory=dict)
    steel: SteelFactors = field(default_factory=SteelFactors)
    timber: TimberFactors = field(default_factory=TimberFactors)
    loads: str = ""
    combined: bool = True


def utilisation(bays: MemberBays, rules: Rules) -> Utilisation:
    """Return the utilisation (force divided by resistance) of each bay of the members, in each load case.
    Raises StaticsError if there is no bay, or if the material has neither a standard nor a strength."""
    if not bays.member:
        raise StaticsError(
            "no member has a bay between two nodes, so the report checks nothing; see dsfab export --to csv"
        )
    check, standard, assumed = _method(rules, bays.thickness)
    results = {case: check(bays, case) for case in bays.forces}
    checks = tuple(next(iter(results.values()), {}))
    values, station = {}, {}
    for case, result in results.items():
        values[case] = np.stack([result[key].max(axis=1) for key in checks], axis=1)
        station[case] = np.stack([result[key].argmax(axis=1) for key in checks], axis=1)
    assumptions = (*((rules.loads,) if rules.loads else ()), *assumed)
    return Utilisation(bays, checks, standard, values, station, assumptions, UNCHECKED, rules.combined)


CheckMethod = tuple[Callable[[MemberBays, str], CheckRatios], str, Iterator[str]]


def _method(rules: Rules, thickness: float) -> CheckMethod:
    if (grade := STEEL.get(rules.material)) is not None:
        return _steel_method(grade, rules, thickness)
    if (timbers := TIMBER.get(rules.material)) is not None:
        return _timber_method(timbers, rules)
    if not rules.strength:
        raise StaticsError(NO_STRENGTH)
    what = f"dsfab has none for {rules.material}" if rules.material else "the preset names no material"

    def check(bays: MemberBays, case: str) -> CheckRatios:
        bent = rules.young * rules.timber.layer * np.abs(bays.curvature) / 2
        return plain_checks(bays, bays.forces[case], rules.strength, bent)

    standard = (
        f"no standard applies: {what}; utilisation is the stress divided by the strength in the preset, "
        f"{rules.strength / 1e6:g} MPa"
    )
    return check, standard, iter(["The material counts as isotropic, and buckling is not checked."])


def _steel_method(grade: SteelGrade, rules: Rules, thickness: float) -> CheckMethod:
    elastic = rules.young, rules.shear
    return (
        lambda bays, case: steel.steel_checks(bays, bays.forces[case], grade, elastic, rules.steel),
        f"{steel.STANDARD}:2005, 6.2 and 6.3; {grade.name}, yield strength {grade.fy(thickness) / 1e6:g} MPa",
        _steel_words(grade, rules.steel, thickness),
    )


def _steel_words(grade: SteelGrade, factors: SteelFactors, thickness: float) -> Iterator[str]:
    yield f"Strengths: {grade.source}, plates of {length(thickness)}."
    if not grade.covers(thickness):
        limit = length(grade.yields[-1][0])
        yield f"The table of strengths ends at {limit}; {length(thickness)} plates get its last value (too high)."
    yield f"Partial factors: gamma_M0 = {factors.gamma_m0:g}, gamma_M1 = {factors.gamma_m1:g} (6.1)."
    yield (
        f"Buckling length: {factors.buckling_length:g} times the distance between nodes for both axes, buckling curve "
        f"{factors.curve} (table 6.2: solid sections). Lateral torsional buckling: curve d (table 6.4), constant "
        f"moment."
    )
    (
        yield "Resistances: plastic for cross-sections without holes (6.2.9); elastic for the stability of members "
        "(6.3.3, table B.2: class 3)."
    )


def _timber_method(grade: TimberGrade, rules: Rules) -> CheckMethod:
    def check(bays: MemberBays, case: str) -> CheckRatios:
        duration = rules.durations.get(case, "medium")
        return timber.timber_checks(bays, bays.forces[case], grade, rules.young, duration, rules.timber)

    return check, f"{timber.STANDARD}:2004 with A1 and A2, 6.1 to 6.3; {grade.name}", _timber_words(grade, rules)


def _timber_words(grade: TimberGrade, rules: Rules) -> Iterator[str]:
    factors = rules.timber
    gamma = factors.gamma_m or timber.GAMMA[grade.product]
    yield f"Strengths: {grade.source}, along the grain; {grade.product}, gamma_M = {gamma:g} (table 2.3)."
    times = sorted({(k_mod(d, factors.service_class), d) for d in rules.durations.values()})
    listed = ", ".join(f"{value:g} ({name})" for value, name in times)
    yield f"k_mod in service class {factors.service_class} for the shortest load in each case: {listed} (table 3.1)."
    yield f"Buckling length, both axes: {factors.buckling_length:g} times the distance between nodes (6.3.2, 6.3.3)."
    yield "The grain follows the axis of the member; stress at an angle to the grain (6.2.2) is not checked."
    if not grade.ft90:
        yield "Tension across the grain of curved members (6.4.3) is not checked: the product declares no strength."
    yield "Size factors above 1 (3.2, 3.3) are unused. Shear includes k_cr (6.1.7). Torsion has its own check (6.1.8)."
    if factors.layer:
        yield (
            f"Straight layers of {length(factors.layer)} are bent into shape: the stress E t kn / 2 from this adds to "
            f"the bending stress and does not relax. dsfab also checks this stress alone, as a permanent stress."
        )
    else:
        yield "Members are made in their final shape; if they are bent into shape, set eurocode.bent_in."
