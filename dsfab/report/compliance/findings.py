"""Findings of a comparison: the status of a design, its reasons, and numbers in words."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from dsfab.core.arrays import Floats
from dsfab.core.errors import StaticsError
from dsfab.core.limits import BALANCE, CONVERGED, FACETS, RESIDUAL, Mark, Status, worst
from dsfab.core.messages import bounded, mass
from dsfab.core.messages import length as length_words
from dsfab.design import loads_on
from dsfab.report.html_pages import escaped
from dsfab.statics import flat_axis
from dsfab.study import Comparison
from dsfab.study.alternatives import Competitor
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judges import Answered, Carried, Judgement, solved_loads
from dsfab.study.verdict import estimates
from dsfab.study.verdict.estimates import Extreme
from dsfab.surface import LimitState

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))


def unit_for(size: float, unit: str) -> tuple[float, str]:
    """Return the divisor for values of this size, and the unit with its prefix."""
    size = abs(size)
    factor, prefix = next(((f, p) for f, p in PREFIXES if size >= 0.9995 * f), (1.0, "") if not size else PREFIXES[-1])
    return factor, prefix + unit


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """Return for example '12.3 kN'; 'n/a' for None or an infinite value."""
    if value is None or not math.isfinite(value):
        return "n/a"
    factor, name = unit_for(value, unit)
    return f"{digits_of(value / factor, digits)} {name}"


def digits_of(value: float, digits: int = 3) -> str:
    """Return a number with significant digits and without an exponent: '0.0123', '12.3', '12 300'."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "n/a"
    value = float(f"{value:.{digits - 1}e}")  # rounded first, because 9.996 becomes 10.00 and has a digit more
    after = max(0, digits - 1 - math.floor(math.log10(abs(value)) + 1e-12))
    return f"{value:,.{after}f}".replace(",", " ")


def within(value: float, bound: float | None, unit: str) -> str:
    """Return for example '59.9 J ± 1.8 %', with as many digits as the bound leaves."""
    if not math.isfinite(value):
        return "n/a"
    if bound is None or not math.isfinite(bound):
        return f"{quantity(value, unit)} (bound unknown)"
    return f"{quantity(value, unit, 4 if bound < 0.005 else 3)} ± {percent(bound)}"


def share_of(part: float) -> str:
    """Return a share of the surface, for example '41.3 %'."""
    return f"{100 * part:.1f} %"


def percent(share: float) -> str:
    """Return a share with two digits: '1.8 %', '0.3 %', '12 %'."""
    return f"{100 * share:.2g} %" if abs(share) < 0.1 else f"{100 * share:.0f} %"


def times(low: float, middle: float, high: float) -> str:
    """Return a ratio with its range, for example '1.92 (1.87 to 1.97)'."""
    return f"{digits_of(middle)} ({digits_of(low)} to {digits_of(high)})"


def point(place: Sequence[float]) -> str:
    """Return a place, for example '(1.20, 0.00, 3.98) m'."""
    return f"({', '.join(f'{x + 0.0:.2f}' for x in place)}) m"


def length(metres: float | None) -> str:
    """Return a length, for example '0.31 mm' or '2.4 m'; 'n/a' for None."""
    return "n/a" if metres is None or not math.isfinite(metres) else length_words(metres)


def enumeration(words: Sequence[str]) -> str:
    """Return 'a, b and c'."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def nice(value: float) -> float:
    """Return the next of 1, 2, 2.5 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(power * step for step in (1.0, 2.0, 2.5, 5.0, 10.0) if power * step >= value * (1 - 1e-9)))


KNOCKED_DOWN = 5.0
"""Load factor above which the linear buckling analysis suffices, because real shells buckle at a fifth to a half of
it.
"""

LABELS = {
    "full": "Whole sheet, uncut",
    "design": "This design",
    "isotropic": "Isotropic stripes",
    "rotated": "Stripes turned by 45°",
    "thinner": "Whole sheet, thinner",
    "von_mises": "Stripes of von Mises stress",
    "grid": "Straight grid",
    "simp": "Topology optimisation (SIMP)",
}
"""Names of the competitors in a report."""


@dataclass(frozen=True)
class CheckLine:
    """A line of the list of checks."""

    name: str
    status: Mark
    found: str
    limit: str


@dataclass(frozen=True, eq=False)
class Findings:
    """A comparison at one mass, with those at several volumes, if any.

    A design without equilibrium (`carries` is False) has no `judged` and no `fields`.

    command : the command line of the comparison.
    share   : share of the surface, if the widths of the design are scaled.
    """

    compared: Comparison
    volumes: Sequence[tuple[float, Comparison]]
    command: str
    share: float | None = None

    @property
    def task(self) -> ComparisonTask:
        """The task that all competitors share."""
        return self.compared.task

    @property
    def design(self) -> Competitor:
        """The design among the competitors."""
        return self.compared.design

    @property
    def carries(self) -> bool:
        """True if the design carries the loads that its pattern follows."""
        return self.design.judgement is not None

    @property
    def drawn(self) -> bool:
        """True if the design has a structure for pictures."""
        return self.design.structure is not None

    @property
    def unit_of(self) -> float:
        """The compliance that sets the unit of all compliances, J."""
        return self.design.compliance if self.carries else self.compared.full.compliance

    @property
    def judged(self) -> Judgement:
        """The judgement of the design."""
        assert self.design.judgement is not None
        return self.design.judgement

    @property
    def structure(self) -> Structure:
        """The structure of the design."""
        assert self.design.structure is not None
        return self.design.structure

    @cached_property
    def fields(self) -> Mapping[str, Answered]:
        """Displacements and stresses of each load, for pictures."""
        every = set(self.judged.cases) != set(self.task.loads)
        return solved_loads(self.task, self.structure, every)

    @cached_property
    def sums(self) -> Mapping[str, Floats]:
        """(3,) newtons of each case and combination on the cut sheet; empty if the sheet does not carry all of them."""
        if not self.carries:
            return {}
        task, made = self.task, self.structure
        try:
            loads = loads_on(task.surface, made.sheet, task.loads_on(made, every=True))
        except StaticsError:
            return {}
        return {name: load.force.sum(axis=0) for name, load in loads.items()}

    @cached_property
    def cases(self) -> list[str]:
        """Names of the cases with a judgement, the governing one first."""
        if not self.carries:
            return list(self.task.loads)
        if self.judged.check:
            return [case.name for case in self.judged.check.cases]
        return sorted(self.judged.cases, key=lambda name: -self.judged.cases[name].compliance)

    @property
    def plane(self) -> bool:
        """True if the loads lie in the plane of a flat sheet, so that it was solved in this plane."""
        return flat_axis(self.task.surface, *self.task.all_loads.values()) is not None

    @property
    def governing(self) -> Carried:
        """The answer to the governing case."""
        return self.judged.cases[self.cases[0]]

    def decisive(self, answer: str) -> tuple[str, Carried]:
        """Return the case or combination with the largest displacement or stress, or the least buckling factor, and
        its answer.

        Only cases of the limit state that judges this answer count: SLS for displacement, else ULS.
        """
        state: LimitState = "SLS" if answer == "displacement" else "ULS"
        return max(
            ((name, self.judged.cases[name]) for name in self.task.preset.judged_in(state, self.judged.cases)),
            key=lambda one: _size(one[1], answer),
        )

    def detailed(self, names: Iterable[str]) -> list[str]:
        """Select the cases and combinations with a figure of their own: of a standard's combinations only the
        decisive ones.
        """
        made = {one.name for one in self.task.preset.surface.standard_sums}
        most = {self.cases[0], self.decisive("displacement")[0], self.decisive("stress")[0]} if self.carries else set()
        return [name for name in names if name not in made or name in most]

    def _under(self, answer: str) -> str:
        return f", {escaped(self.decisive(answer)[0])}" if len(self.judged.cases) > 1 else ""

    def gain(self, rival: Competitor) -> tuple[float, float, float]:
        """Return the stiffness of the design over that of a competitor of the same mass: lower bound, estimate,
        upper bound.
        """
        assert rival.judgement is not None
        off, own = rival.judgement.bound or 0.0, self.judged.bound or 0.0
        middle = rival.compliance / self.design.compliance
        return middle * (1 - off) / (1 + own), middle, middle * (1 + off) / (1 - own)

    @property
    def status(self) -> Status:
        """The worst status of the checks on the structure itself."""
        return worst(one.status for one in self.checks if one.status != "note")

    @cached_property
    def checks(self) -> list[CheckLine]:
        """Lines of the checks on the structure itself."""
        if not self.carries:
            told = f"no: {self.design.error}"
            return [CheckLine("Carries its loads", "fail", told, "equilibrium with its supports")]
        found = [self._carries(), self._known(), self._thin(), self._balanced(), self._member(), self._faceted()]
        return [one for one in (*found, self._strong(), self._buckles(), self._vibrates()) if one]

    def _carries(self) -> CheckLine:
        loose = self.design.loose
        left = f"; {percent(loose)} of what is drawn hangs on nothing and was left out" if loose > 1e-6 else ""
        told = f"{self.design.pieces} {'piece' if self.design.pieces == 1 else 'pieces'} of material{left}"
        failed = self.judged.verdict == "fail"
        return CheckLine(
            "Every load reaches a support",
            "fail" if failed else "pass",
            self.judged.reason if failed else told,
            "loads on pieces that a support holds",
        )

    def _known(self) -> CheckLine:
        check = self.judged.check
        told = within(self.judged.compliance, self.judged.bound, "J")
        known = check is not None and check.status == "pass"
        why = "" if known else f"; {self.judged.reason}"
        return CheckLine("Compliance is known", "pass" if known else "unknown", told + why, percent(CONVERGED))

    def _thin(self) -> CheckLine | None:
        theory = self.judged.theory
        if theory is None:
            return None
        told = f"a solid of it is up to {percent(theory)} softer"
        return CheckLine(
            "Within thin-shell theory", "pass" if theory <= CONVERGED else "note", told, percent(CONVERGED)
        )

    def _balanced(self) -> CheckLine:
        cases = self.judged.cases.values()
        off, residual = max(case.imbalance for case in cases), max(case.residual for case in cases)
        if self.judged.check:
            residual = max(residual, *(level.residual for level in self.judged.check.levels))
        return CheckLine(
            "Reactions balance the loads",
            "pass" if off <= BALANCE and residual <= RESIDUAL else "fail",
            f"off by {off:.0e} of the load; residual of the equations {residual:.0e}",
            f"{BALANCE:.0e}; {RESIDUAL:.0e}",
        )

    def _member(self) -> CheckLine | None:
        check = self.judged.check
        if check is None or not math.isfinite(check.per_member):
            return None
        fine = check.per_member >= estimates.MEMBER
        told = f"{check.per_member:.2g} edges of the uncut mesh across a member"
        more = "" if fine else "; the outline is coarse, the structure as drawn is what was checked"
        return CheckLine(
            "Outline of the members", "pass" if fine else "note", told + more, f"{estimates.MEMBER:g} or more"
        )

    def _faceted(self) -> CheckLine | None:
        check = self.judged.check
        if check is None or check.facets == 0:
            return None
        return CheckLine(
            "Flat faces for the curved surface",
            "pass" if check.facets <= FACETS else "note",
            f"L<sup>2</sup> / (R h) = {check.facets:.2g}",
            f"{FACETS:g} or less",
        )

    def _strong(self) -> CheckLine | None:
        cases = self.task.preset.judged_in("ULS", self.judged.cases)
        shares = [share for name in cases if (share := self.judged.cases[name].utilisation)]
        if not shares:
            return None
        usual, away = max(share[0] for share in shares), max(share[1] for share in shares)
        status: Status = "fail" if usual > 1 else "pass" if away <= 1 else "unknown"
        where = f"further than a rib's width from corners{self._under('stress')}"
        told = f"{usual:.0%} on 99 % of the area, {away:.0%} {where}"
        return CheckLine("Stress against the strength", status, told, quantity(self.task.preset.statics.strength, "Pa"))

    def _buckles(self) -> CheckLine | None:
        case = self.decisive("buckling")[1]
        least, off = case.buckling, case.buckling_bound
        if least is None:
            return None
        low, high = (least * (1 + side * (off or 0.0)) for side in (-1, 1))
        status: Status = "fail" if high < 1 else "pass" if low >= KNOCKED_DOWN else "unknown"
        told = f"{bounded(least, off)} times the load (linear, perfect shape){self._under('buckling')}"
        return CheckLine("Buckling", status, f"{told}{self._assumed()}", f"{KNOCKED_DOWN:g} or more")

    def _vibrates(self) -> CheckLine | None:
        case = next((case for case in self.judged.cases.values() if case.frequency is not None), None)
        if case is None or case.frequency is None:
            return None
        told = f"{bounded(case.frequency, case.frequency_bound, 'Hz')}{self._assumed()}"
        return CheckLine("Lowest natural frequency", "note", told, "not judged")

    def _assumed(self) -> str:
        told = next((case.assumed for case in self.judged.cases.values() if case.assumed), "")
        return f"; {told}" if told else ""

    @cached_property
    def claims(self) -> list[CheckLine]:
        """Lines that say whether the design is stiffer than each competitor of its mass."""
        return [self._claim(rival) for rival in self.compared.rivals]

    def _claim(self, rival: Competitor) -> CheckLine:
        name = f"Stiffer than: {LABELS[rival.name].lower().replace('simp', 'SIMP').replace('von mises', 'von Mises')}"
        if rival.judgement and not self.carries:
            return CheckLine(name, "fail", "it carries the loads, the design does not", "above 1")
        if rival.judgement is None:
            return CheckLine(name, "unknown", f"none was found: {rival.error.split('; the first: ')[0]}", "above 1")
        low, middle, high = self.gain(rival)
        status: Status = "pass" if low > 1 else "fail" if high < 1 else "unknown"
        return CheckLine(name, status, f"{times(low, middle, high)} times", "above 1")

    @property
    def extent(self) -> str:
        """Mass, share of the surface and thickness."""
        made = self.design
        return f"{mass(made.mass)}, {share_of(made.area_fraction)} of the surface, {length(made.thickness)} thick"


def _size(case: Carried, answer: str) -> float:
    """Size of an answer for comparison: metres, pascals, or minus the buckling factor."""
    if answer == "buckling":
        return -math.inf if case.buckling is None else -case.buckling
    found: Extreme = getattr(case, answer)
    return found.settled
