"""The verdict on a cut structure."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, point_tuple
from dsfab.core.errors import DsfabError, StaticsError
from dsfab.core.messages import length
from dsfab.core.sparse import solver_name
from dsfab.design import Design, acting_on, loads_on, sheet_loads
from dsfab.design.member_model import member_utilisation
from dsfab.preset.model import Preset
from dsfab.slicing import Sheet
from dsfab.statics import (
    Elements,
    Equilibrium,
    FactorCache,
    ShearRecovery,
    SheetModel,
    SheetStress,
    elements_of,
    equilibria,
    flat_axis,
    lowest_buckling,
    mode_supports,
    needle_message,
    section_forces,
    sheet_stiffness,
    sheet_stress,
    stress,
)
from dsfab.study.hold_down import hold_down_remarks
from dsfab.study.verdict import BUDGET
from dsfab.study.verdict.estimates import quantile
from dsfab.study.verdict.levels import memory_needed
from dsfab.surface import (
    DesignFactors,
    LiftingRule,
    LoadCase,
    SelfWeight,
    Support,
    Surface,
    link_components,
    support_names,
)

if TYPE_CHECKING:
    from dsfab.members.frame import MemberForces

Place = tuple[float, float, float]
NO_STRENGTH = "the preset has no material and no strength; set statics.material to judge the structure"
NO_FACTORS = (
    "utilisation is for loads without partial factors; to add them, give each load its own case, and set "
    'surface.combinations = "EN 1990 6.10"'
)
BUCKLED_CASES = 3
"""Number of cases and combinations for which buckling is computed: those with the largest compression. The number is
limited because each buckling analysis takes as long as a solve."""


@dataclass(frozen=True)
class MemberUse:
    """The most used member.
    value : utilisation, 1 at the limit.    place : m.    case : load case.    check : name of the check."""

    member: str
    value: float
    place: Place
    case: str
    check: str


@dataclass(frozen=True)
class Movement:
    """The largest displacement, `value` (m).
    span : length (m) to which `value` is compared.    about : the span in words."""

    value: float
    place: Place
    case: str
    span: float
    about: str

    @property
    def share(self) -> float:
        """Movement divided by the span."""
        return self.value / self.span if self.span > 0 else float("inf")


@dataclass(frozen=True)
class SupportForce:
    """Force of a support on the structure in a case.
    vertical   : newtons, positive if the support pushes upwards.    horizontal : newtons.
    direction  : angle of the horizontal force, degrees from x to y.
    thrust     : newtons, sum of the magnitudes of the horizontal forces."""

    support: str
    case: str
    vertical: float
    horizontal: float
    direction: float
    thrust: float


Outcome = Literal["carries", "does not carry", "not judged"]


@dataclass(frozen=True)
class Carrying:
    """The verdict on a cut structure.
    use      : largest utilisation, or None.    movement : largest displacement, or None.
    buckling : lowest buckling factor, or None.    buckling_case : case of this factor, or ''.
    mass     : kg.     reactions : forces by support, then by case.
    faults   : reasons why the structure does not carry.       remarks : missing values and assumptions.
    stress   : (m,) von Mises stress (Pa) in the case of the most used member."""

    thickness: float
    mass: float
    use: MemberUse | None = None
    movement: Movement | None = None
    buckling: float | None = None
    buckling_case: str = ""
    reactions: tuple[SupportForce, ...] = ()
    faults: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    stress: Floats | None = field(default=None, compare=False, repr=False)

    @property
    def outcome(self) -> Outcome:
        """ "carries", "does not carry", or "not judged" without a strength."""
        if self.faults:
            return "does not carry"
        return "carries" if self.use else "not judged"

    def facts(self) -> dict[str, Any]:
        """Return the verdict as plain values in SI units."""
        share = self.movement.share if self.movement else None
        facts = asdict(replace(self, stress=None)) | {"outcome": self.outcome, "of": "the cut sheet"}
        return {key: value for key, value in facts.items() if key != "stress"} | {"movement_over_span": share}


@dataclass(frozen=True, eq=False)
class CutStatics:
    """The cut sheet of a design with a thickness (m), loads, and results.
    answers   : solutions by name of the case.    lifting : solutions of further cases of the `LiftingRule`.
    stiffness : matrix without springs, or None."""

    design: Design
    thickness: float
    loads: Mapping[str, LoadCase]
    answers: Mapping[str, Equilibrium]
    lifting: Mapping[str, Equilibrium] = field(default_factory=dict)
    stiffness: csr_array | None = None
    factor_of: FactorCache = field(default_factory=FactorCache)

    @property
    def preset(self) -> Preset:
        """The preset of the design, with this thickness."""
        preset = self.design.preset
        statics = preset.statics.model_copy(update={"thickness": self.thickness})
        return preset.model_copy(update={"statics": statics})

    @cached_property
    def model(self) -> SheetModel:
        """The cut sheet."""
        return self.design.sheet_with_ribs(self.thickness)

    @property
    def up(self) -> int:
        """Axis that points upwards: that of the self-weight. Without self-weight it is z, or y for a flat sheet that is
        loaded in the xy plane, which counts as a wall."""
        for load in self.preset.surface.load:
            if isinstance(load, SelfWeight):
                return int(np.abs(load.direction).argmax())
        return 1 if flat_axis(self.model.surface, *self.loads.values()) == 2 else 2

    def stress(self, name: str) -> SheetStress:
        return sheet_stress(self.model, self.answers[name].elements, self.answers[name])


def carrying(design: Design) -> Carrying:
    """Return the verdict on the cut sheet of a design.
    Raises the DsfabError of a stage that fails."""
    return design.cached_result("slicing", "carrying", lambda: _carrying(design))


def _carrying(design: Design) -> Carrying:
    thickness, surface = design.preset.statics.thickness, design.sheet.surface
    elements = elements_of("displacement")
    if memory_needed(elements.unknowns(surface), elements.bending, solver_name()) > BUDGET:
        why = f"the cut sheet has {surface.m:,} triangles, too many to judge; make the mesh coarser (surface.edge)"
        return Carrying(thickness, _mass(design, thickness), remarks=(why,))
    try:
        return cut_carrying(cut_statics(design, thickness))
    except StaticsError as error:
        why = f"the cut sheet does not stand: {error}"
        if not design.preset.statics.strength:
            return Carrying(thickness, _mass(design, thickness), remarks=(NO_STRENGTH, why))
        return Carrying(thickness, _mass(design, thickness), faults=(why,))


def cut_loads(design: Design, thickness: float) -> dict[str, LoadCase]:
    """Return the loads on the cut sheet with a thickness (m), by case and combination.
    Raises StaticsError if a load has no support."""
    share = thickness / design.preset.statics.thickness
    loads = {name: case.load.of_thickness(design.surface, share) for name, case in design.statics.cases.items()}
    return sheet_loads(design.surface, design.slicing.cells.subset(), design.sheet, loads)


def _lifting_rule(design: Design) -> LiftingRule:
    section = design.preset.surface
    return LiftingRule.for_loads(
        acting_on(design.preset, design.surface).load, section.actions, section.factors or DesignFactors()
    )


def _lifting_loads(design: Design, thickness: float, rule: LiftingRule) -> dict[str, LoadCase]:
    preset, surface = design.preset, design.surface
    share, supports = thickness / preset.statics.thickness, next(iter(design.statics.cases.values())).load
    acting = {
        name: supports.with_loads(surface, loads, preset.statics.area_weight).of_thickness(surface, share)
        for name, loads in rule.loads.items()
    }
    return loads_on(surface, design.sheet, acting)


def cut_statics(design: Design, thickness: float) -> CutStatics:
    """Solve the cut sheet with a thickness (m) for all cases, with one factorisation.
    Raises StaticsError if the sheet does not stand, or if a load has no support."""
    loads = cut_loads(design, thickness)
    unsolved = CutStatics(design, thickness, loads, {})
    is_plane = flat_axis(design.sheet.surface, *loads.values()) is not None
    pairs = [elements_of(use).in_plane if is_plane else elements_of(use) for use in ("displacement", "needles")]
    K = sheet_stiffness(unsolved.model, pairs[0])
    unsolved = replace(unsolved, stiffness=K if pairs[0] == elements_of("buckling") else None)
    try:
        return _solve(unsolved, K, pairs[0], unsolved.factor_of)
    except StaticsError:
        if not needle_message(design.sheet.surface):
            raise
        return _solve(unsolved, sheet_stiffness(unsolved.model, pairs[1]), pairs[1], FactorCache())


def _solve(statics: CutStatics, K: csr_array, elements: Elements, factor_of: FactorCache) -> CutStatics:
    model, rule = statics.model, _lifting_rule(statics.design)
    combinations = statics.design.statics.combinations
    single = {name: load for name, load in statics.loads.items() if name not in combinations}
    single |= _lifting_loads(statics.design, statics.thickness, rule)
    sums = {**combinations, **rule.sums}
    acting = [model.with_clamped_edges(load) for load in single.values()]
    factors = [[sums[name].get(case, 0.0) for case in single] for name in sums]
    results = equilibria(model.surface, K, acting, elements, None, factors, factor_of)
    answers = dict(zip((*single, *sums), results, strict=True))
    of_preset = {name: answers.pop(name) for name in statics.loads}
    return replace(statics, answers=of_preset, lifting=answers)


def use_and_movement(statics: CutStatics, use: bool = True) -> Carrying:
    """Return the mass, largest displacement and largest utilisation of a solved cut sheet.
    use : False to leave out the utilisation."""
    moved, mass = _movement(statics), _mass(statics.design, statics.thickness)
    if not statics.preset.statics.strength:
        return Carrying(statics.thickness, mass, None, moved, remarks=(NO_STRENGTH,))
    member, remarks = _most_used(statics) if use else (None, ())
    return Carrying(statics.thickness, mass, member, moved, remarks=remarks)


def cut_carrying(statics: CutStatics) -> Carrying:
    """Return the verdict on a solved cut sheet."""
    outcome, rows = use_and_movement(statics), _reactions(statics)
    use, faults = outcome.use, []
    case = use.case if use else statics.preset.judged_in("ULS", statics.answers)[0]
    # supports that pull come first: a short list of notes must not hide them
    rule, combinations = _lifting_rule(statics.design), list(statics.design.statics.combinations)
    remarks = (*hold_down_remarks(rule, combinations, *_vertical_forces(statics)), *outcome.remarks)
    outcome = replace(outcome, reactions=rows, stress=statics.stress(case).largest, remarks=remarks)
    if use is None:
        return outcome
    factor, buckling_case, aside = _buckling(statics)
    if use.value > 1:
        faults.append(f"the load on {use.member} is {use.value:.0%} of its resistance ({use.check})")
    if factor is not None and factor <= 1:
        faults.append(f"the sheet buckles at {factor:.2g} times its load")
    remarks = (*outcome.remarks, *aside)
    return replace(outcome, buckling=factor, buckling_case=buckling_case, faults=tuple(faults), remarks=remarks)


def _mass(design: Design, thickness: float) -> float:
    return float(design.sheet.surface.area * thickness * design.preset.statics.density)


def _most_used(statics: CutStatics) -> tuple[MemberUse, tuple[str, ...]]:
    from dsfab.members.eurocode import STEEL, TIMBER

    preset = statics.preset
    if preset.statics.material in STEEL or preset.statics.material in TIMBER:
        try:
            return _most_used_by_code(statics), () if preset.surface.sums else (NO_FACTORS,)
        except StaticsError as error:
            use = _most_stressed(statics)
            return use, (f"members are not checked by their standard: {error}",)
    return _most_stressed(statics), ()


def _most_used_by_code(statics: CutStatics) -> MemberUse:
    graph = statics.design.members
    use = member_utilisation(statics.preset, graph, _member_forces(statics))
    bay = int(use.order[0])
    check, case, station = use.governing(bay)
    axis, s = graph.by_id[use.bays.member[bay]].axis, use.bays.s[bay, station]
    assert axis is not None  # every member with bays has an axis
    place = axis.frames_at(np.array([s % axis.length if axis.closed else s]))[0][0]
    return MemberUse(use.bays.member[bay], float(use.largest[bay]), point_tuple(place), case, str(check))


def _member_forces(statics: CutStatics) -> "dict[str, MemberForces]":
    from dsfab.members.frame import member_forces

    factors, surface, sections = statics.design.statics.combinations, statics.model.surface, {}
    linear = next(iter(statics.answers.values())).elements.bending == "hhj"
    make = partial(ShearRecovery.for_surface, surface, linear=linear)
    recovery = statics.design.cached_result("slicing", f"shear recovery {linear}", make)
    for name in (name for name in statics.answers if name not in factors):
        result = statics.stress(name)
        sections[name] = section_forces(surface, statics.thickness, result, recovery)
    return member_forces(statics.design.members, sections, statics.design.member_cuts, factors)


def _most_stressed(statics: CutStatics) -> MemberUse:
    surface, strength = statics.model.surface, statics.preset.statics.strength
    rows = []
    for name in statics.preset.judged_in("ULS", statics.answers):
        largest = statics.stress(name).largest
        value = quantile(largest, surface.areas)
        rows.append((value, int(np.abs(largest - value).argmin()), name))
    value, face, case = max(rows)
    member, place = _member_of(statics.design, face), point_tuple(surface.centroids[face])
    return MemberUse(member, value / strength, place, case, "von Mises stress over strength, on 99 % of the area")


def _member_of(design: Design, face: int) -> str:
    try:
        graph = design.members
        owner = int(graph.owner[np.flatnonzero(graph.source == face)[0]])
    except (DsfabError, IndexError):
        return "the sheet"
    return graph.members[owner].id if owner >= 0 else "the sheet"


def _movement(statics: CutStatics) -> Movement:
    surface, answers = statics.model.surface, statics.answers
    names = statics.preset.judged_in("SLS", answers)
    case = max(names, key=lambda name: answers[name].largest_displacement)
    vertex = int(np.linalg.norm(answers[case].u, axis=1).argmax())
    span, about = judged_span(surface, statics.loads[case])
    return Movement(answers[case].largest_displacement, point_tuple(surface.V[vertex]), case, span, about)


def judged_span(surface: Surface, load: LoadCase) -> tuple[float, str]:
    """Return the span (m) to which displacements are compared, and the span in words."""
    net, V, parts = load.force.sum(axis=0), surface.V, load.parts
    if parts is not None and (parts.point.any() or parts.bare.any() or parts.covered.any()):
        net = net - surface.areas @ parts.weight
    down = net / (np.linalg.norm(net) or 1.0)
    across = V - (V @ down)[:, None] * down
    half, straight = (float(np.max(cKDTree(x[load.supported]).query(x)[0])) for x in (across, V))
    if 2 * half < straight:
        return straight, "the distance from a support to the farthest place"
    return 2 * half, f"twice the distance of {length(half)} from the supports to the farthest place"


def _buckling(statics: CutStatics) -> tuple[float | None, str, tuple[str, ...]]:
    model, remarks, factors = statics.model, dict[str, None](), dict[str, float]()
    for name in _most_compressed(statics):
        answer, standing = statics.answers[name], mode_supports(model.surface, statics.loads[name])
        if standing.told:
            remarks[f"buckling: {standing.told}"] = None
        elements = elements_of("buckling")
        try:
            factor, clause = lowest_buckling(
                model, standing.load, answer, elements, statics.stiffness, statics.factor_of
            )
        except StaticsError as error:
            remarks[f"no factor of buckling: {error}"] = None
            continue
        if clause:
            remarks[f"buckling is {clause}"] = None
        if factor is not None:
            factors[name] = factor
    case = min(factors, key=lambda name: factors[name], default="")
    return factors.get(case), case, tuple(remarks)


def _most_compressed(statics: CutStatics) -> list[str]:
    model = statics.model

    def compression(name: str) -> float:
        answer = statics.answers[name]
        sigma = stress(model.surface, model.material, answer.u, model.law, answer.bubbles)
        return float(-np.linalg.eigvalsh(sigma)[:, 0].clip(max=0) @ model.surface.areas)

    names = statics.preset.judged_in("ULS", statics.answers)
    return sorted(names, key=compression, reverse=True)[:BUCKLED_CASES] if len(names) > BUCKLED_CASES else names


def _reactions(statics: CutStatics) -> tuple[SupportForce, ...]:
    preset, surface = statics.preset, statics.design.surface
    supports = acting_on(preset, surface).support
    shares = support_shares(supports, surface, statics.design.sheet)
    up = statics.up
    along, across = (axis for axis in (0, 1, 2) if axis != up)
    rows = []
    for support, share in zip(support_names(supports), shares, strict=True):
        for case, answer in statics.answers.items():
            forces = answer.reaction * share
            R = forces.sum(axis=0)
            level, direction = np.hypot(R[along], R[across]), np.degrees(np.arctan2(R[across], R[along]))
            thrust = np.hypot(forces[:, along], forces[:, across]).sum()
            rows.append(SupportForce(support, case, *(float(x) for x in (R[up], level, direction, thrust))))
    return tuple(rows)


def _vertical_forces(statics: CutStatics) -> tuple[list[str], dict[str, Floats]]:
    """Return the support of each connected place, and the vertical forces (p,), N, of the places by case."""
    supports, sheet = acting_on(statics.preset, statics.design.surface).support, statics.design.sheet
    shares = support_shares(supports, statics.design.surface, sheet)
    names, cases = list[str](), {**statics.answers, **statics.lifting}
    forces: dict[str, list[Floats]] = {case: [] for case in cases}
    ends = sheet.surface.edges.ends
    for support, share in zip(support_names(supports), shares, strict=True):
        vertices = np.flatnonzero(share.any(axis=1))
        place = link_components(sheet.surface.n, *ends[share.any(axis=1)[ends].all(axis=1)].T)[1][vertices]
        place = np.unique(place, return_inverse=True)[1]
        names += [support] * (int(place.max(initial=-1)) + 1)
        for case, answer in cases.items():
            forces[case].append(np.asarray(np.bincount(place, (answer.reaction * share)[vertices, statics.up]), float))
    return names, {case: np.concatenate(parts) for case, parts in forces.items()}


def support_shares(supports: Iterable[Support], surface: Surface, sheet: Sheet) -> Floats:
    """Return the part of the reaction that belongs to each support, 0 to 1, as (s, n', 3)."""
    marks = np.array([_held_directions(support, surface, sheet) for support in supports])
    return np.asarray(marks / np.maximum(marks.sum(axis=0), 1))


def _held_directions(support: Support, surface: Surface, sheet: Sheet) -> Bools:
    springs = sheet.vertices_between(surface, support.springs(surface) > 0)
    return sheet.vertices_between(surface, support.fixed_directions(surface), support.fixed_edges(surface)) | springs
