"""Findings of a comparison: the status of a design, with reasons."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from dsfab.core.arrays import Floats
from dsfab.core.errors import StaticsError
from dsfab.core.limits import BALANCE, CONVERGED, FACETS, RESIDUAL, Mark, Status, worst_status
from dsfab.core.messages import length as length_words
from dsfab.core.messages import mass, value_with_bound
from dsfab.design import loads_on
from dsfab.report.html_pages import escaped_text
from dsfab.statics import flat_axis
from dsfab.study import Comparison
from dsfab.study.alternatives import Competitor
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judges import AnsweredLoad, CaseResponse, Judgement
from dsfab.study.verdict import estimates
from dsfab.study.verdict.estimates import Extreme
from dsfab.surface import LimitState

PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"))


def prefixed_unit(size: float, unit: str) -> tuple[float, str]:
    """Return a divisor and a unit with an SI prefix for a value: 12e3 and 'N' give (1e3, 'kN')."""
    size = abs(size)
    factor, prefix = next(((f, p) for f, p in PREFIXES if size >= 0.9995 * f), (1.0, "") if not size else PREFIXES[-1])
    return factor, prefix + unit


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """Return a value with its unit as text, such as '12.3 kN'; 'n/a' for None or an infinite value."""
    if value is None or not math.isfinite(value):
        return "n/a"
    factor, name = prefixed_unit(value, unit)
    return f"{significant_digits(value / factor, digits)} {name}"


def significant_digits(value: float, digits: int = 3) -> str:
    """Return a number as text with `digits` significant digits and no exponent: '0.0123', '12.3', '12 300'."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "n/a"
    value = float(f"{value:.{digits - 1}e}")  # rounding may add a digit: 9.996 becomes 10.0
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value)) + 1e-12))
    return f"{value:,.{decimals}f}".replace(",", " ")


def within(value: float, bound: float | None, unit: str) -> str:
    """Return a value with its relative error bound: 59.9, 0.018 and 'J' give '59.9 J ± 1.8 %'."""
    if not math.isfinite(value):
        return "n/a"
    if bound is None or not math.isfinite(bound):
        return f"{quantity(value, unit)} (bound unknown)"
    return f"{quantity(value, unit, 4 if bound < 0.005 else 3)} ± {percent(bound)}"


def share_words(part: float) -> str:
    """Return a fraction as percent with one decimal: 0.413 gives '41.3 %'."""
    return f"{100 * part:.1f} %"


def percent(share: float) -> str:
    """Return a fraction as percent with about two digits: 0.018 gives '1.8 %', 0.12 gives '12 %'."""
    return f"{100 * share:.2g} %" if abs(share) < 0.1 else f"{100 * share:.0f} %"


def range_words(low: float, middle: float, high: float) -> str:
    """Return a ratio with bounds as text: '1.92 (1.87 to 1.97)'."""
    return f"{significant_digits(middle)} ({significant_digits(low)} to {significant_digits(high)})"


def point_words(place: Sequence[float]) -> str:
    """Return a point as text: '(1.20, 0.00, 3.98) m'."""
    return f"({', '.join(f'{x + 0.0:.2f}' for x in place)}) m"


def length_or_na(metres: float | None) -> str:
    """Return a length as text: '0.31 mm'; 'n/a' for None."""
    return "n/a" if metres is None or not math.isfinite(metres) else length_words(metres)


def enumeration(words: Sequence[str]) -> str:
    """Join words to a list in a sentence: 'a, b and c'."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def round_number_above(value: float) -> float:
    """Return the least round number that is not below a value: 1, 2, 2.5 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(power * step for step in (1.0, 2.0, 2.5, 5.0, 10.0) if power * step >= value * (1 - 1e-9)))


SAFE_BUCKLING_FACTOR = 5.0  # smallest safe factor; real shells buckle at 1/5 to 1/2 of the linear factor

LABELS = {
    "full": "Whole sheet, uncut",
    "design": "This design",
    "isotropic": "Isotropic stripes",
    "rotated": "Stripes turned by 45°",
    "thinner": "Whole sheet, thinner",
    "von_mises": "Stripes along the von Mises stress",
    "grid": "Straight grid",
    "simp": "Topology optimisation (SIMP)",
}
"""Names of the competitors in a report."""


@dataclass(frozen=True)
class CheckLine:
    """A row in a report's table of checks. result : measured value in words. limit : required value in words."""

    name: str
    status: Mark
    result: str
    limit: str


@dataclass(frozen=True, eq=False)
class Findings:
    """Comparison of a design with other structures of the same mass (competitors).
    A design that does not carry its loads (`carries` is False) has no `judgement` and no `fields`.
    volumes : pairs of a share of material and the comparison at this share.
    share   : share of material if widths were scaled, or None."""

    compared: Comparison
    volumes: Sequence[tuple[float, Comparison]]
    command: str
    share: float | None = None

    @property
    def task(self) -> ComparisonTask:
        """The task of all compared structures: surface, loads and supports."""
        return self.compared.task

    @property
    def design(self) -> Competitor:
        """The design, in the form of a competitor."""
        return self.compared.design

    @property
    def carries(self) -> bool:
        """True if the design is in equilibrium under the loads from which its pattern was computed."""
        return self.design.judgement is not None

    @property
    def has_structure(self) -> bool:
        """True if the design has a cut sheet, which pictures can show."""
        return self.design.structure is not None

    @property
    def reference_compliance(self) -> float:
        """Compliance (J) that sets the unit prefix of all compliances in the report."""
        return self.design.compliance if self.carries else self.compared.full.compliance

    @property
    def judgement(self) -> Judgement:
        """Compliance of the design, its responses to the loads, and a verdict on the accuracy."""
        assert self.design.judgement is not None
        return self.design.judgement

    @property
    def structure(self) -> Structure:
        """The design's cut sheet, and all mesh cells of the cut surface."""
        assert self.design.structure is not None
        return self.design.structure

    @property
    def fields(self) -> Mapping[str, AnsweredLoad]:
        """Displacements and stresses of the design, by name of the load case."""
        return self.judgement.solved

    @cached_property
    def cut_load_sums(self) -> Mapping[str, Floats]:
        """Sum of the forces (3,), N, on the cut sheet, by load case; empty if a load acts on no material."""
        if not self.carries:
            return {}
        task, structure = self.task, self.structure
        try:
            loads = loads_on(task.surface, structure.sheet, task.loads_on(structure, every=True))
        except StaticsError:
            return {}
        return {name: load.force.sum(axis=0) for name, load in loads.items()}

    @cached_property
    def cases(self) -> list[str]:
        """Names of the load cases in which the design was checked, the governing case first."""
        if not self.carries:
            return list(self.task.loads)
        if self.judgement.check:
            return [case.name for case in self.judgement.check.cases]
        return sorted(self.judgement.cases, key=lambda name: -self.judgement.cases[name].compliance)

    @property
    def is_plane(self) -> bool:
        """True if the surface is flat and all loads act in its plane."""
        return flat_axis(self.task.surface, *self.task.all_loads.values()) is not None

    @property
    def governing(self) -> CaseResponse:
        """Response of the design to the governing case."""
        return self.judgement.cases[self.cases[0]]

    def decisive_case(self, answer: str) -> tuple[str, CaseResponse]:
        """Return name and response of the worst load case. answer : 'displacement', 'stress' or 'buckling'."""
        state: LimitState = "SLS" if answer == "displacement" else "ULS"
        return max(
            ((name, self.judgement.cases[name]) for name in self.task.preset.judged_in(state, self.judgement.cases)),
            key=lambda item: _severity(item[1], answer),
        )

    def cases_shown(self, names: Iterable[str]) -> list[str]:
        """Return the load cases of `names` to draw. Standard combinations are drawn only if they decide a result."""
        standard_names = {combination.name for combination in self.task.preset.surface.standard_sums}
        decisive_names = set[str]()
        if self.carries:
            decisive_names = {self.cases[0], self.decisive_case("displacement")[0], self.decisive_case("stress")[0]}
        return [name for name in names if name not in standard_names or name in decisive_names]

    def _case_suffix(self, answer: str) -> str:
        return f", {escaped_text(self.decisive_case(answer)[0])}" if len(self.judgement.cases) > 1 else ""

    def stiffness_ratio(self, rival: Competitor) -> tuple[float, float, float]:
        """Return stiffness of the design / stiffness of the competitor: lower bound, estimate, upper bound."""
        assert rival.judgement is not None
        rival_bound, design_bound = rival.judgement.bound or 0.0, self.judgement.bound or 0.0
        middle = rival.compliance / self.design.compliance
        return middle * (1 - rival_bound) / (1 + design_bound), middle, middle * (1 + rival_bound) / (1 - design_bound)

    @property
    def status(self) -> Status:
        """Worst status of all checks of the structure."""
        return worst_status(line.status for line in self.checks if line.status != "note")

    @cached_property
    def checks(self) -> list[CheckLine]:
        """Rows of the table with all checks of the design."""
        if not self.carries:
            reason = f"no: {self.design.error}"
            return [CheckLine("Carries its loads", "fail", reason, "equilibrium with its supports")]
        knowledge = (self._support_check(), self._compliance_check(), self._theory_check(), self.balance_check())
        mesh = (self._member_check(), self.facet_check())
        limits = (self._strength_check(), self._buckling_check(), self._frequency_line())
        return [line for line in (*knowledge, *mesh, *limits) if line]

    def _support_check(self) -> CheckLine:
        loose = self.design.loose
        loose_words = f"; {percent(loose)} of the material has no support and was left out" if loose > 1e-6 else ""
        words = f"{self.design.pieces} {'piece' if self.design.pieces == 1 else 'pieces'} of material{loose_words}"
        status: Status = "pass"
        if self.judgement.verdict == "fail":
            status, words = "fail", self.judgement.reason
        return CheckLine(
            "Every load reaches a support", status, words, "all loads act on material that is connected to a support"
        )

    def _compliance_check(self) -> CheckLine:
        check = self.judgement.check
        words = within(self.judgement.compliance, self.judgement.bound, "J")
        is_known = check is not None and check.status == "pass"
        why = "" if is_known else f"; {self.judgement.reason}"
        return CheckLine("Compliance is known", "pass" if is_known else "unknown", words + why, percent(CONVERGED))

    def _theory_check(self) -> CheckLine | None:
        theory = self.judgement.theory
        if theory is None:
            return None
        mark: Mark = "pass" if theory <= CONVERGED else "note"
        words = f"by theory, the solid is up to {percent(theory)} softer than the thin shell"
        return CheckLine("Within thin-shell theory", mark, words, percent(CONVERGED))

    def balance_check(self) -> CheckLine:
        """Return the check that reactions balance the loads."""
        cases = self.judgement.cases.values()
        imbalance, residual = max(case.imbalance for case in cases), max(case.residual for case in cases)
        if self.judgement.check:
            residual = max(residual, *(level.residual for level in self.judgement.check.levels))
        status: Status = "pass" if imbalance <= BALANCE and residual <= RESIDUAL else "fail"
        words = f"loads and reactions differ by {imbalance:.0e} of the load; residual of the equations {residual:.0e}"
        return CheckLine("Reactions balance the loads", status, words, f"{BALANCE:.0e}; {RESIDUAL:.0e}")

    def _member_check(self) -> CheckLine | None:
        check = self.judgement.check
        if check is None or not math.isfinite(check.per_member):
            return None
        least = estimates.LEAST_EDGES_PER_MEMBER
        mark: Mark = "pass"
        words = f"the mean width of members is {check.per_member:.2g} edges of the uncut mesh"
        if check.per_member < least:
            mark, words = (
                "note",
                words + "; so the outline of members is coarse, and all checks are for this coarse outline",
            )
        return CheckLine("Outline of the members", mark, words, f"{least:g} or more")

    def facet_check(self) -> CheckLine | None:
        check = self.judgement.check
        if check is None or check.facets == 0:
            return None
        mark: Mark = "pass" if check.facets <= FACETS else "note"
        words = f"L<sup>2</sup> / (R h) = {check.facets:.2g}"
        return CheckLine("Mesh faces small enough for the curvature", mark, words, f"{FACETS:g} or less")

    def _strength_check(self) -> CheckLine | None:
        cases = self.task.preset.judged_in("ULS", self.judgement.cases)
        shares = [share for name in cases if (share := self.judgement.cases[name].utilisation)]
        if not shares:
            return None
        usual_share, interior_share = max(share[0] for share in shares), max(share[1] for share in shares)
        status: Status = "fail" if usual_share > 1 else "pass" if interior_share <= 1 else "unknown"
        words = (
            f"the stress is at most {usual_share:.0%} of the strength on 99 % of the area, and at most "
            f"{interior_share:.0%} at points more than a rib's width from corners{self._case_suffix('stress')}"
        )
        strength = quantity(self.task.preset.statics.strength, "Pa")
        return CheckLine("Stress against the strength", status, words, strength)

    def _buckling_check(self) -> CheckLine | None:
        case = self.decisive_case("buckling")[1]
        factor, bound = case.buckling, case.buckling_bound
        if factor is None:
            return None
        low, high = (factor * (1 + side * (bound or 0.0)) for side in (-1, 1))
        low *= 1 - self.judgement.solid_loss(1.0)
        status: Status = "fail" if high < 1 else "pass" if low >= SAFE_BUCKLING_FACTOR else "unknown"
        local = f"; {case.local}" if case.local else ""
        suffix = self._case_suffix("buckling") + self._solid_suffix(1.0) + local + self._assumption_suffix()
        words = (
            f"the sheet buckles at {value_with_bound(factor, bound)} times the load (linear theory, perfect "
            f"shape){suffix}"
        )
        return CheckLine("Buckling", status, words, f"{SAFE_BUCKLING_FACTOR:g} or more")

    def _frequency_line(self) -> CheckLine | None:
        case = next((case for case in self.judgement.cases.values() if case.frequency is not None), None)
        if case is None or case.frequency is None:
            return None
        value = value_with_bound(case.frequency, case.frequency_bound, "Hz")
        words = f"{value}{self._solid_suffix(0.5)}{self._assumption_suffix()}"
        return CheckLine("Lowest natural frequency", "note", words, "not judged")

    def _solid_suffix(self, power: float) -> str:
        loss = self.judgement.solid_loss(power)
        return f"; about {percent(loss)} less as a solid" if loss else ""

    def _assumption_suffix(self) -> str:
        assumption = next((case.assumed for case in self.judgement.cases.values() if case.assumed), "")
        return f"; {assumption}" if assumption else ""

    @cached_property
    def claims(self) -> list[CheckLine]:
        """For each competitor, the check that the design is stiffer."""
        return [self._claim(rival) for rival in self.compared.rivals]

    def _claim(self, rival: Competitor) -> CheckLine:
        name = f"Stiffer than: {LABELS[rival.name].lower().replace('simp', 'SIMP').replace('von mises', 'von Mises')}"
        if rival.judgement and not self.carries:
            return CheckLine(name, "fail", "this competitor carries the loads, but the design does not", "above 1")
        if rival.judgement is None:
            return CheckLine(name, "unknown", f"none was found: {rival.error.split('; the first: ')[0]}", "above 1")
        low, middle, high = self.stiffness_ratio(rival)
        status: Status = "pass" if low > 1 else "fail" if high < 1 else "unknown"
        return CheckLine(name, status, f"{range_words(low, middle, high)} times", "above 1")

    @property
    def size_words(self) -> str:
        """Text with mass, share of the surface that is material, and thickness."""
        share, thickness = share_words(self.design.area_fraction), length_or_na(self.design.thickness)
        return f"{mass(self.design.mass)}, {share} of the surface, {thickness} thick"


def _severity(case: CaseResponse, answer: str) -> float:
    if answer == "buckling":
        return -math.inf if case.buckling is None else -case.buckling
    extreme: Extreme = getattr(case, answer)
    return extreme.settled
