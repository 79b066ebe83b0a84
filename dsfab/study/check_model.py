"""A design as a model for CalculiX, with our own answer beside it: what a user needs to check us."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.export.calculix import CalculixModel, Element
from dsfab.pipeline import Design, Log, Progress, acting_on, sheet_load, surface_step
from dsfab.pipeline.loadings import Loading, loadings
from dsfab.pipeline.structure import check_scale
from dsfab.preset import Preset
from dsfab.slicing import Sheet
from dsfab.statics import Equilibrium, SheetModel, SpreadLoad, elements_of, flat_axis, solve_cases
from dsfab.statics.supports import all_clamped
from dsfab.study.finite_elements import axes_of_file, nodal_forces, six_node_model
from dsfab.study.verdict import BUDGET, LoadedSurface, mode_intervals, whole_sheet
from dsfab.study.verdict.rules import ModeEstimate
from dsfab.surface import LoadCase, Surface, support_names
from dsfab.wording import bounded

UNRELIABLE = (
    "S6 shells are unreliable on cut curved sheets: CalculiX may refuse the file or answer far too soft; check the "
    "uncut sheet instead, or a sheet that is flat and loaded in its plane"
)


LOADS = {
    "uncut": "Loads are those of the uncut sheet, with its whole weight; the cut sheet weighs less",
    "cut": "Loads are those of the cut sheet: its own weight, and what lies on coverings at the material nearest to it",
}
"""Which loads a model has."""

ROUNDING = 1e-9
"""Components under this share of the largest are shown as zero."""


@dataclass(frozen=True, eq=False)
class CheckModel:
    """A model, the surface it was made of, and our own answers to its steps with the elements for verdicts."""

    model: CalculixModel
    surface: Surface
    answers: Mapping[str, Equilibrium]
    warnings: tuple[str, ...]


def uncut_model(preset: Preset, progress: Progress | None = None) -> CheckModel:
    """The whole surface of a preset, a step for each case and combination: S6 shells, or CPS6 if it is flat and loaded
    in its plane.

    Raises DsfabError for a preset that cannot be solved.
    """
    log = Log(progress)
    surface = surface_step(preset, log)
    check_scale(preset, surface, log)
    acting = [loading for loading in loadings(preset, surface) if loading.name]
    held = {f"SUPPORT_{k}": support.fixed(surface) for k, support in enumerate(acting_on(preset, surface).support, 1)}
    setting = LoadedSurface(surface, preset.statics.sheet(), {one.name: one.load for one in acting})
    modes = _modes(preset, setting, whole_sheet(surface), progress)
    return _checked(preset, surface, acting, held, "uncut", progress, modes)


def cut_model(design: Design, progress: Progress | None = None) -> CheckModel:
    """The cut sheet of a design, with the loads of the uncut surface handed over to its vertices (`sheet_load`)."""
    sheet, preset = design.sheet, design.preset
    nothing = SpreadLoad.on(sheet.surface)  # what was spread has been handed to the vertices
    acting = [
        Loading(name, sheet_load(design.surface, sheet, case.load), nothing, case.factors)
        for name, case in design.statics.cases.items()
    ]
    surface, supports = design.surface, acting_on(preset, design.surface).support
    fixed = (sheet.between(surface, one.fixed(surface), one.fixed_edges(surface)) for one in supports)
    held = {f"SUPPORT_{k}": of for k, of in enumerate(fixed, 1)}
    modes = _modes(preset, LoadedSurface.of(design), design.slicing.cells.kept(), progress)
    return _checked(preset, sheet.surface, acting, held, "cut", progress, modes)


def _modes(preset: Preset, setting: LoadedSurface, material: Sheet, progress: Progress | None) -> list[str]:
    """What [statics] asks of buckling and vibration, with its bound; nothing where it does not ask."""
    if not (ask := preset.statics.ask).modes:
        return []
    found = mode_intervals(setting, material, ask, BUDGET, progress)
    told = [f"Lowest factor of linear buckling, {name}: {_plain(one)}" for name, one in found.buckling.items()]
    told += [f"Lowest natural frequency: {_plain(found.hertz, 'Hz')}"] if found.hertz else []
    if told:
        assumed = f"; {found.assumed}" if found.assumed else ""
        told.append(f"Both are of {len(found.levels)} meshes, extrapolated{assumed}: no step of this file finds them")
    return [*told, *found.refusals]


def _plain(found: ModeEstimate, unit: str = "") -> str:
    return bounded(found.value, found.known, unit).replace("±", "+-")


def _checked(
    preset: Preset,
    surface: Surface,
    acting: Sequence[Loading],
    held: Mapping[str, Bools],
    kind: str,
    progress: Progress | None,
    modes: Sequence[str] = (),
) -> CheckModel:
    cases = {loading.name: loading.load for loading in acting if loading.factors is None}
    load, axis = acting[0].load, flat_axis(surface, *cases.values())
    element: Element = "S6" if axis is None else "CPS6"
    warnings = (UNRELIABLE,) if kind == "cut" and element == "S6" and not surface.is_flat else ()
    if progress:
        progress("check", f"solving {surface.m:,} triangles with {elements_of('six_nodes')}")
    answers = _answers(preset, surface, acting, cases)
    steps = {loading.name: nodal_forces(surface, loading.load.force, loading.spread) for loading in acting}
    across = 2 if axis is None else axis
    sheet = preset.statics
    holding = {name: fixed for name, fixed in held.items() if fixed.any()}
    held_sheet = SheetModel(surface, sheet.elastic, sheet.thickness, clamped=all_clamped(load))
    model = six_node_model(held_sheet, holding, steps, load.spring, element, across)
    turn = axes_of_file(across)
    stored = {name: (a.compliance - float(np.sum(load.spring * a.u**2))) / 2 for name, a in answers.items()}
    rigid = {name: np.where(load.fixed, answer.reaction, 0.0)[:, turn] for name, answer in answers.items()}
    notes = (
        *(f"WARNING: {text}" for text in warnings),
        f"The {kind} sheet, {sheet.thickness:g} m thick, solved in plane stress",
        LOADS[kind],
        *model.notes,
        *_on_supports(preset, model),
        *(
            line
            for name, answer in answers.items()
            for line in _expected(name, model, answer.u[:, turn], rigid[name], stored[name])
        ),
        *modes,
        "Reactions are as CalculiX prints them: forces of its rigid supports together with the loads on their nodes",
        "Where the two differ by more than you accept, refine the mesh (surface.refine, surface.edge)",
    )
    return CheckModel(replace(model, name=preset.name, notes=notes), surface, answers, warnings)


def _answers(
    preset: Preset, surface: Surface, acting: Sequence[Loading], cases: Mapping[str, LoadCase]
) -> dict[str, Equilibrium]:
    """Ours, with the elements whose displacements are those of six-node triangles."""
    spreads = {loading.name: loading.spread for loading in acting if loading.name in cases}
    sums = {loading.name: loading.factors for loading in acting if loading.factors is not None}
    sheet, pair = preset.statics, elements_of("six_nodes")
    return solve_cases(
        SheetModel(surface, sheet.elastic, sheet.thickness), cases, pair, spreads=spreads, combinations=sums
    )


def _on_supports(preset: Preset, model: CalculixModel) -> Iterator[str]:
    names = support_names(preset.surface.support)
    for k, (name, support) in enumerate(zip(names, preset.surface.support, strict=True), 1):
        if (held := model.supports.get(f"SUPPORT_{k}")) is not None:
            called = f" ({name})" if support.name else ""
            yield f"SUPPORT_{k}{called} holds {support.hold} at {int(held.any(axis=1).sum())} nodes"
        if support.spring:
            yield f"{name} stands on springs of {_vector(np.array(support.spring))} N/m in all"
        if support.clamp:
            yield f"{name} is clamped: its edges do not turn"


def _expected(name: str, model: CalculixModel, u: Floats, reaction: Floats, energy: float) -> Iterator[str]:
    """What CalculiX should find in one step, from our displacements and reactions (n, 3) in the file's axes."""
    force, node = model.steps[name], int(np.linalg.norm(u, axis=1).argmax())
    pair = elements_of("six_nodes")
    yield f"{name}: {_vector(force.sum(axis=0))} N in all. With {pair} elements on the same triangles dsfab finds"
    yield f"  largest displacement {np.linalg.norm(u[node]):.6g} m of a corner, node {node + 1}, {_vector(u[node])} m"
    yield f"  internal energy {energy:.6g} J of the sheet, half of the compliance without that of springs"
    for support, held in model.supports.items():
        members: Bools = np.asarray(held.any(axis=1))
        printed = reaction[members[: len(u)]].sum(axis=0) + force[members].sum(axis=0)
        yield f"  reaction {_vector(printed)} N of {support}"


def _vector(values: Floats) -> str:
    """Three numbers, without those that are rounding."""
    kept = np.where(np.abs(values) > ROUNDING * np.abs(values).max(), values, 0.0)
    return "(" + ", ".join(f"{value:.6g}" for value in kept.tolist()) + ")"
